"""Samples files and results as OpenEXR files, through the OpenEXR project's own Python module.

Read are single-part and multi-part files of Blender and plain R, G, B, A, Z files of other programs;
scan lines or tiles; half, float and unsigned channels. Camera, lens and shutter travel in OpenEXR's
standard attributes; what those have no name for, in attributes that begin with ``potmesil:``.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import io
import json
import math
import os
import re
import struct
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import OpenEXR

from . import schemas
from .aperture import SAMPLE_POSITIONS
from .camera import Camera, Film, without_scale
from .errors import InputError, SettingsError
from .exr_claims import check_claims
from .files import utf8_path, whole_file
from .lamps import Lamp, lamps_from_json
from .lens import FloatArray, Lens
from .passes import CRYPTOMATTES, FORWARD, LIGHT_PASSES, MAX_LEVELS, ChannelName, PassName, parse_channel
from .paths import MotionPaths
from .samples import (
    Cryptomatte,
    Float32Array,
    LensAttributes,
    PixelFilter,
    SampleLayer,
    Samples,
    Window,
    repair,
)
from .shutter import ShutterAttributes, attributes_from_json, attributes_to_json

_NO_SURFACE_DEPTH: Final = 1e9
"""Depths from here on are Blender's way (1e10) of saying that there is no surface."""

STATIONARY: Final = " (stationary)"
"""Ends the name of the layer that shows a layer's view without its moving objects."""

MOVING: Final = " (moving)"
"""Ends the name of the layer that shows a layer's moving objects alone."""

ABSENT: Final = " (absent)"
"""Ends the name of the layer that shows a layer's view where its moving objects do not exist."""

REFLECTED: Final = " (reflected)"
"""Ends the name of the layer of what a layer's polished surfaces reflect."""

TRANSMITTED: Final = " (transmitted)"
"""Ends the name of the layer of what comes through a layer's glass."""

_BEHIND: Final = re.compile(r"(.*) \(behind ([1-9][0-9]*)\)", re.DOTALL)
"""The name of a layer that shows another's view without what is nearest, as `behind` makes it."""

_HALF_MAX: Final = 65504.0
"""The largest half float, which is what infinity and 1e10 become in a half channel."""

_MAGIC: Final = 20000630
_LONG_NAMES: Final = 0x400
_MULTI_PART: Final = 0x1000
"""The number that OpenEXR files begin with, and two flags of its version field."""

_SHORT_NAME: Final = 31
"""Bytes of the longest name without the flag for long ones."""

_INTEGERS: Final[tuple[PassName, ...]] = ("object_index", "patch")

_PRIMARIES: Final = 3

_LISTED: Final = 20
"""Layers that a sentence names."""

_LARGEST_INDEX: Final = np.iinfo(np.int32).max

DIGEST_ATTRIBUTE: Final = "potmesil:digest"
"""Header attribute of a samples file: a digest of its samples and of what is said of them.

Two renders of one frame have the same, though Blender writes its time of day into the header.
"""

_SHARED_BY_PARTS: Final = ("pixelAspectRatio",)
"""Attributes of ours that OpenEXR wants to be the same in all parts of a file."""

_LEAST: Final = 1e-9
_MOST: Final = 1e9

_PLAUSIBLE: Final = {
    "aperture": (1e-4, 1e6),
    "potmesil:apertureBlades": (0.0, 1000.0),
    "potmesil:apertureRatio": (1e-3, 1e3),
    "potmesil:apertureRotation": (-1e6, 1e6),
    "pixelAspectRatio": (1e-3, 1e3),
}
"""Least and most of numbers that are believed; the others are positive, from `_LEAST` to `_MOST`."""

_CARRIED: Final = (
    "nominalFocalLength", "aperture", "focus", "sensorOverallDimensions", "worldToCamera", "worldToNDC",
    "expTime", "framesPerSecond", "screenWindowCenter", "screenWindowWidth", "chromaticities",
    "Camera", "Scene", "Frame", "File", "colorInteropID",
)  # fmt: skip
"""Attributes that a result takes over from its samples file."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel of a file with its header-level facts."""

    full_name: str
    parsed: ChannelName
    pixels: npt.NDArray[Any]
    window: Window


@dataclass(frozen=True, slots=True)
class RawFile:
    """All channels of a file, with the first part's header."""

    header: dict[str, Any]
    channels: tuple[Channel, ...]
    parts: int

    @property
    def display_window(self) -> Window:
        """The picture."""
        return _window(self.header["displayWindow"])


def behind(number: int) -> str:
    """Return what ends the name of the layer that shows a layer's view without what is nearest in it.

    Parameters
    ----------
    number : int
        From 1 on; a larger number leaves out more.

    Returns
    -------
    str
        Such as ``" (behind 1)"``.
    """
    return f" (behind {number})"


