"""The shutter: how much light is let in when, and where on the film (1983, section 3.2).

Times are in frames, counted from the frame that was rendered. A shutter opens for a whole interval, for
several openings in it (multiple exposure), or with an openness that rises and falls (a curve, the blades
of a between-the-lens shutter). A focal-plane shutter is a slit that travels over the film, so that each
row or column of pixels has its own times.
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from . import schemas
from .errors import SettingsError
from .lens import FloatArray

ShutterPosition = Literal["start", "center", "end"]
"""Where the frame's own time lies in the interval, as Blender names it."""

SlitEdge = Literal["top", "bottom", "left", "right"]
"""The side of the picture that a travelling slit exposes first."""

Curtain = Literal["first", "second"]
"""Whether a flash fires when the shutter has opened or before it closes."""

Curve = tuple[tuple[float, float], ...]
Openings = tuple[tuple[float, float], ...]

SHUTTER_POSITIONS: Final[tuple[ShutterPosition, ...]] = get_args(ShutterPosition)
SLIT_EDGES: Final[tuple[SlitEdge, ...]] = get_args(SlitEdge)

CURTAINS: Final[tuple[Curtain, ...]] = get_args(Curtain)

MAX_FRAMES: Final = 1e4
"""Longest exposure: far past what an animation's paths tell."""

MAX_OPENINGS: Final = 1000
MAX_FLASHES: Final = 1000

_BLADE_STEPS: Final = 32
"""Straight pieces for the parabola that the area of an opening aperture follows."""

_LEAST_BLADE_TIME: Final = 1e-9
"""Share of the exposure below which blades open at once."""

_LEAST_OPENING: Final = 1e-12
"""Length of an opening, as a share of all of them, below which it is none."""

_REPEATED: Final = re.compile(r"(\d+)x([^@]+)@(.+)")


@dataclass(frozen=True, slots=True)
class Slit:
    """The slit of a focal-plane or rolling shutter.

    Parameters
    ----------
    edge : {"top", "bottom", "left", "right"}
        The side of the picture that is exposed first.
    width : float
        Time that a point of the film is exposed, as a share of the whole interval, from 0 (an
        instant) to 1 (all of the film at once). Cycles' rolling shutter duration.

    Raises
    ------
    SettingsError
        If the width is not within 0 and 1.
    """

    edge: SlitEdge = "top"
    width: float = 0.1

    def __post_init__(self) -> None:
        if self.edge not in SLIT_EDGES:
            raise SettingsError(f"A slit starts at the {', '.join(SLIT_EDGES)}, not '{self.edge}'.")
        if not 0.0 <= self.width <= 1.0:
            raise SettingsError(f"The slit's width must be from 0 to 1, not {self.width:g}.")


@dataclass(frozen=True, slots=True)
class Flash:
    """Flashes while the shutter is open, beside the ambient light.

    The light of a flash falls on all of the scene alike: samples do not tell one lamp from another.

    Parameters
    ----------
    curtain : {"first", "second"}
        With which end of the exposure flashes are in step.
    share : float
        Share of the exposure's light that is theirs, from 0 (no flash) to 1 (no ambient light).
    duration : float
        How long each one lasts, in units of T, greater than 0.
    count : int
        Number of flashes: more than one is a strobe, evenly over the exposure.

    Raises
    ------
    SettingsError
        If a value is out of range or the flashes overlap.
    """

    curtain: Curtain = "second"
    share: float = 0.5
    duration: float = 0.01
    count: int = 1

    def __post_init__(self) -> None:
        if self.curtain not in CURTAINS:
            raise SettingsError(
                f"A flash is in step with the {' or '.join(CURTAINS)} curtain, not '{self.curtain}'."
            )
        if not 0.0 <= self.share <= 1.0:
            raise SettingsError(f"A flash's share of the light must be from 0 to 1, not {self.share:g}.")
        if not 0.0 < self.duration <= 1.0:
            raise SettingsError(f"A flash lasts from 0 to 1 of the exposure, not {self.duration:g}.")
        if not 1 <= self.count <= MAX_FLASHES:
            raise SettingsError(f"There are 1 to {MAX_FLASHES} flashes, not {self.count}.")
        if self.count * self.duration > 1.0:
            raise SettingsError(
                f"{self.count} flashes of {self.duration:g} of the exposure overlap; make them shorter."
            )


