"""Our own properties: only what Blender's camera and render settings do not have."""

from __future__ import annotations

import bpy

from ..operators.setup_passes import POINT_SAMPLES_TOOLTIP


class PotmesilSceneSettings(bpy.types.PropertyGroup):
    """What is saved with the scene."""

    use_lens: bpy.props.BoolProperty(
        name="Depth of Field",
        description="Run the focus processor on the samples",
        default=True,
    )
    coc_model: bpy.props.EnumProperty(
        name="Circle of Confusion",
        description="How points out of focus are imaged",
        items=(
            ("cycles", "Match Cycles", "The field of view stays while the lens focuses, as in Cycles"),
            ("paper", "Lens Law", "The lens moves to focus, as a real one does and as in the papers"),
        ),
        default="cycles",
    )
    psf: bpy.props.EnumProperty(
        name="Aperture Image",
        description="What a point out of focus becomes",
        items=(
            ("disc", "Geometric", "The aperture's shape, evenly lit, with its blades and squeeze"),
            ("lommel", "Diffraction", "The diffraction pattern of a round aperture at three wavelengths"),
        ),
        default="disc",
    )
    point_samples: bpy.props.BoolProperty(
        name="Point Samples",
        description=POINT_SAMPLES_TOOLTIP,
        default=False,
    )
    samples_path: bpy.props.StringProperty(
        name="Samples",
        description="Where the samples of a frame are kept; # stands for the frame number",
        default="//potmesil/####.exr",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )


class PotmesilState(bpy.types.PropertyGroup):
    """What is going on now; lives with the window manager and is never saved."""

    running: bpy.props.BoolProperty(options={"SKIP_SAVE", "HIDDEN"})
    progress: bpy.props.FloatProperty(min=0.0, max=1.0, options={"SKIP_SAVE", "HIDDEN"})
    error: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})
