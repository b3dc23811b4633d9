"""What is rendered for the lens benchmarks, and kept: references, samples files, and how long they took."""

from __future__ import annotations

import hashlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import measures
import numpy as np
import numpy.typing as npt
from lens_regions import Region, regions
from lens_scenes import LensScene, open_scene
from peers import radii
from rgba import saved_rgba

from potmesil_addon import exr
from potmesil_addon.process import ProcessSettings, focus_settings
from potmesil_addon.samples import Samples
from sample_scenes import rendering

ROOT = Path(__file__).resolve().parent.parent
CACHE = ROOT / "build" / "bench" / "cache" / "lens"

Picture = npt.NDArray[np.float32]

SUBSET_OF = 8192
"""Length of the sequence that Cycles' samples are taken from, so that a reference can be carried on."""

_SEEDS = (11, 111)
"""Of the two references."""

_EXPORT_SEED, _EQUAL_SEED = 5, 77

_EXPORT_SOURCES = ("export.py", "peel.py", "boxes.py", "overscan.py", "motion.py", "sampling.py", "scene.py")
"""Of the extension's operators, what a samples file depends on."""

_AT_ONCE = 16
"""Samples of a render that shows what Cycles needs however few they are."""


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
    highlight_floor : float
        The same where highlights reach, which are few and noisy.
    samples : int
        Samples a pixel of an ordinary samples file; finer samples get a quarter, being four times as many.
    """

    name: str
    chunk: int
    most: int
    floor: float
    highlight_floor: float
    samples: int


FULL = Quality("full", 256, 4096, 45.0, 34.0, 128)
QUICK = Quality("quick", 32, 32, 0.0, 0.0, 32)


@dataclass(frozen=True, slots=True)
class Mode:
    """A way to export samples.

    Parameters
    ----------
    name : str
        Of the file.
    sampling : {"PIXELS", "FINE", "POINTS"}
        Whether four samples take the place of a pixel, filtered or not.
    peeled : bool
        Whether with the layers that near things hide.
    """

    name: str
    sampling: str = "PIXELS"
    peeled: bool = False


MODES = {
    mode.name: mode
    for mode in (
        Mode("ordinary"),
        Mode("fine", sampling="FINE"),
        Mode("points", sampling="POINTS"),
        Mode("hidden", peeled=True),
        Mode("fine_hidden", sampling="FINE", peeled=True),
        Mode("points_hidden", sampling="POINTS", peeled=True),
    )
}


def can_peel() -> bool:
    """Return whether the extension can export what near things hide."""
    rendering.extension()
    return "depth_peeling" in bpy.context.scene.potmesil_camera.bl_rna.properties


class Renders:
    """The cached renders of one scene.

    Parameters
    ----------
    item : LensScene
        The scene.
    quality : Quality
        How well it is rendered.
    """

    def __init__(self, item: LensScene, quality: Quality) -> None:
        self.item, self.quality = item, quality
        self.folder = CACHE / f"{item.name}-{item.key()}-{quality.name}"

    @property
    def reference_file(self) -> Path:
        """Two references with independent noise, and how many samples they have."""
        return self.folder / "reference.npz"

    def samples_file(self, mode: str) -> Path:
        """Return where the samples of a mode are."""
        return self.folder / f"{mode}.exr"

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes that there are samples of."""
        return tuple(mode for mode in MODES if self.samples_file(mode).exists())

    @property
    def complete(self) -> bool:
        """Whether there is enough to compare something."""
        known = "cycles_cpu" in self.facts()
        return known and self.reference_file.exists() and "ordinary" in self.modes

    def facts(self) -> dict[str, Any]:
        """Return what is known of the renders: seconds, and from which sources samples were exported."""
        path = self.folder / "facts.json"
        return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}

    def note(self, **facts: Any) -> None:
        """Remember facts beside those that are known."""
        known = self.facts() | facts
        (self.folder / "facts.json").write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")

    def prepare(self, *, again: bool = False) -> None:
        """Render what is not there, the samples also if they are wanted again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        now = _export_key()
        stale = []
        for mode in MODES.values():
            if mode.peeled and not can_peel():
                continue
            if again or not self.samples_file(mode.name).exists():
                self._render_samples(mode, now)
            elif self.facts().get(f"{mode.name}_sources") != now:
                stale.append(mode.name)
        if stale:
            say(f"{self.item.name}: samples older than the export's code, see --again: {', '.join(stale)}")
        if not self._enough():
            self._render_references()
        if "cycles_cpu" not in self.facts():
            self._time_cycles()

    def references(self) -> tuple[Picture, Picture, int]:
        """Return the two references (premultiplied, with alpha) and their samples a pixel."""
        with np.load(self.reference_file) as values:
            return values["first"], values["second"], int(values["spp"])

    def samples(self, mode: str) -> Samples:
        """Return the samples of a mode."""
        return exr.read_samples(self.samples_file(mode))

    def cycles(self, spp: int) -> Picture:
        """Return Cycles' own blur with so many samples a pixel and noise of its own."""
        path = self.folder / f"cycles-{spp}.npz"
        if not path.exists():
            scene = open_lens(self.item)
            scene.cycles.seed, scene.cycles.samples = _EQUAL_SEED, spp
            np.savez(path, picture=_rendered(scene))
        with np.load(path) as values:
            return np.asarray(values["picture"])

    def equal_time(self, cpu_seconds: float) -> int:
        """Return the samples a pixel that Cycles' own blur takes in some processor time.

        Parameters
        ----------
        cpu_seconds : float
            Processor time beside that of exporting the ordinary samples.

        Returns
        -------
        int
            In steps, since a time is never met twice and each new picture would be rendered.
        """
        facts = self.facts()
        spent = facts["ordinary_cpu"] + cpu_seconds
        spp = max(1.0, (spent - facts["cycles_cpu"]) / facts["cycles_cpu_a_sample"])
        return max(1, round(2.0 ** (0.5 * round(2.0 * np.log2(spp)))))

    def _enough(self) -> bool:
        if not self.reference_file.exists():
            return False
        first, second, spp = self.references()
        return enough(first, second, spp, self.quality, self._highlights())

    def _highlights(self) -> Region | None:
        """Return where highlights reach, where there are any."""
        samples = self.samples("ordinary")
        layer, focus = samples.layers[0], focus_settings(samples, ProcessSettings())
        found = regions(radii(layer, focus.lens, focus.film), layer.color).get("highlights")
        return None if found is None else displayed_part(found, samples)

    def _render_references(self) -> None:
        scene = open_lens(self.item)
        carry_on(scene, self.reference_file, self.quality, self.item.name, self._highlights())

    def _render_samples(self, mode: Mode, sources: str) -> None:
        started, cpu_started = time.perf_counter(), time.process_time()
        export(
            open_scene(self.item),
            mode,
            self.samples_file(mode.name),
            self.quality.samples,
            moves=self.item.moves,
            seed=_EXPORT_SEED,
        )
        seconds, cpu = time.perf_counter() - started, time.process_time() - cpu_started
        self.note(
            **{f"{mode.name}_seconds": seconds, f"{mode.name}_cpu": cpu, f"{mode.name}_sources": sources}
        )
        say(f"{self.item.name}: {mode.name} samples exported in {seconds:.1f} s")

    def _time_cycles(self) -> None:
        """Time Cycles' own blur: what every render costs, and what each sample adds.

        Processor time, which depends little on what else the machine does.
        """
        scene = open_lens(self.item)
        cpu = []
        for spp in (_AT_ONCE, 1, self.quality.samples):
            scene.cycles.samples = spp
            started = time.process_time()
            bpy.ops.render.render(scene=scene.name)
            cpu.append(time.process_time() - started)
        # The first render warms up and does not count.
        a_sample = max(1e-6, (cpu[2] - cpu[1]) / (self.quality.samples - 1))
        self.note(cycles_cpu=max(0.0, cpu[1] - a_sample), cycles_cpu_a_sample=a_sample)


