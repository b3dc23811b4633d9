"""Light that is seen in mirrors and through glass, taken apart from its surfaces' own and put back.

What a mirror shows, S, is what share of light it reflects, a, times what is seen in it, S / a. The share
belongs to the mirror: it is blurred with the mirror's depth and motion, and hidden by what hides the mirror.
What is seen is blurred with its own depth and motion, normalised by the shares, so that it ends where the
mirror ends. The product is the mirror's light; without blur it is S, and all parts add up to the picture.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from .focus import FocusSettings
from .lens import circle_of_confusion
from .samples import Float32Array, SampleLayer, Window

_LEAST_WEIGHT: Final = 1e-3
"""Share of a pixel's light below which what is seen there is not known, and is that of the nearest pixel."""

_LIGHTS: Final = ("reflected", "transmitted")

_PRIMARIES: Final = 3
"""Shares that one layer's colours hold."""

_LEAST_SIDE: Final = 4

_LEAST_SPREAD: Final = 0.5
"""Pixels to each side from which one of two blurs is larger than the other."""

_LEAST_CIRCLE: Final = 0.25
"""Pixels below which circles of confusion are all alike."""

_EVEN: Final = 5
"""Side in pixels of the squares over which curvature has a mean."""

_MOST_AROUND: Final = 9
"""Side in pixels of the squares in which the largest share of light is taken."""

_MOST_STEPS: Final = 24

_MIXED: Final = 3
"""Side in pixels of the squares in which patches must be alone for a pixel to be one's alone."""

_REST: Final = 0.5
"""Of the difference between two patches, how much a mixture of them may be from what they explain."""

_STEPS_AWAY: Final = tuple(
    np.array(step)
    for step in sorted(itertools.product(range(-3, 4), repeat=2), key=lambda step: math.hypot(*step))
)
"""Where, beside a pixel in which patches mix, each of them is looked for alone: the nearest first."""

_LEAST_SHARE: Final = 1e-4
"""Share of white light below which a surface shows nothing."""


@dataclass(frozen=True, slots=True)
class Content:
    """What some mirrors, or some glass, show.

    Parameters
    ----------
    layer : SampleLayer
        Colours and alpha, both times the share of light over the largest share around; no more of the view
        than shows any.
    rows, columns : slice
        Where that lies in the view.
    """

    layer: SampleLayer
    rows: slice
    columns: slice

    def window(self, view: Window) -> Window:
        """Return where it lies, for a view that has a window's samples."""
        return Window(
            view.x0 + self.columns.start,
            view.y0 + self.rows.start,
            view.x0 + self.columns.stop,
            view.y0 + self.rows.stop,
        )


@dataclass(frozen=True, slots=True)
class Apart:
    """A layer taken apart.

    Parameters
    ----------
    surfaces : SampleLayer
        The light that belongs to the surfaces, in all of the layer's views.
    shares : tuple of SampleLayer
        The same views: the share of light that is reflected or let through, of three contents each as red,
        green and blue.
    contents : tuple of Content
        What is seen.
    """

    surfaces: SampleLayer
    shares: tuple[SampleLayer, ...]
    contents: tuple[Content, ...]


def take_apart(layer: SampleLayer) -> Apart | None:
    """Part a layer's light by where it comes from.

    Parameters
    ----------
    layer : SampleLayer
        Samples.

    Returns
    -------
    Apart or None
        ``None`` where no mirror or glass shows anything.
    """
    parted = {
        name: _parted(light)
        for name in _LIGHTS
        if (light := getattr(layer, name)) is not None and light.depth is not None
    }
    found = [
        (name, number, _content(getattr(layer, name), parts, number, getattr(layer.absent, name, None)))
        for name, parts in parted.items()
        for number in np.unique(parts.patch).tolist()
        if number > 0
    ]
    if not found:
        return None
    shares = tuple(
        _in_all_views(
            layer,
            functools.partial(_shares, whole=layer, parted=parted, which=found[n : n + _PRIMARIES]),
        )
        for n in range(0, len(found), _PRIMARIES)
    )
    return Apart(_in_all_views(layer, _surfaces), shares, tuple(content for _, _, content in found))


