"""The artist's scene is as it was after every operator, cancelled, failed or done; and undo and redo agree.

A scene with one of everything (`artist`) is dumped whole (`dump`) before and after. What an operator exists
to change is declared here; all else must be the same. Settings, cancels and errors are drawn at random, the
same ones in every run; ``POTMESIL_THOROUGH=1`` draws many more. A stand-in will do for the processors, which
know nothing of Blender.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from .artist import artists_scene
from .conftest import PACKAGE
from .dump import WORKED_OUT, Dump, differences, dump

pytest.importorskip("OpenEXR")

THOROUGH = os.environ.get("POTMESIL_THOROUGH", "") not in ("", "0")

random = settings(
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
    print_blob=False,
    # Each example may render; what failed first is plain enough.
    phases=(Phase.generate,),
)


def examples(few: int, many: int) -> Any:
    """Return how many examples to draw."""
    return settings(random, max_examples=many if THOROUGH else few)


# What each operator exists to change.

_PASSES = (
    r"\.use_pass_(combined|z|vector|object_index)$",
    r"^objects.*\.pass_index$",
    # Sockets of Render Layers nodes follow the passes.
    r"(^node_groups.*|\.node_tree)\.nodes\[\d+\]\.outputs",
)
_NEW_CAMERA = (
    r"^(objects|cameras)\['Camera\.001'\]",
    r"\.users$",
    r"\.objects$",
    r"\.all_objects$",
    r"^scenes\['Scene'\]\.(camera|objects|collection)",
    r"\.view_layer",
)
_STAGE = (
    r"^(scenes|objects|cameras|collections|node_groups|worlds)\['Potmesil Stage",
    r"^node_groups\['Comp'\]",
    r"^scenes\['Scene'\]\.node_tree",
    r"\.use_(compositing|lock_interface|nodes)$",
    r"\.users$",
    r"^window_managers.*potmesil_camera",
)
# Blender renders it at the frame of the scene that it belongs to.
_STAGE_FRAME = (r"^scenes\['Potmesil Stage'\]\.frame_",)
_FOCUS = (r"\.dof\.focus_(distance|object|subtarget)$", r"^(actions|objects).*\.users$")

FIXES: dict[str, tuple[str, ...]] = {
    "add_camera": _NEW_CAMERA,
    "activate_camera": (r"^scenes.*\.camera$", r"\.users$"),
    "perspective_camera": (r"^cameras.*\.type$",),
    "use_cycles": (r"\.render\.engine$",),
    "use_view_layer": (r"view_layers?(\[\d\])?\.use$",),
    "setup_passes": _PASSES,
    "focus_middle": (r"\.dof\.focus_distance$",),
    "open_aperture": (r"\.dof\.aperture_fstop$",),
    "motion_blur_off": (r"\.render\.use_motion_blur$",),
    "camera_blur_off": (r"\.dof\.use_dof$",),
    "denoising_off": (r"\.cycles\.use_denoising$",),
    "clamping_off": (r"\.cycles\.sample_clamp_",),
    "reflections_on": (r"\.potmesil_camera\.reflections",),
    "reflections_off": (r"\.potmesil_camera\.reflections",),
    "motion_on": (r"\.potmesil_camera\.use_motion",),
    "stereo_off": (r"\.render\.use_multiview$",),
    "region_off": (r"\.render\.use_border$",),
    "compositing_on": (r"\.use_(compositing|nodes)$",),
    "lock_interface": (r"\.render\.use_lock_interface$",),
    "samples_beside": (r"\.potmesil_camera\.samples_path",),
    "number_samples": (r"\.potmesil_camera\.samples_path",),
    "save_as": (),
}


@dataclass(frozen=True, slots=True)
class Case:
    """How an operator is run here.

    Parameters
    ----------
    may : tuple of str
        Paths in the dump that it exists to change.
    arguments : tuple of dict
        What it is called with, one set after the other.
    stage : bool
        Whether it needs a stage.
    """

    may: tuple[str, ...] = ()
    arguments: tuple[dict[str, Any], ...] = ({},)
    stage: bool = False


HERE: dict[str, Case] = {
    "render": Case(_STAGE_FRAME),
    "process": Case(_STAGE_FRAME),
    "composite": Case(_STAGE_FRAME, arguments=({}, {"animation": True}), stage=True),
    "render_animation": Case(_STAGE_FRAME),
    "process_animation": Case(_STAGE_FRAME),
    "setup_passes": Case(_PASSES, ({}, {"assign_indices": False})),
    "fix": Case(arguments=tuple({"fix": name} for name in FIXES)),
    "fix_all": Case(tuple(each for paths in FIXES.values() for each in paths)),
    "add_stage": Case(_STAGE),
    "remove_stage": Case(_STAGE, stage=True),
    "focus_on_active": Case(_FOCUS, ({}, {"target": "SURFACE"})),
    "track_object": Case(_FOCUS),
    "stop_tracking": Case(_FOCUS),
    **{
        f"add_{kind}_preset": Case(arguments=({"name": "Mine"}, {"name": "Mine", "remove_name": True}))
        for kind in ("camera", "shutter", "lens", "effects")
    },
}
"""Operators that run here; what they need of the scene, and what they change of it."""

IN_WINDOW = {"live", "end_live", "inspect", "inspect_hand", "watch_render"}
"""Operators that need a window: the tests in tests/gui run them."""

STEPPED = ("render", "process", "composite", "render_animation", "process_animation")


def registered() -> dict[str, Any]:
    """Return our registered operators by their names."""
    found = {}
    for cls in bpy.types.Operator.__subclasses__():
        if cls.__module__.startswith(PACKAGE) and cls.is_registered:
            found[cls.bl_idname.removeprefix("potmesil.")] = cls
    return found


def test_no_operator_is_forgotten(extension: Any, module: Any) -> None:
    assert set(registered()) == HERE.keys() | IN_WINDOW
    stepped = module("operators.work").SteppedOperator
    assert {name for name, cls in registered().items() if issubclass(cls, stepped)} == set(STEPPED)
    assert FIXES.keys() == module("operators.fix").WAYS.keys()


# Settings at random.

_RENDER = [
    "use_motion_blur",
    "motion_blur_shutter",
    "motion_blur_position",
    "use_border",
    "use_crop_to_border",
    "border_min_x",
    "border_max_x",
    "border_min_y",
    "border_max_y",
    "film_transparent",
    "use_compositing",
    "use_sequencer",
    "use_lock_interface",
    "use_persistent_data",
    "use_placeholder",
    "use_overwrite",
    "use_multiview",
    "resolution_percentage",
    "pixel_aspect_x",
    "dither_intensity",
    "use_stamp",
]
_CAMERA = ["type", "shift_x", "shift_y", "sensor_fit", "sensor_width", "lens", "clip_start"]
_DOF = ["use_dof", "focus_distance", "aperture_fstop", "aperture_blades", "aperture_ratio"]
_CYCLES = [
    "pixel_filter_type",
    "filter_width",
    "rolling_shutter_type",
    "use_adaptive_sampling",
    "blur_glossy",
]
_LAYER = [
    "use_pass_z",
    "use_pass_vector",
    "use_pass_object_index",
    "use_pass_mist",
    "use_pass_cryptomatte_object",
    "use_pass_combined",
    "samples",
    "use_sky",
]
_IMAGE = ["file_format", "color_mode", "color_depth", "color_management"]

_LIMITS: dict[str, tuple[float, float]] = {
    "exposure_count": (1, 3),
    "flash_count": (1, 3),
    "peel_count": (1, 2),
    "resolution_percentage": (50, 150),
    "pixel_aspect_x": (1.0, 2.0),
    "motion_blur_shutter": (0.0, 1.5),
    "sensor_width": (20.0, 50.0),
    "lens": (20.0, 60.0),
    "clip_start": (0.01, 1.0),
    "samples": (0, 1),
    "lines": (1, 4),
    "blur_glossy": (0.0, 1.0),
    "filter_width": (0.5, 3.0),
}
"""Of what would take long, or show nothing."""


def _ours(group: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Find all settings of ours that have values."""
    for prop in group.bl_rna.properties:
        if prop.type == "POINTER" and prop.identifier not in ("rna_type", "stage_of", "clip"):
            yield from _ours(getattr(group, prop.identifier), f"{path}.{prop.identifier}")
        elif prop.type in ("BOOLEAN", "INT", "FLOAT", "ENUM") and not prop.is_readonly:
            yield f"{path}.{prop.identifier}", prop