@dataclass(frozen=True, slots=True)
class ShutterAttributes:
    """What a file, or the artist, says of the exposure; ``None`` where it is not said.

    Parameters
    ----------
    exposure_time : float or None
        Seconds, as the standard EXR attribute has it.
    frames_per_second : float or None
        Frame rate.
    frames : float or None
        Length of the interval in frames; wins over `exposure_time`.
    position : {"start", "center", "end"} or None
        Where the frame lies in the interval.
    curve : tuple of (float, float) or None
        See `Shutter`.
    openings : tuple of (float, float) or None
        See `Shutter`.
    blade_time : float or None
        See `Shutter`.
    slit : Slit or None
        The slit; ``None`` for a shutter that exposes the whole film at once.
    flash : Flash or None
        Flashes beside the ambient light.
    """

    exposure_time: float | None = None
    frames_per_second: float | None = None
    frames: float | None = None
    position: ShutterPosition | None = None
    curve: Curve | None = None
    openings: Openings | None = None
    blade_time: float | None = None
    slit: Slit | None = None
    flash: Flash | None = None

    def over(self, other: ShutterAttributes) -> ShutterAttributes:
        """Return these attributes, and the other's where these say nothing."""
        own = {name: getattr(self, name) for name in self.__dataclass_fields__}
        said = {name: value for name, value in own.items() if value is not None}
        if "exposure_time" in said and "frames" not in said:
            # A length in frames from the file would win over the seconds asked for here.
            said["frames"] = None
        return replace(other, **said)

    @property
    def needs_length(self) -> bool:
        """Whether something is said that means nothing without the length of the exposure."""
        slit = self.slit is not None and self.slit.width < 1.0
        flash = self.flash is not None and self.flash.share > 0.0
        return bool(self.position or self.curve or self.openings or self.blade_time or slit or flash)

    def resolve(self) -> Shutter | None:
        """Return the shutter, or ``None`` where its length is not known."""
        frames = self.frames
        if frames is None and self.exposure_time is not None and self.frames_per_second is not None:
            frames = self.exposure_time * self.frames_per_second
        if frames is None:
            return None
        return Shutter(
            frames=frames,
            position=self.position or "center",
            curve=self.curve or (),
            openings=self.openings or (),
            blade_time=self.blade_time or 0.0,
            slit=self.slit,
            flash=self.flash,
        )


