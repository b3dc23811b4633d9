"""Filling in, un-mixing edges and tearing sheets, against pictures whose parts are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.samples import SampleLayer, Samples, Window
from potmesil_addon.sheets import (
    DEPTH_STEP,
    Sheet,
    covered_movers,
    cut_out_movers,
    fill_in,
    inverse_depth,
    join,
    on_display,
    rendered_movers,
)
from potmesil_addon.tracks import Tracks
from potmesil_addon.warp import NO_QUAD, NO_TRACK, QUAD, TORN_QUAD, VECTOR_TRACK

from .helpers import Picture

Labels = npt.NDArray[np.bool_]


def tracks_of(track: npt.NDArray[Any]) -> Tracks:
    nothing = np.zeros((*track.shape, 2), dtype=np.float32)
    return Tracks(track.astype(np.int32), nothing, nothing, (None,))


# Filling in


def filled_in(values: Picture, known: Labels, wanted: Labels) -> Picture:
    result = values.copy()
    fill_in(result, known, wanted)
    return result


shapes = pytest.mark.parametrize("shape", [(1, 1), (1, 7), (9, 1), (2, 3), (5, 8), (13, 21), (64, 64)])


@shapes
def test_filled_in_constant_is_constant(shape: tuple[int, int]) -> None:
    values = np.broadcast_to(np.float32([0.25, 7.0, 1e4]), (*shape, 3)).copy()
    rng = np.random.default_rng(0)
    for share in (0.02, 0.5, 0.98):
        known = rng.random(shape) < share
        known[-1, 0] = True
        broken = np.where(known[..., np.newaxis], values, np.float32(-5e6))
        np.testing.assert_allclose(filled_in(broken, known, ~known), values, rtol=1e-5)


@shapes
def test_where_nothing_is_known_the_fill_is_finite(shape: tuple[int, int]) -> None:
    values = np.full((*shape, 2), 3.0, dtype=np.float32)
    nothing = np.zeros(shape, dtype=bool)
    assert np.isfinite(filled_in(values, nothing, ~nothing)).all()
    assert filled_in(values, nothing, nothing).tobytes() == values.tobytes()


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 10**6))
def test_what_is_filled_in_lies_between_what_is_known(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(rows, columns, 1)).astype(np.float32)
    known = rng.random((rows, columns)) < 0.3
    known[rng.integers(rows), rng.integers(columns)] = True
    wanted = rng.random((rows, columns)) < 0.6
    filled = filled_in(values, known, wanted)
    assert filled[wanted].size == 0 or filled[wanted].min() >= values[known].min() - 1e-5
    assert filled[wanted].size == 0 or filled[wanted].max() <= values[known].max() + 1e-5
    assert filled[~wanted].tobytes() == values[~wanted].tobytes()
    # What is known stays, wanted or not.
    np.testing.assert_allclose(filled[known], values[known], atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("hole", [4, 12, 20])
def test_filled_in_ramp_rises_across_the_hole(hole: int, axis: int) -> None:
    """The nearest known value would be off by half of the hole's width at its middle line."""
    ramp = np.broadcast_to(np.arange(64, dtype=np.float32), (64, 64)).copy()
    known = np.ones((64, 64), dtype=bool)
    known[:, 30 - hole // 2 : 30 + hole // 2] = False
    if axis == 0:
        ramp, known = ramp.T.copy(), known.T.copy()
    filled = filled_in(ramp[..., np.newaxis], known, ~known)[..., 0]
    off = filled - ramp
    assert np.abs(off).max() < 0.5 * hole
    assert abs(off.mean()) < 0.05 * hole
    along = np.diff(filled, axis=1 - axis)
    # Float rounding may turn a level step.
    assert along.min() > -1e-3


def test_fill_takes_no_light_from_what_is_not_known() -> None:
    values = np.zeros((8, 8, 1), dtype=np.float32)
    values[3:5, 3:5] = np.nan
    known = np.isfinite(values[..., 0])
    known[0, 0] = False
    values[0, 0] = np.inf
    assert not filled_in(values, known, ~known).any()


# Depths


def test_inverse_depth_is_0_at_infinity_and_without_depth() -> None:
    color = np.zeros((1, 3, 4), dtype=np.float32)
    layer = SampleLayer("", color, np.float32([[2.0, np.inf, 0.5]]))
    assert inverse_depth(layer).tolist() == [[0.5, 0.0, 2.0]]
    assert inverse_depth(SampleLayer("", color)).tolist() == [[0.0, 0.0, 0.0]]


# Cutting out

FRONT = np.array([0.9, 0.2, 0.1, 1.0])
BEHIND = np.array([0.1, 0.3, 0.7, 1.0])


def half_plane(share: float, rows: int = 12, columns: int = 20, edge: int = 9) -> tuple[SampleLayer, Labels]:
    """Return an object left of an edge; the edge's own column is mixed."""
    alpha = np.where(np.arange(columns) < edge, 1.0, 0.0)
    alpha[edge] = share
    row = alpha[:, np.newaxis] * FRONT + (1.0 - alpha[:, np.newaxis]) * BEHIND
    label = np.broadcast_to(alpha >= 0.5, (rows, columns)).copy()
    color = np.broadcast_to(row, (rows, columns, 4)).astype(np.float32)
    return SampleLayer("", color, np.where(label, 3.0, 8.0).astype(np.float32)), label


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.49, 0.5, 0.75, 0.9, 1.0])
def test_antialiased_edge_is_unmixed(share: float) -> None:
    """C = a F + (1 - a) B of two colours: a is found, whichever surface the sample was said to be of."""
    layer, label = half_plane(share)
    movers, color, depth, guessed = cut_out_movers(layer, tracks_of(np.where(label, 1, 0)), label)
    np.testing.assert_allclose(movers.color[:, 9], np.broadcast_to(share * FRONT, (12, 4)), atol=1e-4)
    np.testing.assert_allclose(movers.color[:, :9], np.broadcast_to(FRONT, (12, 9, 4)), atol=1e-4)
    np.testing.assert_allclose(movers.color[:, 10:], 0.0, atol=1e-4)
    np.testing.assert_allclose(color, np.broadcast_to(BEHIND, color.shape), atol=1e-4)
    np.testing.assert_allclose(depth, 1.0 / 8.0, atol=1e-5)
    # The rim moves with the object, at its depth, and is all that does.
    assert (movers.tracks.track[:, :11] == 1).all()
    assert (movers.tracks.track[:, 13:] == NO_TRACK).all()
    np.testing.assert_allclose(movers.inverse_depth[:, :11], 1.0 / 3.0)
    assert (guessed[:, :9] == 1.0).all()
    assert (guessed[:, 12:] == 0.0).all()


