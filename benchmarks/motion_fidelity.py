"""Measure motion blur against Cycles' own: the motion processor beside Blender's Vector Blur node.

For each scene of `motion_scenes` it renders a reference with Cycles' motion blur, one samples file as the
extension's command does, the node's picture of the same samples and the processor's, and compares them.
References, samples and node pictures are kept in build/bench/cache; tables and pictures go to
build/bench/motion.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CACHE = ROOT / "build" / "bench" / "cache" / "motion"
OUTPUT = ROOT / "build" / "bench" / "motion"

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
os.environ["BLENDER_USER_RESOURCES"] = str(ROOT / "build" / "bench" / "blender")
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402
import measures  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from contact_sheet import write_sheet  # noqa: E402
from motion_scenes import SCENES, MotionScene, open_scene  # noqa: E402
from vector_blur import SAMPLE_COUNTS, Setup, setups, vector_blur  # noqa: E402

from potmesil_addon import exr  # noqa: E402
from potmesil_addon.errors import PotmesilError  # noqa: E402
from potmesil_addon.motion import MOTION_MODELS  # noqa: E402
from potmesil_addon.process import ProcessSettings, process  # noqa: E402
from potmesil_addon.progress import run  # noqa: E402
from potmesil_addon.samples import Samples  # noqa: E402
from sample_scenes import rendering  # noqa: E402
from sample_scenes.rendering import saved_render  # noqa: E402

Picture = npt.NDArray[np.float32]

_SUBSET_OF = 8192
"""Length of the sequence that Cycles' samples are taken from, so that a reference can be carried on."""

_ERROR_GAIN = 8.0

KINDS = {
    "hidden": "with the views without and of the movers alone",
    "single": "with what the camera sees only",
}
"""What a samples file can hold."""


@dataclass(frozen=True, slots=True)
class Quality:
    """How much rendering goes into a scene.

    Parameters
    ----------
    name : str
        For cached files.
    chunk : int
        Samples a pixel that are added to both references at a time.
    most : int
        No more than this.
    floor : float
        PSNR in dB between the two references that is enough.
    samples : int
        Samples a pixel of the samples file.
    """

    name: str
    chunk: int
    most: int
    floor: float
    samples: int


FULL = Quality("full", 256, 2048, 45.0, 128)
QUICK = Quality("quick", 32, 32, 0.0, 32)


@dataclass(slots=True)
class Outcome:
    """What came out of a scene."""

    scene: str
    purpose: str
    region: float
    spp: int
    floor: measures.Likeness
    floor_region: measures.Likeness
    likeness: dict[str, tuple[measures.Likeness, measures.Likeness]] = field(default_factory=dict)
    node_setup: str = ""
    seconds: float = 0.0
    motion: Any = None

    def gain(self, index: int) -> float:
        """Return how many dB ours is ahead of the node, whole (0) or in the region (1)."""
        return self.likeness["ours"][index].psnr - self.likeness["node"][index].psnr

    def to_json(self) -> dict[str, Any]:
        """Return everything, ready for JSON."""
        return {
            "scene": self.scene,
            "purpose": self.purpose,
            "region_share": self.region,
            "reference_spp": self.spp,
            "noise_floor": {"frame": self.floor.to_json(), "region": self.floor_region.to_json()},
            **{
                name: {"frame": frame.to_json(), "region": region.to_json()}
                for name, (frame, region) in self.likeness.items()
            },
            "ours_minus_node_db": {"frame": self.gain(0), "region": self.gain(1)},
            "node_setup": self.node_setup,
            "ours_seconds": self.seconds,
            "ours_motion": self.motion,
        }