@dataclass(frozen=True, slots=True)
class Shutter:
    """A shutter with everything known.

    Parameters
    ----------
    frames : float
        Exposure time T in frames, 0 or more.
    position : {"start", "center", "end"}
        Where the frame's own time lies in the interval.
    curve : tuple of (float, float)
        Openness over the interval: (time from 0 to 1, openness from 0 to 1) pairs in order of time,
        joined by straight lines; empty for a shutter that is open all the time.
    openings : tuple of (float, float)
        Openings of a multiple exposure: (begin, end) pairs in units of T from the beginning of the
        interval, in order and apart. The interval is then as long as the last one needs, at least T.
        Empty for one opening of T.
    blade_time : float
        Between-the-lens shutter: share of T (of the opening, where that is shorter), 0 to 0.5, that the
        blades take to open, and again to close. The radius of the aperture grows evenly meanwhile.
    slit : Slit or None
        Focal-plane or rolling shutter.
    flash : Flash or None
        Flashes beside the ambient light, which the curve, openings and blades let in.

    Raises
    ------
    SettingsError
        If a value is out of range, no light is let in, or a flash falls on a film of which a slit uncovers
        a part only.
    """

    frames: float = 0.5
    position: ShutterPosition = "center"
    curve: Curve = ()
    openings: Openings = ()
    blade_time: float = 0.0
    slit: Slit | None = None
    flash: Flash | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.frames <= MAX_FRAMES:
            raise SettingsError(
                f"The shutter must be open for 0 to {MAX_FRAMES:g} frames, not {self.frames:g}."
            )
        if self.position not in SHUTTER_POSITIONS:
            raise SettingsError(
                f"The shutter's position is one of {', '.join(SHUTTER_POSITIONS)}, not '{self.position}'."
            )
        if not 0.0 <= self.blade_time <= 0.5:
            raise SettingsError(
                f"The shutter's blades take 0 to 0.5 of the exposure, not {self.blade_time:g}."
            )
        _check_curve(self.curve)
        _check_openings(self.openings)
        if not self._ambient()[:, 2:].any():
            raise SettingsError("The shutter's curve is 0 all the time it is open; raise it.")
        if not self._flashes:
            return
        if self.slit is not None and self.slit.width < 1.0:
            raise SettingsError(
                "A flash needs all of the film uncovered at once; leave out the slit, or the flash."
            )
        # One that finds the shutter shut is refused now.
        self.pieces()

    @property
    def length(self) -> float:
        """Length of the interval in frames, from the first opening to the last closing."""
        return self.frames / self._unit

    @property
    def interval(self) -> tuple[float, float]:
        """Beginning and end of the interval in frames."""
        before = {"start": 0.0, "center": 0.5, "end": 1.0}[self.position]
        begin = -before * self.length
        return begin, begin + self.length

    def times(self, shares: npt.ArrayLike) -> FloatArray:
        """Return when given shares of the light have come in.

        Parameters
        ----------
        shares : array_like
            Shares of the exposure from 0 to 1.

        Returns
        -------
        ndarray of float64, the shape of `shares`
            Position in the interval, from 0 to 1. Between two openings no share falls.
        """
        shares = np.asarray(shares, dtype=np.float64)
        t0, t1, d0, d1 = self.pieces().T
        light = 0.5 * (d0 + d1) * (t1 - t0)
        keep = light > 0.0
        t0, t1, d0, d1, light = t0[keep], t1[keep], d0[keep], d1[keep], light[keep]
        ends = np.cumsum(light)
        wanted = np.clip(shares, 0.0, 1.0) * ends[-1]
        piece = np.minimum(np.searchsorted(ends, wanted, side="left"), light.size - 1)
        rest = np.clip(wanted - (ends - light)[piece], 0.0, light[piece])
        width, slope = (t1 - t0)[piece], (d1 - d0)[piece]
        # rest = (d0 s + slope s^2 / 2) width, solved for s without cancellation.
        root = np.sqrt(np.maximum(d0[piece] ** 2 + 2.0 * slope * rest / width, 0.0))
        below = d0[piece] + root
        s = np.divide(2.0 * rest / width, below, out=np.zeros_like(below), where=below > 0.0)
        return np.asarray(t0[piece] + np.clip(s, 0.0, 1.0) * width)

    def light(self, begin: float, end: float) -> float:
        """Return the share of the exposure between two positions (0 to 1) in the interval."""
        t0, t1, d0, d1 = self.pieces().T
        a, b = np.clip(begin, t0, t1), np.clip(end, t0, t1)
        slope = (d1 - d0) / (t1 - t0)
        part = (b - a) * (d0 + slope * (0.5 * (a + b) - t0))
        return float(part.sum() / (0.5 * (d0 + d1) * (t1 - t0)).sum())

    def opening(self, position: npt.ArrayLike) -> FloatArray:
        """Return the aperture's radius over its full one at positions (0 to 1) in the interval.

        It is 1 but for a between-the-lens shutter's opening and closing blades.
        """
        position = np.asarray(position, dtype=np.float64)
        if self.blade_time < _LEAST_BLADE_TIME:
            return np.ones_like(position)
        radius = np.zeros_like(position)
        for begin, end in self.opened():
            blades = self.blade_time * min(end - begin, self._unit)
            edge = np.minimum(position - begin, end - position) / blades
            radius = np.maximum(radius, np.clip(edge, 0.0, 1.0))
        return radius

    def frame_times(self, position: npt.ArrayLike, along: npt.ArrayLike = 0.5) -> FloatArray:
        """Return frame times of positions in the interval at places of the picture.

        Parameters
        ----------
        position : array_like
            Positions from 0 to 1.
        along : array_like
            Place in the direction in which the slit travels, 0 where it starts and 1 where it ends.

        Returns
        -------
        ndarray of float64
            Times in frames. A slit of width w puts the position t at a place s to
            (t - 1/2) w + (s - 1/2)(1 - w) + 1/2, as Cycles does.
        """
        position = np.asarray(position, dtype=np.float64)
        if self.slit is not None:
            w = self.slit.width
            position = (position - 0.5) * w + (np.asarray(along) - 0.5) * (1.0 - w) + 0.5
        begin, end = self.interval
        return np.asarray(begin + position * (end - begin))

    @property
    def _unit(self) -> float:
        """T as a share of the interval."""
        return 1.0 / max(1.0, self.openings[-1][1]) if self.openings else 1.0

    def opened(self) -> Openings:
        """Return the openings as positions from 0 to 1 in the interval."""
        if not self.openings:
            return ((0.0, 1.0),)
        return tuple((begin * self._unit, end * self._unit) for begin, end in self.openings)

    @property
    def _flashes(self) -> Openings:
        """Begin and end of each flash as positions in the interval, evenly over the time that it is open."""
        flash = self.flash
        if flash is None or flash.share == 0.0:
            return ()
        # Between-the-lens shutters are in step when their blades are open.
        opened = [
            (begin + blades, end - blades)
            for begin, end in self.opened()
            for blades in [self.blade_time * min(end - begin, self._unit)]
        ]
        lengths = np.array([end - begin for begin, end in opened])
        if not (lengths > 0.0).all():
            raise SettingsError("The blades are never open for a flash; shorten their time.")
        spacing = float(lengths.sum()) / flash.count
        duration = min(flash.duration * self._unit, spacing)
        before = np.cumsum(lengths) - lengths
        flashes = []
        for n in range(flash.count):
            start = n * spacing + (0.0 if flash.curtain == "first" else spacing - duration)
            which = int(np.searchsorted(before, start + _LEAST_BLADE_TIME, side="right")) - 1
            begin, end = opened[which]
            # None goes on while the shutter is shut.
            at = min(begin + start - float(before[which]), max(begin, end - duration))
            flashes.append((at, min(at + duration, end)))
        return tuple(flashes)

    def pieces(self) -> FloatArray:
        """Return (begin, end, light at begin, light at end) of pieces in which light changes evenly."""
        ambient, flashes = self._ambient(), self._flashes
        if not flashes:
            return ambient
        assert self.flash is not None
        # Ambient light is cut where a flash begins or ends.
        edges = np.unique([*ambient[:, :2].reshape(-1), *np.reshape(flashes, -1)])
        begin, end = edges[:-1], edges[1:]
        middle = 0.5 * (begin + end)
        piece = np.clip(np.searchsorted(ambient[:, 0], middle, side="right") - 1, 0, len(ambient) - 1)
        t0, t1, d0, d1 = ambient[piece].T
        slope = (d1 - d0) / (t1 - t0)
        # Between two openings it is dark.
        lit = (middle > t0) & (middle < t1)
        first, last = (np.where(lit, d0 + slope * (t - t0), 0.0) for t in (begin, end))
        scale = (1.0 - self.flash.share) / float((0.5 * (first + last) * (end - begin)).sum())
        # A shutter that is half open lets half of a flash in.
        curve = np.array(self.curve or ((0.0, 1.0), (1.0, 1.0)))
        open_then = [float(np.interp(0.5 * (start + stop), *curve.T)) for start, stop in flashes]
        if sum(open_then) == 0.0:
            raise SettingsError("The shutter's curve is 0 when the flash fires; raise it there.")
        flash = sum(
            openness * ((middle > start) & (middle < stop))
            for (start, stop), openness in zip(flashes, open_then, strict=True)
        )
        flash = flash * (self.flash.share / float((flash * (end - begin)).sum()))
        return np.stack([begin, end, scale * first + flash, scale * last + flash], axis=1)

    def _ambient(self) -> FloatArray:
        """Return the same pieces without flashes."""
        curve = np.array(self.curve if self.curve else ((0.0, 1.0), (1.0, 1.0)))
        pieces = []
        for begin, end in self.opened():
            knots = [begin, end, *curve[(curve[:, 0] > begin) & (curve[:, 0] < end), 0]]
            if self.blade_time >= _LEAST_BLADE_TIME:
                blades = self.blade_time * min(end - begin, self._unit)
                steps = np.linspace(0.0, blades, _BLADE_STEPS + 1)[1:]
                knots.extend([*(begin + steps), *(end - steps)])
            edges = np.unique(knots)
            area = self.opening(edges) ** 2
            # From inside of each piece to its ends, since the curve may step where two pieces meet.
            width = edges[1:] - edges[:-1]
            early = np.interp(edges[:-1] + 0.25 * width, curve[:, 0], curve[:, 1])
            late = np.interp(edges[:-1] + 0.75 * width, curve[:, 0], curve[:, 1])
            first = np.maximum(1.5 * early - 0.5 * late, 0.0) * area[:-1]
            last = np.maximum(1.5 * late - 0.5 * early, 0.0) * area[1:]
            pieces.append(np.stack([edges[:-1], edges[1:], first, last], axis=1))
        return np.concatenate(pieces)


