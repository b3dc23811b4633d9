"""The motion processor: samples, paths and a shutter to a picture with motion blur (1983, section 4.2).

Every sample has a path: that of the camera and of its object's transform, or the one that the vector
pass tells. What stands still is a background; what moves lies before it as sheets of samples, is seen at
as many instants as its path has pixels, and hides and is hidden at each of them.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from .bands import check_motion
from .lens import FloatArray
from .motion_psf import ExposedPath, path_of
from .paths import CameraPath, MotionPaths, ObjectPath
from .samples import Float32Array, SampleLayer, Samples
from .scatter import Backend
from .sheets import (
    Sheet,
    background_of,
    corners_averaged,
    covered_movers,
    cut_out_movers,
    fill_in,
    inverse_depth,
    join,
    rendered_movers,
    whole_sheet,
)
from .shutter import Shutter
from .time_depth import MovingObject, meeting, merge
from .tracks import Mask, assign_tracks, sample_origin
from .warp import (
    NO_QUAD,
    NO_TRACK,
    VECTOR_TRACK,
    Background,
    Schedule,
    Sheets,
    expose,
    instant,
    outlook,
    places,
)

MotionModel = Literal["auto", "object", "vector"]
"""``object`` gives each object one path (1983), ``vector`` each sample its own, ``auto`` what is needed."""

Hidden = Literal["none", "rendered", "filled"]
"""Where what moving objects hide comes from."""

MOTION_MODELS: Final[tuple[MotionModel, ...]] = get_args(MotionModel)

_STILL: Final = 0.02
"""Pixels over the whole exposure below which a sample counts as at rest; vectors have rounding noise."""

_PROBES: Final = 9
"""Instants at which paths are looked at to learn how long they are and what tears."""

_LEAST_INSTANTS: Final = 8
_MOST_INSTANTS: Final = 2048

_SLIT_GRID: Final = 257
"""Times at which the tracks' matrices are tabulated for a travelling slit."""

_LEAST_SIDE: Final = 2

_LEAST_OPENING: Final = 1e-3
"""Least opening of a between-the-lens shutter over the full one."""

_PATH_STEPS: Final = 128
"""Pieces in which the path of an object is followed over the shutter's interval."""

_DEPTH_KEPT: Final = 0.02
"""Change of an object's inverse depth, as a share of it, up to which one depth will do for it."""

_MOST_OBJECTS: Final = 64
"""Objects above which each sample is given its own path: many small ones cost more one by one."""

_ALIKE: Final = 0.1
"""Pixels by which samples may leave their object's one path before each is given its own."""

