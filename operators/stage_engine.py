"""The engine that hands the processed picture to the compositor, and what prepares a render for it.

Blender renders a scene, then the scenes that other Render Layers nodes of its compositor tree show, then it
runs the tree. The stage's own scene is such a scene, so that its engine is called where no handler is: the
scene's passes are there, and the compositor has not begun. Nothing is rendered inside of a render.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon.errors import InputError, PotmesilError
from ..potmesil_addon.files import working_folder
from . import kernels, stage
from .borrow import Borrowed
from .composite import Outcome
from .export import annotate_render, borrow_for_render, refuse_errors, samples_path, save_render
from .motion import SampledMotion, go_to, kept_scene, sample_motion
from .process import by_turns, known_picture, scene_settings
from .sampling import filter_variance
from .scene import frame_format

if TYPE_CHECKING:
    from ..potmesil_addon.exr import RawFile
    from ..potmesil_addon.samples import Float32Array


@dataclass
class _Job:
    """A render that Blender is at, of a scene with a stage.

    Parameters
    ----------
    scene : Scene
        The scene.
    layers : dict of str to str
        Its view layers by those of the stage.
    renders : bool
        Whether the scene is rendered, and not only composited.
    borrowed : Borrowed
        Gives the scene's settings back.
    path : Path
        The frame's samples file.
    settings : dict
        For the processors.
    motion : SampledMotion or None
        What moves, where the scene is rendered.
    raw : RawFile or None
        The samples file, once it was read.
    trouble : str
        Why there will be no picture.
    """

    scene: bpy.types.Scene
    layers: dict[str, str]
    renders: bool
    borrowed: Borrowed = field(default_factory=Borrowed)
    path: Path = field(default_factory=Path)
    settings: dict[str, Any] = field(default_factory=dict)
    motion: SampledMotion | None = None
    raw: RawFile | None = None
    trouble: str = ""


_jobs: dict[str, _Job] = {}
"""By the name of the scene."""


@persistent
def begin(scene: bpy.types.Scene, *_: Any) -> None:
    """Set a scene with a stage up for samples, before Blender reads its settings."""
    end(scene)
    # Our own exports render without the compositor.
    if not scene.render.use_compositing or stage.stage_scene(scene) is None:
        return
    Outcome.error = ""
    job = _jobs[scene.name] = _Job(scene, stage.layers(scene), bool(stage.rendering_nodes(scene)))
    if not job.renders:
        return
    try:
        refuse_errors(scene)
    except PotmesilError as error:
        job.trouble = str(error)
        return
    # The render has the size, the filter and the view that were asked for.
    job.borrowed.set(scene.potmesil_camera, "sampling", "PIXELS")
    borrow_for_render(job.borrowed, scene, compositing=True)


@persistent
def begin_frame(scene: bpy.types.Scene, *_: Any) -> None:
    """Follow what moves, and note the settings, of the frame that comes next."""
    job = _jobs.get(scene.name)
    if job is None:
        return
    job.raw, job.path = None, samples_path(scene)
    try:
        with kept_scene(scene):
            if job.renders and not job.trouble:
                kernels.use_user_cache()
                from ..potmesil_addon.progress import run  # noqa: PLC0415 - see kernels

                job.motion = run(sample_motion(scene))
            go_to(scene, scene.frame_current + scene.frame_subframe)
            graph = next(layer.depsgraph for layer in scene.view_layers if layer.use)
            job.settings = scene_settings(scene, graph)
    except PotmesilError as error:
        job.trouble = job.trouble or str(error)
    except Exception as error:
        job.trouble = _unexpected(error)
        raise


@persistent
def end(scene: bpy.types.Scene, *_: Any) -> None:
    """Give the scene's settings back, and show in the panels what went wrong."""
    job = _jobs.pop(scene.name, None)
    if job is None:
        return
    job.borrowed.give_back()
    # Blender keeps what the engines of other scenes report to itself.
    for manager in bpy.data.window_managers:
        manager.potmesil_camera.error = Outcome.error


def _handlers() -> tuple[tuple[Any, Any], ...]:
    """Return Blender's lists of handlers, each with ours."""
    lists = bpy.app.handlers
    return (
        (lists.render_init, begin),
        (lists.render_pre, begin_frame),
        (lists.render_complete, end),
        (lists.render_cancel, end),
    )


def register() -> None:
    """Prepare all renders from now on."""
    for handlers, function in _handlers():
        handlers.append(function)


def unregister() -> None:
    """Leave renders alone, and give back what one that runs has borrowed."""
    for handlers, function in _handlers():
        if function in handlers:
            handlers.remove(function)
    for job in list(_jobs.values()):
        end(job.scene)