def read_raw(path: Path) -> RawFile:
    """Read every channel of an EXR file as it is.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    RawFile
        Channels under their full names.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of a kind that cannot be processed.
    """
    file = _read_file(path)
    views = _views(file.parts)
    channels = []
    for part in file.parts:
        window = _window(part.header["dataWindow"])
        view = part.header.get("view")
        part_name = str(part.header.get("name", ""))
        if isinstance(view, str):
            part_name = part_name.removesuffix(f"-{view}")
        for name, channel in part.channels.items():
            full = _full_name(part_name if len(file.parts) > 1 else "", name)
            if isinstance(view, str) and view not in full.split("."):
                # Where a part is one view's, Blender names the view in the part and not in the channel.
                prefix, dot, component = full.rpartition(".")
                full = f"{prefix}{dot}{view}.{component}"
            channels.append(Channel(full, parse_channel(full, views), channel.pixels, window))
    return RawFile(dict(file.parts[0].header), tuple(channels), len(file.parts))


def read_header(path: Path) -> dict[str, Any]:
    """Return the header of an EXR file's first part without reading its pixels.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict
        Attributes by name.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of a kind that cannot be processed.
    """
    return dict(_read_headers(path).parts[0].header)


def read_whole_header(path: Path) -> dict[str, Any]:
    """Return the header of an EXR file's first part after all of its pixels were read.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict
        Attributes by name.

    Raises
    ------
    InputError
        If the file is missing, not whole, or of a kind that cannot be processed.
    """
    return dict(_read_file(path).parts[0].header)


def read_samples(path: Path, layers: tuple[str, ...] | None = None) -> Samples:
    """Read a samples file.

    Values that are not finite are replaced from their neighbours and counted; a depth of infinity is
    none of them. Depths of 0 or less, of 1e9 or more, and the largest half float in a half channel mean
    that there is no surface.

    Parameters
    ----------
    path : Path
        The file.
    layers : tuple of str, optional
        Names of the layers to read, front to back. By default all with colour, and of those the ones
        with a depth where any has one.

    Returns
    -------
    Samples
        The file's samples and camera.

    Raises
    ------
    InputError
        If the file cannot be read, holds no colour, lacks a layer asked for, or has layers behind one
        that do not fit it.
    """
    return samples_of(read_raw(path), path, layers)


def samples_of(raw: RawFile, path: Path, layers: tuple[str, ...] | None = None) -> Samples:
    """Return the samples of a file that was read; see `read_samples`."""
    sets = _layer_channels(raw)
    if not sets:
        if {"Y", "RY", "BY"} & {c.full_name.split(".")[-1] for c in raw.channels}:
            raise InputError(f"'{path}' is a luminance-chroma image; convert it to R, G, B channels.")
        raise InputError(f"'{path}' has no R, G, B channels; give a render with a Combined pass.")
    names = _choose_layers(path, sets, layers)
    windows = {channel.window for name in names for channel in sets[name].values()}
    if len(windows) > 1:
        raise InputError(f"The parts of '{path}' have different data windows; write them with one.")
    data_window = windows.pop()
    repaired: dict[str, int] = {}
    behind_layers = _layers_behind(raw, path, names, sets, data_window)
    built = tuple(
        replace(
            _with_companions(name, sets, data_window, repaired),
            hidden=tuple(_with_seen(other, sets, data_window, repaired) for other in behind_layers[name]),
        )
        for name in names
    )
    header = raw.header
    display_window = raw.display_window
    position = header.get("potmesil:samplePosition", "center")
    if not isinstance(position, str) or position not in SAMPLE_POSITIONS:
        raise InputError(f"'{path}' has samples at {position!r}, which must be center or corner.")
    supersampling = _number(header, "potmesil:supersampling") or 1.0
    if supersampling not in (1.0, 2.0, 3.0, 4.0):
        raise InputError(f"'{path}' claims {supersampling:g} samples a pixel each way; 1 to 4 can be.")
    if display_window.columns % supersampling or display_window.rows % supersampling:
        raise InputError(f"The size of '{path}' is no multiple of its supersampling.")
    film = _film(header, display_window)
    return Samples(
        layers=built,
        data_window=data_window,
        display_window=display_window,
        pixel_aspect=_number(header, "pixelAspectRatio") or 1.0,
        position=position,
        supersampling=int(supersampling),
        pixel_filter=_pixel_filter(header, path),
        lens=_lens_attributes(header),
        film=film,
        camera=_camera(header, film),
        shutter=_shutter(header),
        paths=_paths(header),
        lamps=_lamps(header),
        repaired=repaired,
        attributes={key: header[key] for key in _CARRIED if key in header},
    )


def _pixel_filter(header: dict[str, Any], path: Path) -> PixelFilter | None:
    text = header.get("potmesil:filter")
    if text is None:
        return None
    try:
        stored = schemas.parse(text, schemas.FILTER)
        return PixelFilter(float(stored["pixel_variance"]), float(stored["sample_variance"]))
    except (TypeError, ValueError) as error:
        raise InputError(f"The pixel filter in '{path}' cannot be read; render the samples again.") from error


def light_passes_of(raw: RawFile) -> dict[str, dict[PassName, Float32Array]]:
    """Return the colour of each layer of a render, and the passes that its light is parted by.

    Parameters
    ----------
    raw : RawFile
        The render.

    Returns
    -------
    dict of str to dict of str to ndarray of float32 of shape (rows, columns, 3 or 4)
        By layer and pass.
    """
    found: dict[str, dict[PassName, Float32Array]] = {}
    for name, channels in _layer_channels(raw, light=True).items():
        for which in ("combined", *LIGHT_PASSES):
            planes = [channels[which, n].pixels for n in range(4) if (which, n) in channels]
            if len(planes) >= _PRIMARIES:
                values = np.stack(planes, axis=-1).astype(np.float32)
                found.setdefault(name, {})[which] = np.nan_to_num(values, posinf=0.0, neginf=0.0)
    return found


