"""Pictures that the artist gives are read as light, or refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from potmesil_addon.errors import InputError
from potmesil_addon.exr import write_picture
from potmesil_addon.images import MOST_SIDE, look_again, on_change, read_image
from potmesil_addon.png import write_png


def picture(rows: int = 3, columns: int = 5) -> np.ndarray:
    values = np.random.default_rng(0).random((rows, columns, 4)).astype(np.float32)
    values[..., 3] = 1.0
    return values


def test_an_exr_comes_back_as_it_is(tmp_path: Path) -> None:
    path, values = tmp_path / "a.exr", picture()
    write_picture(path, values, {})
    assert np.array_equal(read_image(path), values[..., :3])


def test_a_png_comes_back_as_light(tmp_path: Path) -> None:
    path, values = tmp_path / "a.png", picture()
    values[..., 3] = 0.5
    values[..., :3] *= 0.5
    write_png(path, values)
    # 8 bits of an sRGB value, times alpha's.
    assert read_image(path) == pytest.approx(values[..., :3], abs=0.005)


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    for name, content, match in (
        ("a.gif", b"", "must end in"),
        ("a.png", b"no picture", "cannot be read"),
        ("a.exr", b"no picture", "cannot be read"),
    ):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError, match=match) as caught:
            read_image(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="no picture"):
        read_image(tmp_path / "missing.png")


def test_a_huge_picture_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wide.exr"
    write_picture(path, picture(1, MOST_SIDE + 1), {})
    with pytest.raises(InputError, match="at most"):
        read_image(path)


def test_a_changed_picture_is_noticed(tmp_path: Path) -> None:
    path, times = tmp_path / "a.exr", []
    on_change(lambda: times.append(1))
    write_picture(path, picture(), {})
    for _ in range(2):
        look_again(["", str(path), str(tmp_path / "missing.exr")])
    assert not times
    write_picture(path, picture(4, 6), {})
    look_again([str(path)])
    look_again([str(path)])
    assert len(times) == 1
