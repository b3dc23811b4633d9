"""Measure depth of field against Cycles' own: the focus processor beside Blender's Defocus node and GEGL.

For each scene of `lens_scenes` it renders a reference with Cycles' depth of field and samples files as the
extension's command does, lets the processor and the other tools make their pictures of them, and compares
all. Renders and the other tools' pictures are kept in build/bench/cache/lens; tables and pictures go to
build/bench/lens.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "bench" / "lens"

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
os.environ["BLENDER_USER_RESOURCES"] = str(ROOT / "build" / "bench" / "blender")
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402, F401 - brings what the modules below import
import measures  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import peers  # noqa: E402
from contact_sheet import write_sheet  # noqa: E402
from lens_regions import REGIONS, Region, reached, regions  # noqa: E402
from lens_renders import FULL, QUICK, Renders, displayed_part, say, shown_psnr  # noqa: E402
from lens_scenes import SCENES  # noqa: E402
from scipy import stats  # noqa: E402

from potmesil_addon.errors import PotmesilError  # noqa: E402
from potmesil_addon.lens import Lens  # noqa: E402
from potmesil_addon.process import ProcessSettings, Result, focus_settings, process  # noqa: E402
from potmesil_addon.progress import run  # noqa: E402
from potmesil_addon.samples import SampleLayer, Samples  # noqa: E402

Picture = npt.NDArray[np.float32]

_ERROR_GAIN = 8.0

_BLOCK = 8
"""Side in pixels of the blocks in which the predicted error is compared with the true one."""

_STILL = 0.25
"""Pixels within the exposure that do not count as motion."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)

FRAME = "frame"
WHOLE = {FRAME: "Whole frame", **REGIONS}
MOVING = "moving"
"""The region of scenes with motion."""

_VISIBILITY = "visibility"
"""The processor's setting for what hides what, where it has one."""

OURS = {
    "eq22": ("ordinary", "none"),
    "ordinary": ("ordinary", "aperture"),
    "points": ("points", "aperture"),
    "fine": ("fine", "aperture"),
    "hidden": ("hidden", "aperture"),
    "points_hidden": ("points_hidden", "aperture"),
    "fine_hidden": ("fine_hidden", "aperture"),
}
"""Our pictures: of which samples, and with what visibility. The first is the papers' equation alone."""

COLUMNS = {
    "pinhole": "pinhole",
    "eq22": "eq. 22",
    "ordinary": "ours",
    "points": "ours, points",
    "fine": "ours, fine",
    "hidden": "ours, hidden",
    "points_hidden": "ours, points + hidden",
    "fine_hidden": "ours, fine + hidden",
    "defocus": "Defocus",
    "gegl": "GEGL",
    "cycles": "Cycles, equal time",
}
"""Titles of the tables' columns."""

_MEASURES = ("psnr", "ssim", "flip")

BEST = ("hidden", "ordinary", "eq22")
"""Which of ours is shown in pictures: the first that there is."""


@dataclass(slots=True)
class Outcome:
    """What came out of a scene."""

    scene: str
    purpose: str
    moves: bool
    largest: float
    spp: int
    floor: dict[str, measures.Likeness]
    shares: dict[str, float]
    likeness: dict[str, dict[str, measures.Likeness]] = field(default_factory=dict)
    alpha: dict[str, float] = field(default_factory=dict)
    setups: dict[str, str] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    prediction: dict[str, dict[str, float]] = field(default_factory=dict)
    equal_spp: int = 0

    def psnr(self, name: str, region: str) -> float | None:
        """Return the PSNR of a picture in a region, where there are both."""
        found = self.likeness.get(name, {}).get(region)
        return None if found is None else found.psnr

    def gain(self, name: str, region: str) -> float | None:
        """Return how many dB a picture is ahead of the Defocus node."""
        ours, node = self.psnr(name, region), self.psnr("defocus", region)
        return None if ours is None or node is None else ours - node

    def to_json(self) -> dict[str, Any]:
        """Return everything, ready for JSON."""
        values = dataclasses.asdict(self)
        values["floor"] = {region: found.to_json() for region, found in self.floor.items()}
        values["likeness"] = {
            name: {region: found.to_json() for region, found in by_region.items()}
            for name, by_region in self.likeness.items()
        }
        # JSON knows no infinity: the same alpha everywhere.
        values["alpha"] = {name: value if np.isfinite(value) else None for name, value in self.alpha.items()}
        values["gain_over_defocus"] = {
            name: {region: self.gain(name, region) for region in self.floor}
            for name in OURS
            if name in self.likeness
        }
        return values


