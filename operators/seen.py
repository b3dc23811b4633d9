"""What mirrors and glass show: probes rendered and made into layers of a samples file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_

from ..potmesil_addon.progress import scaled
from ..potmesil_addon.samples import SampleLayer, Samples, Window
from . import compat
from .borrow import Borrowed
from .motion import SampledMotion
from .probe import ProbeScene, rendered_probe
from .scene import rendered_objects
from .work import doing

if TYPE_CHECKING:
    from ..potmesil_addon.specular import Probe

_PASSES = (
    "use_pass_glossy_direct",
    "use_pass_glossy_indirect",
    "use_pass_glossy_color",
    "use_pass_transmission_direct",
    "use_pass_transmission_indirect",
    "use_pass_transmission_color",
    "use_pass_normal",
)

_LEAST_REACH = 0.25
"""Frames between which motion is followed at least: a shutter may be opened wider later."""


def keeps_light_passes(scene: bpy.types.Scene) -> bool:
    """Return whether the artist wants any of the passes that light is parted by."""
    return any(getattr(layer, name) for layer in scene.view_layers for name in _PASSES)


def borrow_light_passes(borrowed: Borrowed, scene: bpy.types.Scene) -> None:
    """Let the renderer part light into what is reflected, what comes through glass and the rest."""
    for layer in scene.view_layers:
        if layer.use:
            for name in _PASSES:
                borrowed.set(layer, name, True)
            cycles = getattr(layer, "cycles", None)
            if cycles is not None and scene.cycles.use_denoising and compat.view_layer_denoises(layer):
                borrowed.set(cycles, "denoising_store_passes", True)


class SeenLight:
    """Renders the probes of a frame's views, and makes layers of what they tell.

    Parameters
    ----------
    scene : Scene
        The scene, set up for samples.
    motion : SampledMotion
        What moves.
    folder : Path
        Takes files for a while.
    render : callable
        Renders a scene, yielding progress.
    save : callable
        Saves a scene's render.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        motion: SampledMotion,
        folder: Path,
        render: Callable[[bpy.types.Scene], Iterator[float]],
        save: Callable[[bpy.types.Scene, Path], None],
    ) -> None:
        self._scene, self._motion = scene, motion
        self._folder, self._render, self._save = folder, render, save
        self._views: dict[str, dict[str, list[Path]]] = {}

    def probe(self, suffix: str, *, whole: bool) -> Iterator[float]:
        """Render the probes of one view, as the scene is now.

        Parameters
        ----------
        suffix : str
            Of the view's layers; empty for the scene as it is.
        whole : bool
            Whether to ask for all, or only for which samples show mirrors or glass.

        Yields
        ------
        float
            Share of the work done.
        """
        doing(iface_("Probing Mirrors and Glass of Frame {frame}").format(frame=self._scene.frame_current))
        with ProbeScene(self._scene, self._motion) as probe:
            self._names, self._baseline = dict(probe.names), probe.baseline
            lights = probe.lights
            files = self._views.setdefault(suffix, {})
            for n, light in enumerate(lights):
                folder = self._folder / f"probe_{len(self._views)}"
                folder.mkdir(exist_ok=True)
                steps = rendered_probe(probe, light, folder, self._render, self._save, whole=whole)
                files[light] = yield from scaled(steps, n / len(lights), 1.0 / len(lights))
        yield 1.0

    def layers(
        self, rendered: Path, companions: dict[str, Path], margins: tuple[int, int]
    ) -> list[SampleLayer]:
        """Return what mirrors and glass show, as layers to add to a samples file.

        Parameters
        ----------
        rendered : Path
            The render of the scene as it is.
        companions : dict of str to Path
            Renders of its other views by the suffixes of their layers.
        margins : tuple of int
            Columns and rows of overscan.

        Returns
        -------
        list of SampleLayer
            Of every view layer.
        """
        from ..potmesil_addon import exr, specular  # noqa: PLC0415 - see kernels

        suffixes = {"reflected": exr.REFLECTED, "transmitted": exr.TRANSMITTED}
        indices = {item.name_full: item.pass_index for item in rendered_objects(self._scene)}
        layers = []
        for suffix, files in self._views.items():
            source = companions[suffix] if suffix else rendered
            raw = exr.read_raw(source)
            passes = exr.light_passes_of(raw)
            samples = _overscanned(exr.samples_of(raw, source), margins, self._motion)
            for light, paths in files.items():
                views = [exr.light_passes_of(exr.read_raw(path)) for path in paths]
                for layer in samples.layers:
                    if layer.depth is None or layer.name not in passes:
                        continue
                    probe = self._probe(views, layer.name)
                    given = _light_of(passes[layer.name], light)
                    there = specular.grown(probe.there, mixed=samples.mixes_surfaces)
                    color = np.where(there[..., np.newaxis], given, np.float32(0.0))
                    name = f"{layer.name}{suffix}{suffixes[light]}"
                    if len(views) == 1:
                        layers.append(SampleLayer(name, color))
                        continue
                    normal = passes[layer.name]["normal"]
                    seen = specular.resolve(probe, self._view(layer, samples, normal), self._reach())
                    index = specular.indices(probe, indices)
                    patch, small = specular.patches(
                        probe, layer.depth, seen.normal, layer.object_index, seen.vector
                    )
                    specular.on_their_surfaces(seen, small, layer.depth)
                    patch = specular.spread_numbers(patch, there)
                    layers.append(
                        SampleLayer(
                            name,
                            color,
                            seen.depth,
                            index,
                            seen.vector,
                            patch=patch,
                            astigmatism=seen.astigmatism,
                        )
                    )
        return layers

    def _probe(self, views: list[Any], layer: str) -> Probe:
        from ..potmesil_addon import specular  # noqa: PLC0415 - see kernels

        colors = [view[layer]["combined"][..., :3] for view in views]
        return specular.Probe.from_renders(colors[0], colors[1:], self._baseline, self._names)

    def _view(self, layer: SampleLayer, samples: Samples, normal: Any) -> Any:
        from ..potmesil_addon import specular, tracks  # noqa: PLC0415 - see kernels

        assert layer.depth is not None
        found = tracks.assign_tracks(layer, samples)
        track = np.zeros(layer.depth.shape, dtype=np.int32) if found is None else found.track
        return specular.View(
            self._motion.paths,
            tracks.sample_origin(samples),
            self._motion.camera.clip_start,
            layer.depth,
            track,
            normal,
            layer.object_index,
        )

    def _reach(self) -> float:
        shutter = self._motion.shutter.resolve()
        interval = (0.0, 0.0) if shutter is None else shutter.interval
        return max(_LEAST_REACH, *(abs(time) for time in interval))


def _light_of(passes: Any, light: str) -> Any:
    """Return the light that is reflected or comes through glass, no more than there is."""
    from ..potmesil_addon import specular  # noqa: PLC0415 - see kernels

    kind = "glossy" if light == "reflected" else "transmission"
    parts = (passes[f"{kind}_{name}"][..., :3] for name in ("direct", "indirect", "color"))
    given = specular.seen_light(*parts)
    if "noisy" in passes:
        return specular.as_share(given, passes["noisy"], passes["combined"])
    return specular.within(given, passes["combined"])


def _overscanned(samples: Samples, margins: tuple[int, int], motion: SampledMotion) -> Samples:
    """Return a render's samples with its windows as the samples file will have them, and with paths."""
    x, y = margins
    data, display = samples.data_window, samples.display_window
    return replace(
        samples,
        data_window=Window(data.x0 - x, data.y0 - y, data.x1 - x, data.y1 - y),
        display_window=Window(display.x0, display.y0, display.x1 - 2 * x, display.y1 - 2 * y),
        paths=motion.paths,
    )