class Work:
    """The cached files of one scene.

    Parameters
    ----------
    item : MotionScene
        The scene.
    quality : Quality
        How well it is rendered.
    kind : {"hidden", "single"}
        What is in the samples file; see `KINDS`.
    """

    def __init__(self, item: MotionScene, quality: Quality, kind: str) -> None:
        self.item, self.quality, self.kind = item, quality, kind
        self.folder = CACHE / f"{item.name}-{item.key()}-{quality.name}"

    @property
    def reference_file(self) -> Path:
        """Two references with independent noise, and how many samples they have."""
        return self.folder / "reference.npz"

    @property
    def export(self) -> int:
        """How many times the samples were exported; 0 for never."""
        found = [int(p.stem.rpartition("-")[2]) for p in self.folder.glob(f"{self.kind}-*.exr")]
        return max(found, default=0)

    def samples_file(self, export: int) -> Path:
        """Return where the samples file of an export is."""
        return self.folder / f"{self.kind}-{export}.exr"

    def node_file(self, export: int) -> Path:
        """Return where the node's pictures of an export are."""
        return self.folder / f"{self.kind}-{export}-node.npz"

    def prepare(self, *, again: bool) -> None:
        """Render what is not there, the samples also if they are wanted again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if not self._enough():
            self._render_references()
        export = self.export
        if again or not export:
            self._render_samples(export + 1)
            for old in (self.samples_file(export), self.node_file(export)):
                old.unlink(missing_ok=True)
            export += 1
        if not self._node_done(export):
            self._run_node(export)

    @property
    def complete(self) -> bool:
        """Whether everything is there that rendering brings."""
        return self.reference_file.exists() and bool(self.export) and self._node_done(self.export)

    def references(self) -> tuple[Picture, Picture, int]:
        """Return the two references and their samples a pixel."""
        with np.load(self.reference_file) as values:
            return values["first"], values["second"], int(values["spp"])

    def node_pictures(self) -> dict[str, Picture]:
        """Return the node's pictures by how it was set up."""
        with np.load(self.node_file(self.export)) as values:
            return dict(values)

    def _node_done(self, export: int) -> bool:
        if not self.node_file(export).exists():
            return False
        with np.load(self.node_file(export)) as values:
            return set(values) == {setup.name for setup in self._setups()}

    def _enough(self) -> bool:
        if not self.reference_file.exists():
            return False
        first, second, spp = self.references()
        return spp >= self.quality.most or _shown_psnr(first, second) >= self.quality.floor

    def _render_references(self) -> None:
        total: list[Any] = [0.0, 0.0]
        spp = 0
        if self.reference_file.exists():
            *means, spp = self.references()
            total = [mean.astype(np.float64) * spp for mean in means]
        scene = open_scene(self.item)
        cycles, chunk = scene.cycles, self.quality.chunk
        while True:
            for number in range(2):
                cycles.seed = 11 + 100 * number
                cycles.samples = _SUBSET_OF
                cycles.use_sample_subset = True
                cycles.sample_offset, cycles.sample_subset_length = spp, chunk
                bpy.ops.render.render(scene=scene.name)
                total[number] = total[number] + chunk * saved_render(scene)
            spp += chunk
            first, second = ((sum_ / spp).astype(np.float32) for sum_ in total)
            np.savez(self.reference_file, first=first, second=second, spp=spp)
            _say(
                f"{self.item.name}: references of {spp} samples agree to {_shown_psnr(first, second):.1f} dB"
            )
            if self._enough():
                return

    def _render_samples(self, export: int) -> None:
        scene = open_scene(self.item)
        rendering.extension()
        scene.cycles.seed = 5
        scene.cycles.samples = self.quality.samples
        scene.potmesil_camera.use_hidden_surfaces = self.kind == "hidden"
        started = time.perf_counter()
        part = rendering.render_samples(scene, self.folder / "part.exr")
        part.replace(self.samples_file(export))
        _say(f"{self.item.name}: samples exported in {time.perf_counter() - started:.1f} s")

    def _setups(self) -> tuple[Setup, ...]:
        counts = SAMPLE_COUNTS[:1] if self.quality is QUICK else SAMPLE_COUNTS
        return setups(self.item.exposure, counts)

    def _run_node(self, export: int) -> None:
        samples = exr.read_samples(self.samples_file(export))
        pictures = {}
        for setup in self._setups():
            picture = vector_blur(samples.layers[0], setup, self.folder)
            pictures[setup.name] = _displayed_part(picture, samples)
        np.savez(self.node_file(export), **pictures)