def known_settings(scene: Any) -> dict[str, Any]:
    """Return what is changed at random: paths from the scene, and Blender's descriptions."""
    found = dict(_ours(scene.potmesil_camera, "potmesil_camera"))
    for path, names in (
        ("render", _RENDER),
        ("render.image_settings", _IMAGE),
        ("cycles", _CYCLES),
        ("camera.data", _CAMERA),
        ("camera.data.dof", _DOF),
        ("view_layers[0]", _LAYER),
        ("view_layers[1]", ["use", *_LAYER]),
    ):
        owner = scene.path_resolve(path)
        found.update({f"{path}.{name}": owner.bl_rna.properties[name] for name in names})
    # It has a driver, which any evaluation obeys.
    del found["potmesil_camera.slit_width"]
    return found


def change(scene: Any, path: str, prop: Any, share: float) -> None:
    """Give a setting the value that lies at a share of what is possible."""
    place, _, name = path.rpartition(".")
    owner = scene.path_resolve(place)
    value: Any
    if prop.type == "BOOLEAN":
        value = share >= 0.5
    elif prop.type == "ENUM":
        names = [item.identifier for item in prop.enum_items_static] or [""]
        value = names[min(int(share * len(names)), len(names) - 1)]
    else:
        low, high = _LIMITS.get(name, (max(prop.soft_min, -10.0), min(prop.soft_max, 10.0)))
        value = low + share * (high - low)
        value = round(value) if prop.type == "INT" else value
        value = [value] * prop.array_length if prop.is_array else value
    # Such as a colour depth that the chosen format does not have.
    with contextlib.suppress(TypeError):
        setattr(owner, name, value)