_MOSTLY: Final = 0.5
"""Share of the picture that moves from which all of it is one sheet rather than a background with movers."""


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Everything that the motion processor needs beside the samples.

    Parameters
    ----------
    shutter : Shutter
        The exposure.
    model : {"auto", "object", "vector"}
        Whether an object's samples share a path.
    backend : {"auto", "numba", "numpy"}
        Implementation; all give the same picture.
    max_memory : int or None
        Bytes that the process may have in all.
    """

    shutter: Shutter
    model: MotionModel = "auto"
    backend: Backend = "auto"
    max_memory: int | None = None


@dataclass(frozen=True, slots=True)
class MotionReport:
    """What the motion processor did to a layer, for reports and tests.

    Parameters
    ----------
    layer : str
        Name of the layer.
    moving : float
        Share of the samples that move.
    longest_path_px : float
        Length of the longest path in final pixels.
    instants : int
        Number of instants that were averaged; 0 where nothing moves.
    hidden : {"none", "rendered", "filled"}
        Where what moving objects hide came from.
    guessed : float
        Share of the picture's light that was filled in.
    object_paths, sample_paths : int
        Number of objects whose samples share one path, and of those whose samples have their own.
    """

    layer: str
    moving: float = 0.0
    longest_path_px: float = 0.0
    instants: int = 0
    hidden: Hidden = "none"
    guessed: float = 0.0
    object_paths: int = 0
    sample_paths: int = 0


@dataclass(frozen=True, slots=True)
class Motion:
    """A layer made ready to be seen at instants.

    Parameters
    ----------
    sheets : Sheets
        What moves.
    background : Background or None
        What stands still, on the display window.
    samples : Samples
        The file that the layer belongs to.
    settings : MotionSettings
        The exposure.
    paths : tuple of ObjectPath or None
        The tracks' objects.
    surface : ndarray of int32 of shape (sheets, rows, columns)
        Which object each sample belongs to.
    travel : ndarray of float32 of shape (sheets, rows, columns)
        Length of each sample's path in pixels of the samples.
    moving : float
        Share of the samples that move.
    hidden : {"none", "rendered", "filled"}
        Where what moving objects hide comes from.
    """

    sheets: Sheets
    background: Background | None
    samples: Samples
    settings: MotionSettings
    paths: tuple[ObjectPath | None, ...]
    surface: npt.NDArray[np.int32]
    travel: Float32Array
    moving: float
    hidden: Hidden

    @property
    def longest(self) -> float:
        """Length of the longest path in pixels of the samples."""
        return float(self.travel.max(initial=0.0))

    def schedule(self, instants: int, first: float = 0.0, last: float = 1.0) -> Schedule:
        """Return instants with equal shares of the light that comes in between two shares of all of it."""
        shares = first + (last - first) * (np.arange(instants) + 0.5) / instants
        return _schedule(self.samples, self.settings.shutter, self.paths, shares)

    def opening(self, share: float) -> float:
        """Return the aperture's radius over its full one once a share of the light is in; at least 0.001."""
        shutter = self.settings.shutter
        return max(float(shutter.opening(shutter.times(share))), _LEAST_OPENING)


def prepare(layer: SampleLayer, samples: Samples, settings: MotionSettings) -> Motion | None:
    """Find what moves in a layer, what it hides, and where surfaces part.

    Parameters
    ----------
    layer : SampleLayer
        The samples.
    samples : Samples
        The file that they belong to.
    settings : MotionSettings
        The exposure.

    Returns
    -------
    Motion or None
        ``None`` where nothing moves while the shutter is open.

    Raises
    ------
    MemoryLimitError
        If there is no room for it; a picture is taken as a whole.
    """
    tracks = assign_tracks(layer, samples)
    # A single row or column of samples has nothing between them to draw.
    if tracks is None or min(layer.color.shape[:2]) < _LEAST_SIDE:
        return None
    probe = _Probe(samples, settings, tracks.paths)
    sheet = whole_sheet(layer, tracks)
    moves, travel = probe.moves(sheet)
    moving = float(moves.mean())
    if moving > 0.0 or layer.moving is not None:
        check_motion(moves.size, settings.max_memory, views=layer.moving is not None)
    if layer.stationary is not None and layer.moving is not None and samples.paths is not None:
        alone = assign_tracks(layer.moving, samples, all_move=True)
        if alone is not None and layer.moving.depth is not None:
            world = replace(tracks, track=np.zeros_like(tracks.track))
            views = rendered_movers(layer.moving, alone), whole_sheet(layer.stationary, world)
            return _from_views(probe, layer, *views, moving)
    if not moves.any():
        return None
    if np.count_nonzero(moves) > _MOSTLY * samples.display_window.rows * samples.display_window.columns:
        return probe.motion([sheet], None, travel[np.newaxis], moving, "filled")
    # Each of these is as large as the picture: none stays longer than it is needed.
    del sheet
    travel = np.where(moves, travel, np.float32(0.0))[np.newaxis]
    movers, color, depth, guessed = cut_out_movers(layer, tracks, moves)
    del tracks, moves
    if layer.absent is not None and layer.absent.depth is not None:
        # What is behind is known, and not only guessed.
        color = np.where((guessed > 0.0)[..., np.newaxis], layer.absent.color, color)
        depth = np.where(guessed > 0.0, inverse_depth(layer.absent), depth)
        guessed = np.zeros_like(guessed)
    background = background_of(samples, color, depth, guessed)
    del color, depth, guessed
    sheets = [movers]
    del movers
    return probe.motion(sheets, background, travel, moving, "filled")


