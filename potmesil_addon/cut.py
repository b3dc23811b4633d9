"""Tells images that end before their end: not all that writes them says when the disk is full."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

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
        A file. PNG, JPEG, JPEG 2000, WebP, AVIF and, by its suffix, Targa are looked into.

    Returns
    -------
    bool
        False for whole files and for those of other formats; those of OpenEXR's tell on reading.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(16)
        if head.startswith(_PNG):
            return not _is_whole_png(file, size)
        if head.startswith(b"RIFF"):
            said = int.from_bytes(head[4:8], "little")
            return size < 8 + said + said % 2
        if head.startswith(_JP2) or head[4:12] == _AVIF:
            return sum(_boxes(file, size)) != size
        if head.startswith(b"\xff\xd8\xff"):
            return _last(file, size, 2) != b"\xff\xd9"
        if path.suffix.lower() == ".tga":
            return _last(file, size, len(_TARGA_END)) != _TARGA_END
    return False


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
        if length == 1:
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
