"""What objects do to light, read from their materials."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import bpy
import pytest

from sample_scenes import building, carafe, mirror
from sample_scenes.building import diffuse, material, mixed, node, principled, tree_of

from .scenes import card

LIMIT = 0.3
COLOR = (0.5, 0.5, 0.5)


@pytest.fixture
def surface(scene: Any, module: Any) -> Callable[..., Any]:
    """Put materials on an object, and return its surface."""

    def find(*materials: Any, chosen: str = "AUTO", limit: float = LIMIT) -> Any:
        item = card(scene, "Card", (0.0, 5.0, 0.0), 1.0, materials[0])
        for other in materials[1:]:
            item.data.materials.append(other)
        item.potmesil_camera.surface = chosen
        return module("operators.surfaces").surface_of(item, limit)

    return find


@pytest.fixture
def kind(surface: Any) -> Callable[..., str]:
    """Return the name of the kind of the one surface that a function makes."""

    def find(shade: Any) -> str:
        (only,) = surface(material("Material", shade)).kinds
        return only.name

    return find


def bsdf(tree: Any, name: str, **values: Any) -> Any:
    return node(tree, f"Bsdf{name}", **values).outputs[0]


def value(tree: Any, number: float) -> Any:
    made = node(tree, "Value").outputs[0]
    made.default_value = number
    return made


def texture(tree: Any) -> Any:
    return node(tree, "TexNoise").outputs[0]


def shader(tree: Any, name: str) -> Any:
    """Return a shader of the kind of that name."""
    return {
        "ROUGH": lambda: bsdf(tree, "Diffuse"),
        "POLISHED": lambda: bsdf(tree, "Principled", Roughness=0.1),
        "MIRROR": lambda: bsdf(tree, "Glossy", Roughness=0.0),
        "GLASS": lambda: bsdf(tree, "Glass", Roughness=0.0, IOR=1.6),
        "CLEAR": lambda: bsdf(tree, "Transparent"),
    }[name]()


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, "ROUGH"),
        ({"Roughness": 0.3}, "POLISHED"),
        ({"Roughness": 0.0, "Specular_IOR_Level": 0.0}, "ROUGH"),
        ({"Roughness": texture}, "POLISHED"),
        ({"Roughness": lambda tree: value(tree, 0.8)}, "ROUGH"),
        # Of a usual index 4 % are reflected.
        ({"Roughness": 0.1, "Base_Color": (0.03, 0.03, 0.02, 1.0)}, "MIRROR"),
        ({"Roughness": 0.1, "Base_Color": (0.02, 0.05, 0.02, 1.0)}, "POLISHED"),
        ({"Roughness": 0.1, "Base_Color": (0.05, 0.05, 0.05, 1.0), "IOR": 2.2}, "MIRROR"),
        ({"Roughness": 0.1, "Base_Color": texture, "IOR": 2.2}, "POLISHED"),
        ({"Roughness": 0.1, "Base_Color": lambda tree: value(tree, 0.02)}, "MIRROR"),
        ({"Coat_Weight": 0.5, "Coat_Roughness": 0.1}, "POLISHED"),
        ({"Coat_Weight": texture, "Coat_Roughness": 0.1}, "POLISHED"),
        ({"Coat_Weight": 0.5, "Coat_Roughness": 0.6}, "ROUGH"),
        ({"Metallic": 1.0, "Roughness": 0.1}, "MIRROR"),
        ({"Metallic": 1.0, "Roughness": 0.5}, "ROUGH"),
        ({"Metallic": 1.0, "Roughness": 0.5, "Coat_Weight": 1.0, "Coat_Roughness": 0.0}, "POLISHED"),
        ({"Metallic": lambda tree: value(tree, 0.9), "Roughness": 0.1}, "MIRROR"),
        ({"Metallic": texture, "Roughness": 0.1, "Specular_IOR_Level": 0.0}, "POLISHED"),
        ({"Transmission_Weight": 1.0, "Roughness": 0.0}, "GLASS"),
        ({"Transmission_Weight": texture, "Roughness": 0.0}, "GLASS"),
        ({"Transmission_Weight": 1.0, "Roughness": 0.5}, "ROUGH"),
        ({"Alpha": 0.0, "Roughness": 0.0}, "CLEAR"),
        ({"Alpha": texture}, "ROUGH"),
    ],
)
def test_principled(kind: Any, values: dict[str, Any], expected: str) -> None:
    def shade(tree: Any) -> Any:
        made = {name: value(tree) if callable(value) else value for name, value in values.items()}
        return bsdf(tree, "Principled", **made)

    assert kind(shade) == expected


@pytest.mark.parametrize(
    ("name", "roughness", "expected"),
    [
        ("Glass", 0.3, "GLASS"),
        ("Glass", 0.4, "ROUGH"),
        ("Refraction", 0.0, "GLASS"),
        ("Glossy", 0.3, "MIRROR"),
        ("Glossy", 0.4, "ROUGH"),
        ("Anisotropic", 0.1, "MIRROR"),
        ("Metallic", 0.1, "MIRROR"),
        ("Metallic", 0.5, "ROUGH"),
        ("Diffuse", 0.0, "ROUGH"),
        ("Sheen", 0.0, "ROUGH"),
    ],
)
def test_other_shaders(kind: Any, name: str, roughness: float, expected: str) -> None:
    assert kind(lambda tree: bsdf(tree, name, Roughness=roughness)) == expected


@pytest.mark.parametrize(
    ("first", "second", "share", "expected"),
    [
        ("ROUGH", "MIRROR", texture, "POLISHED"),
        ("POLISHED", "MIRROR", texture, "POLISHED"),
        ("ROUGH", "MIRROR", 0.4, "POLISHED"),
        ("ROUGH", "MIRROR", 0.6, "MIRROR"),
        ("MIRROR", "ROUGH", 0.6, "POLISHED"),
        ("MIRROR", "ROUGH", 0.4, "MIRROR"),
        ("ROUGH", "MIRROR", lambda tree: value(tree, 0.6), "MIRROR"),
        ("ROUGH", "MIRROR", 0.0, "ROUGH"),
        ("ROUGH", "MIRROR", 1.0, "MIRROR"),
        ("CLEAR", "MIRROR", texture, "MIRROR"),
        ("MIRROR", "GLASS", texture, "GLASS"),
        ("GLASS", "CLEAR", texture, "GLASS"),
        ("ROUGH", "POLISHED", 0.5, "POLISHED"),
        ("CLEAR", "ROUGH", 0.5, "ROUGH"),
        ("MIRROR", "MIRROR", 0.5, "MIRROR"),
        ("ROUGH", "MIRROR", None, "POLISHED"),
        ("MIRROR", "GLASS", None, "GLASS"),
    ],
)
def test_mixtures(kind: Any, first: str, second: str, share: Any, expected: str) -> None:
    def shade(tree: Any) -> Any:
        both = shader(tree, first), shader(tree, second)
        if share is not None:
            return mixed(tree, share(tree) if callable(share) else share, *both)
        added = node(tree, "AddShader")
        for socket, place in zip(both, added.inputs, strict=True):
            tree.links.new(socket, place)
        return added.outputs[0]

    assert kind(shade) == expected


@pytest.mark.parametrize(
    ("albedo", "ior", "expected"), [(0.03, 2.2, "MIRROR"), (0.5, 2.2, "POLISHED"), (0.03, 1.2, "POLISHED")]
)
def test_polish_that_reflects_more_than_is_below_it_is_a_mirror(
    kind: Any, albedo: float, ior: float, expected: str
) -> None:
    def shade(tree: Any) -> Any:
        fresnel = node(tree, "Fresnel", IOR=ior).outputs[0]
        base = bsdf(tree, "Diffuse", Color=(albedo, albedo, albedo, 1.0))
        return mixed(tree, fresnel, base, shader(tree, "MIRROR"))

    assert kind(shade) == expected


def test_nothing_mixed_in_leaves_the_other(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        mixture = node(tree, "MixShader")
        tree.links.new(shader(tree, "MIRROR"), mixture.inputs[2])
        return mixture.outputs[0]

    assert kind(shade) == "MIRROR"


def test_nodes_that_go_round_in_a_circle_end(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        first, second = node(tree, "MixShader"), node(tree, "MixShader")
        tree.links.new(shader(tree, "GLASS"), first.inputs[2])
        tree.links.new(second.outputs[0], first.inputs[1])
        tree.links.new(first.outputs[0], second.inputs[1])
        return first.outputs[0]

    assert kind(shade) == "GLASS"


def test_shared_shaders_are_followed_once(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        socket = shader(tree, "MIRROR")
        for _ in range(60):
            socket = mixed(tree, 0.5, socket, socket)
        return socket

    assert kind(shade) == "MIRROR"


def grouped(tree: Any, inner_roughness: float = 0.9) -> Any:
    """Return a group node with a glossy shader, whose roughness comes from outside."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    group.interface.new_socket("Wear", in_out="INPUT", socket_type="NodeSocketFloat")
    entry, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    glossy = node(group, "BsdfGlossy", Roughness=inner_roughness)
    group.links.new(entry.outputs["Wear"], glossy.inputs["Roughness"])
    group.links.new(glossy.outputs[0], end.inputs["Shader"])
    return node(tree, "Group", node_tree=group)


