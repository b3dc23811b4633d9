"""Headers that claim too much or are damaged end in one sentence, before they cost memory or time."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from potmesil_addon import exr
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.exr_claims import (
    ReadLimits,
    check_claims,
    parse_read_limits,
    read_limits,
    set_read_limits,
)

from .helpers import crafted_exr, importable, plain_channels, write_exr

MAGIC = b"\x76\x2f\x31\x01"
MULTI_PART = 0x1000


def attribute(name: str, kind: str, value: bytes) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def part(
    columns: int = 8,
    rows: int = 8,
    channels: int = 3,
    compression: int = 3,
    name: str = "",
    extra: bytes = b"",
) -> bytes:
    """Return one part's header."""
    chlist = b"".join(
        f"c{n:05d}".encode() + b"\0" + struct.pack("<iIii", 2, 0, 1, 1) for n in range(channels)
    )
    window = struct.pack("<4i", 0, 0, columns - 1, rows - 1)
    return (
        attribute("channels", "chlist", chlist + b"\0")
        + attribute("compression", "compression", bytes([compression]))
        + attribute("dataWindow", "box2i", window)
        + attribute("displayWindow", "box2i", window)
        + attribute("lineOrder", "lineOrder", b"\0")
        + attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
        + attribute("screenWindowCenter", "v2f", bytes(8))
        + attribute("screenWindowWidth", "float", struct.pack("<f", 1.0))
        + (attribute("name", "string", name.encode()) + attribute("type", "string", b"scanlineimage"))
        * bool(name)
        + extra
        + b"\0"
    )


def header(*parts: bytes, flags: int = 0) -> bytes:
    return MAGIC + struct.pack("<I", 2 | flags) + b"".join(parts) + b"\0" * bool(flags & MULTI_PART)


def tiles_of(side: int) -> OpenEXR.TileDescription:
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = side
    return tiles


def saying(path: Path, data: bytes, grown_to: int = 0) -> str:
    """Return the sentence with which bytes are refused, as a file that is made longer by a hole."""
    path.write_bytes(data)
    if grown_to:
        with path.open("r+b") as file:
            file.truncate(grown_to)
    with pytest.raises(InputError) as caught:
        exr.read_samples(path)
    text = str(caught.value)
    assert text.isprintable()
    assert str(path) in text
    return text


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    before = read_limits()
    yield tmp_path / "a.exr"
    set_read_limits(before)


def test_claims_over_the_limits_name_the_limit(place: Path) -> None:
    many = header(*(part(name=f"p{n}") for n in range(1000)), flags=MULTI_PART)
    assert "513 parts" in saying(place, many, 1 << 30)
    assert "'channels'" in saying(place, header(part(channels=5000)), 1 << 30)
    # 16384 x 16384 x 1000 floats are 2^40 / 1.024 bytes.
    assert f"{16384 * 16384 * 4000} bytes" in saying(place, header(part(16384, 16384, 1000)), 1 << 40)
    assert "20000 x 20000" in saying(place, header(part(20_000, 20_000)), 1 << 30)
    long = attribute("potmesil:motion", "string", b"[" * (33 << 20))
    assert "'text'" in saying(place, header(part(extra=long)))
    notes = b"".join(attribute(f"note{n}", "string", bytes(20 << 20)) for n in range(5))
    assert "'header'" in saying(place, header(part(extra=notes)))
    small = b"".join(attribute(f"note{n}", "int", bytes(4)) for n in range(1100))
    assert "'attributes'" in saying(place, header(part(extra=small)))


def test_claims_that_the_file_is_too_short_for(place: Path) -> None:
    assert "too short" in saying(place, header(part(4096, 4096)), 1 << 16)
    assert "too short" in saying(place, header(part(1, 1 << 20, compression=2)), 1 << 20)
    # An uncompressed file is as long as its pixels.
    assert "too short" in saying(place, header(part(4096, 4096, compression=0)), 100 << 20)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (header(part(extra=attribute("chunkCount", "int", struct.pack("<i", 1 << 30)))), "chunks"),
        (header(part(extra=attribute("dataWindow", "box2i", bytes(16)))), "twice"),
        (header(part(extra=b"x" * 300)), "no end"),
        (header(part(extra=b"views\0stringvector\0" + struct.pack("<i", 1 << 17) + bytes(1 << 17))), "names"),
        (header(part(extra=b"x\0int\0" + struct.pack("<i", -4))), "longer"),
        (header(part(extra=b"x\0int\0" + struct.pack("<i", 1 << 24))), "longer"),
        (
            header(
                part(extra=attribute("tiles", "tiledesc", struct.pack("<IIB", 32, 1 << 24, 0))), flags=0x200
            ),
            "tiles",
        ),
        (header(part(extra=attribute("tiles", "tiledesc", bytes(9))), flags=0x200), "tiles"),
        (header(part(channels=0)), "channels"),
        # Found by fuzzing: the name of a subsampled channel is looked at.
        (crafted_exr([("R", 2, 2)]).replace(b"R\0\2", b"\xda\0\2", 1), "channels are damaged"),
        (header(part()).replace(b"\x03" + b"dataWindow", b"\x03" + b"dataWindoe"), "dataWindow is missing"),
        (MAGIC + struct.pack("<I", 3) + part(), "version"),
        (b"II*\0" + part(), "begin"),
    ],
)
def test_damaged_headers_say_what_is_wrong(place: Path, data: bytes, match: str) -> None:
    assert match in saying(place, data + bytes(1 << 12))


