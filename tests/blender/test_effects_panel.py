"""The special effects in the panels: the core's settings, in the units that artists type."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import Field, asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from potmesil_addon.effects import DISTORTION_MODELS, KINDS, UNITS, effects_from_json
from sample_scenes.building import emitter

from .scenes import card

bpy = pytest.importorskip("bpy")

FIELDS = [(name, item) for name, kind in KINDS.items() for item in fields(kind)]
NUMBERS = [(name, item) for name, item in FIELDS if "least" in item.metadata]

LARGEST = 3.4028234663852886e38


def ids(pairs: list[tuple[str, Field[Any]]]) -> list[str]:
    return [f"{name}.{item.name}" for name, item in pairs]


def groups(scene: Any) -> Iterator[tuple[str, Any]]:
    return ((name, getattr(scene.potmesil_camera.effects, name)) for name in KINDS)


def unit_of(item: Field[Any]) -> float:
    """What the panel's unit is in the core's, by the core's own table; Blender has angles in radians."""
    unit = item.metadata["unit"]
    return 1.0 if unit == "deg" else UNITS[unit]


def single(value: float) -> float:
    """Return a number as Blender keeps it."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


@pytest.fixture
def said(scene: Any, module: Any) -> Any:
    """What the core is told of the scene's effects."""
    return lambda: module("operators.effects").scene_effects(scene)


def test_all_effects_and_no_others_are_there(scene: Any) -> None:
    own = scene.potmesil_camera.effects
    assert set(own.bl_rna.properties.keys()) - {"rna_type", "name"} == set(KINDS)
    for name, group in groups(scene):
        there = set(group.bl_rna.properties.keys()) - {"rna_type", "name", "clip"}
        assert there == {"use", *(item.name for item in fields(KINDS[name]))}


@pytest.mark.parametrize(("name", "item"), FIELDS, ids=ids(FIELDS))
def test_defaults_are_the_cores(scene: Any, name: str, item: Field[Any]) -> None:
    value = getattr(getattr(scene.potmesil_camera.effects, name), item.name)
    if "color" in item.metadata:
        assert tuple(value) == item.default
    elif "least" in item.metadata:
        assert value * unit_of(item) == pytest.approx(item.default)
        assert isinstance(value, int) == isinstance(item.default, int)
    else:
        assert value == item.default


@pytest.mark.parametrize(("name", "item"), NUMBERS, ids=ids(NUMBERS))
def test_hard_limits_are_the_cores(scene: Any, name: str, item: Field[Any]) -> None:
    rna = getattr(scene.potmesil_camera.effects, name).bl_rna.properties[item.name]
    for hard, limit in ((rna.hard_min, item.metadata["least"]), (rna.hard_max, item.metadata["most"])):
        if math.isinf(limit):
            assert hard == math.copysign(LARGEST, limit)
        else:
            assert hard * unit_of(item) == pytest.approx(limit)
    assert rna.hard_min <= rna.soft_min < rna.soft_max <= rna.hard_max


def test_settings_have_names_and_tooltips(scene: Any) -> None:
    for _, group in groups(scene):
        for rna in group.bl_rna.properties:
            if rna.identifier not in {"rna_type", "name"}:
                assert rna.name[0].isupper()
                assert rna.description
                assert not rna.description.endswith(".")


def test_models_are_the_cores_and_blenders(scene: Any) -> None:
    ours = scene.potmesil_camera.effects.distortion.bl_rna.properties["model"].enum_items.keys()
    assert ours == list(DISTORTION_MODELS)
    blenders = bpy.types.MovieTrackingCamera.bl_rna.properties["distortion_model"].enum_items.keys()
    assert {name.upper() for name in ours} == set(blenders)


@pytest.mark.parametrize(
    ("name", "field", "subtype"),
    [
        ("focal_surface", "tilt", "ANGLE"),
        ("star", "rotation", "ANGLE"),
        ("chromatic", "focus_red", "DISTANCE_CAMERA"),
        ("exposure", "tint", "COLOR"),
        ("image_filter", "image", "FILE_PATH"),
    ],
)
def test_units_are_blenders(scene: Any, name: str, field: str, subtype: str) -> None:
    group = getattr(scene.potmesil_camera.effects, name)
    assert group.bl_rna.properties[field].subtype == subtype


