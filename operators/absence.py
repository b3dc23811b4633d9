"""Objects that are not there for a render: their shadow and their light on others are gone as well."""

from __future__ import annotations

from collections.abc import Collection

import bpy

from .animation import curves_of
from .borrow import Borrowed

_RAYS = (
    "visible_camera",
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)
"""Blender's flags of the kinds of rays that an object exists for."""


def absent(borrowed: Borrowed, scene: bpy.types.Scene, names: Collection[str]) -> None:
    """Let objects, and the instances of instancers, exist for no ray until they are given back.

    Parameters
    ----------
    borrowed : Borrowed
        Remembers what the settings were.
    scene : Scene
        The scene that is rendered.
    names : collection of str
        Full names.
    """
    _hide_from(borrowed, scene, names, _RAYS)


def hidden_from_camera(borrowed: Borrowed, scene: bpy.types.Scene, names: Collection[str]) -> None:
    """Hide objects, and the instances of instancers, from the camera; they still cast shadows and light.

    Parameters
    ----------
    borrowed, scene, names
        As for `absent`.
    """
    _hide_from(borrowed, scene, names, ("visible_camera",))


def _hide_from(
    borrowed: Borrowed, scene: bpy.types.Scene, names: Collection[str], flags: Collection[str]
) -> None:
    # A render that keeps its data would not notice what nothing is told of.
    borrowed.set(scene.render, "use_persistent_data", False)
    animated = [
        item for item in bpy.data.objects if item.name_full in names and item.animation_data is not None
    ]
    for flag in flags:
        for item in animated:
            for curve in curves_of(item, flag):
                borrowed.set(curve, "mute", True)
        borrowed.set(_RayVisibility(flag), "seen", dict.fromkeys(names, False))


class _RayVisibility:
    """Which objects exist for a kind of rays, as one setting of all objects.

    Changed one by one, each object would be taken for edited, and its physics would start again.

    Parameters
    ----------
    flag : str
        Blender's name of the kind of rays.
    """

    id_data = None
    """What animates it is muted object by object."""

    def __init__(self, flag: str) -> None:
        self._flag = flag

    @property
    def seen(self) -> dict[str, bool]:
        """Whether each object exists for the rays, by its full name."""
        objects = bpy.data.objects
        values = [False] * len(objects)
        objects.foreach_get(self._flag, values)
        return dict(zip((item.name_full for item in objects), values, strict=True))

    @seen.setter
    def seen(self, values: dict[str, bool]) -> None:
        objects = bpy.data.objects
        now = {**self.seen, **values}
        objects.foreach_set(self._flag, [now[item.name_full] for item in objects])
        # Setting all leaves out what is linked from other files.
        for item in objects:
            if getattr(item, self._flag) != now[item.name_full]:
                setattr(item, self._flag, now[item.name_full])