def test_every_cut_within_a_header_is_refused(place: Path) -> None:
    data = header(part(name="a"), part(name="b"), flags=MULTI_PART)
    for length in range(len(data)):
        saying(place, data[:length])


MEMORY = """
import sys
from pathlib import Path
from potmesil_addon import exr, memory
from potmesil_addon.errors import InputError
before = memory.peak()
for name in sys.argv[1:]:
    try:
        exr.read_samples(Path(name))
    except InputError:
        continue
    raise AssertionError(name)
print((memory.peak() - before) >> 20)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems tell no peak")
def test_refusing_takes_no_memory(tmp_path: Path) -> None:
    notes = b"".join(attribute(f"note{n}", "string", b"") for n in range(1000))
    bombs = {
        "parts": (header(*(part(name=f"p{n}", extra=notes) for n in range(600)), flags=MULTI_PART), 1 << 30),
        "channels": (header(part(16384, 16384, 1000)), 1 << 40),
        "tile": (
            header(
                part(extra=attribute("tiles", "tiledesc", struct.pack("<IIB", 32, 1 << 24, 0))), flags=0x200
            ),
            1 << 12,
        ),
        "wide": (header(part(1_507_341, 20, 5, compression=9)), 4703),
        "text": (header(part(extra=b"x\0string\0" + struct.pack("<i", 100 << 20))), 200 << 20),
    }
    for name, (data, size) in bombs.items():
        (tmp_path / name).write_bytes(data)
        with (tmp_path / name).open("r+b") as file:
            file.truncate(max(size, len(data)))
    names = [str(tmp_path / name) for name in bombs]
    done = subprocess.run(
        [sys.executable, "-c", MEMORY, *names],
        check=False,
        env=importable(),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 100


def test_limits_hold_for_the_process_and_can_be_raised(place: Path) -> None:
    write_exr(place, plain_channels(8, 8))
    before = set_read_limits(replace(ReadLimits(), pixels=63))
    assert before == ReadLimits()
    with pytest.raises(InputError, match="at most 63 are read, unless the read limit 'pixels' is raised"):
        exr.read_samples(place)
    assert set_read_limits(parse_read_limits("pixels=64")).pixels == 63
    assert exr.read_samples(place).layers[0].color.shape == (8, 8, 4)
    check_claims(place, replace(ReadLimits(), channels=5))
    with pytest.raises(InputError, match="5 channels; at most 4"):
        check_claims(place, replace(ReadLimits(), channels=4))


def test_limits_as_text() -> None:
    assert parse_read_limits("pixels=1G, parts=2000") == replace(ReadLimits(), pixels=1 << 30, parts=2000)
    assert parse_read_limits("memory=1t").memory == 1 << 40
    for text in (
        "",
        "pixels",
        "pixels=0",
        "pixels=-1",
        "size=3",
        "pixels=1,",
        "pixels=1e9",
        "pixels=" + "9" * 30,
    ):
        with pytest.raises(SettingsError, match="no limit"):
            parse_read_limits(text)


METHODS = [getattr(OpenEXR, name) for name in dir(OpenEXR) if name.endswith("_COMPRESSION")]


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_what_compresses_best_is_believed(place: Path, method: OpenEXR.Compression) -> None:
    """A picture of zeros is as small as pixels get."""
    pixels = {name: np.zeros((1200, 1100), dtype=np.float32) for name in "RGBZ"}
    write_exr(place, pixels, compression=method)
    assert exr.read_samples(place).layers[0].color.shape == (1200, 1100, 4)


def test_tiles_larger_than_the_picture_are_believed(place: Path) -> None:
    write_exr(
        place,
        plain_channels(5, 6),
        type=OpenEXR.tiledimage,
        tiles=tiles_of(512),
    )
    assert exr.read_samples(place).layers[0].color.shape == (5, 6, 4)


LOSSLESS = [
    OpenEXR.NO_COMPRESSION,
    OpenEXR.ZIPS_COMPRESSION,
    OpenEXR.ZIP_COMPRESSION,
    OpenEXR.PIZ_COMPRESSION,
]


@settings(max_examples=40)
@given(
    rows=st.integers(1, 40),
    columns=st.integers(1, 40),
    corner=st.tuples(st.integers(-1000, 1000), st.integers(-1000, 1000)),
    method=st.sampled_from(LOSSLESS),
    tiles=st.none() | st.integers(1, 48),
    half=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_random_samples_survive_the_file(
    tmp_path_factory: pytest.TempPathFactory,
    rows: int,
    columns: int,
    corner: tuple[int, int],
    method: OpenEXR.Compression,
    tiles: int | None,
    half: bool,
    seed: int,
) -> None:
    path = tmp_path_factory.mktemp("random") / "a.exr"
    channels = plain_channels(rows, columns, seed)
    if half:
        channels = {name: values.astype(np.float16) for name, values in channels.items()}
    x, y = corner
    window = (np.array([x, y], dtype=np.int32), np.array([x + columns - 1, y + rows - 1], dtype=np.int32))
    layout = {"type": OpenEXR.tiledimage, "tiles": tiles_of(tiles)} if tiles else {}
    write_exr(path, channels, compression=method, dataWindow=window, displayWindow=window, **layout)
    samples = exr.read_samples(path)
    assert (samples.data_window.x0, samples.data_window.y0) == corner
    (layer,) = samples.layers
    assert layer.depth is not None
    assert np.array_equal(layer.depth, channels["Z"].astype(np.float32))
    for n, name in enumerate("RGBA"):
        assert np.array_equal(layer.color[..., n], channels[name].astype(np.float32))


@given(
    at=st.floats(0.0, 1.0, exclude_max=True),
    value=st.sampled_from([0, 1, -1, 255, 65536, 2**31 - 1, -(2**31), 2**24])
    | st.integers(-(2**31), 2**31 - 1),
)
def test_any_wrong_word_of_a_header_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, at: float, value: int
) -> None:
    path = tmp_path_factory.mktemp("word") / "a.exr"
    data = bytearray(crafted_exr([(name, 1, 1) for name in "BGR"]))
    place = int(at * 340)
    data[place : place + 4] = struct.pack("<i", value)
    path.write_bytes(data)
    said = ""
    try:
        exr.read_samples(path)
    except InputError as error:
        said = str(error)
    assert not said or said.isprintable()


MUTATIONS = """
import random, resource, sys, warnings
from pathlib import Path
import numpy as np
import OpenEXR
from potmesil_addon import exr
from potmesil_addon.errors import InputError
warnings.simplefilter("error")
folder = Path(sys.argv[1])
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (3 << 29),) * 2)
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
files = [path.read_bytes() for path in sorted(folder.glob("*.exr"))]
words = [0, 1, -1, 127, 128, 255, 256, 65535, 2**31 - 1, -(2**31), 2**24]
read = refused = 0
for seed in range(int(sys.argv[2])):
    chance = random.Random(seed)
    data = bytearray(chance.choice(files))
    for _ in range(chance.choice((1, 1, 2, 3, 6))):
        # Headers are short beside pixels, and most of what can go wrong is in them.
        at = chance.randrange(min(len(data), chance.choice((500, 1 << 20))))
        kind = chance.randrange(6)
        if kind == 0:
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            data[at : at + 4] = (chance.choice(words) & 0xFFFFFFFF).to_bytes(4, "little")
        elif kind == 2:
            del data[at : at + chance.randrange(1, 20)]
        elif kind == 3:
            data[at:at] = data[chance.randrange(len(data)) :][: chance.randrange(1, 60)]
        elif kind == 4:
            other = chance.choice(files)
            start = chance.randrange(len(other))
            data[at : at + 40] = other[start : start + 40]
        else:
            del data[max(at, 8) :]
    path = folder / "mutated"
    path.write_bytes(data)
    print(seed, end="\\r", file=sys.stderr, flush=True)
    try:
        exr.read_samples(path)
        read += 1
    except InputError as error:
        assert str(error).isprintable(), error
        refused += 1
print(read, refused)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is looked up in /proc")
def test_mutations_of_good_files_are_read_or_refused(tmp_path: Path) -> None:
    """In a process with 1.5 GB and warnings as errors: the library itself could crash."""
    for n, method in enumerate(METHODS):
        layout = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if n % 2 else {}
        write_exr(tmp_path / f"{n}.exr", plain_channels(20, 13), compression=method, **layout)
    done = subprocess.run(
        [sys.executable, "-c", MUTATIONS, str(tmp_path), "1500"],
        check=False,
        env=importable(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    read, refused = map(int, done.stdout.split())
    assert read > 100
    assert refused > 500
