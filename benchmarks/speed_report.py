"""Tables and plots of what `speed.py` measured, and how it stands to the targets."""

from __future__ import annotations

import itertools
import math
import re
import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.ticker import ScalarFormatter
from roofline import Limits, Work
from speed_runs import Case

from figures.sheet import COLORS, STYLE, write_plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Results = dict[str, Any]

_MAIN = "1920x1080"
_LARGE = "3840x2160"

_QUIET = 0.5
"""Load of the machine up to which times can be trusted."""

_CERTAIN = 0.1
"""Share of what was subtracted from another tool's time that the rest must exceed."""

_TITLES = {"disc": "disc", "polygon": "polygon, 6 blades", "lommel": "Lommel"}


def seconds_of(results: Results) -> dict[Case, float]:
    """Return the median seconds of our cases."""
    return {Case(**one["case"]): one["seconds"] for one in results.get("ours", ())}


def peers_of(results: Results, name: str) -> dict[tuple[str, int], float]:
    """Return the median seconds of another tool by size and radius; 0 for a tool without radius.

    Parameters
    ----------
    results : dict
        Of a run.
    name : str
        ``defocus``, ``gegl`` or ``vector blur``.

    Returns
    -------
    dict
        What was left out has none, and what is lost in the noise of what it was told apart from.
    """
    found = {}
    for one in results.get("peers", ()):
        match = re.fullmatch(rf"{name}(?: r(\d+))?", one["name"])
        if match and "seconds" in one and one["seconds"] > _CERTAIN * one.get("empty", 0.0):
            found[one["size"], int(match[1] or 0)] = one["seconds"]
    return found


