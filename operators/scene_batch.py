"""Frames of a scene for a batch: their samples rendered, their pictures made, or both."""

from __future__ import annotations

import argparse
import contextlib
import json
from collections.abc import Callable, Generator, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import bpy

from ..potmesil_addon import batch
from ..potmesil_addon.errors import InputError, PotmesilError
from ..potmesil_addon.frames import frame_path
from ..potmesil_addon.samples import LensAttributes
from . import kernels
from .borrow import Borrowed
from .composite import composite
from .export import RENDER_RESULT, export_samples
from .output import output_path, save_image
from .process import panel_shutter
from .result import store_result
from .scene import evaluated_camera, render_graph, samples_path, scene_camera, scene_lens
from .stage import stage_scene

if TYPE_CHECKING:
    from ..potmesil_addon.pictures import PicturePaths
    from ..potmesil_addon.process import ProcessSettings

Stage = Literal["passes", "process", "render"]
"""What a batch does: samples files, pictures from those that are there, or both."""

DOING: Final[dict[Stage, str]] = {"passes": "rendering", "process": "processing", "render": "rendering"}

_SAMPLES_SHARE = 0.7
"""Share of a frame's progress for rendering, where it is processed too."""

_RENDER_SETTINGS = (
    "engine", "resolution_x", "resolution_y", "resolution_percentage", "pixel_aspect_x", "pixel_aspect_y",
    "use_border", "border_min_x", "border_max_x", "border_min_y", "border_max_y", "use_crop_to_border",
    "film_transparent", "filter_size", "use_simplify", "simplify_subdivision_render", "use_single_layer",
    "frame_map_old", "frame_map_new",
)  # fmt: skip
"""What of the render settings changes the samples."""

_ENGINE_ONLY_HERE = ("preview_", "debug_", "device", "use_auto_tile", "tile_size")
"""Beginnings of the names of an engine's settings that change how it renders here, and not what."""

_SAMPLES_SETTINGS = (
    "use_lens", "use_motion", "visibility", "sampling", "use_hidden_surfaces", "depth_peeling", "peel_count",
    "use_overscan", "reflections", "max_roughness",
)  # fmt: skip
"""What of the panel's settings changes what is rendered."""


@dataclass(frozen=True, slots=True)
class SceneFrames:
    """The frames of a scene as a batch makes them.

    Parameters
    ----------
    scene : Scene
        The scene.
    stage : {"passes", "process", "render"}
        What is done.
    options_now : callable
        Returns the command's options, with the panel's settings at the present frame for what they leave
        open.
    samples : Path or None
        Template of the samples files; None for the scene's own.
    output : Path or None
        Template of the pictures; None for the scene's output settings.
    several : bool
        Whether there are several frames.
    max_memory : int or None
        Bytes that the process may take.
    """

    scene: bpy.types.Scene
    stage: Stage
    options_now: Callable[[], argparse.Namespace]
    samples: Path | None
    output: Path | None
    several: bool
    max_memory: int | None

    def begin(self, frame: int | None) -> _SceneFrame:
        """Go to a frame, and return its work.

        Parameters
        ----------
        frame : int or None
            The frame's number.

        Returns
        -------
        Work
            For `batch.run_batch`.

        Raises
        ------
        PotmesilError
            If a setting is out of range at this frame.
        """
        from ..potmesil_addon.pictures import PicturePaths  # noqa: PLC0415 - see kernels

        assert frame is not None
        self.scene.frame_set(frame)
        options = self.options_now()
        if self.samples is None:
            samples_file = samples_path(self.scene).absolute()
        else:
            samples_file = frame_path(self.samples, frame, several=self.several)
        if self.stage == "passes":
            paths = None
        else:
            options.output = self.output or output_path(self.scene, frame)
            for name in ("mask", "error_map", "report"):
                setattr(options, name, _absolute(getattr(options, name)))
            paths = PicturePaths.of_frame(options, frame, several=self.several)
            if self.output is None:
                paths = replace(paths, output=options.output)
        return _SceneFrame(self, options, frame, samples_file, paths)