def _from_views(
    probe: _Probe, layer: SampleLayer, movers: Sheet, world: Sheet, moving: float
) -> Motion | None:
    """Return a layer whose moving objects and what they hide were rendered apart, None where all rests."""
    assert layer.moving is not None
    mover_moves, mover_travel = probe.moves(movers)
    world_moves, world_travel = probe.moves(world)
    if not (world_moves.any() or mover_moves.any()):
        return None
    sheets, travel = [movers], [mover_travel]
    behind = covered_movers(movers)
    if behind is not None:
        sheets.append(behind)
        travel.append(probe.moves(behind)[1])
    if world_moves.any():
        return probe.motion([world, *sheets], None, np.stack([world_travel, *travel]), moving, "rendered")
    # Where no mover is seen the ordinary picture is kept to the bit.
    color = np.where(layer.moving.color[..., 3:] > 0.0, world.color, layer.color)
    background = background_of(probe.samples, color, world.inverse_depth, world.guessed)
    return probe.motion(sheets, background, np.stack(travel), moving, "rendered")


def expose_layer(
    motion: Motion, layer: SampleLayer
) -> Generator[float, None, tuple[Float32Array, Float32Array, MotionReport]]:
    """Blur a layer of pinhole samples by their motion.

    Parameters
    ----------
    motion : Motion
        The layer made ready.
    layer : SampleLayer
        The layer.

    Yields
    ------
    float
        Share of the work done, rising to 1.

    Returns
    -------
    picture : ndarray of float32 of shape (rows, columns, 4)
        The display window, premultiplied. What never changes is the input, to the bit.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that was filled in.
    report : MotionReport
        What was done.
    """
    display = motion.samples.display_window
    picture = np.zeros((display.rows, display.columns, 4), dtype=np.float32)
    guessed = np.zeros((display.rows, display.columns), dtype=np.float32)
    objects, together, rest = _by_object(motion)
    count = instants_for(motion.longest)
    report = replace(
        report_of(motion, layer, count, guessed), object_paths=len(objects), sample_paths=_surface_count(rest)
    )
    background, samples, settings = motion.background, motion.samples, motion.settings
    others = bool(rest.sheets.quads.any())
    if others or not objects:
        steps = expose(rest.sheets, motion.schedule(count), background, picture, guessed, settings.backend)
        for done in steps:
            yield done * (0.5 if objects else 1.0)
    # What takes most of the memory goes before objects are laid over it.
    del motion, rest
    if background is None and (others or not objects):
        _complete(samples, picture, guessed)
    elif not others and objects and background is not None:
        picture[:] = background.color
        guessed[:] = background.guessed
    if objects:
        bins = count if together else 1
        for done in merge(objects, background, bins, picture, guessed):
            yield 0.5 + 0.5 * done
        if not others:
            report = replace(report, instants=bins)
    return picture, guessed, replace(report, guessed=float(guessed.mean()))


def _surface_count(motion: Motion) -> int:
    """Return of how many objects there are samples."""
    found = motion.surface[motion.sheets.track != NO_TRACK]
    # Most samples' neighbours are of the same one, and need not be sorted.
    begins = np.flatnonzero(found[1:] != found[:-1]) + 1
    return int(np.unique(found[np.r_[0, begins]]).size) if found.size else 0


