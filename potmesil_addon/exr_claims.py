"""What an EXR file's header claims, checked against limits and the file's size before it costs memory.

The OpenEXR library believes a header: a damaged one of a hundred bytes can ask for any memory and time.
This reads the header by itself, without a copy of the file, and refuses what no file of ours or of
another renderer holds. It says nothing of the pixels.
"""

from __future__ import annotations

import math
import os
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import BinaryIO, Final

from .errors import InputError, SettingsError

_MAGIC: Final = b"\x76\x2f\x31\x01"
_TILED: Final = 0x200
_DEEP: Final = 0x800
_MULTI_PART: Final = 0x1000
_KNOWN_FLAGS: Final = 0x1E00
_LONGEST_NAME: Final = 255
_LONGEST_LIST: Final = 1 << 16
"""Bytes of a list of texts, such as the names of stereo views."""

_LARGEST_TILE: Final = 1 << 26
"""Unpacked bytes of a tile that is larger than its part; the library takes memory for a whole one."""

_SMALL: Final = 1 << 24
"""Unpacked bytes that are believed of any file."""

_PIXEL_BYTES: Final = {0: 4, 1: 2, 2: 4}

_LINES: Final = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256, 10: 256, 11: 32}
"""Rows that are packed together, by compression; 1 for those to come."""

_SHRINKS: Final = {0: 1, 1: 64, 2: 1032, 3: 1032, 4: 512, 5: 1400, 6: 16, 7: 16, 8: 1 << 14, 9: 1 << 14}
"""How many times smaller a compression can make pixels at best, by its algorithm or well over what a
picture of zeros gives; later ones are taken for `_SHRINKS_MOST`."""

_SHRINKS_MOST: Final = 1 << 18

_SUFFIXES: Final = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_LIMIT: Final = re.compile(r"([a-z_]+)=([0-9]{1,15})([KMGT]?)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ReadLimits:
    """The most that is believed of a file.

    Parameters
    ----------
    pixels : int
        Pixels of a part's data window.
    memory : int
        Bytes of all channels of all parts, unpacked.
    channels : int
        Channels of all parts.
    parts : int
        Parts.
    attributes : int
        Attributes of a part.
    header : int
        Bytes of all parts' headers.
    text : int
        Bytes of one attribute.
    """

    pixels: int = 1 << 28
    memory: int = 1 << 36
    channels: int = 4096
    parts: int = 512
    attributes: int = 1024
    header: int = 1 << 26
    text: int = 1 << 25


class _Process:
    """What holds for this process."""

    limits = ReadLimits()


def read_limits() -> ReadLimits:
    """Return the limits that files are read with."""
    return _Process.limits


def set_read_limits(limits: ReadLimits) -> ReadLimits:
    """Set the limits for the whole process.

    Parameters
    ----------
    limits : ReadLimits
        From now on.

    Returns
    -------
    ReadLimits
        Those until now.
    """
    before, _Process.limits = _Process.limits, limits
    return before


def parse_read_limits(text: str) -> ReadLimits:
    """Read limits as the command line has them.

    Parameters
    ----------
    text : str
        Such as ``pixels=512M,parts=2000``, where K, M, G and T stand for 1024 and its powers. What is not
        named stays at its default.

    Returns
    -------
    ReadLimits
        The limits.

    Raises
    ------
    SettingsError
        If the text is no such list.
    """
    names = [item.name for item in fields(ReadLimits)]
    said: dict[str, int] = {}
    for part in text.split(","):
        match = _LIMIT.fullmatch(part.strip())
        if not match or match[1] not in names or int(match[2]) < 1:
            raise SettingsError(
                f"'{part.strip()}' is no limit; write NAME=NUMBER such as pixels=512M, "
                f"with {', '.join(names)}."
            )
        said[match[1]] = int(match[2]) * _SUFFIXES[match[3].upper()]
    return replace(ReadLimits(), **said)


def check_claims(path: Path, limits: ReadLimits | None = None) -> None:
    """Raise for a file whose header is damaged or claims more than it may or can hold.

    Parameters
    ----------
    path : Path
        A file.
    limits : ReadLimits, optional
        By default those of the process.

    Raises
    ------
    InputError
        With one sentence.
    """
    limits = limits or read_limits()
    try:
        with path.open("rb") as file:
            _check_file(path, _Header(file, path, limits.header), limits)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}.") from error