# Work that ends otherwise than well.


class FaultError(Exception):
    """What nobody expects."""


@dataclass(frozen=True, slots=True)
class Ending:
    """How work ends.

    Parameters
    ----------
    kind : {"done", "closed", "thrown", "inside"}
        To its end; cancelled between two steps; an error at a step; or one in any function of the adapters.
    place : float
        Where, as a share of the steps or calls of `known`.
    error : str
        Which error.
    """

    kind: str
    place: float = 0.0
    error: str = "MemoryError"


ERRORS: dict[str, Callable[[], BaseException]] = {
    "MemoryError": lambda: MemoryError("no memory"),
    "RuntimeError": lambda: RuntimeError("Error: Blender's render failed"),
    "OSError": lambda: OSError(28, "No space left on device"),
    "KeyboardInterrupt": KeyboardInterrupt,
    "OutputError": lambda: sys.modules[f"{PACKAGE}.potmesil_addon.errors"].OutputError("The disk is full."),
}

endings = st.builds(
    Ending,
    st.sampled_from(["done", "closed", "thrown", "inside", "inside"]),
    st.floats(0.0, 1.0, exclude_max=True, width=16),
    st.sampled_from(sorted(ERRORS)),
)

_GIVES_BACK = re.compile(
    r"give_back|__exit__|_remove|end|end_beside|shut_down|_clear_left_over|_take_back|restore|close|unregister"
    r"|update_render_passes"
)
"""What gives things back is let do so; and where the engine tells its passes, sockets would be hidden until
Blender asks again."""


class Inside:
    """Counts the calls of the adapters' functions, and lets one of them fail.

    Parameters
    ----------
    error : callable or None
        Makes the error.
    number : int
        Of the call that fails, from 0.
    """

    def __init__(self, error: Callable[[], BaseException] | None = None, number: int = -1) -> None:
        self._error, self._number = error, number
        self._folder = str(Path(sys.modules[f"{PACKAGE}.operators"].__file__ or "").parent)
        self.count = 0
        self.raised = ""

    def _call(self, frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or self.raised or not frame.f_code.co_filename.startswith(self._folder):
            return
        if self._is_giving_back(frame):
            return
        if self.count == self._number and self._error is not None:
            self.raised = f"{Path(frame.f_code.co_filename).name}:{frame.f_code.co_name}"
            raise self._error()
        self.count += 1

    def _is_giving_back(self, frame: FrameType | None) -> bool:
        while frame is not None and frame.f_code.co_filename.startswith(self._folder):
            caller = frame.f_back
            name = frame.f_code.co_name
            if _GIVES_BACK.fullmatch(name) or (caller and caller.f_code.co_name == "kept_scene"):
                return True
            frame = caller
        return False

    def __enter__(self) -> Inside:
        sys.settrace(self._call)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)


_known: dict[str, int] = {}
"""How many steps and calls an operator had when it was run last."""


