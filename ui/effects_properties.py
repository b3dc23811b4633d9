"""The settings of the special effects: a group for each effect of the core, with the same names."""

from __future__ import annotations

import math

import bpy

from .translations import OWN


class PotmesilPupil(bpy.types.PropertyGroup):
    """What Blender's iris does not say of the aperture's shape."""

    use: bpy.props.BoolProperty(
        name="Aperture Shape",
        description="Give the light of points out of focus the shape of a real aperture",
        default=False,
    )
    blade_curvature: bpy.props.FloatProperty(
        name="Blade Curvature",
        description="How far the blades are bent, from straight to a round aperture",
        min=0.0,
        max=1.0,
        default=0.0,
        subtype="FACTOR",
    )
    obstruction: bpy.props.FloatProperty(
        name="Obstruction",
        description="Diameter of a mirror lens's secondary mirror, as a share of the aperture's: lights out "
        "of focus become rings",
        min=0.0,
        max=0.95,
        default=0.0,
        subtype="FACTOR",
    )
    apodisation: bpy.props.FloatProperty(
        name="Apodisation",
        description="Density of a filter in the aperture that darkens towards the rim, so that lights out of "
        "focus have soft edges",
        min=0.0,
        max=10.0,
        soft_max=4.0,
        default=0.0,
        precision=2,
        step=10,
    )
    spherical_aberration: bpy.props.FloatProperty(
        name="Spherical Aberration",
        description="How far behind the focus of rays near the axis those through the rim meet at f/1: "
        "positive gives soft rims before and hard rims behind the plane in focus, negative the reverse",
        min=-1000.0,
        max=1000.0,
        soft_min=-10.0,
        soft_max=10.0,
        default=0.0,
        precision=3,
        step=10,
        subtype="DISTANCE_CAMERA",
    )
    image: bpy.props.StringProperty(
        name="Picture",
        description="A picture of the aperture, white where light passes, in place of blades and obstruction",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )


class PotmesilFocalSurface(bpy.types.PropertyGroup):
    """Where the lens is sharp, other than in a plane across its axis."""

    use: bpy.props.BoolProperty(
        name="Focal Surface",
        description="Tilt the plane in focus as a view camera does, or bend it",
        default=False,
    )
    tilt: bpy.props.FloatProperty(
        name="Tilt",
        description="Angle that the lens is tilted up by: what is above is sharp nearer by",
        translation_context=OWN,
        min=-math.pi / 4,
        max=math.pi / 4,
        soft_min=-math.radians(15.0),
        soft_max=math.radians(15.0),
        default=0.0,
        subtype="ANGLE",
    )
    swing: bpy.props.FloatProperty(
        name="Swing",
        description="Angle that the lens is swung to the right by: what is right is sharp nearer by",
        translation_context=OWN,
        min=-math.pi / 4,
        max=math.pi / 4,
        soft_min=-math.radians(15.0),
        soft_max=math.radians(15.0),
        default=0.0,
        subtype="ANGLE",
    )
    curvature: bpy.props.FloatProperty(
        name="Curvature",
        description="One over the radius, in metres, of the surface that the lens images sharply onto: with "
        "positive ones the border is sharp nearer by than the middle",
        translation_context=OWN,
        min=-1000.0,
        max=1000.0,
        soft_min=-20.0,
        soft_max=20.0,
        default=0.0,
        precision=2,
        step=10,
    )


