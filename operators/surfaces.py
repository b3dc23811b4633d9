"""What objects do to light, by their materials' nodes: whether they are mirrors, glass, or neither."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import bpy

from ..potmesil_addon.surfaces import SurfaceKind
from .scene import rendered_objects

_USUAL_IOR: Final = 1.45
"""Of glass whose material does not say it, or lets it vary."""

_LEAST_ALPHA = 1e-3

_RANK = (
    SurfaceKind.CLEAR,
    SurfaceKind.ROUGH,
    SurfaceKind.POLISHED,
    SurfaceKind.MIRROR,
    SurfaceKind.GLASS,
)
"""Of two surfaces mixed, the later one is what counts."""


@dataclass(frozen=True, slots=True)
class Surface:
    """What light does at an object.

    Parameters
    ----------
    kinds : tuple of SurfaceKind
        One for each material slot; one where there are no slots.
    ior : float
        Index of refraction of the first slot that is glass.
    """

    kinds: tuple[SurfaceKind, ...]
    ior: float


@dataclass(frozen=True, slots=True)
class _Shader:
    """What a shader does.

    Parameters
    ----------
    kind : SurfaceKind
        What light does there.
    ior : float or None
        Index of refraction, where the shader has one that is the same everywhere.
    albedo : float
        Share of light that it scatters, as far as that is known, else 1.
    """

    kind: SurfaceKind
    ior: float | None = None
    albedo: float = 1.0


_ROUGH = _Shader(SurfaceKind.ROUGH)


def surface_of(item: bpy.types.Object, limit: float) -> Surface:
    """Return what light does at an object.

    Parameters
    ----------
    item : Object
        Its own choice of a surface wins over its materials.
    limit : float
        Roughness up to which something is a mirror or glass.

    Returns
    -------
    Surface
        Kinds of all slots, and the index of refraction.
    """
    return _surface_of(item, _Materials(limit))


def reflecting_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the rendered objects that are mirrors, glass or polished somewhere, in the order of their names.

    Parameters
    ----------
    scene : Scene
        Its roughness limit counts.

    Returns
    -------
    list of Object
        Objects, which hidden ones are not among.
    """
    materials = _Materials(scene.potmesil_camera.max_roughness)
    dull = {SurfaceKind.ROUGH, SurfaceKind.CLEAR}
    objects = rendered_objects(scene)
    return [item for item in objects if not dull.issuperset(_surface_of(item, materials).kinds)]


def _surface_of(item: bpy.types.Object, materials: _Materials) -> Surface:
    shaders = [materials.shader(slot.material) for slot in item.material_slots] or [_ROUGH]
    kinds = tuple(shader.kind for shader in shaders)
    known = [shader for shader in shaders if shader.ior is not None]
    iors = [shader.ior for shader in known if shader.kind == SurfaceKind.GLASS]
    chosen = item.potmesil_camera.surface
    if chosen != "AUTO":
        kinds = (SurfaceKind.ROUGH if chosen == "OPAQUE" else SurfaceKind[chosen],) * len(kinds)
        # What the artist alone calls glass may still have a material that says it.
        iors += [shader.ior for shader in known]
    return Surface(kinds, iors[0] if iors else _USUAL_IOR)


