"""From the scene to a samples file: passes on, blur off, its views rendered, camera and motion saved."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon.errors import InputError
from ..potmesil_addon.files import working_folder
from ..potmesil_addon.lamps import lamps_to_json
from ..potmesil_addon.preflight import Finding, check_scene
from ..potmesil_addon.samples import SampleLayer
from . import compat, kernels
from .absence import absent, hidden_from_camera
from .borrow import Borrowed
from .lamps import lamps_of
from .motion import SampledMotion, kept_scene, sample_motion
from .overscan import borrow_overscan, overscan_margins, uses_overscan
from .peel import peeled_views, uses_depth_peeling
from .sampling import borrow_sampling, filter_variance, supersampling
from .scene import (  # noqa: F401 - the others look for some of it here
    render_graph,
    rendered_objects,
    samples_path,
    scene_facts,
    uses_reflections,
)
from .seen import SeenLight, borrow_light_passes, keeps_light_passes
from .work import doing

RENDER_RESULT = "Render Result"

_COVERING_ENGINES = ("CYCLES", "BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")
"""Engines whose Cryptomatte weighs what a pixel shows as its colour does; EEVEE has two names."""

_CRYPTOMATTE_RANKS = 4
"""Objects in a pixel whose coverages are told apart."""

_MOTION_SHARE = 0.1
"""Share of the export's progress for following what moves; the rest is rendering."""


def refuse_errors(scene: bpy.types.Scene, path: Path | None = None) -> tuple[Finding, ...]:
    """Raise InputError with the first finding that keeps the scene from rendering; return the others.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : Path or None
        The samples file, where it is not the scene's own.
    """
    findings = check_scene(scene_facts(scene, path))
    for finding in findings:
        if finding.severity == "error":
            raise InputError(finding.text)
    return findings


def borrow_for_render(borrowed: Borrowed, scene: bpy.types.Scene, *, compositing: bool = False) -> None:
    """Change, until they are given back, the settings that a samples file needs otherwise.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        A scene with a camera.
    compositing : bool
        Leave the compositor and the sequencer as they are.
    """
    render = scene.render
    borrowed.set(render, "use_motion_blur", False)
    borrowed.set(render, "use_multiview", False)
    try:
        bpy.data.filepath.encode()
    except UnicodeEncodeError:
        # Blender would write it into the header, where OpenEXR reads UTF-8 alone.
        borrowed.set(render, "use_stamp_filename", False)
    borrowed.set(scene.camera.data.dof, "use_dof", False)
    if not compositing:
        borrowed.set(render, "use_compositing", False)
        borrowed.set(render, "use_sequencer", False)
    for layer in scene.view_layers:
        if layer.use:
            borrowed.set(layer, "use_pass_combined", True)
            borrowed.set(layer, "use_pass_z", True)
            borrowed.set(layer, "use_pass_vector", True)
            borrowed.set(layer, "use_pass_object_index", True)
            if uses_coverages(scene) and not layer.use_pass_cryptomatte_object:
                borrowed.set(layer, "use_pass_cryptomatte_object", True)
                borrowed.set(layer, "pass_cryptomatte_depth", _CRYPTOMATTE_RANKS)
    if uses_reflections(scene) and not compositing:
        borrow_light_passes(borrowed, scene)
    borrow_sampling(borrowed, scene)


def render_samples(context: bpy.types.Context, path: Path) -> None:
    """Render the current frame and save its samples, blocking while Blender renders.

    Parameters
    ----------
    context : Context
        Its scene is rendered.
    path : Path
        The samples file.

    Raises
    ------
    InputError
        If the scene cannot be rendered.
    OutputError
        If the file cannot be written.
    """

    def render(scene: bpy.types.Scene) -> Iterator[float]:
        bpy.ops.render.render(scene=scene.name)
        yield 1.0

    for _ in export_samples(context.scene, path, render):
        pass


