"""Blocks of samples: what they keep, what stays single, and how little the picture changes."""

from __future__ import annotations

import numpy as np
import pytest

from potmesil_addon import jit
from potmesil_addon.aperture import SAMPLE_POSITIONS, widened
from potmesil_addon.blocks import put_in_blocks
from potmesil_addon.camera import Film
from potmesil_addon.focus import FocusSettings
from potmesil_addon.lens import Lens
from potmesil_addon.psf import PsfBuilder, PsfSettings, TableAssignment

from .helpers import focused, make_samples, square_film

PITCH = 1e-4
LENS = Lens(focal_length=0.05, f_stop=1.4, focus_distance=2.0)
HEXAGON = Lens(focal_length=0.05, f_stop=1.4, focus_distance=2.0, blades=6, blade_rotation=0.3)

needs_numba = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")
backends = pytest.mark.parametrize("compiled", [pytest.param(True, marks=needs_numba), False])


def builder(**settings):
    return PsfBuilder(LENS, Film(64 * PITCH, 48 * PITCH, 64, 48), settings=PsfSettings(**settings))


def put(color, circle, *, compiled, weight=None, table=None, of=None, **options):
    """Put samples whose tables have these circles (in pixels) into blocks; return all that is left."""
    color = np.array(color, dtype=np.float32)
    weight = np.ones(color.shape[:-1], np.float32) if weight is None else weight.copy()
    table = np.zeros(weight.shape, np.int32) if table is None else table
    assignment = TableAssignment(np.asarray(circle, dtype=np.float64) * PITCH, table, None)
    new, side = put_in_blocks(color, weight, assignment, of or builder(), compiled=compiled, **options)
    return color, weight, new, side


def sides(weight, new, side):
    """Return how many live samples there are of each side."""
    found, count = np.unique(side[new.table[weight > 0.0]], return_counts=True)
    return dict(zip(found.tolist(), count.tolist(), strict=True))


