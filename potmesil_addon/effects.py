"""What a real lens, filter, film and sensor add to the ideal camera: settings of all special effects.

Each effect is one dataclass; one that is ``None`` in `Effects` is off and costs nothing. Lengths are metres
and angles radians, as everywhere in the core; the ``unit`` of a field is the one that people type.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any, Final, Literal, TypeAlias, get_args

from .errors import SettingsError

DistortionModel = Literal["brown", "polynomial", "division", "nuke"]
"""Blender's own lens models of movie clips; ``brown`` is Brown and Conrady's."""

Color: TypeAlias = tuple[float, float, float]

DISTORTION_MODELS: Final[tuple[DistortionModel, ...]] = get_args(DistortionModel)

UNITS: Final[dict[str, float]] = {
    "": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "deg": math.pi / 180.0,
    "1/m": 1.0,
    "stops": 1.0,
    "e-": 1.0,
}
"""What one of each unit that people type is in the core's units."""


def _number(default: float, least: float, most: float, unit: str = "", *, about: str) -> Any:
    """Return a dataclass field with its range, in the core's units, and the unit that people type."""
    return field(default=default, metadata={"least": least, "most": most, "unit": unit, "about": about})


def _flag(default: bool, *, about: str) -> Any:
    return field(default=default, metadata={"flag": True, "unit": "", "about": about})


def _path(*, about: str) -> Any:
    return field(default="", metadata={"path": True, "unit": "", "about": about})


@dataclass(frozen=True, slots=True)
class _Effect:
    """Raises SettingsError where a number is out of the range that its field states."""

    def __post_init__(self) -> None:
        for item in fields(self):
            check_value(f"{effect_name(type(self))}.{item.name}", getattr(self, item.name), item)


@dataclass(frozen=True, slots=True)
class Pupil(_Effect):
    """The shape of the light that a point out of focus becomes, beyond blades, rotation and squeeze."""

    blade_curvature: float = _number(0.0, 0.0, 1.0, about="0 for straight blades, 1 for a round aperture")
    obstruction: float = _number(
        0.0, 0.0, 0.95, about="diameter of a mirror lens's central obstruction over the aperture's"
    )
    apodisation: float = _number(
        0.0, 0.0, 10.0, about="density of a soft rim: light at radius r is exp(-apodisation r^2)"
    )
    spherical_aberration: float = _number(
        0.0, -1.0, 1.0, "mm", about="how far behind the axis' focus rays at the rim of f/1 meet"
    )
    image: str = _path(about="picture of the aperture, in place of blades and obstruction")


@dataclass(frozen=True, slots=True)
class FocalSurface(_Effect):
    """Where the lens is sharp: a plane that is tilted, a bowl."""

    tilt: float = _number(
        0.0, -math.pi / 4, math.pi / 4, "deg", about="lens tilted up: what is above is sharp nearer by"
    )
    swing: float = _number(
        0.0, -math.pi / 4, math.pi / 4, "deg", about="lens swung right: what is right is sharp nearer by"
    )
    curvature: float = _number(
        0.0, -1000.0, 1000.0, "1/m", about="of the image surface: positive is sharp nearer by at the border"
    )


@dataclass(frozen=True, slots=True)
class ChromaticAberration(_Effect):
    """Colours that focus at other distances (longitudinal) and at other sizes (lateral) than green."""

    focus_red: float = _number(0.0, -0.01, 0.01, "mm", about="how far behind green's focus red's lies")
    focus_blue: float = _number(0.0, -0.01, 0.01, "mm", about="how far behind green's focus blue's lies")
    size_red: float = _number(0.0, -0.1, 0.1, about="by what share red's picture is larger than green's")
    size_blue: float = _number(0.0, -0.1, 0.1, about="by what share blue's picture is larger than green's")