def export_samples(
    scene: bpy.types.Scene,
    path: Path,
    render: Callable[[bpy.types.Scene], Iterator[float]],
    more: Mapping[str, str] | None = None,
) -> Iterator[float]:
    """Render the current frame and save its samples: follow what moves, render every view, write one file.

    Where the scene allows it, further views are rendered first: where things move, the scene without
    what moves and what moves alone; for the lens, the scene with more and more of what is nearest left
    out. Last comes the scene as it is, which the Render Result goes on showing.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : Path
        The samples file; written whole or not at all.
    render : callable
        Renders a scene, which may be a copy, into its Render Result, yielding progress. It may yield while
        Blender renders; closing this generator gives everything back.

    Yields
    ------
    float
        Share of the work done.

    Raises
    ------
    InputError
        If the scene cannot be rendered.
    OutputError
        If the file cannot be written.
    """
    kernels.use_user_cache()
    # Blender's start-up would pay for OpenEXR's and numba's import if these stood above.
    from ..potmesil_addon import exr  # noqa: PLC0415
    from ..potmesil_addon.progress import scaled  # noqa: PLC0415

    refuse_errors(scene, path)
    frame = scene.frame_current
    with (
        # Renders, too, take changes back that were never keyed.
        kept_scene(scene),
        Borrowed() as borrowed,
        working_folder() as folder,
    ):
        pixel_variance = filter_variance(scene)
        keeps_light = keeps_light_passes(scene)
        borrow_for_render(borrowed, scene)
        sample_variance = filter_variance(scene)
        doing(iface_("Following What Moves in Frame {frame}").format(frame=frame))
        motion = yield from scaled(sample_motion(scene), 0.0, _MOTION_SHARE)
        margins = overscan_margins(scene, motion) if uses_overscan(scene) else (0, 0)
        borrow_overscan(borrowed, scene, margins)
        views: dict[str, Callable[[Borrowed], None]] = {}
        if motion.paths.objects and uses_hidden_surfaces(scene):
            views[exr.STATIONARY] = lambda own: hidden_from_camera(own, scene, motion.moving)
            views[exr.MOVING] = lambda own: _leave_alone(own, scene, motion)
            if moves_shadows(scene):
                views[exr.ABSENT] = lambda own: absent(own, scene, motion.moving)
        if uses_depth_peeling(scene):
            for number, names in enumerate(peeled_views(scene, motion, margins), start=1):
                views[exr.behind(number)] = functools.partial(hidden_from_camera, scene=scene, names=names)
        seen = SeenLight(scene, motion, folder, render, save_render) if uses_reflections(scene) else None
        start, share = _MOTION_SHARE, (1.0 - _MOTION_SHARE) / (len(views) + 1)
        companions: dict[str, Path] = {}
        for suffix, prepare in views.items():
            doing(_rendering(frame, len(companions) + 1, len(views) + 1))
            with Borrowed() as own:
                prepare(own)
                yield from scaled(render(scene), start, share)
                companions[suffix] = folder / f"companion_{len(companions)}.exr"
                save_render(scene, companions[suffix])
                if seen is not None:
                    yield from scaled(seen.probe(suffix, whole=suffix == exr.ABSENT), start + share, 0.0)
            start += share
        if seen is not None:
            yield from scaled(seen.probe("", whole=True), start, 0.0)
        doing(_rendering(frame, len(views) + 1, len(views) + 1))
        yield from scaled(render(scene), start, share)
        rendered = folder / "render.exr"
        save_render(scene, rendered)
        layers = [] if seen is None else seen.layers(rendered, companions, margins)
        filters = (pixel_variance, sample_variance)
        annotate_render(
            scene, rendered, path, motion, filters, companions, margins, layers, more,
            keep_light_passes=keeps_light,
        )  # fmt: skip


def _rendering(frame: int, number: int, count: int) -> str:
    """Return what is being done while a view of a frame renders."""
    if count == 1:
        return iface_("Rendering Frame {frame}").format(frame=frame)
    text = iface_("Rendering Frame {frame}, View {number} of {count}")
    return text.format(frame=frame, number=number, count=count)