@backends
@pytest.mark.parametrize(
    ("circle", "largest"), [(15.9, 1), (16.0, 2), (31.9, 2), (33.0, 4), (-70.0, 8), (130.0, 16), (900.0, 16)]
)
def test_blocks_grow_with_circles(circle, largest, compiled):
    color, weight, new, side = put(np.ones((1, 32, 48, 4)), [circle], compiled=compiled)
    assert sides(weight, new, side) == {largest: 32 * 48 // largest**2}
    assert np.abs(new.circles / PITCH / circle - 1.0).max() < 0.5 / 128.0 + 1e-6
    assert weight.sum() == 32 * 48
    np.testing.assert_array_equal(color, 1.0)


@backends
def test_light_weight_and_marks_are_kept(compiled):
    rng = np.random.default_rng(1)
    color = 1.0 + 0.05 * rng.random((2, 37, 51, 4))
    marks = tuple(rng.random((2, 2, 37, 51)).astype(np.float32))
    light, marked = color.sum(axis=(0, 1, 2)), [mark.sum(dtype=np.float64) for mark in marks]
    color, weight, new, side = put(color, [60.0], marks=marks, compiled=compiled)
    assert max(sides(weight, new, side)) == 4
    # What is beside the last whole block stays in smaller ones.
    assert min(sides(weight, new, side)) == 1
    left = weight[..., np.newaxis].astype(np.float64)
    np.testing.assert_allclose((color * left).sum(axis=(0, 1, 2)), light, rtol=1e-6)
    np.testing.assert_allclose([(mark * left[..., 0]).sum() for mark in marks], marked, rtol=1e-6)


@backends
@pytest.mark.parametrize("odd", ["color", "light", "alpha", "circle", "sign", "weight", "nothing"])
def test_one_odd_sample_keeps_its_neighbours_single(odd, compiled):
    color, weight, table = (
        np.ones((1, 4, 4, 4)),
        np.ones((1, 4, 4), np.float32),
        np.zeros((1, 4, 4), np.int32),
    )
    circles = [20.0, 24.0, -20.0]
    options = {}
    if odd == "color":
        color[0, 1, 0, 2] = 3.0
    elif odd == "light":
        color[0, 1, 0, :3] = 1.1
        options["brightest"] = 1.01
    elif odd == "alpha":
        color[0, 0, 0, 3] = 0.85
        options["least_alpha"] = 0.9
    elif odd == "weight":
        weight[0, 1, 1] = 0.1
    elif odd == "nothing":
        weight[0, 1, 1] = 0.0
    else:
        table[0, 1, 0] = 1 if odd == "circle" else 2
    _, weight, new, side = put(color, circles, weight=weight, table=table, compiled=compiled, **options)
    assert sides(weight, new, side) == {1: 3 if odd == "nothing" else 4, 2: 3}


@backends
@pytest.mark.parametrize("of", [{"lookup": "interpolated"}, {"tables": "equal-z"}, {"blocks": False}])
def test_the_papers_tables_have_none(of, compiled):
    _, weight, _, side = put(np.ones((1, 8, 8, 4)), [100.0], of=builder(**of), compiled=compiled)
    assert (weight == 1.0).all()
    assert side.tolist() == [1]


@needs_numba
@pytest.mark.parametrize("seed", range(4))
def test_both_implementations_agree(seed):
    rng = np.random.default_rng(seed)
    circles = np.concatenate([-np.geomspace(300, 8, 30), np.geomspace(8, 400, 40)])
    table = np.sort(rng.integers(0, 70, (2, 67, 83)), axis=2).astype(np.int32)
    table[1] = int(np.searchsorted(circles, 150.0))
    color = 1.0 + 0.1 * rng.random((2, 67, 83, 4)) * rng.integers(0, 3, (2, 67, 83, 1))
    weight = np.where(rng.random((2, 67, 83)) < 0.01, 0.0, 1.0).astype(np.float32)
    found = []
    for compiled in (True, False):
        marks = color[..., 0].astype(np.float32), color[..., 1].astype(np.float32)
        result = put(
            color, circles, weight=weight, table=table, marks=marks, brightest=1.1, compiled=compiled
        )
        found.append((result[0], result[1], result[2].table, result[2].circles, result[3], *marks))
    assert found[0][4].max() >= 8
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("side", [1, 2, 4, 8])
@pytest.mark.parametrize("position", SAMPLE_POSITIONS)
@pytest.mark.parametrize("kind", ["disc", "polygon", "lommel"])
def test_widened_table_is_the_mean_of_the_blocks_tables(kind, position, side):
    lens = HEXAGON if kind == "polygon" else LENS
    settings = PsfSettings(kind="lommel" if kind == "lommel" else "disc")
    made = PsfBuilder(lens, Film(64e-4, 48e-4, 64, 48), settings=settings, position=position)
    (table,) = made.tables(np.array([17.3 * PITCH]))
    wide = widened(table, side)
    reach = 40
    one, all_ = canvas(table, reach), canvas(wide, reach)
    mean = np.zeros_like(one)
    for down in range(side):
        for right in range(side):
            mean += np.roll(one, (down, right), axis=(1, 2)) / side**2
    np.testing.assert_allclose(all_, mean, atol=1e-12)
    assert all_.sum(axis=(1, 2)) == pytest.approx(1.0)


def canvas(table, reach):
    """Return a table's pixel values around its sample: (primaries, 2 reach, 2 reach)."""
    values = np.zeros((table.delta.shape[1], 2 * reach, 2 * reach))
    for row, (begin, end) in enumerate(zip(table.row_begin, table.row_end, strict=True)):
        for at, delta in zip(table.offset[begin:end], table.delta[begin:end], strict=True):
            values[:, reach + table.first_row + row, reach + at] += delta
            if table.symmetric:
                values[:, reach + table.first_row + row, reach + table.mirror - at] -= delta
    return np.cumsum(values, axis=2)


@pytest.mark.parametrize("visibility", ["none", "aperture"])
@pytest.mark.parametrize("kind", ["disc", "polygon", "lommel"])
def test_picture_hardly_changes(kind, visibility):
    """A noisy slope from the focus to circles of 50 pixels, with lights: far below what else is uncertain."""
    rng = np.random.default_rng(11)
    rows, columns = 70, 110
    y, x = np.mgrid[:rows, :columns]
    texture = 0.5 + 0.3 * np.sin(0.31 * x + 0.17 * y) * np.cos(0.23 * y)
    color = np.ones((rows, columns, 4))
    color[..., :3] = (texture * (1.0 + 0.05 * rng.standard_normal((rows, columns))))[..., np.newaxis]
    color[rng.random((rows, columns)) < 0.002, :3] = 60.0
    depth = 2.0 + 0.02 * x + 0.01 * y
    samples = make_samples(color, depth)
    lens = HEXAGON if kind == "polygon" else LENS
    pictures = []
    for blocks in (True, False):
        psf = PsfSettings(kind="lommel" if kind == "lommel" else "disc", blocks=blocks)
        settings = FocusSettings(lens, square_film(samples, 1e-5), psf=psf, visibility=visibility)
        pictures.append(np.clip(focused(samples, settings)[..., :3].astype(np.float64), 0.0, 1.0))
    error = np.sqrt(((pictures[0] - pictures[1]) ** 2).mean())
    assert 0.0 < error < 10.0 ** (-55.0 / 20.0)