class _Header:
    """The front of a file, read as far as it is asked for."""

    def __init__(self, file: BinaryIO, path: Path, most: int) -> None:
        self.file = file
        self.path = path
        self.size = os.fstat(file.fileno()).st_size
        self.most = most
        self.at = 0
        self.data = b""

    def damaged(self, why: str) -> InputError:
        """Return the error that the file is no EXR file for a reason."""
        return InputError(f"'{self.path}' is not a readable OpenEXR file ({why}); render or copy it again.")

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        end = self.at + count
        if end > self.size:
            raise self.damaged("it ends within its header")
        if end > self.most:
            raise _too_much(self.path, "a header", end, self.most, "header")
        if end > len(self.data):
            wanted = max(end, 1 << 14, 2 * len(self.data))
            self.data += self.file.read(min(wanted, self.most) - len(self.data))
            if end > len(self.data):
                raise self.damaged("it ends within its header")
        taken = self.data[self.at : end]
        self.at = end
        return taken

    def name(self) -> bytes:
        """Return the next text up to its zero byte."""
        start = self.at
        length = min(_LONGEST_NAME + 1, self.size - start)
        window = self.take(min(length, max(self.most - start, 1)))
        end = window.find(b"\0")
        if end < 0:
            raise self.damaged("a name in its header has no end")
        self.at = start + end + 1
        return window[:end]


@dataclass(frozen=True, slots=True)
class _Part:
    """What one part's header claims."""

    columns: int
    rows: int
    pixel_bytes: int
    channels: int
    chunks: int
    shrinks: int

    @property
    def unpacked(self) -> int:
        return self.columns * self.rows * self.pixel_bytes


def _check_file(path: Path, header: _Header, limits: ReadLimits) -> None:
    if header.size < 8 or header.take(4) != _MAGIC:
        raise header.damaged("it does not begin as one")
    (version,) = struct.unpack("<I", header.take(4))
    if version & 0xFF != 2 or version & ~0xFF & ~_KNOWN_FLAGS:
        raise header.damaged("it is of an unknown version")
    parts: list[_Part] = []
    while True:
        attributes = _attributes(header, limits)
        if not attributes and parts and version & _MULTI_PART:
            break
        parts.append(_part(header, attributes, version, limits))
        if len(parts) > limits.parts:
            raise _too_much(path, "parts", len(parts), limits.parts, "parts")
        channels = sum(part.channels for part in parts)
        if channels > limits.channels:
            raise _too_much(path, "channels", channels, limits.channels, "channels")
        unpacked = sum(part.unpacked for part in parts)
        if unpacked > limits.memory:
            raise _too_much(path, "pixels of all channels", unpacked, limits.memory, "memory")
        if not version & _MULTI_PART:
            break
    # Each chunk has a place in the table and a size of its own, of 4 bytes at least.
    left = header.size - header.at
    if 12 * sum(part.chunks for part in parts) > left or (
        unpacked > _SMALL and sum(part.unpacked / part.shrinks for part in parts) > left
    ):
        raise InputError(
            f"'{path}' is damaged: it is too short for the pixels that it claims; render or copy it again."
        )


def _attributes(header: _Header, limits: ReadLimits) -> dict[bytes, tuple[bytes, bytes]]:
    """Return types and values of a part's attributes by their names; none at the end of all parts."""
    found: dict[bytes, tuple[bytes, bytes]] = {}
    while name := header.name():
        if len(found) >= limits.attributes:
            raise _too_much(header.path, "attributes", len(found) + 1, limits.attributes, "attributes")
        kind = header.name()
        (size,) = struct.unpack("<i", header.take(4))
        if size < 0 or header.at + size > header.size:
            raise header.damaged("an attribute is longer than the file")
        if size > limits.text:
            raise _too_much(header.path, "an attribute", size, limits.text, "text")
        if kind == b"stringvector" and size > _LONGEST_LIST:
            raise header.damaged("a list of names is too long")
        if name in found:
            raise header.damaged("an attribute is there twice")
        found[name] = (kind, header.take(size))
    return found


