"""Measure reflections and refractions against Cycles' own blur: ours without and with their own depths.

For each scene of `reflection_scenes` it renders a reference with Cycles' depth of field and motion blur, and
samples files as the extension's command does, once with reflections off and once with them on. It compares
the processor's pictures and those of Blender's Defocus and Vector Blur nodes with the reference, where
something is reflected or refracted and where not. Renders and the nodes' pictures are kept in
build/bench/cache/reflections; tables and pictures go to build/bench/reflections.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CACHE = ROOT / "build" / "bench" / "cache" / "reflections"
OUTPUT = ROOT / "build" / "bench" / "reflections"
DOCS_PICTURE = ROOT / "docs" / "images" / "reflections.jpg"

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
os.environ["BLENDER_USER_RESOURCES"] = str(ROOT / "build" / "bench" / "blender")
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402
import measures  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import OpenEXR  # noqa: E402
import peers  # noqa: E402
from contact_sheet import write_sheet  # noqa: E402
from lens_renders import MODES, Quality, carry_on, displayed_part, enough, export, say, shown_psnr  # noqa: E402
from motion_scenes import Exposure  # noqa: E402
from reflection_scenes import SCENES, ReflectionScene, open_scene  # noqa: E402
from vector_blur import Setup, setups, vector_blur  # noqa: E402

from potmesil_addon import exr  # noqa: E402
from potmesil_addon.errors import PotmesilError  # noqa: E402
from potmesil_addon.process import ProcessSettings, focus_settings, process  # noqa: E402
from potmesil_addon.progress import run  # noqa: E402
from potmesil_addon.samples import Samples  # noqa: E402
from sample_scenes import rendering  # noqa: E402

Picture = npt.NDArray[np.float32]
Region = npt.NDArray[np.bool_]

FULL = Quality("full", 256, 1024, 43.0, 0.0, 256)
QUICK = Quality("quick", 32, 32, 0.0, 0.0, 32)

_ERROR_GAIN = 8.0

_EXPORT_SEED = 5

_SHARE = 0.3
"""Share of a pixel's light that is reflected or refracted from which the pixel counts as reflecting."""

_SHARE_SAMPLES = 64

_PASSES = ("combined", "object_index", *(
    f"{kind}_{part}" for kind in ("glossy", "transmission") for part in ("direct", "indirect", "color")
))  # fmt: skip

REFLECTING, OTHERS, FRAME = "reflecting", "non-reflecting", "whole"

EXPORTS = {"without": "OFF", "with": "REFLECTIONS_AND_SHADOWS"}
"""Our pictures, and the extension's setting that their samples are exported with."""

COLUMNS = {"without": "ours without", "with": "ours with", "node": "node"}

DOCS_SCENES = ("puddle", "puddle_moving", "shop_window", "chrome")
"""Those in the docs' picture, all of one size."""

TOLERANCE_DB = 3.0
"""How far reflecting regions may stay behind the others."""


@dataclass(slots=True)
class Outcome:
    """What came out of a scene."""

    scene: str
    purpose: str
    spp: int
    own_spp: int
    floor: dict[str, measures.Likeness]
    shares: dict[str, float]
    likeness: dict[str, dict[str, measures.Likeness]] = field(default_factory=dict)
    node_setup: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    def behind(self, name: str) -> float | None:
        """Return how many dB a picture's reflecting region stays behind the others."""
        if name not in self.likeness:
            return None
        return self.likeness[name][OTHERS].psnr - self.likeness[name][REFLECTING].psnr

    def limit(self, region: str) -> float:
        """Return the PSNR in dB that noise alone leaves to a picture of our samples that blurs nothing.

        Two references of n samples differ by twice their variance; ours of m samples has n / m of it, and
        the mean of the references half of it.
        """
        own = self.spp / self.own_spp + 0.5
        return self.floor[region].psnr + 10.0 * math.log10(2.0 / own)

    def behind_limit(self, name: str) -> float | None:
        """Return how many dB a picture's reflecting region stays behind the others beyond its noise."""
        behind = self.behind(name)
        return None if behind is None else behind - (self.limit(OTHERS) - self.limit(REFLECTING))

    def to_json(self) -> dict[str, Any]:
        """Return everything, ready for JSON."""
        return {
            "scene": self.scene,
            "purpose": self.purpose,
            "reference_spp": self.spp,
            "own_spp": self.own_spp,
            "limit_db": {region: self.limit(region) for region in self.floor},
            "noise_floor": {region: found.to_json() for region, found in self.floor.items()},
            "shares": self.shares,
            "likeness": {
                name: {region: found.to_json() for region, found in by_region.items()}
                for name, by_region in self.likeness.items()
            },
            "reflecting_behind_db": {name: self.behind(name) for name in self.likeness},
            "reflecting_behind_limit_db": {name: self.behind_limit(name) for name in self.likeness},
            "node_setup": self.node_setup,
            "seconds": self.seconds,
        }


