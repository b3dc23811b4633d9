"""Composite: a scene's compositor on the samples that are there, and animations by way of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ..potmesil_addon.errors import InputError
from . import stage
from .borrow import Borrowed
from .export import export_samples, samples_path
from .job import render_as_job
from .motion import kept_scene
from .work import SteppedOperator

_SAMPLES_SHARE = 0.6
"""Share of the progress bar for the samples of all frames; the rest is processing and compositing them."""


class Outcome:
    """What the last render through a stage came to."""

    error = ""


class POTMESIL_OT_composite(SteppedOperator, bpy.types.Operator):
    """Run the compositor on the rendered samples with the present settings, without rendering again"""

    bl_idname = "potmesil.composite"
    bl_label = "Composite"
    bl_options = {"REGISTER"}

    animation: bpy.props.BoolProperty(
        name="Animation",
        description="Composite the samples of all frames, and write them as Render Animation does",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a stage."""
        return _has_stage(cls, context)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Say what the button does, of which there are two."""
        del context
        if properties.animation:
            return "Composite the rendered samples of all frames, and write them, without rendering again"
        return str(cls.__doc__)

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Composite the current frame, or all."""
        operator = self if interactive else None
        yield from composite(context.scene, operator, animation=self.animation)


class POTMESIL_OT_render_animation(SteppedOperator, bpy.types.Operator):
    """Render the samples of all frames without blur, then blur, composite and write them"""

    bl_idname = "potmesil.render_animation"
    bl_label = "Render Animation"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a stage."""
        return _has_stage(cls, context)

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Make the samples of every frame, then let Blender go through the frames again."""
        scene = context.scene
        operator = self if interactive else None
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)

        def render() -> Iterator[float]:
            return _render_now(scene) if operator is None else render_as_job(operator, scene)

        refuse_unready(scene)
        with kept_scene(scene):
            for done, frame in enumerate(frames):
                scene.frame_set(frame)
                for share in export_samples(scene, samples_path(scene), render):
                    yield _SAMPLES_SHARE * (done + share) / len(frames)
        for share in composite(scene, operator, animation=True):
            yield _SAMPLES_SHARE + (1.0 - _SAMPLES_SHARE) * share


def refuse_unready(scene: bpy.types.Scene) -> None:
    """Raise InputError where a scene has no stage that is all there is to composite."""
    trios = stage.trios(scene)
    if not trios:
        raise InputError("The compositor has no stage; press Add Stage.")
    known = {trio.samples.name for trio in trios}
    for node in stage.rendering_nodes(scene):
        if node.name not in known:
            raise InputError(
                f"The Render Layers node '{node.name}' is not part of the stage; press Add Stage, or mute it."
            )


def composite(
    scene: bpy.types.Scene, operator: SteppedOperator | None, *, animation: bool = False
) -> Iterator[float]:
    """Run a scene's compositor on the samples that are there.

    Parameters
    ----------
    scene : Scene
        A scene with a stage.
    operator : SteppedOperator or None
        Whose step this is, where Blender's window is to stay free.
    animation : bool
        Composite all frames and write them.

    Yields
    ------
    float
        Share of the work done, as far as it is known.

    Raises
    ------
    InputError
        If the scene has no stage, or the samples are missing or wrong.
    """
    refuse_unready(scene)
    with Borrowed() as borrowed:
        # With no Render Layers node of the scene Blender runs the compositor alone.
        for node in stage.rendering_nodes(scene):
            borrowed.set(node, "mute", True)
        borrowed.set(scene.render, "use_compositing", True)
        Outcome.error = ""
        if operator is not None:
            # The stage goes through frames in the render's thread; nothing comes after that ESC could miss.
            yield from render_as_job(operator, scene, animation=animation, locked=True)
        else:
            yield from _render_now(scene, animation=animation)
        if Outcome.error:
            raise InputError(Outcome.error)


def _render_now(scene: bpy.types.Scene, *, animation: bool = False) -> Iterator[float]:
    """Render, and wait for it."""
    try:
        bpy.ops.render.render(scene=scene.name, animation=animation)
    except RuntimeError as error:
        raise InputError(Outcome.error or f"Blender could not render: {str(error).strip()}") from error
    yield 1.0


def _has_stage(cls: Any, context: bpy.types.Context) -> bool:
    if stage.stage_scene(context.scene) is None:
        cls.poll_message_set("The compositor has no stage; press Add Stage")
        return False
    return True
