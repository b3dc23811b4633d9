"""Animations: the samples of all frames, and their pictures processed, composited or not, and written."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon.errors import InputError, OutputError, PotmesilError
from .composite import composite, refuse_unready, render_now
from .export import export_samples, refuse_errors
from .job import render_as_job
from .motion import kept_scene
from .output import output_path, refuse_output, save_image
from .process import process_samples
from .scene import samples_path, samples_template
from .stage import stage_scene
from .work import SteppedOperator, begin_frames, by_frames, frame_done

_SAMPLES_SHARE = 0.6
"""Share of the progress bar for the samples of all frames where there is a stage, and for those of one frame
where there is none; the rest is processing them."""


class POTMESIL_OT_render_animation(SteppedOperator, bpy.types.Operator):
    """Render all frames without blur, save their samples, and blur and write each picture"""

    bl_idname = "potmesil.render_animation"
    bl_label = "Render Animation"
    bl_options = {"REGISTER"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Render and write every frame; with a stage Blender goes through the frames again."""
        scene = context.scene
        operator = self if interactive else None
        if stage_scene(scene) is None:
            yield from _written_frames(context, operator, renders=True)
            return
        refuse_unready(scene)
        refuse_one_file(scene)
        frames = frames_of(scene)
        begin_frames()
        with kept_scene(scene):
            for done, frame in enumerate(frames):
                scene.frame_set(frame)
                for share in _named(frame, export_samples(scene, samples_path(scene), _render(operator))):
                    yield _SAMPLES_SHARE * (done + share) / len(frames)
                frame_done(_SAMPLES_SHARE * (done + 1) / len(frames))
        yield from by_frames(composite(scene, operator, animation=True), _SAMPLES_SHARE)


class POTMESIL_OT_process_animation(SteppedOperator, bpy.types.Operator):
    """Blur the rendered samples of all frames with the present settings, and write each picture"""

    bl_idname = "potmesil.process_animation"
    bl_label = "Process Animation"
    bl_options = {"REGISTER"}

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Process and write every frame; with a stage this is what Composite Animation does."""
        operator = self if interactive else None
        if stage_scene(context.scene) is None:
            yield from _written_frames(context, operator, renders=False)
        else:
            yield from by_frames(composite(context.scene, operator, animation=True))


def frames_of(scene: bpy.types.Scene) -> range:
    """Return the frames that Render Animation goes through."""
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


def _written_frames(
    context: bpy.types.Context, operator: SteppedOperator | None, *, renders: bool
) -> Iterator[float]:
    """Make the picture of every frame, show it, and write it as the output settings say.

    Parameters
    ----------
    context : Context
        Its scene has the frames.
    operator : SteppedOperator or None
        Whose step this is, where Blender's window is to stay free.
    renders : bool
        Whether samples are rendered, and not only read.

    Yields
    ------
    float
        Share of the work done.

    Raises
    ------
    PotmesilError
        If a frame cannot be made; the sentence names it. Frames before it stay.
    """
    scene = context.scene
    refuse_output(scene)
    if renders:
        refuse_errors(scene)
    else:
        refuse_one_file(scene)
    frames = [frame for frame in frames_of(scene) if _is_wanted(scene, frame)]
    if not frames:
        raise InputError(
            "All frames are there; turn Overwrite on in the output properties to make them again."
        )
    begin_frames()
    with kept_scene(scene):
        for done, frame in enumerate(frames):
            # Another Blender on the same folder may have taken it meanwhile.
            if _is_wanted(scene, frame):
                for share in _named(frame, _frame_steps(context, scene, frame, operator, renders=renders)):
                    yield (done + share) / len(frames)
            frame_done((done + 1) / len(frames))
            yield (done + 1) / len(frames)


def _frame_steps(
    context: bpy.types.Context,
    scene: bpy.types.Scene,
    frame: int,
    operator: SteppedOperator | None,
    *,
    renders: bool,
) -> Iterator[float]:
    """Make and write the picture of one frame."""
    start = _SAMPLES_SHARE if renders else 0.0
    target = output_path(scene, frame)
    scene.frame_set(frame)
    with _placeholder(scene, target):
        if renders:
            for share in export_samples(scene, samples_path(scene), _render(operator)):
                yield start * share
            # The artist may have gone to another frame while Blender rendered.
            scene.frame_set(frame)
        steps = process_samples(context, samples_path(scene), scene)
        while True:
            try:
                share = next(steps)
            except StopIteration as stop:
                image: bpy.types.Image = stop.value
                break
            yield start + (1.0 - start) * share
        save_image(image, scene, target)


def _render(operator: SteppedOperator | None) -> Callable[[bpy.types.Scene], Iterator[float]]:
    """Return what renders a scene: as Blender's job where its window is to stay free."""
    if operator is None:
        return render_now
    return lambda scene: render_as_job(operator, scene)


def _named(frame: int, steps: Iterator[float]) -> Iterator[float]:
    """Run the steps of a frame; what goes wrong in them names it."""
    try:
        yield from steps
    except PotmesilError as error:
        text = rpt_("Frame {frame}: {error}").format(frame=frame, error=rpt_(str(error)))
        raise type(error)(text) from error


def _is_wanted(scene: bpy.types.Scene, frame: int) -> bool:
    """Return whether a frame is to be made: it may be there, and not be overwritten."""
    return scene.render.use_overwrite or not output_path(scene, frame).exists()


@contextlib.contextmanager
def _placeholder(scene: bpy.types.Scene, path: Path) -> Iterator[None]:
    """Let other Blenders see that a frame is being made; without a picture nothing stays of that."""
    made = None
    if scene.render.use_placeholder:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Another Blender may make its own at the same moment.
            with contextlib.suppress(FileExistsError), path.open("xb") as file:
                made = os.fstat(file.fileno())
        except OSError as error:
            text = rpt_("Cannot write '{path}': {reason}; check the folder and the disk.")
            raise OutputError(text.format(path=path, reason=error.strerror)) from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            if made is not None and os.path.samestat(made, path.stat()) and path.stat().st_size == 0:
                path.unlink()


def refuse_one_file(scene: bpy.types.Scene) -> None:
    """Raise InputError where all frames of an animation have the same samples file."""
    if len(frames_of(scene)) > 1 and "#" not in Path(samples_template(scene)).name:
        raise InputError(
            "All frames have the same samples file; put #### into the samples path, and render again."
        )
