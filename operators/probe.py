"""Probes: renders of one sample a pixel that say what mirrors and glass show, and where.

Every material is replaced by one that goes on through a perfect reflection or refraction where a surface is
a mirror or glass, and gives what is asked for as light: at each hit how long the ray was, and where its path
ends, what is there. All is done in a copy of the scene with a camera of its own; of the artist's, objects
carry three numbers while it lasts, and lamps are not seen by rays.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..potmesil_addon.surfaces import SurfaceKind, packed
from . import compat
from .borrow import Borrowed
from .motion import SampledMotion
from .scene import RENDERED_TYPES, render_graph, rendered_objects
from .surfaces import surface_of

SURFACES: Final = "potmesil_surfaces"
INDEX_OF_REFRACTION: Final = "potmesil_ior"
NUMBER: Final = "potmesil_number"
"""What objects carry while a probe renders, for the material to read."""

NOWHERE: Final = -1
"""Number of what is infinitely far away."""

_GLASS_STEP, _NUMBER_STEP = 32, 1024
"""As `specular` has them, which is not loaded at Blender's start."""

_FILTER_WIDTH = 0.01
_MOST_BOUNCES = 24
_SLOTS = 8

_LAMP_FACETS = 16
_FAR = 10.0
"""Metres at which a lens that is focused at infinity is taken to look."""


@dataclass(frozen=True, slots=True)
class ProbeView:
    """One render of the probe.

    Parameters
    ----------
    light : {"reflected", "transmitted"}
        What happens where a path of light from the camera first meets a surface.
    gives : {"path", "place"}
        Length, number of the object at the end and bounces; or the place of the end.
    shift : int
        0 for the camera where it is, 1 for it shifted to the right, 2 upwards.
    """

    light: str
    gives: str
    shift: int = 0


VIEWS: Final = {
    light: (
        ProbeView(light, "path"),
        ProbeView(light, "place"),
        ProbeView(light, "place", 1),
        ProbeView(light, "place", 2),
    )
    for light in ("reflected", "transmitted")
}
"""What is rendered to know one kind of light."""


