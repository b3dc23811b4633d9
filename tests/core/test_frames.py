"""Frame ranges and the paths of frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from potmesil_addon.errors import SettingsError
from potmesil_addon.frames import MAX_FRAMES, existing_frames, frame_path, parse_frames


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("5", (5,)),
        ("-3", (-3,)),
        ("1-4", (1, 2, 3, 4)),
        ("1..4", (1, 2, 3, 4)),
        ("7-7", (7,)),
        ("1-10:3", (1, 4, 7, 10)),
        ("1-10x4", (1, 5, 9)),
        ("1..5x2", (1, 3, 5)),
        ("-3--1", (-3, -2, -1)),
        ("-1-1", (-1, 0, 1)),
        ("-2..1", (-2, -1, 0, 1)),
        ("1,3,7-9", (1, 3, 7, 8, 9)),
        ("9,1-3, 2", (1, 2, 3, 9)),
        (" 4 ", (4,)),
        ("0001-0003", (1, 2, 3)),
        (str(MAX_FRAMES), (MAX_FRAMES,)),
    ],
)
def test_range(text: str, frames: tuple[int, ...]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize(
    "text",
    ["", ",", "1,", "a", "1-", "-", "1.5", "1-2-3", "1..", "1:2", "1-5:", "1-5:x", "1 2", "#", "1-5:-1"],
)
def test_no_range_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="frame range"):
        parse_frames(text)


@pytest.mark.parametrize("text", ["5-1", "1-5:0", "1--5"])
def test_range_that_does_not_run_forwards_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="forwards"):
        parse_frames(text)


@pytest.mark.parametrize("text", [str(MAX_FRAMES + 1), "1-99999999999", f"-{MAX_FRAMES + 1}"])
def test_frame_beyond_blenders_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="beyond"):
        parse_frames(text)


@pytest.mark.parametrize(
    ("template", "frame", "expected"),
    [
        ("out/####.exr", 7, "out/0007.exr"),
        ("out/shot_##_####.exr", 12, "out/shot_##_0012.exr"),
        ("out/#.exr", 123, "out/123.exr"),
        ("out/##.exr", -5, "out/-05.exr"),
        ("out/######.png", 42, "out/000042.png"),
        ("dir_##/out.exr", 7, "dir_##/out.exr"),
        ("out.exr", 7, "out.exr"),
        ("a####b.exr", 3, "a0003b.exr"),
    ],
)
def test_hashes_become_the_frame(template: str, frame: int, expected: str) -> None:
    assert frame_path(Path(template), frame) == Path(expected)


@pytest.mark.parametrize(
    ("template", "frame", "expected"),
    [
        ("out.exr", 7, "out0007.exr"),
        ("out.v2.exr", 12345, "out.v212345.exr"),
        ("out", -1, "out-0001"),
        ("o##.exr", 7, "o07.exr"),
    ],
)
def test_several_frames_get_a_number_each(template: str, frame: int, expected: str) -> None:
    assert frame_path(Path(template), frame, several=True) == Path(expected)


def test_frames_of_a_range_get_different_paths() -> None:
    paths = {frame_path(Path("x/out.exr"), frame, several=True) for frame in parse_frames("-2-12")}
    assert len(paths) == 15


def test_existing_frames_are_those_on_the_disk(tmp_path: Path) -> None:
    for name in (
        "a.0001.exr",
        "a.0010.exr",
        "a.12345.exr",
        "a.-0003.exr",
        "a.7.exr",
        "b.0002.exr",
        "a.0004.png",
    ):
        (tmp_path / name).touch()
    # a.7.exr has other zeros than the template.
    assert existing_frames(tmp_path / "a.####.exr") == (-3, 1, 10, 12345)
    assert existing_frames(tmp_path / "nowhere" / "a.####.exr") == ()
