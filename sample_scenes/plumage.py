"""A picture to wrap around things: a bird's eye amid feathers of every colour, drawn by numbers.

It stands where the papers show a photographed mandrill: vivid, and with detail at every scale from the
whole eye down to single barbs, so that the loss of sharpness shows wherever it falls. Lengths are shares of
the picture's side, x to the right and y down from the upper left corner.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

Array = npt.NDArray[np.float64]

_FINER = 2
"""Drawn this much larger each way, and averaged down."""

_EYE = np.array([0.45, 0.44])
_PUPIL, _IRIS, _LID, _SKIN = 0.052, 0.112, 0.136, 0.185
"""Outer radii of the eye's rings."""

_LIGHT = np.array([-0.55, -0.83])
"""Where the light comes from, in the picture's plane."""

_WIND = np.array([0.42, 0.16])
"""What bends the feathers from pointing straight away from the eye."""

_WIDEST = 0.60
"""Where along a feather it is widest; beyond it the outline is half an ellipse."""

_BARB = 1.0 / 185.0
_BARB_SLANT = 1.5
_BARBS = 256

_PATCHES = (
    # Place, colour of the vane, colour of the rim.
    ((0.40, -0.05), (0.86, 0.07, 0.06), (0.98, 0.30, 0.08)),
    ((0.80, 0.00), (0.98, 0.38, 0.05), (1.00, 0.78, 0.15)),
    ((1.02, 0.33), (1.00, 0.80, 0.10), (0.70, 0.85, 0.15)),
    ((0.98, 0.68), (0.20, 0.66, 0.14), (0.05, 0.45, 0.30)),
    ((0.80, 1.00), (0.04, 0.62, 0.52), (0.10, 0.75, 0.85)),
    ((0.42, 1.02), (0.08, 0.38, 0.92), (0.10, 0.70, 0.95)),
    ((0.08, 0.95), (0.14, 0.14, 0.78), (0.38, 0.20, 0.85)),
    ((-0.05, 0.58), (0.48, 0.14, 0.74), (0.85, 0.25, 0.70)),
    ((-0.05, 0.15), (0.80, 0.08, 0.38), (0.96, 0.45, 0.62)),
    ((0.28, 0.68), (0.97, 0.96, 0.93), (0.78, 0.84, 0.95)),
    ((0.66, 0.62), (0.97, 0.86, 0.30), (0.30, 0.70, 0.35)),
    ((0.62, 0.22), (0.92, 0.16, 0.06), (1.00, 0.62, 0.10)),
    ((0.17, 0.40), (0.98, 0.95, 0.91), (0.98, 0.80, 0.70)),
)


def plumage(side: int, seed: int = 1982) -> Array:
    """Draw the picture.

    Parameters
    ----------
    side : int
        Rows and columns.
    seed : int
        Of the random numbers; the same seed draws the same picture.

    Returns
    -------
    ndarray of float64 of shape (side, side, 3)
        Display values (sRGB) from 0 to 1, row 0 on top.
    """
    rng = np.random.default_rng(seed)
    canvas = _Canvas(side * _FINER)
    canvas.values[:] = (0.16, 0.07, 0.06)
    for feather in _lay(rng):
        _draw_feather(canvas, feather, rng)
    _draw_eye(canvas, rng)
    values = canvas.values * (1.0 + 0.05 * _clouds(canvas.side, rng))[..., np.newaxis]
    averaged = values.reshape(side, _FINER, side, _FINER, 3).mean(axis=(1, 3))
    return np.clip(averaged, 0.0, 1.0)


drawn_plumage = functools.cache(plumage)
"""The same picture, drawn once for all scenes of a session; to be read only."""


class _Canvas:
    """A square of colours that shapes are laid onto, one over the other."""

    def __init__(self, side: int) -> None:
        self.side = side
        self.values = np.zeros((side, side, 3))

    def around(self, center: Array, reach: float) -> tuple[tuple[slice, slice], Array, Array]:
        """Return the pixels within reach of a place, and their x and y from it."""
        low = np.clip(np.floor((center - reach) * self.side), 0, self.side).astype(int)
        high = np.clip(np.ceil((center + reach) * self.side), 0, self.side).astype(int)
        x = (np.arange(low[0], high[0]) + 0.5) / self.side - center[0]
        y = (np.arange(low[1], high[1]) + 0.5) / self.side - center[1]
        return (slice(low[1], high[1]), slice(low[0], high[0])), x[np.newaxis, :], y[:, np.newaxis]

    def lay(self, where: tuple[slice, slice], cover: Array, color: Array) -> None:
        """Lay a colour over pixels, as far as it covers them."""
        under = self.values[where]
        under += cover[..., np.newaxis] * (color - under)


@dataclass(frozen=True, slots=True)
class _Feather:
    base: Array
    along: Array
    length: float
    width: float
    vane: Array
    rim: Array