def test_object_laid_back_over_its_background_is_the_picture() -> None:
    """Whatever was un-mixed: F over B is C again, with patterns too."""
    rng = np.random.default_rng(3)
    layer, label = half_plane(0.4)
    noisy = (layer.color * rng.uniform(0.5, 1.5, layer.color.shape)).astype(np.float32)
    noisy[..., 3] = 1.0
    movers, color, _, _ = cut_out_movers(
        SampleLayer("", noisy, layer.depth), tracks_of(np.where(label, 1, 0)), label
    )
    again = movers.color + (1.0 - movers.color[..., 3:]) * color
    # Where the object's part would be negative it is cut to black.
    excess = again - noisy
    assert excess.min() > -1e-5
    assert (excess < 1e-5).mean() > 0.9
    assert excess[:, :7].max() < 1e-5
    assert excess[:, 12:].max() < 1e-5


def test_nearer_surface_before_an_object_is_not_cut_out() -> None:
    """A post at 1 m across the object: it stays in the background, and the object goes on behind it."""
    color = np.broadcast_to(BEHIND, (20, 30, 4)).astype(np.float32)
    depth = np.full((20, 30), 8.0, dtype=np.float32)
    label = np.zeros((20, 30), dtype=bool)
    label[5:15, 5:25] = True
    color[label], depth[label] = FRONT, 3.0
    post = np.zeros_like(label)
    post[:, 13:16] = True
    color[post], depth[post], label[post] = [0.0, 1.0, 0.0, 1.0], 1.0, False
    movers, rest, inverse, _ = cut_out_movers(
        SampleLayer("", color, depth), tracks_of(np.where(label, 1, 0)), label
    )
    np.testing.assert_array_equal(rest[post], color[post])
    np.testing.assert_allclose(inverse[post], 1.0)
    np.testing.assert_allclose(rest[~post], np.broadcast_to(BEHIND, rest[~post].shape), atol=1e-4)
    behind = post & (np.arange(20)[:, np.newaxis] >= 7) & (np.arange(20)[:, np.newaxis] < 13)
    np.testing.assert_allclose(
        movers.color[behind], np.broadcast_to(FRONT, movers.color[behind].shape), atol=1e-4
    )
    assert (movers.guessed[behind] == 1.0).all()
    assert (movers.tracks.track[behind] == 1).all()


def test_picture_that_moves_as_a_whole_leaves_no_background_to_fill_from() -> None:
    layer, label = half_plane(0.5)
    everything = np.ones_like(label)
    movers, color, depth, _ = cut_out_movers(layer, tracks_of(np.ones(label.shape)), everything)
    for values in (movers.color, movers.inverse_depth, color, depth):
        assert np.isfinite(values).all()
    np.testing.assert_allclose(movers.color, layer.color, atol=1e-6)