def open_lens(item: LensScene) -> bpy.types.Scene:
    """Open a scene with Cycles' own blur by the lens, and by motion where the scene is for that."""
    scene = open_scene(item)
    scene.camera.data.dof.use_dof = True
    scene.render.use_motion_blur = item.moves
    return scene


def export(scene: bpy.types.Scene, mode: Mode, path: Path, spp: int, *, moves: bool, seed: int) -> None:
    """Export the samples of a scene at its frame, as the extension's command does.

    Parameters
    ----------
    scene : Scene
        Seen through a pinhole.
    mode : Mode
        What the file holds.
    path : Path
        The file; it is whole or not there.
    spp : int
        Samples for each pixel of the finished picture.
    moves : bool
        Whether with motion.
    seed : int
        Of Cycles' noise.
    """
    rendering.extension()
    own = scene.potmesil_camera
    scene.cycles.seed = seed
    scene.cycles.samples = spp // (1 if mode.sampling == "PIXELS" else 4)
    own.use_motion = moves
    own.sampling = mode.sampling
    if can_peel():
        own.depth_peeling = "AUTOMATIC" if mode.peeled else "OFF"
    part = path.with_name("part.exr")
    rendering.render_samples(scene, part).replace(path)


def carry_on(
    scene: bpy.types.Scene, path: Path, quality: Quality, name: str, highlights: Region | None = None
) -> None:
    """Render two references with independent noise until they agree, carrying on with what is there.

    Parameters
    ----------
    scene : Scene
        With all that blurs it.
    path : Path
        Where ``first``, ``second`` (both with alpha) and ``spp`` are kept, after each step.
    quality : Quality
        How far to go.
    name : str
        For messages.
    highlights : ndarray of bool of shape (rows, columns), optional
        Where they reach.
    """
    total: list[Any] = [0.0, 0.0]
    spp = 0
    if path.exists():
        with np.load(path) as values:
            spp = int(values["spp"])
            total = [values[which].astype(np.float64) * spp for which in ("first", "second")]
    cycles, chunk = scene.cycles, quality.chunk
    while True:
        for number, seed in enumerate(_SEEDS):
            cycles.seed = seed
            cycles.samples = SUBSET_OF
            cycles.use_sample_subset = True
            cycles.sample_offset, cycles.sample_subset_length = spp, chunk
            total[number] = total[number] + chunk * _rendered(scene)
        spp += chunk
        first, second = ((sum_ / spp).astype(np.float32) for sum_ in total)
        part = path.with_suffix(".part.npz")
        np.savez(part, first=first, second=second, spp=spp)
        part.replace(path)
        agreement = f"{shown_psnr(first, second):.1f} dB"
        if highlights is not None:
            agreement += f", {shown_psnr(first, second, highlights):.1f} dB in highlights"
        say(f"{name}: references of {spp} samples agree to {agreement}")
        if enough(first, second, spp, quality, highlights):
            return


