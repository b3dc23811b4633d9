"""Tells images that end before their end: not all that writes them says when the disk is full."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

_EXR: Final = b"\x76\x2f\x31\x01"
_TILED, _DEEP, _MULTIPART = 0x200, 0x800, 0x1000
_MOST_NAME: Final = 256
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JP2: Final = b"\x00\x00\x00\x0cjP  \r\n\x87\n"
_AVIF: Final = b"ftypavif"
_TARGA_END: Final = b"TRUEVISION-XFILE.\x00"
_AT_ONCE: Final = 1 << 20


def is_cut(path: Path) -> bool:
    """Return whether a file misses its end, or, where its format tells, something of its middle.

    Parameters
    ----------
    path : Path
        A file. OpenEXR, PNG, JPEG, JPEG 2000, WebP, AVIF, BMP and, by its suffix, Targa are looked into.

    Returns
    -------
    bool
        False for whole files and for those of other formats.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(16)
        if head.startswith(_EXR):
            try:
                return not _is_whole_exr(file, size)
            except (ValueError, struct.error):
                return True
        if head.startswith(_PNG):
            return not _is_whole_png(file, size)
        if head.startswith(b"RIFF"):
            said = int.from_bytes(head[4:8], "little")
            return size < 8 + said + said % 2
        if head.startswith(_JP2) or head[4:12] == _AVIF:
            return sum(_boxes(file, size)) != size
        if head.startswith(b"BM") and head[6:10] == bytes(4):
            return size < int.from_bytes(head[2:6], "little")
        if head.startswith(b"\xff\xd8\xff"):
            return _last(file, size, 2) != b"\xff\xd9"
        if path.suffix.lower() == ".tga":
            return _last(file, size, len(_TARGA_END)) != _TARGA_END
    return False


def _is_whole_exr(file: IO[bytes], size: int) -> bool:
    """Return whether all of an OpenEXR file's chunks are named in its tables, and the last one is there.

    Raises
    ------
    ValueError, struct.error
        If the headers or tables are not there.
    """
    file.seek(4)
    flags = _integer(file)
    if flags & _DEEP:
        return True
    tiled = []
    while True:
        header = dict(_attributes(file))
        if not header:
            break
        tiled.append(header["type"].startswith(b"tiled") if "type" in header else bool(flags & _TILED))
        if not flags & _MULTIPART:
            break
    # The tables of all parts stand together, and the first chunk behind them.
    offsets = [size]
    while file.tell() < min(offsets):
        offsets.append(struct.unpack("<Q", file.read(8))[0])
    last = max(offsets[1:], default=0)
    if not last or min(offsets) < file.tell():
        return False
    file.seek(last)
    part = _integer(file) if flags & _MULTIPART else 0
    if not 0 <= part < len(tiled):
        return False
    file.seek(16 if tiled[part] else 4, os.SEEK_CUR)
    return 0 <= _integer(file) <= size - file.tell()


def _attributes(file: IO[bytes]) -> Iterator[tuple[str, bytes]]:
    """Yield the attributes of an OpenEXR header, and leave the file behind it."""
    while name := _text(file):
        _text(file)
        length = _integer(file)
        if length < 0:
            raise ValueError
        # Previews and paths of what moves are long, and nothing here asks for them.
        yield name, file.read(min(length, _MOST_NAME))
        file.seek(max(length - _MOST_NAME, 0), os.SEEK_CUR)


def _text(file: IO[bytes]) -> str:
    found = bytearray()
    while (byte := file.read(1)) != b"\0":
        if not byte or len(found) == _MOST_NAME:
            raise ValueError
        found += byte
    return found.decode("latin-1")


def _integer(file: IO[bytes]) -> int:
    value: int = struct.unpack("<i", file.read(4))[0]
    return value


def _is_whole_png(file: IO[bytes], size: int) -> bool:
    """Return whether a PNG file's chunks have their checksums, and the last one is the last there is."""
    kind, end = b"", len(_PNG)
    while kind != b"IEND":
        file.seek(end)
        length, kind = int.from_bytes(file.read(4), "big"), file.read(4)
        end += 12 + length
        if end > size:
            return False
        checksum = zlib.crc32(kind)
        while length:
            piece = file.read(min(length, _AT_ONCE))
            checksum = zlib.crc32(piece, checksum)
            length -= len(piece)
        if file.read(4) != checksum.to_bytes(4, "big"):
            return False
    return True


def _boxes(file: IO[bytes], size: int) -> Iterator[int]:
    """Yield the lengths of the boxes that a file of the ISO base media format is made of."""
    start = 0
    while start < size:
        file.seek(start)
        length = int.from_bytes(file.read(4), "big")
        if size - start < 8:
            length = 8
        elif length == 1:
            file.seek(start + 8)
            length = int.from_bytes(file.read(8), "big")
        elif not length:  # to the end of the file
            length = size - start
        yield length
        start += max(length, 8)


def _last(file: IO[bytes], size: int, count: int) -> bytes:
    """Return the last bytes of a file, of all its bytes where it has fewer."""
    file.seek(max(size - count, 0))
    return file.read(count)