def camera_attributes(camera: Camera, lens: Lens, shutter: ShutterAttributes) -> dict[str, Any]:
    """Return header attributes that say all of a camera, its lens and its exposure.

    Parameters
    ----------
    camera : Camera
        The pinhole camera.
    lens : Lens
        Lens and aperture.
    shutter : ShutterAttributes
        Exposure time and frame rate, where known.

    Returns
    -------
    dict
        OpenEXR's standard attributes in their own units (millimetres, metres, row vectors, the camera
        looking along +z), and ``potmesil:`` ones for the iris.
    """
    film = camera.film
    flip = np.diag([1.0, 1.0, -1.0, 1.0])
    to_pixels = camera.matrix
    to_ndc = np.stack(
        [to_pixels[0] / film.columns, to_pixels[1] / film.rows, [0.0, 0.0, 0.0, 1.0], to_pixels[2]]
    )
    center = (
        (0.5 * film.columns - camera.axis_x) * film.pitch_x / camera.focal_length,
        (camera.axis_y - 0.5 * film.rows) * film.pitch_y / camera.focal_length,
    )
    attributes: dict[str, Any] = {
        "nominalFocalLength": lens.focal_length * 1000.0,
        "aperture": float(lens.f_stop),
        "focus": float(lens.focus_distance),
        "sensorOverallDimensions": np.array([film.width, film.height], dtype=np.float32) * 1000.0,
        # Cycles' camera looks along -z, OpenEXR's along +z.
        "worldToCamera": _for_row_vectors(flip @ camera.world_to_camera),
        "worldToNDC": _for_row_vectors(to_ndc),
        "screenWindowWidth": film.width / camera.focal_length,
        "screenWindowCenter": np.array(center, dtype=np.float32),
        "pixelAspectRatio": film.pitch_x / film.pitch_y,
        "potmesil:apertureBlades": int(lens.blades),
        "potmesil:apertureRotation": math.degrees(lens.blade_rotation),
        "potmesil:apertureRatio": float(lens.anamorphic_ratio),
    }
    if shutter.exposure_time is not None:
        attributes["expTime"] = float(shutter.exposure_time)
    if shutter.frames_per_second is not None:
        attributes["framesPerSecond"] = Fraction(shutter.frames_per_second).limit_denominator(1001)
    more = attributes_to_json(shutter)
    if more:
        attributes["potmesil:shutter"] = json.dumps(more)
    return attributes


def annotate(
    source: Path,
    destination: Path,
    attributes: Mapping[str, Any],
    companions: Mapping[str, Path] | None = None,
    margins: tuple[int, int] = (0, 0),
    seen: Sequence[SampleLayer] = (),
    *,
    keep_light_passes: bool = True,
) -> None:
    """Copy an EXR file with attributes added to its first part, and with other views of its layers.

    Parameters
    ----------
    source : Path
        A file that was just rendered.
    destination : Path
        The samples file; written whole or not at all.
    attributes : mapping
        Header attributes.
    companions : mapping of str to Path, optional
        Files of the same layers seen otherwise, by the suffix that the names of their layers are given
        (`STATIONARY`, `MOVING`, `ABSENT`, `behind`). Of their passes those that samples have are kept.
    margins : tuple of int
        Columns and rows on each side that were rendered beyond the picture: overscan, which lies in the
        data window and not in the display window.
    seen : sequence of SampleLayer
        What mirrors and glass show, under names that end with `REFLECTED` or `TRANSMITTED`.
    keep_light_passes : bool
        Whether to keep the passes that these were made of.

    Raises
    ------
    InputError
        If a file cannot be read, or a companion has other pixels than the source.
    OutputError
        If the destination cannot be written.
    """
    file = _read_file(source)
    windows = {_part_windows(part) for part in file.parts}
    single = len(file.parts) == 1
    added: list[Any] = []
    for suffix, path in (companions or {}).items():
        other = _read_file(path)
        if {_part_windows(part) for part in other.parts} != windows or (len(other.parts) == 1) != single:
            raise InputError(f"'{path}' has other pixels than '{source}'; render both again.")
        added.extend(_add_companion(file, other, suffix))
    for layer in seen:
        added.extend(_add_seen(file, layer))
    parts = file.parts if keep_light_passes else list(_without_light_passes(file))
    if added or len(parts) != len(file.parts):
        # The module knows the size only of parts that are there when it makes the file.
        file = OpenEXR.File([*parts, *added])
    file.parts[0].header.update(attributes)
    file.parts[0].header[DIGEST_ATTRIBUTE] = _digest(file, attributes)
    shared = {name: attributes[name] for name in _SHARED_BY_PARTS if name in attributes}
    for part in file.parts:
        part.header.update(shared)
        part.header["compression"] = OpenEXR.ZIP_COMPRESSION
        if margins != (0, 0):
            part.header.update(_overscanned(part.header, np.array(margins, dtype=np.int32)))
    _write_file(file, destination)


