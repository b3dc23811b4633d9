"""A lens's character over its field: where it is sharp, how its pupil is cut, how it bends the picture.

Everything is told by a place on the film: metres from the optical axis, x right and y up in the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy import ndimage

from .aperture import IntArray, SamplePosition
from .camera import Film
from .distortion import LensMap, distorted_layer, distorted_picture, window_needed
from .distortion import lens_map as lens_map_of
from .effects import ChromaticAberration, Effects, FocalSurface, Pupil, Vignetting
from .lens import FloatArray, Lens
from .pupil import PupilShape, barrel_at, clear_share, field_cells
from .samples import Float32Array, SampleLayer, Samples, Window

_RADII: Final = 33
_DIRECTIONS: Final = 24
"""Places of the field at which the barrel's vignetting is worked out."""


@dataclass(frozen=True, slots=True)
class Bend:
    """Takes what a pinhole sees to where the lens puts it.

    Parameters
    ----------
    lens_map : LensMap
        Distortion and lateral chromatic aberration.
    picture : Window
        The pixels of the finished picture.
    """

    lens_map: LensMap
    picture: Window

    @property
    def needed(self) -> Window:
        """The pixels of a pinhole's picture that the finished one shows."""
        return window_needed(self.lens_map, self.picture)

    def values(self, values: Float32Array, window: Window) -> Float32Array:
        """Return the finished picture of values that a pinhole sees on a window."""
        if values.ndim == 2:
            return distorted_picture(values[..., np.newaxis], window, self.picture, self.lens_map)[..., 0]
        return distorted_picture(values, window, self.picture, self.lens_map)

    def layer(self, layer: SampleLayer, samples: Samples, reach: int) -> tuple[SampleLayer, Samples]:
        """Return samples where the lens puts them, on the picture and as much around it as reaches in.

        Parameters
        ----------
        layer : SampleLayer
            What a pinhole sees.
        samples : Samples
            The file that it belongs to.
        reach : int
            Pixels from which something blurs into the picture.

        Returns
        -------
        layer : SampleLayer
            On the new data window.
        samples : Samples
            With the picture's windows; its own layers are not to be used.
        """
        picture, extra = self.picture, 1 if samples.position == "corner" else 0
        data = samples.data_window
        covered = Window(data.x0, data.y0, data.x1 - extra, data.y1 - extra)
        while reach > 0 and not _within(window_needed(self.lens_map, _around(picture, reach)), covered):
            reach //= 2
        around = _around(picture, reach)
        target = Window(around.x0, around.y0, around.x1 + extra, around.y1 + extra)
        bent = distorted_layer(layer, data, target, self.lens_map, samples.position)
        return bent, replace(samples, data_window=target, display_window=picture)


def _around(window: Window, margin: int) -> Window:
    return Window(window.x0 - margin, window.y0 - margin, window.x1 + margin, window.y1 + margin)


def _within(inner: Window, outer: Window) -> bool:
    return inner.intersection(outer) == inner