class PotmesilStageEngine(bpy.types.RenderEngine):
    """Hands the processed picture, and the passes of the samples, to the compositor."""

    bl_idname = stage.ENGINE
    bl_label = "Potmesil Stage"
    bl_use_preview = False

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        """Say what a view layer of the stage's scene has."""
        for each in stage.passes(renderlayer):
            count = len(each.components)
            self.register_pass(scene, renderlayer, each.name, count, each.components, each.kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Process the samples of a view layer; Blender calls this from the render's thread."""
        scene = depsgraph.scene.original.potmesil_camera.stage_of
        job = None if scene is None else _jobs.get(scene.name)
        try:
            if job is None:
                raise InputError(
                    "Only the scene that a stage belongs to can show it; render that scene, or remove the "
                    "stage's nodes from this one's compositor."
                )
            if job.trouble:
                raise InputError(job.trouble)
            self.update_stats("", "Potmesil Camera")
            for done in self._steps(job, depsgraph.view_layer):
                self.update_progress(done)
                if self.test_break():
                    return
        except PotmesilError as error:
            self._fail(str(error))
        except Exception as error:
            self._fail(_unexpected(error))
            raise

    def _fail(self, text: str) -> None:
        """Say why there is no picture."""
        Outcome.error = text
        self.report({"ERROR"}, text)

    def _steps(self, job: _Job, view_layer: bpy.types.ViewLayer) -> Iterator[float]:
        """Process the samples of a view layer, and hand over the picture and the passes."""
        kernels.use_user_cache()
        from ..potmesil_addon import exr  # noqa: PLC0415 - see kernels
        from ..potmesil_addon.preview import settings_from_json  # noqa: PLC0415
        from ..potmesil_addon.process import process  # noqa: PLC0415
        from ..potmesil_addon.progress import scaled  # noqa: PLC0415

        if job.raw is None:
            if job.motion is not None:
                _save(job, job.motion)
            job.raw = exr.read_raw(job.path)
        yield 0.1
        layer = job.layers[view_layer.name]
        samples = exr.samples_of(job.raw, job.path, (layer,))
        picture = known_picture(job.path, job.settings, layer)
        if picture is None:
            steps = by_turns(process(samples, settings_from_json(job.settings)))
            picture = (yield from scaled(steps, 0.1, 0.8)).picture
        made = [(stage.COMBINED, picture)]
        for each in stage.passes(view_layer):
            if each.name != stage.COMBINED.name:
                self.add_pass(each.name, len(each.components), each.components, layer=view_layer.name)
                made.append((each, _pass(job.raw, layer, each, samples.supersampling)))
        yield 0.95
        result = self.begin_result(0, 0, self.resolution_x, self.resolution_y, layer=view_layer.name)
        places = {each.name: each for each in result.layers[0].passes}
        try:
            for each, values in made:
                fitted = _fitted(values, job.scene, result.resolution_x, result.resolution_y)
                flipped = np.ascontiguousarray(fitted[::-1], dtype=np.float32)
                places[each.name].rect.foreach_set(flipped.reshape(-1))
        finally:
            self.end_result(result)


def _unexpected(error: Exception) -> str:
    """Return a sentence about what should not have happened."""
    text = rpt_("The stage failed; the console has the details ({kind}: {error}).")
    return text.format(kind=type(error).__name__, error=error)


def _save(job: _Job, motion: SampledMotion) -> None:
    """Make a samples file of the render that has just ended."""
    variance = filter_variance(job.scene)
    with working_folder() as folder:
        rendered = folder / "render.exr"
        save_render(job.scene, rendered)
        annotate_render(job.scene, rendered, job.path, motion, (variance, variance))


def _pass(raw: RawFile, layer: str, wanted: stage.Pass, factor: int) -> Float32Array:
    """Return a pass of a samples file at the picture's size; 0 where the file lacks it.

    Of the samples of a pixel it is one of those in the middle: depths and indices have no mean.
    """
    window = raw.display_window
    values = np.zeros((window.rows, window.columns, len(wanted.components)), dtype=np.float32)
    found = set()
    for channel in raw.channels:
        name, _, component = channel.full_name.rpartition(".")
        place = 0 if wanted.kind == "VALUE" else wanted.components.find(component.upper())
        if name == f"{layer}.{wanted.name}" and place >= 0:
            shared = channel.window.intersection(window)
            values[(*shared.within(window), place)] = channel.pixels[shared.within(channel.window)]
            found.add(place)
    if wanted.kind == "COLOR" and found == {0, 1, 2}:
        values[..., 3] = 1.0
    values = values[factor // 2 :: factor, factor // 2 :: factor]
    return values / factor if wanted.name == "Vector" else values


def _fitted(values: Float32Array, scene: bpy.types.Scene, columns: int, rows: int) -> Float32Array:
    """Return the part of a picture that a render shows: all of it, or that of a render region.

    Raises
    ------
    InputError
        If the picture was made for another render.
    """
    if values.shape[:2] == (rows, columns):
        return values
    render = scene.render
    whole = frame_format(scene, scene.camera.data).frame_size
    if render.use_border and values.shape[:2] == whole[::-1]:
        left = min(int(render.border_min_x * whole[0]), whole[0] - columns)
        top = min(whole[1] - rows - int(render.border_min_y * whole[1]), whole[1] - rows)
        return values[max(top, 0) : max(top, 0) + rows, left : left + columns]
    text = rpt_(
        "The samples are for {columns} x {rows} pixels and the render has {render_columns} x {render_rows}; "
        "render again."
    )
    size = {"columns": values.shape[1], "rows": values.shape[0]}
    raise InputError(text.format(**size, render_columns=columns, render_rows=rows))
