"""Everything that Blender holds, written down to be compared: data, settings, handlers, classes, files."""

from __future__ import annotations

import hashlib
import math
import os
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any

import bpy
import numpy as np

from .conftest import PACKAGE

Dump = dict[str, Any]

RESULTS = ("Render Result", "Potmesil Result", "Potmesil Error", "Potmesil Guessed")
"""Images that exist to be replaced: Blender's render, and ours."""

OUR_STATE = ("error", "has_quality", "guessed_pixels", "expected_error")
"""What panels say about the last picture, kept with the window manager and never saved."""

WORKED_OUT = (
    # Of what is hidden, Blender works this out only when it is shown.
    r"^objects.*\.(matrix_world|matrix_local|bound_box|dimensions)$",
    # Undo reads the file anew, and counts users and notes what is its own later than reading does.
    r"\.users$",
    r"\.is_runtime_data$",
    # Of a scene that a script made, Blender 4.5 and 5.0 turn the cursor when they read it again.
    r"^scenes\['Potmesil Stage'\]\.cursor\.",
    # What tools note when they are first looked at.
    r"\.tool_settings\.(particle_edit\.object$|image_paint\.cavity_curve)",
)
"""What Blender itself leaves changed by any undo, as `besides` of `differences`."""

_PASSING = {
    # Blender counts these up, or makes them anew with every undo step and file.
    "session_uid",
    "tag",
    # What was evaluated, in memory that is no setting.
    "depsgraph",
    "is_evaluated",
    # When a file or a preview was last looked at.
    "is_dirty",
    "preview",
    "icon_id",
    # Which operators ran, what they were called with and what they said.
    "operators",
    "reports",
    "last_operator",
    # Blender notes here what it has drawn and heard of.
    "is_updated_data",
    "is_event_handling_break",
    # How Blender keeps a mesh's values in memory.
    "storage_type",
    # Known only once something was drawn.
    "gpu_preferred_device",
}
"""Properties that are no one's setting."""

_KINDS_APART = {
    # Of their own length: colours and sizes of the interface.
    "Theme",
    "ThemeStyle",
    "StudioLight",
    "KeyConfig",
    "KeyMap",
    "Depsgraph",
    "Event",
}
"""Types that are not walked through; keymaps are listed shortly below."""

_LISTED_APART = {
    # All that is in the other collections.
    "all_ids",
    # Without a window, Blender ends where a script reads regions that were never drawn.
    "screens",
}
"""Collections that are not walked through; of screens, what they show is listed below."""

_BASES = (
    "Operator",
    "Panel",
    "Menu",
    "Header",
    "UIList",
    "PropertyGroup",
    "RenderEngine",
    "GizmoGroup",
    "Gizmo",
    "AddonPreferences",
    "KeyingSetInfo",
    "AssetShelf",
    "FileHandler",
    "Node",
    "NodeSocket",
    "NodeTree",
)

_LONGEST = 16
"""More plain values than this are hashed."""


def dump(*, results: bool = False) -> Dump:
    """Return all there is as plain values by their paths.

    Parameters
    ----------
    results : bool
        Whether images that exist to be replaced, and what panels say about them, are written down too.

    Returns
    -------
    dict
        The values. The dump of the same scene is the same, and outlives undo and new files.
    """
    values: Dump = {}
    _known.clear()
    with warnings.catch_warnings():
        # Some properties say that a later Blender will not have them.
        warnings.simplefilter("ignore")
        for prop in bpy.data.bl_rna.properties:
            if prop.type == "COLLECTION" and prop.identifier not in _LISTED_APART:
                for item in getattr(bpy.data, prop.identifier):
                    if results or not (prop.identifier == "images" and item.name in RESULTS):
                        _Walk(values, f"{prop.identifier}[{item.name_full!r}]", item).run()
        _Walk(values, "preferences", bpy.context.preferences).run()
    for name in list(values):
        state = name.startswith("window_managers") and name.rpartition("potmesil_camera.")[2]
        if state and (state.endswith("(is set)") or (state in OUR_STATE and not results)):
            del values[name]
    for prefix, part in _OUTSIDE.items():
        values.update({f"{prefix}{key}": value for key, value in part().items()})
    return values


