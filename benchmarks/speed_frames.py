"""Render what `speed.py` measures with, once: one scene at several sizes, and the sample scenes.

A program of its own, so that nothing of Blender's is in the process that measures. What it makes is kept in
build/bench/cache/speed.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import inspect
import json
import math
import os
import random
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CACHE = ROOT / "build" / "bench" / "cache" / "speed"

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
os.environ["BLENDER_USER_RESOURCES"] = str(ROOT / "build" / "bench" / "blender")
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402
import numpy as np  # noqa: E402
from peers import largest_radius, radii  # noqa: E402
from rgba import write_channels  # noqa: E402

from potmesil_addon import exr  # noqa: E402
from potmesil_addon.process import ProcessSettings, focus_settings  # noqa: E402
from sample_scenes import building, rendering  # noqa: E402
from sample_scenes.catalogue import SCENES  # noqa: E402

FRAME = 2
_RENDERED = 16 * 1920 * 1080
"""Most of Cycles' samples in a frame: a pixel costs the processors the same however noisy it is."""

_MOST_SAMPLES = 16

_FOCUS = 1.6
_NO_SURFACE = 1e10


def garden(columns: int, rows: int) -> bpy.types.Scene:
    """Build a scene with circles of all sizes: ground through the focus, leaves before it, posts and sky.

    The leaves and the sky have the largest circles, on either side of the focus, so that the mean circle is
    about half of them. The camera slides, so that everything moves as far as its depth says.

    Parameters
    ----------
    columns, rows : int
        Pixels; the picture is the same at all sizes of 16 : 9.

    Returns
    -------
    Scene
        At `FRAME`, seen through a pinhole.
    """
    samples = min(_MOST_SAMPLES, max(1, _RENDERED // (columns * rows)))
    scene = building.empty_scene("Garden", columns, rows, samples=samples, bounces=2)
    scene.render.motion_blur_shutter, scene.render.motion_blur_position = 0.5, "CENTER"
    camera = building.camera(
        scene, 50.0, 36.0, (0.0, 0.0, 0.5), (0.0, 1.6, 0.42), f_stop=2.8, focus_distance=_FOCUS
    )
    # The leaves move by about 22 pixels of a picture 1920 wide while the shutter is open.
    step = 0.012
    building.key(camera, "location", {FRAME + n: (step * n, 0.0, 0.5) for n in (-2, 2)})
    building.sky(scene, (0.45, 0.62, 0.95), 0.8)
    building.lamp(scene, "Sun", "SUN", 3.0, (-3.0, -4.0, 5.0), (0.0, 1.6, 0.0), size=1.0)
    building.add(scene, "Ground", building.plane("Ground", 80.0, 80.0), (0, 0, 0), (0, 0, 0), _checked())
    _subject(scene)
    _behind(scene)
    _leaves(scene)
    scene.frame_set(FRAME)
    return scene


def _checked() -> bpy.types.Material:
    def shade(tree: bpy.types.ShaderNodeTree) -> bpy.types.NodeSocket:
        place = building.node(tree, "TexCoord").outputs["Object"]
        checks = building.node(
            tree, "TexChecker", Vector=place, Color1=(0.55, 0.45, 0.30), Color2=(0.12, 0.14, 0.10), Scale=9.0
        )
        return building.node(tree, "BsdfDiffuse", Color=checks.outputs["Color"]).outputs[0]

    return building.material("Ground", shade)


def _subject(scene: bpy.types.Scene) -> None:
    """Stand a ball on a pedestal where the lens is focused."""
    stone = building.diffuse("Stone", (0.55, 0.53, 0.50))
    building.add(
        scene, "Pedestal", building.box("Pedestal", (0.26, 0.26, 0.3)), (0, 1.7, 0.15), (0, 0, 20), stone
    )
    red = building.principled("Red", (0.62, 0.06, 0.04), Roughness=0.3)
    building.add(scene, "Ball", building.sphere("Ball", 0.12), (0.0, 1.66, 0.42), (0, 0, 0), red)


def _behind(scene: bpy.types.Scene) -> None:
    """Put posts at growing distance, trees before the sky, and lamps that become discs."""
    chance = random.Random(5)
    wood = building.diffuse("Wood", (0.35, 0.20, 0.09))
    post = building.cylinder("Post", 0.025, 1.0, segments=24)
    for number in range(18):
        depth = 2.0 + 0.55 * number
        for side in (-1, 1):
            building.add(scene, f"Post {number} {side}", post, (side * (0.45 + 0.05 * depth), depth, 0.5))
    post.materials.append(wood)
    crown = building.sphere("Crown", 1.0, rings=24)
    crown.materials.append(building.diffuse("Crown", (0.08, 0.22, 0.05)))
    for number in range(24):
        size = chance.uniform(0.6, 1.6)
        place = (chance.uniform(-9.0, 9.0), chance.uniform(9.0, 22.0), size * 0.9)
        building.add(scene, f"Crown {number}", crown, place).scale = (size, size, 1.3 * size)
    lamp = building.sphere("Lamp", 0.02, rings=8)
    lamp.materials.append(building.emitter("Lamp", (1.0, 0.75, 0.4), 80.0))
    for number in range(14):
        place = (chance.uniform(-2.0, 2.0), chance.uniform(4.0, 8.0), chance.uniform(0.3, 1.5))
        building.add(scene, f"Lamp {number}", lamp, place)


def _leaves(scene: bpy.types.Scene) -> None:
    """Hang leaves between the camera and the subject, on both sides."""
    chance = random.Random(3)
    leaf = building.plane("Leaf", 0.05, 0.11)
    leaf.materials.append(building.diffuse("Leaf", (0.16, 0.42, 0.06)))
    for number in range(60):
        side = 1 if number % 3 else -1
        depth = chance.uniform(0.75, 0.95)
        place = (side * chance.uniform(0.10, 0.34) * depth, depth, 0.5 + chance.uniform(-0.2, 0.2) * depth)
        turn = (chance.uniform(30, 120), chance.uniform(-60, 60), chance.uniform(-90, 90))
        building.add(scene, f"Leaf {number}", leaf, place, turn)


def frame_folder(columns: int, rows: int) -> Path:
    """Return where a frame's files are: another folder where the scene's source is another."""
    key = hashlib.sha256()
    parts: tuple[Callable[..., Any], ...] = (garden, _checked, _subject, _behind, _leaves)
    for part in parts:
        # Layout and comments do not count.
        key.update(ast.dump(ast.parse(inspect.getsource(part))).encode())
    return CACHE / f"garden-{key.hexdigest()[:10]}-{columns}x{rows}"


def prepare_frame(columns: int, rows: int, *, again: bool = False) -> Path:
    """Render a frame, with what the other tools need, unless it is there.

    Parameters
    ----------
    columns, rows : int
        Pixels.
    again : bool
        Whether to render it even so: Cycles' times are those of the run that rendered.

    Returns
    -------
    Path
        A folder with ``samples.exr``, ``passes.exr`` for Blender's nodes, ``source.exr`` and ``mask.exr`` for
        GEGL, and ``facts.json``: Cycles' seconds, and f-stop and radius of the largest circle in pixels.
    """
    folder = frame_folder(columns, rows)
    if (folder / "facts.json").exists() and not again:
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = garden(columns, rows)
    seconds = {"pinhole": _rendered(scene)}
    scene.camera.data.dof.use_dof = True
    seconds["lens"] = _rendered(scene)
    scene.render.use_motion_blur = True
    seconds["lens and motion"] = _rendered(scene)
    scene.camera.data.dof.use_dof = scene.render.use_motion_blur = False
    # Every tool gets the same pixels: no margin, and no view but the camera's.
    _export(
        scene, folder / "samples.exr", use_motion=True, use_hidden_surfaces=False, use_overscan=False,
        depth_peeling="OFF", sampling="PIXELS",
    )  # fmt: skip
    facts = _other_inputs(folder)
    facts |= {"cycles_seconds": seconds, "cycles_samples": scene.cycles.samples}
    (folder / "facts.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return folder


def _other_inputs(folder: Path) -> dict[str, float]:
    """Write what Blender's nodes and GEGL read, and return f-stop and largest radius in pixels."""
    samples = exr.read_samples(folder / "samples.exr")
    layer, focus = samples.layers[0], focus_settings(samples, ProcessSettings())
    assert layer.depth is not None
    assert layer.vector is not None
    channels = {f"Layer.Combined.{name}": layer.color[..., n] for n, name in enumerate("RGBA")}
    channels |= {f"Layer.Vector.{name}": layer.vector[..., n] for n, name in enumerate("XYZW")}
    channels["Layer.Depth.V"] = np.where(np.isfinite(layer.depth), layer.depth, np.float32(_NO_SURFACE))
    write_channels(folder / "passes.exr", channels)
    largest = largest_radius(layer, focus.lens, focus.film)
    # All circles are proportional to 1 / f-stop: the mask is the same for all of them.
    share = np.clip(np.abs(radii(layer, focus.lens, focus.film)) / largest, 0.0, 1.0).astype(np.float32)
    write_channels(folder / "source.exr", {name: layer.color[..., n] for n, name in enumerate("RGBA")})
    write_channels(folder / "mask.exr", dict.fromkeys("RGB", share))
    return {
        "f_stop": focus.lens.f_stop,
        "largest_radius": largest,
        "mean_radius": float(share.mean()) * largest,
        "focal_length": focus.lens.focal_length,
        "focus_distance": focus.lens.focus_distance,
        "sensor_width": focus.film.width,
    }


def prepare_scene(name: str, percentage: int, *, again: bool = False) -> Path:
    """Render a sample scene through a pinhole and export its samples, unless that was done.

    Parameters
    ----------
    name : str
        One of the catalogue.
    percentage : int
        Of its size.
    again : bool
        Whether to render it even so.

    Returns
    -------
    Path
        A folder with ``samples.exr`` and ``facts.json``: the render's seconds, the scene's samples a pixel.
    """
    folder = CACHE / f"{name}-{percentage}"
    if (folder / "facts.json").exists() and not again:
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    rendering.extension()
    scene = SCENES[name].open(percentage=percentage)
    # The first render of a file also loads what stays loaded.
    _rendered(scene, samples=1)
    seconds = _rendered(scene)
    _export(scene, folder / "samples.exr")
    facts = {"pinhole_seconds": seconds, "cycles_samples": scene.cycles.samples}
    (folder / "facts.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return folder


def _rendered(scene: bpy.types.Scene, samples: int | None = None) -> float:
    """Return the seconds that a render takes."""
    before = scene.cycles.samples
    scene.cycles.samples = before if samples is None else samples
    started = time.perf_counter()
    bpy.ops.render.render(scene=scene.name)
    seconds = time.perf_counter() - started
    scene.cycles.samples = before
    return seconds


def _export(scene: bpy.types.Scene, path: Path, **own: Any) -> None:
    rendering.extension()
    for name, value in own.items():
        setattr(scene.potmesil_camera, name, value)
    part = path.with_name("part.exr")
    rendering.render_samples(scene, part).replace(path)


def main() -> int:
    """Render what is named and print the folders, one a line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", action="append", default=[], metavar="COLUMNSxROWS")
    parser.add_argument("--scene", action="append", default=[], choices=SCENES, metavar="NAME")
    parser.add_argument("--percentage", type=int, default=100, help="size of the sample scenes")
    parser.add_argument("--again", action="store_true", help="render what is there, too")
    options = parser.parse_args()
    found = {}
    for size in options.size:
        columns, rows = (int(number) for number in size.split("x"))
        if not math.isclose(columns * 9, rows * 16):
            parser.error(f"{size} is not 16 : 9")
        found[size] = prepare_frame(columns, rows, again=options.again)
    for name in options.scene:
        found[name] = prepare_scene(name, options.percentage, again=options.again)
    # Cycles and the extension print too: the last line is the answer.
    print(json.dumps({name: str(folder) for name, folder in found.items()}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