def test_what_is_off_is_none(said: Any) -> None:
    assert said() == dict.fromkeys(KINDS)
    assert effects_from_json(said()) == effects_from_json({})


def test_what_is_on_has_the_cores_defaults(scene: Any, said: Any) -> None:
    for name, group in groups(scene):
        group.use = True
        alone = said()
        assert {key for key, value in alone.items() if value is not None} == {name}
        made = asdict(getattr(effects_from_json(alone), name))
        for item in fields(KINDS[name]):
            default = pytest.approx(item.default) if "least" in item.metadata else item.default
            assert made[item.name] == default
        group.use = False


@pytest.mark.parametrize("end", ["hard_min", "hard_max"])
def test_the_core_takes_all_that_can_be_typed(scene: Any, said: Any, end: str) -> None:
    """Also where the limit is no number that Blender's floats have."""
    for _, group in groups(scene):
        group.use = True
        for rna in group.bl_rna.properties:
            if rna.type in {"FLOAT", "INT"} and not rna.is_array:
                setattr(group, rna.identifier, getattr(rna, end))
    made = effects_from_json(said())
    for name, item in NUMBERS:
        limit = item.metadata["least" if end == "hard_min" else "most"]
        if not math.isinf(limit):
            assert getattr(getattr(made, name), item.name) == pytest.approx(limit)


def test_values_arrive_in_metres_and_radians(scene: Any, said: Any) -> None:
    own = scene.potmesil_camera.effects
    for _, group in groups(scene):
        group.use = True
    own.pupil.spherical_aberration = 1.5
    own.focal_surface.tilt = math.radians(8.0)
    own.focal_surface.curvature = 12.5
    own.chromatic.focus_blue = -0.25
    own.star.groove_width = 50.0
    own.star.lines = 3
    own.grain.size = 12.0
    own.exposure.tint = (1.0, 0.5, 0.25)
    own.distortion.model = "nuke"
    own.diffraction.spectral = False
    made = effects_from_json(said())
    assert made.pupil is not None
    assert made.pupil.spherical_aberration == pytest.approx(0.0015)
    assert made.focal_surface is not None
    assert made.focal_surface.tilt == pytest.approx(8.0 * math.pi / 180.0)
    assert made.focal_surface.curvature == 12.5
    assert made.chromatic is not None
    assert made.chromatic.focus_blue == pytest.approx(-0.00025)
    assert made.star is not None
    assert (made.star.lines, made.star.groove_width) == (3, pytest.approx(50e-6))
    assert made.grain is not None
    assert made.grain.size == pytest.approx(12e-6)
    assert made.exposure is not None
    assert made.exposure.tint == (1.0, 0.5, 0.25)
    assert made.distortion is not None
    assert made.distortion.model == "nuke"
    assert made.diffraction is not None
    assert not made.diffraction.spectral


def test_pictures_beside_the_file_are_found(scene: Any, said: Any, tmp_path: Path) -> None:
    own = scene.potmesil_camera.effects
    own.pupil.use = own.image_filter.use = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    own.pupil.image = "//iris.png"
    assert said()["pupil"]["image"] == str(tmp_path / "iris.png")
    assert said()["image_filter"]["image"] == ""


@pytest.fixture
def clip(tmp_path: Path) -> Any:
    """A movie clip of one frame."""
    image = bpy.data.images.new("Frame", 8, 4)
    image.filepath_raw, image.file_format = str(tmp_path / "frame.png"), "PNG"
    image.save()
    return bpy.data.movieclips.load(str(tmp_path / "frame.png"))


