"""Previews: the same picture from fewer samples and simpler settings, in a given time."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from .camera import Film
from .effects import effects_from_json
from .motion import Motion, instant_layer, instants_for, prepare
from .process import ProcessSettings, motion_settings, process
from .progress import run
from .psf import PsfSettings
from .samples import Float32Array, LensAttributes, SampleLayer, Samples, Window
from .shutter import ShutterAttributes, Slit, flash_from_json
from .visibility import Visibility

MOST_COLUMNS: Final = 960
MOST_ROWS: Final = 540
"""Size that a preview never exceeds."""

BUDGET: Final = 0.06
"""Seconds that a preview should take, so that ten a second leave time to draw them."""

_STEPS: Final = 4
"""Sizes, each half of the one before."""

_GROWTH: Final = 4.0
"""By how many times the next finer preview takes longer, at most as a rule."""

_PATIENCE: Final = 3.0
"""Seconds after which a finer preview that was too slow is tried again."""

_MOVING_TIERS: Final = 6
"""Kinds of previews with motion, before those without it."""

_INSTANTS: Final = 8
"""Most instants of a preview with motion blur."""


def settings_to_json(settings: ProcessSettings) -> dict[str, Any]:
    """Return settings as plain values; the infinite and tuples are as `json` writes them.

    Parameters
    ----------
    settings : ProcessSettings
        The settings.

    Returns
    -------
    dict
        For `settings_from_json`.
    """
    return asdict(settings)


def settings_from_json(values: dict[str, Any]) -> ProcessSettings:
    """Return the settings that plain values describe.

    Parameters
    ----------
    values : dict
        From `settings_to_json`, or a part of it: the rest is as `ProcessSettings` has it.

    Returns
    -------
    ProcessSettings
        The settings.

    Raises
    ------
    SettingsError
        If a value is out of its range.
    """
    known = dict(values)
    if "lens" in known:
        known["lens"] = LensAttributes(**known["lens"])
    if "shutter" in known:
        known["shutter"] = _shutter(known["shutter"])
    if "psf" in known:
        psf = dict(known["psf"])
        if "wavelengths" in psf:
            psf["wavelengths"] = tuple(psf["wavelengths"])
        known["psf"] = PsfSettings(**psf)
    if "effects" in known:
        known["effects"] = effects_from_json(known["effects"])
    return ProcessSettings(**known)


def _shutter(values: dict[str, Any]) -> ShutterAttributes:
    known = dict(values)
    for name in ("curve", "openings"):
        if known.get(name) is not None:
            known[name] = tuple((float(a), float(b)) for a, b in known[name])
    if known.get("slit") is not None:
        known["slit"] = Slit(**known["slit"])
    known["flash"] = flash_from_json(known.get("flash"))
    return ShutterAttributes(**known)


def least_factor(samples: Samples) -> int:
    """Return by how much samples must be reduced, each way, to fit the size of a preview."""
    display = samples.display_window
    across, down = -(-display.columns // MOST_COLUMNS), -(-display.rows // MOST_ROWS)
    return max(1, across, down)


def reduced(samples: Samples, factor: int) -> Samples:
    """Return samples that stand for squares of samples; circles and paths shrink with them.

    A square has the depth, index and vector of its sample with the middle depth, and the mean of all
    colours, so that a highlight keeps its light. What is left over at the right and the bottom of the
    picture is cut off.

    Parameters
    ----------
    samples : Samples
        A samples file.
    factor : int
        Side of the squares, at least 1.

    Returns
    -------
    Samples
        The fewer samples, one for each pixel; the file's own for a factor of 1.
    """
    display, data = samples.display_window, samples.data_window
    # No picture is smaller than a pixel.
    factor = max(1, min(factor, display.columns, display.rows))
    if factor == 1:
        return samples
    columns, rows = display.columns // factor, display.rows // factor
    # Squares lie on the picture's own grid; those that the data has not whole are left out.
    left, above = (display.x0 - data.x0) % factor, (display.y0 - data.y0) % factor
    if samples.position == "corner":
        across, down = (data.columns - left - 1) // factor + 1, (data.rows - above - 1) // factor + 1
    else:
        across, down = (data.columns - left) // factor, (data.rows - above) // factor
    grid = _Grid(factor, above, left, down, across, corners=samples.position == "corner")
    x0, y0 = (data.x0 + left - display.x0) // factor, (data.y0 + above - display.y0) // factor
    film = None if samples.film is None else _shrunk(samples.film, factor, columns, rows)
    camera, paths = samples.camera, samples.paths
    if paths is not None:
        paths = replace(paths, camera=paths.camera.on_other_pixels(1.0 / factor, 0.0, 0.0))
    if camera is not None:
        camera = replace(
            camera,
            film=_shrunk(camera.film, factor, columns, rows),
            axis_x=camera.axis_x / factor,
            axis_y=camera.axis_y / factor,
        )
    return replace(
        samples,
        layers=tuple(grid.layer(layer) for layer in samples.layers),
        data_window=Window(x0, y0, x0 + across, y0 + down),
        display_window=Window(0, 0, columns, rows),
        supersampling=1,
        pixel_filter=None,
        film=film,
        camera=camera,
        paths=paths,
    )


def _shrunk(film: Film, factor: int, columns: int, rows: int) -> Film:
    pitch_x, pitch_y = film.pitch_x * factor, film.pitch_y * factor
    return Film(pitch_x * columns, pitch_y * rows, columns, rows)


@dataclass(frozen=True, slots=True)
class _Grid:
    """Squares of samples, or the corner samples of squares."""

    factor: int
    above: int
    left: int
    rows: int
    columns: int
    corners: bool

    def layer(self, layer: SampleLayer) -> SampleLayer:
        """Return a layer with one sample for each square."""
        chosen = self._chosen(layer)

        def pick(values: npt.NDArray[Any] | None) -> Any:
            return None if values is None else np.ascontiguousarray(values[chosen])

        vector = pick(layer.vector)
        # What the squares' samples mixed is not told apart again: coverages are left out.
        return SampleLayer(
            name=layer.name,
            color=pick(layer.color) if self.corners else self._mean(layer.color),
            depth=pick(layer.depth),
            object_index=pick(layer.object_index),
            vector=None if vector is None else np.asarray(vector / self.factor, dtype=np.float32),
            stationary=None if layer.stationary is None else self.layer(layer.stationary),
            moving=None if layer.moving is None else self.layer(layer.moving),
            hidden=tuple(self.layer(view) for view in layer.hidden),
            reflected=None if layer.reflected is None else self.layer(layer.reflected),
            transmitted=None if layer.transmitted is None else self.layer(layer.transmitted),
            patch=pick(layer.patch),
            astigmatism=pick(layer.astigmatism),
        )

    def _chosen(self, layer: SampleLayer) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return the row and the column of each square's own sample."""
        row = self.above + self.factor * np.arange(self.rows)[:, np.newaxis]
        column = self.left + self.factor * np.arange(self.columns)
        if self.corners:
            return row + 0 * column, column + 0 * row
        if layer.depth is None:
            middle = self.factor // 2
            return row + middle + 0 * column, column + middle + 0 * row
        squares = self._squares(layer.depth)
        half = squares.shape[2] // 2
        order = np.argpartition(squares, half, axis=2)[..., half]
        return row + order // self.factor, column + order % self.factor

    def _squares(self, values: Float32Array) -> Float32Array:
        """Return an array of shape (rows, columns, factor * factor)."""
        f = self.factor
        inside = values[self.above : self.above + self.rows * f, self.left : self.left + self.columns * f]
        squares = inside.reshape(self.rows, f, self.columns, f).transpose(0, 2, 1, 3)
        return squares.reshape(self.rows, self.columns, f * f)

    def _mean(self, color: Float32Array) -> Float32Array:
        f = self.factor
        inside = color[self.above : self.above + self.rows * f, self.left : self.left + self.columns * f]
        squares = inside.reshape(self.rows, f, self.columns, f, color.shape[2])
        return np.asarray(squares.mean(axis=(1, 3), dtype=np.float32))