class Renders:
    """The cached renders of one scene.

    Parameters
    ----------
    item : ReflectionScene
        The scene.
    quality : Quality
        How well it is rendered.
    """

    def __init__(self, item: ReflectionScene, quality: Quality) -> None:
        self.item, self.quality = item, quality
        self.folder = CACHE / f"{item.name}-{item.key()}-{quality.name}"

    @property
    def reference_file(self) -> Path:
        """Two references with independent noise, and how many samples they have."""
        return self.folder / "reference.npz"

    @property
    def share_file(self) -> Path:
        """Which share of each pixel's light is reflected or refracted, and which objects do it."""
        return self.folder / "share.npz"

    @property
    def complete(self) -> bool:
        """Whether there is enough to compare something."""
        return all(
            path.exists() for path in (self.reference_file, self.share_file, self.samples_file("without"))
        )

    def samples_file(self, name: str) -> Path:
        """Return where the samples of one of our pictures are."""
        return self.folder / f"{name}.exr"

    def samples(self, name: str) -> Samples:
        """Return the samples of one of our pictures."""
        return exr.read_samples(self.samples_file(name))

    def references(self) -> tuple[Picture, Picture, int]:
        """Return the two references (premultiplied, with alpha) and their samples a pixel."""
        with np.load(self.reference_file) as values:
            return values["first"], values["second"], int(values["spp"])

    def prepare(self, *, again: bool = False) -> None:
        """Render what is not there, the samples also if they are wanted again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if not self._enough():
            scene = open_scene(self.item)
            scene.camera.data.dof.use_dof = self.item.lens
            scene.render.use_motion_blur = self.item.moves
            carry_on(scene, self.reference_file, self.quality, self.item.name)
        if not self.share_file.exists():
            self._render_share()
        now = _export_key()
        for name, setting in EXPORTS.items():
            if again or not self.samples_file(name).exists():
                self._render_samples(name, setting)
            elif self._exported_by(name) != now:
                say(f"{self.item.name}: samples {name} are older than the export's code, see --again")

    def regions(self) -> dict[str, Region | None]:
        """Return where something is reflected or refracted, and where not."""
        with np.load(self.share_file) as values:
            reflecting = np.asarray((values["share"] > _SHARE) & values["named"])
        return {REFLECTING: reflecting, OTHERS: ~reflecting, FRAME: None}

    def _enough(self) -> bool:
        return self.reference_file.exists() and enough(*self.references(), self.quality, None)

    def _render_share(self) -> None:
        """Render the passes that tell glossy and transmitted light from the rest."""
        scene = open_scene(self.item)
        scene.cycles.samples = _SHARE_SAMPLES
        layer = scene.view_layers[0]
        for name in _PASSES:
            setattr(layer, f"use_pass_{name}", True)
        bpy.ops.render.render(scene=scene.name)
        passes = _saved_passes(scene)
        light = sum(
            passes[f"{kind} Color"] * (passes[f"{kind} Direct"] + passes[f"{kind} Indirect"])
            for kind in ("Glossy", "Transmission")
        ).sum(axis=2)
        whole = passes["Combined"][..., :3].sum(axis=2)
        share = np.divide(light, whole, out=np.zeros_like(whole), where=whole > 0.0)
        # What no object is named for has index 0.
        wanted = [scene.objects[name].pass_index for name in self.item.reflecting]
        named = np.isin(np.rint(passes["Object Index"][..., 0]).astype(int), wanted)
        np.savez(self.share_file, share=share, named=named)

    def _render_samples(self, name: str, setting: str) -> None:
        rendering.extension()
        scene = open_scene(self.item)
        own = scene.potmesil_camera
        if hasattr(own, "reflections"):
            own.reflections = setting
        elif setting != "OFF":
            say(f"{self.item.name}: this extension knows no reflections, the picture {name!r} is left out")
            return
        own.use_lens = self.item.lens
        started = time.perf_counter()
        path = self.samples_file(name)
        export(scene, MODES["ordinary"], path, self.quality.samples, moves=self.item.moves, seed=_EXPORT_SEED)
        (self.folder / f"{name}.key").write_text(_export_key(), encoding="utf-8")
        say(f"{self.item.name}: samples {name} exported in {time.perf_counter() - started:.1f} s")

    def _exported_by(self, name: str) -> str:
        path = self.folder / f"{name}.key"
        return path.read_text(encoding="utf-8") if path.exists() else ""


def _export_key() -> str:
    """Return a hash of what a samples file depends on: any of the extension's operators."""
    found = hashlib.sha256()
    for path in sorted((ROOT / "operators").glob("*.py")):
        found.update(path.read_bytes())
    return found.hexdigest()[:12]


