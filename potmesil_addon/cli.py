"""The command line: ``info``, ``dof``, ``psf`` and ``process``, with or without Blender.

Exit status: 0 done, 2 usage, 3 input missing or wrong, 4 failed, 33 too little memory, 130 interrupted,
143 terminated.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from . import __version__, beside, exr, jit, png, schemas
from .batch import Mark, Standing, add_batch_options, batch_options, run_batch, thread_count
from .camera import Film, pan_tilt_swing
from .diffraction import lommel_intensity, optical_defocus, optical_radius
from .effect_options import described, read_effects, with_options
from .effects import Effects, effects_from_json
from .errors import EXIT_DONE, EXIT_MEMORY, InputError, PotmesilError, SettingsError
from .exr_claims import ReadLimits, parse_read_limits, set_read_limits
from .focus import WEIGHTINGS
from .frames import existing_frames, frame_path, parse_frames
from .keys import Scale, parse_keys
from .lens import (
    COC_MODELS,
    DEFAULT_CRITERION,
    DepthOfField,
    Lens,
    circle_of_confusion,
    depth_of_field,
    depth_of_field_for_circle,
)
from .motion import MOTION_MODELS
from .pictures import PicturePaths, check_output, picture_mark, refuse_replacing
from .preview import settings_to_json
from .process import ProcessSettings, process
from .psf import (
    PRIMARY_WAVELENGTHS,
    PSF_KINDS,
    TABLE_LOOKUPS,
    TABLE_SPACINGS,
    PsfBuilder,
    PsfSettings,
)
from .reports import plain
from .samples import LensAttributes, Samples
from .scatter import BACKENDS
from .shutter import (
    CURTAINS,
    SHUTTER_POSITIONS,
    SLIT_EDGES,
    Curve,
    Flash,
    Openings,
    ShutterAttributes,
    Slit,
    parse_curve,
    parse_openings,
    rotary_slit,
)
from .visibility import VISIBILITIES

_FLASH_NUMBERS: Final[tuple[tuple[str, Callable[[str], Any]], ...]] = (
    ("share", float),
    ("duration", float),
    ("count", int),
)
_EXIT_INTERRUPTED: Final = 130
_PAST_THE_EDGE: Final = 10.0 * math.pi
_MAX_PROFILE: Final = 20_000
_MAX_V: Final = 1e5

_OFF: Final = "none"
"""What switches off a curve, a multiple exposure or a slit of the file's."""