class ProbeScene:
    """A copy of a scene in which probes are rendered; as a context manager it leaves nothing behind.

    Parameters
    ----------
    scene : Scene
        The scene, set up for samples.
    motion : SampledMotion
        Its camera and lens.
    """

    def __init__(self, scene: bpy.types.Scene, motion: SampledMotion) -> None:
        self._original = scene
        self._motion = motion
        self._made: list[bpy.types.ID] = []
        self._marked: list[bpy.types.Object] = []
        self.names: dict[int, str] = {}
        """Full name of the object of each number, from 1."""
        self.baseline = 0.0
        """Metres by which the camera is shifted."""

    def __enter__(self) -> ProbeScene:
        try:
            self._build()
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._remove()

    @property
    def lights(self) -> tuple[str, ...]:
        """Kinds of light that something in the scene gives."""
        kinds: set[int] = set().union(*self._kinds)
        reflected = kinds & {SurfaceKind.POLISHED, SurfaceKind.MIRROR, SurfaceKind.GLASS}
        found = (("reflected", bool(reflected)), ("transmitted", SurfaceKind.GLASS in kinds))
        return tuple(light for light, there in found if there)

    def _build(self) -> None:
        """Copy the scene and set it up."""
        original = self._original
        self._mark()
        self.scene = self._keep(original.copy())
        self.scene.name = "Potmesil Probe"
        # At each frame they would put the artist's cameras in the place of the probe's own.
        self.scene.timeline_markers.clear()
        self._set_up_renderer()
        self._add_camera()
        self._add_lamps()
        self.scene.world = self._keep(bpy.data.worlds.new("Potmesil Probe"))
        self._materials = {}

    def _keep(self, made: Any) -> Any:
        self._made.append(made)
        return made

    def _mark(self) -> None:
        """Let objects say what they are made of, and which they are."""
        limit = self._original.potmesil_camera.max_roughness
        self._kinds: list[set[int]] = []
        graph = render_graph(self._original)
        items = {item.name_full: item for item in rendered_objects(self._original)}
        # As evaluated: geometry nodes may give other materials, and instancers show what no scene has.
        for instance in graph.object_instances:
            if instance.object.type in RENDERED_TYPES:
                items[instance.object.original.name_full] = instance.object
        found = [(name, items[name].original, surface_of(items[name], limit)) for name in sorted(items)]
        for number, (name, item, surface) in enumerate(found, start=1):
            # A face beyond the last slot has the last one's material.
            kinds = surface.kinds + surface.kinds[-1:] * (_SLOTS - len(surface.kinds))
            item[SURFACES] = packed(kinds)
            item[INDEX_OF_REFRACTION] = float(surface.ior)
            item[NUMBER] = float(number)
            self._marked.append(item)
            self._kinds.append({int(kind) for kind in surface.kinds})
            self.names[number] = name

    def _set_up_renderer(self) -> None:
        """One sample through the middle of each pixel, and as many bounces as mirrors need."""
        scene, render = self.scene, self.scene.render
        render.use_motion_blur = False
        render.use_compositing = render.use_sequencer = False
        render.use_freestyle = render.use_persistent_data = False
        render.film_transparent = False
        cycles = compat.cycles_settings(scene)
        for name, value in {
            "samples": 1,
            "use_adaptive_sampling": False,
            "time_limit": 0.0,
            "use_denoising": False,
            "pixel_filter_type": "BLACKMAN_HARRIS",
            "filter_width": _FILTER_WIDTH,
            "film_exposure": 1.0,
            "sample_clamp_direct": 0.0,
            "sample_clamp_indirect": 0.0,
            "blur_glossy": 0.0,
            "max_bounces": _MOST_BOUNCES,
            "glossy_bounces": _MOST_BOUNCES,
            "transmission_bounces": _MOST_BOUNCES,
            "transparent_max_bounces": 4 * _MOST_BOUNCES,
            "use_guiding": False,
            "use_fast_gi": False,
            "caustics_reflective": True,
            "caustics_refractive": True,
            "rolling_shutter_type": "NONE",
        }.items():
            # A release may not have one of them.
            if hasattr(cycles, name):
                setattr(cycles, name, value)
        for layer in scene.view_layers:
            layer.samples = 0
            layer.use_sky, layer.use_volumes = True, False
            layer.use_pass_combined = True
            for name in ("object", "asset", "material"):
                setattr(layer, f"use_pass_cryptomatte_{name}", False)
            if hasattr(layer, "cycles"):
                layer.cycles.denoising_store_passes = False

    def _add_camera(self) -> None:
        """Give the scene a camera that can be shifted."""
        camera, lens = self._motion.camera, self._motion.lens
        data = self._keep(self._original.camera.data.copy())
        data.dof.use_dof = False
        item = self._keep(bpy.data.objects.new("Potmesil Probe", data))
        self._place = Matrix(np.linalg.inv(camera.world_to_camera).tolist())
        self.scene.collection.objects.link(item)
        self.scene.camera = self._camera = item
        distance = lens.focus_distance if math.isfinite(lens.focus_distance) else _FAR
        # So far that what is in focus shifts by a pixel: neighbours tell what lies between.
        pitch = min(camera.film.pitch_x, camera.film.pitch_y)
        self.baseline = max(distance, camera.clip_start) * pitch / camera.focal_length

    def _add_lamps(self) -> None:
        """Let lamps that rays would see be surfaces at their places."""
        graph = render_graph(self._original)
        lamps = [
            (instance.object.original, instance.matrix_world.copy())
            for instance in graph.object_instances
            if instance.object.type == "LIGHT"
        ]
        number = len(self.names)
        for lamp, matrix in lamps:
            mesh = _shape_of_lamp(lamp.data)
            if mesh is None:
                continue
            self._keep(mesh)
            number += 1
            item = self._keep(bpy.data.objects.new("Potmesil Probe", mesh))
            item[SURFACES], item[INDEX_OF_REFRACTION] = packed([SurfaceKind.ROUGH]), 1.0
            item[NUMBER] = float(number)
            item.matrix_world = matrix
            item.visible_camera = False
            self.scene.collection.objects.link(item)
            self.names[number] = lamp.name_full

    def prepare(self, view: ProbeView, borrowed: Borrowed) -> None:
        """Set the scene up for one of its renders.

        Parameters
        ----------
        view : ProbeView
            Which.
        borrowed : Borrowed
            Remembers that rays see lamps.
        """
        for item in self._original.objects:
            if item.type == "LIGHT":
                for ray in ("visible_camera", "visible_glossy", "visible_transmission"):
                    borrowed.set(item, ray, False)
        shift = ((0.0, 0.0, 0.0), (self.baseline, 0.0, 0.0), (0.0, self.baseline, 0.0))[view.shift]
        self._camera.matrix_world = self._place @ Matrix.Translation(Vector(shift))
        key = view.light, view.gives
        if key not in self._materials:
            material = self._keep(bpy.data.materials.new("Potmesil Probe"))
            _build_material(material, view, self._place.translation)
            self._materials[key] = material
        for layer in self.scene.view_layers:
            layer.material_override = self._materials[key]
        _build_world(self.scene.world, view)

    def _remove(self) -> None:
        """Delete what was made, and give back what was borrowed."""
        for made in reversed(self._made):
            with contextlib.suppress(ReferenceError):
                _delete(made)
        self._made.clear()
        for item in self._marked:
            with contextlib.suppress(ReferenceError):
                for name in (SURFACES, INDEX_OF_REFRACTION, NUMBER):
                    if name in item:
                        del item[name]
        self._marked.clear()