def enough(first: Picture, second: Picture, spp: int, quality: Quality, highlights: Region | None) -> bool:
    """Return whether two references agree well enough, or have as many samples as they may."""
    if spp >= quality.most:
        return True
    if highlights is not None and shown_psnr(first, second, highlights) < quality.highlight_floor:
        return False
    return shown_psnr(first, second) >= quality.floor


def shown_psnr(first: Picture, second: Picture, region: Region | None = None) -> float:
    """Return the PSNR in dB between two pictures as displayed, over black."""
    return measures.psnr(measures.displayed(first[..., :3]), measures.displayed(second[..., :3]), region)


def displayed_part(picture: Any, samples: Samples) -> Any:
    """Return what the display window has of a picture of the data window."""
    data, display = samples.data_window, samples.display_window
    return picture[display.y0 - data.y0 : display.y1 - data.y0, display.x0 - data.x0 : display.x1 - data.x0]


def say(text: str) -> None:
    """Tell how far the work is."""
    print(text, file=sys.stderr, flush=True)


def _rendered(scene: bpy.types.Scene) -> Picture:
    bpy.ops.render.render(scene=scene.name)
    return saved_rgba(scene)


def _export_key() -> str:
    """Return a hash of the sources that make samples files."""
    found = hashlib.sha256()
    for name in _EXPORT_SOURCES:
        path = ROOT / "operators" / name
        found.update(path.read_bytes() if path.exists() else b"")
    return found.hexdigest()[:12]