def _saved_passes(scene: bpy.types.Scene) -> dict[str, Picture]:
    """Return the passes of what was rendered last, by way of a file."""
    image = scene.render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    # Else each pass is a part of its own.
    image.use_exr_interleave = True
    with tempfile.TemporaryDirectory(prefix="potmesil_") as folder:
        path = Path(folder) / "passes.exr"
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            found: dict[str, dict[str, Picture]] = {}
            for name, channel in file.channels().items():
                *_, owner, letter = name.split(".")
                found.setdefault(owner, {})[letter] = np.asarray(channel.pixels)
    return {
        owner: np.stack([parts[letter] for letter in sorted(parts, key="RGBAXYZWV".index)], axis=2)
        for owner, parts in found.items()
    }


def measure(renders: Renders, *, again: bool = False) -> tuple[Outcome, dict[str, Picture], Picture]:
    """Make all pictures of a scene's samples and compare them with the reference.

    Parameters
    ----------
    renders : Renders
        The scene's cached renders.
    again : bool
        Whether the nodes' pictures are made again too.

    Returns
    -------
    Outcome, dict of str to ndarray, ndarray
        What came out, the pictures by name, and the reference; in the display window, with alpha.
    """
    item = renders.item
    first, second, spp = renders.references()
    reference = 0.5 * (first + second)
    found = renders.regions()
    outcome = Outcome(
        item.name,
        item.purpose,
        spp,
        renders.quality.samples,
        measures.compare_regions(first[..., :3], second[..., :3], found),
        {name: 1.0 if where is None else float(where.mean()) for name, where in found.items()},
    )
    pictures: dict[str, Picture] = {}
    for name in EXPORTS:
        if renders.samples_file(name).exists():
            started = time.perf_counter()
            settings = ProcessSettings(use_lens=item.lens, use_motion=item.moves)
            pictures[name] = run(process(renders.samples(name), settings)).picture
            outcome.seconds[name] = time.perf_counter() - started
    made = _nodes(renders, again=again)
    scores = {setup: shown_psnr(reference, picture) for setup, picture in made.items()}
    outcome.node_setup = max(scores, key=lambda setup: scores[setup])
    pictures["node"] = made[outcome.node_setup]
    for name, picture in pictures.items():
        outcome.likeness[name] = measures.compare_regions(reference[..., :3], picture[..., :3], found)
    return outcome, pictures, reference


def _nodes(renders: Renders, *, again: bool) -> dict[str, Picture]:
    """Return the pictures of Blender's nodes by how they were set up, made now where they are not cached."""
    path, source = renders.folder / "node.npz", renders.samples_file("without")
    fresh = path.exists() and path.stat().st_mtime > source.stat().st_mtime
    if fresh and not again:
        with np.load(path) as values:
            return dict(values)
    samples = renders.samples("without")
    made = {name: displayed_part(make(), samples) for name, make in _makers(renders, samples).items()}
    np.savez(path, **made)
    return made