def _digest(file: Any, attributes: Mapping[str, Any]) -> str:
    """Return a digest of a file's channels and attributes."""
    digest = hashlib.blake2b(digest_size=16)
    said = {name: getattr(value, "tolist", lambda value=value: value)() for name, value in attributes.items()}
    digest.update(json.dumps(said, sort_keys=True, default=str).encode())
    for part in file.parts:
        for name, channel in sorted(part.channels.items()):
            pixels = np.ascontiguousarray(channel.pixels)
            digest.update(f"{name} {pixels.shape} {pixels.dtype}".encode())
            digest.update(pixels.data)
    return digest.hexdigest()


def stamp(path: Path, attributes: Mapping[str, str]) -> None:
    """Add texts to the header of an EXR file in its place, and leave its pixels as they are, bit by bit.

    Where the file was compressed with losses, reading and writing it would lose more. What follows the first
    header moves, and with it where the offset tables say that pixels begin.

    Parameters
    ----------
    path : Path
        A whole file, which no one else reads yet.
    attributes : mapping of str to str
        Attributes that it does not have.

    Raises
    ------
    InputError
        If it is no whole EXR file.
    OSError
        If it cannot be read or written.
    """
    before = path.read_bytes()
    try:
        first_end, headers_end = _header_ends(before)
        added = b"".join(
            name.encode() + b"\0string\0" + struct.pack("<i", len(text.encode())) + text.encode()
            for name, text in attributes.items()
        )
        # The tables of all parts stand together, and the first pixels behind them.
        position, offsets = headers_end, [len(before)]
        while position < min(offsets):
            offsets.append(struct.unpack_from("<Q", before, position)[0])
            position += 8
    except (ValueError, struct.error) as error:
        raise InputError(f"'{path}' is not a whole OpenEXR file; render it again.") from error
    tables = struct.pack(f"<{len(offsets) - 1}Q", *(offset + len(added) for offset in offsets[1:]))
    flags = struct.unpack_from("<i", before, 4)[0]
    if any(len(name) > _SHORT_NAME for name in attributes):
        flags |= _LONG_NAMES
    with path.open("wb") as stream:
        stream.write(before[:4] + struct.pack("<i", flags) + before[8:first_end] + added)
        stream.write(before[first_end:headers_end] + tables + before[position:])


def _header_ends(content: bytes) -> tuple[int, int]:
    """Return where the first header's attributes end, and where all headers do.

    Raises
    ------
    ValueError, struct.error
        If the content ends before.
    """
    magic, flags = struct.unpack_from("<ii", content)
    if magic != _MAGIC:
        raise ValueError("no OpenEXR file")
    position, first_end = 8, 0
    while True:
        start = position
        while content[position : position + 1] != b"\0":
            # Name, type, and as many bytes as are said.
            for _ in range(2):
                position = content.index(b"\0", position) + 1
            (size,) = struct.unpack_from("<i", content, position)
            if size < 0:
                raise ValueError("an attribute of less than no bytes")
            position += 4 + size
        first_end = first_end or position
        position += 1
        # Headers of several parts end with an empty one.
        if not flags & _MULTI_PART or position == start + 1:
            return first_end, position


def _overscanned(header: Mapping[str, Any], margins: npt.NDArray[np.int32]) -> dict[str, Any]:
    """Return the windows of a render that shows more on all sides than the picture."""
    first, last = header["displayWindow"]
    data_first, data_last = header["dataWindow"]
    return {
        "displayWindow": (first, last - 2 * margins),
        "dataWindow": (data_first - margins, data_last - margins),
    }


def _full_name(part: str, channel: str) -> str:
    """Return a channel's name with its part's, which Blender may leave out, before it."""
    return channel if not part or channel.startswith(f"{part}.") else f"{part}.{channel}"


def _add_companion(file: Any, other: Any, suffix: str) -> list[Any]:
    """Add another file's layers, a suffix to their names, to a file's only part, or return parts to add.

    Blender 4.5 writes one part with all channels, later ones write a part for each pass.
    """
    views = _views(other.parts)
    single = len(other.parts) == 1
    added: list[Any] = []
    named = []
    for part in other.parts:
        part_name = "" if single else str(part.header.get("name", ""))
        for name, channel in part.channels.items():
            full = _full_name(part_name, name)
            named.append((part, full, parse_channel(full, views), channel))
    # Without a depth it is a picture of the compositor's or the denoiser's.
    layers = {parsed.layer for _, _, parsed, _ in named if parsed.name == "depth" and not parsed.other_view}
    for part in other.parts:
        kept = [
            (full, parsed, channel)
            for own, full, parsed, channel in named
            if own is part
            and parsed.name is not None
            and parsed.name not in LIGHT_PASSES
            and parsed.layer in layers
        ]
        if not kept:
            continue
        channels = {_with_suffix(full, parsed.layer, suffix): c.pixels for full, parsed, c in kept}
        if single:
            for name, pixels in channels.items():
                file.parts[0].channels[name] = OpenEXR.Channel(name, pixels)
        else:
            # The number of its chunks follows from its compression.
            header = {k: v for k, v in part.header.items() if k not in ("channels", "chunkCount", "name")}
            name = _with_suffix(str(part.header.get("name", "")), kept[0][1].layer, suffix)
            added.append(OpenEXR.Part(header, channels, name))
    return added