@dataclass(frozen=True, slots=True)
class _SceneFrame:
    """One of them."""

    frames: SceneFrames
    options: argparse.Namespace
    frame: int
    samples_file: Path
    paths: PicturePaths | None

    @property
    def output(self) -> Path:
        """The picture, or the samples file where there is no picture."""
        return self.samples_file if self.paths is None else self.paths.output

    def standing(self) -> batch.Standing:
        """Return what the frame's files are."""
        if self.paths is None:
            return batch.standing(self.samples_file, batch.Mark(self._rendered()))
        return self.paths.standing(self._picture_mark)

    def make(self) -> Generator[float, None, None]:
        """Do what the batch does."""
        from ..potmesil_addon.progress import scaled  # noqa: PLC0415 - see kernels

        start = 0.0
        if self.frames.stage != "process" and not self._has_samples():
            share = 1.0 if self.paths is None else _SAMPLES_SHARE
            yield from scaled(_as_generator(self._export()), 0.0, share)
            start = share
        if self.paths is not None:
            yield from scaled(self._process(self.paths), start, 1.0 - start)

    def _has_samples(self) -> bool:
        """Return whether the samples of a frame to be rendered and processed are there already."""
        if self.paths is None or self.options.existing == "overwrite":
            return False
        found = batch.standing(self.samples_file, batch.Mark(self._rendered()))
        return found == "current" or (found == "stale" and self.options.existing == "keep")

    def _export(self) -> Iterator[float]:
        scene = self.frames.scene
        with _wanted(scene, self.options):
            mark = batch.Mark(_rendered_hash(scene))
            yield from export_samples(scene, self.samples_file, _render, mark.attributes())

    def _process(self, paths: PicturePaths) -> Generator[float, None, None]:
        from ..potmesil_addon import exr  # noqa: PLC0415 - see kernels
        from ..potmesil_addon.pictures import picture_mark  # noqa: PLC0415
        from ..potmesil_addon.preview import settings_to_json  # noqa: PLC0415
        from ..potmesil_addon.process import process  # noqa: PLC0415

        scene = self.frames.scene
        scene.frame_set(self.frame)
        settings = self._settings()
        mark = picture_mark(settings, self._layers, self.samples_file, more=self._more())
        if self.frames.output is None and stage_scene(scene) is not None:
            yield from self._composite(paths, mark)
            return
        kernels.compile_beside(self.samples_file, settings_to_json(settings))
        samples = exr.read_samples(self.samples_file, self._layers)
        result = yield from process(samples, settings)
        if self.frames.output is not None:
            paths.write(result, samples, mark, self.samples_file)
            return
        paths.write_beside(result, samples, mark, self.samples_file)
        save_image(store_result(result.picture), scene, paths.output, mark.attributes())

    def _composite(self, paths: PicturePaths, mark: batch.Mark) -> Iterator[float]:
        """Write what the compositor makes of the processed picture."""
        scene = self.frames.scene
        with batch.dies_on_sigterm():
            yield from composite(scene, None)
        image = bpy.data.images.get(RENDER_RESULT)
        if image is None:
            raise InputError("The compositor gave no picture; check its output.")
        save_image(image, scene, paths.output, mark.attributes())

    @property
    def _layers(self) -> tuple[str, ...] | None:
        return tuple(self.options.layer) if self.options.layer else None

    def _rendered(self) -> str:
        """Return the hash of what the samples would be rendered with now."""
        with _wanted(self.frames.scene, self.options):
            return _rendered_hash(self.frames.scene)

    def _settings(self) -> ProcessSettings:
        """Return what is done to the samples: what the options say, and else the scene."""
        from ..potmesil_addon import cli  # noqa: PLC0415 - see kernels

        scene = self.frames.scene
        settings = cli.process_settings(self.options, self.frame)
        lens = asdict(scene_lens(evaluated_camera(scene, bpy.context.evaluated_depsgraph_get())))
        said = {name: value for name, value in asdict(settings.lens).items() if value is not None}
        known = {name: value for name, value in lens.items() if name in LensAttributes.__dataclass_fields__}
        return replace(
            settings,
            max_memory=self.frames.max_memory,
            lens=LensAttributes(**{**known, **said}),
            shutter=settings.shutter.over(panel_shutter(scene)),
        )

    def _picture_mark(self) -> batch.Mark:
        """Return how the picture would be made now; without its samples only their settings count."""
        from ..potmesil_addon.pictures import picture_hash, picture_mark  # noqa: PLC0415 - see kernels

        settings = self._settings()
        if self.frames.stage == "process":
            return picture_mark(settings, self._layers, self.samples_file, more=self._more())
        rendered = self._rendered()
        digest = None
        if batch.standing(self.samples_file, batch.Mark(rendered)) == "current":
            return picture_mark(settings, self._layers, self.samples_file, more=self._more())
        return batch.Mark(picture_hash(settings, self._layers, rendered, self._more()), digest)

    def _more(self) -> dict[str, Any]:
        """Return what else changes a picture that Blender writes: its format and view transform."""
        if self.frames.output is not None:
            return {}
        scene = self.frames.scene
        owners = {"image": scene.render.image_settings, "view": scene.view_settings}
        return {
            "output": {name: _plain_settings(owner) for name, owner in owners.items()},
            "stage": stage_scene(scene) is not None,
        }


