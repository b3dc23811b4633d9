"""Inspect Focus under the bpy module, which has no window: what it works out, and that nothing is left."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

ROWS, COLUMNS = 64, 96


@pytest.fixture
def inspection(module: Callable[[str], ModuleType]) -> Any:
    return module("operators.inspection")


class Window:
    """Stands for a window, which the bpy module does not have."""

    def as_pointer(self) -> int:
        return 1


class Context:
    """The context of a script, in a window."""

    window = Window()

    def __getattr__(self, name: str) -> Any:
        return getattr(bpy.context, name)


@pytest.fixture
def session(inspection: Any, scene: Any) -> Iterator[Any]:
    """What Inspect Focus knows, without its window, timer and drawing."""
    state = bpy.context.window_manager.potmesil_camera
    before = {name: getattr(state, name) for name in ("inspect_psf", "inspect_compare", "inspect_overlay")}
    yield inspection.Session(Context())
    for name, value in before.items():
        setattr(state, name, value)


def wall(distance: float = 4.0) -> Any:
    """A wall that fills the picture."""
    bpy.ops.mesh.primitive_plane_add(
        size=40.0, location=(0.0, distance, 0.0), rotation=(math.pi / 2, 0.0, 0.0)
    )
    return bpy.context.object


def point_at(session: Any, inspection: Any, u: float, v: float) -> None:
    session.cursor = inspection.Place(1, u, v, 0.0, 0.0)


def test_the_button_needs_a_window(scene: Any) -> None:
    assert not bpy.ops.potmesil.inspect.poll()
    assert not bpy.ops.potmesil.inspect_hand.poll()


def test_without_samples_it_says_what_to_do(session: Any, module: Any) -> None:
    with pytest.raises(module("potmesil_addon.errors").InputError, match="press Render"):
        session.update(bpy.context)


def test_a_file_that_cannot_be_read_is_an_error(
    session: Any, scene: Any, module: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which is said for as long as the file is there, and found out once."""
    path = module("operators.export").samples_path(scene)
    path.write_bytes(b"nothing")
    errors, core = module("potmesil_addon.errors"), module("potmesil_addon.inspection")
    times: list[Path] = []
    read = core.read_view
    monkeypatch.setattr(core, "read_view", lambda path: times.append(path) or read(path))
    for _ in range(3):
        with pytest.raises(errors.InputError, match="not a readable OpenEXR file"):
            session.update(bpy.context)
    assert len(times) == 1


def test_it_reads_the_distance_and_the_circle_under_the_mouse(
    session: Any, inspection: Any, scene: Any
) -> None:
    """A wall at 4 m; the lens of 50 mm is focused at 5 m, at f/0.5."""
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    assert session.reading() is None
    assert session.update(bpy.context)
    point_at(session, inspection, 0.3, 0.6)
    found = session.reading()
    circle = -(0.05**2) / 0.5 * (1.0 / 4.0 - 1.0 / 5.0)
    assert found.depth == pytest.approx(4.0, rel=1e-4)
    assert found.circle == pytest.approx(circle, rel=1e-3)
    assert found.circle_px == pytest.approx(circle / (0.036 / COLUMNS), rel=1e-3)
    assert found.zone == "near"
    point_at(session, inspection, 1.2, 0.5)
    assert session.reading() is None


