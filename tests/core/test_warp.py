"""Instantaneous images of sheets against places, colours and coverage by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from potmesil_addon import jit
from potmesil_addon.warp import (
    NO_QUAD,
    NO_TRACK,
    QUAD,
    TILE_COLUMNS,
    TILE_ROWS,
    TORN_QUAD,
    VECTOR_TRACK,
    Background,
    Schedule,
    Sheets,
    expose,
    instant,
    outlook,
    places,
)

from .helpers import Array, Picture

BACKENDS: list[Any] = [
    pytest.param("numba", marks=pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")),
    "numpy",
]
backends = pytest.mark.parametrize("backend", BACKENDS)
needs_numba = pytest.mark.skipif(not jit.HAVE_NUMBA, reason="numba is not installed")

IDENTITY = np.eye(4)[:3]


def shifted(x: float, y: float = 0.0) -> Array:
    """Return a reprojection that moves everything by some pixels."""
    matrix = np.eye(4)[:3].copy()
    matrix[:2, 2] = x, y
    return matrix


def schedule_of(*matrices: Array) -> Schedule:
    """Return instants of one track."""
    return Schedule(np.zeros(len(matrices)), np.ascontiguousarray(np.stack(matrices)[np.newaxis]))


def sheets_of(color: npt.NDArray[Any], inverse_depth: Any = 0.25, track: Any = 0, **others: Any) -> Sheets:
    """Return one sheet, its first sample at the first pixel's centre."""
    own = np.asarray(color, dtype=np.float32)
    shape = (1, *own.shape[:2])
    behind = np.asarray(others.pop("behind", own), dtype=np.float32)
    values: dict[str, Any] = {
        "color": np.ascontiguousarray(np.stack([own, behind])[:, np.newaxis]),
        "inverse_depth": np.broadcast_to(np.float32(inverse_depth), shape).copy(),
        "track": np.broadcast_to(np.int32(track), shape).copy(),
        "velocity": np.zeros((*shape, 2), dtype=np.float32),
        "acceleration": np.zeros((*shape, 2), dtype=np.float32),
        "guessed": np.zeros(shape, dtype=np.float32),
        "quads": np.full((shape[0], shape[1] - 1, shape[2] - 1), QUAD, dtype=np.uint8),
        "origin_x": 0.5,
        "origin_y": 0.5,
    }
    return Sheets(**{**values, **others})


def noise(rows: int, columns: int, seed: int = 0) -> Picture:
    color = np.random.default_rng(seed).random((rows, columns, 4), dtype=np.float32)
    color[..., 3] = 1.0
    return color


def wall(rows: int, columns: int, inverse_depth: float = 0.1, alpha: float = 1.0) -> Background:
    color = np.full((rows, columns, 4), 0.5 * alpha, dtype=np.float32)
    color[..., 3] = alpha
    nothing = np.zeros((rows, columns), dtype=np.float32)
    return Background(color, nothing + np.float32(inverse_depth), nothing)


def averaged(
    sheets: Sheets, schedule: Schedule, background: Background | None, backend: Any, shape: Any = None
) -> tuple[Picture, Picture]:
    shape = shape or sheets.track.shape[1:]
    picture, guessed = np.full((*shape, 4), -7.0, np.float32), np.full(shape, -7.0, np.float32)
    shares = list(expose(sheets, schedule, background, picture, guessed, backend))
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return picture, guessed


# Places


@backends
def test_places_are_the_reprojections(backend: Any) -> None:
    """(x, y, 1, 1/z) goes to (x' s, y' s, s), and 1/z to 1/(z s)."""
    rng = np.random.default_rng(2)
    iz = rng.uniform(0.0, 0.5, (6, 7)).astype(np.float32)
    matrix = np.eye(4)[:3] + 0.01 * rng.normal(size=(3, 4))
    sheets = sheets_of(noise(6, 7), iz, origin_x=-3.5, origin_y=2.0)
    got = places(sheets, schedule_of(IDENTITY, matrix), 1, backend)[0]
    for row, column in np.ndindex(6, 7):
        h = matrix @ [column - 3.5, row + 2.0, 1.0, float(iz[row, column])]
        expected = [h[0] / h[2], h[1] / h[2], iz[row, column] / h[2]]
        np.testing.assert_allclose(got[row, column], expected, rtol=1e-9, atol=1e-9)