def put_together(
    shares: Sequence[Float32Array], contents: Sequence[tuple[Float32Array, slice, slice]]
) -> Float32Array:
    """Return the light of mirrors and glass.

    Parameters
    ----------
    shares : sequence of ndarray of float32 of shape (rows, columns, 4)
        Blurred shares, three contents' each.
    contents : sequence of (ndarray of float32 of shape (r, c, 4), slice, slice)
        Blurred contents, and their rows and columns.

    Returns
    -------
    ndarray of float32 of shape (rows, columns, 3)
        Light.
    """
    light = np.zeros((*shares[0].shape[:2], 3), dtype=np.float32)
    for n, (content, rows, columns) in enumerate(contents):
        share = shares[n // _PRIMARIES][..., n % _PRIMARIES]
        known = np.zeros(share.shape, dtype=bool)
        known[rows, columns] = content[..., 3] > _LEAST_WEIGHT
        if not known.any():
            continue
        seen = np.zeros_like(light)
        inside = known[rows, columns]
        seen[known] = content[inside, :3] / content[inside, 3:]
        # Behind the edge of something blurred a mirror shows what no sample has; so do edges of its own.
        wanted = ~known & (share > 0.0)
        if wanted.any():
            _, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
            seen[wanted] = seen[tuple(places[wanted] for places in nearest)]
        light += share[..., np.newaxis] * seen
    return light


@dataclass(frozen=True, slots=True)
class _Parts:
    """A light by the patches that it is from: each sample's own, and another that its pixel has some of.

    Parameters
    ----------
    patch, beside : ndarray of int32 of shape (rows, columns)
        Numbers of the patches, 0 for none.
    own, other : ndarray of float32 of shape (rows, columns, 4)
        Their light and share of light; the sum of both is the light's.
    source : ndarray of intp of shape (rows, columns)
        Sample, as a flat index, that is like the other patch there.
    """

    patch: npt.NDArray[np.int32]
    beside: npt.NDArray[np.int32]
    own: Float32Array
    other: Float32Array
    source: npt.NDArray[np.intp]

    def color(self, number: int) -> Float32Array:
        """Return a patch's light and share of light."""
        color: Float32Array = np.where((self.patch == number)[..., np.newaxis], self.own, np.float32(0.0))
        there = self.beside == number
        color[there] = self.other[there]
        return color

    def filled(self, values: npt.NDArray[np.float32], number: int) -> npt.NDArray[np.float32]:
        """Return values of samples, and of those that have some of a patch beside them what it has there."""
        there = self.beside == number
        if not there.any():
            return values
        result = values.copy()
        result[there] = values.reshape(-1, *values.shape[2:])[self.source[there]]
        return result


def _parted(light: SampleLayer) -> _Parts:
    """Part a light where patches meet: the renderer's filter mixes them in the pixels there.

    A sample a little further on in each of the two says how they look, and how much of each there is.
    """
    color = light.color
    shown = color[..., 3] > _LEAST_SHARE
    patch = shown.astype(np.int32) if light.patch is None else np.where(shown, light.patch, np.int32(0))
    parts = _Parts(
        patch, np.zeros_like(patch), color, np.zeros_like(color), np.zeros(patch.shape, dtype=np.intp)
    )
    at, *beside = _meeting(patch)
    if not at.size:
        return parts
    mixture, one, two = (color.reshape(-1, 4)[of].astype(np.float64) for of in (at, *beside))
    between = two - one
    length = (between * between).sum(axis=1)
    share = np.zeros(at.size)
    np.divide(((mixture - one) * between).sum(axis=1), length, out=share, where=length > 0.0)
    share = np.clip(share, 0.0, 1.0)
    # The share of light is as it is; what the two do not explain of the light is each one's like its share.
    of_each = np.stack([1.0 - share, share]) * (one[:, 3], two[:, 3])
    of_each *= mixture[:, 3] / of_each.sum(axis=0)
    shows, *shown_by = (values[:, :3] / values[:, 3:] for values in (mixture, one, two))
    rest = shows - (of_each[..., np.newaxis] * shown_by).sum(axis=0) / mixture[:, 3:]
    # Where that is much, the pixel shows something else.
    explained = np.abs(rest).sum(axis=1) < _REST * np.abs(shown_by[1] - shown_by[0]).sum(axis=1)
    explained &= (np.minimum(*shown_by) + rest > 0.0).all(axis=1)
    some = explained & (of_each.min(axis=0) > _LEAST_SHARE)
    other = of_each[1, :, np.newaxis] * np.append(shown_by[1] + rest, np.ones((at.size, 1)), axis=1)
    place = np.unravel_index(at[some], patch.shape)
    parts.beside[place] = patch.reshape(-1)[beside[1][some]]
    parts.other[place] = other[some]
    parts.source[place] = beside[1][some]
    return replace(parts, own=color - parts.other)


def _meeting(patch: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.intp], ...]:
    """Return where patches meet, and samples of its own patch and of another nearby: flat indices."""
    highest = ndimage.maximum_filter(patch, size=_MIXED)
    lowest = ndimage.minimum_filter(np.where(patch > 0, patch, np.iinfo(np.int32).max), size=_MIXED)
    alone = (patch > 0) & (highest == lowest)
    rows, columns = np.nonzero((patch > 0) & ~alone)
    own, other = (np.full(rows.size, -1, dtype=np.intp) for _ in range(2))
    last = np.array(patch.shape)[:, np.newaxis] - 1
    here = patch[rows, columns]
    for step in _STEPS_AWAY:
        y, x = np.clip(np.stack([rows, columns]) + step[:, np.newaxis], 0, last)
        at, same = y * patch.shape[1] + x, patch[y, x] == here
        own = np.where((own < 0) & alone[y, x] & same, at, own)
        other = np.where((other < 0) & alone[y, x] & ~same, at, other)
    known = (own >= 0) & (other >= 0)
    return (rows * patch.shape[1] + columns)[known], own[known], other[known]