def parse_openings(text: str) -> Openings:
    """Read the openings of a multiple exposure.

    Parameters
    ----------
    text : str
        A list such as ``0:0.2,0.4:0.6``, or count, duration and spacing as ``5x0.2@0.4``, in units of
        the shutter time.

    Returns
    -------
    tuple of (float, float)
        Begin and end of each.

    Raises
    ------
    SettingsError
        If the text is no such list.
    """
    try:
        repeated = _REPEATED.fullmatch(text.strip())
        if repeated:
            count, duration, spacing = int(repeated[1]), float(repeated[2]), float(repeated[3])
            return even_openings(count, duration, spacing)
        pairs = [part.split(":") for part in text.split(",")]
        openings = tuple((float(begin), float(end)) for begin, end in pairs)
    except SettingsError:
        raise  # a ValueError too, but it already says what is wrong
    except ValueError:
        raise SettingsError(
            f"'{text}' is no list of exposures; write 0:0.2,0.4:0.6, or 5x0.2@0.4 for five of 0.2 each 0.4."
        ) from None
    _check_openings(openings)
    return openings


def even_openings(count: int, duration: float, spacing: float) -> Openings:
    """Return openings of one duration at one spacing (1983, figure 7d: 5, 0.2, 0.4).

    Raises
    ------
    SettingsError
        If there are none or they overlap.
    """
    if not 1 <= count <= MAX_OPENINGS:
        raise SettingsError(f"A multiple exposure has 1 to {MAX_OPENINGS} openings, not {count}.")
    # Rounded, so that 0.1 + 0.2 written as a list gives the same numbers.
    openings = tuple((round(n * spacing, 12), round(n * spacing + duration, 12)) for n in range(count))
    _check_openings(openings)
    return openings


