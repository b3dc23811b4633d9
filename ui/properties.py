"""Our own properties: only what Blender's camera and render settings do not have."""

from __future__ import annotations

import math

import bpy

from .effects_properties import PotmesilEffects
from .translations import OWN


def _shutter_angle(self: PotmesilSceneSettings) -> float:
    return 2.0 * math.pi * float(self.id_data.render.motion_blur_shutter)


def _set_shutter_angle(self: PotmesilSceneSettings, angle: float) -> None:
    self.id_data.render.motion_blur_shutter = angle / (2.0 * math.pi)


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
    visibility: bpy.props.EnumProperty(
        name="Visibility",
        description="What the lens sees of things behind others",
        items=(
            (
                "aperture",
                "Aperture",
                "Near things hide what is behind them from a part of the aperture, as with a real lens",
            ),
            (
                "none",
                "None (Papers)",
                "The light of all things is added, as in the papers: faster, but blurred backgrounds spread "
                "over what is before them",
            ),
        ),
        default="aperture",
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
        translation_context=OWN,
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
            (
                "rotary",
                "Rotary Disc",
                "A disc with an opening turns once a frame before the gate, whose sides it uncovers one "
                "after the other",
            ),
        ),
        default="whole",
    )
    shutter_angle: bpy.props.FloatProperty(
        name="Shutter Angle",
        description="Blender's own Shutter as the opening of a disc that turns once a frame; to animate it, "
        "key Shutter",
        get=_shutter_angle,
        set=_set_shutter_angle,
        min=0.0,
        soft_max=2.0 * math.pi,
        subtype="ANGLE",
        options=set(),
    )
    gate_angle: bpy.props.FloatProperty(
        name="Gate Angle",
        description="Angle of the film gate as seen from the disc's axis: its last side is exposed by so "
        "much later",
        min=0.0,
        max=math.pi,
        default=math.radians(30.0),
        subtype="ANGLE",
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
    use_flash: bpy.props.BoolProperty(
        name="Flash",
        description="Light the scene with flashes while the shutter is open. Their light falls on everything "
        "alike",
        default=False,
    )
    flash_curtain: bpy.props.EnumProperty(
        name="Curtain",
        description="With which end of the exposure the flash is in step",
        items=(
            ("first", "First Curtain", "When the shutter has opened: trails run ahead of what moves"),
            ("second", "Second Curtain", "Before the shutter closes: trails follow what moves"),
        ),
        default="second",
    )
    flash_share: bpy.props.FloatProperty(
        name="Flash Light",
        description="Share of the exposure's light that comes from flashes; the rest is ambient",
        min=0.0,
        max=1.0,
        default=0.5,
        subtype="FACTOR",
    )
    flash_duration: bpy.props.FloatProperty(
        name="Flash Duration",
        description="How long a flash lasts, in units of the shutter time",
        min=0.0001,
        max=1.0,
        soft_max=0.1,
        default=0.01,
        precision=4,
        step=1,
    )
    flash_count: bpy.props.IntProperty(
        name="Flashes",
        description="More than one is a strobe, evenly over the exposure",
        min=1,
        max=1000,
        soft_max=20,
        default=1,
    )
    sampling: bpy.props.EnumProperty(
        name="Samples",
        description="How finely the picture is sampled, by Cycles only",
        translation_context=OWN,
        items=(
            ("PIXELS", "Pixels", "One sample for each pixel, filtered as in any render"),
            (
                "FINE",
                "Fine",
                "Twice the size, filtered as always: closest to Cycles. It has four times the pixels; give "
                "Cycles a quarter of the samples",
            ),
            (
                "POINTS",
                "Points",
                "Twice the size with the smallest filter, so that each sample is one point, as in the "
                "papers; fine texture in focus suffers. It has four times the pixels; give Cycles a quarter "
                "of the samples",
            ),
        ),
        default="PIXELS",
    )
    use_overscan: bpy.props.BoolProperty(
        name="Overscan",
        description=(
            "Render a margin around the picture, as wide as things move there during the exposure and as "
            "circles of confusion reach in, so that what comes in from outside is there. It takes longer by "
            "the square: a margin of a tenth of the picture on each side by almost a half"
        ),
        default=True,
    )
    use_hidden_surfaces: bpy.props.BoolProperty(
        name="Hidden Surfaces",
        description="Also render what moving objects hide, and what hides them, so that it is really there "
        "when they move away. Frames with moving objects take up to three times as long",
        default=True,
    )
    depth_peeling: bpy.props.EnumProperty(
        name="Depth Peeling",
        description="Also render what near things hide, which the lens sees past their blurred edges. Each "
        "further view takes about as long as the picture",
        items=(
            ("OFF", "Off", "What near things hide is not rendered"),
            (
                "AUTOMATIC",
                "Automatic",
                "Leave out what is nearest, parted where circles of confusion differ most; what is farthest, "
                "large as the ground, or around the camera stays",
            ),
            ("COLLECTIONS", "Collections", "Leave out one collection marked Peel Off after the other"),
        ),
        default="OFF",
    )
    peel_count: bpy.props.IntProperty(
        name="Layers",
        description="How many further views there may be, each without more of what is near",
        min=1,
        max=4,
        default=2,
    )
    reflections: bpy.props.EnumProperty(
        name="Reflections",
        description="Focus and move what mirrors and glass show apart from the surfaces that show it. Probes "
        "of one sample a pixel find how far it is and how it moves",
        translation_context=OWN,
        items=(
            ("OFF", "Off", "What mirrors and glass show is focused and moves as their surfaces do"),
            (
                "REFLECTIONS",
                "Reflections",
                "What mirrors and glass show is focused by its distance along the path of the light, and "
                "moves by itself",
            ),
            (
                "REFLECTIONS_AND_SHADOWS",
                "Reflections and Shadows",
                "Shadows of moving objects move, too. Frames with moving objects need the views of Hidden "
                "Surfaces and one more",
            ),
        ),
        default="OFF",
    )
    max_roughness: bpy.props.FloatProperty(
        name="Roughness Limit",
        description="Objects whose materials are rougher than this do not count as mirrors or glass: what "
        "they show keeps the depth of their surface",
        min=0.0,
        max=1.0,
        default=0.3,
        subtype="FACTOR",
    )
    show_limits: bpy.props.BoolProperty(
        name="Show Limits",
        description="Show the near limit, the plane in focus with a handle, and the far limit of the scene's "
        "camera in the 3D viewports",
        default=False,
    )
    use_quality_maps: bpy.props.BoolProperty(
        name="Show Quality Maps",
        description="Let Process also make the images Potmesil Error, how far each pixel is expected to be "
        "off, and Potmesil Guessed, how much of its light was guessed",
        default=False,
    )
    effects: bpy.props.PointerProperty(
        name="Special Effects",
        description="What a real lens, filters, film and sensor add to the picture",
        type=PotmesilEffects,
    )
    samples_path: bpy.props.StringProperty(
        name="Samples",
        description="Where the samples of a frame are kept; # stands for the frame number",
        default="//potmesil/####.exr",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )

    stage_of: bpy.props.PointerProperty(
        name="Stage Of",
        description="The scene whose processed picture this one hands to the compositor",
        type=bpy.types.Scene,
        options={"HIDDEN"},
    )


class PotmesilCollectionSettings(bpy.types.PropertyGroup):
    """What is saved with a collection."""

    peel: bpy.props.BoolProperty(
        name="Peel Off",
        description="Render a view without this collection, and without what is marked and nearer, for what "
        "its objects hide, where Depth Peeling is set to Collections",
        default=False,
    )


class PotmesilObjectSettings(bpy.types.PropertyGroup):
    """What is saved with an object."""

    surface: bpy.props.EnumProperty(
        name="Surface",
        description="What light does at this object, where Reflections is on",
        translation_context=OWN,
        items=(
            ("AUTO", "As Material", "As the object's materials say"),
            ("OPAQUE", "Opaque", "Its surface is what is seen: nothing is followed further"),
            (
                "POLISHED",
                "Polished",
                "A clear coat over something opaque: it reflects where it is seen directly, and ends a path "
                "of light that comes from another mirror",
            ),
            ("MIRROR", "Mirror", "Metal: it always reflects"),
            ("GLASS", "Glass", "It lets light through and bends it, and reflects where it is seen directly"),
            ("CLEAR", "Clear", "Light goes straight through"),
        ),
        default="AUTO",
        override={"LIBRARY_OVERRIDABLE"},
    )


class PotmesilState(bpy.types.PropertyGroup):
    """What is going on now; lives with the window manager and is never saved."""

    running: bpy.props.BoolProperty(options={"SKIP_SAVE", "HIDDEN"})
    progress: bpy.props.FloatProperty(min=0.0, max=1.0, options={"SKIP_SAVE", "HIDDEN"})
    doing: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})
    seconds_left: bpy.props.FloatProperty(default=-1.0, options={"SKIP_SAVE", "HIDDEN"})
    error: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})
    live: bpy.props.BoolProperty(options={"SKIP_SAVE", "HIDDEN"})
    live_message: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})
    has_quality: bpy.props.BoolProperty(options={"SKIP_SAVE", "HIDDEN"})
    guessed_pixels: bpy.props.FloatProperty(options={"SKIP_SAVE", "HIDDEN"})
    expected_error: bpy.props.FloatProperty(options={"SKIP_SAVE", "HIDDEN"})

    inspect: bpy.props.BoolProperty(options={"SKIP_SAVE", "HIDDEN"})
    inspect_message: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})
    inspect_overlay: bpy.props.BoolProperty(
        name="Overlay",
        description="Colour what is near, sharp and far by the limits of the depth of field",
        default=True,
        options={"SKIP_SAVE"},
    )
    inspect_readout: bpy.props.BoolProperty(
        name="Read-Out",
        description="Show the distance and the circle of confusion of what is under the mouse",
        default=True,
        options={"SKIP_SAVE"},
    )
    inspect_psf: bpy.props.BoolProperty(
        name="PSF",
        description="Draw the point-spread function under the mouse: what becomes of a point there",
        default=True,
        options={"SKIP_SAVE"},
    )
    inspect_compare: bpy.props.BoolProperty(
        name="Compare",
        description="Show the render as it is before the lens and the shutter to the left of a line that can "
        "be dragged",
        default=False,
        options={"SKIP_SAVE"},
    )
    split: bpy.props.FloatProperty(
        name="Split",
        description="Share of the picture to the left of the line, which shows the render before",
        min=0.0,
        max=1.0,
        default=0.5,
        subtype="FACTOR",
        options={"SKIP_SAVE"},
    )