@dataclass(slots=True)
class Pictures:
    """A scene's pictures, in the display window, with alpha."""

    reference: Picture
    named: dict[str, Picture] = field(default_factory=dict)


def our_settings(visibility: str, *, moves: bool) -> ProcessSettings | None:
    """Return settings for a visibility, or None where the processor does not know it."""
    known = {f.name for f in dataclasses.fields(ProcessSettings)}
    if _VISIBILITY in known:
        chosen: dict[str, Any] = {_VISIBILITY: visibility}
        return ProcessSettings(use_motion=moves, **chosen)
    return ProcessSettings(use_motion=moves) if visibility == "none" else None


def measure(renders: Renders, *, again: bool = False) -> tuple[Outcome, Pictures]:
    """Make all pictures of a scene's samples and compare them with the reference.

    Parameters
    ----------
    renders : Renders
        The scene's cached renders.
    again : bool
        Whether the other tools' pictures are made again too.

    Returns
    -------
    Outcome, Pictures
        What came out.
    """
    item = renders.item
    first, second, spp = renders.references()
    reference = 0.5 * (first + second)
    samples = renders.samples("ordinary")
    layer = samples.layers[0]
    settings = focus_settings(samples, ProcessSettings())
    lens, film = settings.lens, settings.film
    radius = peers.radii(layer, lens, film)
    sharp = displayed_part(layer.color, samples)
    found: dict[str, Region | None] = {FRAME: None}
    if item.moves:
        found[MOVING] = displayed_part(_moving(layer, radius, samples.shutter.frames or 0.0), samples)
    else:
        found |= {
            name: displayed_part(where, samples) for name, where in regions(radius, layer.color).items()
        }
    outcome = Outcome(
        item.name,
        item.purpose,
        item.moves,
        float(np.abs(radius).max()),
        spp,
        measures.compare_regions(first[..., :3], second[..., :3], found),
        {name: 1.0 if where is None else float(where.mean()) for name, where in found.items()},
    )
    pictures = Pictures(reference, {"pinhole": sharp})
    cpu: dict[str, float] = {}
    for name, (mode, visibility) in OURS.items():
        ours = our_settings(visibility, moves=item.moves)
        if ours is None or mode not in renders.modes:
            continue
        result, outcome.seconds[name], cpu[name] = _processed(renders.samples(mode), ours)
        pictures.named[name] = result.picture
        predicted = getattr(result, "predicted_error", None)
        if predicted is not None:
            outcome.prediction[name] = prediction(predicted, reference, result.picture)
    shutter = samples.shutter.frames if item.moves else None
    tools = {"defocus": _defocus(renders, samples, lens, shutter, again=again)}
    if peers.gegl_program() is not None and not item.moves:
        tools["gegl"] = _gegl(renders, samples, lens, again=again)
    for name, (made, seconds) in tools.items():
        scores = {setup: shown_psnr(reference, picture) for setup, picture in made.items()}
        best = max(scores, key=lambda setup: scores[setup])
        outcome.setups[name], outcome.seconds[name] = best, seconds[best]
        pictures.named[name] = made[best]
    outcome.seconds["render"] = renders.facts()["ordinary_seconds"]
    outcome.equal_spp = renders.equal_time(cpu["ordinary" if "ordinary" in cpu else "eq22"])
    pictures.named["cycles"] = renders.cycles(outcome.equal_spp)
    for name, picture in pictures.named.items():
        outcome.likeness[name] = measures.compare_regions(reference[..., :3], picture[..., :3], found)
        if reference[..., 3].min() < 1.0:
            outcome.alpha[name] = measures.psnr(reference[..., 3], picture[..., 3])
    return outcome, pictures