def _surfaces(view: SampleLayer) -> Float32Array:
    """Return a view's colours without what is seen in its mirrors and through its glass."""
    color = view.color.copy()
    for name in _LIGHTS:
        light = getattr(view, name)
        if light is not None:
            shown = light.color[..., 3] > _LEAST_SHARE
            color[shown, :3] -= light.color[shown, :3]
    return color


def _shares(
    view: SampleLayer,
    whole: SampleLayer,
    parted: Mapping[str, _Parts],
    which: Sequence[tuple[str, int, Content]],
) -> Float32Array:
    """Return what shares of light a view's surfaces reflect and let through, for up to three contents."""
    color = np.zeros_like(view.color)
    color[..., 3] = view.color[..., 3]
    for n, (name, number, _) in enumerate(which):
        light = getattr(view, name)
        if light is None:
            continue
        if view is whole:
            color[..., n] = parted[name].color(number)[..., 3]
            continue
        share = light.color[..., 3]
        # Of other views only colours are known: their patches are those beside them.
        patch = parted[name].patch
        _, nearest = ndimage.distance_transform_edt(patch == 0, return_indices=True)
        patch = patch[tuple(nearest)]
        color[..., n] = np.where((share > _LEAST_SHARE) & (patch == number), share, np.float32(0.0))
    return color


def _in_all_views(layer: SampleLayer, color_of: Callable[[SampleLayer], Float32Array]) -> SampleLayer:
    """Return a layer with other colours, and its other views with theirs."""

    def changed(view: SampleLayer) -> SampleLayer:
        return replace(view, color=color_of(view), reflected=None, transmitted=None)

    return replace(
        changed(layer),
        stationary=None if layer.stationary is None else changed(layer.stationary),
        moving=None if layer.moving is None else changed(layer.moving),
        hidden=tuple(changed(view) for view in layer.hidden),
        absent=None if layer.absent is None else changed(layer.absent),
    )


