"""Values with keys: written as text, looked up at frames."""

from __future__ import annotations

import math

import pytest

from potmesil_addon.errors import SettingsError
from potmesil_addon.keys import Keys, parse_keys


def test_a_number_needs_no_frame() -> None:
    keys = parse_keys("2.8")
    assert not keys.animated
    assert keys.at(None) == keys.at(12) == 2.8


def test_keys_go_evenly_and_stay_outside() -> None:
    keys = parse_keys("1=0,11=1,21=1,31=0")
    assert [keys.at(frame) for frame in (-5, 1, 6, 11, 15, 26, 31, 99)] == [0, 0, 0.5, 1, 1, 0.5, 0, 0]


def test_distances_go_evenly_as_the_lens_travels() -> None:
    # Half way between 1 and 3 dioptres.
    assert parse_keys("1=1,3=0.3333333333333333").at(2, "reciprocal") == pytest.approx(0.5)
    assert parse_keys("1=0.5,3=inf").at(2, "reciprocal") == pytest.approx(1.0)
    assert parse_keys("1=inf,3=inf").at(2, "reciprocal") == math.inf


def test_f_stops_go_evenly_in_stops() -> None:
    assert parse_keys("1=2,5=8").at(3, "stops") == pytest.approx(4.0)


@pytest.mark.parametrize("scale", ["even", "reciprocal", "stops"])
def test_values_at_keys_are_exact(scale: str) -> None:
    keys = Keys((1.0, 8.0, 24.0), (0.29, 0.55, 0.98))
    assert [keys.at(frame, scale) for frame in keys.frames] == list(keys.values)


def test_a_value_without_a_place_on_the_scale_goes_evenly() -> None:
    # Left to the settings to refuse, if it is wrong there.
    assert parse_keys("1=0,3=8").at(2, "stops") == 4.0


def test_keys_need_a_frame() -> None:
    with pytest.raises(SettingsError, match="--frames"):
        parse_keys("1=0,2=1").at(None)


@pytest.mark.parametrize("text", ["", "x", "1=", "=1", "1=2=3", "1=0,2", "nan=1,2=3", "1=nan", "inf=1"])
def test_what_is_no_number_and_no_key_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="FRAME=VALUE"):
        parse_keys(text)


@pytest.mark.parametrize("text", ["2=0,1=1", "1=0,1=1"])
def test_frames_must_rise(text: str) -> None:
    with pytest.raises(SettingsError, match="do not rise"):
        parse_keys(text)
