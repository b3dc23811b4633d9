"""The compositor stage: node groups that stand where the scene's Render Layers nodes stood.

A stage is three nodes for each Render Layers node, which know each other by a number:

- *samples*, the Render Layers node itself, out of the way and connected to nothing. While it is there and
  not muted, F12 renders the scene.
- *picture*, a Render Layers node of the stage's own scene. That scene holds nothing: its engine (see
  `stage_render`) hands over the processed picture and the passes of the samples.
- the *group*, which stands where the Render Layers node stood, with its outputs under their names.

Render Layers nodes may stand in a tree's top level only, hence the picture's node beside the group.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..potmesil_addon.errors import InputError
from . import compat

ENGINE = "POTMESIL_STAGE"

PASSES = "potmesil_passes"
"""Custom property of the stage's view layers: what their engine hands over, as JSON."""

_KEY, _ROLE, _BEFORE = "potmesil_stage", "potmesil_role", "potmesil_before"
_NAME = "Potmesil Stage"
_SAMPLES, _PICTURE, _GROUP = "samples", "picture", "group"
_LABELS = {_SAMPLES: "Samples", _PICTURE: "Processed"}
_COMPONENTS = {"Depth": "Z", "UV": "UVA", "Vector": "XYZW"}
_ASIDE = 260.0
"""How far left of the group the nodes behind it stand."""

_BELOW = 45.0
"""From one of them down to the next."""

_BORROWED = (("render", "use_compositing", True), ("render", "use_lock_interface", True))
"""What a stage needs of the scene while it is there: what it is in, its name, its value."""