def _content(light: SampleLayer, parts: _Parts, number: int, absent: SampleLayer | None) -> Content:
    """Return what is seen in one patch: beyond it there is nothing, infinitely far away.

    What is there without what moves is behind it.
    """
    color = parts.color(number)
    shown = color[..., 3] > 0.0
    ((rows, columns),) = ndimage.find_objects(shown.astype(np.int32))
    vector = None if light.vector is None else parts.filled(light.vector, number) * shown[..., np.newaxis]
    if vector is not None:
        # What moves out of a mirror may come back.
        margin = math.ceil(float(np.abs(vector).max())) + 1
        rows, columns = (
            slice(max(part.start - margin, 0), min(part.stop + margin, size))
            for part, size in zip((rows, columns), shown.shape, strict=True)
        )
    # A single row or column has nothing between its samples.
    if min(rows.stop - rows.start, columns.stop - columns.start) < _LEAST_SIDE:
        rows, columns = slice(0, shown.shape[0]), slice(0, shown.shape[1])
    at = (rows, columns)
    assert light.depth is not None
    scale = _to_full_alpha(color[..., 3])
    behind = None
    if vector is not None and absent is not None and absent.depth is not None:
        there = (parts.patch == number) & (absent.color[..., 3] > _LEAST_SHARE)
        behind = SampleLayer(
            absent.name,
            (absent.color * (scale * there)[..., np.newaxis])[at],
            np.where(there, absent.depth, np.float32(np.inf))[at],
        )
    return Content(
        replace(
            light,
            color=(color * scale[..., np.newaxis])[at],
            depth=np.where(shown, parts.filled(light.depth, number), np.float32(np.inf))[at],
            # What is seen in one mirror need not be one surface.
            object_index=None,
            vector=None if vector is None else vector[at],
            patch=None,
            absent=behind,
            astigmatism=None if light.astigmatism is None else parts.filled(light.astigmatism, number)[at],
        ),
        rows,
        columns,
    )


def _to_full_alpha(share: Float32Array) -> Float32Array:
    """Return by what a share of light is multiplied to be an alpha: 1 in a mirror, less at its edges.

    What a puddle shows hides what is behind it there as well as in a mirror of silver.
    """
    most = ndimage.maximum_filter(share, size=_MOST_AROUND)
    scale: Float32Array = np.zeros_like(share)
    np.divide(np.float32(1.0), most, out=scale, where=most > 0.0)
    return scale


def _circles(depth: npt.ArrayLike, focus: FocusSettings) -> npt.NDArray[np.float64]:
    """Return diameters of circles of confusion in pixels."""
    return np.abs(circle_of_confusion(np.asarray(depth), focus.lens, focus.model)) / focus.film.pitch_x