class PotmesilChromaticAberration(bpy.types.PropertyGroup):
    """Colours that a lens images elsewhere than green."""

    use: bpy.props.BoolProperty(
        name="Chromatic Aberration",
        description="Focus the colours at other distances, or image them at other sizes, as simple lenses do",
        default=False,
    )
    focus_red: bpy.props.FloatProperty(
        name="Focus Red",
        description="How far behind green's focus on the film side red's lies: what is out of focus has "
        "coloured rims",
        min=-10.0,
        max=10.0,
        soft_min=-0.5,
        soft_max=0.5,
        default=0.0,
        precision=3,
        step=1,
        subtype="DISTANCE_CAMERA",
    )
    focus_blue: bpy.props.FloatProperty(
        name="Focus Blue",
        description="How far behind green's focus on the film side blue's lies: what is out of focus has "
        "coloured rims",
        min=-10.0,
        max=10.0,
        soft_min=-0.5,
        soft_max=0.5,
        default=0.0,
        precision=3,
        step=1,
        subtype="DISTANCE_CAMERA",
    )
    size_red: bpy.props.FloatProperty(
        name="Size Red",
        description="Share by which red's picture is larger than green's: edges towards the corners have "
        "coloured fringes",
        min=-0.1,
        max=0.1,
        soft_min=-0.01,
        soft_max=0.01,
        default=0.0,
        precision=4,
        step=0.01,
    )
    size_blue: bpy.props.FloatProperty(
        name="Size Blue",
        description="Share by which blue's picture is larger than green's: edges towards the corners have "
        "coloured fringes",
        min=-0.1,
        max=0.1,
        soft_min=-0.01,
        soft_max=0.01,
        default=0.0,
        precision=4,
        step=0.01,
    )


class PotmesilVignetting(bpy.types.PropertyGroup):
    """Light that is lost towards the corners."""

    use: bpy.props.BoolProperty(
        name="Vignetting",
        description="Darken the corners, and cut lights out of focus there to cat's eyes",
        default=False,
    )
    natural: bpy.props.FloatProperty(
        name="Natural",
        description="Share of the fall of light with the fourth power of the cosine of its angle, which a "
        "simple lens has in full",
        min=0.0,
        max=1.0,
        default=1.0,
        subtype="FACTOR",
    )
    mechanical: bpy.props.FloatProperty(
        name="Cat's Eye",
        description="How far apart the two ends of the lens's barrel are seen from the corners, in diameters "
        "of the aperture",
        min=0.0,
        max=1.0,
        default=0.0,
        subtype="FACTOR",
    )
    fastest_f_stop: bpy.props.FloatProperty(
        name="Fastest F-Stop",
        description="F-stop at which the aperture is as wide as the barrel: stopped down from there, cat's "
        "eyes go. 0 is the present one",
        min=0.0,
        max=128.0,
        soft_max=22.0,
        default=0.0,
        precision=1,
        step=10,
    )


class PotmesilDistortion(bpy.types.PropertyGroup):
    """Straight lines that the lens bends."""

    use: bpy.props.BoolProperty(
        name="Distortion",
        description="Bend straight lines to a barrel or a pincushion, by the formulas of movie clips",
        translation_context=OWN,
        default=False,
    )
    clip: bpy.props.PointerProperty(
        name="Clip",
        description="Movie clip whose solved camera says how lines are bent, in place of the numbers below",
        type=bpy.types.MovieClip,
    )
    model: bpy.props.EnumProperty(
        name="Model",
        description="Formula of the movie clip editor",
        items=(
            ("brown", "Brown", "Radial and tangential terms by Brown and Conrady"),
            ("polynomial", "Polynomial", "Radial terms, which fit common cameras"),
            ("division", "Division", "One over a polynomial, which fits wide-angle lenses better"),
            ("nuke", "Nuke", "The terms of Nuke's lens distortion"),
        ),
        default="brown",
    )
    k1: bpy.props.FloatProperty(
        name="K1",
        description="Coefficient of the second power of the radius; with Brown, below 0 is a barrel and "
        "above 0 a pincushion",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )
    k2: bpy.props.FloatProperty(
        name="K2",
        description="Coefficient of the fourth power of the radius",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )
    k3: bpy.props.FloatProperty(
        name="K3",
        description="Coefficient of the sixth power of the radius",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )
    k4: bpy.props.FloatProperty(
        name="K4",
        description="Coefficient of the eighth power of the radius",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )
    p1: bpy.props.FloatProperty(
        name="P1",
        description="First tangential coefficient, of a lens off its axis",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )
    p2: bpy.props.FloatProperty(
        name="P2",
        description="Second tangential coefficient, of a lens off its axis",
        min=-10.0,
        max=10.0,
        soft_min=-1.0,
        soft_max=1.0,
        default=0.0,
        precision=4,
        step=0.1,
    )