def growth(times: dict[int, float]) -> dict[int, float]:
    """Return by how much a time grows where the radius is doubled, by the larger radius."""
    return {radius: times[radius] / times[radius // 2] for radius in times if times.get(radius // 2)}


def report(results: Results) -> str:
    """Return everything as Markdown.

    Parameters
    ----------
    results : dict
        Of a run, parts of which may be missing.

    Returns
    -------
    str
        Headings of the third level and tables.
    """
    parts = (
        _machine, _targets, _lens, _others, _peers, _cycles, _stage, _memory, _cold, _growth, _busy, _limits,
        _code,
    )  # fmt: skip
    return "\n\n".join(text for text in (part(results) for part in parts) if text) + "\n"


def targets(results: Results) -> list[tuple[str, str, float | None, bool | None]]:
    """Return what is aimed at and what was reached.

    Parameters
    ----------
    results : dict
        Of a run.

    Returns
    -------
    list of tuple
        What, the target in words, the value, and whether it is reached; both None where it was not measured.
    """
    ours = seconds_of(results)
    rows: list[tuple[str, str, float | None, bool | None]] = []

    def row(what: str, limit: float, value: float | None, *, most: bool, unit: str = "") -> None:
        reached = None if value is None else (value <= limit if most else value >= limit)
        rows.append((what, f"{'at most' if most else 'at least'} {limit:g}{unit}", value, reached))

    defocus, gegl, vector = (peers_of(results, name) for name in ("defocus", "gegl", "vector blur"))
    for radius, plain, with_it in ((32, 100, 40), (64, 250, 100)):
        for visibility, least in (("none", plain), ("aperture", with_it)):
            own = ours.get(Case(_MAIN, "lens", "disc", visibility, radius))
            what = f"Defocus / lens stage, {_MAIN}, radius {radius}, visibility {visibility}"
            row(what, least, _ratio(defocus.get((_MAIN, radius)), own), most=False)
    for visibility in ("none", "aperture"):
        ratios = [
            seconds / ours[Case(size, "lens", "disc", visibility, radius)]
            for (size, radius), seconds in gegl.items()
            if Case(size, "lens", "disc", visibility, radius) in ours
        ]
        row(f"GEGL / lens stage, least, visibility {visibility}", 1, min(ratios, default=None), most=False)
    doubled = [g for _, times in _by_radius(ours) for g in growth(times).values()]
    row("Twice the diameter, most", 2.2, max(doubled, default=None), most=True)
    row("Time a pixel, larger over smaller frame, most", 1.0, max(_scaling(ours), default=None), most=True)
    ratios = [
        vector[size, 0] / ours[Case(size, "motion")] for size, _ in vector if Case(size, "motion") in ours
    ]
    row("Vector Blur / motion stage, least", 1, min(ratios, default=None), most=False)
    shares = [_stage_seconds(one) / one["pinhole_seconds"] for one in results.get("stage", ())]
    row("Stage / pinhole render, most", 15, _percent(max(shares, default=None)), most=True, unit=" %")
    peaks = [one["peak_bytes"] / 1e9 for one in results.get("memory", ()) if one["case"]["size"] == _LARGE]
    row(f"Memory at {_LARGE}, most", 1.2, max(peaks, default=None), most=True, unit=" GB")
    for cache, limit in (("full", 1.5), ("empty", 15.0)):
        times = [one["imports"] + one["first"] for one in results.get("cold", ()) if one["cache"] == cache]
        what = f"Imports and first frame, kernel cache {cache}, most"
        row(what, limit, max(times, default=None), most=True, unit=" s")
    busy = [one["busy"] for one in results.get("ours", ()) if one["case"]["size"] == _MAIN]
    row(f"Cores busy at {_MAIN}, least", 90, _percent(min(busy, default=None)), most=False, unit=" %")
    return rows


def _machine(results: Results) -> str:
    if "machine" not in results:
        return ""
    known = results["machine"]
    peers = [one["blender"] for one in results.get("peers", ()) if "blender" in one]
    blender = f" Blender {peers[0]}." if peers else ""
    text = (
        f"Measured on {known['cores']} cores of: {known['processor']}, "
        f"{known['memory_bytes'] / 2**30:.0f} GB of memory, {known['system']}.{blender}"
    )
    if known["load"] > _QUIET:
        text += f" **Other programs were running: the load was {known['load']:.1f} at the start.**"
    return text


def _targets(results: Results) -> str:
    rows = []
    for what, limit, value, reached in targets(results):
        if value is not None:
            rows.append((what, limit, f"{value:.3g}", "yes" if reached else "**no**"))
    return _section("Targets", ("", "target", "measured", "reached"), rows)


def _lens(results: Results) -> str:
    ours, defocus = seconds_of(results), peers_of(results, "defocus")
    texts = []
    for size in _sizes(ours):
        lens = {case: value for case, value in ours.items() if (case.size, case.stage) == (size, "lens")}
        radii = sorted({case.radius for case in lens})
        rows = []
        for psf, visibility in dict.fromkeys((case.psf, case.visibility) for case in lens):
            values = [lens.get(Case(size, "lens", psf, visibility, radius)) for radius in radii]
            rows.append((_TITLES[psf], visibility, *(_number(value) for value in values)))
        for name, title in (("defocus", "Defocus"), ("gegl", "GEGL lens-blur")):
            times = peers_of(results, name)
            if any((size, radius) in times for radius in radii):
                rows.append((title, "", *(_number(times.get((size, radius))) for radius in radii)))
        for visibility in ("none", "aperture"):
            ratios = [
                _ratio(defocus.get((size, radius)), lens.get(Case(size, "lens", "disc", visibility, radius)))
                for radius in radii
            ]
            if any(ratios):
                rows.append(("*Defocus / disc*", visibility, *(_number(ratio) for ratio in ratios)))
        head = ("PSF", "visibility", *(f"{radius} px" for radius in radii))
        texts.append(_section(f"Lens stage, {size}: seconds by the largest radius", head, rows))
    return "\n\n".join(text for text in texts if text)


def _others(results: Results) -> str:
    ours, vector = seconds_of(results), peers_of(results, "vector blur")
    instants = {Case(**one["case"]): sum(one["instants"]) for one in results.get("ours", ())}
    rows = []
    for case, value in ours.items():
        if case.stage == "lens":
            continue
        blur = vector.get((case.size, 0)) if case.stage == "motion" else None
        name = "motion" if case.stage == "motion" else f"lens and motion, {case.visibility}, {case.radius} px"
        rows.append(
            (
                case.size,
                name,
                instants[case] or "",
                _number(value),
                _number(blur),
                _number(_ratio(blur, value)),
            )
        )
    head = ("Size", "stage", "instants", "s", "Vector Blur, 32 samples", "ratio")
    return _section("Motion stage, and both", head, rows)


def _peers(results: Results) -> str:
    left = [one for one in results.get("peers", ()) if "left_out" in one]
    if not left:
        return ""
    names = ", ".join(f"{one['name']} at {one['size']}" for one in left)
    return f"Left out, since a run was expected to take longer than {left[0]['cap']:.0f} s: {names}."


def _cycles(results: Results) -> str:
    ours = seconds_of(results)
    rows = []
    for size, facts in results.get("frames", {}).items():
        cycles = facts["cycles_seconds"]
        own = ours.get(Case(size, "lens", "disc", "aperture", 32))
        rows.append(
            (size, facts["cycles_samples"], *(_number(cycles[name]) for name in cycles), _number(own))
        )
    head = ("Size", "samples a pixel", "pinhole", "lens", "lens and motion", "lens stage, aperture, 32 px")
    return _section("Cycles on the same frame, seconds", head, rows)


def _stage(results: Results) -> str:
    rows = [
        (
            one["scene"],
            "lens and motion" if one["motion"] else "lens",
            one["cycles_samples"],
            _number(one["pinhole_seconds"]),
            *(_number(one[name]) for name in ("read", "process", "write")),
            f"{100.0 * _stage_seconds(one) / one['pinhole_seconds']:.1f} %",
        )
        for one in results.get("stage", ())
    ]
    head = ("Scene", "processors", "Cycles' samples", "pinhole render", "read", "process", "write", "share")
    return _section("Sample scenes, seconds", head, rows)


def _memory(results: Results) -> str:
    rows = [
        (
            Case(**one["case"]).name,
            f"{one['peak_bytes'] / 1e6:.0f}",
            f"{one['peak_bytes'] / Case(**one['case']).pixels:.0f}",
        )
        for one in results.get("memory", ())
    ]
    return _section("Memory above the input", ("Case", "MB", "bytes a pixel"), rows)


def _cold(results: Results) -> str:
    rows = [
        (
            Case(**one["case"]).name,
            one["cache"],
            *(_number(one[name]) for name in ("imports", "first", "later")),
            _number(one["imports"] + one["first"]),
        )
        for one in results.get("cold", ())
    ]
    head = ("First frame", "kernel cache", "imports", "first", "later", "imports and first")
    return _section("Cold start, seconds", head, rows)


def _growth(results: Results) -> str:
    ours = seconds_of(results)
    rows = []
    for (size, psf, visibility), times in _by_radius(ours):
        found = growth(times)
        if found:
            told = ", ".join(f"{value:.2f}" for _, value in sorted(found.items()))
            rows.append((size, _TITLES[psf], visibility, f"{max(found)} px", told))
    for name in ("defocus", "gegl"):
        for size in dict.fromkeys(size for size, _ in peers_of(results, name)):
            times = {radius: value for (at, radius), value in peers_of(results, name).items() if at == size}
            found = growth(times)
            if found:
                told = ", ".join(f"{value:.2f}" for _, value in sorted(found.items()))
                rows.append(
                    (size, name.capitalize() if name == "defocus" else "GEGL", "", f"{max(found)} px", told)
                )
    head = ("Size", "", "visibility", "up to", "factor for each doubling of the diameter")
    return _section("Growth", head, rows)


def _busy(results: Results) -> str:
    found: dict[tuple[str, str], list[float]] = {}
    for one in results.get("ours", ()):
        case = Case(**one["case"])
        found.setdefault((case.size, _kind(case)), []).append(100.0 * one["busy"])
    rows = [
        (size, kind, len(shares), f"{statistics.median(shares):.0f} %", f"{min(shares):.0f} %")
        for (size, kind), shares in found.items()
    ]
    return _section("Cores busy", ("Size", "stage", "cases", "median", "least"), rows)


def _limits(results: Results) -> str:
    if "limits" not in results:
        return ""
    limits = Limits(**results["limits"])
    text = (
        f"Measured limits of the machine: {limits.memory / 1e9:.1f} GB/s to and from memory, "
        f"{limits.cache / 1e9:.0f} GB/s in the caches, {limits.single / 1e9:.0f} and "
        f"{limits.double / 1e9:.0f} thousand million operations a second in single and double precision."
    )
    stood = _stood(results)
    # The other sizes are in the plot.
    size = _MAIN if any(case.size == _MAIN for case, _, _ in stood) else ""
    rows = []
    for case, work, seconds in stood:
        if not case.name.startswith(size):
            continue
        least, cache = work.least_seconds(limits), work.cache_seconds(limits)
        rows.append(
            (
                case.name,
                f"{work.operations / 1e9:.2f}",
                f"{work.bytes / 1e6:.0f}",
                f"{work.operations / seconds / 1e9:.2f}",
                f"{1000.0 * least:.0f}",
                f"{1000.0 * cache:.0f}",
                _number(1000.0 * seconds),
                f"{100.0 * cache / seconds:.0f} %",
            )
        )
    head = (
        "Case", "10⁹ operations", "MB", "10⁹ operations a second", "limit, ms", "limit in the caches, ms",
        "measured, ms", "share",
    )  # fmt: skip
    return _section("How near the limit", head, rows, text)


def _code(results: Results) -> str:
    rows = []
    for kernel in results.get("code", ()):
        if not kernel["parallel"]:
            continue
        loops = kernel["loops"]
        rows.append(
            (
                f"`{kernel['kernel']}`",
                len(loops),
                sum(loop["vectorised"] for loop in loops),
                max(loop["bits"] for loop in loops),
                sum(bool(loop["calls"]) for loop in loops),
                sum(loop["allocates"] for loop in loops),
            )
        )
    head = ("Kernel", "innermost loops", "on vectors", "bits", "that call", "that allocate")
    text = (
        "Of the kernels that run on all cores, with what they call, for all types that were used. Loops "
        "without arithmetic on floating-point numbers are left out. On vectors: at least half of it."
    )
    return _section("Innermost loops in the machine code", head, rows, text)


def plots(results: Results, folder: Path, stem: str) -> dict[str, Path]:
    """Draw time over diameter, and the roofline.

    Parameters
    ----------
    results : dict
        Of a run.
    folder : Path
        For the pictures.
    stem : str
        Their names begin with it.

    Returns
    -------
    dict of str to Path
        ``speed`` and, where limits were measured, ``speed_roofline``.
    """
    found = {}
    with mpl.rc_context(STYLE):
        sizes = _sizes(seconds_of(results))
        if sizes:
            plot, axes = plt.subplots(
                1, len(sizes), figsize=(3.3 * len(sizes), 3.4), sharey=True, squeeze=False
            )
            for size, ax in zip(sizes, axes[0], strict=True):
                _draw_times(ax, results, size)
            axes[0, 0].set_ylabel("seconds")
            axes[0, -1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
            found["speed"] = write_plot(folder / f"{stem}_time.png", plot)
            plt.close(plot)
        if "limits" in results and _stood(results):
            plot, ax = plt.subplots(figsize=(6.4, 4.0))
            _draw_roofline(ax, results)
            found["speed_roofline"] = write_plot(folder / f"{stem}_roofline.png", plot)
            plt.close(plot)
    return found


def _draw_times(ax: Axes, results: Results, size: str) -> None:
    lines = {
        (psf, visibility): times
        for (at, psf, visibility), times in _by_radius(seconds_of(results))
        if at == size
    }
    colors = dict(zip(("disc", "polygon", "lommel"), COLORS, strict=False))
    for (psf, visibility), times in lines.items():
        style = "-" if visibility == "none" else "--"
        label = f"{_TITLES[psf]}, {visibility}"
        radii = sorted(times)
        ax.plot(
            [2 * r for r in radii],
            [times[r] for r in radii],
            style,
            color=colors[psf],
            marker=".",
            label=label,
        )
    for number, (name, title) in enumerate((("defocus", "Defocus"), ("gegl", "GEGL lens-blur")), start=3):
        times = {radius: value for (at, radius), value in peers_of(results, name).items() if at == size}
        radii = [radius for radius in sorted(times) if times[radius] > 0.0]
        if radii:
            ax.plot(
                [2 * r for r in radii], [times[r] for r in radii], "-", color=COLORS[number], marker="s",
                markersize=4, label=title,
            )  # fmt: skip
    ax.set_xscale("log", base=2)
    ax.xaxis.set_major_formatter(ScalarFormatter())
    ax.set_yscale("log")
    ax.set_xlabel("largest circle of confusion, pixels")
    ax.set_title(size)


def _draw_roofline(ax: Axes, results: Results) -> None:
    limits, points = Limits(**results["limits"]), _stood(results)
    far = max(work.intensity for _, work, _ in points) * 3.0
    near = min(work.intensity for _, work, _ in points) / 10.0
    x = [near, limits.single / limits.memory, far]
    ax.plot(
        x, [min(v * limits.memory, limits.single) for v in x], color="black", label="memory, single precision"
    )
    knee = limits.double / limits.memory
    ax.plot(
        [knee, far],
        [limits.double] * 2,
        color="black",
        linewidth=0.8,
        linestyle="--",
        label="double precision",
    )
    ratio = statistics.median(work.operations / work.added_bytes for _, work, _ in points)
    held = limits.cache * ratio
    ax.plot(
        [held / limits.memory, far], [held] * 2, color="black", linewidth=0.8, linestyle=":",
        label="sums kept in the caches",
    )  # fmt: skip
    kinds = {
        "lens, none": ("o", COLORS[0]), "lens, aperture": ("^", COLORS[1]), "motion": ("s", COLORS[2]),
        "both": ("D", COLORS[3]),
    }  # fmt: skip
    for kind, (marker, color) in kinds.items():
        own = [(w, t) for case, w, t in points if _kind(case) == kind]
        if own:
            ax.plot(
                [w.intensity for w, _ in own], [w.operations / t for w, t in own], marker, color=color,
                markersize=4, alpha=0.7, label=kind,
            )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("operations a byte that must move")
    ax.set_ylabel("operations a second")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _kind(case: Case) -> str:
    return f"lens, {case.visibility}" if case.stage == "lens" else case.stage


def _stood(results: Results) -> list[tuple[Case, Work, float]]:
    """Return the cases that the work is known of, with their seconds."""
    ours = seconds_of(results)
    found = [(Case(**one["case"]), Work(**one["work"])) for one in results.get("work", ())]
    return [(case, work, ours[case]) for case, work in found if case in ours]


def _by_radius(ours: dict[Case, float]) -> list[tuple[tuple[str, str, str], dict[int, float]]]:
    """Return the lens stage's seconds by radius, for each size, PSF and visibility."""
    found: dict[tuple[str, str, str], dict[int, float]] = {}
    for case, value in ours.items():
        if case.stage == "lens":
            found.setdefault((case.size, case.psf, case.visibility), {})[case.radius] = value
    return list(found.items())


def _scaling(ours: dict[Case, float]) -> Iterable[float]:
    """Yield seconds a pixel in one frame over those in the next smaller one, at the same radius."""
    sizes = _sizes(ours)
    for small, large in itertools.pairwise(sizes):
        for case, value in ours.items():
            same = Case(large, case.stage, case.psf, case.visibility, case.radius)
            if case.size == small and case.stage == "lens" and same in ours:
                yield (ours[same] / same.pixels) / (value / case.pixels)


def _sizes(ours: dict[Case, float]) -> list[str]:
    return sorted({case.size for case in ours}, key=lambda size: math.prod(int(n) for n in size.split("x")))


def _stage_seconds(one: Results) -> float:
    return float(one["read"] + one["process"] + one["write"])


def _ratio(first: float | None, second: float | None) -> float | None:
    return None if first is None or not second else first / second


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _number(value: float | None) -> str:
    """Return a number with three digits that count."""
    if value is None:
        return ""
    return f"{value:.0f}" if value >= 100.0 else f"{value:#.3g}"


def _section(title: str, head: Sequence[str], rows: Sequence[Sequence[object]], text: str = "") -> str:
    """Return a heading with a table, or nothing where the table would be empty."""
    if not rows:
        return ""
    lines = [f"### {title}", "", *([text, ""] if text else [])]
    lines += ["| " + " | ".join(head) + " |", "|---|" + "--:|" * (len(head) - 1)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)
