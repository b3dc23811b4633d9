"""Measure flicker: how a focus pull and a camera move change from frame to frame, beside Cycles' own.

A focus pull is made from the samples of one frame; a camera move has samples of every frame. For each pair
of neighbouring frames the change of a picture is compared with the change of the reference: what is left
over is flicker, or blur that is wrong in a way that moves. The reference's own noise is told beside it.
References and samples are kept in build/bench/cache/lens; the table and the plots go to build/bench/flicker.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "bench" / "flicker"

# Blender reads this once, when the module is imported: nothing of the user's is seen or changed.
os.environ["BLENDER_USER_RESOURCES"] = str(ROOT / "build" / "bench" / "blender")
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402, F401 - brings what the modules below import
import measures  # noqa: E402
import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import peers  # noqa: E402
from contact_sheet import write_sheet  # noqa: E402
from lens_fidelity import COLUMNS, OURS, our_settings  # noqa: E402
from lens_renders import CACHE, MODES, Quality, can_peel, carry_on, displayed_part, export, open_lens, say  # noqa: E402
from lens_scenes import SEQUENCES, LensScene, open_scene  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from potmesil_addon import exr  # noqa: E402
from potmesil_addon.process import focus_settings, process  # noqa: E402
from potmesil_addon.progress import run  # noqa: E402
from potmesil_addon.samples import LensAttributes, Samples  # noqa: E402

Picture = npt.NDArray[np.float32]

_FULL = Quality("full", 64, 256, 60.0, 0.0, 64)
_QUICK = Quality("quick", 16, 16, 0.0, 0.0, 32)

_QUICK_STEP = 8
"""Of the frames, a quick look has the first few."""

_REFERENCE = "reference"

_SHOWN = 4
"""Frames on the sheet of pictures."""


@dataclass(slots=True)
class Sequence:
    """The cached renders of a sequence.

    Parameters
    ----------
    item : LensScene
        The scene.
    quality : Quality
        How well it is rendered.
    """

    item: LensScene
    quality: Quality

    @property
    def folder(self) -> Path:
        """Where everything is."""
        return CACHE / f"{self.item.name}-{self.item.key()}-{self.quality.name}"

    @property
    def frames(self) -> range:
        """The frames that are looked at."""
        return range(1, (self.item.frames if self.quality is _FULL else _QUICK_STEP) + 1)

    @property
    def one_export(self) -> bool:
        """Whether one samples file serves all frames: nothing but the focus changes."""
        return self.item.name == "focus_pull"

    def reference_file(self, frame: int) -> Path:
        """Return where the two references of a frame are."""
        return self.folder / f"reference-{frame:04}.npz"

    def samples_file(self, mode: str, frame: int) -> Path:
        """Return where the samples of a frame are."""
        return self.folder / f"{mode}-{1 if self.one_export else frame:04}.exr"

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes of which all frames have samples."""
        return tuple(m for m in MODES if all(self.samples_file(m, n).exists() for n in self.frames))

    def prepare(self, modes: list[str], *, again: bool) -> None:
        """Render what is not there."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for mode in (MODES[name] for name in modes):
            if mode.peeled and not can_peel():
                continue
            for frame in self.frames[:1] if self.one_export else self.frames:
                path = self.samples_file(mode.name, frame)
                if again or not path.exists():
                    scene = open_scene(self.item)
                    scene.frame_set(frame)
                    # Noise of its own in each frame is what an animation has.
                    export(scene, mode, path, self.quality.samples, moves=False, seed=frame)
            say(f"{self.item.name}: {mode.name} samples are there")
        missing = [n for n in self.frames if not self._enough(n)]
        if missing:
            scene = open_lens(self.item)
            for frame in missing:
                scene.frame_set(frame)
                # The same two seeds in all frames: what noise they share is no change, and so drops out.
                name = f"{self.item.name}, frame {frame}"
                carry_on(scene, self.reference_file(frame), self.quality, name)

    def _enough(self, frame: int) -> bool:
        path = self.reference_file(frame)
        if not path.exists():
            return False
        with np.load(path) as values:
            return int(values["spp"]) >= self.quality.most

    def references(self, frame: int) -> tuple[Picture, Picture]:
        """Return the two references of a frame, as displayed."""
        with np.load(self.reference_file(frame)) as values:
            return _shown(values["first"]), _shown(values["second"])

    def focus_distances(self) -> dict[int, float]:
        """Return the focus distance of each frame."""
        scene = open_scene(self.item)
        found = {}
        for frame in self.frames:
            scene.frame_set(frame)
            found[frame] = float(scene.camera.data.dof.focus_distance)
        return found


@dataclass(slots=True)
class Flicker:
    """Changes from each frame to the next one, means of the absolute difference as displayed.

    Parameters
    ----------
    change : list of float
        Of the pictures.
    residual : list of float
        Of their change from the reference's change; of the reference, its noise.
    """

    change: list[float] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Return the values with their means."""
        return {
            "change": self.change,
            "residual": self.residual,
            "mean_change": float(np.mean(self.change)),
            "mean_residual": float(np.mean(self.residual)),
            "largest_residual": max(self.residual),
        }