def _add_seen(file: Any, layer: SampleLayer) -> list[Any]:
    """Add a layer to a file's only part, or return a part with it to add."""
    values = {f"Combined.{name}": layer.color[..., n] for n, name in enumerate("RGBA")}
    if layer.depth is not None:
        values["Depth.Z"] = np.where(
            np.isfinite(layer.depth), layer.depth, np.float32(10.0 * _NO_SURFACE_DEPTH)
        )
    if layer.object_index is not None:
        values["Object Index.X"] = layer.object_index.astype(np.float32)
    if layer.patch is not None:
        values["Patch.X"] = layer.patch.astype(np.float32)
    if layer.astigmatism is not None:
        values.update((f"Astigmatism.{name}", layer.astigmatism[..., n]) for n, name in enumerate("XY"))
    if layer.vector is not None:
        values.update((f"Vector.{name}", layer.vector[..., n]) for n, name in enumerate("XYZW"))
    channels = {f"{layer.name}.{name}": np.ascontiguousarray(pixels) for name, pixels in values.items()}
    if len(file.parts) == 1:
        for name, pixels in channels.items():
            file.parts[0].channels[name] = OpenEXR.Channel(name, pixels)
        return []
    header = {k: v for k, v in file.parts[0].header.items() if k not in ("channels", "chunkCount", "name")}
    return [OpenEXR.Part(header, channels, layer.name)]


def _without_light_passes(file: Any) -> Iterator[Any]:
    """Yield a file's parts without the passes that light is parted by; parts that hold nothing else go."""
    views = _views(file.parts)
    single = len(file.parts) == 1
    for part in file.parts:
        part_name = "" if single else str(part.header.get("name", ""))
        for name in list(part.channels):
            if parse_channel(_full_name(part_name, name), views).name in LIGHT_PASSES:
                del part.channels[name]
        if part.channels:
            yield part


def _with_suffix(name: str, layer: str, suffix: str) -> str:
    """Return a channel's or part's name with a suffix to its layer, which stands first."""
    return f"{layer}{suffix}{name[len(layer) :]}" if layer else f"{suffix}.{name}"


def _part_windows(part: Any) -> tuple[Window, Window]:
    """Return the windows of a part: data and display."""
    return _window(part.header["dataWindow"]), _window(part.header["displayWindow"])


def write_picture(path: Path, picture: Float32Array, attributes: Mapping[str, Any]) -> None:
    """Write a premultiplied scene-linear picture as a float RGBA file.

    Parameters
    ----------
    path : Path
        The file; written whole or not at all.
    picture : ndarray of float32 of shape (rows, columns, 4)
        The picture.
    attributes : mapping
        Header attributes.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    header = {
        **attributes,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    _write_file(OpenEXR.File(header, {"RGBA": np.ascontiguousarray(picture)}), path)


def _write_file(file: Any, path: Path) -> None:
    with whole_file(path) as part, utf8_path(part) as name, _quiet():
        file.write(name)


def _read_headers(path: Path) -> Any:
    """Return an OpenEXR.File without pixels, of a kind that can be processed."""
    if not path.is_file():
        raise InputError(f"'{path}' does not exist; give the path of a samples file.")
    check_claims(path)
    try:
        with utf8_path(path) as name, _quiet():
            headers = OpenEXR.File(name, header_only=True)
    except Exception as error:  # the module raises RuntimeError, ValueError, UnicodeError ...
        raise InputError(
            f"'{path}' is not a readable OpenEXR file ({_first_line(error)}); render or copy it again."
        ) from error
    for part in headers.parts:
        _refuse_unsupported(path, part.header)
    if not headers.parts:
        raise InputError(f"'{path}' is damaged: it has no parts; render or copy it again.")
    return headers


def _read_file(path: Path) -> Any:
    """Return an OpenEXR.File with every channel by itself, checked as `read_raw` says."""
    headers = _read_headers(path)
    try:
        with utf8_path(path) as name, _quiet():
            file = OpenEXR.File(name, separate_channels=True)
    except Exception as error:
        raise InputError(f"'{path}' is damaged ({_first_line(error)}); render or copy it again.") from error
    # The module drops a part that it cannot decode and only prints a warning.
    if len(file.parts) < len(headers.parts):
        raise InputError(f"'{path}' is damaged: its pixels cannot be decoded; render or copy it again.")
    return file


def _views(parts: Sequence[Any]) -> tuple[str, ...]:
    """Return the names of a file's stereo views, the default one first."""
    listed = parts[0].header.get("multiView")
    if isinstance(listed, list) and all(isinstance(view, str) for view in listed):
        return tuple(listed)
    own = (part.header.get("view") for part in parts)
    return tuple(dict.fromkeys(view for view in own if isinstance(view, str)))