def main(arguments: Sequence[str] | None = None, *, prog: str = "python -m potmesil_addon") -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words after the program's name; by default the process's own.
    prog : str
        Name of the program in its help.

    Returns
    -------
    int
        Exit status.
    """
    parser = build_parser(prog)
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:
        # Blender's own command line takes a return value, not an exception.
        return int(stop.code or 0)
    try:
        apply_read_limits(options)
        status: int = options.run(options)
    except PotmesilError as error:
        print(f"Error: {error}", file=sys.stderr)
        return error.exit_status
    except MemoryError:
        print("Error: There is not enough memory for this picture; use a machine with more.", file=sys.stderr)
        return EXIT_MEMORY
    except KeyboardInterrupt:
        return _EXIT_INTERRUPTED
    return status


def build_parser(prog: str) -> argparse.ArgumentParser:
    """Return the parser of all commands.

    Parameters
    ----------
    prog : str
        Name of the program in its help.

    Returns
    -------
    argparse.ArgumentParser
        Parser whose result has a ``run`` function.
    """
    parser = argparse.ArgumentParser(
        prog=prog, description="Depth of field and motion blur for rendered pictures, after the render."
    )
    parser.add_argument("--version", action="version", version=f"Potmesil Camera {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    add_core_commands(commands)
    return parser


def add_core_commands(commands: Any) -> None:
    """Add the commands that need no Blender to a parser's subparsers.

    Parameters
    ----------
    commands : argparse subparsers
        What ``add_subparsers`` returned.
    """
    info = commands.add_parser("info", help="say what a samples file holds")
    info.add_argument("input", type=Path, metavar="IN.exr")
    info.add_argument("--json", action="store_true", help="print JSON")
    add_read_limits(info)
    info.set_defaults(run=_info)

    effects = commands.add_parser("effects", help="list the special effects and what can be set")
    effects.add_argument("--json", action="store_true", help="print JSON; null stands for no limit")
    effects.set_defaults(run=_list_effects)

    dof = commands.add_parser("dof", help="print the limits of the depth of field")
    _add_lens(dof)
    criterion = dof.add_mutually_exclusive_group()
    criterion.add_argument(
        "--criterion",
        type=float,
        default=DEFAULT_CRITERION,
        help="distance over the smallest diameter that the eye resolves at it (default %(default)g)",
    )
    criterion.add_argument(
        "--circle-mm", type=float, help="largest circle of confusion on the film instead, in millimetres"
    )
    dof.add_argument("--coc-model", choices=COC_MODELS, default="cycles", help="used with --circle-mm")
    dof.add_argument("--json", action="store_true", help="print JSON; null stands for infinity")
    dof.set_defaults(run=_dof)

    psf = commands.add_parser("psf", help="print the diffraction pattern of a point out of focus")
    _add_lens(psf)
    psf.add_argument("--depth", type=float, required=True, metavar="M", help="distance of the point")
    psf.add_argument("--wavelength-nm", type=float, metavar="L", help="default: 549, the green primary")
    psf.add_argument(
        "--coc-model", choices=COC_MODELS, default="paper", help="default: %(default)s (TOG 1982, eq. 9)"
    )
    psf.add_argument("--psf", choices=PSF_KINDS, default="lommel", help="what the pixel table holds")
    _add_iris(psf)
    psf.add_argument("--json", action="store_true", help="print JSON")
    psf.add_argument("--pixel-pitch-um", type=float, metavar="P", help="pixel size for the table")
    psf.add_argument("-o", "--output", type=Path, metavar="OUT.exr|OUT.png", help="write the pixel table")
    psf.set_defaults(run=_psf)

    work = commands.add_parser(
        "process", help="turn samples files into pictures with depth of field and motion blur"
    )
    work.add_argument("input", type=Path, metavar="IN.exr", help="####.exr for a sequence")
    work.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.exr|OUT.png")
    work.add_argument(
        "--frames",
        metavar="RANGE",
        help="1-10, 1-10:2 or 1,3,7-9 (default: every frame of a sequence that is there)",
    )
    add_process_options(work)
    add_batch_options(work)
    work.set_defaults(run=_process)


def add_process_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that `process_settings` reads; what is not given comes from the file.

    Options that take KEYS take a number, or numbers for frames as in ``1=0.29,24=0.98``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Receives the options.
    """
    parser.add_argument("--focal-length", type=float, metavar="MM")
    parser.add_argument("--fstop", metavar="KEYS", help="a number, or FRAME=NUMBER,...: evenly in stops")
    parser.add_argument(
        "--focus-distance", metavar="KEYS", help="metres, or FRAME=METRES,...: evenly in 1/distance"
    )
    parser.add_argument(
        "--sensor-width",
        type=float,
        metavar="MM",
        help="sensor along the width of a landscape picture; the height follows from the pixels' shape",
    )
    parser.add_argument(
        "--sensor-height",
        type=float,
        metavar="MM",
        help="sensor along the height of a portrait picture, or of any where no width is given",
    )
    _add_iris(parser)
    parser.add_argument("--no-lens", action="store_true", help="leave out the focus processor")
    _add_shutter(parser)
    parser.add_argument("--no-motion", action="store_true", help="leave out the motion processor")
    parser.add_argument(
        "--motion-model",
        choices=MOTION_MODELS,
        default="auto",
        help="one path for each object, or each sample's own vector (default: as each object needs)",
    )
    parser.add_argument("--coc-model", choices=COC_MODELS, default="cycles")
    parser.add_argument("--psf", choices=PSF_KINDS, default="disc")
    parser.add_argument("--tables", choices=TABLE_SPACINGS, default="coc")
    parser.add_argument("--lookup", choices=TABLE_LOOKUPS, default="nearest")
    parser.add_argument(
        "--table-step",
        type=float,
        metavar="STEP",
        help="between tables: pixels of circle for coc, millimetres of depth for equal-z",
    )
    parser.add_argument(
        "--no-blocks",
        dest="blocks",
        action="store_false",
        help="spread samples that are much blurred one by one, also where neighbours are alike (slower)",
    )
    parser.add_argument(
        "--weighting", choices=WEIGHTINGS, default="1982", help="1981 weighs samples by 1/z^2"
    )
    parser.add_argument(
        "--visibility",
        choices=VISIBILITIES,
        default="aperture",
        help="aperture: nearer surfaces hide farther ones from parts of the aperture; none: the papers",
    )
    parser.add_argument(
        "--no-reflections",
        action="store_true",
        help="blur what mirrors and glass show as their surfaces, also where the samples have it apart",
    )
    parser.add_argument(
        "--no-shadows",
        action="store_true",
        help="leave the shadows of moving objects where they are at the frame",
    )
    parser.add_argument(
        "--uniform-defocus",
        metavar="KEYS",
        default="0",
        help="defocus the finished picture evenly: the circle's diameter on the film in millimetres",
    )
    parser.add_argument(
        "--fade", metavar="KEYS", default="1", help="share of the finished picture's light: 0 is black"
    )
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME[.FIELD=KEYS]",
        help="switch a special effect on, or set what it does: star, star.lines=4, star=off; may be "
        "repeated; the command effects lists them",
    )
    parser.add_argument(
        "--effects", type=Path, metavar="FILE.json", help="special effects, which --effect goes on from"
    )
    parser.set_defaults(panel_effects={})
    parser.add_argument(
        "--layer",
        action="append",
        metavar="NAME",
        help="view layer to take; may be repeated (default: all that have a depth)",
    )
    parser.add_argument(
        "--mask",
        metavar="MASK.exr|MASK.png",
        help="write where the picture rests on surfaces that had to be guessed (1) and where not (0)",
    )
    parser.add_argument(
        "--error-map",
        metavar="ERROR.exr|ERROR.png",
        help="write how far each pixel is expected to be off",
    )
    parser.add_argument("--report", type=Path, metavar="OUT.json", help="write what was done as JSON")
    add_read_limits(parser)
    parser.add_argument("--backend", choices=BACKENDS, default="auto")
    parser.add_argument(
        "--threads", type=int, metavar="N", help="default: as many as the farm allows, or all cores"
    )


