"""What is said of a scene before it renders."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from potmesil_addon.preflight import SceneFacts, check_scene

ORDER = ["error", "warning", "note"]


def test_a_good_scene_has_no_findings() -> None:
    assert check_scene(SceneFacts()) == ()


@pytest.mark.parametrize(
    ("facts", "severity", "title", "fix"),
    [
        ({"camera_type": None}, "error", "No Camera", "add_camera"),
        (
            {"camera_type": None, "has_inactive_camera": True},
            "error",
            "No Active Camera",
            "activate_camera",
        ),
        ({"camera_type": "PANO"}, "error", "Panoramic Camera", "perspective_camera"),
        ({"camera_type": "ORTHO"}, "error", "No Perspective Camera", "perspective_camera"),
        ({"camera_type": "CUSTOM"}, "error", "No Perspective Camera", "perspective_camera"),
        ({"engine": "BLENDER_WORKBENCH"}, "error", "Engine Without Passes", "use_cycles"),
        ({"engine": "BLENDER_WORKBENCH", "has_cycles": False}, "error", "Engine Without Passes", None),
        ({"renders_anything": False}, "error", "No View Layer", "use_view_layer"),
        ({"unwritable_folder": "/there"}, "error", "Samples Cannot Be Kept", "samples_beside"),
        (
            {"unwritable_folder": "/there", "samples_relative": True},
            "error",
            "Samples Cannot Be Kept",
            "save_as",
        ),
        ({"has_depth": False}, "warning", "Passes Off: Z", "setup_passes"),
        ({"has_vector": False, "wants_motion": True}, "warning", "Passes Off: Vector", "setup_passes"),
        ({"has_object_index": False}, "warning", "Passes Off: Object Index", "setup_passes"),
        ({"all_on_index_zero": True}, "warning", "Objects Share Index 0", "setup_passes"),
        ({"focus_at_lens": True}, "warning", "Focus Distance Is 0", "focus_middle"),
        ({"motion_blur": True, "wants_motion": True}, "warning", "Motion Blur On", "motion_blur_off"),
        ({"engine": "BLENDER_EEVEE"}, "warning", "Not Cycles", "use_cycles"),
        ({"stereo": True}, "warning", "Stereo Views", "stereo_off"),
        ({"compositing_off": True}, "warning", "Compositing Off", "compositing_on"),
        ({"interface_free": True}, "warning", "Interface Not Locked", "lock_interface"),
        ({"region": True}, "warning", "Render Region", "region_off"),
        ({"depth_of_field": True}, "note", "Camera Blurs Already", "camera_blur_off"),
        ({"nothing_blurred": True}, "note", "Hardly Anything Is Blurred", "open_aperture"),
        ({"denoising": True}, "note", "Denoising On", "denoising_off"),
        ({"clamped": True}, "note", "Samples Clamped", "clamping_off"),
        ({"nothing_reflects": True}, "note", "Nothing Reflects", "reflections_off"),
        ({"flat_mirrors": True}, "note", "Reflections Off", "reflections_on"),
        ({"wants_shadows": True}, "note", "Shadows Do Not Move", "motion_on"),
        ({"one_samples_file": True}, "note", "One Samples File", "number_samples"),
        ({"temporary_samples": True}, "note", "File Not Saved", "save_as"),
    ],
)
def test_each_fact_has_its_finding(facts: dict[str, Any], severity: str, title: str, fix: str | None) -> None:
    (found,) = check_scene(SceneFacts(**facts))
    assert (found.severity, found.title, found.fix) == (severity, title, fix)


def test_passes_that_are_off_are_named_together() -> None:
    facts = SceneFacts(has_depth=False, has_vector=False, has_object_index=False, wants_motion=True)
    (found,) = check_scene(facts)
    assert found.title == "Passes Off: Z, Vector, Object Index"


@pytest.mark.parametrize("facts", [{"motion_blur": True}, {"has_vector": False}])
def test_vectors_matter_to_the_motion_processor_alone(facts: dict[str, Any]) -> None:
    assert check_scene(SceneFacts(**facts)) == ()
    assert check_scene(SceneFacts(**facts, wants_motion=True)) != ()


@pytest.mark.parametrize("has_cycles", [True, False])
def test_reflections_need_cycles(has_cycles: bool) -> None:
    facts = SceneFacts(engine="BLENDER_EEVEE", has_cycles=has_cycles, wants_reflections=True)
    fix = "use_cycles" if has_cycles else None
    found = [(finding.severity, finding.title, finding.fix) for finding in check_scene(facts)]
    assert found == [("warning", "Not Cycles", fix), ("warning", "Reflections Without Cycles", fix)]
    assert check_scene(replace(facts, engine="CYCLES")) == ()


def test_shadows_move_with_the_motion_processor() -> None:
    assert check_scene(SceneFacts(wants_shadows=True, wants_motion=True)) == ()


def everything_wrong() -> SceneFacts:
    values: dict[str, Any] = {}
    for field in fields(SceneFacts):
        default = field.default
        values[field.name] = not default if isinstance(default, bool) else default
    return SceneFacts(
        **{**values, "engine": "BLENDER_EEVEE", "camera_type": None, "unwritable_folder": "/there"}
    )


def test_every_finding_of_a_scene_of_ones_own_has_a_fix() -> None:
    everything = replace(everything_wrong(), camera_linked=False, has_cycles=True)
    assert [finding.title for finding in check_scene(everything) if finding.fix is None] == []


def test_a_linked_camera_is_said_and_not_changed() -> None:
    assert check_scene(SceneFacts(camera_linked=True)) == ()
    findings = check_scene(SceneFacts(camera_linked=True, camera_type="ORTHO", depth_of_field=True))
    assert [finding.fix for finding in findings] == [None, None, None]
    assert findings[-1].title == "Camera Is Linked"


def test_errors_come_first_and_notes_last() -> None:
    severities = [finding.severity for finding in check_scene(everything_wrong())]
    assert set(severities) == set(ORDER)
    assert severities == sorted(severities, key=ORDER.index)


def test_each_finding_is_one_sentence_with_a_short_label() -> None:
    for finding in check_scene(everything_wrong()):
        assert finding.text.endswith(".")
        assert "\n" not in finding.text
        assert len(finding.title) <= 40
        assert not finding.title.endswith(".")