@dataclass(frozen=True, slots=True)
class LensCharacter:
    """What makes one place of the picture different from another, and a pupil more than its blades.

    Parameters
    ----------
    axis : tuple of float
        Where the optical axis meets the picture, in pixels of the samples' windows, y down.
    corner : float
        Distance in metres from the axis to the picture's farthest corner.
    pupil : Pupil or None
        Shape of the aperture.
    focal_surface : FocalSurface or None
        Where the lens is sharp.
    chromatic : ChromaticAberration or None
        Where red and blue are.
    vignetting : Vignetting or None
        The barrel before the aperture.
    bend : Bend or None
        Where the lens puts what a pinhole sees elsewhere.
    """

    axis: tuple[float, float]
    corner: float
    pupil: Pupil | None = None
    focal_surface: FocalSurface | None = None
    chromatic: ChromaticAberration | None = None
    vignetting: Vignetting | None = None
    bend: Bend | None = None

    def shape(self, lens: Lens, film: Film) -> PupilShape | None:
        """Return what makes tables, None where blades, rotation and squeeze say all."""
        shape = PupilShape(lens, film, self.pupil, self.chromatic, self.vignetting)
        plain = self.pupil is None and shape.colors == (0.0,) and not shape.is_cut
        return None if plain else shape

    def place(self, film: Film, window: Window, position: SamplePosition) -> tuple[FloatArray, FloatArray]:
        """Return where samples lie on the film.

        Parameters
        ----------
        film : Film
            Its pixels' size.
        window : Window
            The samples.
        position : {"center", "corner"}
            Where they lie on the pixel grid.

        Returns
        -------
        x : ndarray of float64 of shape (columns,)
        y : ndarray of float64 of shape (rows, 1)
            In metres from the optical axis.
        """
        half = 0.5 if position == "center" else 0.0
        x = (window.x0 + np.arange(window.columns) + half - self.axis[0]) * film.pitch_x
        y = (self.axis[1] - window.y0 - np.arange(window.rows) - half) * film.pitch_y
        return np.asarray(x), np.asarray(y[:, np.newaxis])

    def vergence(
        self, lens: Lens, film: Film, window: Window, position: SamplePosition
    ) -> Float32Array | None:
        """Return by how much the inverse distance of what is sharp differs from that on the axis.

        Scheimpflug: a lens tilted by an angle t is sharp on a plane that meets its own F / sin t to the side,
        so 1/D grows with the place y on the film by y sin t / F^2, whatever it is on the axis. An image
        surface of the curvature K lies r^2 K / 2 before the film; 1/D is greater by so much over F^2.

        Parameters
        ----------
        lens : Lens
            Its focal length F.
        film : Film
            Its pixels' size.
        window : Window
            The samples.
        position : {"center", "corner"}
            Where they lie on the pixel grid.

        Returns
        -------
        ndarray of float32 of shape (rows, columns) or None
            In 1/m; None where it is 0 everywhere.
        """
        surface = self.focal_surface
        if surface is None or surface == FocalSurface():
            return None
        x, y = self.place(film, window, position)
        sag = 0.5 * surface.curvature * (x * x + y * y)
        tilted = math.sin(surface.tilt) * y + math.sin(surface.swing) * x
        return np.asarray((tilted + sag) / lens.focal_length**2, dtype=np.float32)

    def cells(self, film: Film, window: Window, position: SamplePosition) -> IntArray:
        """Return in which cell of the field samples lie, (rows, columns); see `pupil.field_cells`."""
        x, y = self.place(film, window, position)
        return field_cells(*np.broadcast_arrays(x / self.corner, y / self.corner))

    def vignetted(self, lens: Lens, film: Film, window: Window) -> Float32Array:
        """Return what share of its light each pixel gets.

        Parameters
        ----------
        lens : Lens
            Focal length, blades and f-stop.
        film : Film
            The picture's pixels.
        window : Window
            The picture, in the pixels of `axis`.

        Returns
        -------
        ndarray of float32 of shape (rows, columns)
            From 0 to 1: the fourth power of the cosine of the angle to the axis, for the share `natural`
            of it, times what the barrel leaves of the pupil's area.
        """
        assert self.vignetting is not None
        x, y = self.place(film, window, "center")
        square = x * x + y * y
        cosine_4 = (1.0 + square / lens.focal_length**2) ** -2
        share = 1.0 - self.vignetting.natural * (1.0 - cosine_4)
        if self.vignetting.mechanical > 0.0:
            clear = _clear_shares(self, lens)
            radius = np.sqrt(square) * ((_RADII - 1) / self.corner)
            turn = np.arctan2(y, x) * (_DIRECTIONS / (2.0 * math.pi)) % _DIRECTIONS
            at = np.stack(np.broadcast_arrays(turn, np.minimum(radius, _RADII - 1.0)))
            share = share * ndimage.map_coordinates(clear, at, order=1, mode="nearest")
        return np.asarray(share, dtype=np.float32)


def _clear_shares(character: LensCharacter, lens: Lens) -> FloatArray:
    """Return what the barrel leaves of the pupil in directions, the first twice, and at radii."""
    assert character.vignetting is not None
    shares = np.empty((_DIRECTIONS + 1, _RADII))
    for n, angle in enumerate(np.linspace(0.0, 2.0 * math.pi, _DIRECTIONS + 1)):
        for k, radius in enumerate(np.linspace(0.0, 1.0, _RADII)):
            x, y = radius * math.cos(angle), radius * math.sin(angle)
            shares[n, k] = clear_share(lens, character.pupil, barrel_at(lens, character.vignetting, x, y))
    return shares


def axis_of(samples: Samples) -> tuple[float, float]:
    """Return the pixel, in the samples' windows, at which the optical axis meets the picture."""
    display = samples.display_window
    if samples.camera is None:
        return 0.5 * (display.x0 + display.x1), 0.5 * (display.y0 + display.y1)
    return display.x0 + samples.camera.axis_x, display.y0 + samples.camera.axis_y


def character_of(
    effects: Effects, focal_length: float, film: Film, axis: tuple[float, float], picture: Window
) -> LensCharacter | None:
    """Return a lens's character, None where it has none.

    Parameters
    ----------
    effects : Effects
        What is on.
    focal_length : float
        In metres.
    film : Film
        The picture's pixels on the film.
    axis : tuple of float
        Where the optical axis meets the picture, in pixels of `picture`'s window.
    picture : Window
        The picture.

    Returns
    -------
    LensCharacter or None
        The character.
    """
    pupil = None if effects.pupil == Pupil() else effects.pupil
    said = pupil, effects.focal_surface, effects.chromatic, effects.vignetting
    lens_map = lens_map_of(effects.distortion, effects.chromatic, focal_length, film, axis, picture)
    if said == (None,) * 4 and lens_map is None:
        return None
    across = max(abs(picture.x0 - axis[0]), abs(picture.x1 - axis[0])) * film.pitch_x
    down = max(abs(picture.y0 - axis[1]), abs(picture.y1 - axis[1])) * film.pitch_y
    bend = None if lens_map is None else Bend(lens_map, picture)
    return LensCharacter(axis, math.hypot(across, down), *said, bend)