@pytest.mark.parametrize(
    ("model", "blenders"),
    [
        ("POLYNOMIAL", {"k1": "k1", "k2": "k2", "k3": "k3"}),
        ("DIVISION", {"k1": "division_k1", "k2": "division_k2"}),
        ("NUKE", {"k1": "nuke_k1", "k2": "nuke_k2"}),
        ("BROWN", {name: f"brown_{name}" for name in ("k1", "k2", "k3", "k4", "p1", "p2")}),
    ],
)
def test_a_clips_coefficients_are_taken(
    scene: Any, said: Any, clip: Any, model: str, blenders: dict[str, str]
) -> None:
    own = scene.potmesil_camera.effects.distortion
    own.use, own.model, own.k1, own.k4, own.p2 = True, "brown", 0.5, 0.25, 0.125
    camera = clip.tracking.camera
    # Of each model, so that another one's would be found out.
    for number, rna in enumerate(camera.bl_rna.properties):
        if rna.identifier.rpartition("_")[2] in {"k1", "k2", "k3", "k4", "p1", "p2"}:
            setattr(camera, rna.identifier, 0.001 * (number + 1))
    camera.distortion_model = model
    own.clip = clip
    wanted = dict.fromkeys(("k1", "k2", "k3", "k4", "p1", "p2"), 0.0)
    wanted |= {name: getattr(camera, its) for name, its in blenders.items()}
    assert all(wanted[name] != 0.0 for name in blenders)
    assert said()["distortion"] == {"model": model.lower(), **wanted}
    own.clip = None
    assert said()["distortion"] == {
        "model": "brown", "k1": 0.5, "k2": 0.0, "k3": 0.0, "k4": 0.25, "p1": 0.0, "p2": 0.125,
    }  # fmt: skip


def test_processors_are_told_effects_and_frame(scene: Any, module: Any) -> None:
    own = scene.potmesil_camera.effects
    own.grain.use, own.grain.seed = True, 7
    scene.frame_set(12)
    settings = module("operators.process").process_settings(bpy.context)
    assert settings.effects.grain.seed == 7
    assert settings.effects.pupil is None
    assert settings.frame == 12


def result() -> Any:
    image = bpy.data.images["Potmesil Result"]
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)


def test_process_puts_them_into_the_picture(scene: Any) -> None:
    """A mirror lens makes a ring of a light out of focus, dark where a disc is bright."""
    card(scene, "Light", (0.0, 20.0, 0.0), 0.3, emitter("Glow", (100.0, 100.0, 100.0)))
    scene.camera.data.dof.aperture_fstop = 0.1
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    disc = result()[..., 0]
    pupil = scene.potmesil_camera.effects.pupil
    pupil.use, pupil.obstruction = True, 0.6
    assert bpy.ops.potmesil.process() == {"FINISHED"}
    ring = result()[..., 0]
    middle = np.s_[31:33, 47:49]
    assert ring[middle].max() < 0.1 * disc[middle].mean()
    assert ring.max() > 1.2 * disc.max()
    assert ring.sum() == pytest.approx(disc.sum(), rel=0.02)
    pupil.use = False
    assert bpy.ops.potmesil.process() == {"FINISHED"}
    np.testing.assert_allclose(result()[..., 0], disc, atol=1e-5)


def test_effects_follow_their_keys(scene: Any, said: Any) -> None:
    own = scene.potmesil_camera.effects
    own.focal_surface.use = True
    for frame, tilt in ((1, 0.0), (11, 0.2)):
        own.focal_surface.tilt = tilt
        assert own.focal_surface.keyframe_insert("tilt", frame=frame)
    scene.frame_set(6)
    assert said()["focal_surface"]["tilt"] == pytest.approx(0.1)
    scene.frame_set(11)
    assert said()["focal_surface"]["tilt"] == pytest.approx(0.2)


@pytest.fixture
def session(scene: Any, module: Any) -> Iterator[Any]:
    """What Live Focus knows, without its window, timer and keys."""
    found = module("operators.live")._Session(bpy.context)
    yield found
    found.close()