def differences(before: Dump, after: Dump, besides: Sequence[str] = ()) -> list[str]:
    """Return what differs between two dumps, a line for each.

    Parameters
    ----------
    before, after : dict
        The dumps.
    besides : sequence of str
        Regular expressions of paths that may differ.

    Returns
    -------
    list of str
        The path, what was there and what is there.
    """
    allowed = re.compile("|".join(besides) or r"(?!)")
    lines = []
    for key in sorted(before.keys() | after.keys()):
        if allowed.search(key):
            continue
        if key not in after:
            lines.append(f"{key}: gone (was {before[key]!r})")
        elif key not in before:
            lines.append(f"{key}: new ({after[key]!r})")
        elif before[key] != after[key]:
            lines.append(f"{key}: {before[key]!r} -> {after[key]!r}")
    return lines


class _Walk:
    """Writes down one block of data and all that belongs to it alone.

    Parameters
    ----------
    values : dict
        Takes the values.
    name : str
        Path of the block.
    item : bpy_struct
        The block.
    """

    def __init__(self, values: Dump, name: str, item: Any) -> None:
        self._values, self._name, self._item = values, name, item
        self._seen: dict[tuple[int, str], str] = {}

    def run(self) -> None:
        """Write it down."""
        self._struct(self._name, self._item)
        if isinstance(self._item, bpy.types.Object):
            for scene in bpy.data.scenes:
                for layer in scene.view_layers:
                    if self._item.name in layer.objects:
                        path = f"{self._name}@{scene.name}/{layer.name}"
                        self._values[path] = (
                            self._item.select_get(view_layer=layer),
                            self._item.hide_get(view_layer=layer),
                        )
        if isinstance(self._item, bpy.types.Image) and self._item.has_data:
            pixels = np.empty(len(self._item.pixels), dtype=np.float32)
            self._item.pixels.foreach_get(pixels)
            self._values[f"{self._name}.pixels"] = hashlib.sha1(pixels.tobytes()).hexdigest()

    def _struct(self, path: str, item: Any) -> None:
        key = item.as_pointer(), item.bl_rna.identifier
        if key in self._seen:
            self._values[path] = f"= {self._seen[key]}"
            return
        self._seen[key] = path
        if item.bl_rna.identifier in _KINDS_APART:
            return
        for prop in _properties(item.bl_rna):
            self._property(f"{path}.{prop.identifier}", item, prop)
        self._custom(path, item)

    def _property(self, path: str, item: Any, prop: Any) -> None:
        try:
            value = getattr(item, prop.identifier)
        except Exception as error:
            self._values[path] = f"{type(error).__name__}"
            return
        if prop.type == "POINTER":
            self._reference(path, value)
        elif prop.type == "COLLECTION":
            self._collection(path, value, prop)
        else:
            self._values[path] = plain(value)
            if prop.is_runtime and not prop.is_readonly and item.is_property_set(prop.identifier):
                self._values[f"{path} (is set)"] = True

    def _reference(self, path: str, value: Any) -> None:
        if value is None or not hasattr(value, "bl_rna"):
            self._values[path] = plain(value)
        elif isinstance(value, bpy.types.ID) and not (value.is_embedded_data and value is not self._item):
            self._values[path] = value.name_full
        else:
            self._struct(path, value)

    def _collection(self, path: str, items: Any, prop: Any) -> None:
        fixed = prop.fixed_type
        if isinstance(fixed, bpy.types.ID) or fixed.identifier in _KINDS_APART:
            self._values[path] = [None if item is None else getattr(item, "name_full", "") for item in items]
        else:
            # Of passes that were on for a while, Blender keeps sockets that are not there for anyone.
            items_there = [item for item in items if not _is_absent(item)]
            self._values[f"{path} (count)"] = len(items_there)
            for number, item in enumerate(items_there):
                self._reference(f"{path}[{number}]", item)
        # Such as what is active.
        for own in [] if prop.srna is None else _properties(prop.srna):
            name = f"{path}.{own.identifier}"
            value = getattr(items, own.identifier, None)
            if own.type == "COLLECTION":
                self._values[name] = [getattr(each, "name", "") for each in value or ()]
            elif own.type == "POINTER" and value is not None:
                key = value.as_pointer(), value.bl_rna.identifier
                self._values[name] = self._seen.get(key) or getattr(value, "name", "")
            else:
                self._values[name] = plain(value)

    def _custom(self, path: str, item: Any) -> None:
        try:
            names = list(item.keys())
        except (AttributeError, TypeError):
            return
        known = item.bl_rna.properties.keys()
        for name in names:
            if name not in known:
                self._values[f"{path}[{name!r}]"] = plain(item[name])


def _is_absent(item: Any) -> bool:
    return isinstance(item, bpy.types.NodeSocket) and not item.enabled


_known: dict[str, list[Any]] = {}
"""Of types that were met in this dump, the properties that are written down."""