def measure(work: Work, settings: ProcessSettings) -> Outcome:
    """Process a scene's samples, compare all pictures, and write its sheet.

    Parameters
    ----------
    work : Work
        The scene's cached files.
    settings : ProcessSettings
        For the processor.

    Returns
    -------
    Outcome
        What came out.
    """
    first, second, spp = work.references()
    reference = 0.5 * (first + second)
    samples = exr.read_samples(work.samples_file(work.export))
    sharp = _displayed_part(samples.layers[0].color[..., :3], samples)
    region = measures.moving_region(sharp, first, second)
    started = time.perf_counter()
    result = run(process(samples, settings))
    seconds = time.perf_counter() - started
    ours = result.picture[..., :3]

    outcome = Outcome(
        work.item.name, work.item.purpose, float(region.mean()), spp, *measures.compare(first, second, region)
    )
    outcome.seconds, outcome.motion = seconds, result.report.get("motion")
    nodes = work.node_pictures()
    scores = {name: _shown_psnr(reference[region], picture[region]) for name, picture in nodes.items()}
    outcome.node_setup = max(scores, key=lambda name: scores[name])
    node = nodes[outcome.node_setup]
    outcome.likeness = {
        "sharp": measures.compare(reference, sharp, region),
        "ours": measures.compare(reference, ours, region),
        "node": measures.compare(reference, node, region),
    }
    _write_pictures(outcome, reference, sharp, ours, node)
    return outcome


def _write_pictures(
    outcome: Outcome, reference: Picture, sharp: Picture, ours: Picture, node: Picture
) -> None:
    OUTPUT.mkdir(parents=True, exist_ok=True)
    shown = {
        name: measures.displayed(picture)
        for name, picture in (("reference", reference), ("sharp", sharp), ("ours", ours), ("node", node))
    }

    def label(name: str) -> str:
        frame, region = outcome.likeness[name]
        return f"{name}: {frame.psnr:.2f} dB, where it moves {region.psnr:.2f} dB"

    def error(name: str) -> Picture:
        return np.abs(shown[name] - shown["reference"]) * np.float32(_ERROR_GAIN)

    write_sheet(
        OUTPUT / f"{outcome.scene}.png",
        [
            (label("sharp"), shown["sharp"]),
            (label("ours"), shown["ours"]),
            (label("node"), shown["node"]),
            (f"reference, {outcome.scene}: noise {outcome.floor.psnr:.1f} dB", shown["reference"]),
            ("|ours - reference| x 8", error("ours")),
            ("|node - reference| x 8", error("node")),
        ],
        columns=3,
    )