def test_mover_at_the_border_and_a_mover_of_one_pixel() -> None:
    color = np.broadcast_to(BEHIND, (15, 15, 4)).astype(np.float32)
    label = np.zeros((15, 15), dtype=bool)
    label[0, 0] = label[7, 7] = True
    color[label] = FRONT
    layer = SampleLayer("", color, np.where(label, 3.0, 8.0).astype(np.float32))
    movers, rest, _, _ = cut_out_movers(layer, tracks_of(np.where(label, 1, 0)), label)
    np.testing.assert_allclose(rest, np.broadcast_to(BEHIND, rest.shape), atol=1e-4)
    np.testing.assert_allclose(movers.color.sum(axis=(0, 1)), 2.0 * FRONT, atol=1e-3)


# Movers rendered alone


def test_rendered_mover_has_a_transparent_rim_that_moves_with_it() -> None:
    color = np.zeros((9, 9, 4), dtype=np.float32)
    color[3:6, 3:6] = 0.5
    depth = np.full((9, 9), np.inf, dtype=np.float32)
    # A faint edge may have no depth of its own.
    depth[4:6, 3:6] = 4.0
    track = np.where(np.isfinite(depth), 2, 0)
    sheet = rendered_movers(SampleLayer("", color, depth), tracks_of(track))
    there = np.zeros((9, 9), dtype=bool)
    there[2:7, 2:7] = True
    np.testing.assert_array_equal(sheet.tracks.track == 2, there)
    assert (sheet.tracks.track[~there] == NO_TRACK).all()
    np.testing.assert_allclose(sheet.inverse_depth[there], 0.25)
    np.testing.assert_array_equal(sheet.color, color)
    assert not sheet.guessed.any()


def test_layer_without_movers_is_no_sheet() -> None:
    color, depth = np.zeros((4, 4, 4), np.float32), np.full((4, 4), np.inf, np.float32)
    sheet = rendered_movers(SampleLayer("", color, depth), tracks_of(np.zeros((4, 4))))
    assert (sheet.tracks.track == NO_TRACK).all()


# Joining


def sheet_of(depth: Picture, track: npt.NDArray[Any], surface: npt.NDArray[Any] | None = None) -> Sheet:
    rows, columns = track.shape
    color = np.zeros((rows, columns, 4), dtype=np.float32)
    color[..., 0], color[..., 3] = np.arange(columns), 1.0
    chosen = track if surface is None else surface
    return Sheet(
        color, (1.0 / depth).astype(np.float32), tracks_of(track), np.zeros((rows, columns), np.float32),
        chosen.astype(np.int64),
    )  # fmt: skip


def parted(rows: int, columns: int, right: int | None = None) -> tuple[Labels, Labels]:
    """Return that the samples of one column, or all, part from those right of it; all from those below."""
    beside = np.zeros((rows, columns - 1), dtype=bool)
    beside[:, slice(None) if right is None else right] = True
    return beside, np.full((rows - 1, columns), right is None)


def test_one_surface_is_never_torn() -> None:
    """A slant of less than a step, and samples that part: an object that grows."""
    depth = np.broadcast_to(3.0 * (1.0 + 0.5 * DEPTH_STEP) ** np.arange(8), (5, 8))
    quads, behind = join(sheet_of(depth, np.zeros((5, 8))), *parted(5, 8), before_something=False)
    assert (quads == QUAD).all()
    np.testing.assert_array_equal(behind[..., 0], np.broadcast_to(np.arange(8), (5, 8)))


def test_surfaces_at_a_step_of_depth_are_torn_where_they_part() -> None:
    depth = np.where(np.arange(8) < 4, 3.0, 6.0) * np.ones((5, 1))
    sheet = sheet_of(depth, np.zeros((5, 8)))
    quads, behind = join(sheet, *parted(5, 8, right=3), before_something=False)
    assert (quads[:, 3] == TORN_QUAD).all()
    assert (np.delete(quads, 3, axis=1) == QUAD).all()
    # Samples at the tear give the colour of their own surface farther off.
    assert (behind[:, 3, 0] <= 2.0).all()
    assert (behind[:, 4, 0] >= 5.0).all()
    np.testing.assert_array_equal(behind[:, [0, 1, 2, 5, 6, 7]], sheet.color[:, [0, 1, 2, 5, 6, 7]])
    # At rest to each other nothing is uncovered.
    still = join(sheet, *parted(5, 8, right=0), before_something=False)[0]
    assert (still == QUAD).all()


