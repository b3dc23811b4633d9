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
    uniform_defocus: bpy.props.FloatProperty(
        name="Uniform Defocus",
        description="Diameter on the film of the circle that the finished picture is evenly defocused by, "
        "whatever the depth, as in an optical printer",
        min=0.0,
        soft_max=5.0,
        default=0.0,
        precision=3,
        step=1,
        subtype="DISTANCE_CAMERA",
    )
    fade: bpy.props.FloatProperty(
        name="Fade",
        description="Share of the finished picture's light, from black to all of it",
        min=0.0,
        max=1.0,
        default=1.0,
        subtype="FACTOR",
    )
    use_motion: bpy.props.BoolProperty(
        name="Motion Blur",
        description="Run the motion processor on the samples",
        default=True,
    )
    motion_model: bpy.props.EnumProperty(
        name="Paths",
        description="Which path a sample of a moving object follows",
        items=(
            ("auto", "Auto", "One path where all samples of an object move alike, else one for each sample"),
            (
                "object",
                "One Path per Object",
                "All samples of an object share one path, as in the papers",
            ),
            (
                "vector",
                "One Path per Sample",
                "Each sample moves as its object and the camera do, or by its vector where shapes change",
            ),
        ),
        default="auto",
    )
    shutter_kind: bpy.props.EnumProperty(
        name="Type",
        description="How the shutter lets light onto the film",
        items=(
            ("whole", "Whole Film", "All of the film at once, or line by line with Cycles' rolling shutter"),
            ("focal_plane", "Focal Plane", "A slit travels over the film, so that moving objects are skewed"),
            (
                "between_lens",
                "Between the Lens",
                "Blades in the lens open and close the aperture, so that its radius varies with time",
            ),
        ),
        default="whole",
    )
    slit_edge: bpy.props.EnumProperty(
        name="Slit From",
        description="The side of the picture that the slit exposes first",
        items=(
            ("top", "Top", "From top to bottom"),
            ("bottom", "Bottom", "From bottom to top"),
            ("left", "Left", "From left to right"),
            ("right", "Right", "From right to left"),
        ),
        default="top",
    )
    slit_width: bpy.props.FloatProperty(
        name="Slit Width",
        description="Share of the exposure that a point of the film gets; at 1 the film is exposed at once",
        min=0.0,
        max=1.0,
        default=0.1,
        subtype="FACTOR",
    )
    blade_time: bpy.props.FloatProperty(
        name="Blade Time",
        description="Share of the exposure in which the blades open, and again close",
        min=0.0,
        max=0.5,
        default=0.2,
        subtype="FACTOR",
    )
    exposure_count: bpy.props.IntProperty(
        name="Exposures",
        description="How often the shutter opens for one picture",
        min=1,
        max=1000,
        soft_max=10,
        default=1,
    )
    exposure_duration: bpy.props.FloatProperty(
        name="Duration",
        description="How long each exposure lasts, in units of the shutter time",
        min=0.001,
        soft_max=1.0,
        default=0.2,
        precision=3,
        step=1,
    )
    exposure_spacing: bpy.props.FloatProperty(
        name="Spacing",
        description="From one exposure's begin to the next one's, in units of the shutter time; "
        "never less than the duration",
        min=0.001,
        soft_max=2.0,
        default=0.4,
        precision=3,
        step=1,
    )
    point_samples: bpy.props.BoolProperty(
        name="Point Samples",
        description=POINT_SAMPLES_TOOLTIP,
        default=False,
    )
    use_overscan: bpy.props.BoolProperty(
        name="Overscan",
        description=(
            "Render a margin around the picture, as wide as things move there during the exposure, so that "
            "what comes in from outside is there"
        ),
        default=True,
    )
    use_hidden_surfaces: bpy.props.BoolProperty(
        name="Hidden Surfaces",
        description="Also render what moving objects hide, and what hides them, so that it is really there "
        "when they move away. Frames with moving objects take up to three times as long",
        default=True,
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