@pytest.mark.parametrize(
    ("wear", "expected"),
    [(0.1, "MIRROR"), (0.5, "ROUGH"), (texture, "MIRROR"), (lambda tree: value(tree, 0.5), "ROUGH")],
)
def test_groups_take_values_from_outside(kind: Any, wear: Any, expected: str) -> None:
    def shade(tree: Any) -> Any:
        group = grouped(tree)
        if callable(wear):
            tree.links.new(wear(tree), group.inputs["Wear"])
        else:
            group.inputs["Wear"].default_value = wear
        return group.outputs[0]

    assert kind(shade) == expected


def test_one_group_may_be_used_with_several_values(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        dull = grouped(tree)
        bright = node(tree, "Group", node_tree=dull.node_tree)
        dull.inputs["Wear"].default_value, bright.inputs["Wear"].default_value = 0.9, 0.0
        return mixed(tree, 0.5, dull.outputs[0], bright.outputs[0])

    assert kind(shade) == "POLISHED"


def test_reroutes_and_muted_nodes_are_passed_through(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        reroute = tree.nodes.new("NodeReroute")
        tree.links.new(shader(tree, "MIRROR"), reroute.inputs[0])
        mixture = node(tree, "MixShader", mute=True)
        tree.links.new(reroute.outputs[0], mixture.inputs[1])
        tree.links.new(shader(tree, "GLASS"), mixture.inputs[2])
        return mixture.outputs[0]

    assert kind(shade) == "MIRROR"


def test_muted_value_and_muted_link_leave_the_input_its_own(kind: Any) -> None:
    def shade(tree: Any) -> Any:
        rough = value(tree, 0.9)
        rough.node.mute = True
        glossy = bsdf(tree, "Glossy", Roughness=rough)
        glossy.node.inputs["Roughness"].default_value = 0.1
        mixture = mixed(tree, 0.9, shader(tree, "GLASS"), glossy)
        tree.links[1].is_muted = True
        return mixture

    assert kind(shade) == "MIRROR"


def test_cycles_own_output_counts(surface: Any) -> None:
    made = material("Two", lambda tree: shader(tree, "ROUGH"))
    tree = tree_of(made)
    tree.nodes["Material Output"].target = "EEVEE"
    node(tree, "OutputMaterial", Surface=shader(tree, "MIRROR"), target="CYCLES")
    assert surface(made).kinds[0].name == "MIRROR"


def test_volume_alone_is_clear(surface: Any) -> None:
    made = bpy.data.materials.new("Smoke")
    tree = tree_of(made)
    tree.nodes.clear()
    end = node(tree, "OutputMaterial")
    assert surface(made).kinds[0].name == "ROUGH"
    tree.links.new(node(tree, "VolumePrincipled").outputs[0], end.inputs["Volume"])
    assert surface(made).kinds[0].name == "CLEAR"
    tree.nodes.clear()
    assert surface(made).kinds[0].name == "ROUGH"


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="materials always have nodes")
def test_materials_without_nodes(surface: Any) -> None:
    metal = bpy.data.materials.new("Metal")
    metal.metallic, metal.roughness = 1.0, 0.0
    assert surface(metal).kinds[0].name == "ROUGH"
    unused = principled("Unused", COLOR, Transmission_Weight=1.0, Roughness=0.0)
    unused.use_nodes = False
    assert surface(unused).kinds[0].name == "ROUGH"


def test_each_slot_has_its_kind(surface: Any, scene: Any, module: Any) -> None:
    glass = principled("Glass", COLOR, Transmission_Weight=1.0, Roughness=0.0, IOR=1.7)
    found = surface(diffuse("Matt", COLOR), None, principled("Gloss", COLOR, Roughness=0.1), glass)
    assert [kind.name for kind in found.kinds] == ["ROUGH", "ROUGH", "POLISHED", "GLASS"]
    assert found.ior == pytest.approx(1.7)
    bare = bpy.data.objects.new("Bare", bpy.data.meshes.new("Bare"))
    assert [kind.name for kind in module("operators.surfaces").surface_of(bare, LIMIT).kinds] == ["ROUGH"]


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [("OPAQUE", "ROUGH"), *((name, name) for name in ("POLISHED", "MIRROR", "GLASS", "CLEAR"))],
)
def test_artist_decides_for_all_slots(surface: Any, chosen: str, expected: str) -> None:
    glass = material("Glass", lambda tree: bsdf(tree, "Glass", Roughness=0.8, IOR=1.6))
    found = surface(diffuse("Matt", COLOR), glass, chosen=chosen)
    assert [kind.name for kind in found.kinds] == [expected] * 2
    assert found.ior == pytest.approx(1.6)
    assert surface(diffuse("Matt", COLOR), chosen=chosen).ior == pytest.approx(1.45)


