"""Lens and motion together: parts of an exposure, blurred by their motion and then focused (1983, figure 5).

Within a part every pixel is focused by one depth, the one it has half-way. So a part has to be short where
circles of confusion differ, and may be long where all is about equally sharp.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from .focus import FocusReport, FocusSettings, focus_layer
from .lens import FloatArray, circle_of_confusion
from .motion import Motion, expose_part, instant_layer, instants_for
from .progress import scaled
from .samples import Float32Array, SampleLayer
from .shutter import Shutter
from .visibility import brightness_of_lights
from .warp import NO_QUAD, NO_TRACK, QUAD, VECTOR_TRACK, Sheets, expose

_STEP_OF_CIRCLE: Final = 0.125
"""Distance between the discs of a defocused moving sample, as a share of their diameter."""

_PARTS: Final = 8
"""Parts of an exposure in which things of different circles of confusion pass each other."""

_SHORTEST_PART: Final = 2.0
_LONGEST_PART: Final = 8.0
"""Steps of a path below which there are fewer parts, and from which there are more."""

_ONE_OF: Final = 16
"""Moving samples of which one is asked how its depth changes."""

_LEAST_RATIO: Final = 1e-3
"""Least depth over that in the frame; what comes nearer passes the camera."""


@dataclass(frozen=True, slots=True)
class Cascaded:
    """A layer with depth of field and motion blur, on the display window.

    Parameters
    ----------
    picture : ndarray of float32 of shape (rows, columns, 4)
        Premultiplied.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that was filled in, by either processor.
    doubt : ndarray of float32 of shape (rows, columns)
        See `Focused.doubt`; the motion's guesses are not in it.
    focus : FocusReport
        Of the last part.
    instants : int
        Number of instants that were averaged.
    """

    picture: Float32Array
    guessed: Float32Array
    doubt: Float32Array
    focus: FocusReport
    instants: int


def cascade(motion: Motion, layer: SampleLayer, focus: FocusSettings) -> Generator[float, None, Cascaded]:
    """Focus what is seen during each part of an exposure, and add the parts up.

    Parameters
    ----------
    motion : Motion
        The layer made ready.
    layer : SampleLayer
        The layer.
    focus : FocusSettings
        Lens, film and how to work.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    Cascaded
        The picture, and how sure it is.
    """
    samples = replace(motion.samples, data_window=motion.samples.display_window, position="center")
    instants = instants_for(_steps(motion, focus))
    # Eq. 22 divides by the weights of all samples that reach a pixel, and a blurred trace has more samples
    # than the thing that left it: without visibility each instant is focused by itself.
    wanted = _part_count(motion, focus) if focus.visibility == "aperture" else instants
    parts = parts_of(motion.settings.shutter, min(wanted, instants))
    filler = None
    if motion.background is None and len(parts) > 1:
        # What is not seen during a part may well be during another.
        filler, _ = expose_part(motion, instants_for(0.0), (0.0, 1.0))
    lights = _lights(motion, layer)
    bend = None if focus.character is None else focus.character.bend
    window = samples.display_window if bend is None else bend.picture
    rows, columns = window.rows, window.columns
    picture = np.zeros((rows, columns, 4), dtype=np.float32)
    guessed, doubt = np.zeros((2, rows, columns), dtype=np.float32)
    report, taken = None, 0
    for n, part in enumerate(parts):
        share = part[1] - part[0]
        count = max(1, math.ceil(round(instants * share, 6)))
        then, filled = _seen_during(motion, layer, part, count, filler, lights)
        if bend is not None:
            filled = bend.values(filled, samples.display_window)
        # The blades of a between-the-lens shutter stop the lens down while they open and close.
        lens = replace(focus.lens, f_stop=focus.lens.f_stop / motion.opening(0.5 * (part[0] + part[1])))
        turn = n if len(parts) >= _PARTS else None
        steps = focus_layer(then, samples, replace(focus, lens=lens), turn)
        focused = yield from scaled(steps, n / len(parts), 1.0 / len(parts))
        picture += np.float32(share) * focused.picture
        guessed += np.float32(share) * np.maximum(filled, focused.guessed)
        doubt += np.float32(share) * focused.doubt
        report, taken = focused.report, taken + count
    assert report is not None
    return Cascaded(picture, guessed, doubt, report, taken)


def parts_of(shutter: Shutter, count: int) -> list[tuple[float, float]]:
    """Divide an exposure.

    Parameters
    ----------
    shutter : Shutter
        The exposure.
    count : int
        Parts wanted.

    Returns
    -------
    list of (float, float)
        First and last share of the light of each part, `count` of equal light or a few more: none goes on
        from one opening of a multiple exposure to the next, unless there are more openings than parts.
    """
    light = [shutter.light(begin, end) for begin, end in shutter.opened()]
    light = [share for share in light if share > 0.0]
    if len(light) > count:
        light = [1.0]
    edges = [0.0]
    for share in light:
        parts = max(1, math.ceil(round(count * share, 6)))
        edges += list(edges[-1] + share * (np.arange(parts) + 1) / parts)
    return [(float(first), float(last)) for first, last in itertools.pairwise(edges)]


def _steps(motion: Motion, focus: FocusSettings) -> float:
    """Return how many steps the longest path has; discs of what is out of focus may be farther apart."""
    circles = np.abs(_circles(motion.sheets.inverse_depth, focus))
    return float((motion.travel / np.maximum(1.0, _STEP_OF_CIRCLE * circles)).max(initial=0.0))


def _part_count(motion: Motion, focus: FocusSettings) -> int:
    """Return in how many parts an exposure is focused.

    Where things pass each other during a part, one circle of confusion is taken for both: as wrong as
    their circles differ, for as much of the time as the part is long.
    """
    if motion.settings.shutter.blade_time > 0.0:
        return 2 * _PARTS
    some = np.flatnonzero(motion.sheets.track != NO_TRACK)[::_ONE_OF]
    begin, end = _depths(motion, some, 0.0), _depths(motion, some, 1.0)
    inverse_depths = [begin, end]
    if motion.background is not None:
        still = motion.background.inverse_depth
        inverse_depths.append(np.array([still.min(), still.max()], dtype=np.float64))
    circles = _circles(np.concatenate(inverse_depths), focus)
    differ = float(np.ptp(circles)) if circles.size else 0.0
    changes = float(np.abs(_circles(begin, focus) - _circles(end, focus)).max(initial=0.0))
    steps = max(_steps(motion, focus), changes)
    wanted = max(min(_PARTS, math.ceil(steps / _SHORTEST_PART)), math.ceil(steps / _LONGEST_PART))
    return max(1, min(math.ceil(differ), wanted))


def _depths(motion: Motion, which: npt.NDArray[np.int64], share: float) -> FloatArray:
    """Return inverse depths of some of the sheets' samples when a share of the light has come in."""
    sheets = motion.sheets
    _, row, column = np.unravel_index(which, sheets.track.shape)
    track = sheets.track.reshape(-1)[which]
    inverse_depth = sheets.inverse_depth.reshape(-1)[which].astype(np.float64)
    # With a slit, matrices are those of all times from the first to the last.
    matrices = motion.schedule(1, share, share).matrices
    matrix = matrices[np.maximum(track, 0), round(share * (matrices.shape[1] - 1)), 2]
    place = np.stack([sheets.origin_x + column, sheets.origin_y + row, np.ones(row.size), inverse_depth])
    ratio = np.where(track == VECTOR_TRACK, 1.0, np.einsum("nk,kn->n", matrix, place))
    return np.asarray(inverse_depth / np.maximum(ratio, _LEAST_RATIO))