@dataclass(frozen=True, slots=True)
class Vignetting(_Effect):
    """Light that is lost towards the corners."""

    natural: float = _number(1.0, 0.0, 1.0, about="share of the fall with the fourth power of the cosine")
    mechanical: float = _number(
        0.0, 0.0, 1.0, about="how far apart the barrel's two ends are seen from the corners, in diameters"
    )
    fastest_f_stop: float = _number(
        0.0, 0.0, 128.0, about="f-stop at which the barrel is as wide as the aperture; 0 is the present one"
    )


@dataclass(frozen=True, slots=True)
class Distortion(_Effect):
    """Straight lines that the lens bends, by the models of Blender's movie clips."""

    model: DistortionModel = field(
        default="brown",
        metadata={"choices": DISTORTION_MODELS, "unit": "", "about": "formula of the movie clip editor"},
    )
    k1: float = _number(0.0, -10.0, 10.0, about="second order of the radius; negative is a barrel (brown)")
    k2: float = _number(0.0, -10.0, 10.0, about="fourth order")
    k3: float = _number(0.0, -10.0, 10.0, about="sixth order (brown, polynomial)")
    k4: float = _number(0.0, -10.0, 10.0, about="eighth order (brown)")
    p1: float = _number(0.0, -10.0, 10.0, about="first tangential coefficient (brown)")
    p2: float = _number(0.0, -10.0, 10.0, about="second tangential coefficient (brown)")


@dataclass(frozen=True, slots=True)
class Diffraction(_Effect):
    """The Fraunhofer pattern of the aperture around everything: stars about lights."""

    strength: float = _number(1.0, 0.0, 1.0, about="share of the light that is diffracted; 1 is physical")
    f_stop: float = _number(0.0, 0.0, 1024.0, about="in place of the lens's for the pattern; 0 is the lens's")
    spectral: bool = _flag(True, about="all wavelengths, or only one for each primary")


@dataclass(frozen=True, slots=True)
class StarFilter(_Effect):
    """Glass before the lens with fine parallel grooves, which diffract light across them."""

    lines: int = _number(2, 1, 8, about="directions of grooves, each of which gives two points")
    rotation: float = _number(0.0, -math.inf, math.inf, "deg", about="of the first streak, counter-clockwise")
    strength: float = _number(0.1, 0.0, 1.0, about="share of the light that falls on grooves")
    groove_width: float = _number(
        20e-6, 1e-6, 1e-2, "um", about="the narrower, the longer the streaks: to wavelength F / width"
    )


@dataclass(frozen=True, slots=True)
class ImageFilter(_Effect):
    """A picture of what a point of light becomes, such as a glare that was photographed."""

    image: str = _path(about="picture whose middle is the point's place")
    strength: float = _number(0.1, 0.0, 1.0, about="share of the light that takes its form")
    size: float = _number(0.25, 0.001, 4.0, about="width of the picture over the frame's")
    rotation: float = _number(0.0, -math.inf, math.inf, "deg", about="counter-clockwise")


@dataclass(frozen=True, slots=True)
class Exposure(_Effect):
    """Film sensitivity, aperture and exposure time brighten the picture (TOG 1982, section 3.2)."""

    sensitivity: float = _number(100.0, 1.0, 1e7, about="ISO speed of film or sensor")
    normal_ev: float = _number(
        8.6, -20.0, 30.0, "stops", about="exposure value at ISO 100 that leaves the picture as it is"
    )
    density: float = _number(0.0, -20.0, 30.0, "stops", about="neutral filter before the lens")
    tint: Color = field(
        default=(1.0, 1.0, 1.0),
        metadata={
            "color": True,
            "unit": "",
            "about": "share of red, green and blue that a filter lets through",
        },
    )


@dataclass(frozen=True, slots=True)
class FilmGrain(_Effect):
    """Silver or dye clouds of an emulsion, in density."""

    granularity: float = _number(
        10.0, 0.0, 200.0, about="RMS granularity: 1000 times the deviation of density over 48 um"
    )
    size: float = _number(10e-6, 1e-6, 1e-3, "um", about="diameter of a grain on the film")
    color: float = _number(0.5, 0.0, 1.0, about="0 for one emulsion for all colours, 1 for three apart")
    seed: int = _number(0, 0, 2**31 - 1, about="another seed is another film; each frame has its own grain")