@backends
def test_what_passes_the_camera_or_is_no_sample_has_no_depth(backend: Any) -> None:
    track = np.zeros((2, 3), dtype=np.int32)
    track[0, 1] = NO_TRACK
    iz = np.float32([[0.25, 0.25, 0.0], [1.0, 0.5, 0.49]])
    matrix = np.eye(4)[:3].copy()
    # Nearer by 2 m: what was at 2 m is in the camera's plane.
    matrix[2, 3] = -2.0
    got = places(sheets_of(noise(2, 3), iz, track), schedule_of(matrix), 0, backend)[0, ..., 2]
    assert got[0, 1] == got[1, 0] == got[1, 1] == -1.0
    np.testing.assert_allclose([got[0, 0], got[0, 2], got[1, 2]], [0.25 / 0.5, 0.0, 0.49 / 0.02], rtol=1e-5)


@backends
def test_vectors_are_parabolas(backend: Any) -> None:
    velocity, acceleration = np.zeros((1, 2, 3, 2), np.float32), np.zeros((1, 2, 3, 2), np.float32)
    velocity[0, 1, 2], acceleration[0, 1, 2] = [4.0, -3.0], [1.0, 8.0]
    sheets = sheets_of(noise(2, 3), 0.3, VECTOR_TRACK, velocity=velocity, acceleration=acceleration)
    schedule = Schedule(np.array([-0.5, 0.25]), np.zeros((1, 2, 3, 4)))
    for n, t in enumerate(schedule.times):
        got = places(sheets, schedule, n, backend)[0]
        expected = [2.5 + 4.0 * t + t**2, 1.5 - 3.0 * t + 8.0 * t**2, np.float32(0.3)]
        np.testing.assert_allclose(got[1, 2], expected, rtol=1e-6)
        np.testing.assert_allclose(got[0, 1, :2], [1.5, 0.5])


@backends
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("factor", [0.1, 0.5, 0.9, -0.4, -0.9, -3.0])
def test_slit_meets_a_sample_at_one_time_and_place(factor: float, axis: int, backend: Any) -> None:
    """With x = x0 + v t and t = t0 + r (x - m): x = (x0 + v (t0 - r m)) / (1 - v r)."""
    rate, middle = 0.01, 20.0
    v = factor / rate
    grid = np.linspace(-4.0, 4.0, 257)
    matrices = np.stack([shifted(v * t, 0.0) if axis == 0 else shifted(0.0, v * t) for t in grid])
    sheets = sheets_of(noise(9, 8))
    by_vector = sheets._replace(
        track=np.full_like(sheets.track, VECTOR_TRACK),
        velocity=np.broadcast_to(
            np.float32([v, 0.0] if axis == 0 else [0.0, v]), sheets.velocity.shape
        ).copy(),
    )
    schedule = Schedule(
        np.array([0.1]),
        np.ascontiguousarray(matrices[np.newaxis]),
        axis,
        rate,
        middle,
        -4.0,
        float(grid[1] - grid[0]),
    )
    for which in (sheets, by_vector):
        got = places(which, schedule, 0, backend)[0]
        start = np.arange(8) + 0.5 if axis == 0 else np.arange(9) + 0.5
        expected = (start + v * (0.1 - rate * middle)) / (1.0 - factor)
        along = got[0, :, 0] if axis == 0 else got[:, 0, 1]
        # A hundredth of a pixel.
        np.testing.assert_allclose(along, expected, atol=0.01)


# Outlook