def change(group: Any) -> None:
    """Give all settings of an effect another value."""
    for rna in group.bl_rna.properties:
        name = rna.identifier
        if rna.type == "BOOLEAN":
            setattr(group, name, not getattr(group, name))
        elif rna.type == "ENUM":
            setattr(group, name, rna.enum_items[-1].identifier)
        elif rna.type == "STRING" and name != "name":
            setattr(group, name, "//other.png")
        elif rna.type in {"FLOAT", "INT"}:
            value = rna.soft_max if not rna.is_array else (0.5, 0.25, 0.125)
            setattr(group, name, value)


@pytest.mark.parametrize("name", KINDS)
def test_live_focus_follows_an_effect(scene: Any, module: Any, session: Any, name: str) -> None:
    Path(module("operators.scene").samples_path(scene)).touch()
    session._look(bpy.context)
    before = session._key
    session._look(bpy.context)
    assert session._key == before
    getattr(scene.potmesil_camera.effects, name).use = True
    session._look(bpy.context)
    switched = session._key
    assert switched != before
    change(getattr(scene.potmesil_camera.effects, name))
    getattr(scene.potmesil_camera.effects, name).use = True
    session._look(bpy.context)
    assert session._key not in (before, switched)
    assert session._request["settings"]["effects"][name] is not None


def test_live_focus_gives_effects_back(scene: Any, session: Any, said: Any, clip: Any) -> None:
    assert not session.restore()
    own = scene.potmesil_camera.effects
    for _, group in groups(scene):
        change(group)
    own.distortion.clip = clip
    assert None not in said().values()
    assert session.restore()
    assert said() == dict.fromkeys(KINDS)
    for name, item in FIELDS:
        value = getattr(getattr(own, name), item.name)
        if "color" in item.metadata:
            assert tuple(value) == item.default
        elif "least" in item.metadata:
            assert value == single(item.default / unit_of(item))
        else:
            assert value == item.default
    assert own.distortion.clip is None
    assert not session.restore()


def test_live_focus_gives_a_clip_back(scene: Any, module: Any, clip: Any) -> None:
    own = scene.potmesil_camera.effects.distortion
    own.clip = clip
    session = module("operators.live")._Session(bpy.context)
    own.clip = None
    assert session.restore()
    assert own.clip == clip
    session.close()


def test_brightness_is_that_of_the_exposure(scene: Any, module: Any) -> None:
    """By its closed form, and by what each stop of anything changes."""
    brightness = module("ui.effects_panels").brightness
    scene.camera.data.dof.aperture_fstop = 2.8
    scene.render.fps, scene.render.motion_blur_shutter = 24, 0.5
    assert brightness(scene) == pytest.approx(8.6 - math.log2(7.84 * 48.0), abs=1e-6)
    own = scene.potmesil_camera.effects.exposure
    normal = brightness(scene)
    own.sensitivity = 800.0
    assert brightness(scene) == pytest.approx(normal + 3.0, abs=1e-6)
    own.density = 2.0
    assert brightness(scene) == pytest.approx(normal + 1.0, abs=1e-6)
    scene.render.motion_blur_shutter = 0.25
    assert brightness(scene) == pytest.approx(normal, abs=1e-6)
    scene.camera.data.dof.aperture_fstop = 1.4
    assert brightness(scene) == pytest.approx(normal + 2.0, abs=1e-5)
    scene.render.motion_blur_shutter = 0.0
    assert brightness(scene) is None
    scene.render.motion_blur_shutter, scene.camera = 0.5, None
    assert brightness(scene) is None


def test_each_effect_has_a_panel_with_its_switch(module: Any) -> None:
    """The lens's on the camera's tab, the rest with the render, all of them closed."""
    panels = module("ui.effects_panels")
    found = {cls.effect: cls for cls in panels.CLASSES if hasattr(cls, "effect")}
    assert list(found) == list(KINDS)
    for name, cls in found.items():
        of_lens = name in module("ui.presets")._LENS_EFFECTS
        assert cls.bl_context == ("data" if of_lens else "render")
        assert cls.bl_parent_id == ("POTMESIL_PT_lens_character" if of_lens else "POTMESIL_PT_filters")
        assert cls.bl_options == {"DEFAULT_CLOSED"}
        assert cls.bl_label
