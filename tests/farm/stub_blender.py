"""A stand-in for Blender that makes no pictures: it keeps the command's contract with farms and writes text.

It takes `-b FILE --command potmesil_camera COMMAND ...` as Blender does, and `--python SCRIPT -- ...`. A file
named fail-7 beside the samples makes frame 7 fail. Each run adds its words to calls.txt beside the samples.
"""

from __future__ import annotations

import argparse
import json
import os
import runpy
import sys
from pathlib import Path

from potmesil_addon.frames import frame_path, parse_frames


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    part.write_text(text)
    part.replace(path)


def say(line: str) -> None:
    print(line, flush=True)


def main() -> int:
    words = sys.argv[1:]
    if "--python" in words:
        script = words.index("--python") + 1
        sys.argv = words[script:]
        runpy.run_path(words[script], run_name="__main__")
        return 0
    scene, command, extension = words[1], words[2], words[3]
    assert (words[0], command, extension) == ("-b", "--command", "potmesil_camera")
    if not Path(scene).is_file():
        print(f"Error: {scene} cannot be read.", file=sys.stderr)
        return 3
    parser = argparse.ArgumentParser()
    parser.add_argument("stage", choices=("passes", "process", "render"))
    parser.add_argument("--frames", type=parse_frames, required=True)
    parser.add_argument("--samples", type=Path, required=True)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--existing", choices=("skip", "keep", "overwrite"), default="skip")
    parser.add_argument("--progress", default="openjd")
    for option in ("--scene", "--threads", "--max-memory", "--frame-retries"):
        parser.add_argument(option)
    options = parser.parse_args(words[4:])
    folder = options.samples.parent
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "calls.txt").open("a") as calls:
        calls.write(json.dumps(words[4:]) + "\n")
    made = options.samples if options.stage == "passes" else options.output
    for number, frame in enumerate(options.frames, 1):
        path = frame_path(made, frame)
        if path.is_file() and options.existing != "overwrite":
            say(f'Skipping existing frame "{path}"')
        else:
            samples = frame_path(options.samples, frame)
            if (folder / f"fail-{frame}").exists() and options.stage != "passes":
                print(f"Error: Frame {frame}: it was told to fail.", file=sys.stderr, flush=True)
                say(f"openjd_fail: frame {frame}")
                return 4
            if options.stage == "process" and not samples.is_file():
                print(f"Error: Frame {frame}: {samples} is missing.", file=sys.stderr, flush=True)
                return 3
            write(path, f"{options.stage} {frame}\n")
            say(f"Saved: '{path}'")
            say("Time: 00:00.01")
        if options.progress == "openjd":
            say(f"openjd_progress: {100 * number / len(options.frames):.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
