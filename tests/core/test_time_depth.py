"""The time-and-depth buffer against sums by hand (1983, figure 6 and section 4.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from potmesil_addon.motion_psf import ExposedPath
from potmesil_addon.shutter import even_openings
from potmesil_addon.time_depth import MovingObject, meeting, merge, split
from potmesil_addon.warp import Background

from .helpers import Array, Picture

ROWS, COLUMNS = 5, 24
RED, GREEN, WHITE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, 0.5)
NEAR, FAR = 0.5, 0.25


def bar(
    color: tuple[float, float, float], first: int, last: int, inverse_depth: float, alpha: float = 1.0
) -> Picture:
    """Return five bands of an object that fills some columns."""
    picture = np.zeros((ROWS, COLUMNS, 5), dtype=np.float32)
    picture[:, first : last + 1] = [*(alpha * np.array(color)), alpha, alpha * inverse_depth]
    return picture


def line(*xs: float) -> ExposedPath:
    """Return an even motion along x through some places."""
    return ExposedPath.polyline([[x, 0.0] for x in xs], np.full(len(xs) - 1, 1.0 / (len(xs) - 1)))


REST = line(0.0, 0.0)


def thing(picture: Picture, path: ExposedPath = REST, ratio: Any = (1.0,)) -> MovingObject:
    return MovingObject(picture, 0, 0, path, np.asarray(ratio, dtype=np.float64))


def still(inverse_depth: float = 0.1, alpha: float = 1.0) -> Background:
    color = np.broadcast_to(np.float32([*(alpha * np.array(WHITE)), alpha]), (ROWS, COLUMNS, 4)).copy()
    nothing = np.zeros((ROWS, COLUMNS), dtype=np.float32)
    return Background(color, nothing + np.float32(inverse_depth), nothing)


def merged(
    objects: list[MovingObject], background: Background | None, bins: int = 1
) -> tuple[Picture, Picture]:
    picture = np.zeros((ROWS, COLUMNS, 4), dtype=np.float32)
    guessed = np.zeros((ROWS, COLUMNS), dtype=np.float32)
    if background is not None:
        picture[:], guessed[:] = background.color, background.guessed
    shares = list(merge(objects, background, bins, picture, guessed))
    assert shares[-1] == pytest.approx(1.0)
    return picture, guessed


@pytest.mark.parametrize("bins", [1, 4, 7])
def test_object_takes_its_time_from_what_lies_behind(bins: int) -> None:
    """A bar of 4 pixels goes 8: pixel by pixel the overlap of two boxes and the tent of a pixel."""
    picture, _ = merged([thing(bar(RED, 4, 7, NEAR), line(0.0, 8.0))], still(), bins)
    x = np.arange(COLUMNS)[:, np.newaxis] - (np.linspace(0.0, 8.0, 200001)[np.newaxis])
    # Columns 4 to 7, linearly between pixels.
    time = np.clip(np.minimum(x - 3.0, 8.0 - x), 0.0, 1.0).mean(axis=1)
    expected = time[:, np.newaxis] * [*RED, 1.0] + (1.0 - time)[:, np.newaxis] * [*WHITE, 1.0]
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-5)


@pytest.mark.parametrize("bins", [1, 5])
def test_nearer_surface_at_rest_hides_an_object(bins: int) -> None:
    """Only its half of the picture, the other's depth being farther away."""
    background = still(0.1)
    background.inverse_depth[:, 12:] = 0.9
    picture, _ = merged([thing(bar(RED, 2, 21, NEAR))], background, bins)
    np.testing.assert_array_equal(picture[:, 2:12], np.broadcast_to(np.float32([*RED, 1.0]), (ROWS, 10, 4)))
    np.testing.assert_array_equal(picture[:, 12:], background.color[:, 12:])


def test_object_shines_through_a_translucent_surface_before_it() -> None:
    background = still(0.9, alpha=0.25)
    picture, _ = merged([thing(bar(RED, 0, 23, NEAR))], background)
    # What lies before it, over it.
    expected = 0.25 * np.array([*WHITE, 1.0]) + 0.75 * np.array([*RED, 1.0])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


def test_surface_at_rest_at_the_object_s_own_depth_is_behind_it() -> None:
    picture, _ = merged([thing(bar(RED, 0, 23, NEAR))], still(NEAR * 1.0005))
    np.testing.assert_array_equal(picture[..., 0], 1.0)