@backends
def test_outlook_follows_paths_there_and_back(backend: Any) -> None:
    """A sample that goes 5 pixels and back has a path of 10, and was never farther away than 5."""
    velocity = np.zeros((1, 3, 4, 2), dtype=np.float32)
    velocity[0, 1, 2] = [3.0, -4.0]
    sheets = sheets_of(noise(3, 4), 0.3, VECTOR_TRACK, velocity=velocity)
    found = outlook(sheets, Schedule(np.array([0.0, 0.5, 1.0, 0.0]), np.zeros((1, 4, 3, 4))), backend)
    length, right, down = np.zeros((3, 4)), np.zeros((3, 3)), np.zeros((2, 4))
    length[1, 2], right[1, 1:], down[:, 2] = 10.0, 4.0, 4.0
    np.testing.assert_allclose(found.length[0], length)
    np.testing.assert_allclose(found.farthest[0], 0.5 * length)
    np.testing.assert_allclose(found.right[0], right)
    np.testing.assert_allclose(found.down[0], down)


@backends
def test_outlook_leaves_samples_where_they_passed_the_camera(backend: Any) -> None:
    iz = np.full((2, 3), 0.25, dtype=np.float32)
    iz[1, 1] = 1.0
    near, past = shifted(2.0), shifted(7.0)
    past[2, 3] = -2.0
    found = outlook(sheets_of(noise(2, 3), iz), schedule_of(IDENTITY, near, past), backend)
    assert found.length[0, 1, 1] == found.farthest[0, 1, 1] == 2.0
    assert found.length[0, 0, 0] > 7.0


@needs_numba
@pytest.mark.parametrize("seed", range(2))
def test_outlooks_of_the_backends_agree(seed: int) -> None:
    sheets, schedule, _ = tangle(seed, 9, 600)
    # Near the camera's plane places, and what they differ by in rounding, know no bounds.
    schedule.matrices[:, :, 2] = [0.0, 0.0, 1.0, 0.0]
    for a, b in zip(*(outlook(sheets, schedule, backend) for backend in ("numba", "numpy")), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5)


# Instants


@backends
def test_samples_at_rest_are_the_input_to_the_bit(backend: Any) -> None:
    color = noise(9, 11) * np.float32(1e4)
    iz = np.random.default_rng(1).uniform(0.0, 1.0, (9, 11)).astype(np.float32)
    picture, depth, guessed = instant(sheets_of(color, iz), schedule_of(IDENTITY), 0, None, (9, 11), backend)
    assert picture.tobytes() == color.tobytes()
    assert depth.tobytes() == iz.tobytes()
    assert not guessed.any()
    picture, _ = averaged(sheets_of(color, iz), schedule_of(*[IDENTITY] * 7), None, backend)
    np.testing.assert_allclose(picture, color, rtol=1e-6)


@backends
@pytest.mark.parametrize("move", [(2.0, -1.0), (0.25, 0.5), (-3.3, 1.7)])
def test_moved_samples_are_interpolated_linearly(move: tuple[float, float], backend: Any) -> None:
    color = noise(12, 14)
    picture, depth, _ = instant(sheets_of(color), schedule_of(shifted(*move)), 0, None, (12, 14), backend)
    seen = depth >= 0.0
    assert seen.sum() > 60
    for row, column in np.argwhere(seen):
        x, y = column - move[0], row - move[1]
        i, j = min(int(np.floor(x + 1e-9)), 12), min(int(np.floor(y + 1e-9)), 10)
        u, v = x - i, y - j
        expected = (
            (1 - u) * (1 - v) * color[j, i] + u * (1 - v) * color[j, i + 1]
            + (1 - u) * v * color[j + 1, i] + u * v * color[j + 1, i + 1]
        )  # fmt: skip
        np.testing.assert_allclose(picture[row, column], expected, atol=1e-5)
    # Between the outermost samples and nowhere else.
    rows, columns = np.mgrid[0:12, 0:14]
    x, y = columns - move[0], rows - move[1]
    inside = (x >= -1e-6) & (x <= 13 + 1e-6) & (y >= -1e-6) & (y <= 11 + 1e-6)
    np.testing.assert_array_equal(seen, inside)