@dataclass(frozen=True, slots=True)
class Tier:
    """How good a preview is.

    Parameters
    ----------
    factor : int
        By how much the samples are reduced, each way.
    visibility : {"aperture", "none"}
        Whether near things hide what is behind them.
    motion : bool
        Whether what moves is blurred.
    """

    factor: int
    visibility: Visibility
    motion: bool = True


class Previewer:
    """Makes previews of one samples file, each as good as the last one's time allows.

    Parameters
    ----------
    samples : Samples
        A samples file. It is reduced at once and not kept.
    budget : float
        Seconds that a preview should take.
    """

    def __init__(self, samples: Samples, budget: float = BUDGET) -> None:
        self._budget = budget
        least = least_factor(samples)
        self._levels: dict[int, Samples] = {}
        level = reduced(samples, least)
        for n in range(_STEPS):
            self._levels[least * 2**n] = level
            if min(level.display_window.columns, level.display_window.rows) < 2 * _INSTANTS:
                break
            level = reduced(level, 2)
        self._tier = 0
        self._ladder: list[Tier] = []
        self._too_slow: dict[Tier, float] = {}
        self._used: set[Tier] = set()
        self._instants: tuple[Any, list[tuple[Samples, float]] | None] = (None, None)

    def picture(self, settings: ProcessSettings) -> tuple[Float32Array, Tier]:
        """Return a preview.

        Parameters
        ----------
        settings : ProcessSettings
            What the finished picture is made with.

        Returns
        -------
        picture : ndarray of float32 of shape (rows, columns, 4)
            Premultiplied and scene-linear, row 0 on top; at most `MOST_ROWS` by `MOST_COLUMNS`.
        tier : Tier
            How good it is.

        Raises
        ------
        PotmesilError
            As `process.process` does.
        """
        tier = self._choose(settings)
        started = time.perf_counter()
        picture = self.picture_at(settings, tier)
        self._learn(tier, time.perf_counter() - started)
        return picture, tier

    def warm_up(self, settings: ProcessSettings) -> None:
        """Make previews of each kind at half the size, so that no kernel is compiled while the hand moves.

        Parameters
        ----------
        settings : ProcessSettings
            What previews will be made with.

        Raises
        ------
        PotmesilError
            As `process.process` does.
        """
        half = list(self._levels)[:2][-1]
        for tier in self.tiers(settings):
            if tier.factor == half:
                self.picture_at(settings, tier)

    def tiers(self, settings: ProcessSettings) -> list[Tier]:
        """Return the kinds of previews that there are for some settings, the best one first."""
        kinds: list[Visibility] = ["none"]
        if settings.use_lens and settings.visibility == "aperture":
            kinds = ["aperture", "none"]
        ladder = [Tier(factor, kind) for factor in self._levels for kind in kinds]
        if not settings.use_motion:
            return ladder
        # Motion takes several times as long: larger pictures without it come after small ones with it.
        return [*ladder[:_MOVING_TIERS], *(Tier(tier.factor, tier.visibility, False) for tier in ladder[2:])]

    def picture_at(self, settings: ProcessSettings, tier: Tier) -> Float32Array:
        """Return a preview of a chosen kind, however long it takes; see `picture`."""
        still = replace(settings, use_motion=False, visibility=tier.visibility)
        samples = self._levels[tier.factor]
        moves = settings.use_motion and tier.motion
        moments = self._moments(samples, settings, tier.factor) if moves else None
        if moments is None:
            return run(process(samples, still)).picture
        total = np.zeros(1, dtype=np.float64)
        for moment, opening in moments:
            lens = still.lens
            f_stop = lens.f_stop if lens.f_stop is not None else samples.lens.f_stop
            if f_stop is not None and opening < 1.0:
                # The blades of a between-the-lens shutter stop the lens down while they open and close.
                lens = replace(lens, f_stop=f_stop / opening)
            total = total + run(process(moment, replace(still, lens=lens))).picture
        return np.asarray(total / len(moments), dtype=np.float32)

    def _moments(
        self, samples: Samples, settings: ProcessSettings, factor: int
    ) -> list[tuple[Samples, float]] | None:
        """Return the samples at some instants and the lens's opening then, None where all rests.

        They stay for the next preview: while focus is pulled the shutter does not change.
        """
        key = (factor, settings.shutter, settings.motion_model, settings.backend)
        if self._instants[0] == key:
            return self._instants[1]
        found: list[tuple[Samples, float]] | None = None
        motion = motion_settings(samples, settings)
        moving: list[Motion | None] = []
        if motion is not None:
            moving = [prepare(layer, samples, motion) for layer in samples.layers]
        longest = max((layer.longest for layer in moving if layer is not None), default=0.0)
        if longest > 0.0:
            found = _seen_at(samples, moving, min(_INSTANTS, instants_for(longest)))
        self._instants = key, found
        return found

    def _choose(self, settings: ProcessSettings) -> Tier:
        ladder = self.tiers(settings)
        if ladder != self._ladder:
            # The first guess is small and simple: its time tells what else is possible.
            self._ladder, self._tier = ladder, min(len(ladder) - 1, 3)
        return ladder[self._tier]

    def _learn(self, tier: Tier, seconds: float) -> None:
        """Take a simpler kind after one that took too long, and a better one where there is much time."""
        now = time.perf_counter()
        if tier not in self._used:
            # What was compiled or read from disk for it will not be again.
            self._used.add(tier)
            return
        if seconds > self._budget:
            self._too_slow[tier] = now
            # One down for each time that it took twice as long.
            down = max(1, round(math.log2(seconds / self._budget)))
            self._tier = min(self._tier + down, len(self._ladder) - 1)
            return
        if self._tier > 0 and seconds * _GROWTH < self._budget:
            better = self._ladder[self._tier - 1]
            if now - self._too_slow.get(better, -_PATIENCE) >= _PATIENCE:
                self._tier -= 1