def _refuse_unsupported(path: Path, header: Mapping[str, Any]) -> None:
    """Raise for the kinds of file that hold no one sample a pixel."""
    kind = header.get("type")
    if kind in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise InputError(f"'{path}' is a deep image; flatten it to one sample a pixel first.")
    tiles = header.get("tiles")
    if tiles is not None and tiles.mode != OpenEXR.ONE_LEVEL:
        raise InputError(f"'{path}' is mip-mapped; save it with one level.")
    channels = header.get("channels", ())
    if any(channel.xSampling != 1 or channel.ySampling != 1 for channel in channels):
        if {"RY", "BY"} & {channel.name.split(".")[-1] for channel in channels}:
            raise InputError(f"'{path}' is a luminance-chroma image; convert it to R, G, B channels.")
        raise InputError(f"'{path}' has subsampled channels; save them at full size.")


def _layer_channels(raw: RawFile, *, light: bool = False) -> dict[str, dict[tuple[str, int], Channel]]:
    """Return, for each layer that has red, green and blue, its channels by pass and component.

    Samples have no use for the passes that light is parted by.
    """
    sets: dict[str, dict[tuple[str, int], Channel]] = {}
    for channel in raw.channels:
        if channel.parsed.name is not None and (light or channel.parsed.name not in LIGHT_PASSES):
            key = (channel.parsed.name, channel.parsed.component)
            sets.setdefault(channel.parsed.layer, {}).setdefault(key, channel)
    return {
        name: _with_fitting_cryptomatte(channels)
        for name, channels in sets.items()
        if all(("combined", component) in channels for component in range(3))
    }


def _with_fitting_cryptomatte(
    channels: dict[tuple[str, int], Channel],
) -> dict[tuple[str, int], Channel]:
    """Return a layer's channels but for Cryptomattes with other pixels than its colours: they only help."""
    window = channels["combined", 0].window
    return {
        (name, component): channel
        for (name, component), channel in channels.items()
        if name not in CRYPTOMATTES or channel.window == window
    }


def _choose_layers(
    path: Path, sets: Mapping[str, Mapping[tuple[str, int], Channel]], wanted: tuple[str, ...] | None
) -> tuple[str, ...]:
    suffixes = (STATIONARY, MOVING, ABSENT, REFLECTED, TRANSMITTED)
    companions = {f"{name}{suffix}" for name in sets for suffix in suffixes}
    companions.update(name for name in sets if (match := _BEHIND.fullmatch(name)) and match[1] in sets)
    sets = {name: channels for name, channels in sets.items() if name not in companions}
    if wanted is not None:
        for name in wanted:
            if name not in sets:
                listed = ", ".join(map(repr, list(sets)[:_LISTED])) + ", ..." * (len(sets) > _LISTED)
                raise InputError(f"'{path}' has no layer '{name}'; it has {listed}.")
        return wanted
    # Other stereo views are pictures of their own, and a composite has no depth.
    if "" in sets:
        return ("",)
    usual = {n: channels for n, channels in sets.items() if not channels["combined", 0].parsed.other_view}
    with_depth = tuple(name for name, channels in usual.items() if ("depth", 0) in channels)
    return with_depth or tuple(usual or sets)[:1]


def _layers_behind(
    raw: RawFile,
    path: Path,
    names: Sequence[str],
    sets: Mapping[str, Mapping[tuple[str, int], Channel]],
    data_window: Window,
) -> dict[str, list[str]]:
    """Return, for each layer, the names of those that show it without what is nearest, nearest first.

    Raises
    ------
    InputError
        If one is missing, is not whole, or has other pixels.
    """
    found: dict[str, list[str]] = {name: [] for name in names}
    numbers: dict[str, set[int]] = {name: set() for name in names}
    for other in {channel.parsed.layer for channel in raw.channels}:
        match = _BEHIND.fullmatch(other)
        if match and match[1] in numbers:
            numbers[match[1]].add(int(match[2]))
    for name in names:
        for number in range(1, max(numbers[name], default=0) + 1):
            other = f"{name}{behind(number)}"
            channels = sets.get(other, {})
            if ("depth", 0) not in channels:
                lacks = "lacks colour or depth" if number in numbers[name] else "is missing"
                raise InputError(f"Layer {other!r} of '{path}' {lacks}; render the samples again.")
            if {channel.window for channel in channels.values()} != {data_window}:
                raise InputError(
                    f"Layer {other!r} of '{path}' has another data window than {name!r}; write them with one."
                )
            found[name].append(other)
    return found


def _with_companions(
    name: str,
    sets: Mapping[str, Mapping[tuple[str, int], Channel]],
    data_window: Window,
    repaired: dict[str, int],
) -> SampleLayer:
    """Return a layer with those of its other views, and of what its mirrors and glass show."""
    layer = _with_seen(name, sets, data_window, repaired)
    if not all(_is_whole(sets, f"{name}{suffix}", data_window) for suffix in (STATIONARY, MOVING)):
        return layer
    stationary, moving = (
        _with_seen(f"{name}{suffix}", sets, data_window, repaired) for suffix in (STATIONARY, MOVING)
    )
    absent = None
    if _is_whole(sets, f"{name}{ABSENT}", data_window):
        absent = _with_seen(f"{name}{ABSENT}", sets, data_window, repaired)
    return replace(layer, stationary=stationary, moving=moving, absent=absent)