def add_read_limits(parser: argparse.ArgumentParser) -> None:
    """Add the option that `apply_read_limits` reads.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Receives the option.
    """
    parser.add_argument(
        "--read-limits",
        metavar="NAME=NUMBER,...",
        help="raise what a file's header may claim: " + ", ".join(item.name for item in fields(ReadLimits)),
    )


def apply_read_limits(options: argparse.Namespace) -> None:
    """Let files claim as much as the options say, in this process.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.

    Raises
    ------
    SettingsError
        If the text of ``--read-limits`` is wrong.
    """
    text = getattr(options, "read_limits", None)
    if text is not None:
        set_read_limits(parse_read_limits(text))


def process_settings(options: argparse.Namespace, frame: int | None = None) -> ProcessSettings:
    """Return the settings that the options of `add_process_options` ask for.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    frame : int, optional
        The frame that keys are looked up at.

    Returns
    -------
    ProcessSettings
        In the core's units.

    Raises
    ------
    SettingsError
        If a value is out of range.
    InputError
        If the file of the shutter's curve cannot be read.
    """
    step = options.table_step
    if step is not None and options.tables == "equal-z":
        step /= 1000.0
    return ProcessSettings(
        use_lens=not options.no_lens,
        use_motion=not options.no_motion,
        lens=LensAttributes(
            focal_length=_millimetres(options.focal_length),
            f_stop=_keyed(options.fstop, frame, "stops"),
            focus_distance=_keyed(options.focus_distance, frame, "reciprocal"),
            blades=options.blades,
            blade_rotation=None if options.blade_rotation is None else math.radians(options.blade_rotation),
            anamorphic_ratio=options.anamorphic_ratio,
        ),
        shutter=_shutter(options),
        motion_model=options.motion_model,
        sensor_width=_millimetres(options.sensor_width),
        sensor_height=_millimetres(options.sensor_height),
        model=options.coc_model,
        psf=PsfSettings(
            kind=options.psf, tables=options.tables, lookup=options.lookup, step=step, blocks=options.blocks
        ),
        weighting=options.weighting,
        visibility=options.visibility,
        reflections=not options.no_reflections,
        shadows=not options.no_shadows,
        uniform_defocus=parse_keys(options.uniform_defocus).at(frame) / 1000.0,
        fade=parse_keys(options.fade).at(frame),
        effects=_effects(options, frame),
        frame=frame or 0,
        backend=options.backend,
    )