class _Materials:
    """Follows the nodes of materials, of each only once.

    Nodes must not change while it is used. Where a path into node groups is asked for, it is the group nodes
    that were entered, the outermost first.

    Parameters
    ----------
    limit : float
        Roughness up to which something is a mirror or glass.
    """

    def __init__(self, limit: float) -> None:
        # Blender stores four bytes: what is set to the limit itself must be within it.
        self._limit = limit + 1e-6
        self._materials: dict[int, _Shader] = {}
        self._shaders: dict[tuple[int, ...], _Shader | None] = {}
        self._links: dict[int, dict[int, bpy.types.NodeLink]] = {}

    def shader(self, material: bpy.types.Material | None) -> _Shader:
        """Return what a material does; an empty slot is rough."""
        if material is None:
            return _ROUGH
        key = material.as_pointer()
        if key not in self._materials:
            self._materials[key] = self._material(material)
        return self._materials[key]

    def _material(self, material: bpy.types.Material) -> _Shader:
        tree = material.node_tree
        # Asking newer releases warns, and all their materials have nodes.
        if tree is None or (bpy.app.version < (5, 0, 0) and not material.use_nodes):
            # Cycles draws it diffuse, however metallic it is.
            return _ROUGH
        output = tree.get_output_node("CYCLES")
        if output is None:
            return _ROUGH
        surface = self._followed_shader(output.inputs["Surface"], ())
        if surface is not None:
            return surface
        volume, _ = self._source(output.inputs["Volume"], ())
        return _Shader(SurfaceKind.CLEAR) if volume.is_output else _ROUGH

    def _is_smooth(self, roughness: float | None) -> bool:
        """Return whether a roughness is within the limit; one that varies (None) may be somewhere."""
        return roughness is None or roughness <= self._limit

    def _followed_shader(
        self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]
    ) -> _Shader | None:
        """Return what the shader linked to a socket does, or None where there is none."""
        source, path = self._source(socket, path)
        if not source.is_output:
            return None
        # Many mixtures may share a shader, and groups their nodes.
        key = (source.as_pointer(), *(group.as_pointer() for group in path))
        if key not in self._shaders:
            self._shaders[key] = self._shader(source.node, path)
        return self._shaders[key]

    def _shader(self, node: bpy.types.Node, path: tuple[bpy.types.Node, ...]) -> _Shader | None:
        """Return what a node that makes a shader does."""

        def number(name: str) -> float | None:
            return self._number(node.inputs.get(name), path)

        match node.type:
            case "MIX_SHADER" | "ADD_SHADER":
                first, second = (self._followed_shader(socket, path) for socket in list(node.inputs)[-2:])
                is_mix = node.type == "MIX_SHADER"
                share = self._number(node.inputs[0], path) if is_mix else None
                return _mixed(first, second, share, self._facing(node.inputs[0], path) if is_mix else None)
            case "BSDF_DIFFUSE":
                return _Shader(SurfaceKind.ROUGH, albedo=self._albedo(node.inputs["Color"], path))
            case "BSDF_PRINCIPLED":
                return self._principled(number, self._albedo(node.inputs["Base Color"], path))
            case "BSDF_GLASS" | "BSDF_REFRACTION":
                is_smooth = self._is_smooth(number("Roughness"))
                return _Shader(SurfaceKind.GLASS if is_smooth else SurfaceKind.ROUGH, number("IOR"))
            case "BSDF_GLOSSY" | "BSDF_METALLIC":
                return _Shader(SurfaceKind.MIRROR) if self._is_smooth(number("Roughness")) else _ROUGH
            case "BSDF_TRANSPARENT":
                return _Shader(SurfaceKind.CLEAR)
        return _ROUGH

    def _principled(self, number: Any, albedo: float) -> _Shader:
        """Return what a Principled BSDF does.

        Parameters
        ----------
        number : callable
            Gives the value of an input by its name, None where it varies.
        albedo : float
            Of its base.

        Returns
        -------
        _Shader
            Polish that reflects more than what is below it scatters is a mirror.
        """

        def exceeds(name: str, least: float) -> bool:
            value = number(name)
            return value is None or value > least

        ior, metallic = number("IOR"), number("Metallic")
        kind = SurfaceKind.ROUGH
        if not exceeds("Alpha", _LEAST_ALPHA):
            kind = SurfaceKind.CLEAR
        elif self._is_smooth(number("Roughness")):
            if metallic is not None and metallic > 0.5:
                kind = SurfaceKind.MIRROR
            elif exceeds("Transmission Weight", 0.5):
                kind = SurfaceKind.GLASS
            # Metal only here and there is polished in any case.
            elif metallic is None or exceeds("Specular IOR Level", 0.0):
                level = number("Specular IOR Level")
                dark = metallic == 0.0 and level is not None and 2.0 * level * _reflectance(ior) > albedo
                kind = SurfaceKind.MIRROR if dark else SurfaceKind.POLISHED
        if kind == SurfaceKind.ROUGH:
            if exceeds("Coat Weight", 0.0) and self._is_smooth(number("Coat Roughness")):
                kind = SurfaceKind.POLISHED
        return _Shader(kind, ior, albedo if metallic == 0.0 else 1.0)

    def _albedo(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> float:
        """Return the largest part of a colour, 1 where it varies."""
        source, _ = self._source(socket, path)
        value = getattr(source, "default_value", None)
        if value is None or (source.is_output and source.node.type not in {"RGB", "VALUE"}):
            return 1.0
        # A group may take the colour from a number.
        return float(value) if isinstance(value, (int, float)) else max(list(value)[:3])

    def _facing(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> float | None:
        """Return what a Fresnel node is where the surface is seen from the front, None for another one."""
        source, path = self._source(socket, path)
        if not source.is_output or source.node.type != "FRESNEL":
            return None
        return _reflectance(self._number(source.node.inputs["IOR"], path))

    def _number(self, socket: bpy.types.NodeSocket | None, path: tuple[bpy.types.Node, ...]) -> float | None:
        """Return the value of an input, or None where it varies; 0 for one that Blender does not have."""
        if socket is None:
            return 0.0
        source, _ = self._source(socket, path)
        if source.is_output and source.node.type != "VALUE":
            return None
        value = getattr(source, "default_value", None)
        return float(value) if isinstance(value, (bool, int, float)) and math.isfinite(value) else None

    def _source(
        self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]
    ) -> tuple[bpy.types.NodeSocket, tuple[bpy.types.Node, ...]]:
        """Return what an input gets its value from, and the path there.

        Parameters
        ----------
        socket : NodeSocket
            An input.
        path : tuple of Node
            Group nodes around it.

        Returns
        -------
        NodeSocket
            The output of a node that makes something itself, past reroutes, muted nodes and the borders of
            groups; or an input whose own value counts, as nothing is linked to it.
        tuple of Node
            Group nodes around that.
        """
        while True:
            link = self._links_into(socket.id_data).get(socket.as_pointer())
            if link is None:
                return socket, path
            node, output = link.from_node, link.from_socket
            tree = getattr(node, "node_tree", None)
            if node.type == "REROUTE":
                inner = node.inputs[0]
            elif node.mute:
                ways = (way.from_socket for way in node.internal_links if way.to_socket == output)
                inner = next(ways, None)
            elif node.type == "GROUP_INPUT" and path:
                inner = _same(path[-1].inputs, output)
                path = path[:-1]
            elif tree is not None:
                ends = (end for end in tree.nodes if end.type == "GROUP_OUTPUT" and end.is_active_output)
                end = next(ends, None)
                inner = None if end is None else _same(end.inputs, output)
                path = (*path, node)
            else:
                return output, path
            if inner is None:
                # Nothing comes this way: as without the link.
                return socket, path
            socket = inner

    def _links_into(self, tree: bpy.types.NodeTree) -> dict[int, bpy.types.NodeLink]:
        """Return a tree's links by the inputs they go into.

        A socket's own links are slow: it looks through all those of the tree.
        """
        key = tree.as_pointer()
        if key not in self._links:
            # Those that go round in a circle are not valid.
            used = (link for link in tree.links if link.is_valid and not link.is_muted)
            self._links[key] = {link.to_socket.as_pointer(): link for link in used}
        return self._links[key]


def _same(sockets: Any, wanted: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """Return the socket on the other side of a group's border."""
    return next((socket for socket in sockets if socket.identifier == wanted.identifier), None)


def _reflectance(ior: float | None) -> float:
    """Return what share of light is reflected back where a surface with an index of refraction faces it."""
    return 0.0 if ior is None else ((ior - 1.0) / (ior + 1.0)) ** 2


def _mixed(
    first: _Shader | None, second: _Shader | None, share: float | None, facing: float | None
) -> _Shader | None:
    """Return what two shaders do together.

    Parameters
    ----------
    first, second : _Shader or None
        The shaders; ``None`` for nothing linked.
    share : float or None
        The second one's, or ``None`` where it varies or both are added.
    facing : float or None
        The second one's where the surface is seen from the front, as far as that is known.

    Returns
    -------
    _Shader or None
        The one that counts. A mirror over something else is polished, unless it reflects more than the other
        scatters.
    """
    if share is not None and share <= 0.0:
        return first
    if share is not None and share >= 1.0:
        return second
    if first is None or second is None:
        return first or second
    low, high = sorted((first, second), key=lambda shader: _RANK.index(shader.kind))
    ior = high.ior if high.ior is not None or high.kind == SurfaceKind.GLASS else low.ior
    if high.kind == SurfaceKind.MIRROR and low.kind in {SurfaceKind.ROUGH, SurfaceKind.POLISHED}:
        known = facing if share is None else share
        if known is not None and high is not second:
            known = 1.0 - known
        most = known is not None and known > (1.0 - known) * low.albedo
        return _Shader(SurfaceKind.MIRROR if most else SurfaceKind.POLISHED, ior, low.albedo)
    return _Shader(high.kind, ior, max(first.albedo, second.albedo))