def _is_whole(sets: Mapping[str, Mapping[tuple[str, int], Channel]], name: str, data_window: Window) -> bool:
    """Return whether there is a layer of a name, with a file's own pixels."""
    return name in sets and {channel.window for channel in sets[name].values()} == {data_window}


def _with_seen(
    name: str,
    sets: Mapping[str, Mapping[tuple[str, int], Channel]],
    data_window: Window,
    repaired: dict[str, int],
) -> SampleLayer:
    """Return a layer with what its mirrors and glass show."""
    reflected, transmitted = (
        _build_layer(f"{name}{suffix}", sets[f"{name}{suffix}"], repaired)
        if _is_whole(sets, f"{name}{suffix}", data_window)
        else None
        for suffix in (REFLECTED, TRANSMITTED)
    )
    layer = _build_layer(name, sets[name], repaired)
    return replace(layer, reflected=reflected, transmitted=transmitted)


def _build_layer(
    name: str, channels: Mapping[tuple[str, int], Channel], repaired: dict[str, int]
) -> SampleLayer:
    """Return a layer with float32 arrays and finite values."""
    red = channels["combined", 0].pixels
    color = np.ones((*red.shape, 4), dtype=np.float32)
    for component in range(4):
        if ("combined", component) in channels:
            color[..., component] = channels["combined", component].pixels
    _count(repaired, "color", repair(color, np.asarray(~np.isfinite(color).all(axis=2))))

    depth = None
    if ("depth", 0) in channels:
        values = channels["depth", 0].pixels
        depth = values.astype(np.float32)
        far = _HALF_MAX if values.dtype == np.float16 else _NO_SURFACE_DEPTH
        with np.errstate(invalid="ignore"):
            depth[(depth <= 0.0) | (depth >= far)] = np.inf
        _count(repaired, "depth", _repair_depth(depth))

    index, patch = (_integers(channels, which, repaired) for which in _INTEGERS)

    vector = None
    if all(("vector", component) in channels for component in (2, 3)):
        vector = np.zeros((*red.shape, 4), dtype=np.float32)
        # Other programs may know the way to the next frame alone.
        for component in range(4):
            channel = channels.get(("vector", component))
            if channel is not None:
                # Blender's vector to the next frame points backwards, a forward vector forwards.
                forward = channel.full_name.rpartition(".")[2] in FORWARD
                vector[..., component] = -channel.pixels if forward else channel.pixels
        _count(repaired, "vector", repair(vector, np.asarray(~np.isfinite(vector).all(axis=2))))
    astigmatism = None
    if all(("astigmatism", component) in channels for component in (0, 1)):
        planes = [channels["astigmatism", component].pixels for component in (0, 1)]
        astigmatism = np.nan_to_num(np.stack(planes, axis=-1).astype(np.float32), posinf=0.0, neginf=0.0)
    matte = _cryptomatte(channels)
    return SampleLayer(
        name, color, depth, index, vector, cryptomatte=matte, patch=patch, astigmatism=astigmatism
    )


def _integers(
    channels: Mapping[tuple[str, int], Channel], which: PassName, repaired: dict[str, int]
) -> npt.NDArray[np.int32] | None:
    """Return a pass of whole numbers, None where a layer lacks it."""
    if (which, 0) not in channels:
        return None
    values = channels[which, 0].pixels.astype(np.float64)
    broken = ~(np.abs(values) <= _LARGEST_INDEX)
    _count(repaired, which, int(broken.sum()))
    return np.asarray(np.rint(np.where(broken, 0.0, values)), dtype=np.int32)