def _effects(options: argparse.Namespace, frame: int | None) -> Effects:
    """Return the special effects: the panel's, those of a file over them, and single options over both."""
    base = {**options.panel_effects, **({} if options.effects is None else read_effects(options.effects))}
    return effects_from_json(with_options(base, options.effect, frame))


def _add_shutter(parser: argparse.ArgumentParser) -> None:
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--shutter", type=float, metavar="FRAMES", help="exposure time T in frames")
    length.add_argument(
        "--shutter-angle",
        type=float,
        metavar="DEG",
        help="exposure time as a rotary shutter's opening: T = DEG / 360",
    )
    parser.add_argument(
        "--shutter-gate",
        metavar="[EDGE:]DEG",
        help="rotary shutter: angle of the film gate as its disc's axis sees it, by which the side opposite "
        "to the edge (top where none is said) is later",
    )
    parser.add_argument(
        "--shutter-position", choices=SHUTTER_POSITIONS, help="where the frame lies in the exposure"
    )
    parser.add_argument(
        "--shutter-curve",
        metavar="FILE.json",
        help=f"openness over the exposure as [[time, openness], ...], both from 0 to 1; {_OFF}: always open",
    )
    parser.add_argument(
        "--exposures",
        metavar="LIST",
        help="openings of a multiple exposure in units of T: begin:end,begin:end,... or "
        f"COUNTxDURATION@SPACING; {_OFF}: one of T",
    )
    parser.add_argument(
        "--shutter-blades",
        type=float,
        metavar="SHARE",
        help="share of T in which a between-the-lens shutter opens, and again closes: 0 to 0.5",
    )
    parser.add_argument(
        "--slit",
        metavar="EDGE:WIDTH",
        help=f"focal-plane shutter: the side it starts from ({', '.join(SLIT_EDGES)}), and the share of the "
        f"exposure that a point of the film gets, such as left:0.1; {_OFF}: all of the film at once",
    )

    parser.add_argument(
        "--flash",
        metavar="CURTAIN[:SHARE[:DURATION[:COUNT]]]",
        help=f"flash with the {' or '.join(CURTAINS)} curtain: its share of the light (default 0.5), how "
        f"long it lasts in units of T (0.01), and of how many a strobe is (1); {_OFF}: no flash",
    )


def _shutter(options: argparse.Namespace) -> ShutterAttributes:
    """Return what the options say of the exposure."""
    frames, slit = options.shutter, _slit(options.slit)
    if options.shutter_angle is not None:
        frames = options.shutter_angle / 360.0
    if options.shutter_gate is not None:
        if frames is None or options.slit is not None:
            raise SettingsError("--shutter-gate needs --shutter-angle or --shutter, and no --slit.")
        frames, slit = _rotary(frames, options.shutter_gate)
    shutter = ShutterAttributes(
        frames=frames,
        position=options.shutter_position,
        curve=_curve(options.shutter_curve),
        openings=_openings(options.exposures),
        blade_time=options.shutter_blades,
        slit=slit,
        flash=_flash(options.flash),
    )
    # What is wrong by itself is refused before any work starts.
    replace(shutter, frames=_default(frames, 1.0)).resolve()
    return shutter


def _rotary(frames: float, text: str) -> tuple[float, Slit]:
    edge, _, angle = text.rpartition(":")
    for known in SLIT_EDGES:
        if (edge or "top") == known:
            with contextlib.suppress(ValueError):
                gate = math.radians(float(angle))
                if 0.0 <= gate <= math.pi:
                    return rotary_slit(frames, gate, known)
    raise SettingsError(f"'{text}' is no gate; write its angle from 0 to 180 degrees as 30 or left:30.")