def _properties(kind: Any) -> list[Any]:
    """Return the properties of a type that are written down."""
    if kind.identifier not in _known:
        names = {"rna_type", *_PASSING}
        _known[kind.identifier] = [prop for prop in kind.properties if prop.identifier not in names]
    return _known[kind.identifier]


def plain(value: Any) -> Any:
    """Return a value that outlives the data that it was read from, and is equal to itself."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else value
    if isinstance(value, str | int | bool | None):
        return value
    if isinstance(value, set | frozenset):
        return sorted(value)
    if isinstance(value, bytes):
        return hashlib.sha1(value).hexdigest()
    if isinstance(value, bpy.types.ID):
        return value.name_full
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if hasattr(value, "__len__"):
        values = [plain(each) for each in value]
        return values if len(values) <= _LONGEST else hashlib.sha1(repr(values).encode()).hexdigest()
    return type(value).__name__


def _handlers() -> Dump:
    """Return who is told of what, in order."""
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    return {
        name: [
            f"{getattr(each, '__module__', '')}.{getattr(each, '__qualname__', each)}" for each in functions
        ]
        for name, functions in lists.items()
        if isinstance(functions, list)
    }


def _timers() -> Dump:
    """Return which of our functions Blender will call."""
    return {
        f"{name}.{key}": True
        for name, module in list(sys.modules.items())
        if name.startswith(PACKAGE) and module is not None
        for key, value in vars(module).items()
        if isinstance(value, FunctionType) and bpy.app.timers.is_registered(value)
    }


def _classes() -> Dump:
    """Return the names of all registered classes of scripts."""
    found = {}
    for base in _BASES:
        kind = getattr(bpy.types, base, None)
        if kind is not None:
            # Blender's own appear as they are first used.
            found[base] = sorted(
                each.__name__
                for each in set(_below(kind))
                if each.__module__ != "bpy.types" and getattr(each, "is_registered", False)
            )
    return found


def _below(kind: type) -> Iterator[type]:
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)


def _keymaps() -> Dump:
    manager = bpy.context.window_manager
    return {
        f"{config.name}/{keymap.name}": [
            (item.idname, item.type, item.value, item.active) for item in keymap.keymap_items
        ]
        for config in manager.keyconfigs
        for keymap in config.keymaps
    }


def _screens() -> Dump:
    """Return what every screen shows."""
    return {
        screen.name: [
            (area.type, area.ui_type, getattr(getattr(area.spaces.active, "image", None), "name", None))
            for area in screen.areas
        ]
        for screen in bpy.data.screens
    }


def _properties_of_types() -> Dump:
    """Return the properties that scripts have added to Blender's own types."""
    kinds = ("Scene", "Object", "Collection", "WindowManager", "Camera", "ViewLayer", "Material", "World")
    return {
        kind: sorted(
            prop.identifier for prop in getattr(bpy.types, kind).bl_rna.properties if prop.is_runtime
        )
        for kind in kinds
    }


def _process() -> Dump:
    """Return what belongs to the process and not to the file."""
    return {
        "path": list(sys.path),
        "environment": dict(os.environ),
        "folder": str(Path.cwd()),
        "threads": sorted(thread.name for thread in threading.enumerate()),
        "files": sorted(path.name for path in Path(tempfile.gettempdir()).glob("potmesil*")),
        "children": children(),
        "context": [
            getattr(getattr(bpy.context, name, None), "name", None)
            for name in ("scene", "view_layer", "collection", "object", "active_object", "workspace")
        ],
        "mode": bpy.context.mode,
        "drivers": sorted(bpy.app.driver_namespace.keys()),
        "loaded": bpy.data.filepath,
        "draws": len(_draws()),
    }


def _draws() -> list[Any]:
    """Return what our module of the viewport draws with: Blender lists draw handlers nowhere."""
    module = sys.modules.get(f"{PACKAGE}.ui.viewport")
    return [] if module is None else module._handlers


def children() -> list[str]:
    """Return the processes that this one has started and that run, as far as the system tells."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        state, parent, *_ = rest.split()
        if int(parent) == os.getpid() and state != "Z":
            found.append(name.partition("(")[2])
    return sorted(found)


_OUTSIDE: dict[str, Callable[[], Dump]] = {
    "handlers: ": _handlers,
    "timers: ": _timers,
    "classes: ": _classes,
    "keymaps: ": _keymaps,
    "screens: ": _screens,
    "types: ": _properties_of_types,
    "process: ": _process,
}
