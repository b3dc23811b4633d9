"""What is wrong with a scene before any render starts, in words, with the fix named."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

Severity = Literal["error", "warning", "note"]
Fix = Literal["setup_passes"]

_ENGINES_WITHOUT_PASSES: Final = ("BLENDER_WORKBENCH",)


@dataclass(frozen=True, slots=True)
class SceneFacts:
    """What the check needs to know of a scene, free of Blender's types.

    Parameters
    ----------
    engine : str
        Blender's identifier of the render engine.
    camera_type : str or None
        ``PERSP``, ``ORTHO``, ``PANO`` ...; ``None`` without a camera.
    has_depth, has_vector, has_object_index : bool
        Whether every view layer that renders has the pass.
    wants_motion : bool
        Whether the motion processor will run; it alone reads the vectors.
    motion_blur : bool
        Whether the engine's own motion blur is on.
    depth_of_field : bool
        Whether the camera's own depth of field is on.
    focus_at_lens : bool
        Whether the focus distance was never set and is 0.
    renders_anything : bool
        Whether a view layer is used for rendering.
    all_on_index_zero : bool
        Whether several objects render and every one has pass index 0.
    denoising : bool
        Whether the render is denoised.
    clamped : bool
        Whether sample values are clamped.
    stereo : bool
        Whether several views are rendered.
    """

    engine: str = "CYCLES"
    camera_type: str | None = "PERSP"
    has_depth: bool = True
    has_vector: bool = True
    has_object_index: bool = True
    wants_motion: bool = False
    motion_blur: bool = False
    depth_of_field: bool = False
    focus_at_lens: bool = False
    renders_anything: bool = True
    all_on_index_zero: bool = False
    denoising: bool = False
    clamped: bool = False
    stereo: bool = False


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing to know before rendering.

    Parameters
    ----------
    severity : {"error", "warning", "note"}
        ``error`` keeps the render from starting.
    title : str
        A few words, as a label.
    text : str
        One sentence: what it means and what to do.
    fix : str or None
        What would put it right.
    """

    severity: Severity
    title: str
    text: str
    fix: Fix | None = None


def check_scene(facts: SceneFacts) -> tuple[Finding, ...]:
    """Name what keeps a scene from rendering well.

    Parameters
    ----------
    facts : SceneFacts
        The scene.

    Returns
    -------
    tuple of Finding
        Errors first, then warnings, then notes.
    """
    findings = [*_errors(facts), *_warnings(facts), *_notes(facts)]
    return tuple(findings)


def _errors(facts: SceneFacts) -> list[Finding]:
    found = []
    if facts.camera_type is None:
        found.append(Finding("error", "No Camera", "The scene has no camera; add one and make it active."))
    elif facts.camera_type == "PANO":
        found.append(
            Finding(
                "error",
                "Panoramic Camera",
                "A panoramic camera's Z is a distance and no depth; use a perspective camera.",
            )
        )
    elif facts.camera_type != "PERSP":
        found.append(
            Finding(
                "error",
                "No Perspective Camera",
                "Only a perspective camera has a lens in front of a film; choose that type.",
            )
        )
    if facts.engine in _ENGINES_WITHOUT_PASSES:
        found.append(
            Finding("error", "Engine Without Passes", "This render engine gives no Z pass; use Cycles.")
        )
    if not facts.renders_anything:
        found.append(Finding("error", "No View Layer", "No view layer is used for rendering; switch one on."))
    return found


def _warnings(facts: SceneFacts) -> list[Finding]:
    found = []
    missing = [
        name
        for name, there in (
            ("Z", facts.has_depth),
            ("Vector", facts.has_vector or not facts.wants_motion),
            ("Object Index", facts.has_object_index),
        )
        if not there
    ]
    if missing:
        found.append(
            Finding(
                "warning",
                f"Passes Off: {', '.join(missing)}",
                "Render switches them on for itself; Set Up Passes keeps them on for every render.",
                "setup_passes",
            )
        )
    if facts.focus_at_lens:
        found.append(
            Finding(
                "warning",
                "Focus Distance Is 0",
                "Everything is blurred beyond recognition; set the focus distance or a focus object.",
            )
        )
    if facts.motion_blur and facts.wants_motion:
        found.append(
            Finding(
                "warning",
                "Motion Blur On",
                "With it the vector pass is all zero; Render switches it off while it works.",
            )
        )
    if facts.all_on_index_zero:
        found.append(
            Finding(
                "warning",
                "Objects Share Index 0",
                "Samples cannot tell one object from another; Set Up Passes gives each an index.",
                "setup_passes",
            )
        )
    if facts.engine != "CYCLES" and facts.engine not in _ENGINES_WITHOUT_PASSES:
        found.append(
            Finding("warning", "Not Cycles", "Only Cycles gives all passes; others lack the object index.")
        )
    if facts.stereo:
        found.append(
            Finding(
                "warning",
                "Stereo Views",
                "Only the camera's own view is rendered; render the others one by one.",
            )
        )
    return found


def _notes(facts: SceneFacts) -> list[Finding]:
    found = []
    if facts.depth_of_field:
        found.append(
            Finding(
                "note",
                "Camera Blurs Already",
                "The camera's own depth of field is on; Render switches it off while it works.",
            )
        )
    if facts.denoising:
        found.append(
            Finding(
                "note",
                "Denoising On",
                "Denoised colors can lie across depth edges; more samples are safer where edges show.",
            )
        )
    if facts.clamped:
        found.append(
            Finding(
                "note",
                "Samples Clamped",
                "Clamping dims highlights, and with them the discs they blur into; set it to 0.",
            )
        )
    return found