def annotate_render(
    scene: bpy.types.Scene,
    rendered: Path,
    path: Path,
    motion: SampledMotion,
    variances: tuple[float | None, float | None],
    companions: Mapping[str, Path] | None = None,
    margins: tuple[int, int] = (0, 0),
    seen: Sequence[SampleLayer] = (),
    more: Mapping[str, str] | None = None,
    *,
    keep_light_passes: bool = True,
) -> None:
    """Make a samples file of a saved render.

    Parameters
    ----------
    scene : Scene
        The scene, set up for samples.
    rendered : Path
        Its saved render.
    path : Path
        The samples file; written whole or not at all.
    motion : SampledMotion
        Its camera, and what moves.
    variances : tuple of float or None
        Of the pixel filter that is wanted, and of the one that the samples were rendered with.
    companions, margins, seen, keep_light_passes
        Other views, overscan, and what mirrors and glass show: see `exr.annotate`.
    more : mapping of str to str, optional
        Further attributes.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    from ..potmesil_addon import exr  # noqa: PLC0415 - see kernels

    attributes = exr.camera_attributes(motion.camera, motion.lens, motion.shutter)
    attributes["potmesil:motion"] = motion.paths.to_json()
    if moves_shadows(scene):
        attributes["potmesil:lamps"] = lamps_to_json(lamps_of(scene, render_graph(scene)))
    if supersampling(scene) > 1:
        attributes["potmesil:supersampling"] = supersampling(scene)
    if variances[0] is not None:
        filters = {"pixel_variance": variances[0], "sample_variance": variances[1]}
        attributes["potmesil:filter"] = json.dumps(filters)
    attributes.update(more or {})
    exr.annotate(rendered, path, attributes, companions, margins, seen, keep_light_passes=keep_light_passes)


def uses_coverages(scene: bpy.types.Scene) -> bool:
    """Return whether the lens needs to know how much of each pixel is whose, and the engine tells it.

    Point samples show one surface each.
    """
    own = scene.potmesil_camera
    if not (own.use_lens and own.visibility == "aperture") or scene.render.engine not in _COVERING_ENGINES:
        return False
    return bool(own.sampling != "POINTS" or supersampling(scene) == 1)


def uses_hidden_surfaces(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for views with and without moving objects and its engine gives them."""
    own = scene.potmesil_camera
    asked = own.use_hidden_surfaces or moves_shadows(scene)
    return bool(own.use_motion and asked and scene.render.engine == "CYCLES")


def moves_shadows(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for shadows apart from what they fall on, and its engine gives them."""
    own = scene.potmesil_camera
    asked = own.reflections == "REFLECTIONS_AND_SHADOWS"
    return bool(own.use_motion and asked and scene.render.engine == "CYCLES")


def _leave_alone(borrowed: Borrowed, scene: bpy.types.Scene, motion: SampledMotion) -> None:
    """Let the camera see what moves, and nothing else."""
    borrowed.set(scene.render, "film_transparent", True)
    others = {item.name_full for item in scene.objects if item.type == "LIGHT"}
    # What the viewport does not show was not sampled, and does not count as moving.
    instanced = {name for name, parent in motion.pairs if parent is not None}
    others |= {item.name_full for item in rendered_objects(scene)} - instanced
    hidden_from_camera(borrowed, scene, (motion.still | others) - motion.moving)


def save_render(scene: bpy.types.Scene, path: Path) -> None:
    """Save the Render Result as a float multilayer EXR.

    Raises
    ------
    InputError
        If there is no render to save.
    """
    image = bpy.data.images.get(RENDER_RESULT)
    if image is None:
        raise InputError("There is no render to save; render the scene first.")
    with Borrowed() as borrowed:
        compat.borrow_multilayer_exr(borrowed, scene)
        try:
            image.save_render(str(path), scene=scene)
        except RuntimeError as error:
            text = rpt_("Blender cannot save the render ({reason}); render again.")
            raise InputError(text.format(reason=str(error).strip())) from error