def measure(sequence: Sequence) -> dict[str, Flicker]:
    """Compare the changes between neighbouring frames, and write the sheet of some of the frames.

    Parameters
    ----------
    sequence : Sequence
        Its renders are there.

    Returns
    -------
    dict of str to Flicker
        By the name of the picture; the reference's is its own, with its noise.
    """
    found: dict[str, Flicker] = {}
    before: dict[str, Picture] = {}
    noise_before: Picture | None = None
    tiles = []
    shown = set(np.linspace(sequence.frames[0], sequence.frames[-1], _SHOWN).round().astype(int))
    distances = sequence.focus_distances()
    largest = _largest(sequence, distances)
    for frame in sequence.frames:
        first, second = sequence.references(frame)
        reference = np.asarray(0.5 * (first + second), dtype=np.float32)
        # Half the difference: the mean of both has that much noise.
        noise = np.asarray(0.5 * (first - second), dtype=np.float32)
        pictures = {_REFERENCE: reference, **dict(_pictures(sequence, frame, distances[frame], largest))}
        if frame in shown:
            titles = {_REFERENCE: "Cycles", **COLUMNS}
            tiles += [(f"frame {frame}: {titles[name]}", picture) for name, picture in pictures.items()]
        if noise_before is not None:
            change = reference - before[_REFERENCE]
            for name, picture in pictures.items():
                mine = picture - before[name]
                rest = noise - noise_before if name == _REFERENCE else mine - change
                flicker = found.setdefault(name, Flicker())
                flicker.change.append(float(np.abs(mine).mean()))
                flicker.residual.append(float(np.abs(rest).mean()))
        before, noise_before = pictures, noise
    write_sheet(OUTPUT / f"{sequence.item.name}.png", tiles, columns=len(before))
    return found


def _pictures(
    sequence: Sequence, frame: int, distance: float, largest: float
) -> Iterator[tuple[str, Picture]]:
    """Yield our pictures of a frame, and the Defocus node's, as displayed."""
    for name, (mode, visibility) in OURS.items():
        settings = our_settings(visibility, moves=False)
        if settings is None or mode not in sequence.modes:
            continue
        samples = _samples(sequence, mode, frame)
        settings = replace(settings, lens=LensAttributes(focus_distance=distance))
        yield name, _shown(run(process(samples, settings)).picture)
    samples = _samples(sequence, "ordinary", frame)
    settings = our_settings("none", moves=False)
    assert settings is not None
    focus = focus_settings(samples, replace(settings, lens=LensAttributes(focus_distance=distance)))
    # The last of the setups does best in nearly all scenes of the fidelity benchmark.
    setup = peers.defocus_setups(largest, focus.lens, None)[-1]
    picture = peers.defocus(samples.layers[0], focus.lens, focus.film, setup, sequence.folder)
    yield "defocus", _shown(displayed_part(picture, samples))


def _largest(sequence: Sequence, distances: dict[int, float]) -> float:
    """Return the largest radius of a circle in all frames: Max Blur must not change in between."""
    samples = _samples(sequence, "ordinary", sequence.frames[0])
    settings = our_settings("none", moves=False)
    assert settings is not None
    focus = focus_settings(samples, settings)
    return max(
        peers.largest_radius(samples.layers[0], replace(focus.lens, focus_distance=distance), focus.film)
        for distance in (min(distances.values()), max(distances.values()))
    )