def expose_part(
    motion: Motion, instants: int, part: tuple[float, float], filler: Float32Array | None = None
) -> tuple[Float32Array, Float32Array]:
    """Return what is seen during a part of the exposure, on average.

    Parameters
    ----------
    motion : Motion
        The layer made ready.
    instants : int
        Number of instants that are averaged.
    part : (float, float)
        First and last share of the exposure's light.
    filler : ndarray of float32 of shape (rows, columns, 4), optional
        What is taken where nothing is seen; by default what is seen around it.

    Returns
    -------
    picture : ndarray of float32 of shape (rows, columns, 4)
        The display window, premultiplied.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that was filled in.
    """
    display = motion.samples.display_window
    picture = np.zeros((display.rows, display.columns, 4), dtype=np.float32)
    guessed = np.zeros((display.rows, display.columns), dtype=np.float32)
    schedule = motion.schedule(instants, *part)
    for _ in expose(motion.sheets, schedule, motion.background, picture, guessed, motion.settings.backend):
        pass
    if motion.background is None:
        _complete(motion.samples, picture, guessed, filler)
    return picture, guessed


def _complete(
    samples: Samples, picture: Float32Array, guessed: Float32Array, filler: Float32Array | None = None
) -> None:
    """Fill in what no sample was seen at, and leave empty what the file has no data for."""
    there = _has_data(samples)
    # What is known of a surface is a guess too, but it is seen.
    unseen = there & (guessed >= 1.0) & (picture[..., 3] <= 0.0)
    if unseen.any():
        if filler is None:
            fill_in(picture, there & ~unseen, unseen)
        else:
            picture[unseen] = filler[unseen]
    # Beyond its data a file is empty: what was not seen there at an instant was nothing.
    picture[~there] *= (1.0 - guessed[~there])[:, np.newaxis]
    guessed[~there] = 0.0


def _has_data(samples: Samples) -> Mask:
    """Return which pixels of the display window the file has samples for."""
    display = samples.display_window
    there = np.zeros((display.rows, display.columns), dtype=bool)
    there[samples.data_window.intersection(display).within(display)] = True
    return there


def instant_layer(
    motion: Motion, layer: SampleLayer, schedule: Schedule, n: int
) -> tuple[SampleLayer, Float32Array]:
    """Return a layer as if it had been rendered at an instant, on the display window.

    Parameters
    ----------
    motion : Motion
        The layer made ready.
    layer : SampleLayer
        The layer.
    schedule : Schedule
        From `Motion.schedule`.
    n : int
        Which instant.

    Returns
    -------
    layer : SampleLayer
        Colour and depth at pixel centres.
    guessed : ndarray of float32 of shape (rows, columns)
        Share of each pixel's light that was filled in.
    """
    display = motion.samples.display_window
    color, iz, guessed = instant(
        motion.sheets,
        schedule,
        n,
        motion.background,
        (display.rows, display.columns),
        motion.settings.backend,
    )
    there = _has_data(motion.samples)
    nothing = (iz < 0.0) & there
    if nothing.any() and not nothing.all():
        _, nearest = ndimage.distance_transform_edt((iz < 0.0), return_indices=True)
        color = np.where(nothing[..., np.newaxis], color[tuple(nearest)], color)
        iz = np.where(nothing, iz[tuple(nearest)], iz)
        guessed = np.where(nothing, np.float32(1.0), guessed)
    with np.errstate(divide="ignore"):
        depth = np.asarray(1.0 / np.maximum(iz, 0.0), dtype=np.float32)
    return SampleLayer(layer.name, color, depth), guessed


def report_of(motion: Motion, layer: SampleLayer, instants: int, guessed: Float32Array) -> MotionReport:
    """Return the report on a layer."""
    return MotionReport(
        layer=layer.name,
        moving=motion.moving,
        longest_path_px=motion.longest / motion.samples.supersampling,
        instants=instants,
        hidden=motion.hidden,
        guessed=float(guessed.mean()),
    )


def instants_for(length: float) -> int:
    """Return how many instants a path of a length in pixels needs: one for each of its pixels."""
    return max(math.ceil(min(_MOST_INSTANTS, length)), _LEAST_INSTANTS)