def run(name: str, arguments: dict[str, Any], ending: Ending) -> str:
    """Run an operator to some end; return what became of it."""
    if ending.kind == "inside":
        number = int(ending.place * _known.get(f"{name} calls", 100))
        with Inside(ERRORS[ending.error], number) as inside:
            said = _executed(name, arguments)
        return f"{said} ({inside.raised})"
    if ending.kind == "done" or name not in STEPPED:
        with Inside() as inside:
            said = _executed(name, arguments)
        _known[f"{name} calls"] = max(inside.count, _known.get(f"{name} calls", 0))
        return said
    return _stepped(name, arguments, ending)


def _executed(name: str, arguments: dict[str, Any]) -> str:
    try:
        return str(getattr(bpy.ops.potmesil, name)(**arguments))
    # An operator that is not possible now, that says why not, or that failed.
    except (Exception, KeyboardInterrupt) as error:
        return f"{type(error).__name__}: {error}"


def _stepped(name: str, arguments: dict[str, Any], ending: Ending) -> str:
    """Take the steps that a modal operator takes, up to some step."""
    if not getattr(bpy.ops.potmesil, name).poll():
        return "not possible"
    cls = registered()[name]
    operator = SimpleNamespace(**{"escaped": False, "animation": False, **arguments})
    steps = cls.steps(operator, bpy.context, interactive=True)
    last = int(ending.place * _known.get(f"{name} steps", 10))
    try:
        for number, _ in enumerate(steps):
            _known[f"{name} steps"] = max(number + 1, _known.get(f"{name} steps", 0))
            if number == last and ending.kind == "closed":
                steps.close()
            elif number == last:
                steps.throw(ERRORS[ending.error]())
    except (Exception, KeyboardInterrupt) as error:
        return f"{type(error).__name__}: {error}"
    finally:
        bpy.context.window_manager.potmesil_camera.doing = ""
    return "closed" if ending.kind == "closed" else "done"


def _quick(samples: Any, _: Any) -> Iterator[float]:
    """Stand in for the processors: the right size, in three steps."""
    window, finer = samples.display_window, samples.supersampling
    size = window.rows // finer, window.columns // finer
    yield from (0.2, 0.5, 0.9)
    zeros = np.zeros(size, dtype=np.float32)
    quality = {"guessed_pixels": 0.0, "predicted_error": 0.0}
    picture = np.ones((*size, 4), dtype=np.float32)
    return SimpleNamespace(picture=picture, predicted_error=zeros, guessed=zeros, report={"quality": quality})


def _as_job(operator: Any, scene: Any, *, animation: bool = False, locked: bool = False) -> Iterator[float]:
    """Stand in for a render that is a job, of which there are none without a window."""
    yield 0.0
    bpy.ops.render.render(scene=scene.name, animation=animation)
    yield 0.5
    yield 1.0


