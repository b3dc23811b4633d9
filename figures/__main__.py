"""Draw the papers' figures and tables again, and put them into the documentation when asked.

Samples files and Cycles' references are rendered once and kept in the output's cache.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from .catalogue import FIGURES
from .publish import publish
from .workshop import Workshop

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    """Draw figures."""
    parser = argparse.ArgumentParser(prog="python -m figures", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="figures to draw (default: all)")
    parser.add_argument("--list", action="store_true", help="name the figures")
    parser.add_argument(
        "--output", type=Path, default=ROOT / "build" / "figures", help="folder of the figures"
    )
    parser.add_argument("--percentage", type=int, default=100, help="size of rendered pictures")
    parser.add_argument("--samples", type=int, help="Cycles' samples a pixel in place of the scenes' own")
    parser.add_argument("--docs", action="store_true", help="put the figures into the documentation")
    options = parser.parse_args()
    if options.list:
        for figure in FIGURES:
            print(f"{figure.name:20} {figure.title}")
        return 0
    known = {figure.name for figure in FIGURES}
    for name in options.names:
        if name not in known:
            parser.error(f"there is no figure '{name}'; --list names them")
    workshop = Workshop(options.output.resolve(), options.percentage, options.samples)
    for figure in FIGURES:
        if options.names and figure.name not in options.names:
            continue
        started = time.perf_counter()
        drawing = figure.draw(workshop)
        numbers = workshop.folder / f"{figure.name}.json"
        numbers.write_text(json.dumps(drawing.numbers, indent=2) + "\n", encoding="utf-8")
        print(f"{figure.title}: {drawing.path.name}, {time.perf_counter() - started:.1f} s", flush=True)
        if options.docs:
            for path in publish(figure.name, drawing):
                print(f"  {path.relative_to(ROOT)}, {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