def test_varying_ior_is_that_of_usual_glass(surface: Any) -> None:
    made = material("Glass", lambda tree: bsdf(tree, "Glass", Roughness=0.0, IOR=texture(tree)))
    assert surface(made).ior == pytest.approx(1.45)


def test_looking_warns_of_nothing(surface: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surface(principled("Gloss", COLOR, Roughness=0.1))


def kinds_in(scene: Any, module: Any) -> dict[str, str]:
    surface_of, limit = module("operators.surfaces").surface_of, scene.potmesil_camera.max_roughness
    return {
        item.name: "/".join(kind.name for kind in surface_of(item, limit).kinds)
        for item in scene.objects
        if item.type == "MESH"
    }


@pytest.mark.parametrize(
    ("transparent", "expected"),
    [(False, "POLISHED"), (True, "GLASS")],
)
def test_carafe(scene: Any, module: Any, transparent: bool, expected: str) -> None:
    built = carafe.build(transparent=transparent)
    assert kinds_in(built, module) == {"Carafe": expected, "Floor": "POLISHED", "Wall": "ROUGH"}


def test_mirror_and_spheres(scene: Any, module: Any) -> None:
    built = mirror.build()
    found = kinds_in(built, module)
    assert {name for name, kind in found.items() if kind == "MIRROR"} == {"Mirror"}
    assert {name for name, kind in found.items() if kind == "GLASS"} == set(mirror.SPHERES)
    names = [item.name for item in module("operators.surfaces").reflecting_objects(built)]
    assert names == sorted({"Mirror", *mirror.SPHERES})
    assert module("operators.surfaces").surface_of(built.objects["Rising"], 0.3).ior == pytest.approx(1.5)


def test_reflecting_objects_follow_each_material_once(scene: Any, module: Any, monkeypatch: Any) -> None:
    surfaces = module("operators.surfaces")
    silver = material("Silver", lambda tree: bsdf(tree, "Glossy", Roughness=0.4))
    made_of = (silver, diffuse("Matt", COLOR), material("Air", lambda tree: shader(tree, "CLEAR")))
    for number in range(60):
        card(scene, f"Card {number:02}", (0.0, 5.0, 0.0), 1.0, made_of[number % 3])
    scene.objects["Card 03"].hide_render = True
    scene.objects["Card 04"].potmesil_camera.surface = "MIRROR"
    building.lamp(scene, "Lamp", "POINT", 1.0, (0.0, 0.0, 1.0))
    looked = []
    plain = surfaces._Materials._material
    monkeypatch.setattr(surfaces._Materials, "_material", lambda *a: looked.append(a) or plain(*a))
    scene.potmesil_camera.max_roughness = 0.3
    assert [item.name for item in surfaces.reflecting_objects(scene)] == ["Card 04"]
    assert len(looked) == 3
    scene.potmesil_camera.max_roughness = 0.4
    expected = sorted({"Card 04"} | {f"Card {number:02}" for number in range(0, 60, 3) if number != 3})
    assert [item.name for item in surfaces.reflecting_objects(scene)] == expected
