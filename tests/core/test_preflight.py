"""What is said of a scene before it renders."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from potmesil_addon.preflight import SceneFacts, check_scene

ORDER = ["error", "warning", "note"]


def test_a_good_scene_has_no_findings() -> None:
    assert check_scene(SceneFacts()) == ()


@pytest.mark.parametrize(
    ("facts", "severity", "title", "fix"),
    [
        ({"camera_type": None}, "error", "No Camera", None),
        ({"camera_type": "PANO"}, "error", "Panoramic Camera", None),
        ({"camera_type": "ORTHO"}, "error", "No Perspective Camera", None),
        ({"camera_type": "CUSTOM"}, "error", "No Perspective Camera", None),
        ({"engine": "BLENDER_WORKBENCH"}, "error", "Engine Without Passes", None),
        ({"renders_anything": False}, "error", "No View Layer", None),
        ({"has_depth": False}, "warning", "Passes Off: Z", "setup_passes"),
        ({"has_vector": False, "wants_motion": True}, "warning", "Passes Off: Vector", "setup_passes"),
        ({"has_object_index": False}, "warning", "Passes Off: Object Index", "setup_passes"),
        ({"all_on_index_zero": True}, "warning", "Objects Share Index 0", "setup_passes"),
        ({"motion_blur": True, "wants_motion": True}, "warning", "Motion Blur On", None),
        ({"engine": "BLENDER_EEVEE"}, "warning", "Not Cycles", None),
        ({"stereo": True}, "warning", "Stereo Views", None),
        ({"depth_of_field": True}, "note", "Camera Blurs Already", None),
        ({"denoising": True}, "note", "Denoising On", None),
        ({"clamped": True}, "note", "Samples Clamped", None),
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


def everything_wrong() -> SceneFacts:
    values: dict[str, Any] = {}
    for field in fields(SceneFacts):
        default = field.default
        values[field.name] = not default if isinstance(default, bool) else default
    return SceneFacts(**{**values, "engine": "BLENDER_EEVEE", "camera_type": None})


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