def _lay(rng: np.random.Generator) -> Iterator[_Feather]:
    """Yield feathers in rings around the eye, each ring under the next one inwards, as scales lie."""
    radii = [_SKIN - 0.03]
    while radii[-1] < 0.95:
        radii.append(radii[-1] + 0.34 * _length_at(radii[-1]))
    for ring, radius in reversed(list(enumerate(radii))):
        length = _length_at(radius)
        count = round(2.0 * math.pi * radius / (0.36 * length))
        turns = (np.arange(count) + 0.5 * (ring % 2) + rng.uniform(-0.25, 0.25, count)) / count
        for turn in rng.permutation(turns):
            out = np.array([math.cos(2.0 * math.pi * turn), math.sin(2.0 * math.pi * turn)])
            base = _EYE + out * radius * rng.uniform(0.97, 1.03)
            along = out + _WIND + rng.normal(0.0, 0.10, 2)
            along /= np.linalg.norm(along)
            size = length * rng.uniform(0.88, 1.12)
            vane, rim = _colors(base + 0.5 * size * along, rng)
            yield _Feather(base, along, size, 0.23 * size * rng.uniform(0.9, 1.1), vane, rim)


def _length_at(radius: float) -> float:
    """Return how long feathers are at a distance from the eye: down near it, coverts far away."""
    return 0.05 + 0.27 * (radius - _SKIN + 0.03)