def _evened(layer: SampleLayer, focus: FocusSettings) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return vergence and astigmatism of what is seen, even over some pixels.

    From pixel to pixel of a mirror in focus the direction that is seen changes by the lens's width for each
    circle of confusion, and in proportion to the mirror's curvature: what has a mean is the inverse. Where a
    mirror is flat along one axis for less than the circle there, the circle is not that long.
    """
    assert layer.depth is not None
    assert layer.astigmatism is not None
    with np.errstate(divide="ignore"):
        near = 1.0 / layer.depth.astype(np.float64)
    half = 0.5 * layer.astigmatism.astype(np.float64)
    size = np.hypot(half[..., 0], half[..., 1])
    shown = (layer.color[..., 3] > 0.0) & np.isfinite(size)
    focused = 1.0 / focus.lens.focus_distance
    # Pixels for each dioptre.
    scale = float(_circles(1.0 / (focused + 1.0), focus))
    away = focused - np.stack([near, near - 2.0 * size])
    # Of the images along the two axes, as a tensor: its trace, and what is left, turned twice.
    first, second = 1.0 / np.maximum(np.abs(away), _LEAST_CIRCLE / scale)
    axis = np.zeros_like(half)
    np.divide(half, size[..., np.newaxis], out=axis, where=size[..., np.newaxis] > 0.0)
    parts = (0.5 * (first + second), *(0.5 * (first - second) * part for part in np.moveaxis(axis, 2, 0)))
    weight = ndimage.uniform_filter(shown.astype(np.float64), _EVEN, mode="constant")
    mean, *turned = (
        np.divide(
            ndimage.uniform_filter(np.where(shown, part, 0.0), _EVEN, mode="constant"),
            weight,
            out=np.ones_like(weight),
            where=shown,
        )
        for part in parts
    )
    # Each image stays on its side of the focus.
    along = turned[0] * axis[..., 0] + turned[1] * axis[..., 1]
    other = np.copysign(np.hypot(*turned), along)
    images = focused - np.copysign(1.0 / np.stack([mean + other, mean - other]), away)
    astigmatism = np.stack(turned, axis=2)
    np.divide(astigmatism, other[..., np.newaxis], out=astigmatism, where=other[..., np.newaxis] != 0.0)
    astigmatism *= (images[0] - images[1])[..., np.newaxis]
    # Where both are as large, or small, there is nothing to even; a pinhole's are.
    circles = scale * np.abs(away)
    uneven = shown & (_difference(circles) > _LEAST_SPREAD)
    # The nearer of the two is the layer's depth.
    return np.where(uneven, images.max(axis=0), near), np.where(
        uneven[..., np.newaxis], astigmatism, 2.0 * half
    )


def _difference(circles: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return by how many pixels to each side the smaller of two circles is spread to be as the other."""
    spread: npt.NDArray[np.float64] = 0.5 * np.sqrt(np.abs(circles[0] ** 2 - circles[1] ** 2))
    return spread


def spread_out(layer: SampleLayer, focus: FocusSettings) -> SampleLayer:
    """Return what is seen in curved mirrors with the larger of its two blurs done, along its axis.

    A point of an astigmatic image is an ellipse: the disc of its smaller circle of confusion, spread along
    the axis of the larger one. What is left to the focus processor is the disc.

    Parameters
    ----------
    layer : SampleLayer
        What is seen.
    focus : FocusSettings
        Lens and film.

    Returns
    -------
    SampleLayer
        With other colours, and with the depth of the smaller circle.
    """
    if layer.astigmatism is None or layer.depth is None or not layer.astigmatism.any():
        return layer
    near, astigmatism = _evened(layer, focus)
    size = np.hypot(astigmatism[..., 0], astigmatism[..., 1])
    angle = 0.5 * np.arctan2(astigmatism[..., 1], astigmatism[..., 0])
    with np.errstate(divide="ignore"):
        depths = [1.0 / np.maximum(vergence, 0.0) for vergence in (near, near - size)]
    circles = np.stack([_circles(depth, focus) for depth in depths])
    farther = circles[1] < circles[0]
    # The longer axis is that of the other circle.
    angle = angle + np.where(farther, 0.5 * np.pi, 0.0)
    half = _difference(circles)
    shown = (half > _LEAST_SPREAD) & (layer.color[..., 3] > 0.0) & (size > 0.0)
    depth = np.where(farther & (size > 0.0), depths[1], depths[0]).astype(np.float32)
    color = layer.color.copy()
    rows, columns = np.nonzero(shown)
    if rows.size:
        steps = min(math.ceil(float(half[shown].max())), _MOST_STEPS)
        places = (np.arange(2 * steps) + 0.5) / steps - 1.0
        # Along its axis an ellipse is as wide as a semicircle.
        weights = np.sqrt(1.0 - places * places)
        way = half[shown] * np.stack([np.sin(angle[shown]), np.cos(angle[shown])])
        sums = np.zeros((rows.size, 4))
        for place, weight in zip(places, weights / weights.sum(), strict=True):
            at = np.stack([rows, columns]) + place * way
            for n in range(4):
                sums[:, n] += weight * ndimage.map_coordinates(
                    layer.color[..., n], at, order=1, mode="nearest", output=np.float64
                )
        color[rows, columns] = sums
    return replace(layer, color=color, depth=depth)