def rendered_probe(
    probe: ProbeScene,
    light: str,
    folder: Path,
    render: Callable[[bpy.types.Scene], Iterator[float]],
    save: Callable[[bpy.types.Scene, Path], None],
    *,
    whole: bool,
) -> Generator[float, None, list[Path]]:
    """Render what is needed to know one kind of light.

    Parameters
    ----------
    probe : ProbeScene
        The scene.
    light : {"reflected", "transmitted"}
        Which kind.
    folder : Path
        Takes the files.
    render : callable
        Renders a scene, yielding progress.
    save : callable
        Saves a scene's render.
    whole : bool
        Whether to render all of `VIEWS`, or the first alone.

    Yields
    ------
    float
        Share of the work done.

    Returns
    -------
    list of Path
        The files, in the order of `VIEWS`.
    """
    views = VIEWS[light] if whole else VIEWS[light][:1]
    files = []
    for number, view in enumerate(views):
        with Borrowed() as borrowed:
            probe.prepare(view, borrowed)
            for done in render(probe.scene):
                yield (number + done) / len(views)
        files.append(folder / f"{light}_{number}.exr")
        save(probe.scene, files[-1])
    return files


def _delete(made: bpy.types.ID) -> None:
    """Delete a datablock of any kind that is used here."""
    kinds = {
        bpy.types.Scene: bpy.data.scenes,
        bpy.types.Object: bpy.data.objects,
        bpy.types.Material: bpy.data.materials,
        bpy.types.World: bpy.data.worlds,
        bpy.types.Camera: bpy.data.cameras,
        bpy.types.Mesh: bpy.data.meshes,
    }
    for kind, data in kinds.items():
        if isinstance(made, kind):
            data.remove(made)
            return


def _shape_of_lamp(lamp: Any) -> bpy.types.Mesh | None:
    """Return what a lamp is for rays that meet it, None where that is nothing."""
    if lamp.type == "AREA":
        width = lamp.size
        height = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
        if lamp.shape in {"DISK", "ELLIPSE"}:
            angles = np.linspace(0.0, 2.0 * math.pi, 2 * _LAMP_FACETS, endpoint=False)
            points = [(0.5 * width * math.cos(a), 0.5 * height * math.sin(a), 0.0) for a in angles]
        else:
            corners = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
            points = [(width * x, height * y, 0.0) for x, y in corners]
        faces = [tuple(range(len(points)))]
    elif lamp.type in {"POINT", "SPOT"} and lamp.shadow_soft_size > 0.0:
        points, faces = _ball(lamp.shadow_soft_size)
    else:
        return None
    mesh = bpy.data.meshes.new("Potmesil Probe")
    mesh.from_pydata(points, [], faces)
    return mesh


def _ball(radius: float) -> tuple[list[tuple[float, ...]], list[tuple[int, ...]]]:
    """Return a ball of facets."""
    across, down = 2 * _LAMP_FACETS, _LAMP_FACETS
    theta = math.pi * np.arange(down + 1) / down
    phi = 2.0 * math.pi * np.arange(across) / across
    points = [
        (radius * math.sin(t) * math.cos(p), radius * math.sin(t) * math.sin(p), radius * math.cos(t))
        for t in theta.tolist()
        for p in phi.tolist()
    ]
    faces = [
        (across * j + i, across * (j + 1) + i, across * (j + 1) + k, across * j + k)
        for j in range(down)
        for i, k in ((n, (n + 1) % across) for n in range(across))
    ]
    return points, faces