def _seen_at(samples: Samples, moving: list[Motion | None], count: int) -> list[tuple[Samples, float]]:
    """Return the samples at instants with equal shares of the light, and the lens's opening then."""
    ready = next(motion for motion in moving if motion is not None)
    openings = [ready.opening((n + 0.5) / count) for n in range(count)]
    schedules = [None if motion is None else motion.schedule(count) for motion in moving]
    there = samples.data_window.intersection(samples.display_window)
    rows, columns = there.within(samples.data_window)
    moments = []
    for n in range(count):
        layers = []
        for layer, motion, schedule in zip(samples.layers, moving, schedules, strict=True):
            if motion is None or schedule is None:
                layers.append(_on_display(layer, samples, rows, columns))
            else:
                layers.append(instant_layer(motion, layer, schedule, n)[0])
        then = replace(
            samples, layers=tuple(layers), data_window=samples.display_window, position="center", paths=None
        )
        moments.append((then, openings[n]))
    # With one aperture all the time what is seen meanwhile is focused at once, by the depths half-way.
    return moments if min(openings) < 1.0 else [(_mean_of([then for then, _ in moments]), 1.0)]


def _mean_of(moments: list[Samples]) -> Samples:
    """Return samples with the mean colours of some moments, and the depths of the middle one."""
    middle = moments[len(moments) // 2]
    layers = [
        replace(layer, color=np.mean([then.layers[n].color for then in moments], axis=0, dtype=np.float32))
        for n, layer in enumerate(middle.layers)
    ]
    return replace(middle, layers=tuple(layers))


def _on_display(layer: SampleLayer, samples: Samples, rows: slice, columns: slice) -> SampleLayer:
    """Return a layer that rests on the picture's own pixels."""
    display = samples.display_window
    there = samples.data_window.intersection(display).within(display)
    color = np.zeros((display.rows, display.columns, 4), dtype=np.float32)
    color[there] = layer.color[rows, columns]
    depth = None
    if layer.depth is not None:
        depth = np.full((display.rows, display.columns), np.inf, dtype=np.float32)
        depth[there] = layer.depth[rows, columns]
    return SampleLayer(layer.name, color, depth)


def depth_map(samples: Samples) -> Float32Array:
    """Return how far away is what each sample of the picture shows.

    Parameters
    ----------
    samples : Samples
        A samples file.

    Returns
    -------
    ndarray of float32 of shape (rows, columns)
        Depth in metres of the nearest layer that shows something, on the display window; ``inf`` where
        there is no surface or no data.
    """
    display = samples.display_window
    depth = np.full((display.rows, display.columns), np.inf, dtype=np.float32)
    seen = samples.data_window.intersection(display)
    there, here = seen.within(display), seen.within(samples.data_window)
    for layer in samples.layers:
        if layer.depth is not None:
            shown = np.where(layer.color[here][..., 3] > 0.0, layer.depth[here], np.float32(np.inf))
            depth[there] = np.minimum(depth[there], shown)
    return depth