def _makers(renders: Renders, samples: Samples) -> dict[str, Callable[[], Picture]]:
    """Return what makes the nodes' pictures: Defocus for a lens, Vector Blur for motion, both for both."""
    item, layer, folder = renders.item, samples.layers[0], renders.folder
    shutter = samples.shutter.frames or 0.0
    if not item.lens:
        counts = setups(Exposure(frames=shutter))

        def vectors(setup: Setup) -> Callable[[], Picture]:
            return lambda: vector_blur(layer, setup, folder)

        return {setup.name: vectors(setup) for setup in counts}
    focus = focus_settings(samples, ProcessSettings())
    lens, film = focus.lens, focus.film
    largest = peers.largest_radius(layer, lens, film)

    def defocus(setup: peers.DefocusSetup) -> Callable[[], Picture]:
        return lambda: peers.defocus(layer, lens, film, setup, folder)

    ways = peers.defocus_setups(largest, lens, shutter if item.moves else None)
    return {setup.name: defocus(setup) for setup in ways}


def write_pictures(
    outcome: Outcome, pictures: dict[str, Picture], reference: Picture, found: dict[str, Region | None]
) -> None:
    """Write a scene's sheet: the pictures, below them how far they are from the reference."""
    shown = measures.displayed(reference[..., :3])
    reflecting = found[REFLECTING]
    assert reflecting is not None
    dimmed = shown * np.where(reflecting, 1.0, 0.25)[..., np.newaxis]
    tiles = [(f"{outcome.scene}: {outcome.spp} spp, noise {outcome.floor[FRAME].psnr:.1f} dB", shown)]
    errors = [(f"reflecting: {100.0 * outcome.shares[REFLECTING]:.0f} % of the picture", dimmed)]
    for name, title in COLUMNS.items():
        if name not in pictures:
            tiles.append((f"{title}: not there", np.zeros_like(shown)))
            errors.append(("", np.zeros_like(shown)))
            continue
        picture = measures.displayed(pictures[name][..., :3])
        by_region = outcome.likeness[name]
        label = f"{title}: {by_region[REFLECTING].psnr:.1f} dB, else {by_region[OTHERS].psnr:.1f} dB"
        tiles.append((label, picture))
        errors.append((f"{title} x {_ERROR_GAIN:.0f}", np.abs(picture - shown) * np.float32(_ERROR_GAIN)))
    write_sheet(OUTPUT / f"{outcome.scene}.png", tiles + errors, len(tiles))