def _flash(text: str | None) -> Flash | None:
    if text is None:
        return None
    if text == _OFF:
        # A flash without light, since None would leave the file's.
        return Flash(share=0.0)
    curtain, *numbers = text.split(":")
    for known in CURTAINS:
        if curtain == known and len(numbers) <= len(_FLASH_NUMBERS):
            try:
                values = {name: kind(n) for (name, kind), n in zip(_FLASH_NUMBERS, numbers, strict=False)}
                return Flash(known, **values)
            except ValueError as error:
                if isinstance(error, SettingsError):
                    raise
    raise SettingsError(
        f"'{text}' is no flash; write {' or '.join(CURTAINS)}, its share, duration and count as in "
        f"second:0.5:0.01:1, or {_OFF}."
    )


def _curve(name: str | None) -> Curve | None:
    if name is None or name == _OFF:
        return None if name is None else ()
    try:
        with Path(name).open("rb") as file:
            # More is refused as no curve, without being held.
            text = file.read(schemas.MOST_CHARACTERS + 1).decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(
            f"The shutter's curve '{name}' cannot be read: {error.strerror or error}; give a JSON file."
        ) from error
    return parse_curve(text)


def _openings(text: str | None) -> Openings | None:
    if text is None or text == _OFF:
        return None if text is None else ()
    return parse_openings(text)


def _slit(text: str | None) -> Slit | None:
    if text is None:
        return None
    if text == _OFF:
        # A slit as wide as the film, since None would leave the file's.
        return Slit(width=1.0)
    edge, _, width = text.partition(":")
    for known in SLIT_EDGES:
        if edge == known:
            try:
                return Slit(known, float(width))
            except ValueError as error:
                if isinstance(error, SettingsError):
                    raise
    raise SettingsError(
        f"'{text}' is no slit; write {', '.join(SLIT_EDGES)} and its width as left:0.1, or {_OFF}."
    )


