"""Fuzz what reads files, guided by coverage: ``make fuzz FUZZ_SECONDS=3600``.

Whatever the bytes, reading ends in a result or in an error of one line. Anything else, a warning, a hang and
memory over the limit included, stops the run and leaves the bytes in build/fuzz/found.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import atheris
import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

with atheris.instrument_imports(include=["potmesil_addon"]):
    from potmesil_addon import exr, schemas
    from potmesil_addon.effect_options import read_effects
    from potmesil_addon.errors import InputError, PotmesilError
    from potmesil_addon.lamps import Lamp, lamps_from_json, lamps_to_json
    from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
    from potmesil_addon.shutter import (
        Flash,
        ShutterAttributes,
        Slit,
        attributes_from_json,
        attributes_to_json,
        parse_curve,
    )

MEMORY_MIB = 1024
SECONDS_EACH = 20
"""After which an input counts as a hang."""

LONGEST = {"samples": 16384, "json": 4096}

WORDS = {
    "samples": (
        *(
            "channels",
            "compression",
            "dataWindow",
            "displayWindow",
            "lineOrder",
            "chunkCount",
            "tiles",
            "type",
        ),
        *("box2i", "chlist", "string", "stringvector", "tiledesc", "float", "int", "m44f", "v2f", "rational"),
        *("scanlineimage", "tiledimage", "deepscanline", "multiView", "view", "name", "preview", "expTime"),
        *("potmesil:motion", "potmesil:shutter", "potmesil:lamps", "potmesil:filter", "worldToCamera"),
        *("potmesil:supersampling", "potmesil:samplePosition", "R", "G", "B", "A", "Z", "Layer.Depth.Z"),
    ),
    "json": (
        *("version", "camera", "objects", "times", "matrices", "name", "index", "box", "deforming", "places"),
        *("frames", "position", "curve", "openings", "blade_time", "slit", "edge", "width", "flash", "star"),
        *(
            "NaN",
            "Infinity",
            "1e999",
            "-1e30",
            "null",
            "true",
            "1e-320",
            "0.5",
            "[[",
            "]]",
            "{}",
            "\\\\u0000",
        ),
    ),
}


def shutter_attributes(text: str) -> None:
    """Read a shutter as the samples reader does."""
    attributes_from_json(schemas.parse(text, schemas.SHUTTER))


def effects_file(text: str) -> None:
    """Read a file of effects."""
    PLACE.write_bytes(text.encode("utf-8", "surrogatepass"))
    read_effects(PLACE)


READERS: tuple[Callable[[str], object], ...] = (
    MotionPaths.from_json,
    lamps_from_json,
    shutter_attributes,
    parse_curve,
    effects_file,
    lambda text: schemas.parse(text, schemas.FILTER),
)

PLACE = Path(tempfile.mkdtemp(prefix="potmesil_fuzz_")) / "input.exr"


def one_line(error: Exception) -> None:
    """Hold a message to one line that a terminal can show."""
    if not str(error).isprintable():
        raise AssertionError(f"not one line: {error!r}") from error


def samples(data: bytes) -> None:
    """Read bytes as a samples file."""
    PLACE.write_bytes(data)
    try:
        exr.read_samples(PLACE)
    except InputError as error:
        one_line(error)


def json_text(data: bytes) -> None:
    """Read bytes as the JSON that their first byte says."""
    text = data[1:].decode("utf-8", "replace")
    try:
        READERS[data[0] % len(READERS) if data else 0](text)
    except (PotmesilError, schemas.JsonError) as error:
        one_line(error)
    except OverflowError:
        if data[0] % len(READERS) != 2:  # that one's own docstring names it
            raise


TARGETS = {"samples": samples, "json": json_text}


def good_json() -> list[bytes]:
    """Return a text for each reader, as the extension writes it."""
    times = np.array([-0.5, 0.0, 0.5])
    matrices = np.repeat(np.eye(3, 4)[np.newaxis], 3, axis=0)
    thing = ObjectPath("Ball", 3, times, matrices, np.array([[-1.0] * 3, [1.0] * 3]), True)
    paths = MotionPaths(CameraPath(times[1:2], matrices[:1]), (thing,))
    said = ShutterAttributes(
        frames=0.5,
        position="end",
        curve=((0.0, 0.0), (1.0, 1.0)),
        openings=((0.0, 0.2), (0.4, 0.6)),
        blade_time=0.1,
        slit=Slit("top", 0.2),
        flash=Flash("first", 0.5, 0.01, 2),
    )
    texts = [
        paths.to_json(),
        lamps_to_json((Lamp(np.array([0.0, 1.0, 2.0, 1.0])),)),
        json.dumps(attributes_to_json(said)),
        "[[0, 0], [0.5, 1], [1, 0]]",
        '{"star": {"lines": 4, "rotation": 30}, "exposure": {"tint": [1, 1, 1]}, "grain": null}',
        '{"pixel_variance": 0.1727, "sample_variance": 0.1727}',
    ]
    return [bytes([n]) + text.encode() for n, text in enumerate(texts)]


def write_good_files(folder: Path) -> None:
    """Write a small file of each compression, with scan lines and tiles, with parts, and with attributes."""
    rng = np.random.default_rng(0)
    methods = [name for name in dir(OpenEXR) if name.endswith("_COMPRESSION")]
    for name in methods:
        for form in ("scan", "tile"):
            kind = np.float16 if form == "tile" else np.float32
            pixels = {channel: rng.random((20, 13)).astype(kind) for channel in "ABGRZ"}
            header = {"compression": getattr(OpenEXR, name), "type": OpenEXR.scanlineimage}
            if form == "tile":
                header |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
            OpenEXR.File(header, pixels).write(str(folder / f"{name}.{form}.exr"))
    zipped = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = []
    for part, channels in (("Layer.Combined", "RGBA"), ("Layer.Depth", "Z"), ("Layer.Vector", "XYZW")):
        pixels = {f"{part}.{c}": rng.random((6, 7), dtype=np.float32) for c in channels}
        parts.append(OpenEXR.Part(dict(zipped), pixels, part))
    OpenEXR.File(parts).write(str(folder / "parts.exr"))
    texts = dict(zip(("motion", "lamps", "shutter", "", "", "filter"), good_json(), strict=True))
    said = {f"potmesil:{name}": text[1:].decode() for name, text in texts.items() if name}
    pixels = {c: rng.random((5, 6), dtype=np.float32) for c in "RGBAZ"}
    OpenEXR.File({**zipped, **said}, pixels).write(str(folder / "attributes.exr"))


def main() -> None:
    """Fuzz one target for some seconds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", choices=list(TARGETS))
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "fuzz")
    parser.add_argument("--more", type=Path, action="append", default=[], help="a folder with more inputs")
    options = parser.parse_args()
    seeds, corpus, found = (options.output / name for name in ("seeds", "corpus", "found"))
    seeds, corpus = seeds / options.target, corpus / options.target
    for folder in (seeds, corpus, found):
        folder.mkdir(parents=True, exist_ok=True)
    if options.target == "samples":
        write_good_files(seeds)
    else:
        for n, text in enumerate(good_json()):
            (seeds / f"{n}.bin").write_bytes(text)
    words = options.output / f"{options.target}.dict"
    words.write_text("".join(f'"{word}"\n' for word in WORDS[options.target]))
    # A warning would be a line more.
    warnings.simplefilter("error")
    atheris.Setup(
        [
            sys.argv[0],
            *(str(folder) for folder in (corpus, seeds, *options.more)),
            f"-max_total_time={options.seconds}",
            f"-rss_limit_mb={MEMORY_MIB}",
            f"-timeout={SECONDS_EACH}",
            f"-max_len={LONGEST[options.target]}",
            f"-dict={words}",
            f"-artifact_prefix={found}/{options.target}-",
            "-len_control=0",
            "-print_final_stats=1",
        ],
        TARGETS[options.target],
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