def test_times_that_sum_to_more_than_the_exposure_are_scaled_down() -> None:
    objects = [thing(bar(RED, 0, 23, NEAR, 0.75)), thing(bar(GREEN, 0, 23, FAR, 0.5))]
    picture, _ = merged(objects, still())
    expected = np.array([0.6, 0.4, 0.0, 1.0])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


def test_times_that_sum_to_less_leave_the_rest_to_what_is_behind() -> None:
    objects = [thing(bar(RED, 0, 23, NEAR, 0.3)), thing(bar(GREEN, 0, 23, FAR, 0.2))]
    picture, _ = merged(objects, still())
    expected = np.array([0.3 + 0.25, 0.2 + 0.25, 0.25, 1.0])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


@pytest.mark.parametrize("order", [1, -1])
def test_nearer_object_goes_first_where_the_exposure_is_cut_into_bins(order: int) -> None:
    objects = [thing(bar(RED, 0, 23, NEAR, 0.75)), thing(bar(GREEN, 0, 23, FAR, 0.5))][::order]
    picture, _ = merged(objects, still(), bins=2)
    expected = np.array([0.75, 0.25, 0.0, 1.0])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


def test_order_is_that_of_each_time() -> None:
    """The red one goes from before the green one to behind it halfway through the exposure."""
    ratio = np.where(np.arange(64) < 32, 1.0, 0.1)
    picture, _ = merged(
        [thing(bar(RED, 0, 23, NEAR), ratio=ratio), thing(bar(GREEN, 0, 23, FAR))], still(), 8
    )
    np.testing.assert_allclose(picture, np.broadcast_to([0.5, 0.5, 0.0, 1.0], picture.shape), atol=1e-6)


def test_object_that_goes_behind_a_surface_at_rest_in_the_course_of_time() -> None:
    ratio = np.where(np.arange(64) < 16, 1.0, 0.1)
    picture, _ = merged([thing(bar(RED, 0, 23, NEAR), ratio=ratio)], still(FAR), 4)
    expected = 0.25 * np.array([*RED, 1.0]) + 0.75 * np.array([*WHITE, 1.0])
    np.testing.assert_allclose(picture, np.broadcast_to(expected, picture.shape), atol=1e-6)


def test_pixels_that_no_object_reaches_are_left_as_they_are() -> None:
    background = still()
    background.color[:] = np.random.default_rng(1).random(background.color.shape, dtype=np.float32)
    for bins in (1, 3):
        picture, guessed = merged([thing(bar(RED, 4, 5, NEAR), line(0.0, 6.0))], background, bins)
        assert picture[:, :4].tobytes() == background.color[:, :4].tobytes()
        assert picture[:, 12:].tobytes() == background.color[:, 12:].tobytes()
        assert not guessed.any()


def test_guessed_share_is_the_time_for_which_the_guess_is_seen() -> None:
    background = still()
    background.guessed[:, 6:] = 1.0
    _, guessed = merged([thing(bar(RED, 0, 23, NEAR, 0.25))], background)
    np.testing.assert_allclose(
        guessed, np.broadcast_to(np.where(np.arange(24) < 6, 0.0, 0.75), guessed.shape)
    )


def test_light_of_objects_over_nothing_is_kept() -> None:
    """Two lamps of 1e4 that meet in one pixel for less than all of the time."""
    lamps = [
        thing(bar((1e4, 0.0, 0.0), 3, 3, NEAR), line(0.0, 8.0)),
        thing(bar((0.0, 1e4, 0.0), 17, 17, FAR), line(0.0, -7.5)),
    ]
    picture, _ = merged(lamps, still(0.0, alpha=0.0))
    np.testing.assert_allclose(picture.sum(axis=(0, 1)), ROWS * np.array([1e4, 1e4, 0.0, 2.0]), rtol=1e-5)
    assert picture.min() >= 0.0


@pytest.mark.parametrize("bins", [1, 3])
def test_object_s_picture_may_lie_anywhere(bins: int) -> None:
    """What comes in from outside is seen: the output is the middle of a larger one."""
    path = ExposedPath.polyline([[0.0, 0.0], [10.0, 1.5]], [1.0])
    picture = bar(RED, 1, 3, NEAR)
    whole, _ = merged([thing(picture, path)], still(), bins)
    part = (slice(1, 4), slice(6, 21))
    background = Background(*(values[part] for values in still()))
    seen, guessed = background.color.copy(), np.zeros((3, 15), np.float32)
    cut = MovingObject(picture[:, 1:4], -1, -5, path, np.ones(1))
    list(merge([cut], background, bins, seen, guessed))
    np.testing.assert_allclose(seen, whole[part], atol=1e-6)
    assert seen[..., 0].max() > 0.6