@pytest.fixture(scope="module")
def folder(extension: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the samples of an earlier render of the scene."""
    path: Path = tmp_path_factory.mktemp("untouched")
    scene = artists_scene(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(importlib.import_module(f"{PACKAGE}.potmesil_addon.process"), "process", _quick)
        for frame in (1, 2, 3):
            scene.frame_set(frame)
            assert bpy.ops.potmesil.render() == {"FINISHED"}
    return path


@pytest.fixture
def untouched(extension: Any, module: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """The extension with stand-ins for what takes long or needs a window."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(module("potmesil_addon.process"), "process", _quick)
    for name in ("render", "all_frames", "composite"):
        monkeypatch.setattr(module(f"operators.{name}"), "render_as_job", _as_job)
    yield module
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def begin(folder: Path, *, stage: bool = False) -> Any:
    """Make the scene, with a stage where one is needed."""
    scene = artists_scene(folder)
    if stage:
        assert bpy.ops.potmesil.add_stage() == {"FINISHED"}
    return scene


_OF_HIDDEN = r"^objects\['(Eye|Viewport|Out)'\]\.(bound_box|dimensions|matrix_local|matrix_world)$"
"""Of what the viewport does not show, Blender keeps what it worked out last."""


def same(before: Dump, besides: Sequence[str] = (), note: object = "") -> None:
    """Fail with what differs between a dump and what there is now."""
    # As the next redraw would.
    bpy.context.view_layer.update()
    lines = differences(before, dump(), (*besides, _OF_HIDDEN))
    assert not lines, "\n".join([str(note), *(line[:300] for line in lines)])


def allowed(name: str, arguments: dict[str, Any]) -> tuple[str, ...]:
    """Return what an operator exists to change."""
    return HERE[name].may + FIXES.get(arguments.get("fix", ""), ())


@pytest.mark.parametrize("name", sorted(HERE))
def test_nothing_else_changes_when_an_operator_is_done(untouched: Any, folder: Path, name: str) -> None:
    case = HERE[name]
    begin(folder, stage=case.stage)
    for arguments in case.arguments:
        before = dump()
        said = run(name, arguments, Ending("done"))
        same(before, allowed(name, arguments), (arguments, said))


@pytest.mark.parametrize("name", STEPPED)
@examples(5, 100)
@given(data=st.data())
def test_nothing_changes_whatever_the_settings_and_the_end(
    untouched: Any, folder: Path, name: str, data: Any
) -> None:
    run_at_random(folder, name, data)


@pytest.mark.parametrize("name", sorted(HERE.keys() - set(STEPPED)))
@examples(2, 60)
@given(data=st.data())
def test_nothing_else_changes_whatever_the_settings_and_the_end(
    untouched: Any, folder: Path, name: str, data: Any
) -> None:
    run_at_random(folder, name, data)


def run_at_random(folder: Path, name: str, data: Any) -> None:
    """Change settings, run an operator to some end, and look what is left changed."""
    case = HERE[name]
    scene = begin(folder, stage=case.stage or data.draw(st.booleans()))
    known = known_settings(scene)
    changed = data.draw(
        st.dictionaries(st.sampled_from(sorted(known)), st.floats(0.0, 1.0, width=16), max_size=12)
    )
    for path, share in changed.items():
        change(scene, path, known[path], share)
    arguments = data.draw(st.sampled_from(case.arguments))
    ending = data.draw(endings)
    bpy.context.view_layer.update()
    before = dump()
    said = run(name, arguments, ending)
    same(before, allowed(name, arguments), (arguments, ending, said))


@pytest.mark.parametrize("stage", [False, True])
def test_nothing_changes_where_every_view_is_rendered(untouched: Any, folder: Path, stage: bool) -> None:
    own = begin(folder, stage=stage).potmesil_camera
    own.reflections, own.depth_peeling, own.sampling = "REFLECTIONS_AND_SHADOWS", "AUTOMATIC", "FINE"
    bpy.context.view_layer.update()
    for name in ("render", "render_animation"):
        before = dump()
        assert run(name, {}, Ending("done")) == "{'FINISHED'}"
        same(before, _STAGE_FRAME, name)


@pytest.mark.parametrize("name", sorted(HERE))
def test_undo_and_redo_go_back_and_forth(untouched: Any, folder: Path, name: str) -> None:
    case = HERE[name]
    begin(folder, stage=case.stage)
    for arguments in case.arguments[:1] if not THOROUGH else case.arguments:
        bpy.ops.ed.undo_push(message="before")
        before = dump()
        run(name, arguments, Ending("done"))
        bpy.ops.ed.undo_push(message="after")
        after = dump()
        bpy.ops.ed.undo()
        same(before, WORKED_OUT)
        bpy.ops.ed.redo()
        same(after, WORKED_OUT)


def test_adding_and_removing_a_stage_is_as_if_nothing_had_been(untouched: Any, folder: Path) -> None:
    begin(folder)
    before = dump()
    bpy.ops.potmesil.add_stage()
    bpy.ops.potmesil.remove_stage()
    # Blender counts a scene's users up where Render Layers nodes come, and not always down where they go.
    same(before, (r"^scenes.*\.users$",))


def test_disabling_leaves_nothing(untouched: Any, folder: Path) -> None:
    addon_utils.disable(PACKAGE)
    try:
        artists_scene(folder)
        before = dump()
        addon_utils.enable(PACKAGE)
        bpy.context.scene.potmesil_camera.samples_path = str(folder / "samples_####.exr")
        for name in ("render", "add_stage", "process", "remove_stage"):
            assert run(name, {}, Ending("done")) == "{'FINISHED'}"
        addon_utils.disable(PACKAGE)
        # What is saved with the file stays, for when the extension is enabled again.
        same(before, (r"\['potmesil_camera'\]", r"^scenes.*\.users$"))
    finally:
        addon_utils.enable(PACKAGE)