def docs_row(
    outcome: Outcome, pictures: dict[str, Picture], reference: Picture
) -> list[tuple[str, npt.NDArray[Any]]]:
    """Return a scene's row of the docs' picture: Cycles, ours without and with, and the nodes."""
    made = {title: pictures[name] for name, title in COLUMNS.items() if name in pictures}
    shown = {f"{outcome.scene}: Cycles": reference, **made}
    return [(title, measures.displayed(picture[..., :3])) for title, picture in shown.items()]


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the results as Markdown: every region of every scene, and how far reflections stay behind."""
    lines = [
        "PSNR in dB / SSIM / FLIP as displayed (sRGB). *Reflecting* is where more than "
        f"{100.0 * _SHARE:.0f} % of the light is reflected or refracted by the objects that the scene names. "
        "Noise is how well two references agree. Of the nodes the best setup counts.",
        "",
        _row("Scene", "region", "share", "noise", *COLUMNS.values(), "with - without"),
        "|---|---|--:|--:|" + "--:|" * (len(COLUMNS) + 1),
    ]
    for o in outcomes:
        for region in (REFLECTING, OTHERS, FRAME):
            cells = [_cell(o.likeness.get(name, {}).get(region)) for name in COLUMNS]
            gained = _signed(_gain(o, region))
            share = f"{100.0 * o.shares[region]:.0f} %"
            lines.append(_row(o.scene, region, share, f"{o.floor[region].psnr:.1f}", *cells, gained))
    for region in (REFLECTING, OTHERS, FRAME):
        gains = [gain for o in outcomes if (gain := _gain(o, region)) is not None]
        middle = _signed(statistics.median(gains) if gains else None)
        lines.append(_row("**median**", region, "", "", *[""] * len(COLUMNS), middle))
    lines += [
        "",
        "## How many dB reflecting regions stay behind the others",
        "",
        f"With reflections at their own depth it is to be no more than {TOLERANCE_DB:.0f} dB. *Beyond noise* "
        "leaves out by how much the noise of our samples and the references differs in the two regions.",
        "",
        _row(
            "Scene",
            *COLUMNS.values(),
            "noise's limit: reflecting",
            "others",
            "ours with, beyond noise",
            f"which is within {TOLERANCE_DB:.0f} dB",
            "node's setup",
        ),
        "|---|" + "--:|" * (len(COLUMNS) + 3) + "---|---|",
    ]
    for o in outcomes:
        behind = o.behind_limit("with")
        verdict = "" if behind is None else "yes" if behind <= TOLERANCE_DB else "no"
        limits = (f"{o.limit(region):.1f}" for region in (REFLECTING, OTHERS))
        shown = (_signed(o.behind(name)) for name in COLUMNS)
        lines.append(_row(o.scene, *shown, *limits, _signed(behind), verdict, o.node_setup))
    return "\n".join([*lines, ""])


def _gain(outcome: Outcome, region: str) -> float | None:
    """Return how many dB our picture gains by reflections at their own depth."""
    if not {"with", "without"} <= outcome.likeness.keys():
        return None
    return outcome.likeness["with"][region].psnr - outcome.likeness["without"][region].psnr


def _row(*cells: object) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def _cell(likeness: measures.Likeness | None) -> str:
    return "" if likeness is None else f"{likeness.psnr:.2f} / {likeness.ssim:.3f} / {likeness.flip:.3f}"


def _signed(value: float | None) -> str:
    return "" if value is None else f"{value:+.2f}"


def _scenes(text: str) -> list[str]:
    names = text.split(",")
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        raise argparse.ArgumentTypeError(
            f"no such scene: {', '.join(unknown)}; there are {', '.join(SCENES)}"
        )
    return names


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=_scenes, metavar="A,B", help="these alone")
    parser.add_argument("--list", action="store_true", help="name the scenes and what they are for")
    parser.add_argument("--quick", action="store_true", help="few samples: a look, and no measurement")
    parser.add_argument(
        "--reprocess", action="store_true", help="render nothing; skip scenes without cached files"
    )
    parser.add_argument("--again", action="store_true", help="export the samples and run the nodes again")
    parser.add_argument("--docs", action="store_true", help="replace the picture in the docs")
    parser.add_argument("--prepare", action="store_true", help="render what is missing, and stop")
    options = parser.parse_args()
    if options.list:
        for item in SCENES.values():
            print(f"{item.name:>14}  {item.purpose}")
        return 0
    OUTPUT.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    failed = []
    rows: list[tuple[str, npt.NDArray[Any]]] = []
    for name in options.scenes or SCENES:
        renders = Renders(SCENES[name], QUICK if options.quick else FULL)
        try:
            if not options.reprocess:
                renders.prepare(again=options.again)
            elif not renders.complete:
                say(f"{name}: nothing cached, skipped")
                continue
            if options.prepare:
                continue
            outcome, pictures, reference = measure(renders, again=options.again)
        except PotmesilError as error:
            failed.append(name)
            say(f"{name}: {error}")
            continue
        write_pictures(outcome, pictures, reference, renders.regions())
        outcomes.append(outcome)
        if name in DOCS_SCENES:
            rows += docs_row(outcome, pictures, reference)
        behind = ", ".join(f"{COLUMNS[n]} {_signed(outcome.behind(n))}" for n in outcome.likeness)
        say(f"{name}: reflecting regions behind the others in dB: {behind}")
    if options.docs and rows:
        write_sheet(DOCS_PICTURE, rows, 1 + len(COLUMNS))
    if outcomes:
        # A part of the scenes has no median that could be compared.
        stem = "part" if options.scenes else "quick" if options.quick else "results"
        text = report(outcomes)
        print(text)
        (OUTPUT / f"{stem}.md").write_text(text, encoding="utf-8")
        values = [outcome.to_json() for outcome in outcomes]
        (OUTPUT / f"{stem}.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
