"""How many renders a frame takes, to say so before it is rendered."""

from __future__ import annotations

import time
from dataclasses import dataclass

import bpy

from ..potmesil_addon.surfaces import SurfaceKind
from .export import moves_shadows, uses_hidden_surfaces
from .peel import uses_depth_peeling
from .probe import VIEWS
from .scene import rendered_objects, uses_reflections
from .surfaces import surface_of

_REFLECTING = frozenset({SurfaceKind.POLISHED, SurfaceKind.MIRROR, SurfaceKind.GLASS})

_KEPT_SECONDS = 1.0
"""How long what was found counts in Blender's window, which draws panels many times a second."""


@dataclass(frozen=True, slots=True)
class RenderCounts:
    """How many renders a frame takes at most.

    Parameters
    ----------
    full : int
        Renders of the picture, or of a view that takes about as long.
    probes : int
        Renders of one sample a pixel.
    """

    full: int
    probes: int


def render_counts(scene: bpy.types.Scene) -> RenderCounts:
    """Return how many renders a frame takes with the settings as they are now.

    Parameters
    ----------
    scene : Scene
        The scene; what moves, and what is in view, is not looked at.

    Returns
    -------
    RenderCounts
        At most so many: where nothing moves, or nothing is near, a frame takes less.
    """
    own = scene.potmesil_camera
    plain = 2 if uses_hidden_surfaces(scene) else 0
    if uses_depth_peeling(scene):
        plain += own.peel_count if own.depth_peeling == "AUTOMATIC" else _marked(scene)
    # Without what moves, mirrors show something else, and are probed as the picture is.
    whole = 2 if moves_shadows(scene) else 1
    probes = 0
    for light in _lights(scene) if uses_reflections(scene) else ():
        probes += whole * len(VIEWS[light]) + plain
    return RenderCounts(plain + whole, probes)


def kinds_in(scene: bpy.types.Scene) -> frozenset[SurfaceKind]:
    """Return what mirrors and glass there are in a scene.

    Parameters
    ----------
    scene : Scene
        Its roughness limit counts. In Blender's window a change may count a moment later.

    Returns
    -------
    frozenset of SurfaceKind
        ``POLISHED``, ``MIRROR`` and ``GLASS``, as far as something is.
    """
    limit = scene.potmesil_camera.max_roughness
    key = (scene.as_pointer(), limit, len(scene.objects))
    start = time.perf_counter()
    if _Last.key == key and start < _Last.until:
        return _Last.kinds
    # Many objects share their materials, and each is asked about once.
    alike = {_made_of(item): item for item in rendered_objects(scene)}
    found: set[SurfaceKind] = set()
    for item in alike.values():
        if found >= _REFLECTING:
            break
        found.update(surface_of(item, limit).kinds)
    kinds = _REFLECTING & found
    if not bpy.app.background:
        _Last.key, _Last.kinds = key, kinds
        _Last.until = time.perf_counter() + _KEPT_SECONDS
    return kinds


class _Last:
    """What was found last: panels ask several times for each redraw, also in playback."""

    key: object = None
    kinds: frozenset[SurfaceKind] = frozenset()
    until = 0.0


def _made_of(item: bpy.types.Object) -> tuple[str | int, ...]:
    """Return what tells objects apart that may do different things to light."""
    materials = (slot.material for slot in item.material_slots)
    return (item.potmesil_camera.surface, *(0 if each is None else each.as_pointer() for each in materials))


def _lights(scene: bpy.types.Scene) -> list[str]:
    """Return the kinds of light that are probed."""
    kinds = kinds_in(scene)
    return [light for light in VIEWS if (SurfaceKind.GLASS in kinds if light == "transmitted" else kinds)]


def _marked(scene: bpy.types.Scene) -> int:
    """Return how many collections are marked for depth peeling."""
    return len({item for item in scene.collection.children_recursive if item.potmesil_camera.peel})