class PotmesilDiffraction(bpy.types.PropertyGroup):
    """The pattern that the aperture's edges make of every light."""

    use: bpy.props.BoolProperty(
        name="Diffraction",
        description="Spread all light by the diffraction pattern of the aperture, which gives bright lights "
        "the stars of a lens stopped down",
        default=False,
    )
    strength: bpy.props.FloatProperty(
        name="Strength",
        description="Share of the light that is diffracted; 1 is physical",
        min=0.0,
        max=1.0,
        default=1.0,
        subtype="FACTOR",
    )
    f_stop: bpy.props.FloatProperty(
        name="F-Stop",
        description="F-stop of the pattern in place of the lens's; 0 is the lens's",
        min=0.0,
        max=1024.0,
        soft_max=64.0,
        default=0.0,
        precision=1,
        step=10,
    )
    spectral: bpy.props.BoolProperty(
        name="Full Spectrum",
        description="Let all wavelengths make the pattern, which gives its streaks the colours of a rainbow, "
        "and not only one for each of red, green and blue",
        default=True,
    )


class PotmesilStarFilter(bpy.types.PropertyGroup):
    """Glass with fine grooves before the lens."""

    use: bpy.props.BoolProperty(
        name="Star Filter",
        description="Put glass with fine parallel grooves before the lens, which draw lights out to streaks",
        default=False,
    )
    lines: bpy.props.IntProperty(
        name="Directions",
        description="Directions of the grooves, each of which gives a star two points",
        min=1,
        max=8,
        default=2,
    )
    rotation: bpy.props.FloatProperty(
        name="Rotation",
        description="Angle of the first streak, counter-clockwise from level",
        default=0.0,
        subtype="ANGLE",
    )
    strength: bpy.props.FloatProperty(
        name="Strength",
        description="Share of the light that falls on grooves",
        min=0.0,
        max=1.0,
        default=0.1,
        subtype="FACTOR",
    )
    groove_width: bpy.props.FloatProperty(
        name="Width (µm)",
        description="Width of a groove: the narrower, the longer the streaks",
        min=1.0,
        max=10000.0,
        soft_max=200.0,
        default=20.0,
        precision=1,
        step=100,
    )