def _circles(inverse_depth: npt.ArrayLike, focus: FocusSettings) -> FloatArray:
    """Return signed diameters of circles of confusion in pixels."""
    with np.errstate(divide="ignore"):
        depth = 1.0 / np.asarray(inverse_depth, dtype=np.float64)
    return circle_of_confusion(depth, focus.lens, focus.model) / focus.film.pitch_x


def _seen_during(
    motion: Motion,
    layer: SampleLayer,
    part: tuple[float, float],
    instants: int,
    filler: Float32Array | None,
    lights: Sheets | None,
) -> tuple[SampleLayer, Float32Array]:
    """Return what is seen during a part of the exposure, with its depth half-way, and what was guessed."""
    then, guessed = instant_layer(motion, layer, motion.schedule(1, *part), 0)
    if instants == 1 and filler is None:
        return then, guessed
    color, guessed = expose_part(motion, instants, part, filler)
    depth = then.depth
    if lights is not None and depth is not None:
        depth = _depth_of_lights(motion, lights, part, instants, color, depth)
    return replace(then, color=color, depth=depth), guessed


def _lights(motion: Motion, layer: SampleLayer) -> Sheets | None:
    """Return sheets of those samples alone that shine, None where none does."""
    sheets = motion.sheets
    light = sheets.color[0, ..., :3].mean(axis=3)
    light *= light > brightness_of_lights(layer.color)
    shines = light > 0.0
    corners = shines[:, :-1, :-1] | shines[:, :-1, 1:] | shines[:, 1:, :-1] | shines[:, 1:, 1:]
    quads = np.where(corners & (sheets.quads == QUAD), np.uint8(QUAD), np.uint8(NO_QUAD))
    if not quads.any():
        return None
    color = np.zeros_like(sheets.color)
    color[0, ..., 1] = light
    return sheets._replace(color=color, quads=quads, guessed=np.zeros_like(sheets.guessed))


def _depth_of_lights(
    motion: Motion,
    lights: Sheets,
    part: tuple[float, float],
    instants: int,
    picture: Float32Array,
    depth: Float32Array,
) -> Float32Array:
    """Return depths during a part, those of lights wherever a pixel has most of its light from one.

    A light that passes a pixel leaves a bright trace, whose circle of confusion one sees; half-way through
    the part the pixel may well show something else.
    """
    half = 0.5 * (part[0] + part[1])
    light = lights.color[0].reshape(-1, 4)
    shines = np.flatnonzero(light[:, 1])
    # Sums of what lights give, times their inverse depth and alone.
    light[shines, 0] = light[shines, 1] * _depths(motion, shines, half)
    sums, unseen = np.zeros_like(picture), np.zeros(picture.shape[:2], dtype=np.float32)
    for _ in expose(lights, motion.schedule(instants, *part), None, sums, unseen, motion.settings.backend):
        pass
    given = sums[..., 1] * (1.0 - unseen)
    all_of_it = picture[..., :3].mean(axis=2)
    mostly = (given > 0.5 * all_of_it) & (all_of_it > 0.5 * given)
    result = depth.copy()
    with np.errstate(divide="ignore"):
        result[mostly] = sums[..., 1][mostly] / sums[..., 0][mostly]
    return result