def test_object_that_never_comes_into_the_picture() -> None:
    away = MovingObject(bar(RED, 1, 3, NEAR), 40, -70, line(0.0, 10.0), np.ones(1))
    picture, guessed = merged([away], still())
    assert picture.tobytes() == still().color.tobytes()
    assert not guessed.any()


def wandering() -> ExposedPath:
    rng = np.random.default_rng(4)
    return ExposedPath(rng.normal(size=(7, 2, 2)), np.array([0.3, 0.0, 0.05, 0.2, 0.15, 0.0, 0.3]))


@pytest.mark.parametrize("bins", [1, 2, 3, 16, 100])
@pytest.mark.parametrize("path", [wandering(), line(0.0, 5.0), line(0.0, 0.0), line(0.0, 1.0, -3.0, 4.0)])
def test_split_keeps_light_and_order(path: ExposedPath, bins: int) -> None:
    parts = split(path, bins)
    assert len(parts) == bins
    light = [float(part.light.sum()) for part in parts]
    np.testing.assert_allclose(light, path.light.sum() / bins, rtol=1e-9)
    # The means of the parts are that of the path, and so are those of what comes before each moment.
    np.testing.assert_allclose(
        sum(part.light @ part.segments.mean(axis=1) for part in parts), path.mean, atol=1e-12
    )
    for b, part in enumerate(parts):
        # But for what rounding leaves of the pieces before and after.
        pieces = part.segments[part.light > 1e-12]
        np.testing.assert_allclose(pieces[0, 0], place(path, b / bins, after=True), atol=1e-7)
        np.testing.assert_allclose(pieces[-1, 1], place(path, (b + 1) / bins, after=False), atol=1e-7)


def place(path: ExposedPath, share: float, *, after: bool) -> Array:
    """Return where the image is once a share of the light has come in, just after or before."""
    ends = np.cumsum(path.light) / path.light.sum()
    lit = np.flatnonzero(path.light > 0.0)
    if after:
        k = next((k for k in lit if ends[k] > share + 1e-9), lit[-1])
    else:
        k = next((k for k in lit if ends[k] > share - 1e-9), lit[-1])
    inside = (share - (ends[k] - path.light[k] / path.light.sum())) * path.light.sum() / path.light[k]
    begin, end = path.segments[k]
    return np.asarray(begin + np.clip(inside, 0.0, 1.0) * (end - begin))


def test_split_paths_sum_to_the_whole_blur() -> None:
    """Where nothing meets, any number of bins gives the same picture."""
    path = line(0.0, 3.5, -2.25)
    pictures = [merged([thing(bar(RED, 10, 12, NEAR), path)], still(), bins)[0] for bins in (1, 2, 9, 50)]
    for picture in pictures[1:]:
        np.testing.assert_allclose(picture, pictures[0], atol=1e-5)


def test_openings_of_a_multiple_exposure_stay_apart_when_split() -> None:
    """Three bins of three openings: each is one place."""
    del_x = [begin for begin, _ in even_openings(3, 0.2, 0.4)]
    path = ExposedPath(np.array([[[x, 0.0], [x, 0.0]] for x in del_x]), np.full(3, 1.0 / 3.0))
    for part, x in zip(split(path, 3), del_x, strict=True):
        # A third and three rounded thirds may differ in the last bit.
        assert part.light @ part.segments[:, 0, 0] / part.light.sum() == pytest.approx(x, abs=1e-9)


def test_rectangles_that_meet_are_known() -> None:
    """Side by side with less than two pixels between them counts: each blurs over one more."""
    low, high = (
        np.array([[2.0, 2.0], [20.0, 2.0], [2.0, 30.0]]),
        np.array([[4.0, 4.0], [22.0, 4.0], [4.0, 33.0]]),
    )
    assert meeting(low, high).tolist() == [False, False, False]
    right, down = (
        np.array([[14.5, 0.0], [0.0, 0.0], [0.0, 0.0]]),
        np.array([[0.0, 28.0], [0.0, 0.0], [0.0, 0.0]]),
    )
    assert meeting(low, high + right).tolist() == [True, True, False]
    assert meeting(low, high + down).tolist() == [True, False, True]
    # Two go half the way each.
    there, back = (
        np.array([[8.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
        np.array([[0.0, 0.0], [-8.0, 0.0], [0.0, 0.0]]),
    )
    assert meeting(low + back, high + there).tolist() == [True, True, False]
    assert meeting(low[:1], high[:1]).tolist() == [False]
