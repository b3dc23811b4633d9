"""The demo: the papers' first scene through Cycles and both processors, to pictures.

Run it with `make demo`. It writes the scene, its samples file, the pictures of TOG 1982, figures 11 to
14, that are focused on the cube (pinhole, f/5.6, f/11 and f/22), and the cube spinning and the sphere
flying past: with motion blur alone, and at f/5.6 with lens and shutter on one sample.
"""

from __future__ import annotations

import argparse
import importlib
import time
from pathlib import Path

import bpy

from . import cube_and_sphere, rendering

F_STOPS = (5.6, 11.0, 22.0)


def main() -> int:
    """Build, render and process the scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("build", "demo"), help="folder of the pictures")
    parser.add_argument("--percentage", type=int, default=100, help="size of the pictures; 100 is 512 pixels")
    parser.add_argument(
        "--samples", type=int, default=16, help="Cycles' samples for each of the four of a pixel"
    )
    options = parser.parse_args()
    folder: Path = options.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)

    started = time.perf_counter()
    scene = cube_and_sphere.build(moving=True)
    scene.render.resolution_percentage = options.percentage
    scene.cycles.samples = options.samples
    core = f"{rendering.extension().__name__}.potmesil_addon"
    samples_file = folder / "samples.exr"
    settings = scene.potmesil_camera
    settings.samples_path = str(samples_file)
    settings.sampling = "FINE"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "cube_and_sphere.blend"))
    print("Rendering 2 x 2 samples for each pixel ...")
    bpy.ops.potmesil.render()
    print(f"Rendered and saved the samples in {time.perf_counter() - started:.1f} s")

    cli = importlib.import_module(f"{core}.cli")

    def process(name: str, *words: str) -> int:
        begun = time.perf_counter()
        status = int(cli.main(["process", str(samples_file), "-o", str(folder / name), *words]))
        print(f"{time.perf_counter() - begun:.1f} s")
        return status

    status = process("pinhole.png", "--no-lens", "--no-motion")
    for f_stop in F_STOPS:
        print(f"f/{f_stop:g}: sharp from {_limits(core, f_stop)}")
        status = status or process(f"f{f_stop:g}.png", "--fstop", str(f_stop), "--no-motion")
    print("Shutter open for half a frame")
    status = status or process("motion.png", "--no-lens")
    print("Shutter and f/5.6 together")
    return status or process("motion_f5.6.png", "--fstop", "5.6")


def _limits(core: str, f_stop: float) -> str:
    """Return a row of the papers' Table 1."""
    lens = importlib.import_module(f"{core}.lens")
    limits = lens.depth_of_field(lens.Lens(0.055, f_stop, cube_and_sphere.CUBE_DISTANCE))
    return f"{limits.near * 1000:.0f} to {limits.far * 1000:.0f} mm ({limits.total * 1000:.0f} mm deep)"


if __name__ == "__main__":
    raise SystemExit(main())
