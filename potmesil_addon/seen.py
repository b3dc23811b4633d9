"""Light that is seen in mirrors and through glass, taken apart from its surfaces' own and put back.

What a mirror shows, S, is what share of light it reflects, a, times what is seen in it, S / a. The share
belongs to the mirror: it is blurred with the mirror's depth and motion, and hidden by what hides the mirror.
What is seen is blurred with its own depth and motion, normalised by the shares, so that it ends where the
mirror ends. The product is the mirror's light; without blur it is S, and all parts add up to the picture.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

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

_MOST_AROUND: Final = 9
"""Side in pixels of the squares in which the largest share of light is taken."""

_MOST_STEPS: Final = 24

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
    found = [
        (name, number, _content(light, number, getattr(layer.absent, name, None)))
        for name in _LIGHTS
        if (light := getattr(layer, name)) is not None and light.depth is not None
        for number in np.unique(_patch(light)).tolist()
        if number > 0
    ]
    if not found:
        return None
    shares = tuple(
        _in_all_views(layer, functools.partial(_shares, whole=layer, which=found[n : n + _PRIMARIES]))
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


def _patch(light: SampleLayer) -> npt.NDArray[np.int32]:
    """Return the numbers of a light's patches, 0 where nothing is seen."""
    shown = light.color[..., 3] > _LEAST_SHARE
    if light.patch is None:
        return shown.astype(np.int32)
    return np.where(shown, light.patch, np.int32(0))


def _surfaces(view: SampleLayer) -> Float32Array:
    """Return a view's colours without what is seen in its mirrors and through its glass."""
    color = view.color.copy()
    for name in _LIGHTS:
        light = getattr(view, name)
        if light is not None:
            shown = light.color[..., 3] > _LEAST_SHARE
            color[shown, :3] -= light.color[shown, :3]
    return color


def _shares(view: SampleLayer, whole: SampleLayer, which: Sequence[tuple[str, int, Content]]) -> Float32Array:
    """Return what shares of light a view's surfaces reflect and let through, for up to three contents."""
    color = np.zeros_like(view.color)
    color[..., 3] = view.color[..., 3]
    for n, (name, number, _) in enumerate(which):
        light = getattr(view, name)
        if light is None:
            continue
        share = light.color[..., 3]
        patch = _patch(getattr(whole, name))
        if view is not whole:
            # Of other views only colours are known: their patches are those beside them.
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


def _content(light: SampleLayer, number: int, absent: SampleLayer | None) -> Content:
    """Return what is seen in one patch: beyond it there is nothing, infinitely far away.

    What is there without what moves is behind it.
    """
    shown = _patch(light) == number
    ((rows, columns),) = ndimage.find_objects(shown.astype(np.int32))
    vector = None if light.vector is None else light.vector * shown[..., np.newaxis]
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
    scale = _to_full_alpha(light.color[..., 3] * shown)
    behind = None
    if vector is not None and absent is not None and absent.depth is not None:
        there = shown & (absent.color[..., 3] > _LEAST_SHARE)
        behind = SampleLayer(
            absent.name,
            (absent.color * (scale * there)[..., np.newaxis])[at],
            np.where(there, absent.depth, np.float32(np.inf))[at],
        )
    return Content(
        replace(
            light,
            color=(light.color * (scale * shown)[..., np.newaxis])[at],
            depth=np.where(shown, light.depth, np.float32(np.inf))[at],
            # What is seen in one mirror need not be one surface.
            object_index=None,
            vector=None if vector is None else vector[at],
            patch=None,
            absent=behind,
            astigmatism=None if light.astigmatism is None else light.astigmatism[at],
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
    size = np.hypot(layer.astigmatism[..., 0], layer.astigmatism[..., 1])
    angle = 0.5 * np.arctan2(layer.astigmatism[..., 1], layer.astigmatism[..., 0])
    with np.errstate(divide="ignore"):
        far = 1.0 / np.maximum(1.0 / layer.depth - size, 0.0)
    circles = np.stack(
        [np.abs(circle_of_confusion(depth, focus.lens, focus.model)) for depth in (layer.depth, far)]
    )
    circles /= focus.film.pitch_x
    farther = circles[1] < circles[0]
    # The longer axis is that of the other circle.
    angle = angle + np.where(farther, 0.5 * np.pi, 0.0)
    half = 0.5 * np.sqrt(np.abs(circles[0] ** 2 - circles[1] ** 2))
    shown = (half > _LEAST_SPREAD) & (layer.color[..., 3] > 0.0) & (size > 0.0)
    depth = np.where(farther & (size > 0.0), far, layer.depth).astype(np.float32)
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
