"""Save scenes as .blend files: `python -m sample_scenes carafe`, or all of them."""

from __future__ import annotations

import argparse
from pathlib import Path

from .catalogue import FOLDER, SCENES, save


def main() -> int:
    """Save scenes."""
    parser = argparse.ArgumentParser(prog="python -m sample_scenes", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(SCENES)}")
    parser.add_argument("--output", type=Path, default=FOLDER, help="folder of the .blend files")
    options = parser.parse_args()
    for name in options.names:
        if name not in SCENES:
            parser.error(f"there is no scene '{name}'; choose from {', '.join(SCENES)}")
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.names or [name for name, item in SCENES.items() if item.saved]:
        path = options.output.resolve() / f"{name}.blend"
        save(name, path)
        print(f"Saved: {path.name}, {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