def _by_object(motion: Motion) -> tuple[list[MovingObject], bool, Motion]:
    """Return the objects that are given one path, whether they may meet, and the rest of the layer.

    An object needs no more than one path where its samples move alike, on a film that is exposed at once,
    over a background at rest, and it meets no other.
    """
    none: list[MovingObject] = []
    slit = motion.settings.shutter.slit is not None
    auto = motion.settings.model == "auto"
    if motion.settings.model == "vector" or (auto and (slit or motion.background is None)):
        return none, False, motion
    parts = _parts(motion)
    if not parts or (auto and len(parts) > _MOST_OBJECTS):
        return none, False, motion
    means = [_mean_sample(motion, part) for part in parts]
    paths = [_path_of_mean(motion, part, mean) for part, mean in zip(parts, means, strict=True)]
    alike, low, high = _swept(motion, parts)
    for k, (path, _) in enumerate(paths):
        # Between two instants that were looked at, and for all samples of an object given one path.
        mean = means[k][:2]
        first, last = path.segments.min(axis=(0, 1)) + mean, path.segments.max(axis=(0, 1)) + mean
        half = 0.5 * np.array([parts[k].mask.shape[1], parts[k].mask.shape[0]])
        low[k], high[k] = np.minimum(low[k], first - half), np.maximum(high[k], last + half)
        # Its one depth in the time-and-depth buffer would not do.
        alike[k] &= float(np.ptp(paths[k][1])) <= _DEPTH_KEPT
    meets = meeting(low, high)
    chosen = np.flatnonzero(~meets & alike) if auto else np.arange(len(parts))
    objects = []
    track, quads = motion.sheets.track.copy(), motion.sheets.quads.copy()
    around = motion.samples.data_window
    display = motion.samples.display_window
    for n in chosen:
        part = parts[n]
        color = motion.sheets.color[0, part.sheet][part.window] * part.mask[..., np.newaxis]
        iz = motion.sheets.inverse_depth[part.sheet][part.window]
        picture = np.dstack([color, color[..., 3] * iz]).astype(np.float32)
        if motion.samples.position == "corner":
            picture = corners_averaged(np.pad(picture, ((1, 1), (1, 1), (0, 0))))
        inset = 1 if motion.samples.position == "corner" else 0
        row = around.y0 - display.y0 + part.window[0].start - inset
        column = around.x0 - display.x0 + part.window[1].start - inset
        objects.append(MovingObject(picture, row, column, *paths[n]))
        track[part.sheet][part.window][part.mask] = NO_TRACK
    for s in range(track.shape[0]):
        left = track[s] != NO_TRACK
        quads[s][~(left[:-1, :-1] & left[1:, :-1] & left[:-1, 1:] & left[1:, 1:])] = NO_QUAD
    rest = replace(motion, sheets=motion.sheets._replace(track=track, quads=quads))
    return objects, bool(meets[chosen].any()), rest


@dataclass(frozen=True, slots=True)
class _Part:
    """The samples of one object: which sheet, which part of it, and which samples there."""

    sheet: int
    window: tuple[slice, slice]
    mask: Mask


def _parts(motion: Motion) -> list[_Part]:
    """Return the objects that the sheets show."""
    parts: list[_Part] = []
    for s in range(motion.sheets.track.shape[0]):
        there = motion.sheets.track[s] != NO_TRACK
        if not there.any():
            continue
        labels = np.zeros(there.shape, dtype=np.int64)
        labels[there] = 1 + np.unique(motion.surface[s][there], return_inverse=True)[1].reshape(-1)
        parts.extend(
            _Part(s, window, labels[window] == number)
            for number, window in enumerate(ndimage.find_objects(labels), start=1)
        )
    return parts


def _mean_sample(motion: Motion, part: _Part) -> FloatArray:
    """Return x, y and inverse depth of the middle of an object's samples, weighed by their alpha."""
    weight = np.where(part.mask, motion.sheets.color[0, part.sheet][part.window][..., 3], 0.0)
    weight = weight if weight.any() else part.mask.astype(np.float32)
    x, y = np.moveaxis(_rest(motion.sheets)[part.window], -1, 0)
    values = (x, y, motion.sheets.inverse_depth[part.sheet][part.window].astype(np.float64))
    return np.array([np.average(value, weights=weight) for value in values])