@backends
@pytest.mark.parametrize("move", [(3.0, 0.0), (-2.0, 4.0), (0.0, 1.0), (1e-12, 2.0 - 1e-12)])
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_pixels_on_the_edges_of_quads_belong_to_one(
    move: tuple[float, float], share: float, backend: Any
) -> None:
    """As all do where a camera pans: each is seen once, also of a clear sheet with holes and tears."""
    color = noise(20, 24) * np.float32(share)
    quads = np.full((1, 19, 23), QUAD, dtype=np.uint8)
    quads[0, 5:7, 8], quads[0, 11, 3:6], quads[0, 14:16, 12:15] = TORN_QUAD, TORN_QUAD, NO_QUAD
    sheets = sheets_of(color, quads=quads)
    picture, depth, _ = instant(sheets, schedule_of(shifted(*move)), 0, None, (20, 24), backend)
    x, y = (round(along) for along in move)
    rows, columns = slice(max(y, 0), 20 + min(y, 0)), slice(max(x, 0), 24 + min(x, 0))
    from_rows, from_columns = slice(max(-y, 0), 20 - max(y, 0)), slice(max(-x, 0), 24 - max(x, 0))
    hole = np.zeros((20, 24), dtype=bool)
    # All four quads around it are missing.
    hole[15, 13:15] = True
    seen = ~hole[from_rows, from_columns]
    np.testing.assert_array_equal(depth[rows, columns] >= 0.0, seen)
    np.testing.assert_allclose(picture[rows, columns][seen], color[from_rows, from_columns][seen], atol=1e-6)


@backends
@pytest.mark.parametrize("turn", [0.3, 1.2, 3.0])
def test_turned_sheet_covers_its_inside_once(turn: float, backend: Any) -> None:
    """A sheet of one translucent colour: nowhere twice over itself, nowhere a hole."""
    color = np.broadcast_to(np.float32([0.2, 0.3, 0.4, 0.5]), (21, 21, 4))
    c, s = 0.8 * np.cos(turn), 0.8 * np.sin(turn)
    about = np.array([[c, -s, 10.5 - 10.5 * c + 10.5 * s], [s, c, 10.5 - 10.5 * s - 10.5 * c], [0, 0, 1.0]])
    matrix = np.concatenate([about, np.zeros((3, 1))], axis=1)
    picture, depth, _ = instant(sheets_of(color), schedule_of(matrix), 0, None, (21, 21), backend)
    rows, columns = np.mgrid[0:21, 0:21] - 10.0
    x, y = (c * columns + s * rows) / 0.64, (-s * columns + c * rows) / 0.64
    reach = np.maximum(np.abs(x), np.abs(y))
    assert (depth[reach < 10.0 - 1e-3] > 0.0).all()
    assert (depth[reach > 10.0 + 1e-3] < 0.0).all()
    np.testing.assert_allclose(
        picture[depth > 0.0], np.broadcast_to(color[0, 0], picture[depth > 0.0].shape), atol=1e-6
    )


@backends
@pytest.mark.parametrize("order", [1, -1])
def test_nearer_sheet_hides_the_other_whichever_is_drawn_first(order: int, backend: Any) -> None:
    red, green = np.float32([1.0, 0.0, 0.0, 1.0]), np.float32([0.0, 0.5, 0.0, 0.5])
    color = np.stack([np.broadcast_to(red, (4, 5, 4)), np.broadcast_to(green, (4, 5, 4))])[::order]
    iz = np.stack([np.full((4, 5), 0.2), np.full((4, 5), 0.8)]).astype(np.float32)[::order]
    nothing = np.zeros((2, 4, 5, 2), dtype=np.float32)
    both = Sheets(
        np.ascontiguousarray(np.stack([color, color])), np.ascontiguousarray(iz),
        np.zeros((2, 4, 5), np.int32),
        nothing, nothing, nothing[..., 0].copy(), np.full((2, 3, 4), QUAD, np.uint8), 0.5, 0.5,
    )  # fmt: skip
    picture, depth, _ = instant(both, schedule_of(IDENTITY), 0, None, (4, 5), backend)
    np.testing.assert_allclose(picture, np.broadcast_to([0.5, 0.5, 0.0, 1.0], picture.shape))
    np.testing.assert_allclose(depth, 0.8)