class POTMESIL_OT_add_stage(bpy.types.Operator):
    """Put the processed picture where the compositor's Render Layers nodes are, or update its passes"""

    bl_idname = "potmesil.add_stage"
    bl_label = "Add Stage"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it, or say in one sentence why not."""
        try:
            said = add_stage(context.scene)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, said)
        return {"FINISHED"}


class POTMESIL_OT_remove_stage(bpy.types.Operator):
    """Put the compositor back to how it was without the stage"""

    bl_idname = "potmesil.remove_stage"
    bl_label = "Remove Stage"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is one."""
        return stage_scene(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it, or say in one sentence why not."""
        try:
            remove_stage(context.scene)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


@dataclass(frozen=True, slots=True)
class Trio:
    """The nodes of a stage that belong together.

    Parameters
    ----------
    samples : Node
        The Render Layers node of the scene.
    picture : Node
        That of the stage's scene.
    groups : tuple of Node
        The node that stands in its place, and copies of it.
    """

    samples: Any
    picture: Any
    groups: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Pass:
    """A pass that the stage's engine hands over.

    Parameters
    ----------
    name : str
        As sockets and files have it.
    components : str
        Letters of its channels.
    kind : {"COLOR", "VALUE", "VECTOR"}
        Of its socket.
    """

    name: str
    components: str
    kind: str


COMBINED = Pass("Combined", "RGBA", "COLOR")


def stage_scene(scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """Return the stage's own scene, or None where a scene has no stage."""
    for other in bpy.data.scenes:
        if other.potmesil_camera.stage_of == scene and other.render.engine == ENGINE:
            return other
    return None


def trios(scene: bpy.types.Scene) -> list[Trio]:
    """Return the nodes of a scene's stage as far as they are whole."""
    tree, own = compat.compositor_tree(scene), stage_scene(scene)
    if tree is None or own is None:
        return []
    found: dict[tuple[int, str], list[Any]] = {}
    for node in tree.nodes:
        if _KEY in node:
            found.setdefault((node[_KEY], node[_ROLE]), []).append(node)
    whole = []
    for (key, role), nodes in found.items():
        samples = [n for n in found.get((key, _SAMPLES), []) if n.scene == scene]
        pictures = [n for n in found.get((key, _PICTURE), []) if n.scene == own]
        if role == _GROUP and samples and pictures:
            whole.append(Trio(samples[0], pictures[0], tuple(nodes)))
    return whole


def layers(scene: bpy.types.Scene) -> dict[str, str]:
    """Return the scene's view layers that its stage shows, by the names of the stage's own."""
    return {trio.picture.layer: trio.samples.layer for trio in trios(scene)}


def rendering_nodes(scene: bpy.types.Scene) -> list[Any]:
    """Return the nodes for which F12 renders a scene; without any it runs the compositor alone."""
    tree = compat.compositor_tree(scene)
    return [] if tree is None else [node for node in tree.nodes if _shows(node, scene)]


def add_stage(scene: bpy.types.Scene) -> str:
    """Put groups in the place of the scene's Render Layers nodes.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    str
        What was done, as a sentence for the artist.

    Raises
    ------
    InputError
        If it cannot be done; nothing has changed then.
    """
    _refuse(scene)
    tree = compat.compositor_tree(scene)
    made = tree is None or not tree.nodes
    known = {trio.samples.name for trio in trios(scene)}
    used = {layer.name for layer in scene.view_layers if layer.use}
    fresh: list[Any] = []
    if not made:
        assert tree is not None
        _mend(scene)
        fresh = [n for n in tree.nodes if _shows(n, scene) and n.name not in known and n.layer in used]
        if not fresh and not known:
            raise InputError("The compositor has no Render Layers node of this scene; add one first.")
    own = stage_scene(scene) or _make_scene(scene, made=made)
    if made:
        tree = compat.make_compositor_tree(scene)
        fresh = [node for node in tree.nodes if _shows(node, scene)]
    active, selected = tree.nodes.active, [node for node in tree.nodes if node.select]
    for node in fresh:
        _replace(tree, node, own)
    for trio in trios(scene):
        _update(tree, trio, own)
    for node in tree.nodes:
        node.select = node in selected
    tree.nodes.active = active
    if made:
        return n_("A compositor tree was made, with the stage in it")
    if len(fresh) == 1:
        return n_("The stage stands in the place of 1 Render Layers node")
    if fresh:
        text = rpt_("The stage stands in the place of {count} Render Layers nodes")
        return text.format(count=len(fresh))
    return n_("The stage was there; its passes are up to date")


def remove_stage(scene: bpy.types.Scene) -> None:
    """Put the scene's compositor tree back to how it was without the stage.

    Nodes and links that the artist added or changed since stay so.

    Parameters
    ----------
    scene : Scene
        The scene.

    Raises
    ------
    InputError
        If the tree cannot be changed.
    """
    _refuse(scene)
    own = stage_scene(scene)
    if own is None:
        raise InputError("The scene has no stage.")
    tree = compat.compositor_tree(scene)
    before = json.loads(own[_BEFORE])
    if tree is not None:
        _mend(scene)
        for trio in trios(scene):
            _restore(tree, trio)
        if before["made"] and len(tree.nodes) == 2:
            compat.remove_compositor_tree(scene)
    for owner, name, value in before["settings"]:
        setattr(getattr(scene, owner) if owner else scene, name, value)
    for item in list(own.collection.objects):
        camera = item.data
        bpy.data.objects.remove(item)
        bpy.data.cameras.remove(camera)
    bpy.data.scenes.remove(own)


def _shows(node: Any, scene: bpy.types.Scene) -> bool:
    """Return whether a node makes Blender render a scene."""
    return node.bl_idname == "CompositorNodeRLayers" and node.scene == scene and not node.mute


def _refuse(scene: bpy.types.Scene) -> None:
    """Raise InputError where a scene's tree cannot be changed, or where others would be changed with it."""
    tree = compat.compositor_tree(scene)
    if scene.library is not None or scene.override_library is not None:
        text = rpt_("The scene '{name}' is linked from another file; make it local first.")
        raise InputError(text.format(name=scene.name))
    if scene.render.engine == ENGINE:
        text = rpt_("'{name}' is a stage's own scene; go to the scene that it belongs to.")
        raise InputError(text.format(name=scene.name))
    if tree is None or not getattr(tree, "users", 0):
        return
    if tree.library is not None or tree.override_library is not None:
        text = rpt_("The compositor tree '{name}' is linked from another file; make it local first.")
        raise InputError(text.format(name=tree.name))
    others = [o for o in bpy.data.scenes if o != scene and compat.compositor_tree(o) == tree]
    if others:
        text = rpt_(
            "The compositor tree '{name}' is shared with the scene '{other}'; make it a single-user copy "
            "first."
        )
        raise InputError(text.format(name=tree.name, other=others[0].name))


def _make_scene(scene: bpy.types.Scene, *, made: bool) -> bpy.types.Scene:
    """Make the stage's own scene: empty but for the camera that Blender asks for."""
    own = bpy.data.scenes.new(_NAME)
    own.render.engine = ENGINE
    own.potmesil_camera.stage_of = scene
    camera = bpy.data.objects.new(_NAME, bpy.data.cameras.new(_NAME))
    own.collection.objects.link(camera)
    own.camera = camera
    settings = []
    for owner, name, value in (*_BORROWED, *compat.compositor_switches(scene)):
        holder: Any = getattr(scene, owner) if owner else scene
        settings.append((owner, name, getattr(holder, name)))
        if getattr(holder, name) != value:
            setattr(holder, name, value)
    own[_BEFORE] = json.dumps({"made": made, "settings": settings})
    return own


def _replace(tree: Any, node: Any, own: bpy.types.Scene) -> None:
    """Put a group in the place of a Render Layers node, and the node aside."""
    key = 1 + max((other[_KEY] for other in tree.nodes if _KEY in other), default=0)
    was = {"location": list(node.location), "hide": node.hide, "label": node.label, "mute": node.mute}
    inner = bpy.data.node_groups.new(_NAME, "CompositorNodeTree")
    inner.nodes.new("NodeGroupInput").location.x = -200.0
    inner.nodes.new("NodeGroupOutput").location.x = 200.0
    group = tree.nodes.new("CompositorNodeGroup")
    group.node_tree = inner
    # The first view layer is there from the beginning.
    layer = own.view_layers[0] if PASSES not in own.view_layers[0] else own.view_layers.new("Layer")
    layer.name = node.layer
    _tell_passes(layer, node)
    picture = tree.nodes.new("CompositorNodeRLayers")
    picture.scene = own
    picture.layer = layer.name
    for each in (group, picture):
        each.parent = node.parent
    group.location, group.width = node.location, node.width
    group.label = node.label or _NAME
    for place, (each, role) in enumerate(((picture, _PICTURE), (node, _SAMPLES))):
        each.location = (was["location"][0] - _ASIDE, was["location"][1] - _BELOW * place)
        each.hide = True
        each.label = _LABELS[role]
    for each, role in ((group, _GROUP), (picture, _PICTURE), (node, _SAMPLES)):
        each[_KEY], each[_ROLE] = key, role
    node[_BEFORE] = json.dumps(was)


def _update(tree: Any, trio: Trio, own: bpy.types.Scene) -> None:
    """Give a stage the passes that its Render Layers node has now, and the links that hang on that node."""
    sockets = [socket for socket in trio.samples.outputs if socket.enabled]
    _tell_passes(own.view_layers[trio.picture.layer], trio.samples)
    # Blender looks for new passes when a node is told its layer, and not in other scenes' trees.
    trio.picture.layer = trio.picture.layer
    for group in trio.groups:
        inner = group.node_tree
        for direction in ("INPUT", "OUTPUT"):
            there = {item.name for item in _items(inner, direction)}
            for socket in sockets:
                if socket.name not in there:
                    compat.new_interface_socket(inner, socket, direction)
        start, end = (_node(inner, kind) for kind in ("NodeGroupInput", "NodeGroupOutput"))
        for socket in sockets:
            if not end.inputs[socket.name].is_linked:
                inner.links.new(start.outputs[socket.name], end.inputs[socket.name])
            if not group.inputs[socket.name].is_linked and socket.name in trio.picture.outputs:
                tree.links.new(trio.picture.outputs[socket.name], group.inputs[socket.name])
            group.outputs[socket.name].hide = socket.hide
    _move_links(tree, trio.samples, trio.groups[0])


def _restore(tree: Any, trio: Trio) -> None:
    """Put a Render Layers node back into its place, and remove what stood there."""
    group = trio.groups[0]
    was = json.loads(trio.samples[_BEFORE])
    for each in trio.groups:
        _move_links(tree, each, trio.samples)
    for socket in trio.samples.outputs:
        if socket.name in group.outputs:
            socket.hide = group.outputs[socket.name].hide
    # Where the group was moved, its node goes along.
    trio.samples.parent = group.parent
    _put_back(trio.samples)
    trio.samples.location = group.location
    if group.label not in (_NAME, was["label"]):
        trio.samples.label = group.label
    _remove_nodes(tree, [*trio.groups, trio.picture])


def _remove_nodes(tree: Any, nodes: list[Any]) -> None:
    """Remove nodes, and the groups' own trees that nothing else uses."""
    inner = {node.node_tree for node in nodes if getattr(node, "node_tree", None) is not None}
    for node in nodes:
        tree.nodes.remove(node)
    for each in inner:
        if not each.users:
            bpy.data.node_groups.remove(each)


def _put_back(node: Any) -> None:
    """Give a Render Layers node its own look again."""
    was = json.loads(node[_BEFORE])
    node.location = was["location"]
    node.hide, node.label, node.mute = was["hide"], was["label"], was["mute"]
    for name in (_KEY, _ROLE, _BEFORE):
        del node[name]


def _mend(scene: bpy.types.Scene) -> None:
    """Take apart what is no whole stage any more: parts deleted, nodes copied, a copied scene's tree."""
    tree = compat.compositor_tree(scene)
    assert tree is not None
    whole = trios(scene)
    kept = {node.name for trio in whole for node in (trio.samples, trio.picture, *trio.groups)}
    broken = [node for node in tree.nodes if _KEY in node and node.name not in kept]
    for samples in [node for node in broken if node[_ROLE] == _SAMPLES]:
        for group in [node for node in broken if node[_ROLE] == _GROUP and node[_KEY] == samples[_KEY]]:
            _move_links(tree, group, samples)
        _put_back(samples)
    _remove_nodes(tree, [node for node in broken if node.get(_ROLE) in (_PICTURE, _GROUP)])


def _move_links(tree: Any, old: Any, new: Any) -> None:
    """Let what hangs on a node's outputs hang on those of another node with the same names."""
    names = {socket.name: socket for socket in new.outputs if socket.enabled}
    for link in [link for link in tree.links if link.from_node == old and link.from_socket.enabled]:
        target = names.get(link.from_socket.name)
        if target is None:
            continue
        to_socket, muted, hidden = link.to_socket, link.is_muted, link.to_socket.hide
        tree.links.remove(link)
        made = tree.links.new(target, to_socket)
        made.is_muted = muted
        if hidden:
            to_socket.hide = True


def _tell_passes(layer: bpy.types.ViewLayer, node: Any) -> None:
    """Let the engine hand over the passes of a Render Layers node."""
    found = [_pass_of(socket) for socket in node.outputs if socket.enabled and socket.name != "Alpha"]
    layer[PASSES] = json.dumps([(each.name, each.components, each.kind) for each in found])


def _pass_of(socket: Any) -> Pass:
    """Return the pass that a Render Layers node's socket shows."""
    kind = {"RGBA": "COLOR", "VALUE": "VALUE", "VECTOR": "VECTOR"}[socket.type]
    if socket.name == "Image":
        return COMBINED
    name = socket.name
    plain = {"COLOR": "RGBA", "VALUE": "X", "VECTOR": "XYZ"}[kind]
    return Pass(name, _COMPONENTS.get(name, plain), kind)


def passes(view_layer: bpy.types.ViewLayer) -> list[Pass]:
    """Return what the stage's engine hands over for a view layer of its scene."""
    return [Pass(*each) for each in json.loads(view_layer.get(PASSES, "[]"))]


def _items(inner: Any, direction: str) -> Iterator[Any]:
    """Yield the inputs or the outputs of a group's interface."""
    for item in inner.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == direction:
            yield item


def _node(inner: Any, kind: str) -> Any:
    """Return a group's node of a kind, made where the artist removed it."""
    return next((node for node in inner.nodes if node.bl_idname == kind), None) or inner.nodes.new(kind)