@dataclass(frozen=True, slots=True)
class SensorNoise(_Effect):
    """Photons counted and charge read out by an electronic sensor."""

    full_well: float = _number(50_000.0, 10.0, 1e7, "e-", about="electrons of white at ISO 100")
    read_noise: float = _number(3.0, 0.0, 1e4, "e-", about="deviation of each pixel's read-out")
    seed: int = _number(0, 0, 2**31 - 1, about="another seed is another take; each frame has its own noise")


@dataclass(frozen=True, slots=True)
class Effects:
    """All special effects; what is ``None`` is off."""

    pupil: Pupil | None = None
    focal_surface: FocalSurface | None = None
    chromatic: ChromaticAberration | None = None
    vignetting: Vignetting | None = None
    distortion: Distortion | None = None
    diffraction: Diffraction | None = None
    star: StarFilter | None = None
    image_filter: ImageFilter | None = None
    exposure: Exposure | None = None
    grain: FilmGrain | None = None
    noise: SensorNoise | None = None


KINDS: Final[dict[str, type[_Effect]]] = {
    "pupil": Pupil,
    "focal_surface": FocalSurface,
    "chromatic": ChromaticAberration,
    "vignetting": Vignetting,
    "distortion": Distortion,
    "diffraction": Diffraction,
    "star": StarFilter,
    "image_filter": ImageFilter,
    "exposure": Exposure,
    "grain": FilmGrain,
    "noise": SensorNoise,
}
"""The effects by their names, which are the same on the command line, in reports and in the panel."""


def effect_name(kind: type[_Effect]) -> str:
    """Return the name of an effect."""
    return next(name for name, its_kind in KINDS.items() if its_kind is kind)


def effects_from_json(values: Mapping[str, Any]) -> Effects:
    """Return the effects that plain values describe.

    Parameters
    ----------
    values : mapping
        For each effect that is on a mapping of its fields, in the core's units; ``None`` for one that is
        off. As `dataclasses.asdict` makes of `Effects`.

    Returns
    -------
    Effects
        The effects.

    Raises
    ------
    SettingsError
        If an effect or a field is unknown or a value is out of its range.
    """
    found: dict[str, Any] = {}
    for name, said in values.items():
        if name not in KINDS:
            raise SettingsError(f"There is no effect {name!r:.80}; there are {', '.join(KINDS)}.")
        if said is None:
            continue
        kind = KINDS[name]
        known = {item.name for item in fields(kind)}
        unknown = sorted(set(said) - known)
        if unknown:
            raise SettingsError(f"'{name}' has no {unknown[0]!r:.80}; it has {', '.join(sorted(known))}.")
        found[name] = kind(**{key: tuple(v) if isinstance(v, list) else v for key, v in said.items()})
    return Effects(**found)


def check_value(name: str, value: Any, item: Field[Any]) -> None:
    """Raise SettingsError unless a field may have a value.

    Parameters
    ----------
    name : str
        What the sentence calls it.
    value : object
        In the core's units.
    item : Field
        Of one of the effects.
    """
    about = item.metadata
    if "choices" in about:
        if value not in about["choices"]:
            raise SettingsError(f"{name} is one of {', '.join(about['choices'])}, not {value!r:.80}.")
    elif "color" in about:
        if len(value) != 3 or not all(math.isfinite(v) and v >= 0.0 for v in value):
            raise SettingsError(f"{name} must be three numbers of 0 or more.")
    elif "least" in about:
        least, most, unit = about["least"], about["most"], about["unit"]
        if not (math.isfinite(value) and least <= value <= most):
            scale = UNITS[unit]
            limits = f"from {least / scale:g} to {most / scale:g} {unit}".rstrip()
            if math.isinf(least):
                limits = "a finite number"
            raise SettingsError(f"{name} must be {limits}, not {value / scale:g}.")