def _as_generator(steps: Iterator[float]) -> Generator[float, None, None]:
    yield from steps


def _render(scene: bpy.types.Scene) -> Iterator[float]:
    """Render, and wait for it."""
    try:
        with batch.dies_on_sigterm():
            bpy.ops.render.render(scene=scene.name)
    except RuntimeError as error:
        raise PotmesilError(f"Blender could not render: {' '.join(str(error).split())}") from error
    yield 1.0


@contextlib.contextmanager
def _wanted(scene: bpy.types.Scene, options: argparse.Namespace) -> Iterator[None]:
    """Render nothing that only something needs that the options switch off."""
    own = scene.potmesil_camera
    with Borrowed() as borrowed:
        borrowed.set(own, "use_motion", not options.no_motion)
        borrowed.set(own, "use_lens", not options.no_lens)
        if options.no_shadows:
            borrowed.set(own, "reflections", "OFF" if options.no_reflections else "REFLECTIONS")
        yield


def _rendered_hash(scene: bpy.types.Scene) -> str:
    """Return a hash of the settings that samples are rendered with.

    What is in the scene, its shapes, materials and lamps, is too much to go in, and focus, f-stop and shutter
    are what samples are rendered without.
    """
    engine = getattr(scene, {"CYCLES": "cycles"}.get(scene.render.engine, "eevee"), None)
    camera = scene_camera(scene, evaluated_camera(scene, render_graph(scene)))
    return batch.settings_hash(
        {
            "blender": bpy.app.version[:2],
            "scene": scene.name,
            "frame": scene.frame_current,
            "render": {name: getattr(scene.render, name) for name in _RENDER_SETTINGS},
            "engine": {} if engine is None else _plain_settings(engine),
            "layers": [
                [layer.name, layer.samples, layer.material_override and layer.material_override.name]
                for layer in scene.view_layers
                if layer.use
            ],
            "camera": json.dumps(asdict(camera), default=_as_list),
            "samples": {name: getattr(scene.potmesil_camera, name) for name in _SAMPLES_SETTINGS},
        }
    )


def _as_list(value: Any) -> Any:
    # A camera that stands still may move in the last bit from frame to frame.
    return value.round(9).tolist() if hasattr(value, "tolist") else str(value)


def _plain_settings(owner: Any) -> dict[str, Any]:
    """Return the numbers, texts and switches of some settings, by name."""
    return {
        item.identifier: getattr(owner, item.identifier)
        for item in owner.bl_rna.properties
        if item.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM")
        and not getattr(item, "is_array", False)
        and not item.identifier.startswith(_ENGINE_ONLY_HERE)
    }


def _absolute(name: Path | str | None) -> Path | None:
    return None if name is None else Path(bpy.path.abspath(str(name))).absolute()
