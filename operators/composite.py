"""Composite: a scene's compositor on the samples that are there, of one frame or all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_

from ..potmesil_addon.errors import InputError
from . import stage
from .borrow import Borrowed
from .job import render_as_job
from .motion import kept_scene
from .work import SteppedOperator, by_frames, doing


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
        if stage.stage_scene(context.scene) is None:
            cls.poll_message_set(tip_("The compositor has no stage; press Add Stage"))
            return False
        return True

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Say what the button does, of which there are two."""
        del context
        if properties.animation:
            return tip_(
                "Composite the rendered samples of all frames, and write them, without rendering again"
            )
        return tip_(str(cls.__doc__))

    def steps(self, context: bpy.types.Context, *, interactive: bool) -> Iterator[float]:
        """Composite the current frame, or all."""
        operator = self if interactive else None
        steps = composite(context.scene, operator, animation=self.animation)
        yield from by_frames(steps) if self.animation else steps


def refuse_unready(scene: bpy.types.Scene) -> None:
    """Raise InputError where a scene has no stage that is all there is to composite."""
    trios = stage.trios(scene)
    if not trios:
        raise InputError("The compositor has no stage; press Add Stage.")
    known = {trio.samples.name for trio in trios}
    for node in stage.rendering_nodes(scene):
        if node.name not in known:
            text = rpt_(
                "The Render Layers node '{name}' is not part of the stage; press Add Stage, or mute it."
            )
            raise InputError(text.format(name=node.name))


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
    frame = iface_("Compositing Frame {frame}").format(frame=scene.frame_current)
    doing(iface_("Compositing All Frames") if animation else frame)
    # Renders, too, take changes back that were never keyed.
    with kept_scene(scene), Borrowed() as borrowed:
        # With no Render Layers node of the scene Blender runs the compositor alone.
        for node in stage.rendering_nodes(scene):
            borrowed.set(node, "mute", True)
        borrowed.set(scene.render, "use_compositing", True)
        Outcome.error = ""
        if operator is not None:
            # The stage goes through frames in the render's thread; nothing comes after that ESC could miss.
            yield from render_as_job(operator, scene, animation=animation, locked=True)
        else:
            yield from render_now(scene, animation=animation)
        if Outcome.error:
            raise InputError(Outcome.error)


def render_now(scene: bpy.types.Scene, *, animation: bool = False) -> Iterator[float]:
    """Render, and wait for it."""
    try:
        bpy.ops.render.render(scene=scene.name, animation=animation)
    except RuntimeError as error:
        text = rpt_("Blender could not render: {reason}").format(reason=str(error).strip())
        raise InputError(Outcome.error or text) from error
    yield 1.0