_LAST: dict[Path, Samples] = {}
"""The samples that were read last: a focus pull reads one file for all frames."""


def _samples(sequence: Sequence, mode: str, frame: int) -> Samples:
    path = sequence.samples_file(mode, frame)
    if path not in _LAST:
        for other in [p for p in _LAST if p.name.startswith(f"{mode}-")]:
            del _LAST[other]
        _LAST[path] = exr.read_samples(path)
    return _LAST[path]


def _shown(picture: npt.NDArray[Any]) -> Picture:
    return measures.displayed(picture[..., :3])


def _title(name: str) -> str:
    return "Cycles, its noise" if name == _REFERENCE else COLUMNS[name]


def table(found: dict[str, dict[str, Flicker]]) -> str:
    """Return the results as Markdown, in thousandths of white."""
    lines = [
        "Mean absolute difference between neighbouring frames as displayed, in thousandths of white. "
        "*Residual* is how far that change is from the reference's, for Cycles the noise of its own.",
        "",
        "| Sequence | Picture | change | residual | largest residual | residual over noise |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for sequence, by_name in found.items():
        noise = float(np.mean(by_name[_REFERENCE].residual))
        for name, flicker in by_name.items():
            change, rest = float(np.mean(flicker.change)), float(np.mean(flicker.residual))
            ratio = rest / noise if noise > 0.0 else math.inf
            lines.append(
                f"| {sequence} | {_title(name)} | {1e3 * change:.2f} | {1e3 * rest:.2f} "
                f"| {1e3 * max(flicker.residual):.2f} | {ratio:.2f} |"
            )
    return "\n".join([*lines, ""])


def plot(path: Path, found: dict[str, dict[str, Flicker]]) -> None:
    """Draw change and residual over the frames, a row for each sequence."""
    figure = Figure(figsize=(11.0, 3.6 * len(found)), layout="constrained")
    axes = figure.subplots(len(found), 2, squeeze=False)
    for row, (sequence, by_name) in zip(axes, found.items(), strict=True):
        for axis, what in zip(row, ("change", "residual"), strict=True):
            for name, flicker in by_name.items():
                values = 1e3 * np.array(getattr(flicker, what))
                style = {"color": "black", "linestyle": "--"} if name == _REFERENCE else {}
                axis.plot(np.arange(1, len(values) + 1), values, label=_title(name), linewidth=1.2, **style)
            axis.set_title(f"{sequence.replace('_', ' ')}: {what}")
            axis.set_xlabel("frame")
            axis.set_ylabel("thousandths of white")
            axis.set_ylim(bottom=0.0)
            axis.grid(alpha=0.3)
        row[1].legend(fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", action="append", choices=SEQUENCES, metavar="NAME", help="may be repeated")
    parser.add_argument("--list", action="store_true", help="name the sequences and what they are")
    parser.add_argument("--quick", action="store_true", help="few frames and samples: a look only")
    parser.add_argument("--reprocess", action="store_true", help="render nothing: all of it must be there")
    parser.add_argument("--again", action="store_true", help="export the samples again")
    parser.add_argument("--prepare", action="store_true", help="render what is missing, and stop")
    parser.add_argument("--mode", action="append", choices=MODES, help="samples to export (ordinary, hidden)")
    options = parser.parse_args()
    if options.list:
        for item in SEQUENCES.values():
            print(f"{item.name:>12}  {item.purpose}")
        return 0
    OUTPUT.mkdir(parents=True, exist_ok=True)
    found = {}
    for name in options.scene or SEQUENCES:
        sequence = Sequence(SEQUENCES[name], _QUICK if options.quick else _FULL)
        if not options.reprocess:
            sequence.prepare(options.mode or ["ordinary", "hidden"], again=options.again)
        if not options.prepare:
            found[name] = measure(sequence)
    if found:
        stem = "part" if options.scene else "quick" if options.quick else "results"
        text = table(found)
        print(text)
        (OUTPUT / f"{stem}.md").write_text(text, encoding="utf-8")
        values = {name: {n: f.to_json() for n, f in by_name.items()} for name, by_name in found.items()}
        (OUTPUT / f"{stem}.json").write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
        plot(OUTPUT / f"{stem}.png", found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
