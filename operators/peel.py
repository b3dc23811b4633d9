"""Depth peeling: what to leave out of further views, so that what near things hide is rendered too.

Around a near thing that is out of focus, and behind its blurred rim, a lens sees past it. The more the
circles of confusion before and behind an edge differ, the more of what is behind it shows. Objects are
therefore put in order, and parted, by their circles of confusion.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..potmesil_addon.lens import circle_of_confusion
from .motion import SampledMotion

_LARGE = 0.7
"""What reaches over more than this share of the circles from its near end to the farthest thing is large."""

_LEAST_STEP_PX = 2.0
"""Difference of circles, a pixel of radius, below which an edge opens too little for a view of its own."""


def uses_depth_peeling(scene: bpy.types.Scene) -> bool:
    """Return whether the scene asks for views of what near things hide and its engine can give them."""
    own = scene.potmesil_camera
    return bool(own.use_lens and own.depth_peeling != "OFF" and scene.render.engine == "CYCLES")


def peeled_views(
    scene: bpy.types.Scene, motion: SampledMotion, margins: tuple[int, int] = (0, 0)
) -> tuple[frozenset[str], ...]:
    """Return what each further view leaves out, at the rendered frame and with the lens as it is.

    Parameters
    ----------
    scene : Scene
        The scene; its *Depth Peeling* is not ``OFF``.
    motion : SampledMotion
        What is before the camera.
    margins : tuple of int
        Columns and rows by which the view is larger than the picture on each side.

    Returns
    -------
    tuple of frozenset of str
        Full names of objects to hide, what is nearest first; every view also leaves out what those
        before it do. None where there is nothing to leave out.
    """
    parts = _parts(motion, margins)
    if scene.potmesil_camera.depth_peeling == "COLLECTIONS":
        groups = _marked_groups(scene, motion, parts)
    else:
        groups = _automatic_groups(scene, motion, parts)
    views = []
    hidden: frozenset[str] = frozenset()
    for group in groups:
        # A collection may lie inside another one that is left out already.
        if not group <= hidden:
            hidden |= group
            views.append(hidden)
    return tuple(views)


@dataclass(frozen=True, slots=True)
class _Part:
    """Objects that are hidden together, and the depths between which they are in view.

    Parameters
    ----------
    names : frozenset of str
        Full names.
    line : tuple of str
        Names of the object and its parents, the topmost first.
    near, far : float
        One over the depth of its nearest and its farthest part, 1/m.
    around : bool
        Whether the camera is inside it.
    """

    names: frozenset[str]
    line: tuple[str, ...]
    near: float
    far: float
    around: bool

    @property
    def middle(self) -> float:
        """The middle of its circles, which are proportional to the inverse depths."""
        return 0.5 * (self.near + self.far)

    def is_large(self, farthest: float) -> bool:
        """Return whether it reaches from near to far, as the ground does, or around the camera."""
        return self.around or self.near - self.far > _LARGE * (self.near - farthest)


def _parts(motion: SampledMotion, margins: tuple[int, int]) -> list[_Part]:
    """Return what the camera sees, in parts that cannot be hidden apart from each other."""
    inverse = motion.boxes.inverse_depths(motion.camera, margins)
    around = motion.boxes.around(motion.camera)
    objects = {item.name_full: item for item in bpy.data.objects}
    together = _linked(motion.pairs)
    found: dict[frozenset[str], list[_Part]] = {}
    for owner, (near, far), inside in zip(motion.boxes.owners, inverse, around, strict=True):
        if np.isfinite(near) and objects[owner].visible_camera:
            names = together[owner]
            line = _line(objects[min(names)])
            found.setdefault(names, []).append(_Part(names, line, float(near), float(far), bool(inside)))
    return [_joined(instances) for instances in found.values()]


def _linked(pairs: Iterable[tuple[str, str | None]]) -> dict[str, frozenset[str]]:
    """Return, for each object and instancer, what cannot be hidden apart from it, itself included.

    An object that is seen itself and is also instanced elsewhere goes with its instancer.
    """
    pairs = set(pairs)
    together = {parent or name: frozenset({parent or name}) for name, parent in pairs}
    for name, parent in pairs:
        if parent is not None and (name, None) in pairs:
            both = together[name] | together[parent]
            together.update(dict.fromkeys(both, both))
    return together


def _line(item: bpy.types.Object) -> tuple[str, ...]:
    """Return the names of an object and its parents, the topmost first."""
    names = [item.name_full]
    while item.parent is not None:
        item = item.parent
        names.append(item.name_full)
    return tuple(reversed(names))


def _joined(parts: Sequence[_Part]) -> _Part:
    """Return parts as one."""
    return _Part(
        frozenset().union(*(part.names for part in parts)),
        parts[0].line,
        max(part.near for part in parts),
        min(part.far for part in parts),
        any(part.around for part in parts),
    )


def _automatic_groups(
    scene: bpy.types.Scene, motion: SampledMotion, parts: Sequence[_Part]
) -> list[frozenset[str]]:
    """Return what to leave out, nearest group first: families parted where their circles differ most.

    What is large or farthest stays: without the ground or the backdrop a view shows nothing of use.
    """
    if not parts:
        return []
    families = list(_families(parts, min(part.far for part in parts)))
    farthest = min(families, key=lambda family: family.far)
    peelable = sorted(
        (f for f in families if f is not farthest and not f.is_large(farthest.far)), key=lambda f: -f.middle
    )
    middles = [family.middle for family in peelable]
    # What stands behind all is where it is; of a ground that reaches from near to far the end counts.
    middles.append(farthest.middle if farthest.middle <= min(middles, default=np.inf) else farthest.far)
    depths = 1.0 / np.array(middles)
    circles = circle_of_confusion(depths, motion.lens, scene.potmesil_camera.coc_model)
    steps = np.abs(np.diff(circles)) / motion.camera.film.pitch_x
    largest = np.argsort(-steps, kind="stable")[: scene.potmesil_camera.peel_count]
    cuts = sorted(int(n) + 1 for n in largest if steps[n] >= _LEAST_STEP_PX)
    return [_joined(peelable[begin:cut]).names for begin, cut in itertools.pairwise([0, *cuts])]


def _families(parts: Sequence[_Part], farthest: float, generation: int = 1) -> Iterator[_Part]:
    """Keep objects together with their parents, but for families that reach from near to far."""
    by_ancestor: dict[tuple[str, ...], list[_Part]] = {}
    for part in parts:
        by_ancestor.setdefault(part.line[:generation], []).append(part)
    for members in by_ancestor.values():
        family = _joined(members)
        if len(members) > 1 and family.is_large(farthest):
            yield from _families(members, farthest, generation + 1)
        else:
            yield family


def _marked_groups(
    scene: bpy.types.Scene, motion: SampledMotion, parts: Sequence[_Part]
) -> list[frozenset[str]]:
    """Return the objects of each collection marked *Peel Off* that is in view, nearest first."""
    together = _linked(motion.pairs)
    instanced = {name for name, parent in motion.pairs if parent is not None}
    groups = []
    for collection in scene.collection.children_recursive:
        if not collection.potmesil_camera.peel:
            continue
        members = {item.name_full for item in collection.all_objects}
        # What is seen through its instancers alone would be gone from all of them.
        names = frozenset().union(
            *(together.get(name, {name}) for name in members if name in together or name not in instanced)
        )
        depths = [part.near for part in parts if part.names <= names]
        if depths:
            groups.append((max(depths), names))
    # Of two that begin with the same object the smaller one comes first.
    groups.sort(key=lambda group: (-group[0], len(group[1])))
    return [names for _, names in groups]