@backends
def test_sheet_goes_before_or_behind_what_stands_still(backend: Any) -> None:
    color = np.broadcast_to(np.float32([0.6, 0.0, 0.0, 0.6]), (4, 5, 4))
    for background, expected in (
        (wall(4, 5, 0.1), [0.6 + 0.4 * 0.5, 0.2, 0.2, 1.0]),
        (wall(4, 5, 0.9), [0.5, 0.5, 0.5, 1.0]),
        (wall(4, 5, 0.9, alpha=0.5), [0.25 + 0.3, 0.25, 0.25, 0.5 + 0.3]),
    ):
        sheets = sheets_of(color)
        picture, _, _ = instant(sheets, schedule_of(IDENTITY), 0, background, (4, 5), backend)
        np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)
        picture, _ = averaged(sheets, schedule_of(IDENTITY, IDENTITY), background, backend)
        np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


@backends
def test_torn_quad_is_drawn_as_what_lies_behind(backend: Any) -> None:
    """In the far corners' depth and colour, and as a guess."""
    color = np.zeros((3, 6, 4), dtype=np.float32)
    color[:, :3], color[:, 3:] = [1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]
    behind = color.copy()
    behind[:, 3:] = [0.0, 0.75, 0.0, 1.0]
    iz = np.where(np.arange(6) < 3, 0.8, 0.2) * np.ones((3, 1))
    quads = np.full((1, 2, 5), QUAD, dtype=np.uint8)
    quads[:, :, 2] = TORN_QUAD
    track = np.where(np.arange(6) < 3, 0, 1) * np.ones((3, 1))
    sheets = sheets_of(color, iz, track, quads=quads, behind=behind)
    # The far half goes off by almost 4 pixels, so that no centre lies on an edge.
    matrices = np.stack([IDENTITY[np.newaxis], shifted(3.7)[np.newaxis]])
    picture, depth, guessed = instant(sheets, Schedule(np.zeros(1), matrices), 0, None, (3, 9), backend)
    expected = np.zeros((9, 4))
    expected[:3], expected[3:7], expected[7:] = [1, 0, 0, 1], [0, 0.75, 0, 1], [0, 1, 0, 1]
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)
    np.testing.assert_allclose(depth[0], [0.8] * 3 + [0.2] * 6, rtol=1e-6)
    np.testing.assert_array_equal(guessed[0], [0] * 3 + [1] * 4 + [0] * 2)


@backends
def test_missing_quads_and_samples_behind_the_camera_are_not_drawn(backend: Any) -> None:
    color = noise(6, 8)
    quads = np.full((1, 5, 7), QUAD, dtype=np.uint8)
    quads[0, 2, 3] = NO_QUAD
    _, depth, _ = instant(
        sheets_of(color, quads=quads), schedule_of(shifted(0.5, 0.5)), 0, None, (6, 8), backend
    )
    hole = np.zeros((6, 8), dtype=bool)
    hole[3, 4] = hole[0] = hole[:, 0] = True
    np.testing.assert_array_equal(depth < 0.0, hole)
    iz = np.full((6, 8), 0.25, dtype=np.float32)
    iz[2, 3] = 1.0
    nearer = shifted(0.5, 0.5)
    nearer[2, 3] = -1.5
    nearer[:2, 3] = -1.5 * 3.0
    picture, depth, _ = instant(sheets_of(color, iz), schedule_of(nearer), 0, None, (6, 8), backend)
    assert np.isfinite(picture).all()
    assert (depth >= 0.0).any()


# Means


@backends
def test_mean_of_instants_is_their_mean(backend: Any) -> None:
    """Before a wall, pixel by pixel; what is never reached is the wall to the bit."""
    color = noise(7, 9)
    color[..., 3] = 0.75
    color[..., :3] *= 0.75
    sheets = sheets_of(color, origin_x=8.5, origin_y=5.5)
    matrices = [shifted(0.7 * n, -0.4 * n) for n in range(9)]
    background = wall(20, 30)
    background.color[:] *= np.random.default_rng(3).random((20, 30, 1), dtype=np.float32)
    picture, guessed = averaged(sheets, schedule_of(*matrices), background, backend, (20, 30))
    instants = [
        instant(sheets, schedule_of(*matrices), n, background, (20, 30), backend)[0] for n in range(9)
    ]
    np.testing.assert_allclose(picture, np.mean(instants, axis=0, dtype=np.float64), atol=1e-6)
    never = np.all([instant_ == background.color for instant_ in instants], axis=(0, 3))
    assert 150 < never.sum() < 500
    assert picture[never].tobytes() == background.color[never].tobytes()
    assert not guessed.any()


