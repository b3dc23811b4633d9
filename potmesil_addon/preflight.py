"""What is wrong with a scene before any render starts, in words, with the fix named."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

Severity = Literal["error", "warning", "note"]
Fix = Literal[
    "add_camera",
    "activate_camera",
    "perspective_camera",
    "use_cycles",
    "use_view_layer",
    "setup_passes",
    "focus_middle",
    "open_aperture",
    "motion_blur_off",
    "camera_blur_off",
    "denoising_off",
    "clamping_off",
    "reflections_on",
    "reflections_off",
    "motion_on",
    "stereo_off",
    "region_off",
    "compositing_on",
    "lock_interface",
    "samples_beside",
    "number_samples",
    "save_as",
]

OF_THE_CAMERA: Final[tuple[Fix, ...]] = (
    "perspective_camera",
    "focus_middle",
    "open_aperture",
    "camera_blur_off",
)
"""Fixes that change the camera, which one that is linked from another file does not allow."""

_ENGINES_WITHOUT_PASSES: Final = ("BLENDER_WORKBENCH",)


@dataclass(frozen=True, slots=True)
class SceneFacts:
    """What the check needs to know of a scene, free of Blender's types.

    Parameters
    ----------
    engine : str
        Blender's identifier of the render engine.
    has_cycles : bool
        Whether Blender was built with Cycles.
    camera_type : str or None
        ``PERSP``, ``ORTHO``, ``PANO`` ...; ``None`` without a camera.
    has_inactive_camera : bool
        Whether there is a camera that could be the scene's.
    camera_linked : bool
        Whether the camera is in another file and cannot be changed here.
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
    nothing_blurred : bool
        Whether all from half of the focus distance on is sharp to a pixel.
    renders_anything : bool
        Whether a view layer is used for rendering.
    all_on_index_zero : bool
        Whether several objects render and every one has pass index 0.
    denoising : bool
        Whether the render is denoised.
    clamped : bool
        Whether sample values are clamped.
    wants_reflections : bool
        Whether what mirrors and glass show is asked for, and something blurs it.
    nothing_reflects : bool
        Whether that alone is asked for, and there is neither mirror nor glass.
    flat_mirrors : bool
        Whether there are mirrors or glass, something blurs them, and what they show is not asked for.
    wants_shadows : bool
        Whether shadows are to move.
    stereo : bool
        Whether several views are rendered.
    region : bool
        Whether only a part of the picture is rendered, without being cropped to it.
    compositing_off : bool
        Whether there is a stage and the compositor does not run.
    interface_free : bool
        Whether there is a stage and the window draws the scene while it renders.
    unwritable_folder : str
        Where samples cannot be written; empty where they can.
    samples_relative : bool
        Whether samples are kept beside the .blend file.
    temporary_samples : bool
        Whether samples go into Blender's temporary folder.
    one_samples_file : bool
        Whether all frames of an animation have the same samples file.
    """

    engine: str = "CYCLES"
    has_cycles: bool = True
    camera_type: str | None = "PERSP"
    has_inactive_camera: bool = False
    camera_linked: bool = False
    has_depth: bool = True
    has_vector: bool = True
    has_object_index: bool = True
    wants_motion: bool = False
    motion_blur: bool = False
    depth_of_field: bool = False
    focus_at_lens: bool = False
    nothing_blurred: bool = False
    renders_anything: bool = True
    all_on_index_zero: bool = False
    denoising: bool = False
    clamped: bool = False
    wants_reflections: bool = False
    nothing_reflects: bool = False
    flat_mirrors: bool = False
    wants_shadows: bool = False
    stereo: bool = False
    region: bool = False
    compositing_off: bool = False
    interface_free: bool = False
    unwritable_folder: str = ""
    samples_relative: bool = False
    temporary_samples: bool = False
    one_samples_file: bool = False


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
        What would put it right with one click.
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
    cycles: Fix = "use_cycles"
    refused = () if facts.has_cycles else (cycles,)
    if facts.camera_linked and any(finding.fix in OF_THE_CAMERA for finding in findings):
        refused = (*refused, *OF_THE_CAMERA)
        findings.append(
            Finding(
                "note",
                "Camera Is Linked",
                "The camera is linked from another file; make it local, or a library override, to change it.",
            )
        )
    return tuple(replace(found, fix=None) if found.fix in refused else found for found in findings)


def _errors(facts: SceneFacts) -> list[Finding]:
    found = []
    if facts.camera_type is None and facts.has_inactive_camera:
        found.append(
            Finding(
                "error",
                "No Active Camera",
                "The scene has no camera that is active; make one active.",
                "activate_camera",
            )
        )
    elif facts.camera_type is None:
        found.append(
            Finding(
                "error", "No Camera", "The scene has no camera; add one and make it active.", "add_camera"
            )
        )
    elif facts.camera_type == "PANO":
        found.append(
            Finding(
                "error",
                "Panoramic Camera",
                "A panoramic camera's Z is a distance and no depth; use a perspective camera.",
                "perspective_camera",
            )
        )
    elif facts.camera_type != "PERSP":
        found.append(
            Finding(
                "error",
                "No Perspective Camera",
                "Only a perspective camera has a lens in front of a film; choose that type.",
                "perspective_camera",
            )
        )
    if facts.engine in _ENGINES_WITHOUT_PASSES:
        found.append(
            Finding(
                "error",
                "Engine Without Passes",
                "This render engine gives no Z pass; use Cycles.",
                "use_cycles",
            )
        )
    if not facts.renders_anything:
        found.append(
            Finding(
                "error",
                "No View Layer",
                "No view layer is used for rendering; switch one on.",
                "use_view_layer",
            )
        )
    if facts.unwritable_folder:
        found.append(
            Finding(
                "error",
                "Samples Cannot Be Kept",
                f"Cannot write samples into '{facts.unwritable_folder}'; "
                + (
                    "save the file where you may write."
                    if facts.samples_relative
                    else "choose another samples path."
                ),
                "save_as" if facts.samples_relative else "samples_beside",
            )
        )
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
    if facts.engine != "CYCLES" and facts.engine not in _ENGINES_WITHOUT_PASSES:
        found.append(
            Finding(
                "warning",
                "Not Cycles",
                "Only Cycles gives all passes; others lack the object index.",
                "use_cycles",
            )
        )
        if facts.wants_reflections:
            found.append(
                Finding(
                    "warning",
                    "Reflections Without Cycles",
                    "Only Cycles tells what mirrors and glass show; use it, or turn Reflections off.",
                    "use_cycles",
                )
            )
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
                "focus_middle",
            )
        )
    if facts.motion_blur and facts.wants_motion:
        found.append(
            Finding(
                "warning",
                "Motion Blur On",
                "With it the vector pass is all zero; Render switches it off while it works.",
                "motion_blur_off",
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
    if facts.stereo:
        found.append(
            Finding(
                "warning",
                "Stereo Views",
                "Only the camera's own view is rendered; render the others one by one.",
                "stereo_off",
            )
        )
    if facts.compositing_off:
        found.append(
            Finding(
                "warning",
                "Compositing Off",
                "The compositor has a stage and does not run; turn Compositing on.",
                "compositing_on",
            )
        )
    if facts.interface_free:
        found.append(
            Finding(
                "warning",
                "Interface Not Locked",
                "Renders with a stage follow what moves; turn Render > Lock Interface on.",
                "lock_interface",
            )
        )
    if facts.region:
        found.append(
            Finding(
                "warning",
                "Render Region",
                "Only the region is rendered, and its blurred edges miss what lies outside; turn it off.",
                "region_off",
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
                "camera_blur_off",
            )
        )
    if facts.nothing_blurred:
        found.append(
            Finding(
                "note",
                "Hardly Anything Is Blurred",
                "From half of the focus distance on, all is sharp to a pixel; choose a lower f-stop.",
                "open_aperture",
            )
        )
    if facts.denoising:
        found.append(
            Finding(
                "note",
                "Denoising On",
                "Denoised colors can lie across depth edges; more samples are safer where edges show.",
                "denoising_off",
            )
        )
    if facts.clamped:
        found.append(
            Finding(
                "note",
                "Samples Clamped",
                "Clamping dims highlights, and with them the discs they blur into; set it to 0.",
                "clamping_off",
            )
        )
    if facts.nothing_reflects:
        found.append(
            Finding(
                "note",
                "Nothing Reflects",
                "No material is smooth enough; raise the Roughness Limit, or turn Reflections off.",
                "reflections_off",
            )
        )
    if facts.flat_mirrors:
        found.append(
            Finding(
                "note",
                "Reflections Off",
                "What mirrors and glass show is blurred as their surfaces are; turn Reflections on.",
                "reflections_on",
            )
        )
    if facts.wants_shadows and not facts.wants_motion:
        found.append(
            Finding(
                "note",
                "Shadows Do Not Move",
                "Shadows are moved by the motion processor alone, and it is off; turn it on.",
                "motion_on",
            )
        )
    if facts.one_samples_file:
        found.append(
            Finding(
                "note",
                "One Samples File",
                "Each frame's samples replace those of the frame before; put #### into the samples path.",
                "number_samples",
            )
        )
    if facts.temporary_samples:
        found.append(
            Finding(
                "note",
                "File Not Saved",
                "Samples go into a folder that Blender empties when it ends; save the file to keep new ones "
                "beside it.",
                "save_as",
            )
        )
    return found