def parse_curve(text: str) -> Curve:
    """Read a shutter curve: a JSON list of [time, openness] pairs.

    Raises
    ------
    SettingsError
        If the text is no such list.
    """
    try:
        values = schemas.parse(text, schemas.CURVE)
    except schemas.JsonError:
        raise SettingsError(
            "A shutter curve is a JSON list of [time, openness] pairs such as [[0, 0], [0.5, 1], [1, 0]]."
        ) from None
    curve = tuple((float(time), float(openness)) for time, openness in values)
    _check_curve(curve)
    return curve


def attributes_to_json(shutter: ShutterAttributes) -> dict[str, Any]:
    """Return the attributes that no standard EXR attribute holds, ready for JSON."""
    slit = None if shutter.slit is None else {"edge": shutter.slit.edge, "width": shutter.slit.width}
    values = {
        "frames": shutter.frames,
        "position": shutter.position,
        "curve": shutter.curve,
        "openings": shutter.openings,
        "blade_time": shutter.blade_time,
        "slit": slit,
        "flash": None if shutter.flash is None else asdict(shutter.flash),
    }
    return {name: value for name, value in values.items() if value is not None}


def attributes_from_json(values: dict[str, Any]) -> ShutterAttributes:
    """Return what `attributes_to_json` wrote.

    Raises
    ------
    SettingsError, TypeError, ValueError, KeyError, OverflowError
        If it is not of that form.
    """

    def pairs(name: str) -> tuple[tuple[float, float], ...] | None:
        value = values.get(name)
        return None if value is None else tuple((float(a), float(b)) for a, b in value)

    def number(name: str) -> float | None:
        value = values.get(name)
        return None if value is None else float(value)

    slit = values.get("slit")
    attributes = ShutterAttributes(
        frames=number("frames"),
        position=values.get("position"),
        curve=pairs("curve"),
        openings=pairs("openings"),
        blade_time=number("blade_time"),
        slit=None if slit is None else Slit(slit["edge"], float(slit["width"])),
        flash=flash_from_json(values.get("flash")),
    )
    # Found good or raised, also where the length is not known.
    replace(attributes, frames=1.0 if attributes.frames is None else attributes.frames).resolve()
    return attributes