def table(outcomes: list[Outcome]) -> str:
    """Return the results as Markdown.

    Parameters
    ----------
    outcomes : list of Outcome
        At least one.

    Returns
    -------
    str
        A table for the whole frame and one for the region that moves, with medians.
    """
    lines = []
    for index, title in ((0, "Whole frame"), (1, "Where motion changes the picture")):
        lines += [
            f"## {title}",
            "",
            "PSNR in dB and SSIM, FLIP as displayed (sRGB); linear PSNR in brackets.",
            "",
            "| Scene | moves | noise | sharp | ours | node | ours - node | SSIM, ours / node | FLIP | s |",
            "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
        ]
        for o in outcomes:
            floor = (o.floor, o.floor_region)[index]
            sharp, ours, node = (o.likeness[name][index] for name in ("sharp", "ours", "node"))
            lines.append(
                f"| {o.scene} | {100.0 * o.region:.0f} % | {floor.psnr:.1f} | {_pair(sharp)} | {_pair(ours)} "
                f"| {_pair(node)} | **{o.gain(index):+.2f}** | {ours.ssim:.4f} / {node.ssim:.4f} "
                f"| {ours.flip:.4f} / {node.flip:.4f} | {o.seconds:.2f} |"
            )
        columns = {
            name: [getattr(o.likeness[who][index], what) for o in outcomes]
            for name, who, what in (
                ("sharp", "sharp", "psnr"),
                ("ours", "ours", "psnr"),
                ("node", "node", "psnr"),
                ("ssim", "ours", "ssim"),
                ("node_ssim", "node", "ssim"),
                ("flip", "ours", "flip"),
                ("node_flip", "node", "flip"),
            )
        }
        m = {name: statistics.median(values) for name, values in columns.items()}
        gain = statistics.median(o.gain(index) for o in outcomes)
        lines += [
            f"| **median** | | | {m['sharp']:.2f} | {m['ours']:.2f} | {m['node']:.2f} | **{gain:+.2f}** "
            f"| {m['ssim']:.4f} / {m['node_ssim']:.4f} | {m['flip']:.4f} / {m['node_flip']:.4f} | |",
            "",
        ]
    return "\n".join(lines)


def _pair(likeness: measures.Likeness) -> str:
    return f"{likeness.psnr:.2f} ({likeness.linear_psnr:.1f})"


def _shown_psnr(first: Picture, second: Picture) -> float:
    return measures.psnr(measures.displayed(first), measures.displayed(second))


def _displayed_part(picture: Picture, samples: Samples) -> Picture:
    """Return what the display window has of a picture of the data window."""
    data, display = samples.data_window, samples.display_window
    return picture[display.y0 - data.y0 : display.y1 - data.y0, display.x0 - data.x0 : display.x1 - data.x0]


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", action="append", choices=SCENES, metavar="NAME", help="may be repeated")
    parser.add_argument("--list", action="store_true", help="name the scenes and what they are for")
    parser.add_argument("--quick", action="store_true", help="few samples: a look, and no measurement")
    parser.add_argument(
        "--reprocess", action="store_true", help="render nothing; skip scenes without cached files"
    )
    parser.add_argument("--export", action="store_true", help="export the samples files again")
    kinds = "; ".join(f"{name}: {text}" for name, text in KINDS.items())
    parser.add_argument("--kind", choices=KINDS, default="hidden", help=f"the samples file, {kinds}")
    parser.add_argument("--motion-model", choices=MOTION_MODELS, default="auto")
    parser.add_argument("--prepare", action="store_true", help="render what is missing, and stop")
    options = parser.parse_args()
    if options.list:
        for item in SCENES.values():
            print(f"{item.name:>18}  {item.purpose}")
        return 0
    settings = ProcessSettings(use_lens=False, use_motion=True, motion_model=options.motion_model)
    outcomes = []
    failed = []
    for name in options.scene or SCENES:
        work = Work(SCENES[name], QUICK if options.quick else FULL, options.kind)
        if not options.reprocess:
            work.prepare(again=options.export)
        elif not work.complete:
            _say(f"{name}: nothing cached, skipped")
            continue
        if options.prepare:
            print(f"{name} {work.samples_file(work.export)} {work.reference_file}", flush=True)
            continue
        try:
            outcome = measure(work, settings)
        except PotmesilError as error:
            failed.append(name)
            _say(f"{name}: {error}")
            continue
        outcomes.append(outcome)
        _say(f"{name}: ours - node {outcome.gain(0):+.2f} dB, where it moves {outcome.gain(1):+.2f} dB")
    if outcomes:
        text = table(outcomes)
        print(text)
        # A part of the scenes has no median that could be compared.
        stem = "part" if options.scene else "quick" if options.quick else "results"
        (OUTPUT / f"{stem}.md").write_text(text, encoding="utf-8")
        values = [outcome.to_json() for outcome in outcomes]
        (OUTPUT / f"{stem}.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
