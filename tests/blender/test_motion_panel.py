"""The shutter in the panel: from Blender's and our properties to the processors' settings."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import bpy
import pytest

from sample_scenes.building import emitter

from .scenes import card

OpenEXR = pytest.importorskip("OpenEXR")


@pytest.fixture
def settings(scene: Any, module: Any) -> Any:
    """Return the settings that Process would take now."""
    return lambda: module("operators.process").process_settings(bpy.context)


def resolved(settings: Any) -> Any:
    return settings().shutter.resolve()


def slit_of(settings: Any) -> tuple[str, float]:
    slit = settings().shutter.slit
    return slit.edge, slit.width


def test_a_new_scene_has_blenders_shutter(settings: Any) -> None:
    now = settings()
    assert (now.use_motion, now.motion_model) == (True, "auto")
    shutter = now.shutter.resolve()
    assert shutter.frames == pytest.approx(0.5)
    assert shutter.position == "center"
    assert shutter.openings == ()
    assert shutter.blade_time == 0.0
    # All of the film at once, whatever the samples file says.
    assert slit_of(settings)[1] == 1.0


def test_shutter_is_blenders_own(scene: Any, settings: Any) -> None:
    scene.render.motion_blur_shutter = 1.5
    scene.render.fps, scene.render.fps_base = 30, 1.25
    for position in ("START", "CENTER", "END"):
        scene.render.motion_blur_position = position
        assert resolved(settings).position == position.lower()
    assert resolved(settings).frames == pytest.approx(1.5)


def test_curve_is_blenders_own(scene: Any, settings: Any) -> None:
    points = scene.render.motion_blur_shutter_curve.curves[0].points
    points[0].location, points[-1].location = (0.0, 0.0), (1.0, 1.0)
    for point in points:
        point.handle_type = "VECTOR"
    scene.render.motion_blur_shutter_curve.update()
    shutter = resolved(settings)
    # A ramp to the middle point and open from there: a third of the light comes in the first half.
    assert shutter.light(0.0, 0.5) == pytest.approx(1.0 / 3.0, abs=0.01)
    assert float(shutter.times(0.5)) == pytest.approx(0.625, abs=0.01)


def test_curve_takes_blenders_preset_shapes(settings: Any) -> None:
    for shape, first_half in (("MAX", 0.5), ("LINE", 0.5), ("ROUND", 0.5)):
        assert bpy.ops.render.shutter_curve_preset(shape=shape) == {"FINISHED"}
        assert resolved(settings).light(0.0, 0.5) == pytest.approx(first_half, abs=0.01)
        assert (resolved(settings).curve == ()) == (shape == "MAX")


def test_switch_and_paths(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.use_motion = False
    assert not settings().use_motion
    for model in ("auto", "object", "vector"):
        own.motion_model = model
        assert settings().motion_model == model


def test_visibility(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    assert settings().visibility == "aperture"
    own.visibility = "none"
    assert settings().visibility == "none"
    for frame, visibility in ((1, "aperture"), (2, "none")):
        own.visibility = visibility
        own.keyframe_insert("visibility", frame=frame)
    for frame, visibility in ((1, "aperture"), (2, "none")):
        scene.frame_set(frame)
        assert settings().visibility == visibility


def test_exposures(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.exposure_duration, own.exposure_spacing = 0.25, 0.5
    assert resolved(settings).openings == ()
    own.exposure_count = 3
    assert resolved(settings).openings == ((0.0, 0.25), (0.5, 0.75), (1.0, 1.25))
    assert resolved(settings).length == pytest.approx(0.5 * 1.25)
    # A spacing below the duration is one exposure right after the other.
    own.exposure_spacing = 0.125
    assert resolved(settings).openings == ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75))


@pytest.mark.parametrize("duration", [0.1, 0.2, 0.3, 0.7])
def test_exposures_that_touch_do_not_overlap(scene: Any, settings: Any, duration: float) -> None:
    own = scene.potmesil_camera
    own.exposure_count, own.exposure_duration, own.exposure_spacing = 100, duration, 0.001
    assert len(resolved(settings).openings) == 100


def test_focal_plane_shutter(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.shutter_kind = "focal_plane"
    for edge in ("top", "bottom", "left", "right"):
        own.slit_edge, own.slit_width = edge, 0.25
        assert slit_of(settings) == (edge, 0.25)
    assert resolved(settings).blade_time == 0.0


def test_between_the_lens_shutter(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.blade_time = 0.375
    assert resolved(settings).blade_time == 0.0
    own.shutter_kind = "between_lens"
    assert resolved(settings).blade_time == 0.375
    assert slit_of(settings)[1] == 1.0


def test_rolling_shutter_is_cycles_own(scene: Any, settings: Any) -> None:
    scene.cycles.rolling_shutter_type = "TOP"
    scene.cycles.rolling_shutter_duration = 0.25
    assert slit_of(settings) == ("top", 0.25)
    own = scene.potmesil_camera
    own.shutter_kind, own.slit_edge, own.slit_width = "focal_plane", "left", 0.5
    assert slit_of(settings) == ("left", 0.5)
    own.shutter_kind = "between_lens"
    assert slit_of(settings)[1] == 1.0


def test_the_shutter_angle_is_blenders_shutter(scene: Any) -> None:
    own, render = scene.potmesil_camera, scene.render
    render.motion_blur_shutter = 0.48
    assert math.degrees(own.shutter_angle) == pytest.approx(172.8)
    own.shutter_angle = math.radians(90.0)
    assert render.motion_blur_shutter == pytest.approx(0.25)


def test_a_rotary_disc_exposes_longer_in_all_and_each_row_as_long(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.shutter_kind, own.gate_angle, own.slit_edge = "rotary", math.radians(36.0), "left"
    shutter = resolved(settings)
    assert shutter.frames == pytest.approx(0.6)
    assert slit_of(settings) == ("left", pytest.approx(0.5 / 0.6))


def test_flashes(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    assert resolved(settings).flash.share == 0.0
    own.use_flash, own.flash_curtain, own.flash_share = True, "first", 0.25
    own.flash_duration, own.flash_count = 0.5, 4
    flash = resolved(settings).flash
    # Longer than a quarter and they would overlap.
    assert (flash.curtain, flash.share, flash.duration, flash.count) == ("first", 0.25, 0.25, 4)
    for kind, fires in (("focal_plane", False), ("rotary", False), ("between_lens", True), ("whole", True)):
        own.shutter_kind = kind
        assert (resolved(settings).flash.share > 0.0) == fires
    scene.cycles.rolling_shutter_type = "TOP"
    assert resolved(settings).flash.share == 0.0


def test_what_is_off_in_the_panel_does_not_come_back_from_the_file(settings: Any, module: Any) -> None:
    shutter = module("potmesil_addon.shutter")
    file = shutter.ShutterAttributes(
        frames=2.0,
        position="end",
        openings=((0.0, 0.5),),
        blade_time=0.5,
        slit=shutter.Slit("left", 0.1),
        flash=shutter.Flash(),
    )
    used = settings().shutter.over(file).resolve()
    assert used.frames == pytest.approx(0.5)
    assert used.openings == ()
    assert used.blade_time == 0.0
    assert used.slit is None or used.slit.width == 1.0
    assert used.flash.share == 0.0


KEYED = [
    ("use_motion", False, True),
    ("motion_model", "object", "vector"),
    ("shutter_kind", "whole", "between_lens"),
    ("slit_edge", "left", "right"),
    ("slit_width", 0.25, 0.75),
    ("blade_time", 0.125, 0.375),
    ("exposure_count", 1, 5),
    ("exposure_duration", 0.25, 0.5),
    ("exposure_spacing", 0.5, 1.5),
    ("gate_angle", 0.25, 1.5),
    ("flash_share", 0.25, 0.75),
    ("flash_count", 1, 5),
    ("uniform_defocus", 0.0, 2.0),
    ("fade", 0.0, 1.0),
]


@pytest.mark.parametrize(("name", "first", "last"), KEYED)
def test_every_setting_can_be_animated(scene: Any, name: str, first: Any, last: Any) -> None:
    own = scene.potmesil_camera
    for frame, value in ((1, first), (3, last)):
        setattr(own, name, value)
        assert own.keyframe_insert(name, frame=frame)
    for frame, value in ((1, first), (3, last)):
        scene.frame_set(frame)
        assert getattr(own, name) == value


def test_process_takes_the_frames_shutter(scene: Any, settings: Any) -> None:
    own = scene.potmesil_camera
    own.shutter_kind = "between_lens"
    for frame, value in ((1, 0.0), (3, 0.5)):
        own.blade_time = value
        own.keyframe_insert("blade_time", frame=frame)
        scene.render.motion_blur_shutter = 1.0 + value
        scene.render.keyframe_insert("motion_blur_shutter", frame=frame)
    scene.frame_set(3)
    assert resolved(settings).blade_time == 0.5
    assert resolved(settings).frames == pytest.approx(1.5)
    scene.frame_set(1)
    assert resolved(settings).blade_time == 0.0
    assert resolved(settings).frames == pytest.approx(1.0)


def test_panels_are_there(extension: Any) -> None:
    assert bpy.types.POTMESIL_PT_shutter_curve.bl_parent_id == "POTMESIL_PT_shutter"
    assert "DEFAULT_CLOSED" in bpy.types.POTMESIL_PT_shutter_curve.bl_options


@pytest.fixture
def moving_blend(scene: Any, tmp_path: Path) -> Path:
    """A saved .blend file with a card that crosses the picture."""
    item = card(scene, "Card", (0.0, 5.0, 0.0), 1.0, emitter("Glow", (1.0, 0.5, 0.25)))
    for frame, x in ((1, -1.0), (5, 1.0)):
        item.location.x = x
        item.keyframe_insert("location", frame=frame)
    scene.camera.data.dof.aperture_fstop = 64.0
    scene.frame_set(3)
    path = tmp_path / "moving.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def header_of(path: Path) -> dict[str, Any]:
    header: dict[str, Any] = OpenEXR.File(str(path), header_only=True).parts[0].header
    return header


def test_command_takes_the_panels_shutter_and_options_win(
    moving_blend: Path, module: Any, tmp_path: Path
) -> None:
    main = module("operators.command").main
    own = bpy.context.scene.potmesil_camera
    own.shutter_kind, own.slit_edge, own.slit_width = "focal_plane", "left", 0.25
    out = tmp_path / "panel.exr"
    assert main(["render", "--frames", "3", "--output", str(out)]) == 0
    shutter = json.loads(header_of(out)["potmesil:shutter"])
    assert shutter["frames"] == pytest.approx(0.5)
    assert shutter["slit"] == {"edge": "left", "width": 0.25}
    out = tmp_path / "options.exr"
    options = ["--shutter", "2", "--slit", "none", "--exposures", "2x0.25@0.5", "--shutter-position", "start"]
    assert main(["render", "--frames", "3", "--output", str(out), *options]) == 0
    header = header_of(out)
    shutter = json.loads(header["potmesil:shutter"])
    assert shutter["frames"] == 2.0
    assert shutter["position"] == "start"
    assert shutter["openings"] == [[0.0, 0.25], [0.5, 0.75]]
    assert shutter.get("slit", {"width": 1.0})["width"] == 1.0
    assert header["expTime"] == pytest.approx(2.0 / 24.0)


def test_command_leaves_out_motion_where_the_panel_does(
    moving_blend: Path, module: Any, tmp_path: Path
) -> None:
    main = module("operators.command").main
    bpy.context.scene.potmesil_camera.use_motion = False
    assert main(["render", "--frames", "3", "--output", str(tmp_path / "panel.exr")]) == 0
    assert "potmesil:shutter" not in header_of(tmp_path / "panel.exr")
    bpy.context.scene.potmesil_camera.use_motion = True
    assert main(["render", "--frames", "3", "--output", str(tmp_path / "option.exr"), "--no-motion"]) == 0
    assert "potmesil:shutter" not in header_of(tmp_path / "option.exr")


def test_command_follows_an_animated_switch(moving_blend: Path, module: Any, tmp_path: Path) -> None:
    own = bpy.context.scene.potmesil_camera
    for frame, value in ((2, False), (3, True)):
        own.use_motion = value
        own.keyframe_insert("use_motion", frame=frame)
    main = module("operators.command").main
    assert main(["render", "--frames", "2-3", "--output", str(tmp_path / "#.exr")]) == 0
    assert "potmesil:shutter" not in header_of(tmp_path / "2.exr")
    assert "potmesil:shutter" in header_of(tmp_path / "3.exr")


def test_command_writes_masks_by_frame(moving_blend: Path, module: Any, tmp_path: Path) -> None:
    main = module("operators.command").main
    out, mask = str(tmp_path / "out_#.png"), str(tmp_path / "mask_#.exr")
    assert main(["render", "--frames", "2-3", "--output", out, "--mask", mask]) == 0
    names = sorted(path.name for path in tmp_path.glob("mask_*"))
    assert names == ["mask_2.exr", "mask_3.exr"]


@pytest.mark.parametrize(
    ("options", "status"),
    [
        (["--shutter", "-1"], 2),
        (["--slit", "middle:1"], 2),
        (["--exposures", "0.4:0.2"], 2),
        (["--shutter-curve", "missing.json"], 3),
        (["--mask", "mask.jpg"], 2),
        (["--mask", "x.exr"], 2),
    ],
)
def test_command_refuses_before_it_renders(
    moving_blend: Path, module: Any, capsys: Any, tmp_path: Path, options: list[str], status: int
) -> None:
    main = module("operators.command").main
    assert main(["render", "--output", "x.exr", *options]) == status
    assert "Time:" not in capsys.readouterr().out
    assert not list(tmp_path.glob("samples_*"))