def prediction(predicted: Picture, reference: Picture, picture: Picture) -> dict[str, float]:
    """Return how well a predicted error ranks pixels, and blocks of them, by their true error.

    Parameters
    ----------
    predicted : ndarray of shape (rows, columns)
        What the processor says.
    reference, picture : ndarray of shape (rows, columns, 4)
        Scene-linear.

    Returns
    -------
    dict of str to float
        Spearman's rank correlation with the absolute difference of luminance as displayed.
    """
    shown = [measures.displayed(values[..., :3]) @ _LUMINANCE for values in (reference, picture)]
    error = np.abs(shown[0] - shown[1])

    def blocks(values: Picture) -> Picture:
        rows, columns = (side // _BLOCK for side in values.shape)
        cut = values[: rows * _BLOCK, : columns * _BLOCK]
        return np.asarray(cut.reshape(rows, _BLOCK, columns, _BLOCK).mean(axis=(1, 3)))

    return {
        "pixels": float(stats.spearmanr(predicted.ravel(), error.ravel()).statistic),
        "blocks": float(stats.spearmanr(blocks(predicted).ravel(), blocks(error).ravel()).statistic),
    }


def _moving(layer: SampleLayer, radius: npt.NDArray[np.float64], shutter: float) -> Region:
    """Return where moving samples get to while the shutter is open, each with its own circle."""
    assert layer.vector is not None
    # The pass has where a sample was a frame before and where it will be a frame after.
    travel = np.hypot(layer.vector[..., 0::2], layer.vector[..., 1::2]).max(axis=2) * 0.5 * shutter
    return reached(travel > _STILL, np.abs(radius) + travel)


def _processed(samples: Samples, settings: ProcessSettings) -> tuple[Result, float, float]:
    """Return what the processor makes, its seconds and its processor time."""
    started, cpu_started = time.perf_counter(), time.process_time()
    result = run(process(samples, settings))
    return result, time.perf_counter() - started, time.process_time() - cpu_started


def _defocus(
    renders: Renders, samples: Samples, lens: Lens, shutter: float | None, *, again: bool
) -> tuple[dict[str, Picture], dict[str, float]]:
    """Return the Defocus node's pictures and their seconds, by how it was set up."""
    layer, film = samples.layers[0], samples.film
    assert film is not None
    setups = peers.defocus_setups(peers.largest_radius(layer, lens, film), lens, shutter)
    makers = {
        setup.name: lambda setup=setup: peers.defocus(layer, lens, film, setup, renders.folder)
        for setup in setups
    }
    return _tool(renders, "defocus", samples, makers, again=again)


def _gegl(
    renders: Renders, samples: Samples, lens: Lens, *, again: bool
) -> tuple[dict[str, Picture], dict[str, float]]:
    """Return GEGL's pictures and their seconds, by how it was set up."""
    layer, film = samples.layers[0], samples.film
    assert film is not None
    setups = peers.gegl_setups(peers.largest_radius(layer, lens, film))
    makers = {
        setup.name: lambda setup=setup: peers.lens_blur(layer, lens, film, setup, renders.folder)
        for setup in setups
    }
    return _tool(renders, "gegl", samples, makers, again=again)


def _tool(
    renders: Renders, name: str, samples: Samples, makers: dict[str, Callable[[], Picture]], *, again: bool
) -> tuple[dict[str, Picture], dict[str, float]]:
    """Return a tool's pictures in the display window from the cache, made now where they are not there."""
    path = renders.folder / f"{name}.npz"
    fresh = path.exists() and path.stat().st_mtime > renders.samples_file("ordinary").stat().st_mtime
    made: dict[str, Picture] = {}
    seconds: dict[str, float] = {}
    if fresh and not again:
        with np.load(path) as values:
            made = {setup: values[setup] for setup in values.files}
        seconds = renders.facts().get(f"{name}_seconds", {})
    if set(made) != set(makers):
        made = {}
        for setup, maker in makers.items():
            picture, seconds[setup] = peers.timed(maker)
            made[setup] = displayed_part(picture, samples)
        np.savez(path, **made)
        renders.note(**{f"{name}_seconds": seconds})
        say(f"{renders.item.name}: {name} in {', '.join(f'{s:.1f}' for s in seconds.values())} s")
    return made, seconds


def write_pictures(outcome: Outcome, pictures: Pictures) -> None:
    """Write the sheet of a scene: every picture, and below it how far it is from the reference."""
    shown = {name: measures.displayed(picture[..., :3]) for name, picture in pictures.named.items()}
    reference = measures.displayed(pictures.reference[..., :3])
    tiles = [
        (
            f"reference, {outcome.scene}: {outcome.spp} spp, noise {outcome.floor[FRAME].psnr:.1f} dB",
            reference,
        )
    ]
    errors = [("x 8: |picture - reference|", np.zeros_like(reference))]
    for name in (name for name in COLUMNS if name in shown):
        tiles.append((_label(outcome, name), shown[name]))
        errors.append((f"{COLUMNS[name]} x 8", _error(shown[name], reference)))
    columns = -(-len(tiles) // 2)
    rows: list[tuple[str, Picture]] = []
    while len(tiles) % columns:
        tiles.append(("", np.zeros_like(reference)))
        errors.append(("", np.zeros_like(reference)))
    for start in range(0, len(tiles), columns):
        rows += tiles[start : start + columns] + errors[start : start + columns]
    write_sheet(OUTPUT / f"{outcome.scene}.png", rows, columns)


def overview(outcome: Outcome, pictures: Pictures) -> list[tuple[str, Picture]]:
    """Return a scene's row on the page of pictures, at half the size: the pictures, and then their errors."""
    reference = measures.displayed(pictures.reference[..., :3])
    row = [(f"{outcome.scene}: reference", reference)]
    errors = []
    for name in (best(outcome), "defocus", "pinhole"):
        picture = measures.displayed(pictures.named[name][..., :3])
        row.append((_label(outcome, name), picture))
        errors.append((f"{COLUMNS[name]} x {_ERROR_GAIN:.0f}", _error(picture, reference)))
    return [(label, _halved(picture)) for label, picture in row + errors]


def best(outcome: Outcome) -> str:
    """Return which of our pictures is shown."""
    return next(name for name in BEST if name in outcome.likeness)


def _halved(picture: Picture) -> Picture:
    """Return a picture at half its size; an upright one lies on its side, so that all have one size."""
    lying = np.rot90(picture) if picture.shape[0] > picture.shape[1] else picture
    rows, columns = (side // 2 for side in lying.shape[:2])
    quarters = lying[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3)
    return np.asarray(np.clip(quarters, 0.0, 1.0).mean(axis=(1, 3)), dtype=np.float32)


def _label(outcome: Outcome, name: str) -> str:
    spp = f" ({outcome.equal_spp} spp)" if name == "cycles" else ""
    return f"{COLUMNS[name]}{spp}: {outcome.likeness[name][FRAME].psnr:.2f} dB"


def _error(picture: Picture, reference: Picture) -> Picture:
    return np.abs(picture - reference) * np.float32(_ERROR_GAIN)


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the results as Markdown: a table for each region, then motion, prediction, alpha and times."""
    still = [o for o in outcomes if not o.moves]
    moving = [o for o in outcomes if o.moves]
    lines = [
        "PSNR in dB / SSIM / FLIP as displayed (sRGB). *Cycles, equal time* has the samples a pixel that "
        "take as much processor time as rendering the pinhole samples and processing them; refocusing takes "
        "the processing alone. Of the other tools the best setup counts. The best picture made after a "
        "render is **bold**.",
        "",
    ]
    for region, title in WHOLE.items():
        chosen = [o for o in still if region in o.floor]
        if chosen:
            lines += [f"## {title}", "", *_table(chosen, region), ""]
    for region, title in ((FRAME, "whole frame"), (MOVING, "where things move")):
        if moving:
            lines += [f"## Lens and motion, {title}", "", *_table(moving, region), ""]
    predicted = [(o, name) for o in outcomes for name in o.prediction]
    if predicted:
        lines += ["## Predicted error", "", "Spearman's rank correlation with the true error.", ""]
        lines += _row("Scene", "samples", f"blocks of {_BLOCK} x {_BLOCK}", "pixels"), "|---|---|--:|--:|"
        lines += [
            _row(
                o.scene,
                COLUMNS[name],
                f"{o.prediction[name]['blocks']:.3f}",
                f"{o.prediction[name]['pixels']:.3f}",
            )
            for o, name in predicted
        ]
        for name in OURS:
            values = [o.prediction[name] for o in outcomes if name in o.prediction]
            if values:
                medians = [
                    f"{statistics.median(v[kind] for v in values):.3f}" for kind in ("blocks", "pixels")
                ]
                lines.append(_row("**median**", COLUMNS[name], *medians))
        lines.append("")
    with_alpha = [o for o in outcomes if o.alpha]
    if with_alpha:
        names = [name for name in COLUMNS if any(name in o.alpha for o in with_alpha)]
        lines += ["## Alpha", "", "PSNR in dB.", "", _row("Scene", *(COLUMNS[n] for n in names))]
        lines += ["|---|" + "--:|" * len(names)]
        lines += [_row(o.scene, *(_number(o.alpha.get(n)) for n in names)) for o in with_alpha]
        lines.append("")
    timed = [name for name in ("render", *COLUMNS) if any(name in o.seconds for o in outcomes)]
    titles = [{"render": "pinhole render"}.get(name, COLUMNS.get(name, name)) for name in timed]
    lines += [
        "## Seconds and setups",
        "",
        _row("Scene", "largest circle", *titles, "Cycles spp", "Defocus", "GEGL"),
    ]
    lines += ["|---|--:|" + "--:|" * len(timed) + "--:|---|---|"]
    for o in outcomes:
        seconds = [_number(o.seconds.get(name)) for name in timed]
        setup = [o.setups.get(name, "") for name in ("defocus", "gegl")]
        lines.append(_row(o.scene, f"{o.largest:.1f} px", *seconds, o.equal_spp, *setup))
    return "\n".join([*lines, ""])


def _table(outcomes: Sequence[Outcome], region: str) -> list[str]:
    """Return a table of all pictures in a region, with medians and gains over the Defocus node."""
    names = [name for name in COLUMNS if any(name in o.likeness for o in outcomes)]
    gains = [name for name in OURS if name in names]
    head = _row(
        "Scene", "share", "noise", *(COLUMNS[n] for n in names), *(f"{COLUMNS[n]} - Defocus" for n in gains)
    )
    lines = [head, "|---|" + "--:|" * (2 + len(names) + len(gains))]
    rivals = [name for name in names if name != "cycles"]
    for o in outcomes:
        top = max(rivals, key=lambda name: o.psnr(name, region) or 0.0)
        cells = [_cell(o.likeness.get(name, {}).get(region), strong=name == top) for name in names]
        found = [_signed(o.gain(name, region)) for name in gains]
        share = f"{100.0 * o.shares[region]:.0f} %"
        lines.append(_row(o.scene, share, f"{o.floor[region].psnr:.1f}", *cells, *found))
    medians = []
    for name in names:
        likeness = [o.likeness[name][region] for o in outcomes if name in o.likeness]
        middle = [statistics.median(getattr(found, what) for found in likeness) for what in _MEASURES]
        # A median of other scenes compares with nothing.
        some = "" if len(likeness) == len(outcomes) else f" ({len(likeness)} of {len(outcomes)})"
        medians.append(f"{middle[0]:.2f} / {middle[1]:.3f} / {middle[2]:.3f}{some}")
    gained = [_signed(_median(o.gain(name, region) for o in outcomes)) for name in gains]
    lines.append(_row("**median**", "", "", *medians, *gained))
    return lines


def _median(values: Iterable[float | None]) -> float | None:
    found = [value for value in values if value is not None]
    return statistics.median(found) if found else None


def _row(*cells: object) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def _cell(likeness: measures.Likeness | None, *, strong: bool) -> str:
    if likeness is None:
        return ""
    psnr = f"**{likeness.psnr:.2f}**" if strong else f"{likeness.psnr:.2f}"
    return f"{psnr} / {likeness.ssim:.3f} / {likeness.flip:.3f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _signed(value: float | None) -> str:
    return "" if value is None else f"{value:+.2f}"


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", action="append", choices=SCENES, metavar="NAME", help="may be repeated")
    parser.add_argument("--list", action="store_true", help="name the scenes and what they are for")
    parser.add_argument("--quick", action="store_true", help="few samples: a look, and no measurement")
    parser.add_argument(
        "--reprocess", action="store_true", help="render nothing; skip scenes without cached files"
    )
    parser.add_argument(
        "--again", action="store_true", help="export the samples and run the other tools again"
    )
    parser.add_argument("--prepare", action="store_true", help="render what is missing, and stop")
    parser.add_argument("--motion", action="store_true", help="append the tables of motion_fidelity.py")
    options = parser.parse_args()
    if options.list:
        for item in SCENES.values():
            print(f"{item.name:>18}  {item.purpose}")
        return 0
    OUTPUT.mkdir(parents=True, exist_ok=True)
    if peers.gegl_program() is None:
        say("GEGL is not installed (Debian: apt-get install gegl): its column is left out")
    outcomes: list[Outcome] = []
    page: list[tuple[str, Picture]] = []
    failed = []
    for name in options.scene or SCENES:
        renders = Renders(SCENES[name], QUICK if options.quick else FULL)
        if not options.reprocess:
            renders.prepare(again=options.again)
        elif not renders.complete:
            say(f"{name}: nothing cached, skipped")
            continue
        if options.prepare:
            print(f"{name} {renders.folder}", flush=True)
            continue
        if not outcomes:
            # Compiling is no part of what is timed.
            _warm_up(renders)
        try:
            outcome, pictures = measure(renders, again=options.again)
        except PotmesilError as error:
            failed.append(name)
            say(f"{name}: {error}")
            continue
        write_pictures(outcome, pictures)
        outcomes.append(outcome)
        page += overview(outcome, pictures)
        gains = (f"{COLUMNS[n]} {_signed(outcome.gain(n, FRAME))}" for n in OURS if n in outcome.likeness)
        say(f"{name}: over Defocus in dB: {', '.join(gains)}")
    if outcomes:
        _finish(outcomes, page, options)
    return 1 if failed else 0


def _warm_up(renders: Renders) -> None:
    for mode, visibility in OURS.values():
        settings = our_settings(visibility, moves=renders.item.moves)
        if settings is not None and mode in renders.modes:
            run(process(renders.samples(mode), settings))


def _finish(outcomes: list[Outcome], page: list[tuple[str, Picture]], options: argparse.Namespace) -> None:
    """Write tables, numbers and the page of pictures."""
    # A part of the scenes has no median that could be compared.
    stem = "part" if options.scene else "quick" if options.quick else "results"
    text = report(outcomes)
    if options.motion:
        script = Path(__file__).with_name("motion_fidelity.py")
        passed = [flag for flag in ("--quick", "--reprocess") if getattr(options, flag[2:])]
        done = subprocess.run(
            [sys.executable, str(script), *passed], stdout=subprocess.PIPE, text=True, check=False
        )
        tables = done.stdout[done.stdout.find("## ") :]
        text += "\n# Motion alone\n\n" + tables
    print(text)
    (OUTPUT / f"{stem}.md").write_text(text, encoding="utf-8")
    values = [outcome.to_json() for outcome in outcomes]
    (OUTPUT / f"{stem}.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    write_sheet(OUTPUT / f"{stem}.png", page, columns=len(page) // len(outcomes))


if __name__ == "__main__":
    sys.exit(main())