def _add_lens(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--focal-length", type=float, required=True, metavar="MM")
    parser.add_argument("--fstop", type=float, required=True, metavar="N")
    parser.add_argument("--focus-distance", type=float, required=True, metavar="M")


def _add_iris(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--blades", type=int, metavar="N", help="blades of the iris; 0 is round")
    parser.add_argument("--blade-rotation", type=float, metavar="DEG")
    parser.add_argument("--anamorphic-ratio", type=float, metavar="R", help="height over width")


def _lens(options: argparse.Namespace) -> Lens:
    return Lens(
        focal_length=options.focal_length / 1000.0,
        f_stop=options.fstop,
        focus_distance=options.focus_distance,
        blades=getattr(options, "blades", None) or 0,
        blade_rotation=math.radians(getattr(options, "blade_rotation", None) or 0.0),
        anamorphic_ratio=_default(getattr(options, "anamorphic_ratio", None), 1.0),
    )


def _default(value: float | None, default: float) -> float:
    return default if value is None else value


def _keyed(text: str | None, frame: int | None, scale: Scale) -> float | None:
    return None if text is None else parse_keys(text).at(frame, scale)


def _millimetres(value: float | None) -> float | None:
    return None if value is None else value / 1000.0


def _dof(options: argparse.Namespace) -> int:
    lens = _lens(options)
    limits: DepthOfField
    if options.circle_mm is None:
        limits = depth_of_field(lens, options.criterion)
    else:
        limits = depth_of_field_for_circle(lens, options.circle_mm / 1000.0, options.coc_model)
    values = {
        "hyperfocal_m": limits.hyperfocal,
        "near_m": limits.near,
        "far_m": plain(limits.far),
        "depth_of_field_m": plain(limits.total),
    }
    if options.json:
        print(json.dumps(plain(values)))
        return EXIT_DONE
    for name, value in values.items():
        label = name.removesuffix("_m").replace("_", " ")
        print(f"{label:>14}: " + ("infinity" if value is None or math.isinf(value) else f"{value:.4g} m"))
    return EXIT_DONE


def _psf(options: argparse.Namespace) -> int:
    lens = _lens(options)
    if not options.depth > 0.0:
        raise SettingsError(f"--depth must be greater than 0, not {options.depth:g}.")
    if (options.output is None) != (options.pixel_pitch_um is None):
        raise SettingsError("--output and --pixel-pitch-um go together: a pixel table needs both.")
    wavelength = _default(options.wavelength_nm, PRIMARY_WAVELENGTHS[1] * 1e9) * 1e-9
    if not (wavelength > 0.0 and math.isfinite(wavelength)):
        raise SettingsError(f"--wavelength-nm must be greater than 0, not {wavelength * 1e9:g}.")
    circle = float(circle_of_confusion(options.depth, lens, options.coc_model))
    edge = float(optical_radius(0.5 * abs(circle), lens, wavelength))
    # With the image plane held at F the exact defocus is v at the circle's rim.
    u = -math.copysign(edge, circle)
    if options.coc_model == "paper":
        u = float(optical_defocus(options.depth, lens, wavelength))
    reach = max(abs(u), edge) + _PAST_THE_EDGE
    if not reach <= _MAX_V:
        raise SettingsError(
            f"The point is too far out of focus for a diffraction pattern (u = {u:g}, at most {_MAX_V:g}); "
            "choose another --depth or a smaller aperture."
        )
    v = np.linspace(0.0, reach, min(max(256, math.ceil(reach * 4.0)), _MAX_PROFILE) + 1)
    values = {
        "u": u,
        "v": v.tolist(),
        "intensity": lommel_intensity(u, v).tolist(),
        "coc_mm": circle * 1000.0,
        "wavelength_nm": wavelength * 1e9,
        "coc_model": options.coc_model,
    }
    if options.output is not None:
        _write_table(options, lens, circle, None if options.wavelength_nm is None else wavelength)
    if options.json:
        print(json.dumps(plain(values)))
    else:
        print(f"u = {u:.6g}, circle of confusion {circle * 1000.0:.6g} mm")
    return EXIT_DONE


def _write_table(options: argparse.Namespace, lens: Lens, circle: float, wavelength: float | None) -> None:
    check_output(options.output)
    pitch = options.pixel_pitch_um * 1e-6
    film = Film(width=pitch, height=pitch, columns=1, rows=1)
    colors = PRIMARY_WAVELENGTHS if wavelength is None else (wavelength,) * 3
    settings = PsfSettings(kind=options.psf, wavelengths=colors)
    builder = PsfBuilder(lens, film, options.coc_model, settings)
    table = next(builder.tables(np.array([circle]))).dense()
    values = np.moveaxis(np.broadcast_to(table, (3, *table.shape[1:])), 0, 2)
    if options.output.suffix.lower() == ".png":
        png.write_png_table(options.output, values)
    else:
        opaque = np.ones((*values.shape[:2], 1))
        exr.write_picture(options.output, np.concatenate([values, opaque], axis=2).astype(np.float32), {})


def _process(options: argparse.Namespace) -> int:
    for path in (options.output, options.mask, options.error_map):
        if path is not None:
            check_output(Path(path))
    frames = _frames(options)
    batch = batch_options(options)
    # What is wrong with the settings is said before the first picture.
    for frame in frames:
        process_settings(options, frame)
    several = len(frames) > 1
    places = {frame: PicturePaths.of_frame(options, frame, several=several) for frame in frames}
    sources = {
        frame: options.input if frame is None else frame_path(options.input, frame) for frame in frames
    }
    refuse_replacing(list(places.values()), sources.values())
    if jit.set_thread_count(thread_count(options.threads)) > 1:
        _compile_beside(sources[frames[0]], process_settings(options, frames[0]))
    layers = tuple(options.layer) if options.layer else None
    reader = _Reader(layers)

    def begin(frame: int | None) -> _FrameOfFile:
        settings = replace(process_settings(options, frame), max_memory=batch.max_memory)
        return _FrameOfFile(sources[frame], places[frame], settings, layers, reader)

    return run_batch(frames, begin, batch)


def _frames(options: argparse.Namespace) -> tuple[int | None, ...]:
    """Return the frames to process; ``None`` where there is one file and no frame is named."""
    if options.frames is not None:
        return parse_frames(options.frames)
    if "#" not in options.input.name:
        return (None,)
    frames = existing_frames(options.input)
    if not frames:
        raise InputError(f"There is no frame of '{options.input}'; # stands for the frame's number.")
    return frames


class _Reader:
    """Reads samples files, and keeps the last one: a still may become an animation."""

    def __init__(self, layers: tuple[str, ...] | None) -> None:
        self._layers = layers
        self._last: tuple[Path, Samples] | None = None

    def read(self, source: Path) -> Samples:
        """Return the samples of a file."""
        if self._last is None or self._last[0] != source:
            self._last = None
            self._last = source, exr.read_samples(source, self._layers)
        return self._last[1]


@dataclass(frozen=True, slots=True)
class _FrameOfFile:
    """A frame of a batch whose samples are in a file, without a scene."""

    source: Path
    paths: PicturePaths
    settings: ProcessSettings
    layers: tuple[str, ...] | None
    reader: _Reader

    @property
    def output(self) -> Path:
        """The picture's file."""
        return self.paths.output.absolute()

    def standing(self) -> Standing:
        """Return what the picture and its maps are."""
        return self.paths.standing(self._mark)

    def make(self) -> Generator[float, None, None]:
        """Process the samples, and write all that was asked for."""
        samples = self.reader.read(self.source)
        settings = self.settings
        exposure = settings.shutter.over(samples.shutter).resolve() if settings.use_motion else None
        asked = exposure is not None and (settings.shutter.frames or settings.shutter.needs_length)
        if asked and not samples.knows_motion:
            raise InputError(
                f"'{self.source}' has neither motion paths nor a vector pass, which a shutter needs; "
                "render with the Vector pass or leave out the shutter's options."
            )
        result = yield from process(samples, settings)
        self.paths.write(result, samples, self._mark(), self.source)
        for what, count in samples.repaired.items():
            print(f"Repaired {count} {what} values that were not finite from their neighbours.", flush=True)

    def _mark(self) -> Mark:
        return picture_mark(self.settings, self.layers, self.source)


_BESIDE: Final[list[str]] = []
"""The kernel for which a second process was started: one is enough, however many pictures a process makes."""


def _compile_beside(source: Path, settings: ProcessSettings) -> None:
    """Have a second process compile kernels too, should any of a picture's have to be."""

    def start(kernel: str) -> None:
        if _BESIDE:
            return
        _BESIDE.append(kernel)
        words = [str(source.absolute()), json.dumps(settings_to_json(settings))]
        kept = jit.cache_directory()
        # Alone it takes longer, and comes to the same.
        with contextlib.suppress(OSError, InputError):
            beside.start("warm", words if kept is None else [*words, str(kept)], subprocess.DEVNULL)

    jit.on_compile(start)


def _list_effects(options: argparse.Namespace) -> int:
    rows = described()
    if options.json:
        print(json.dumps(rows))
        return EXIT_DONE
    for row in rows:
        default, unit = row["default"], row["unit"]
        if isinstance(default, bool):
            default = "on" if default else "off"
        elif isinstance(default, list):
            default = ",".join(f"{part:g}" for part in default)
        limits = "|".join(row["choices"])
        if row["least"] is not None:
            limits = f"{row['least']:g} to {row['most']:g}"
        facts = ", ".join(filter(None, (unit, f"default {default}" if default != "" else "", limits)))
        print(
            f"{row['name']:>30}: {row['about']} ({facts})" if facts else f"{row['name']:>30}: {row['about']}"
        )
    return EXIT_DONE


def _info(options: argparse.Namespace) -> int:
    raw = exr.read_raw(options.input)
    values = _describe_file(raw)
    try:
        values |= _describe_samples(exr.samples_of(raw, options.input))
    except InputError as error:
        values["not_processable"] = str(error)
    if options.json:
        print(json.dumps(plain(values)))
        return EXIT_DONE
    layers = values.pop("layers", [])
    for name, value in values.items():
        print(f"{name.replace('_', ' '):>16}: {_readable(value)}")
    for layer in layers:
        print(f"{'layer':>16}: '{_readable(layer.pop('name'))}', {_readable(layer)}")
    return EXIT_DONE


def _readable(value: Any) -> str:
    if value is None:
        return "unknown"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        inner = "; ".join(f"{key.replace('_', ' ')} {_readable(item)}" for key, item in value.items())
        return inner or "none"
    if isinstance(value, list):
        # Pairs, as --exposures has them.
        parts = (
            ":".join(map(_readable, item)) if isinstance(item, list) else _readable(item) for item in value
        )
        inner = ", ".join(parts)
        return inner or "none"
    # A file's own words may hold what a terminal would obey.
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in str(value)
    )


def _describe_file(raw: exr.RawFile) -> dict[str, Any]:
    """Return what any file says, ready for JSON."""
    display = raw.display_window
    return {
        "size": [display.columns, display.rows],
        "display_window": [display.x0, display.y0, display.x1, display.y1],
        "parts": raw.parts,
        "passes": sorted({channel.full_name.rpartition(".")[0] or "RGBAZ" for channel in raw.channels}),
        "channels": [channel.full_name for channel in raw.channels],
    }


def _describe_samples(samples: Samples) -> dict[str, Any]:
    """Return what the samples in a file are, ready for JSON: depths in metres, motion in pixels."""
    data = samples.data_window
    layers = []
    for layer in samples.layers:
        finite = layer.depth[np.isfinite(layer.depth)] if layer.depth is not None else np.empty(0)
        motion = None
        if layer.vector is not None:
            motion = [float(np.hypot(*np.moveaxis(layer.vector[..., i : i + 2], 2, 0)).max()) for i in (0, 2)]
        layers.append(
            {
                "name": layer.name,
                "depth_m": [float(finite.min()), float(finite.max())] if finite.size else None,
                "without_surface": (None if layer.depth is None else float(np.mean(np.isinf(layer.depth)))),
                "objects": None if layer.object_index is None else np.unique(layer.object_index).tolist(),
                "motion_px": motion,
                "companions": [
                    kind
                    for kind in ("stationary", "moving", "absent", "reflected", "transmitted")
                    if getattr(layer, kind) is not None
                ],
            }
        )
    camera = None
    if samples.camera is not None:
        pan, tilt, swing = pan_tilt_swing(samples.camera.world_to_camera[:3, :3])
        center = np.linalg.inv(samples.camera.world_to_camera)[:3, 3]
        camera = {
            "position_m": center.tolist(),
            "pan_deg": math.degrees(pan),
            "tilt_deg": math.degrees(tilt),
            "swing_deg": math.degrees(swing),
        }
    lens = samples.lens
    return {
        "data_window": [data.x0, data.y0, data.x1, data.y1],
        "pixel_aspect": samples.pixel_aspect,
        "sample_position": samples.position,
        "supersampling": samples.supersampling,
        "layers": layers,
        "lens": {
            "focal_length_mm": None if lens.focal_length is None else lens.focal_length * 1000.0,
            "f_stop": lens.f_stop,
            "focus_distance_m": lens.focus_distance,
            "blades": lens.blades,
        },
        "film_mm": (
            None if samples.film is None else [samples.film.width * 1000.0, samples.film.height * 1000.0]
        ),
        "camera": camera,
        "shutter": _describe_shutter(samples.shutter),
        "motion": (
            None
            if samples.paths is None
            else {
                "objects": len(samples.paths.objects),
                "deforming": sum(path.deforming for path in samples.paths.objects),
                "camera_moves": samples.paths.camera.moves,
            }
        ),
        "repaired": samples.repaired,
    }


def _describe_shutter(shutter: ShutterAttributes) -> dict[str, Any]:
    """Return what a file says of the exposure, ready for JSON."""
    frames = shutter.frames
    if frames is None and shutter.exposure_time is not None and shutter.frames_per_second is not None:
        frames = shutter.exposure_time * shutter.frames_per_second
    slit = shutter.slit
    return {
        "frames": frames,
        "exposure_time_s": shutter.exposure_time,
        "position": shutter.position,
        "curve": bool(shutter.curve),
        "openings": [list(opening) for opening in shutter.openings or ()],
        "blade_time": shutter.blade_time or 0.0,
        "slit": None if slit is None else {"edge": slit.edge, "width": slit.width},
        "flash": None if shutter.flash is None else asdict(shutter.flash),
    }
