"""Shutters against numeric integration of their openness, and what is said of them in text and files."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon.errors import SettingsError
from potmesil_addon.shutter import (
    SHUTTER_POSITIONS,
    SLIT_EDGES,
    Curve,
    Flash,
    Openings,
    Shutter,
    ShutterAttributes,
    Slit,
    attributes_from_json,
    attributes_to_json,
    even_openings,
    parse_curve,
    parse_openings,
    rotary_slit,
)

Array = npt.NDArray[np.float64]

TRIANGLE: Curve = ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0))


def openness(shutter: Shutter, position: Array) -> Array:
    """Return the light at positions, straight from the definitions."""
    whole = max([1.0, *(end for _, end in shutter.openings)])
    light = np.zeros_like(position)
    for begin, end in shutter.openings or ((0.0, 1.0),):
        inside = (position >= begin / whole) & (position <= end / whole)
        radius = np.ones_like(position)
        if shutter.blade_time > 0.0:
            blades = shutter.blade_time * min(end - begin, 1.0) / whole
            edge = np.minimum(position - begin / whole, end / whole - position)
            radius = np.clip(edge / blades, 0.0, 1.0)
        light = np.where(inside, radius**2, light)
    if shutter.curve:
        light = light * np.interp(position, *zip(*shutter.curve, strict=True))
    return light


def integrated(shutter: Shutter, count: int = 400_000) -> tuple[Array, Array]:
    """Return positions and the share of the light until each, by the midpoint rule."""
    edges = np.linspace(0.0, 1.0, count + 1)
    light = np.cumsum(openness(shutter, 0.5 * (edges[1:] + edges[:-1])))
    return edges, np.concatenate([[0.0], light / light[-1]])


SHUTTERS = {
    "open": Shutter(),
    "triangle": Shutter(curve=TRIANGLE),
    "not to the ends": Shutter(curve=((0.2, 0.1), (0.7, 0.9))),
    "dark in the middle": Shutter(curve=((0, 1), (0.3, 0), (0.6, 0), (1, 1))),
    "blades": Shutter(blade_time=0.2),
    "blades all the time": Shutter(blade_time=0.5, curve=((0, 1), (1, 0.2))),
    "openings": Shutter(openings=((0.0, 0.2), (0.4, 0.6), (0.8, 1.0))),
    "figure 7d": Shutter(frames=2.0, openings=even_openings(5, 0.2, 0.4)),
    "openings under a curve": Shutter(openings=((0.1, 0.3), (0.5, 1.7)), curve=TRIANGLE),
    "openings with blades": Shutter(openings=((0.1, 0.3), (0.5, 1.7)), blade_time=0.25),
}

every_shutter = pytest.mark.parametrize("shutter", SHUTTERS.values(), ids=SHUTTERS.keys())


@every_shutter
def test_shares_of_light_and_their_times_are_integrals(shutter: Shutter) -> None:
    # The blades' parabola is kept as 32 straight pieces.
    tolerance = 3e-4 if shutter.blade_time else 2e-5
    edges, light = integrated(shutter)
    for begin, end in ((0.0, 0.13), (0.13, 0.52), (0.4, 0.41), (0.7, 1.0), (0.0, 1.0)):
        expected = np.interp(end, edges, light) - np.interp(begin, edges, light)
        assert shutter.light(begin, end) == pytest.approx(expected, abs=tolerance)
    shares = np.linspace(0.0, 1.0, 101)
    at = shutter.times(shares)
    assert (np.diff(at) >= 0.0).all()
    assert np.interp(at, edges, light) == pytest.approx(shares, abs=tolerance)


@every_shutter
@given(share=st.floats(0.0, 1.0))
def test_times_inverts_light(shutter: Shutter, share: float) -> None:
    at = float(shutter.times(share))
    assert 0.0 <= at <= 1.0
    assert shutter.light(0.0, at) == pytest.approx(share, abs=1e-12)


@every_shutter
@given(cuts=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6))
def test_light_adds_up(shutter: Shutter, cuts: list[float]) -> None:
    edges = [0.0, *sorted(cuts), 1.0]
    parts = [shutter.light(a, b) for a, b in pairwise(edges)]
    assert min(parts) >= -1e-15
    assert math.fsum(parts) == pytest.approx(1.0, abs=1e-12)


def test_no_share_falls_between_openings() -> None:
    shutter = SHUTTERS["openings"]
    at = shutter.times(np.linspace(0.0, 1.0, 1000))
    assert not ((at > 0.2) & (at < 0.4)).any()
    assert not ((at > 0.6) & (at < 0.8)).any()
    assert shutter.light(0.2, 0.4) == 0.0


def test_times_keep_their_shape_and_clip() -> None:
    shutter = Shutter()
    assert shutter.times(0.25).shape == ()
    assert shutter.times([[0.0, 0.5], [1.0, 2.0]]).tolist() == [[0.0, 0.5], [1.0, 1.0]]
    assert float(shutter.times(-1.0)) == 0.0


@pytest.mark.parametrize(("position", "begin"), [("start", 0.0), ("center", -0.3), ("end", -0.6)])
def test_where_the_frame_lies(position: Any, begin: float) -> None:
    shutter = Shutter(frames=0.6, position=position)
    assert shutter.interval == pytest.approx((begin, begin + 0.6))
    assert shutter.length == 0.6
    assert shutter.frame_times([0.0, 0.5, 1.0]) == pytest.approx([begin, begin + 0.3, begin + 0.6])


def test_openings_lengthen_the_interval() -> None:
    assert Shutter(frames=2.0, openings=((0.0, 0.5),)).length == 2.0
    figure = SHUTTERS["figure 7d"]
    assert figure.length == pytest.approx(3.6)
    assert [figure.light(2 * n / 9, (2 * n + 1) / 9) for n in range(5)] == pytest.approx([0.2] * 5)


def test_blades_open_the_radius_evenly() -> None:
    shutter = Shutter(blade_time=0.25)
    assert shutter.opening([0.0, 0.125, 0.25, 0.5, 0.75, 0.875, 1.0]) == pytest.approx(
        [0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0]
    )
    # The parabola has a third of the light that an open aperture lets in meanwhile.
    assert shutter.light(0.25, 0.75) == pytest.approx(0.5 / (0.5 + 2.0 * 0.25 / 3.0), abs=1e-3)
    assert Shutter().opening([0.0, 1.0]).tolist() == [1.0, 1.0]
    between = Shutter(openings=((0.0, 0.4), (0.6, 1.0)), blade_time=0.25)
    assert between.opening([0.5, 0.2, 0.65]) == pytest.approx([0.0, 1.0, 0.5])


def test_a_slit_puts_each_place_at_its_own_time_as_cycles_does() -> None:
    shutter = Shutter(frames=2.0, position="start", slit=Slit("top", 0.25))
    # The first line is exposed in the first quarter, the last line in the last.
    assert shutter.frame_times([0.0, 1.0], 0.0) == pytest.approx([0.0, 0.5])
    assert shutter.frame_times([0.0, 1.0], 1.0) == pytest.approx([1.5, 2.0])
    assert shutter.frame_times([0.0, 1.0]) == pytest.approx([0.75, 1.25])
    # An instant for each line, and all lines at once.
    line = np.linspace(0.0, 1.0, 5)
    assert replace(shutter, slit=Slit("left", 0.0)).frame_times(0.3, line) == pytest.approx(2.0 * line)
    assert replace(shutter, slit=Slit("left", 1.0)).frame_times(0.3, line) == pytest.approx([0.6] * 5)
    grid = shutter.frame_times(np.zeros((4, 1)), line)
    assert grid.shape == (4, 5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"frames": -0.1}, "0 to 10000 frames"),
        ({"frames": math.nan}, "0 to 10000 frames"),
        ({"frames": math.inf}, "0 to 10000 frames"),
        ({"position": "middle"}, "start, center, end, not 'middle'"),
        ({"blade_time": 0.6}, "0 to 0.5"),
        ({"blade_time": -0.1}, "0 to 0.5"),
        ({"blade_time": math.nan}, "0 to 0.5"),
        ({"curve": ((0, 0), (1, 0))}, "raise it"),
        ({"curve": ((0.0, 1.0),)}, "two or more"),
        ({"curve": ((1.0, 1.0), (0.0, 1.0))}, "in order"),
        ({"curve": ((0.0, 2.0), (1.0, 1.0))}, "from 0 to 1"),
        ({"curve": ((0.0, math.nan), (1.0, 1.0))}, "from 0 to 1"),
        ({"openings": ((0.4, 0.2),)}, "without overlap"),
        ({"openings": ((0.0, 0.5), (0.4, 0.8))}, "without overlap"),
        ({"openings": ((-0.1, 0.5),)}, "without overlap"),
        ({"openings": ((0.0, math.inf),)}, "without overlap"),
        ({"openings": ((math.nan, 1.0),)}, "without overlap"),
        ({"openings": ((0.0, 0.4),), "curve": ((0.5, 0.0), (1.0, 1.0))}, "raise it"),
    ],
)
def test_shutters_that_cannot_be(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        Shutter(**settings)


@pytest.mark.parametrize(("edge", "width"), [("middle", 0.1), ("top", 1.1), ("top", -0.1), ("top", math.nan)])
def test_slits_that_cannot_be(edge: Any, width: float) -> None:
    with pytest.raises(SettingsError, match="slit"):
        Slit(edge, width)


def test_a_shutter_of_no_frames_is_an_instant() -> None:
    shutter = Shutter(frames=0.0)
    assert shutter.interval == (0.0, 0.0)
    assert shutter.frame_times([0.0, 1.0]).tolist() == [0.0, 0.0]


def test_blades_of_a_shutter_of_no_frames() -> None:
    shutter = Shutter(frames=0.0, blade_time=0.2)
    assert shutter.times([0.0, 0.5, 1.0]) == pytest.approx([0.0, 0.5, 1.0])


@pytest.mark.parametrize("step", [((0, 0), (0.5, 0), (0.5, 1), (1, 1)), ((0, 1), (0.5, 1), (0.5, 0), (1, 0))])
def test_a_curve_may_step(step: Curve) -> None:
    lit = (0.5, 1.0) if step[0][1] == 0 else (0.0, 0.5)
    shutter = Shutter(curve=step)
    assert shutter.light(*lit) == pytest.approx(1.0)
    assert shutter.times(0.5) == pytest.approx(0.5 * sum(lit))


# --- text -------------------------------------------------------------------------------------------------


def test_openings_are_read() -> None:
    assert parse_openings("0:0.2,0.4:0.6") == ((0.0, 0.2), (0.4, 0.6))
    assert parse_openings(" 5x0.2@0.4 ") == even_openings(5, 0.2, 0.4)
    assert parse_openings("3x0.1@0.1") == ((0.0, 0.1), (0.1, 0.2), (0.2, 0.3))
    assert parse_openings("0:0.1,0.1:0.2,0.2:0.3") == parse_openings("3x0.1@0.1")
    assert parse_openings("1 : 2") == ((1.0, 2.0),)


@pytest.mark.parametrize(
    "text", ["", "0.2", "0:0.2:0.4", "a:b", "5x@0.4", "5 x 0.2", "-5x0.2@0.4", "0:0.2,", "5xa@1"]
)
def test_text_that_is_no_list_of_openings(text: str) -> None:
    with pytest.raises(SettingsError, match="is no list of exposures"):
        parse_openings(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0x0.2@0.4", "1 to 1000"),
        ("3x0.5@0.4", "without overlap"),
        ("3xnan@0.4", "without overlap"),
        ("3x0.1@inf", "without overlap"),
        ("0.4:0.2", "without overlap"),
        ("0:1e999", "without overlap"),
    ],
)
def test_openings_that_cannot_be(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        parse_openings(text)


def test_a_curve_is_read() -> None:
    assert parse_curve("[[0, 0], [0.5, 1], [1, 0]]") == TRIANGLE


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "5",
        "null",
        '"ab"',
        '{"a": 1}',
        "[1, 2]",
        "[[0, 0, 1]]",
        "[[0, null], [1, 1]]",
        "[[0, 1], [NaN, 1]]",
        "[[0, 1], [Infinity, 1]]",
        "[[0, 1], [1e999, 1]]",
        "[[0, 1], [1" + "0" * 400 + ", 1]]",
        "[" * 100_000,
    ],
)
def test_text_that_is_no_curve(text: str) -> None:
    with pytest.raises(SettingsError, match="is a JSON list"):
        parse_curve(text)


@pytest.mark.parametrize("text", ["[[0, 1]]", "[[1, 1], [0, 1]]"])
def test_curves_that_cannot_be(text: str) -> None:
    with pytest.raises(SettingsError, match="two or more points in order"):
        parse_curve(text)


@given(text=st.one_of(st.text(max_size=30), st.text("0123456789.:x@,eE+- naif", max_size=30)))
def test_any_text_is_openings_or_a_settings_error(text: str) -> None:
    # A count of millions is a list as long.
    if any(len(number) > 4 for number in text.split("x", maxsplit=1)[0].split()):
        return
    try:
        openings = parse_openings(text)
    except SettingsError:
        return
    assert Shutter(openings=openings).length > 0.0


numbers = st.one_of(st.floats(), st.integers(-3, 3), st.none(), st.booleans(), st.text(max_size=3))


@given(value=st.recursive(numbers, lambda inner: st.lists(inner, max_size=4), max_leaves=12))
def test_any_json_is_a_curve_or_a_settings_error(value: Any) -> None:
    try:
        curve = parse_curve(json.dumps(value))
    except SettingsError:
        return
    assert all(0.0 <= number <= 1.0 for point in curve for number in point)


# --- attributes -------------------------------------------------------------------------------------------


times = st.floats(0.0, 1.0)
attributes = st.builds(
    ShutterAttributes,
    frames=st.none() | st.floats(0.01, 100.0),
    position=st.none() | st.sampled_from(SHUTTER_POSITIONS),
    curve=st.none() | st.just(TRIANGLE) | st.just(((0.0, 0.5), (0.25, 1.0))),
    openings=st.none() | st.just(even_openings(3, 0.2, 0.4)),
    blade_time=st.none() | st.floats(0.0, 0.5),
    slit=st.none() | st.builds(Slit, st.sampled_from(SLIT_EDGES), times),
)


@given(said=attributes)
def test_attributes_survive_json(said: ShutterAttributes) -> None:
    text = json.dumps(attributes_to_json(said))
    assert attributes_from_json(json.loads(text)) == said


def test_what_is_not_said_is_not_written() -> None:
    assert attributes_to_json(ShutterAttributes(exposure_time=0.02, frames_per_second=25.0)) == {}


@pytest.mark.parametrize(
    "values",
    [
        {"frames": -1},
        {"frames": "long"},
        {"frames": [1]},
        {"frames": 1, "position": "middle"},
        {"curve": 5},
        {"frames": 1, "curve": [[0, 0], [1, 0]]},
        {"frames": 1, "openings": [[0.5, 0.2]]},
        {"openings": [[0.5]]},
        {"frames": 1, "blade_time": 0.7},
        {"slit": {"edge": "top"}},
        {"slit": {"edge": "top", "width": 7}},
        {"slit": "top"},
    ],
)
def test_damaged_attributes_are_errors_that_are_announced(values: dict[str, Any]) -> None:
    with pytest.raises((SettingsError, TypeError, ValueError, KeyError)):
        attributes_from_json(values)


@pytest.mark.parametrize("values", [{"position": "middle"}, {"blade_time": 7}, {"curve": [[0, 2], [1, 1]]}])
def test_damaged_attributes_of_no_length(values: dict[str, Any]) -> None:
    with pytest.raises(SettingsError):
        attributes_from_json(values)


def test_a_number_beyond_floats_is_an_error_that_is_announced() -> None:
    with pytest.raises((SettingsError, TypeError, ValueError, KeyError, OverflowError)):
        attributes_from_json(json.loads('{"frames": 1' + "0" * 400 + "}"))


def test_what_is_asked_for_wins_over_the_file() -> None:
    file = ShutterAttributes(frames=0.5, position="end", blade_time=0.1, curve=TRIANGLE)
    asked = ShutterAttributes(position="start")
    assert asked.over(file) == replace(file, position="start")
    assert ShutterAttributes().over(file) == file
    assert file.over(ShutterAttributes()) == file
    # 0 and an empty curve are said.
    none = ShutterAttributes(blade_time=0.0, curve=(), openings=()).over(file)
    assert (none.blade_time, none.curve) == (0.0, ())


def test_seconds_that_are_asked_for_win_over_the_files_frames() -> None:
    file = ShutterAttributes(exposure_time=0.02, frames_per_second=24.0, frames=0.48)
    asked = ShutterAttributes(exposure_time=1.0 / 12.0)
    shutter = asked.over(file).resolve()
    assert shutter is not None
    assert shutter.frames == pytest.approx(2.0)
    both = ShutterAttributes(exposure_time=1.0, frames=0.25).over(file).resolve()
    assert both is not None
    assert both.frames == 0.25


def test_the_length_comes_from_frames_or_from_seconds() -> None:
    assert ShutterAttributes().resolve() is None
    assert ShutterAttributes(exposure_time=0.02).resolve() is None
    assert ShutterAttributes(frames_per_second=25.0).resolve() is None
    assert ShutterAttributes(exposure_time=0.02, frames_per_second=25.0).resolve() == Shutter(frames=0.5)
    assert ShutterAttributes(frames=0.0).resolve() == Shutter(frames=0.0)
    slit = Slit("left", 0.3)
    full = ShutterAttributes(None, None, 1.5, "end", TRIANGLE, ((0.0, 1.0),), 0.2, slit)
    assert full.resolve() == Shutter(1.5, "end", TRIANGLE, ((0.0, 1.0),), 0.2, slit)
    with pytest.raises(SettingsError, match="0 to 10000 frames"):
        ShutterAttributes(frames=-1.0).resolve()


FLASHED = [
    (Shutter(flash=Flash("first", 0.4, 0.02)), [(0.0, 0.02)]),
    (Shutter(flash=Flash("second", 0.4, 0.02)), [(0.98, 1.0)]),
    (Shutter(flash=Flash("first", 0.7, 0.05, 4)), [(0.0, 0.05), (0.25, 0.3), (0.5, 0.55), (0.75, 0.8)]),
    (Shutter(flash=Flash("second", 1.0, 0.1, 2)), [(0.4, 0.5), (0.9, 1.0)]),
    (Shutter(curve=TRIANGLE, flash=Flash("second", 0.5, 0.2)), [(0.8, 1.0)]),
    (Shutter(blade_time=0.2, flash=Flash("first", 0.3, 0.1)), [(0.2, 0.3)]),
    (Shutter(blade_time=0.2, flash=Flash("second", 0.3, 0.1)), [(0.7, 0.8)]),
    (Shutter(openings=even_openings(3, 0.2, 0.4), flash=Flash("second", 0.5, 0.1)), [(0.9, 1.0)]),
]


@pytest.mark.parametrize(("shutter", "flashes"), FLASHED)
def test_a_flash_adds_its_share_to_the_ambient_light(
    shutter: Shutter, flashes: list[tuple[float, float]]
) -> None:
    flash = shutter.flash
    assert flash is not None
    ambient = replace(shutter, flash=None)
    edges = np.linspace(0.0, 1.0, 41)
    for begin, end in pairwise(edges.tolist()):
        lit = sum(max(0.0, min(end, stop) - max(begin, start)) for start, stop in flashes)
        whole = sum(stop - start for start, stop in flashes)
        wanted = flash.share * lit / whole + (1.0 - flash.share) * ambient.light(begin, end)
        assert shutter.light(begin, end) == pytest.approx(wanted, abs=1e-9)
    # Shares of the light come in when all before has come in.
    shares = np.linspace(0.001, 0.999, 99)
    times = shutter.times(shares)
    assert [shutter.light(0.0, t) for t in times.tolist()] == pytest.approx(shares.tolist(), abs=1e-9)


def test_no_flash_fires_while_the_shutter_is_shut() -> None:
    shutter = Shutter(openings=((0.0, 0.2), (0.8, 1.0)), flash=Flash("first", 1.0, 0.02, 4))
    times = shutter.times((np.arange(400) + 0.5) / 400)
    starts = (0.0, 0.1, 0.8, 0.9)
    assert [((times >= a) & (times <= a + 0.02)).mean() for a in starts] == pytest.approx([0.25] * 4)
    # One that would go on past the end of an opening fires a little earlier.
    tight = Shutter(openings=((0.0, 0.2), (0.8, 1.0)), flash=Flash("second", 1.0, 0.15, 1))
    assert tight.times([0.0, 1.0]) == pytest.approx([0.85, 1.0])
    with pytest.raises(SettingsError, match="when the flash fires"):
        Shutter(curve=((0.0, 1.0), (0.4, 1.0), (0.5, 0.0), (1.0, 0.0)), flash=Flash("second"))


def test_a_strobe_without_ambient_light_shows_distinct_moments() -> None:
    strobe = Shutter(flash=Flash("first", 1.0, 0.001, 5))
    times = strobe.times((np.arange(500) + 0.5) / 500)
    assert np.unique(np.rint(times * 5.0)).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.abs(times * 5.0 - np.rint(times * 5.0)).max() <= 0.005 + 1e-9


def test_without_its_share_a_flash_is_none() -> None:
    for shutter in (Shutter(), Shutter(curve=TRIANGLE), Shutter(blade_time=0.3)):
        assert np.array_equal(shutter.pieces(), replace(shutter, flash=Flash(share=0.0)).pieces())


WRONG_FLASHES: list[dict[str, Any]] = [
    {"curtain": "third"},
    {"share": -0.1},
    {"share": 1.1},
    {"share": math.nan},
    {"duration": 0.0},
    {"duration": 1.5},
    {"count": 0},
    {"count": 10_000},
    {"count": 20, "duration": 0.1},
]


@pytest.mark.parametrize("values", WRONG_FLASHES)
def test_wrong_flashes_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(SettingsError):
        Flash(**values)


def test_a_flash_needs_the_whole_film() -> None:
    with pytest.raises(SettingsError, match="uncovered at once"):
        Shutter(slit=Slit("top", 0.2), flash=Flash())
    assert Shutter(slit=Slit("top", 1.0), flash=Flash()).light(0.99, 1.0) > 0.5
    with pytest.raises(SettingsError, match="never open"):
        Shutter(blade_time=0.5, flash=Flash())


def test_a_flash_survives_a_file_and_can_be_switched_off() -> None:
    attributes = ShutterAttributes(frames=0.5, flash=Flash("first", 0.25, 0.02, 3))
    text = json.dumps(attributes_to_json(attributes))
    assert attributes_from_json(json.loads(text)) == attributes
    off = ShutterAttributes(flash=Flash(share=0.0)).over(attributes).resolve()
    assert off is not None
    assert np.array_equal(off.pieces(), Shutter(frames=0.5).pieces())
    with pytest.raises((TypeError, ValueError, KeyError)):
        attributes_from_json({"flash": {"curtain": "first", "share": 0.5, "duration": 0.1, "count": 1.5}})


@pytest.mark.parametrize("angle", [45.0, 172.8, 180.0])
def test_a_rotary_disc_exposes_each_row_for_its_angle(angle: float) -> None:
    """A point at s of the gate is uncovered while the disc's opening is over it, as the disc turns."""
    gate = math.radians(40.0)
    frames, slit = rotary_slit(angle / 360.0, gate)
    shutter = Shutter(frames=frames, position="start", slit=slit)
    for along in (0.0, 0.3, 1.0):
        begin, end = shutter.frame_times([0.0, 1.0], along)
        assert end - begin == pytest.approx(angle / 360.0)
        assert begin == pytest.approx(along * 40.0 / 360.0)


@pytest.mark.parametrize("openings", [((0.0, 2.1e-321), (0.4, 0.6)), ((0.0, 1.0), (2.0, 1e300))])
def test_openings_too_short_for_numbers_are_none(openings: Openings) -> None:
    """Found by fuzzing: the blades' way over such a time was infinite."""
    with pytest.raises(SettingsError, match="Exposures"):
        Shutter(openings=openings, blade_time=0.1)