def _colors(place: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the colours of a feather: the nearest patch's, or a neighbour's where patches meet."""
    distances = [np.linalg.norm(place - patch[0]) * rng.normal(1.0, 0.16) for patch in _PATCHES]
    _, vane, rim = _PATCHES[int(np.argmin(distances))]
    tint = rng.normal(1.0, 0.07) * rng.normal(1.0, 0.05, 3)
    return np.clip(vane * tint, 0.0, 1.0), np.clip(rim * tint, 0.0, 1.0)


def _draw_feather(canvas: _Canvas, feather: _Feather, rng: np.random.Generator) -> None:
    """Draw a feather: its shadow, then the vane with barbs, rim and sheen, then the shaft."""
    center = feather.base + 0.5 * feather.length * feather.along
    where, x, y = canvas.around(center, 0.75 * feather.length)
    if 0 in canvas.values[where].shape:
        return
    along, across = feather.along, np.array([-feather.along[1], feather.along[0]])
    s = (x * along[0] + y * along[1]) / feather.length + 0.5
    t = (x * across[0] + y * across[1]) / feather.width

    drop = -0.10 * feather.width * _LIGHT
    shifted = _outline(s - drop @ along / feather.length, t - drop @ across / feather.width)
    canvas.lay(where, 0.62 * _step(1.35, 0.75, shifted), np.array([0.05, 0.02, 0.03]))

    barb = (s * feather.length - _BARB_SLANT * np.abs(t) * feather.width) / max(_BARB, 3.0 / canvas.side)
    barb += 0.35 * np.sin(5.0 * t + rng.uniform(0.0, 6.0))
    number = np.floor(barb).astype(int) % _BARBS + (t < 0.0) * _BARBS
    own = rng.normal(0.0, 1.0, 2 * _BARBS)[number]
    ridge = 1.0 - 2.0 * np.abs(barb - np.floor(barb) - 0.45)

    rim_at = _outline(s, t)
    # Barbs end unevenly, and here and there the vane has split.
    split = (own < -2.1) * (np.abs(t) > 0.45) * 0.8
    inside = (1.0 - rim_at - np.maximum(0.0, -0.045 * own)) * feather.width * canvas.side
    cover = np.clip(inside + 0.5, 0.0, 1.0) * (1.0 - split)

    rim = _step(0.58, 0.88, rim_at + 0.05 * own) * _step(0.35, 0.65, s)
    color = feather.vane + rim[..., np.newaxis] * (feather.rim - feather.vane)
    round_back = -(np.sin(0.9 * t) * float(across @ _LIGHT) * -0.30)
    shade = (0.50 + 0.50 * _step(0.15, 0.70, s)) * (1.0 + round_back) * (1.0 - 0.10 * _step(0.8, 1.0, rim_at))
    shade = shade * (0.86 + 0.20 * ridge + 0.12 * own)
    sheen = np.exp(-(((t + 0.40 * np.sign(across @ -_LIGHT)) / 0.28) ** 2) - ((s - 0.66) / 0.20) ** 2)
    lit = color * shade[..., np.newaxis] + (0.22 * sheen * (0.4 + ridge))[..., np.newaxis]
    canvas.lay(where, cover, np.clip(lit, 0.0, 1.0))

    # The light has the shaft bright on one side and shadowed on the other.
    thin = np.abs(t) * feather.width * canvas.side / (0.45 + 0.010 * feather.length * canvas.side * (1.1 - s))
    shaft = np.clip(1.3 - thin, 0.0, 1.0) * (rim_at < 0.93)
    pale = feather.vane.sum() > 2.0
    canvas.lay(where, 0.75 * shaft, feather.vane * 0.55 if pale else 0.6 * feather.vane + 0.4)


def _outline(s: Array, t: Array) -> Array:
    """Return where a point lies between a feather's shaft (0) and its rim (1), or outside (more)."""
    narrow = 0.35 + 0.65 * _step(-0.05, _WIDEST, s)
    tip = np.hypot((s - _WIDEST) / (1.0 - _WIDEST), t)
    return np.where(s > _WIDEST, tip, np.abs(t) / narrow + np.maximum(0.0, -20.0 * s))


def _draw_eye(canvas: _Canvas, rng: np.random.Generator) -> None:
    """Draw bare skin with rows of down, the lids, the iris with its fibres, the pupil and its highlight."""
    where, x, y = canvas.around(_EYE, _SKIN)
    r = np.hypot(x, y)
    turn = np.arctan2(y, x)
    pixel = 1.0 / canvas.side
    wavy = _circular_noise(turn, rng, 7)

    def within(radius: float | Array) -> Array:
        return np.clip((radius - r) / pixel + 0.5, 0.0, 1.0)

    up = (x * _LIGHT[0] + y * _LIGHT[1]) / np.maximum(r, pixel)
    fold = np.sin(2.0 * math.pi * (r + 0.004 * wavy) / 0.0085 + 2.0 * _circular_noise(turn, rng, 23))
    bead = np.sin(90.0 * turn + 3.0 * wavy + 9.0 * np.floor(r / 0.0085))
    skin = (0.83 - 0.12 * up + 0.07 * fold + 0.05 * bead)[..., np.newaxis] * np.array([1.0, 0.95, 0.90])
    down = (fold > 0.55) & (bead > 0.35)
    skin = np.where(down[..., np.newaxis], skin * np.array([0.25, 0.18, 0.22]), skin)
    soft = _step(_SKIN, _SKIN - 0.022, r + 0.010 * _circular_noise(turn, rng, 41))
    canvas.lay(where, soft, skin)

    beads = 0.30 + 0.22 * np.cos(64.0 * turn) * np.sin(math.pi * (r - _IRIS) / (_LID - _IRIS)) + 0.14 * up
    lid_edge = _LID + 0.003 * wavy
    canvas.lay(where, within(lid_edge), beads[..., np.newaxis] * np.array([0.80, 0.72, 0.74]))

    depth = (r - _PUPIL) / (_IRIS - _PUPIL)
    fibre = _circular_noise(turn + 0.3 * depth, rng, 60) + 0.8 * _circular_noise(turn - 0.2 * depth, rng, 130)
    inner, outer = np.array([1.00, 0.86, 0.22]), np.array([0.90, 0.36, 0.03])
    mix = np.clip(depth + 0.16 * fibre, 0.0, 1.0)[..., np.newaxis]
    glow = (0.88 + 0.16 * fibre - 0.22 * up) * _step(1.08, 0.72, depth)
    canvas.lay(where, within(_IRIS), (inner + mix * (outer - inner)) * glow[..., np.newaxis])
    canvas.lay(where, within(_PUPIL + 0.002 * fibre), np.array([0.02, 0.015, 0.03]))

    sky = _step(0.95, 0.35, np.hypot((x + 0.030) / 0.036, (y + 0.042) / 0.026))
    canvas.lay(where, 0.96 * sky, np.array([0.97, 0.98, 1.0]))
    ground = _step(1.0, 0.0, np.hypot((x - 0.030) / 0.040, (y - 0.052) / 0.016))
    canvas.lay(where, 0.35 * ground, np.array([0.65, 0.80, 1.0]))


def _circular_noise(turn: Array, rng: np.random.Generator, waves: int) -> Array:
    """Return noise around a circle with about so many waves, of standard deviation near 1."""
    values = ndimage.zoom(rng.normal(0.0, 1.0, 2 * waves), 16, order=3, mode="grid-wrap", grid_mode=True)
    places = np.mod(turn / (2.0 * math.pi), 1.0) * values.size
    return ndimage.map_coordinates(values, [places.reshape(-1)], order=1, mode="grid-wrap").reshape(
        turn.shape
    )


def _clouds(side: int, rng: np.random.Generator) -> Array:
    """Return soft noise of standard deviation 1 whose amplitude falls as one over the frequency."""
    spectrum = np.fft.rfft2(rng.normal(0.0, 1.0, (side, side)))
    frequency = np.hypot(np.fft.fftfreq(side)[:, np.newaxis], np.fft.rfftfreq(side)[np.newaxis, :])
    frequency[0, 0] = math.inf
    clouds = np.fft.irfft2(spectrum / frequency, s=(side, side))
    return np.asarray(clouds / clouds.std())


def _step(start: float, end: float, value: Array) -> Array:
    """Return a smooth step from 0 at one value to 1 at another."""
    x = np.clip((value - start) / (end - start), 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))