def _cryptomatte(channels: Mapping[tuple[str, int], Channel]) -> Cryptomatte | None:
    """Return the ids and coverages of the best Cryptomatte that a layer has, or None.

    An id is the bits of a float, which as a number may be NaN or too small to be normal: it is never
    calculated with. Half floats cannot hold one.
    """
    for name in CRYPTOMATTES:
        ids, coverages = [], []
        for rank in range(2 * MAX_LEVELS):
            pair = channels.get((name, 2 * rank)), channels.get((name, 2 * rank + 1))
            if pair[0] is None or pair[1] is None or pair[0].pixels.dtype != np.float32:
                break
            bits = np.ascontiguousarray(pair[0].pixels).view(np.uint32)
            share = np.nan_to_num(pair[1].pixels.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
            share = np.where(bits == 0, np.float32(0.0), np.clip(share, 0.0, 1.0))
            ids.append(np.where(share > 0.0, bits, np.uint32(0)))
            coverages.append(share)
        # Ranks that no pixel uses would only take memory.
        while ids and not ids[-1].any():
            ids.pop()
        if ids:
            return Cryptomatte(np.stack(ids), np.stack(coverages[: len(ids)]))
    return None


def _repair_depth(depth: Float32Array) -> int:
    """Replace NaN depths from their neighbours; the mean is of inverse depths, so infinity counts."""
    broken = np.isnan(depth)
    if not broken.any():
        return 0
    with np.errstate(all="ignore"):
        inverse = np.divide(1.0, depth, dtype=np.float32)
    count = repair(inverse, broken)
    with np.errstate(divide="ignore"):
        depth[broken] = 1.0 / inverse[broken]
    return count


def _count(repaired: dict[str, int], what: str, number: int) -> None:
    if number:
        repaired[what] = repaired.get(what, 0) + number


def _lens_attributes(header: Mapping[str, Any]) -> LensAttributes:
    focal_length_mm = _number(header, "nominalFocalLength")
    blades = _number(header, "potmesil:apertureBlades")
    rotation = _number(header, "potmesil:apertureRotation")
    focus = _number(header, "focus", infinite=True)
    return LensAttributes(
        focal_length=None if focal_length_mm is None else focal_length_mm / 1000.0,
        f_stop=_number(header, "aperture"),
        focus_distance=focus,
        blades=None if blades is None else int(blades),
        blade_rotation=None if rotation is None else math.radians(rotation),
        anamorphic_ratio=_number(header, "potmesil:apertureRatio"),
    )


def _shutter(header: Mapping[str, Any]) -> ShutterAttributes:
    """Return the exposure; what is damaged counts as not said."""
    attributes = ShutterAttributes()
    text = header.get("potmesil:shutter")
    if isinstance(text, str):
        # A SettingsError is a ValueError too.
        with contextlib.suppress(ValueError, OverflowError):
            attributes = attributes_from_json(schemas.parse(text, schemas.SHUTTER))
    return replace(
        attributes,
        exposure_time=_number(header, "expTime"),
        frames_per_second=_number(header, "framesPerSecond"),
    )


def _lamps(header: Mapping[str, Any]) -> tuple[Lamp, ...]:
    """Return the lamps that a file names."""
    text = header.get("potmesil:lamps")
    return lamps_from_json(text) if isinstance(text, str) else ()


def _paths(header: Mapping[str, Any]) -> MotionPaths | None:
    text = header.get("potmesil:motion")
    return MotionPaths.from_json(text) if isinstance(text, str) else None


def _film(header: Mapping[str, Any], display: Window) -> Film | None:
    size = _array(header, "sensorOverallDimensions", (2,))
    if size is None or not ((size >= _LEAST) & (size <= _MOST)).all():
        return None
    width, height = (float(x) / 1000.0 for x in size)
    try:
        return Film(width, height, display.columns, display.rows)
    except SettingsError:
        return None


def _camera(header: Mapping[str, Any], film: Film | None) -> Camera | None:
    """Return the camera of the standard attributes, or None where they do not make one."""
    to_camera = _array(header, "worldToCamera", (4, 4))
    to_ndc = _array(header, "worldToNDC", (4, 4))
    if film is None or to_camera is None or to_ndc is None:
        return None
    try:
        world_to_camera = without_scale(np.diag([1.0, 1.0, -1.0, 1.0]) @ to_camera.T)
        # In camera coordinates the projection is its own x and y scale and where the axis meets it.
        projection = to_ndc.T @ np.linalg.inv(world_to_camera)
    except (SettingsError, np.linalg.LinAlgError):
        return None
    depth = -projection[3, 2]
    if not depth > 0.0:
        return None
    return Camera(
        world_to_camera=world_to_camera,
        focal_length=float(projection[0, 0] / depth) * film.width,
        film=film,
        axis_x=float(-projection[0, 2] / depth) * film.columns,
        axis_y=float(-projection[1, 2] / depth) * film.rows,
    )


def _number(header: Mapping[str, Any], name: str, *, infinite: bool = False) -> float | None:
    """Return an attribute as a finite number that is plausible for it, or None."""
    value = header.get(name)
    if not isinstance(value, int | float | Fraction) or isinstance(value, bool):
        return None
    number = float(value)
    if math.isnan(number) or (math.isinf(number) and not infinite):
        return None
    least, most = _PLAUSIBLE.get(name, (_LEAST, _MOST))
    return number if least <= number <= most or (math.isinf(number) and number > 0.0) else None


def _for_row_vectors(matrix: FloatArray) -> Float32Array:
    """Return a matrix as OpenEXR has it, applied to row vectors from the right.

    The OpenEXR module reads an array's memory and not its strides, so a transposed view will not do.
    """
    return np.ascontiguousarray(matrix.T, dtype=np.float32)


def _array(header: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> FloatArray | None:
    value = header.get(name)
    if not isinstance(value, np.ndarray) or value.shape != shape or not np.isfinite(value).all():
        return None
    return value.astype(np.float64)


def _window(box: tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]) -> Window:
    (x0, y0), (x1, y1) = box
    return Window(int(x0), int(y0), int(x1) + 1, int(y1) + 1)


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    text = lines[0].split(" when attempting to open")[0].split(" '")[0] if lines else type(error).__name__
    # It may quote the file.
    return "".join(character if character.isprintable() else "?" for character in text[:200])


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep the library's own messages off the terminal and out of pipes; what is wrong it also raises."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # none, broken or closed
            stream.flush()
    saved = {}
    for descriptor in (1, 2):
        # A windowed program has none, as under pythonw.
        with contextlib.suppress(OSError):
            saved[descriptor] = os.dup(descriptor)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in saved:
            os.dup2(null, descriptor)
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        # The decoder of HTJ2K prints through C's own buffer.
        _flush_c()
        for descriptor, copy in saved.items():
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)


def _flush_c() -> None:
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush(None)
