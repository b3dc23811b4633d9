"""The installed extension under the bpy module: built, installed from its zip and enabled once a session."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
_RESOURCES = tempfile.TemporaryDirectory(prefix="potmesil_test_")
os.environ["BLENDER_USER_RESOURCES"] = _RESOURCES.name

bpy = pytest.importorskip("bpy", reason="the bpy module is not installed")

PACKAGE = "bl_ext.user_default.potmesil_camera"


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension's zip, built with Blender's own tool."""
    folder = tmp_path_factory.mktemp("zip")
    subprocess.run(
        [sys.executable, str(ROOT / "tools" / "build_extension.py"), "--output", str(folder)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    (archive,) = folder.glob("*.zip")
    return archive


@pytest.fixture(scope="session")
def extension(extension_zip: Path) -> ModuleType:
    """The root package of the installed and enabled extension."""
    bpy.ops.extensions.package_install_files(
        filepath=str(extension_zip), repo="user_default", enable_on_install=True
    )
    return importlib.import_module(PACKAGE)


@pytest.fixture
def scene(extension: ModuleType, tmp_path: Path) -> Iterator[Any]:
    """A fresh scene for Cycles: small, few samples, a camera that looks along +y from the origin."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 96, 64
    scene.render.resolution_percentage = 100
    scene.cycles.samples = 4
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.rotation_euler = (1.5707963267948966, 0.0, 0.0)
    camera.data.dof.focus_distance = 5.0
    camera.data.dof.aperture_fstop = 0.5
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = None
    scene.potmesil_camera.samples_path = str(tmp_path / "samples_####.exr")
    bpy.context.view_layer.update()
    yield scene
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture
def module(extension: ModuleType) -> Any:
    """Import a module of the installed extension by its name inside it."""

    def find(name: str) -> ModuleType:
        return importlib.import_module(f"{PACKAGE}.{name}")

    return find
