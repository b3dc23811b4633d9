"""How long work still takes, and the words for it."""

from __future__ import annotations

import math

import pytest

from potmesil_addon.progress import TimeLeft, clock_text, progress_text


@pytest.mark.parametrize("start", [0.0, 0.6])
def test_at_a_steady_pace_the_time_left_is_exact(start: float) -> None:
    clock = TimeLeft(100.0, start)
    for tick in range(1, 80):
        now = 100.0 + 0.5 * tick
        clock.update(now, start + (1.0 - start) * tick / 80)
        if tick >= 4:
            assert clock.seconds(now) == pytest.approx(40.0 - 0.5 * tick)


def test_nothing_is_said_before_it_means_something() -> None:
    clock = TimeLeft(0.0)
    clock.update(1.0, 0.5)
    assert clock.seconds(1.0) is None
    clock.update(10.0, 0.049)
    assert clock.seconds(10.0) is None
    clock.update(10.0, 0.05)
    assert clock.seconds(10.0) == pytest.approx(190.0)


def test_a_frame_of_many_means_something() -> None:
    clock = TimeLeft(0.0, least=0.0)
    clock.update(30.0, 0.0)
    assert clock.seconds(30.0) is None
    clock.update(60.0, 1 / 250)
    assert clock.seconds(60.0) == pytest.approx(249 * 60.0)


def test_between_two_updates_the_seconds_run_down_to_0() -> None:
    clock = TimeLeft(0.0)
    clock.update(10.0, 0.5)
    assert [clock.seconds(now) for now in (10.0, 13.0, 19.5, 25.0)] == pytest.approx([10.0, 7.0, 0.5, 0.0])


def test_a_change_of_pace_is_smoothed_with_a_time_constant_of_3_s() -> None:
    clock = TimeLeft(0.0)
    clock.update(10.0, 0.5)  # the end is at 20
    clock.update(13.0, 0.5)  # the mean pace now says 26
    assert clock.seconds(13.0) == pytest.approx(7.0 + 6.0 * (1.0 - math.exp(-1.0)))


def test_what_is_suddenly_done_has_no_time_left() -> None:
    clock = TimeLeft(0.0)
    clock.update(100.0, 0.5)
    clock.update(100.1, 0.99)
    assert clock.seconds(100.1) == pytest.approx(2.0 * 100.1 * 0.01 / 0.99)
    clock.update(100.2, 1.0)
    assert clock.seconds(100.2) == 0.0


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "00:00"), (4.2, "00:05"), (60.0, "01:00"), (3599.5, "1:00:00"), (36_061.0, "10:01:01")],
)
def test_times_are_written_as_blender_does(seconds: float, text: str) -> None:
    assert clock_text(seconds) == text


def test_what_is_not_known_is_not_said() -> None:
    assert progress_text(0.489, None) == "48 %"
    assert progress_text(0.489, 4.5) == "48 %, 00:05 Remaining"