def test_different_objects_that_part_show_what_is_behind_them() -> None:
    track = np.where(np.arange(8) < 4, 1, 2) * np.ones((5, 1))
    for depth in (3.0, np.where(np.arange(8) < 4, 3.0, 6.0)):
        sheet = sheet_of(depth * np.ones((5, 8)), track)
        assert (join(sheet, *parted(5, 8, 3), before_something=True)[0][:, 3] == NO_QUAD).all()
        assert (join(sheet, *parted(5, 8, 3), before_something=False)[0][:, 3] == TORN_QUAD).all()
        # Side by side they go together.
        assert (join(sheet, *parted(5, 8, 0), before_something=True)[0] == QUAD).all()


def test_samples_without_a_track_end_a_sheet() -> None:
    track = np.zeros((4, 5))
    track[2, 2] = NO_TRACK
    quads, _ = join(sheet_of(np.ones((4, 5)), track), *parted(4, 5), before_something=True)
    expected = np.full((3, 4), QUAD)
    expected[1:3, 1:3] = NO_QUAD
    np.testing.assert_array_equal(quads, expected)


def test_vectors_of_one_surface_are_not_torn() -> None:
    track = np.full((4, 5), VECTOR_TRACK)
    quads, _ = join(
        sheet_of(np.ones((4, 5)), track, np.full((4, 5), -11)), *parted(4, 5), before_something=False
    )
    assert (quads == QUAD).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_sheets_of_any_size_are_joined(shape: tuple[int, int]) -> None:
    quads, behind = join(sheet_of(np.ones(shape), np.zeros(shape)), *parted(*shape), before_something=False)
    assert quads.shape == (shape[0] - 1, shape[1] - 1)
    assert behind.shape == (*shape, 4)


# Windows


@pytest.mark.parametrize("position", ["center", "corner"])
def test_on_display_places_samples_in_the_window(position: Any) -> None:
    values = np.arange(30, dtype=np.float32).reshape(5, 6)
    samples = Samples(
        (SampleLayer("", np.zeros((5, 6, 4), np.float32)),),
        Window(-2, 3, 4, 8),
        Window(-1, 1, 9, 6),
        1.0,
        position,
    )
    pixels = on_display(samples, values)
    assert pixels.shape == (5, 10)
    expected = np.zeros((5, 10), dtype=np.float32)
    if position == "center":
        # Pixels (-1, 3) to (3, 5).
        expected[2:, :5] = values[:3, 1:]
    else:
        # A pixel has its four corners' mean; there is one less of them than of samples.
        expected[2:, :4] = values[:3, 1:5] + 3.5
    np.testing.assert_array_equal(pixels, expected)


def test_windows_apart_show_nothing() -> None:
    samples = Samples(
        (SampleLayer("", np.zeros((2, 2, 4), np.float32)),), Window(50, 50, 52, 52), Window(0, 0, 4, 3)
    )
    assert not on_display(samples, np.ones((2, 2), np.float32)).any()


def test_what_one_mover_hides_of_another_is_filled_in() -> None:
    """A near square before the middle of a far bar: the bar goes on behind it, in its color."""
    shape = (24, 40)
    rows, columns = np.indices(shape)
    bar = (abs(rows - 11.5) < 6) & (abs(columns - 19.5) < 16)
    square = (abs(rows - 11.5) < 4) & (abs(columns - 19.5) < 5)
    track = np.where(square, 1, np.where(bar, 2, NO_TRACK))
    depth = np.where(square, 2.0, 5.0).astype(np.float32)
    sheet = sheet_of(depth, track, track)
    color = np.zeros((*shape, 4), dtype=np.float32)
    color[bar] = (0.1, 0.2, 0.8, 1.0)
    color[square] = (0.9, 0.5, 0.1, 1.0)
    hidden = covered_movers(replace(sheet, color=color))
    assert hidden is not None
    filled = hidden.guessed > 0.0
    assert np.array_equal(filled, square)
    assert np.allclose(hidden.color[square], (0.1, 0.2, 0.8, 1.0), atol=1e-6)
    assert np.allclose(hidden.inverse_depth[square], 0.2)
    assert (hidden.tracks.track[square] == 2).all()
    # Joined to what is seen of the bar, and nothing else.
    assert set(np.unique(hidden.tracks.track)) == {NO_TRACK, 2}
    assert covered_movers(replace(sheet, color=color, inverse_depth=np.float32(1.0) / (7.0 - depth))) is None


def test_movers_beside_each_other_hide_nothing() -> None:
    track = np.full((12, 20), NO_TRACK)
    track[2:10, 2:8], track[2:10, 9:18] = 1, 2
    sheet = sheet_of(np.where(track == 1, 2.0, 5.0).astype(np.float32), track, track)
    assert covered_movers(replace(sheet, color=np.ones((12, 20, 4), dtype=np.float32))) is None
