"""Images that end before their end."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from potmesil_addon import exr, png
from potmesil_addon.cut import is_cut

from .helpers import crafted_exr, data_files, needs_data

NOISE = np.random.default_rng(0).random((40, 30, 4), dtype=np.float32)


def exr_of(**header: Any) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File({**kind, **header}, {"RGBA": NOISE}).write(str(path))

    return write


def parts(path: Path) -> None:
    header = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    each = [OpenEXR.Part({**header}, {"Z": NOISE[..., n].copy()}, f"part {n}") for n in range(3)]
    OpenEXR.File(each).write(str(path))


def boxes(kind: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        long = (1).to_bytes(4, "big") + b"mdat" + (36).to_bytes(8, "big") + bytes(20)
        path.write_bytes(kind + (20).to_bytes(4, "big") + b"free" + bytes(12) + long)

    return write


def riff(path: Path) -> None:
    path.write_bytes(b"RIFF" + (31).to_bytes(4, "little") + b"WEBPVP8 " + bytes(24))


WHOLE: dict[str, Callable[[Path], object]] = {
    "picture.exr": lambda path: exr.write_picture(path, NOISE, {"potmesil:motion": "x" * 5000}),
    "lines.exr": exr_of(compression=OpenEXR.NO_COMPRESSION),
    "parts.exr": parts,
    "crafted.exr": lambda path: path.write_bytes(crafted_exr([("R", 1, 1), ("Z", 2, 1)])),
    "picture.png": lambda path: png.write_png(path, NOISE),
    "picture.webp": riff,
    "picture.jp2": boxes(b"\x00\x00\x00\x0cjP  \r\n\x87\n"),
    "picture.avif": boxes(b"\x00\x00\x00\x10ftypavif" + bytes(4)),
    "picture.jpg": lambda path: path.write_bytes(b"\xff\xd8\xff\xe0" + bytes(20) + b"\xff\xd9"),
    "picture.bmp": lambda path: path.write_bytes(b"BM" + (80).to_bytes(4, "little") + bytes(74)),
    "picture.tga": lambda path: path.write_bytes(bytes(18) + bytes(100) + b"TRUEVISION-XFILE.\x00"),
}


@pytest.mark.parametrize("name", WHOLE)
def test_whole_files_are_whole_and_any_shorter_one_is_cut(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    WHOLE[name](path)
    assert not is_cut(path)
    whole = path.read_bytes()
    # Between two boxes nothing says that there was a third one.
    first = 37 if path.suffix in (".jp2", ".avif") else 16
    lengths = {*range(first, len(whole), 1 + len(whole) // 60), len(whole) - 1}
    for length in sorted(lengths):
        path.write_bytes(whole[:length])
        assert is_cut(path), length


@pytest.mark.parametrize("name", ["picture.exr", "parts.exr"])
def test_an_exr_file_whose_tables_were_never_filled_in_is_cut(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    WHOLE[name](path)
    whole = path.read_bytes()
    _, first = exr._header_ends(whole)
    path.write_bytes(whole[:first] + bytes(8) + whole[first + 8 :])
    assert is_cut(path)


def test_a_png_file_with_a_hole_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    WHOLE["picture.png"](path)
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 1
    path.write_bytes(whole)
    assert is_cut(path)


@pytest.mark.parametrize("content", [b"", b"x", b'{"report": 1}\n', b"P6 1 1 255\n123"])
def test_other_files_are_not_cut(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "file").write_bytes(content)
    assert not is_cut(tmp_path / "file")


@needs_data
@pytest.mark.parametrize("folder", ["exr"])
def test_other_peoples_files_that_openexr_reads_are_whole(folder: str) -> None:
    for path in data_files(folder):
        if path.suffix != ".exr":
            continue
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(Exception):
            OpenEXR.File(str(path))
            assert not is_cut(path), path