def flash_from_json(values: dict[str, Any] | None) -> Flash | None:
    """Return the flash of plain values, as `dataclasses.asdict` makes them.

    Raises
    ------
    SettingsError, TypeError, ValueError
        If it is not of that form.
    """
    if values is None:
        return None
    return Flash(
        values["curtain"], float(values["share"]), float(values["duration"]), operator.index(values["count"])
    )


def rotary_slit(frames: float, gate: float, edge: SlitEdge = "top") -> tuple[float, Slit]:
    """Return the exposure of a rotary disc shutter before the gate of a film camera.

    A disc with an opening of the angle a turns once a frame: each point of the film is exposed for
    a / 360 of it. The disc's edges take as long to cross the gate as the angle under which its axis sees the
    gate, so the last row is exposed by that much later than the first.

    Parameters
    ----------
    frames : float
        Exposure of a point in frames: the disc's opening over a whole turn.
    gate : float
        Angle of the gate as seen from the disc's axis, in radians.
    edge : {"top", "bottom", "left", "right"}
        The side of the picture that is exposed first.

    Returns
    -------
    frames : float
        Length of the interval in which the film is exposed anywhere.
    slit : Slit
        The share of it that each point gets.
    """
    whole = frames + gate / (2.0 * math.pi)
    return whole, Slit(edge, frames / whole if whole > 0.0 else 1.0)


def _check_curve(curve: Curve) -> None:
    if not curve:
        return
    values = np.array(curve, dtype=np.float64)
    inside = np.isfinite(values).all() and (values >= 0.0).all() and (values <= 1.0).all()
    if len(curve) < 2 or not inside or (np.diff(values[:, 0]) < 0.0).any():
        raise SettingsError(
            "A shutter curve needs two or more points in order of time, with times and openness from 0 to 1."
        )


def _check_openings(openings: Openings) -> None:
    last = 0.0
    # Shorter ones are none: their blades would move faster than numbers can tell.
    shortest = _LEAST_OPENING * max(1.0, openings[-1][1]) if openings else 0.0
    for begin, end in openings:
        if not (math.isfinite(end) and last <= begin and end - begin >= shortest):
            raise SettingsError(
                "Exposures must follow each other without overlap, each from its begin to a later end."
            )
        last = end
