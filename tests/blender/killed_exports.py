"""Exports and pictures of Blender's that are killed at random moments: ``killed_exports.py FOLDER COUNT``."""

from __future__ import annotations

import importlib
import importlib.util
import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from farm.run import load_extension  # noqa: E402 - found by now
from tests.core.killed import Series  # noqa: E402


def small_scene() -> Any:
    """Return a scene of a cube that is rendered in a moment."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    own = scene.potmesil_camera
    own.use_motion = own.use_hidden_surfaces = own.use_overscan = False
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format = "PNG"
    return scene


def main(arguments: list[str]) -> None:
    """Run one series, and print what was seen."""
    folder, count = Path(arguments[0]), int(arguments[1])
    package = load_extension().__name__
    export = importlib.import_module(f"{package}.operators.export")
    files = importlib.import_module(f"{package}.potmesil_addon.files")
    scene = small_scene()
    image = bpy.data.images.new("Picture", 64, 64, float_buffer=True)

    with tempfile.TemporaryDirectory(prefix="potmesil_test_") as renders:

        def rendered(version: int) -> Path:
            return Path(renders) / f"{version}.exr"

        for version in (0, 1):
            scene.camera.location.x += 0.5 * version
            bpy.ops.render.render()
            export.save_render(scene, rendered(version))

        def work(version: int) -> None:
            # The threads with which Blender writes EXR files do not outlive a fork.
            export.save_render = lambda _, path: shutil.copyfile(rendered(version), path)
            image.generated_type = "COLOR_GRID" if version else "UV_GRID"
            for frame in (1, 2):
                export.render_samples(bpy.context, folder / f"samples_{frame:04d}.exr")
                with files.whole_file(folder / f"picture_{frame:04d}.png") as part:
                    image.save_render(str(part), scene=scene)

        print(json.dumps(Series(folder, work).kill(count, seed=count)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
