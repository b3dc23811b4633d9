"""The extension's command: ``blender -b scene.blend --command potmesil_camera render ...``.

The commands that need no Blender are the core's own; ``render`` is added here.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy

from ..potmesil_addon.errors import EXIT_DONE, EXIT_FAILED, InputError, PotmesilError, SettingsError
from ..potmesil_addon.frames import frame_path, parse_frames
from . import kernels
from .borrow import Borrowed
from .effects import scene_effects
from .export import refuse_errors, render_samples, samples_path
from .process import panel_shutter

NAME = "potmesil_camera"


def main(arguments: list[str]) -> int:
    """Run the command with the words after its name.

    Parameters
    ----------
    arguments : list of str
        Such as ``["render", "--frames", "1-4", "--output", "out/####.exr"]``.

    Returns
    -------
    int
        Exit status: 0 done, 2 usage, 3 input missing or wrong, 4 failed.
    """
    kernels.use_user_cache()
    from ..potmesil_addon import cli  # noqa: PLC0415 - see kernels

    prog = f"blender --command {NAME}"
    if not arguments or arguments[0] != "render":
        if arguments[:1] in (["-h"], ["--help"]):
            print(f"{prog} render: render frames and focus them; see '{prog} render --help'")
        return cli.main(arguments, prog=prog)
    parser = argparse.ArgumentParser(
        prog=f"{prog} render", description="Render frames of the open .blend file and focus them."
    )
    parser.add_argument(
        "--frames", metavar="RANGE", help="5, 1-10, 1-10:2 or 1,3,7-9 (default: the current frame)"
    )
    parser.add_argument(
        "--output", "-o", required=True, metavar="PATH", help="####.exr or ####.png; # is the frame's number"
    )
    parser.add_argument("--samples", metavar="PATH", help="where samples files go (default: the scene's)")
    parser.add_argument("--scene", metavar="NAME", help="default: the .blend file's active one")
    cli.add_process_options(parser)
    try:
        options = parser.parse_args(arguments[1:])
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        scene = _open_scene(options.scene)

        def options_now() -> argparse.Namespace:
            # What no option says is as the panel has it, at each frame; the options were found good above.
            own = scene.potmesil_camera
            parser.set_defaults(coc_model=own.coc_model, psf=own.psf, visibility=own.visibility)
            parser.set_defaults(motion_model=own.motion_model)
            parser.set_defaults(no_reflections=own.reflections == "OFF")
            parser.set_defaults(no_shadows=own.reflections != "REFLECTIONS_AND_SHADOWS")
            parser.set_defaults(no_lens=not own.use_lens, no_motion=not own.use_motion)
            parser.set_defaults(panel_effects=scene_effects(scene))
            parser.set_defaults(uniform_defocus=repr(own.uniform_defocus), fade=repr(own.fade))
            return parser.parse_args(arguments[1:])

        _render(scene, options, options_now)
    except PotmesilError as error:
        print(f"Error: {error}", file=sys.stderr, flush=True)
        return error.exit_status
    except RuntimeError as error:
        print(f"Error: Blender could not render: {str(error).strip()}", file=sys.stderr, flush=True)
        return EXIT_FAILED
    return EXIT_DONE


def _open_scene(name: str | None) -> bpy.types.Scene:
    """Make a scene of the open .blend file the active one, and return it.

    Raises
    ------
    InputError
        If no file is open or it has no such scene.
    """
    # Blender goes on with an empty scene where the .blend file is missing.
    if not bpy.data.filepath:
        raise InputError("No .blend file is open; name one that exists before --command.")
    if name is not None:
        if name not in bpy.data.scenes:
            raise InputError(f"The .blend file has no scene '{name}'.")
        bpy.context.window.scene = bpy.data.scenes[name]
    return bpy.context.scene


def _render(
    scene: bpy.types.Scene, options: argparse.Namespace, options_now: Callable[[], argparse.Namespace]
) -> None:
    """Render, process and write every frame asked for; the scene's settings may be animated."""
    from ..potmesil_addon import cli, exr, jit  # noqa: PLC0415 - see kernels
    from ..potmesil_addon.process import process  # noqa: PLC0415
    from ..potmesil_addon.progress import run  # noqa: PLC0415

    frames = (scene.frame_current,) if options.frames is None else parse_frames(options.frames)
    # What is wrong with the options is said before the first render.
    for frame in frames:
        cli.process_settings(options, frame)
    output = Path(bpy.path.abspath(options.output)).absolute()
    cli.check_output(output)
    mask, error_map = (
        None if name is None else Path(bpy.path.abspath(name)).absolute()
        for name in (options.mask, options.error_map)
    )
    for extra, other in ((mask, output), (error_map, output), (error_map, mask)):
        if extra is not None:
            cli.check_output(extra)
            if extra == other:
                raise SettingsError("The mask or error map would replace another picture; give another name.")
    if options.samples is not None and frame_path(Path(options.samples), 0).suffix.lower() != ".exr":
        raise SettingsError("--samples must end in .exr.")
    elsewhere = None if options.samples is None else Path(bpy.path.abspath(options.samples)).absolute()
    for finding in refuse_errors(scene, elsewhere):
        if finding.severity == "warning":
            # Not "Warning": strict farms take that word for a failure.
            print(f"Note: {finding.title}. {finding.text}", flush=True)
    jit.set_thread_count(options.threads)
    for done, frame in enumerate(frames):
        started = time.perf_counter()
        scene.frame_set(frame)
        if options.samples is None:
            samples_file = samples_path(scene)
        else:
            named = Path(bpy.path.abspath(options.samples)).absolute()
            samples_file = frame_path(named, frame, several=len(frames) > 1)
        current = options_now()
        with Borrowed() as borrowed:
            # Without motion blur or lens nothing that only it needs is rendered.
            borrowed.set(scene.potmesil_camera, "use_motion", not current.no_motion)
            borrowed.set(scene.potmesil_camera, "use_lens", not current.no_lens)
            if current.no_shadows:
                wanted = "OFF" if current.no_reflections else "REFLECTIONS"
                borrowed.set(scene.potmesil_camera, "reflections", wanted)
            render_samples(bpy.context, samples_file)
        samples = exr.read_samples(samples_file, tuple(options.layer) if options.layer else None)
        settings = cli.process_settings(current, frame)
        settings = replace(settings, shutter=settings.shutter.over(panel_shutter(scene)))
        result = run(process(samples, settings))
        target = frame_path(output, frame, several=len(frames) > 1)
        cli.write_result(target, result, samples)
        for template, values in ((mask, result.guessed), (error_map, result.predicted_error)):
            if template is not None:
                cli.write_map(frame_path(template, frame, several=len(frames) > 1), values, result, samples)
        minutes, seconds = divmod(time.perf_counter() - started, 60.0)
        # Whole lines, flushed: farms read them through a pipe.
        print(f"Saved: '{target}'", flush=True)
        print(f"Time: {int(minutes):02d}:{seconds:05.2f}", flush=True)
        print(f"openjd_progress: {100.0 * (done + 1) / len(frames):.1f}", flush=True)