def _part(
    header: _Header, attributes: Mapping[bytes, tuple[bytes, bytes]], version: int, limits: ReadLimits
) -> _Part:
    box = _unpacked(header, attributes, b"dataWindow", "<4i")
    columns, rows = box[2] - box[0] + 1, box[3] - box[1] + 1
    if columns < 1 or rows < 1 or columns * rows > limits.pixels:
        raise InputError(
            f"'{header.path}' claims {columns} x {rows} pixels; at least one and at most {limits.pixels} are "
            "read, unless the read limit 'pixels' is raised."
        )
    _unpacked(header, attributes, b"displayWindow", "<4i")
    (compression,) = _unpacked(header, attributes, b"compression", "<B")
    channels, pixel_bytes = _channels(header, attributes)
    kind = attributes.get(b"type", (b"", b""))[1].rstrip(b"\0")
    tiled = kind in (b"tiledimage", b"deeptile") if kind else bool(version & _TILED)
    # Of deep files only the header is read, to say that they are.
    deep = kind.startswith(b"deep") or bool(version & _DEEP)
    if tiled:
        across, down, _ = _unpacked(header, attributes, b"tiles", "<IIB")
        if across < 1 or down < 1:
            raise header.damaged("its tiles have no pixels")
        if across * down * pixel_bytes > max(_LARGEST_TILE, columns * rows * pixel_bytes):
            raise header.damaged("its tiles are much larger than the picture")
        chunks = math.ceil(columns / across) * math.ceil(rows / down)
    else:
        chunks = math.ceil(rows / _LINES.get(compression, 1))
    if b"chunkCount" in attributes:
        (said,) = _unpacked(header, attributes, b"chunkCount", "<i")
        if said < 0 or 8 * said > header.size:
            raise header.damaged("it claims more chunks than it can hold")
    return _Part(
        columns,
        rows,
        0 if deep else pixel_bytes,
        channels,
        0 if deep else chunks,
        _SHRINKS.get(compression, _SHRINKS_MOST),
    )


def _unpacked(
    header: _Header, attributes: Mapping[bytes, tuple[bytes, bytes]], name: bytes, form: str
) -> tuple[int, ...]:
    value = attributes.get(name, (b"", b""))[1]
    if len(value) != struct.calcsize(form):
        raise header.damaged(f"its {name.decode()} is missing or damaged")
    return struct.unpack(form, value)


def _channels(header: _Header, attributes: Mapping[bytes, tuple[bytes, bytes]]) -> tuple[int, int]:
    """Return how many channels there are, and the bytes of a pixel."""
    value = attributes.get(b"channels", (b"", b""))[1]
    at = count = pixel_bytes = 0
    while at < len(value) and value[at]:
        end = value.find(b"\0", at, at + _LONGEST_NAME + 1)
        if end < 0 or end + 17 > len(value):
            raise header.damaged("its channels are damaged")
        kind, _, across, down = struct.unpack_from("<iIii", value, end + 1)
        if kind not in _PIXEL_BYTES or across < 1 or down < 1 or not _is_text(value[at:end]):
            raise header.damaged("its channels are damaged")
        pixel_bytes += max(1, _PIXEL_BYTES[kind] // (across * down))
        count += 1
        at = end + 17
    if not count or at + 1 != len(value):
        raise header.damaged("its channels are missing or damaged")
    return count, pixel_bytes


def _is_text(name: bytes) -> bool:
    try:
        name.decode()
    except UnicodeDecodeError:
        return False
    return True


def _too_much(path: Path, what: str, claimed: int, most: int, name: str) -> InputError:
    unit = " bytes" if name in ("header", "text", "memory") else ""
    claim = f"{what} of {claimed}{unit}" if unit else f"{claimed} {what}"
    return InputError(
        f"'{path}' claims {claim}; at most {most} are read, unless the read limit '{name}' is raised."
    )