class PotmesilImageFilter(bpy.types.PropertyGroup):
    """A picture of what a point of light becomes."""

    use: bpy.props.BoolProperty(
        name="Image Filter",
        description="Give a share of all light the form of a picture, such as a glare that was photographed",
        default=False,
    )
    image: bpy.props.StringProperty(
        name="Picture",
        description="What a point of light becomes; the picture's middle is the point's place",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    strength: bpy.props.FloatProperty(
        name="Strength",
        description="Share of the light that takes the picture's form",
        min=0.0,
        max=1.0,
        default=0.1,
        subtype="FACTOR",
    )
    size: bpy.props.FloatProperty(
        name="Size",
        description="Width of the picture as a share of the frame's",
        min=0.001,
        max=4.0,
        soft_max=1.0,
        default=0.25,
        precision=3,
        step=1,
    )
    rotation: bpy.props.FloatProperty(
        name="Rotation",
        description="Angle that the picture is turned by, counter-clockwise",
        default=0.0,
        subtype="ANGLE",
    )


class PotmesilExposure(bpy.types.PropertyGroup):
    """How bright film speed, f-stop and exposure time make the picture."""

    use: bpy.props.BoolProperty(
        name="Exposure",
        description="Let film speed, f-stop and shutter time brighten and darken the picture as in a real "
        "camera",
        default=False,
    )
    sensitivity: bpy.props.FloatProperty(
        name="ISO",
        description="Speed of the film or the sensor: twice the number is one stop brighter",
        min=1.0,
        max=1e7,
        soft_min=25.0,
        soft_max=25600.0,
        default=100.0,
        precision=0,
        step=10000,
    )
    normal_ev: bpy.props.FloatProperty(
        name="Normal EV",
        description="Exposure value at ISO 100 that leaves the picture as it was rendered: that of the light "
        "that the scene stands for, such as 15 in the sun",
        min=-20.0,
        max=30.0,
        soft_min=-6.0,
        soft_max=17.0,
        default=8.6,
        precision=2,
        step=10,
    )
    density: bpy.props.FloatProperty(
        name="ND Filter",
        description="How much a grey filter before the lens darkens the picture, in stops",
        min=-20.0,
        max=30.0,
        soft_min=0.0,
        soft_max=10.0,
        default=0.0,
        precision=2,
        step=10,
    )
    tint: bpy.props.FloatVectorProperty(
        name="Filter Color",
        description="Share of red, green and blue light that a coloured filter before the lens lets through",
        size=3,
        min=0.0,
        soft_max=1.0,
        default=(1.0, 1.0, 1.0),
        subtype="COLOR",
    )


class PotmesilFilmGrain(bpy.types.PropertyGroup):
    """Silver or dye clouds of an emulsion."""

    use: bpy.props.BoolProperty(
        name="Film Grain",
        description="Give the picture the grain of a film, by the granularity on its data sheet",
        default=False,
    )
    granularity: bpy.props.FloatProperty(
        name="Granularity",
        description="RMS granularity of film data sheets: 1000 times the deviation of density seen through a "
        "hole of 48 µm. About 5 is very fine, 10 fine, 20 coarse",
        min=0.0,
        max=200.0,
        soft_max=40.0,
        default=10.0,
        precision=1,
        step=10,
    )
    size: bpy.props.FloatProperty(
        name="Size (µm)",
        description="Diameter of a grain or dye cloud on the film",
        min=1.0,
        max=1000.0,
        soft_max=50.0,
        default=10.0,
        precision=1,
        step=10,
    )
    color: bpy.props.FloatProperty(
        name="Color",
        description="How different the grain of red, green and blue is: 0 for black-and-white film, 1 for "
        "three layers apart",
        min=0.0,
        max=1.0,
        default=0.5,
        subtype="FACTOR",
    )
    seed: bpy.props.IntProperty(
        name="Seed",
        description="Another seed is another piece of film; each frame has its own grain anyway",
        min=0,
        soft_max=1000,
        default=0,
    )


class PotmesilSensorNoise(bpy.types.PropertyGroup):
    """Photons that are counted and charge that is read out."""

    use: bpy.props.BoolProperty(
        name="Sensor Noise",
        description="Count photons as an electronic sensor does, which is noisy where light is scarce",
        default=False,
    )
    full_well: bpy.props.FloatProperty(
        name="Full Well",
        description="Electrons that white at ISO 100 gives a pixel: about 50000 with full frame, 5000 in a "
        "phone. The ISO is that of Exposure",
        min=10.0,
        max=1e7,
        soft_min=1000.0,
        soft_max=100000.0,
        default=50000.0,
        precision=0,
        step=100000,
    )
    read_noise: bpy.props.FloatProperty(
        name="Read Noise",
        description="Electrons by which reading a pixel out deviates, which is what is left in the dark",
        min=0.0,
        max=10000.0,
        soft_max=50.0,
        default=3.0,
        precision=1,
        step=10,
    )
    seed: bpy.props.IntProperty(
        name="Seed",
        description="Another seed is another take; each frame has its own noise anyway",
        min=0,
        soft_max=1000,
        default=0,
    )


class PotmesilEffects(bpy.types.PropertyGroup):
    """All special effects."""

    pupil: bpy.props.PointerProperty(type=PotmesilPupil)
    focal_surface: bpy.props.PointerProperty(type=PotmesilFocalSurface)
    chromatic: bpy.props.PointerProperty(type=PotmesilChromaticAberration)
    vignetting: bpy.props.PointerProperty(type=PotmesilVignetting)
    distortion: bpy.props.PointerProperty(type=PotmesilDistortion)
    diffraction: bpy.props.PointerProperty(type=PotmesilDiffraction)
    star: bpy.props.PointerProperty(type=PotmesilStarFilter)
    image_filter: bpy.props.PointerProperty(type=PotmesilImageFilter)
    exposure: bpy.props.PointerProperty(type=PotmesilExposure)
    grain: bpy.props.PointerProperty(type=PotmesilFilmGrain)
    noise: bpy.props.PointerProperty(type=PotmesilSensorNoise)


CLASSES = (
    PotmesilPupil,
    PotmesilFocalSurface,
    PotmesilChromaticAberration,
    PotmesilVignetting,
    PotmesilDistortion,
    PotmesilDiffraction,
    PotmesilStarFilter,
    PotmesilImageFilter,
    PotmesilExposure,
    PotmesilFilmGrain,
    PotmesilSensorNoise,
    PotmesilEffects,
)
