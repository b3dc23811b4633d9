"""Geometrical optics of a thin lens with an aperture (TOG 1982, sections 2.2 and 2.3).

Lengths are metres, angles radians. Distances are measured along the optical axis from the lens and are
positive in front of it; ``inf`` is a valid distance. The signed circle of confusion is negative for
points nearer than the plane in focus.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from .errors import SettingsError

FloatArray = npt.NDArray[np.float64]

CocModel = Literal["cycles", "paper"]
"""How an out-of-focus point is imaged.

``cycles`` holds the field of view while the lens focuses, as Cycles does: the image plane stays at the
focal length. ``paper`` moves the image plane to the lens law's image distance (TOG 1982, eq. 8).
"""

COC_MODELS: Final[tuple[CocModel, ...]] = ("cycles", "paper")

_MOST_BLADES: Final = 1000
_LEAST_RATIO: Final = 1e-3
"""As files are believed, see `exr`; beyond them tables of an aperture's shape take all memory."""

DEFAULT_CRITERION: Final = 1000.0
"""Distance over the smallest diameter that the eye resolves at it (TOG 1982, section 2.2)."""


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens, its aperture and where it is focused.

    Parameters
    ----------
    focal_length : float
        Focal length F in metres, greater than 0.
    f_stop : float
        Aperture number n: focal length over aperture diameter, greater than 0.
    focus_distance : float
        Distance D of the plane in focus in metres, greater than 0; ``inf`` focuses at infinity.
    blades : int
        Blades of the iris. Fewer than 3 is a round aperture, as in Cycles.
    blade_rotation : float
        Rotation of the iris in radians, counter-clockwise as the camera looks.
    anamorphic_ratio : float
        Height over width of the aperture, greater than 0.

    Raises
    ------
    SettingsError
        If a value is outside its range.
    """

    focal_length: float
    f_stop: float
    focus_distance: float
    blades: int = 0
    blade_rotation: float = 0.0
    anamorphic_ratio: float = 1.0

    def __post_init__(self) -> None:
        _require_positive("Focal length", self.focal_length)
        _require_positive("F-stop", self.f_stop)
        _require_positive("Focus distance", self.focus_distance, infinite=True)
        _require_positive("Anamorphic ratio", self.anamorphic_ratio)
        if not math.isfinite(self.blade_rotation):
            raise SettingsError(f"Blade rotation must be a finite angle, not {self.blade_rotation}.")
        if not 0 <= self.blades <= _MOST_BLADES:
            raise SettingsError(f"Blades must be 0 (round) to {_MOST_BLADES}, not {self.blades}.")
        if not _LEAST_RATIO <= self.anamorphic_ratio <= 1.0 / _LEAST_RATIO:
            raise SettingsError(f"Anamorphic ratio must be 0.001 to 1000, not {self.anamorphic_ratio:g}.")

    @property
    def aperture_diameter(self) -> float:
        """Diameter d = F/n of the aperture in metres."""
        return self.focal_length / self.f_stop

    @property
    def is_round(self) -> bool:
        """Whether the aperture is an ellipse (a circle when the anamorphic ratio is 1)."""
        return self.blades < 3


@dataclass(frozen=True, slots=True)
class DepthOfField:
    """What appears sharp, in metres; `far` and `total` are ``inf`` from the hyperfocal distance on."""

    hyperfocal: float
    near: float
    far: float

    @property
    def total(self) -> float:
        """Distance between the near and the far limit in metres."""
        return self.far - self.near


def image_distance(distance: npt.ArrayLike, focal_length: float) -> FloatArray:
    """Return the distance V behind the lens at which a point converges (TOG 1982, eq. 2 and 8).

    Parameters
    ----------
    distance : array_like
        Object distances in metres, any shape; ``inf`` gives the focal length.
    focal_length : float
        Focal length F in metres.

    Returns
    -------
    ndarray of float64
        V = F D / (D - F) in metres, same shape. ``inf`` where the distance equals the focal length and
        negative (a virtual image) where it is smaller.
    """
    d = np.asarray(distance, dtype=np.float64)
    with np.errstate(divide="ignore", over="ignore"):
        # Divided through by D so that infinity needs no case of its own.
        return np.asarray(focal_length / (1.0 - focal_length / d))


def hyperfocal_distance(lens: Lens, criterion: float = DEFAULT_CRITERION) -> float:
    """Return the distance H = criterion F / n of greatest depth of field (TOG 1982, section 2.2).

    Parameters
    ----------
    lens : Lens
        The lens; its focus distance does not matter.
    criterion : float
        Distance over the smallest diameter resolved at it.

    Returns
    -------
    float
        H in metres.

    Raises
    ------
    SettingsError
        If the criterion is not a positive number.
    """
    _require_positive("Criterion", criterion)
    return criterion * lens.aperture_diameter


def depth_of_field(lens: Lens, criterion: float = DEFAULT_CRITERION) -> DepthOfField:
    """Return the near and far limits of what appears in focus (TOG 1982, eqs. 6 and 7).

    Parameters
    ----------
    lens : Lens
        The focused lens.
    criterion : float
        Distance over the smallest diameter resolved at it.

    Returns
    -------
    DepthOfField
        Hyperfocal distance, near and far limit in metres.

    Raises
    ------
    SettingsError
        If the criterion is not a positive number.
    """
    h = hyperfocal_distance(lens, criterion)
    d = lens.focus_distance
    # D H / (H + D), divided through by D so that D = inf gives H.
    near = h / (h / d + 1.0)
    far = d * h / (h - d) if d < h else math.inf
    return DepthOfField(hyperfocal=h, near=near, far=far)


def depth_of_field_for_circle(lens: Lens, circle: float, model: CocModel = "cycles") -> DepthOfField:
    """Return the limits at which the circle of confusion grows to a given diameter on the film.

    This is the photographer's criterion: `circle` follows from the film format (its diagonal over 1500
    is customary) in place of the eye's resolving power.

    Parameters
    ----------
    lens : Lens
        The focused lens.
    circle : float
        Largest acceptable diameter on the film in metres, greater than 0.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.

    Returns
    -------
    DepthOfField
        Hyperfocal distance, near and far limit in metres.

    Raises
    ------
    SettingsError
        If `circle` is not positive, or the paper's lens is focused within its focal length.
    """
    _require_positive("Circle of confusion", circle)
    scale = circle_scale(lens, model)
    # c(P) = s (1/D - 1/P) D for every model; solved for P at -circle and +circle.
    reach = circle / scale
    near = 1.0 / (1.0 / lens.focus_distance + reach)
    inverse_far = 1.0 / lens.focus_distance - reach
    far = 1.0 / inverse_far if inverse_far > 0.0 else math.inf
    breathing = lens.focal_length if model == "paper" else 0.0
    hyperfocal = lens.focal_length * lens.aperture_diameter / circle + breathing
    return DepthOfField(hyperfocal=hyperfocal, near=near, far=far)


def circle_of_confusion(depth: npt.ArrayLike, lens: Lens, model: CocModel = "cycles") -> FloatArray:
    """Return the signed diameter of the circle of confusion on the image plane (TOG 1982, eq. 9).

    The papers' letters worked out, with P the point's and D the focused distance::

        paper   c = (F^2 / n) (P - D) / (P (D - F))
        cycles  c = (F^2 / n) (P - D) / (P D)

    Parameters
    ----------
    depth : array_like
        Distances P in metres, any shape, greater than 0; ``inf`` is valid.
    lens : Lens
        The focused lens.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.

    Returns
    -------
    ndarray of float64
        Diameters in metres, same shape; negative nearer than the plane in focus, 0 on it.

    Raises
    ------
    SettingsError
        If the paper's lens is focused within its focal length.
    """
    p = np.asarray(depth, dtype=np.float64)
    scale = circle_scale(lens, model)
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(scale * (1.0 / lens.focus_distance - 1.0 / p))


def circle_of_confusion_at_infinity(lens: Lens, model: CocModel = "cycles") -> float:
    """Return the diameter in metres that circles approach at infinite distance.

    The papers print V_P / (n F) - F / n, which is no length; eq. 9 gives (V_D - F) / n for the papers'
    lens and F^2 / (n D) for Cycles'.

    Parameters
    ----------
    lens : Lens
        The focused lens.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.

    Returns
    -------
    float
        The limit, 0 or more.
    """
    return float(circle_of_confusion(math.inf, lens, model))


def circle_scale(lens: Lens, model: CocModel) -> float:
    """Return what circles of confusion scale with.

    Parameters
    ----------
    lens : Lens
        The focused lens.
    model : {"cycles", "paper"}
        How out-of-focus points are imaged.

    Returns
    -------
    float
        s in metres squared so that c(P) = s (1/D - 1/P); see `circle_of_confusion`.

    Raises
    ------
    SettingsError
        If the paper's lens is focused within its focal length.
    """
    square = lens.focal_length * lens.aperture_diameter
    if model == "cycles":
        return square
    if lens.focus_distance <= lens.focal_length:
        raise SettingsError(
            f"A lens of {lens.focal_length * 1000:g} mm cannot focus at {lens.focus_distance * 1000:g} mm; "
            "choose a focus distance beyond the focal length or the Cycles model."
        )
    # D / (D - F), divided through by D so that D = inf gives 1.
    return square / (1.0 - lens.focal_length / lens.focus_distance)


def _require_positive(name: str, value: float, *, infinite: bool = False) -> None:
    if math.isnan(value) or value <= 0.0 or (math.isinf(value) and not infinite):
        raise SettingsError(f"{name} must be a number greater than 0, not {value:g}.")