@backends
def test_without_a_background_a_pixel_is_the_mean_of_what_is_there(backend: Any) -> None:
    """Two instants, one of which has left; the other's share is a guess."""
    color = np.broadcast_to(np.float32([0.2, 0.4, 0.6, 1.0]), (5, 6, 4))
    picture, guessed = averaged(sheets_of(color), schedule_of(IDENTITY, shifted(3.0)), None, backend)
    np.testing.assert_allclose(picture, color, atol=1e-6)
    np.testing.assert_allclose(guessed, np.broadcast_to(np.where(np.arange(6) < 3, 0.5, 0.0), (5, 6)))


@backends
def test_transparent_samples_are_there(backend: Any) -> None:
    """Half clear, half solid, over nothing: after a shift of 2 of 4 pixels alpha is a half there."""
    color = np.zeros((4, 12, 4), dtype=np.float32)
    color[:, 6:] = 1.0
    steps = [shifted(-0.5 * n) for n in range(9)]
    picture, guessed = averaged(sheets_of(color), schedule_of(*steps), None, backend)
    # Column 2 to 7: the tent of an edge between samples 5 and 6, moved left by up to 4.
    at = np.array(
        [[np.clip(x + 0.5 * n - 5.0, 0.0, 1.0) for n in range(9) if x + 0.5 * n <= 11] for x in range(8)]
    )
    np.testing.assert_allclose(picture[..., :8, 3], np.broadcast_to(at.mean(axis=1), (4, 8)), atol=1e-6)
    assert not guessed[:, :8].any()
    _, depth, _ = instant(sheets_of(color), schedule_of(IDENTITY), 0, None, (4, 12), backend)
    assert (depth >= 0.0).all()


@backends
@pytest.mark.parametrize("share", [1.0, 0.25])
def test_guessed_share_is_counted_in_time(share: float, backend: Any) -> None:
    sheets = sheets_of(np.full((4, 5, 4), share), guessed=np.ones((1, 4, 5), np.float32))
    _, guessed = averaged(sheets, schedule_of(IDENTITY, IDENTITY, shifted(99.0)), wall(4, 5), backend)
    assert 0.0 < guessed.min() == guessed.max() <= 2.0 / 3.0 + 1e-6


# Tiles


@needs_numba
@pytest.mark.parametrize("behind", [True, False])
def test_tiles_have_no_seams(behind: bool) -> None:
    """Over several tiles each way, and more instants than are drawn at a time: one even colour stays even."""
    shape = TILE_ROWS + 9, TILE_COLUMNS + 17
    color = np.broadcast_to(np.float32([0.2, 0.4, 0.6, 1.0]), (shape[0] + 40, shape[1] + 40, 4))
    sheets = sheets_of(color, origin_x=-19.5, origin_y=-19.5)
    turns = np.linspace(-0.1, 0.1, 70)
    matrices = [
        np.array([[1.0, -t, 9.0 * t, 0.0], [t, 1.0, -9.0 * t, 0.0], [0.0, 0.0, 1.0, 0.0]]) for t in turns
    ]
    background = wall(*shape) if behind else None
    picture, guessed = averaged(sheets, schedule_of(*matrices), background, "numba", shape)
    inside = np.s_[12:-12, 12:-12]
    np.testing.assert_allclose(
        picture[inside], np.broadcast_to(color[0, 0], picture[inside].shape), rtol=1e-6
    )
    assert not guessed[inside].any()