def _path_of_mean(motion: Motion, part: _Part, mean: FloatArray) -> tuple[ExposedPath, FloatArray]:
    """Return the path of the middle of an object's samples, and its inverse depth over the first."""
    sheets, shutter = motion.sheets, motion.settings.shutter
    display = motion.samples.display_window
    positions = np.linspace(0.0, 1.0, _PATH_STEPS + 1)
    times = shutter.frame_times(positions, _along(shutter, mean[0] / display.columns, mean[1] / display.rows))
    track = int(sheets.track[part.sheet][part.window][part.mask][0])
    if track == VECTOR_TRACK:
        velocity, acceleration = (
            field[part.sheet][part.window][part.mask].mean(axis=0, dtype=np.float64)
            for field in (sheets.velocity, sheets.acceleration)
        )
        places = times[:, np.newaxis] * (velocity + times[:, np.newaxis] * acceleration)
        ratio = np.ones(times.size)
    else:
        world = motion.samples.paths
        assert world is not None
        h = world.reprojection(motion.paths[track], times) @ np.array([mean[0], mean[1], 1.0, mean[2]])
        w = np.maximum(h[:, 2:], 1e-6)
        places, ratio = h[:, :2] / w - mean[:2], 1.0 / w[:, 0]
    lit = shutter.times((np.arange(_PATH_STEPS) + 0.5) / _PATH_STEPS)
    return path_of(shutter, positions, places), np.interp(lit, positions, ratio)


def _swept(motion: Motion, parts: list[_Part]) -> tuple[Mask, FloatArray, FloatArray]:
    """Look where objects go.

    Returns
    -------
    alike : ndarray of bool of shape (objects,)
        Whether an object's samples have one path, to a tenth of a pixel.
    low, high : ndarray of float64 of shape (objects, 2)
        Corners of the rectangles that they pass over.
    """
    rest = _rest(motion.sheets)
    schedule = motion.schedule(_PROBES)
    alike = np.ones(len(parts), dtype=bool)
    low, high = np.full((len(parts), 2), np.inf), np.full((len(parts), 2), -np.inf)
    for n in range(_PROBES):
        now = places(motion.sheets, schedule, n, motion.settings.backend)[..., :2]
        for k, part in enumerate(parts):
            at = now[part.sheet][part.window][part.mask]
            alike[k] &= bool((np.ptp(at - rest[part.window][part.mask], axis=0) <= 2.0 * _ALIKE).all())
            low[k], high[k] = np.minimum(low[k], at.min(axis=0)), np.maximum(high[k], at.max(axis=0))
    return alike, low, high


def _along(shutter: Shutter, x: float, y: float) -> float:
    """Return how far along its way a slit passes a place, given as shares of the picture."""
    edge = "top" if shutter.slit is None else shutter.slit.edge
    return {"top": y, "bottom": 1.0 - y, "left": x, "right": 1.0 - x}[edge]