def test_what_is_seen_again_is_not_read_again(
    session: Any, inspection: Any, scene: Any, module: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    core = module("potmesil_addon.inspection")
    times: list[Path] = []
    read = core.read_view
    monkeypatch.setattr(core, "read_view", lambda path: times.append(path) or read(path))
    assert session.update(bpy.context)
    assert not session.update(bpy.context)
    assert len(times) == 1
    # Another focus needs the same samples.
    scene.camera.data.dof.focus_distance = 4.0
    bpy.context.view_layer.update()
    assert session.update(bpy.context)
    point_at(session, inspection, 0.5, 0.5)
    assert session.reading().zone == "sharp"
    assert len(times) == 1
    path = module("operators.export").samples_path(scene)
    os.utime(path, (path.stat().st_atime, path.stat().st_mtime + 10.0))
    assert session.update(bpy.context)
    assert len(times) == 2
    path.unlink()
    with pytest.raises(module("potmesil_addon.errors").InputError, match="press Render"):
        session.update(bpy.context)
    assert session.view is None


def test_colours_follow_the_limits(session: Any, scene: Any, module: Any) -> None:
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    colors = module("potmesil_addon.inspection").COLORS
    for distance, zone in ((5.0, 0), (4.0, 1), (3.0, 2)):
        scene.camera.data.dof.focus_distance = distance
        bpy.context.view_layer.update()
        assert session.update(bpy.context)
        assert session.overlay.shape == (ROWS, COLUMNS, 4)
        np.testing.assert_allclose(session.overlay[10, 20, :3], colors[zone], atol=1e-6)
    before = session.overlay
    assert not session.update(bpy.context)
    assert session.overlay is before


def test_a_very_large_picture_is_coloured_coarsely_while_it_changes(
    session: Any, inspection: Any, scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    monkeypatch.setattr(inspection, "_AT_ONCE", ROWS * COLUMNS // 4)
    session.update(bpy.context)
    assert session.overlay.shape == (ROWS // 2, COLUMNS // 2, 4)
    session._changed -= 1.0
    assert session.update(bpy.context)
    assert session.overlay.shape == (ROWS, COLUMNS, 4)


def test_the_point_is_drawn_as_wide_as_its_circle(session: Any, inspection: Any, scene: Any) -> None:
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    session.update(bpy.context)
    assert session.point is None
    point_at(session, inspection, 0.5, 0.5)
    assert session.update(bpy.context)
    assert abs(session.point_width - abs(session.reading().circle_px)) < 3.0
    assert session.point.shape[0] == session.point_width
    before = session.point
    point_at(session, inspection, 0.5, 0.5)
    assert not session.update(bpy.context)
    assert session.point is before


def test_diffraction_of_blades_is_an_error_that_says_what_to_do(
    session: Any, inspection: Any, scene: Any, module: Any
) -> None:
    wall()
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    scene.potmesil_camera.psf, scene.camera.data.dof.aperture_blades = "lommel", 5
    bpy.context.view_layer.update()
    point_at(session, inspection, 0.5, 0.5)
    with pytest.raises(module("potmesil_addon.errors").SettingsError, match="blades"):
        session.update(bpy.context)


def test_the_read_out(inspection: Any, scene: Any, module: Any) -> None:
    core, draw = module("potmesil_addon.inspection"), module("operators.inspection_draw")
    found = core.Reading(2.5, -1.25e-4, -6.0, "near")
    assert draw.lines_of(scene, found) == ["Near", "2.5 m", "6 px", "0.125 mm"]
    assert draw.lines_of(scene, core.Reading(math.inf, 0.0, 0.0, "far"))[1] == "Infinity"


def display_of(picture: Any) -> Any:
    """The sRGB curve on straight colours."""
    x = np.clip(picture[..., :3] / picture[..., 3:], 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055)


def test_the_render_before_is_displayed_as_blender_does(inspection: Any, scene: Any) -> None:
    """Without view and look it is the sRGB curve; as a render it is the scene's, and settings come back."""
    picture = np.random.default_rng(1).random((6, 9, 4), dtype=np.float32)
    picture[..., 3] = 1.0
    picture[0, 0] = [0.1, 0.2, 0.3, 0.5]
    output = scene.render.image_settings
    if hasattr(output, "media_type"):
        output.media_type = "MULTI_LAYER_IMAGE"
    output.file_format, output.color_depth = "OPEN_EXR_MULTILAYER", "16"
    images = len(bpy.data.images)
    found = inspection.display_values(scene, picture, as_render=False)
    np.testing.assert_allclose(found[..., :3], display_of(picture), atol=0.006)
    np.testing.assert_allclose(found[..., 3], picture[..., 3], atol=0.003)
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.exposure = -1.0
    darker = inspection.display_values(scene, picture, as_render=True)
    half = picture * [0.5, 0.5, 0.5, 1.0]
    np.testing.assert_allclose(darker[..., :3], display_of(half), atol=0.006)
    scene.view_settings.view_transform = "AgX"
    assert not np.allclose(inspection.display_values(scene, picture, as_render=True), darker, atol=0.02)
    assert (output.file_format, output.color_depth) == ("OPEN_EXR_MULTILAYER", "16")
    assert (output.color_management, scene.render.dither_intensity) == ("FOLLOW_SCENE", 1.0)
    assert len(bpy.data.images) == images


def test_what_decides_the_display(inspection: Any, scene: Any) -> None:
    view = scene.view_settings
    seen = {inspection.look_of(scene, as_render=True)}
    view.exposure = 1.0
    seen.add(inspection.look_of(scene, as_render=True))
    view.use_curve_mapping = True
    seen.add(inspection.look_of(scene, as_render=True))
    view.curve_mapping.curves[0].points[0].location.y = 0.3
    seen.add(inspection.look_of(scene, as_render=True))
    assert len(seen) == 4
    assert len(inspection.look_of(scene, as_render=False)) == 1


def test_before_is_the_render_without_the_lens(session: Any, scene: Any) -> None:
    """Behind a lens that is stopped down, the result is the render, seen as the scene's view has it."""
    scene.view_settings.view_transform = "Standard"
    wall()
    scene.world = bpy.data.worlds.new("World")
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    bpy.context.window_manager.potmesil_camera.inspect_compare = True
    assert session.update(bpy.context)
    shown = session.before
    assert shown.shape == (ROWS, COLUMNS, 4)
    result = np.empty(ROWS * COLUMNS * 4, np.float32)
    scene.camera.data.dof.aperture_fstop = 128.0
    bpy.context.view_layer.update()
    assert bpy.ops.potmesil.process() == {"FINISHED"}
    bpy.data.images["Potmesil Result"].pixels.foreach_get(result)
    np.testing.assert_allclose(shown[..., :3], display_of(result.reshape(ROWS, COLUMNS, 4)[::-1]), atol=0.01)
    session.update(bpy.context)
    assert session.before is shown


def test_nothing_is_left_after_the_end(inspection: Any, module: Any, scene: Any) -> None:
    state = bpy.context.window_manager.potmesil_camera
    assert inspection.session() is None
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.potmesil.inspect()
    inspection._begin(Context())
    assert state.inspect
    assert bpy.app.timers.is_registered(inspection._tick)
    painter = inspection._painter
    assert painter._handle is not None
    inspection._file_closes()
    assert painter._handle is None
    assert not painter._textures
    assert not state.inspect
    assert inspection.session() is None
    assert not bpy.app.timers.is_registered(inspection._tick)
    assert inspection._file_closes not in bpy.app.handlers.load_pre
    inspection.shut_down()


def test_switching_the_extension_off_ends_it(inspection: Any, module: Any, scene: Any) -> None:
    inspection._begin(Context())
    painter = inspection._painter
    operators = module("operators")
    operators.unregister()
    assert painter._handle is None
    assert not hasattr(bpy.types, "POTMESIL_OT_inspect")
    operators.register()
    assert hasattr(bpy.types, "POTMESIL_OT_inspect")


def test_the_frame_is_where_the_image_is(module: Any) -> None:
    frame = module("operators.inspection_draw").Frame(10.0, 20.0, 200.0, 100.0)
    assert frame.x(0.25) == 60.0
    assert frame.place(60.0, 70.0) == (0.25, 0.5)