@needs_numba
@pytest.mark.parametrize("behind", [True, False])
@pytest.mark.parametrize(
    ("rows", "columns", "instants"), [(TILE_ROWS + 10, TILE_COLUMNS + 20, 5), (21, 24, 45)]
)
def test_tiles_are_the_mean_of_whole_instants(rows: int, columns: int, instants: int, behind: bool) -> None:
    """Noise that is thrown from tile to tile, and more instants than are drawn at a time."""
    sheets, few, background = tangle(11, rows, columns)
    share = np.linspace(0.0, 3.999, instants)
    k, after = share.astype(int), (share % 1.0)[:, np.newaxis, np.newaxis]
    matrices = (1.0 - after) * few.matrices[:, k] + after * few.matrices[:, k + 1]
    schedule = Schedule(np.interp(share, range(5), few.times), np.ascontiguousarray(matrices))
    chosen = background if behind else None
    results = [averaged(sheets, schedule, chosen, backend) for backend in ("numba", "numpy")]
    for a, b in zip(*results, strict=True):
        # As for the tangle below; every instant has its own such fragments, and a share of the difference.
        assert np.mean(np.abs(a - b) > 2e-6) < 2e-4 * instants


@needs_numba
def test_a_sheet_shrunk_into_a_tile_is_drawn_whole() -> None:
    """All of a row of more blocks than are placed at a time."""
    sheets = sheets_of(noise(12, 900))
    matrix = np.array([[0.1, 0.0, 4.0, 0.0], [0.0, 1.0, 0.3, 0.0], [0.0, 0.0, 1.0, 0.0]])
    results = [instant(sheets, schedule_of(matrix), 0, None, (16, 100), b)[:2] for b in ("numba", "numpy")]
    assert (results[0][1][2:11, 5:93] > 0.0).all()
    for a, b in zip(*results, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


# The two implementations


def tangle(
    seed: int, rows: int = 2 * TILE_ROWS + 9, columns: int = 40
) -> tuple[Sheets, Schedule, Background]:
    """Return two sheets of noise with holes, tears and all kinds of tracks, thrown about at five instants."""
    rng = np.random.default_rng(seed)
    shape = (2, rows, columns)
    color = rng.random((*shape, 4), dtype=np.float32)
    color[..., 3] = np.where(rng.random(shape) < 0.8, 1.0, rng.random(shape))
    color[..., :3] *= color[..., 3:]
    track = rng.choice([0, 1, 2, VECTOR_TRACK], size=(2, rows // 8 + 1, -(-columns // 8)))
    track = track.repeat(8, axis=1).repeat(8, axis=2)[:, :rows, :columns].astype(np.int32)
    track[rng.random(shape) < 0.03] = NO_TRACK
    velocity = rng.normal(0.0, 9.0, (2, *shape, 2)).astype(np.float32)
    sheets = Sheets(
        np.stack([color, rng.random((*shape, 4), dtype=np.float32)]),
        rng.uniform(0.0, 0.8, shape).astype(np.float32), track, velocity[0], velocity[1],
        (rng.random(shape) < 0.1).astype(np.float32),
        rng.choice([NO_QUAD, QUAD, QUAD, TORN_QUAD], size=(2, rows - 1, columns - 1)).astype(np.uint8),
        0.5, -2.5,
    )  # fmt: skip
    matrices = np.eye(4)[:3] + rng.normal(0.0, 1.0, (3, 5, 3, 4)) * [[0.05, 0.05, 4.0, 4.0]] * 1.0
    # The last row of each: s = z'/z near 1, sometimes behind the camera.
    matrices[..., 2, :] = [0.0, 0.0, 1.0, 0.0] + rng.normal(0.0, 1.0, (3, 5, 4)) * [0.002, 0.002, 0.05, 1.0]
    schedule = Schedule(np.linspace(-0.4, 0.5, 5), np.ascontiguousarray(matrices))
    background = Background(
        rng.random((rows, columns, 4), dtype=np.float32),
        rng.uniform(0.0, 0.8, (rows, columns)).astype(np.float32),
        rng.random((rows, columns), dtype=np.float32),
    )  # fmt: skip
    return sheets, schedule, background


@needs_numba
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("behind", [True, False])
def test_backends_agree_on_a_tangle(seed: int, behind: bool) -> None:
    sheets, schedule, background = tangle(seed)
    chosen = background if behind else None
    for n in range(5):
        a, b = (places(sheets, schedule, n, backend) for backend in ("numba", "numpy"))
        np.testing.assert_array_equal(a[..., 2] < 0.0, b[..., 2] < 0.0)
        seen = a[..., 2] >= 0.0
        np.testing.assert_allclose(a[seen], b[seen], rtol=1e-7, atol=1e-7)
    pictures = [averaged(sheets, schedule, chosen, backend) for backend in ("numba", "numpy")]
    for a, b in zip(*pictures, strict=True):
        # Of fragments at one depth whose alphas are alike but for rounding either may be taken.
        assert np.mean(np.abs(a - b) > 2e-6) < 1e-3
    for n in (0, 3):
        shape = (2 * TILE_ROWS + 9, 40) if behind else (50, 30)
        results = [instant(sheets, schedule, n, chosen, shape, backend) for backend in ("numba", "numpy")]
        for a, b in zip(*results, strict=True):
            assert np.mean(np.abs(a - b) > 2e-6) < 1e-3


@needs_numba
def test_backends_agree_with_a_slit() -> None:
    sheets, schedule, background = tangle(8)
    # Tame enough that there is one time at which the slit meets a sample, and none goes behind the camera.
    schedule.matrices[:, :, 2] = [0.0, 0.0, 1.0, 0.0]
    for axis in (0, 1):
        slit = schedule._replace(slit_axis=axis, slit_rate=0.004, slit_middle=20.0, first=-0.5, step=0.25)
        pictures = [averaged(sheets, slit, background, backend)[0] for backend in ("numba", "numpy")]
        assert np.mean(np.abs(pictures[0] - pictures[1]) > 2e-6) < 1e-3


@needs_numba
def test_tangle_does_not_depend_on_the_number_of_threads(all_threads: int) -> None:
    if all_threads < 2:
        pytest.skip("this machine has one core")
    sheets, schedule, background = tangle(5, columns=TILE_COLUMNS + 40)
    results = []
    for threads in (1, 2):
        assert jit.set_thread_count(threads) == threads
        results.append([values.tobytes() for values in averaged(sheets, schedule, background, "numba")])
        results[-1] += [
            v.tobytes() for v in instant(sheets, schedule, 2, None, background.inverse_depth.shape, "numba")
        ]
    assert results[0] == results[1]


@backends
def test_nothing_negative_and_nothing_brighter_than_its_parts(backend: Any) -> None:
    """Interpolation, layers and means are all of weights from 0 to 1."""
    for seed in range(3):
        sheets, schedule, background = tangle(seed)
        picture, guessed = averaged(sheets, schedule, background, backend)
        assert np.isfinite(picture).all()
        assert picture.min() >= 0.0
        # Two sheets and a wall over each other, each at most 1.
        assert picture.max() <= 3.0
        assert guessed.min() >= -1e-6


@backends
@pytest.mark.parametrize("size", [1e7, 1e12, 1e30])
def test_samples_thrown_far_out_are_not_seen(size: float, backend: Any) -> None:
    velocity = np.full((1, 4, 5, 2), size, dtype=np.float32)
    sheets = sheets_of(noise(4, 5), 0.3, VECTOR_TRACK, velocity=velocity)
    schedule = Schedule(np.array([-1.0, 1.0]), np.zeros((1, 2, 3, 4)))
    background = wall(4, 5)
    picture, _ = averaged(sheets, schedule, background, backend)
    assert picture.tobytes() == background.color.tobytes()


@backends
def test_light_beside_black_does_not_make_it_negative(backend: Any) -> None:
    """A pixel's centre that is a hair off a sample counts as inside two quads."""
    color = np.zeros((6, 9, 4), dtype=np.float32)
    color[..., 3] = 1.0
    color[:, 5, :3] = 1e6
    for past in (4e-6, 9e-6, -9e-6):
        for move in ((1.0 + past, 0.0), (past, 0.0), (past, past)):
            picture, _, _ = instant(sheets_of(color), schedule_of(shifted(*move)), 0, None, (6, 9), backend)
            assert picture.min() >= 0.0