class _Probe:
    """Looks at sheets at a few instants of the exposure."""

    def __init__(
        self, samples: Samples, settings: MotionSettings, paths: tuple[ObjectPath | None, ...]
    ) -> None:
        self.samples = samples
        self._settings = settings
        self._paths = paths
        self._schedule = _schedule(samples, settings.shutter, paths, np.linspace(0.0, 1.0, _PROBES))

    def moves(self, sheet: Sheet) -> tuple[Mask, Float32Array]:
        """Return which samples move, and how long each one's path is in pixels."""
        found = outlook(self._stack([sheet]), self._schedule, self._settings.backend)
        return np.maximum(found.length, found.farthest)[0] > _STILL, found.length[0]

    def motion(
        self,
        sheets: list[Sheet],
        background: Background | None,
        travel: Float32Array,
        moving: float,
        hidden: Hidden,
    ) -> Motion:
        """Return the layer with its sheets joined; the list of them is empty then, to free their memory."""
        stacked = self._stack(sheets)
        found = outlook(stacked, self._schedule, self._settings.backend)
        quads = np.empty(stacked.quads.shape, dtype=np.uint8)
        color = np.empty((2, *stacked.color.shape[1:]), dtype=np.float32)
        color[0] = stacked.color[0]
        stacked = stacked._replace(quads=quads, color=color)
        sheets[:] = [replace(sheet, color=color[0, s]) for s, sheet in enumerate(sheets)]
        for s, sheet in enumerate(sheets):
            quads[s], color[1, s] = join(
                sheet, found.right[s], found.down[s], before_something=s > 0 or background is not None
            )
        surface = _stacked([sheet.surface for sheet in sheets])
        sheets.clear()
        return Motion(
            stacked, background, self.samples, self._settings, self._paths, surface, travel, moving, hidden
        )

    def _stack(self, sheets: list[Sheet]) -> Sheets:
        shape = (len(sheets), *sheets[0].tracks.track.shape)
        return Sheets(
            color=_stacked([sheet.color for sheet in sheets])[np.newaxis],
            inverse_depth=_stacked([sheet.inverse_depth for sheet in sheets]),
            track=_stacked([sheet.tracks.track for sheet in sheets]),
            velocity=_stacked([sheet.tracks.velocity for sheet in sheets]),
            acceleration=_stacked([sheet.tracks.acceleration for sheet in sheets]),
            guessed=_stacked([sheet.guessed for sheet in sheets]),
            quads=np.zeros((shape[0], shape[1] - 1, shape[2] - 1), dtype=np.uint8),
            origin_x=sample_origin(self.samples)[0],
            origin_y=sample_origin(self.samples)[1],
        )


def _stacked(arrays: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Return arrays as one, which the kernels read as a flat one; a single one is not copied."""
    stacked = arrays[0][np.newaxis] if len(arrays) == 1 else np.stack(arrays)
    # Another kind of array would have all kernels compiled again.
    return np.require(stacked, requirements=["C_CONTIGUOUS", "WRITEABLE"])


def _rest(sheets: Sheets) -> FloatArray:
    """Return where samples were rendered, (rows, columns, 2)."""
    rows, columns = sheets.track.shape[1:]
    x, y = np.meshgrid(sheets.origin_x + np.arange(columns), sheets.origin_y + np.arange(rows))
    return np.stack([x, y], axis=2)


def _schedule(
    samples: Samples, shutter: Shutter, paths: tuple[ObjectPath | None, ...], shares: FloatArray
) -> Schedule:
    """Return the instants at which shares of the light have come in, and the tracks' matrices then."""
    still = CameraPath(np.zeros(1), np.eye(3, 4)[np.newaxis])
    world = samples.paths or MotionPaths(still)
    positions = shutter.times(shares)
    times = shutter.frame_times(positions)
    slit = shutter.slit
    if slit is None or slit.width == 1.0 or shutter.length == 0.0:
        matrices = np.stack([world.reprojection(path, times) for path in paths])
        return Schedule(times, np.ascontiguousarray(matrices))
    begin, end = shutter.interval
    display = samples.display_window
    axis = 0 if slit.edge in ("left", "right") else 1
    size = display.columns if axis == 0 else display.rows
    rate = (end - begin) * (1.0 - slit.width) / size
    grid = np.linspace(begin, end, _SLIT_GRID)
    matrices = np.stack([world.reprojection(path, grid) for path in paths])
    return Schedule(
        times=times,
        matrices=np.ascontiguousarray(matrices),
        slit_axis=axis,
        slit_rate=rate if slit.edge in ("left", "top") else -rate,
        slit_middle=0.5 * size,
        first=begin,
        step=float(grid[1] - grid[0]),
    )
