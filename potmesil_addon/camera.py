"""The pinhole camera saved with the samples: from world to pixels (TOG 1982, section 2.1).

World and camera coordinates are right-handed and in metres. Camera coordinates have x to the right, y
up and look along -z, as Blender's; the papers' depth z' is -z. Pixel coordinates have x to the right,
y down, the origin in the upper left corner of the display window and pixel centres at halves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from .errors import SettingsError
from .lens import FloatArray

SensorFit = Literal["AUTO", "HORIZONTAL", "VERTICAL"]


@dataclass(frozen=True, slots=True)
class Film:
    """The part of the image plane that the picture covers, with its pixels.

    Parameters
    ----------
    width, height : float
        Size of the display window on the film in metres, greater than 0.
    columns, rows : int
        Pixels of the display window, at least 1.

    Raises
    ------
    SettingsError
        If a size is not positive, or pixels are 1000 times as wide as high, or as high as wide.
    """

    width: float
    height: float
    columns: int
    rows: int

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("height", self.height)):
            if not (math.isfinite(value) and value > 0.0):
                raise SettingsError(f"Sensor {name} must be a number greater than 0, not {value:g}.")
        if self.columns < 1 or self.rows < 1:
            raise SettingsError(f"A picture of {self.columns} x {self.rows} pixels holds nothing.")
        if not 1e-3 <= self.pitch_x / self.pitch_y <= 1e3:
            raise SettingsError(
                f"Pixels are {self.pitch_x / self.pitch_y:g} times as wide as high, which no camera's are; "
                "give another sensor size."
            )

    @property
    def pitch_x(self) -> float:
        """Width of a pixel on the film in metres."""
        return self.width / self.columns

    @property
    def pitch_y(self) -> float:
        """Height of a pixel on the film in metres."""
        return self.height / self.rows

    def with_pixels(self, columns: int, rows: int) -> Film:
        """Return a film of more or fewer pixels of the same size."""
        return Film(self.pitch_x * columns, self.pitch_y * rows, columns, rows)

    @classmethod
    def from_sensor(
        cls,
        columns: int,
        rows: int,
        pixel_aspect: float = 1.0,
        *,
        sensor_width: float | None = None,
        sensor_height: float | None = None,
    ) -> Film:
        """Return the film behind a picture from the size of the sensor.

        The sensor's width lies along a picture that is wider than high, its height along one that is
        higher than wide; the other side follows from the pixels' aspect, so that circles of confusion
        stay round on the display whatever the sensor's own proportions are.

        Parameters
        ----------
        columns, rows : int
            Pixels of the picture.
        pixel_aspect : float
            Width over height of a pixel.
        sensor_width, sensor_height : float, optional
            Size of the sensor in metres. One is enough.

        Returns
        -------
        Film
            The film that the picture covers.

        Raises
        ------
        SettingsError
            If neither is given or one is not positive.
        """
        if sensor_width is None and sensor_height is None:
            raise SettingsError("The sensor's size is unknown; give its width or its height.")
        wide = columns * pixel_aspect >= rows
        along_width = sensor_height is None or (wide and sensor_width is not None)
        if along_width:
            assert sensor_width is not None
            width = sensor_width
            height = width / columns / pixel_aspect * rows
        else:
            assert sensor_height is not None
            height = sensor_height
            width = height / rows * pixel_aspect * columns
        return cls(width=width, height=height, columns=columns, rows=rows)


@dataclass(frozen=True, slots=True)
class FrameFormat:
    """Blender's description of the image frame: sensor, shift, resolution, border.

    Parameters
    ----------
    sensor_width, sensor_height : float
        Size of the sensor in metres.
    sensor_fit : {"AUTO", "HORIZONTAL", "VERTICAL"}
        Which side of the picture the sensor is fitted to. AUTO lays `sensor_width` along the longer one.
    shift_x, shift_y : float
        Lens shift, in units of the fitted side; positive shift shows more of what is right or above.
    resolution_x, resolution_y : int
        Pixels of the frame before the percentage.
    resolution_percentage : int
        Scale of the resolution in percent.
    pixel_aspect_x, pixel_aspect_y : float
        Shape of a pixel.
    border : tuple of float or None
        Render border (x_min, x_max, y_min, y_max), fractions of the frame with y up, where the picture
        is cropped to it; ``None`` for the whole frame.
    """

    sensor_width: float
    sensor_height: float
    resolution_x: int
    resolution_y: int
    sensor_fit: SensorFit = "AUTO"
    shift_x: float = 0.0
    shift_y: float = 0.0
    resolution_percentage: int = 100
    pixel_aspect_x: float = 1.0
    pixel_aspect_y: float = 1.0
    border: tuple[float, float, float, float] | None = None

    @property
    def frame_size(self) -> tuple[int, int]:
        """Columns and rows of the frame without the border, rounded down as Blender does."""
        scale = self.resolution_percentage
        return max(1, self.resolution_x * scale // 100), max(1, self.resolution_y * scale // 100)

    @property
    def crop(self) -> tuple[int, int, int, int]:
        """Columns and rows (x0, y0, x1, y1) of the picture in the frame, y down, ends excluded."""
        columns, rows = self.frame_size
        if self.border is None:
            return 0, 0, columns, rows
        # Blender keeps the border, and multiplies it, in single precision.
        x_min, x_max, y_min, y_max = np.asarray(self.border, dtype=np.float32)
        left, right = int(x_min * np.float32(columns)), int(x_max * np.float32(columns))
        bottom, top = int(y_min * np.float32(rows)), int(y_max * np.float32(rows))
        return left, rows - top, max(right, left + 1), max(rows - bottom, rows - top + 1)

    @property
    def fitted_pitch(self) -> tuple[float, float]:
        """Width and height of a pixel on the film in metres."""
        columns, rows = self.frame_size
        width = columns * self.pixel_aspect_x
        height = rows * self.pixel_aspect_y
        if self.sensor_fit == "VERTICAL":
            unit = self.sensor_height / height
        elif self.sensor_fit == "HORIZONTAL" or width >= height:
            unit = self.sensor_width / width
        else:
            unit = self.sensor_width / height
        return unit * self.pixel_aspect_x, unit * self.pixel_aspect_y

    @property
    def shift(self) -> tuple[float, float]:
        """Where the optical axis meets the film, from the frame's centre, in metres, y up."""
        columns, rows = self.frame_size
        pitch_x, pitch_y = self.fitted_pitch
        width, height = columns * pitch_x, rows * pitch_y
        along_width = self.sensor_fit == "HORIZONTAL" or (self.sensor_fit == "AUTO" and width >= height)
        side = width if along_width else height
        return -self.shift_x * side, -self.shift_y * side


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole camera: where it stands, how it looks, and the image frame.

    Parameters
    ----------
    world_to_camera : ndarray of shape (4, 4)
        Rigid transform of column vectors into camera coordinates.
    focal_length : float
        Distance of the image plane from the centre of projection in metres.
    film : Film
        The picture on the film.
    axis_x, axis_y : float
        Pixel at which the optical axis meets the picture; its middle unless the lens is shifted or the
        frame cropped.
    clip_start, clip_end : float
        Depths in metres between which something is rendered.
    """

    world_to_camera: FloatArray
    focal_length: float
    film: Film
    axis_x: float
    axis_y: float
    clip_start: float = field(default=0.0)
    clip_end: float = field(default=math.inf)

    @classmethod
    def from_format(
        cls,
        world_to_camera: npt.ArrayLike,
        focal_length: float,
        frame: FrameFormat,
        *,
        clip_start: float = 0.0,
        clip_end: float = math.inf,
    ) -> Camera:
        """Return the camera that Blender's camera and render settings describe.

        Parameters
        ----------
        world_to_camera : array_like of shape (4, 4)
            Inverse of the camera's world matrix. Scale in it is removed, as Cycles removes it.
        focal_length : float
            Focal length in metres.
        frame : FrameFormat
            Sensor, shift, resolution and border.
        clip_start, clip_end : float
            Clipping depths in metres.

        Returns
        -------
        Camera
            The camera, its film cut to the border.
        """
        pitch_x, pitch_y = frame.fitted_pitch
        columns, rows = frame.frame_size
        shift_x, shift_y = frame.shift
        left, top, right, bottom = frame.crop
        return cls(
            world_to_camera=without_scale(world_to_camera),
            focal_length=focal_length,
            film=Film(
                width=(right - left) * pitch_x,
                height=(bottom - top) * pitch_y,
                columns=right - left,
                rows=bottom - top,
            ),
            axis_x=0.5 * columns + shift_x / pitch_x - left,
            axis_y=0.5 * rows - shift_y / pitch_y - top,
            clip_start=clip_start,
            clip_end=clip_end,
        )

    @property
    def matrix(self) -> FloatArray:
        """The 3x4 matrix of TOG 1982, eq. 1: world (x, y, z, w) to pixels (x'' w'', y'' w'', w'').

        Its third row is the depth z' along the optical axis, so w'' is the depth in metres.
        """
        scale_x = self.focal_length / self.film.pitch_x
        scale_y = self.focal_length / self.film.pitch_y
        project = np.array(
            [
                [scale_x, 0.0, -self.axis_x, 0.0],
                [0.0, -scale_y, -self.axis_y, 0.0],
                [0.0, 0.0, -1.0, 0.0],
            ]
        )
        return np.asarray(project @ self.world_to_camera)

    def project(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Project points of the world into the picture.

        Parameters
        ----------
        points : array_like of shape (..., 3)
            World coordinates in metres.

        Returns
        -------
        pixels : ndarray of float64 of shape (..., 2)
            Pixel coordinates (x, y); meaningless where the depth is not positive.
        depth : ndarray of float64 of shape (...)
            Depth z' along the optical axis in metres, negative behind the camera.
        """
        points = np.asarray(points, dtype=np.float64)
        homogeneous = points @ self.matrix[:, :3].T + self.matrix[:, 3]
        depth = homogeneous[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = homogeneous[..., :2] / depth[..., np.newaxis]
        return pixels, depth


def camera_rotation(pan: float, tilt: float, swing: float) -> FloatArray:
    """Return the rotation from world to camera coordinates of a camera aimed by three angles.

    A camera at pan, tilt and swing 0 looks along the world's +y with +z up. Pan turns it to the left
    about the vertical, tilt raises it, swing rolls it counter-clockwise as it looks.

    Parameters
    ----------
    pan, tilt, swing : float
        Angles in radians.

    Returns
    -------
    ndarray of shape (3, 3)
        Orthonormal matrix for column vectors.
    """
    level = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return np.asarray(_about_z(-swing) @ _about_x(-tilt) @ level @ _about_z(-pan))


def pan_tilt_swing(rotation: npt.ArrayLike) -> tuple[float, float, float]:
    """Return the angles that `camera_rotation` turns into a rotation.

    Parameters
    ----------
    rotation : array_like of shape (3, 3)
        World to camera, orthonormal.

    Returns
    -------
    tuple of float
        Pan in (-pi, pi], tilt in [-pi/2, pi/2], swing in (-pi, pi], radians. Looking straight up or
        down leaves pan and swing tied together; pan is then 0.
    """
    r = np.asarray(rotation, dtype=np.float64)
    forward = -r[2]
    tilt = math.asin(max(-1.0, min(1.0, forward[2])))
    pan = 0.0 if abs(forward[2]) > 1.0 - 1e-12 else math.atan2(-forward[0], forward[1])
    roll = r @ camera_rotation(pan, tilt, 0.0).T
    return pan, tilt, math.atan2(roll[0, 1], roll[0, 0])


def without_scale(matrix: npt.ArrayLike) -> FloatArray:
    """Return a world-to-camera matrix with the scale of the camera's object removed.

    Parameters
    ----------
    matrix : array_like of shape (4, 4)
        World to camera, for column vectors.

    Returns
    -------
    ndarray of shape (4, 4)
        The same camera with unit axes.

    Raises
    ------
    SettingsError
        If the matrix has no inverse.
    """
    try:
        world = np.linalg.inv(np.asarray(matrix, dtype=np.float64))
    except np.linalg.LinAlgError:
        raise SettingsError("The camera's scale is 0; give the camera object a scale of 1.") from None
    world[:3, :3] /= np.linalg.norm(world[:3, :3], axis=0)
    return np.asarray(np.linalg.inv(world))


def _about_x(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_z(angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
