"""The extension's command: ``blender -b scene.blend --command potmesil_camera render ...``.

The commands that need no Blender are the core's own; those of the open scene are added here.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy

from ..potmesil_addon.batch import (
    Lines,
    add_batch_options,
    batch_options,
    dies_on_sigterm,
    run_batch,
    thread_count,
)
from ..potmesil_addon.errors import EXIT_DONE, EXIT_FAILED, InputError, PotmesilError, SettingsError
from ..potmesil_addon.frames import frame_path, parse_frames
from . import kernels
from .all_frames import frames_of, refuse_one_file
from .borrow import Borrowed
from .composite import refuse_unready
from .effects import scene_effects
from .export import refuse_errors
from .motion import kept_scene
from .movie import write_movie
from .output import refuse_output
from .scene_batch import DOING, SceneFrames, Stage
from .stage import stage_scene

NAME = "potmesil_camera"

_ABOUT: dict[str, str] = {
    "passes": "render the samples of frames of the open .blend file, without blur",
    "process": "make pictures of the samples that are there, with the scene's settings",
    "render": "render frames of the open .blend file and make pictures of them",
    "movie": "make a video of pictures that are there, with the scene's frame rate",
}


def main(arguments: list[str]) -> int:
    """Run the command with the words after its name.

    Parameters
    ----------
    arguments : list of str
        Such as ``["render", "--frames", "1-4", "--output", "out/####.exr"]``.

    Returns
    -------
    int
        Exit status: 0 done, 2 usage, 3 input missing or wrong, 4 failed, 33 too little memory,
        130 interrupted, 143 terminated.
    """
    kernels.use_user_cache()
    from ..potmesil_addon import cli  # noqa: PLC0415 - see kernels

    prog = f"blender --command {NAME}"
    name = arguments[0] if arguments else ""
    # A name before the first option is a samples file's: that needs no scene.
    of_a_file = name == "process" and len(arguments) > 1 and not arguments[1].startswith("-")
    if name not in _ABOUT or of_a_file:
        if name in ("-h", "--help"):
            for command, about in _ABOUT.items():
                print(f"{prog} {command}: {about}; see '{prog} {command} --help'")
        return cli.main([_of_blend(word) for word in arguments], prog=prog)
    parser = _movie_parser(prog) if name == "movie" else _frames_parser(prog, name)
    try:
        options = parser.parse_args(arguments[1:])
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        scene = _open_scene(options.scene)
        if name == "movie":
            return _movie(scene, options)
        return _run(scene, _stage(name), parser, arguments[1:])
    except PotmesilError as error:
        print(f"Error: {error}", file=sys.stderr, flush=True)
        return error.exit_status
    except RuntimeError as error:
        print(f"Error: Blender failed: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        return EXIT_FAILED


def _stage(name: str) -> Stage:
    stages: dict[str, Stage] = {"passes": "passes", "process": "process", "render": "render"}
    return stages[name]


def _frames_parser(prog: str, name: str) -> argparse.ArgumentParser:
    from ..potmesil_addon import cli  # noqa: PLC0415 - see kernels

    parser = argparse.ArgumentParser(
        prog=f"{prog} {name}", description=f"{_ABOUT[name].capitalize()}.", allow_abbrev=False
    )
    parser.add_argument(
        "--frames", metavar="RANGE", help="5, 1-10, 1-10:2 or 1,3,7-9 (default: the scene's own range)"
    )
    parser.add_argument(
        "--output",
        "-o",
        metavar="PATH",
        help="####.exr or ####.png; # is the frame's number (default: as the scene's output settings say)",
    )
    parser.add_argument("--samples", metavar="PATH", help="samples files, ####.exr (default: the scene's)")
    parser.add_argument("--scene", metavar="NAME", help="default: the .blend file's active one")
    add_batch_options(parser)
    cli.add_process_options(parser)
    return parser


def _movie_parser(prog: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=f"{prog} movie", description=f"{_ABOUT['movie'].capitalize()}.")
    parser.add_argument("--input", required=True, metavar="PATH", help="the pictures, such as out/####.exr")
    parser.add_argument(
        "--output", "-o", required=True, metavar="PATH", help="the video: .mp4, .mov, .mkv, .webm or .avi"
    )
    parser.add_argument("--frames", metavar="RANGE", help="1-10 (default: all pictures that are there)")
    parser.add_argument("--scene", metavar="NAME", help="default: the .blend file's active one")
    return parser


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


def _run(scene: bpy.types.Scene, stage: Stage, parser: argparse.ArgumentParser, words: list[str]) -> int:
    """Make frames of a scene, whose settings may be animated."""
    from ..potmesil_addon import cli, jit  # noqa: PLC0415 - see kernels

    options = parser.parse_args(words)
    cli.apply_read_limits(options)
    batch = batch_options(options)
    frames = tuple(frames_of(scene)) if options.frames is None else parse_frames(options.frames)
    # What is wrong with the options is said before the first render.
    for frame in frames:
        cli.process_settings(options, frame)
    samples, output = (_template(name) for name in (options.samples, options.output))
    if stage != "passes":
        _check_pictures(scene, options, output)
    several = len(frames) > 1
    if samples is not None and frame_path(samples, 0).suffix.lower() != ".exr":
        raise SettingsError("--samples must end in .exr.")
    if several and samples is None:
        refuse_one_file(scene)
    if stage != "process":
        for finding in refuse_errors(scene, samples):
            if finding.severity == "warning":
                # Not "Warning": strict farms take that word for a failure.
                Lines().say(f"Note: {finding.title}. {finding.text}")

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
        return parser.parse_args(words)

    with kept_scene(scene), Borrowed() as borrowed:
        threads = thread_count(options.threads)
        jit.set_thread_count(threads)
        if threads is not None:
            borrowed.set_all(scene.render, {"threads_mode": "FIXED", "threads": threads})
        work = SceneFrames(scene, stage, options_now, samples, output, several, batch.max_memory)
        return run_batch(frames, work.begin, batch, DOING[stage])


def _check_pictures(scene: bpy.types.Scene, options: argparse.Namespace, output: Path | None) -> None:
    """Raise PotmesilError where pictures cannot be written as the options and the scene say."""
    from ..potmesil_addon.pictures import check_output  # noqa: PLC0415 - see kernels

    staged = output is None and stage_scene(scene) is not None
    if staged:
        refuse_unready(scene)
    if output is None:
        if scene.render.is_movie_format:
            raise InputError(
                "The scene's output is a movie, of which a batch makes the frames; give --output ####.exr, "
                "and make the movie of them with the command movie."
            )
        refuse_output(scene, layered=staged)
    maps = [_template(name) for name in (options.mask, options.error_map)]
    for path in filter(None, (output, *maps)):
        check_output(path)
    named = [path for path in (output, *maps) if path is not None]
    if len(set(named)) < len(named):
        raise SettingsError("The mask or error map would replace another picture; give another name.")


def _movie(scene: bpy.types.Scene, options: argparse.Namespace) -> int:
    """Make a video."""
    source, target = _template(options.input), _template(options.output)
    assert source is not None
    assert target is not None
    frames = None if options.frames is None else parse_frames(options.frames)
    with dies_on_sigterm():
        write_movie(scene, source, target, frames)
    Lines().say(f"Saved: '{target}'")
    return EXIT_DONE


def _of_blend(word: str) -> str:
    """Return a path of the command line, or an option with one, as `_template` does where a file is open."""
    option, equals, path = word.partition("=") if word.startswith("-") else ("", "", word)
    if path.startswith("//") and bpy.data.filepath:
        return f"{option}{equals}{bpy.path.abspath(path)}"
    return word


def _template(name: str | None) -> Path | None:
    """Return a path as the options give it: ``//`` is the .blend file's folder."""
    return None if name is None else Path(bpy.path.abspath(name)).absolute()