class _Tree:
    """A node tree that is written down from its end."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        tree.nodes.clear()

    def node(self, kind: str, *inputs: Any, **settings: Any) -> Any:
        """Add a node with its inputs in order, each a socket or a value; None leaves one as it is."""
        node = self._tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for socket, value in zip(node.inputs, inputs, strict=False):
            if isinstance(value, bpy.types.NodeSocket):
                self._tree.links.new(value, socket)
            elif value is not None:
                socket.default_value = value
        return node

    def math(self, operation: str, *inputs: Any) -> Any:
        """Return the result of an operation on numbers."""
        return self.node("ShaderNodeMath", *inputs, operation=operation).outputs[0]

    def mix(self, share: Any, first: Any, second: Any) -> Any:
        """Return a mix of two shaders; None is black."""
        return self.node("ShaderNodeMixShader", share, first, second).outputs[0]

    def attribute(self, name: str, kind: str = "OBJECT") -> Any:
        """Return a number that an object or a face carries."""
        return self.node("ShaderNodeAttribute", attribute_type=kind, attribute_name=name).outputs["Fac"]


def _build_material(material: Any, view: ProbeView, eye: Vector) -> None:
    """Make the material of a probe."""
    compat.use_nodes(material)
    material.cycles.emission_sampling = "NONE"
    tree = _Tree(material.node_tree)
    path = tree.node("ShaderNodeLightPath").outputs
    kind = _kind_of_hit(tree)

    def is_kind(wanted: SurfaceKind) -> Any:
        return tree.math("COMPARE", kind, float(wanted), 0.5)

    first = path["Is Camera Ray"]
    mirror, glass, clear = (is_kind(k) for k in (SurfaceKind.MIRROR, SurfaceKind.GLASS, SurfaceKind.CLEAR))
    later = tree.math("SUBTRACT", 1.0, first)
    if view.light == "reflected":
        shows = tree.math("ADD", glass, is_kind(SurfaceKind.POLISHED))
        reflects = tree.math("ADD", mirror, tree.math("MULTIPLY", first, shows))
        refracts = tree.math("MULTIPLY", later, glass)
    else:
        reflects = tree.math("MULTIPLY", later, mirror)
        refracts = glass
    goes_on = tree.math("ADD", tree.math("ADD", reflects, refracts), clear)
    ends = tree.math("SUBTRACT", 1.0, goes_on)
    if view.gives == "path":
        length = tree.math("MULTIPLY", path["Ray Length"], tree.math("SUBTRACT", 1.0, clear))
        number = tree.math("MULTIPLY", tree.attribute(NUMBER), ends)
        bounces = tree.math("MULTIPLY_ADD", refracts, float(_GLASS_STEP), reflects)
        # What a mirror or glass shows first, if light goes on there too.
        second = tree.math("COMPARE", path["Ray Depth"], 1.0, 0.5)
        second = tree.math("MULTIPLY", second, tree.math("ADD", reflects, refracts))
        second = tree.math("MULTIPLY", second, tree.attribute(NUMBER))
        bounces = tree.math("MULTIPLY_ADD", second, float(_NUMBER_STEP), bounces)
        light = tree.node("ShaderNodeCombineXYZ", length, number, bounces).outputs[0]
    else:
        position = tree.node("ShaderNodeNewGeometry").outputs["Position"]
        place = tree.node("ShaderNodeVectorMath", position, eye, operation="SUBTRACT").outputs[0]
        scaled = tree.node("ShaderNodeVectorMath", place, operation="SCALE")
        scaled.inputs["Scale"].default_value = 1.0
        material.node_tree.links.new(ends, scaled.inputs["Scale"])
        light = scaled.outputs[0]
    emission = tree.node("ShaderNodeEmission", light, 1.0).outputs[0]
    ior = tree.attribute(INDEX_OF_REFRACTION)
    glossy = tree.node("ShaderNodeBsdfGlossy")
    glossy.inputs["Roughness"].default_value = 0.0
    glossy.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    refraction = tree.node("ShaderNodeBsdfRefraction", (1.0, 1.0, 1.0, 1.0), 0.0, ior).outputs[0]
    # Where light is totally reflected inside, it goes on as from a mirror.
    total = tree.math("GREATER_THAN", tree.node("ShaderNodeFresnel", ior).outputs[0], 0.999)
    through = tree.mix(total, refraction, glossy.outputs[0])
    transparent = tree.node("ShaderNodeBsdfTransparent", (1.0, 1.0, 1.0, 1.0)).outputs[0]
    on = tree.mix(reflects, tree.mix(refracts, None, through), glossy.outputs[0])
    on = tree.mix(clear, on, transparent)
    surface = tree.node("ShaderNodeAddShader", emission, on).outputs[0]
    tree.node("ShaderNodeOutputMaterial", surface)


def _kind_of_hit(tree: _Tree) -> Any:
    """Return the kind of the surface that was hit, from its object's numbers and its face's slot."""
    slot = tree.math("MINIMUM", tree.attribute("material_index", "GEOMETRY"), float(_SLOTS - 1))
    # Rounded, since powers are not exact everywhere.
    step = tree.math("ROUND", tree.math("POWER", 8.0, slot))
    return tree.math("MODULO", tree.math("FLOOR", tree.math("DIVIDE", tree.attribute(SURFACES), step)), 8.0)


def _build_world(world: Any, view: ProbeView) -> None:
    """Make the world of a probe."""
    compat.use_nodes(world)
    world.cycles.sampling_method = "NONE"
    tree = _Tree(world.node_tree)
    if view.gives == "path":
        light = tree.node("ShaderNodeCombineXYZ", 0.0, float(NOWHERE), 0.0).outputs[0]
    else:
        light = tree.node("ShaderNodeTexCoord").outputs["Generated"]
    background = tree.node("ShaderNodeBackground", light, 1.0).outputs[0]
    tree.node("ShaderNodeOutputWorld", background)
