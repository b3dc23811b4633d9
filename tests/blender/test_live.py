"""Live Focus under the bpy module, which has no window: its worker, its settings, its end."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

ROWS, COLUMNS = 64, 96


@pytest.fixture
def live(module: Callable[[str], ModuleType]) -> Any:
    return module("operators.live")


@pytest.fixture
def session(live: Any, scene: Any) -> Any:
    """What Live Focus knows, without its window, timer and keys."""
    del scene
    found = live._Session(bpy.context)
    yield found
    found.close()


def step(session: Any, done: Callable[[], bool], seconds: float = 300.0) -> None:
    state = bpy.context.window_manager.potmesil_camera
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:
        session._receive(state)
        session._look(bpy.context)
        session._ask()
        time.sleep(0.02)
    assert done(), (state.live_message, session._preview.waiting, session._whole.waiting)


def pixels() -> np.ndarray[Any, Any]:
    image = bpy.data.images["Potmesil Result"]
    values = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(values)
    return values


def test_the_button_needs_a_window(scene: Any) -> None:
    assert not bpy.ops.potmesil.live.poll()
    assert not bpy.ops.potmesil.end_live.poll()


def test_without_samples_it_says_what_to_do(session: Any, module: Any) -> None:
    errors = module("potmesil_addon.errors")
    with pytest.raises(errors.InputError, match="press Render"):
        session._look(bpy.context)


def test_kernels_are_compiled_once(live: Any, session: Any, scene: Any, module: Any) -> None:
    """By Process for Live Focus, and by one Live Focus for the next, where none was on disk."""
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    cache = module("potmesil_addon.jit").numba.config.CACHE_DIR
    assert cache.endswith("potmesil_addon")
    step(session, lambda: session._finished != "" and session._finished == session._key)
    assert session.compiled["full"] == []
    session.close()
    again = live._Session(bpy.context)
    step(again, lambda: again._finished != "" and again._finished == again._key)
    again.close()
    assert again.compiled == {"preview": [], "full": []}


def test_it_follows_and_ends_as_process_does(session: Any, scene: Any) -> None:
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    dof = scene.camera.data.dof
    step(session, lambda: session._finished != "" and session._finished == session._key)
    first = session.updates
    dof.focus_distance = 2.0
    bpy.context.view_layer.update()
    step(session, lambda: session.updates > first)
    step(session, lambda: session._finished == session._key)
    followed = pixels()
    assert bpy.context.window_manager.potmesil_camera.has_quality
    assert bpy.ops.potmesil.process() == {"FINISHED"}
    np.testing.assert_array_equal(followed, pixels())


def test_the_panel_says_that_kernels_are_compiled(session: Any, scene: Any) -> None:
    state = bpy.context.window_manager.potmesil_camera
    session._preview.replies = lambda: [{"compiling": "gather"}]
    session._receive(state)
    assert state.live_message == "Compiling Kernels (Once)"
    assert session.compiled["preview"] == ["gather"]


def test_each_scene_gets_its_own_back(session: Any, scene: Any) -> None:
    other = bpy.data.scenes.new("Other")
    other.render.motion_blur_shutter, other.frame_current = 0.25, 7
    session._remember(other)
    scene.render.motion_blur_shutter = other.render.motion_blur_shutter = 2.0
    assert session.restore()
    assert (scene.render.motion_blur_shutter, other.render.motion_blur_shutter) == (0.5, 0.25)


def test_abandoned_folders_are_removed(live: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    old, young, other = (tmp_path / name for name in ("potmesil_live_a", "potmesil_live_b", "else"))
    for folder in (old, young, other):
        folder.mkdir()
        (folder / "requests.jsonl").touch()
    for folder in (old, other):
        os.utime(folder / "requests.jsonl", (1.0, 1.0))
    live._remove_abandoned()
    assert sorted(tmp_path.iterdir()) == sorted([young, other])


def test_settings_and_result_come_back(session: Any, scene: Any, module: Any) -> None:
    result = module("operators.result")
    before = np.random.default_rng(1).random((8, 12, 4), dtype=np.float32)
    result.store_result(before)
    session._keep_result()
    data, own = scene.camera.data, scene.potmesil_camera
    was = (data.lens, data.dof.focus_distance, data.dof.aperture_fstop, scene.render.motion_blur_shutter)
    empty = bpy.data.objects.new("Target", None)
    data.lens, data.dof.focus_distance, data.dof.aperture_fstop = 85.0, 1.25, 4.0
    data.dof.focus_object, scene.render.motion_blur_shutter, own.visibility = empty, 1.5, "none"
    result.store_result(before[:4] * 2.0)
    assert session.restore()
    assert was == (
        data.lens,
        data.dof.focus_distance,
        data.dof.aperture_fstop,
        scene.render.motion_blur_shutter,
    )
    assert data.dof.focus_object is None
    assert own.visibility == "aperture"
    np.testing.assert_array_equal(pixels().reshape(8, 12, 4)[::-1], before)
    assert not session.restore()


@pytest.mark.parametrize(("u", "v", "expected"), [(0.01, 0.99, 1.0), (0.99, 0.99, 3.0), (0.01, 0.01, 4.0)])
def test_focus_is_at_the_sample_under_the_mouse(
    session: Any, scene: Any, u: float, v: float, expected: float
) -> None:
    session._request = {"path": "samples.exr"}
    session._depth = "samples.exr", np.array([[1.0, 2.0, 3.0], [4.0, 5.0, np.inf]], np.float32)
    dof = scene.camera.data.dof
    dof.focus_object = bpy.data.objects.new("Target", None)
    session.focus_at(bpy.context, u, v)
    state = bpy.context.window_manager.potmesil_camera
    assert state.live_message.startswith("Target is no longer the focus object")
    # A picture that comes at once leaves the note there.
    session._say(state, "")
    assert state.live_message
    session._note(state, "")
    assert not state.live_message
    assert dof.focus_distance == expected
    assert dof.focus_object is None


def test_the_focus_object_comes_back(live: Any, scene: Any) -> None:
    target = bpy.data.objects.new("Target", None)
    dof = scene.camera.data.dof
    dof.focus_object = target
    session = live._Session(bpy.context)
    session._request = {"path": "samples.exr"}
    session._depth = "samples.exr", np.array([[1.0]], np.float32)
    session.focus_at(bpy.context, 0.5, 0.5)
    assert dof.focus_object is None
    assert session.restore()
    assert (dof.focus_object, dof.focus_distance) == (target, 5.0)


def test_nothing_is_focused_on_where_nothing_is(session: Any, scene: Any) -> None:
    session._request = {"path": "samples.exr"}
    session._depth = "samples.exr", np.array([[1.0, np.inf]], np.float32)
    for u, v in ((0.9, 0.5), (1.5, 0.5), (0.2, -0.1)):
        session.focus_at(bpy.context, u, v)
    assert scene.camera.data.dof.focus_distance == 5.0
    assert "nothing" in bpy.context.window_manager.potmesil_camera.live_message


def test_a_driven_focus_distance_is_left_alone(session: Any, scene: Any) -> None:
    session._request = {"path": "samples.exr"}
    session._depth = "samples.exr", np.array([[1.0]], np.float32)
    scene.camera.data.driver_add("dof.focus_distance").driver.expression = "5.0"
    session.focus_at(bpy.context, 0.5, 0.5)
    assert scene.camera.data.dof.focus_distance == 5.0
    assert "driver" in bpy.context.window_manager.potmesil_camera.live_message


def test_a_worker_that_is_gone_is_started_again(session: Any, scene: Any) -> None:
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    step(session, lambda: session.updates > 0)
    session._preview._process.kill()
    session._preview._process.wait()
    scene.camera.data.dof.focus_distance = 3.0
    bpy.context.view_layer.update()
    step(session, lambda: session.updates > 1)


def test_nothing_is_left_after_the_end(live: Any, scene: Any) -> None:
    session = live._Session(bpy.context)
    assert bpy.ops.potmesil.render() == {"FINISHED"}
    step(session, lambda: session.updates > 0)
    process, folder = session._preview._process, session._preview._folder
    session.close()
    assert process.poll() is not None
    assert not folder.exists()
    assert live.session() is None
    live.shut_down()
    assert live._file_closes not in bpy.app.handlers.load_pre
    assert not bpy.app.timers.is_registered(live._tick)
