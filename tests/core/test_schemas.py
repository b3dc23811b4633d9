"""JSON from files: held to a published schema, by a check that agrees with the jsonschema package."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from potmesil_addon import schemas
from potmesil_addon.errors import InputError, SettingsError
from potmesil_addon.lamps import Lamp, lamps_from_json, lamps_to_json
from potmesil_addon.motion import instants_for
from potmesil_addon.paths import CameraPath, MotionPaths, ObjectPath
from potmesil_addon.schemas import JsonError, parse
from potmesil_addon.shutter import (
    Flash,
    ShutterAttributes,
    Slit,
    attributes_from_json,
    attributes_to_json,
    parse_curve,
)

from .helpers import ROOT

TIMES = np.array([-0.5, 0.0, 0.5])
MATRICES = np.repeat(np.eye(3, 4)[np.newaxis], 3, axis=0)
BOX = np.array([[-1.0] * 3, [1.0] * 3])
PATHS = MotionPaths(
    CameraPath(TIMES[1:2], MATRICES[:1]), (ObjectPath("Ball", 3, TIMES, MATRICES, BOX, deforming=True),)
)
SHUTTER = ShutterAttributes(
    frames=0.5,
    position="end",
    curve=((0.0, 0.0), (1.0, 1.0)),
    openings=((0.0, 0.2), (0.4, 0.6)),
    blade_time=0.1,
    slit=Slit("top", 0.2),
    flash=Flash("first", 0.5, 0.01, 2),
)
GOOD: dict[str, Any] = {
    "potmesil:motion": json.loads(PATHS.to_json()),
    "potmesil:lamps": json.loads(lamps_to_json((Lamp(np.array([0.0, 1.0, 2.0, 1.0])),))),
    "potmesil:shutter": json.loads(json.dumps(attributes_to_json(SHUTTER))),
    "potmesil:filter": {"pixel_variance": 0.1727, "sample_variance": 0.0},
}


def test_the_published_schema_is_the_one_that_is_checked() -> None:
    published = json.loads((ROOT / "docs" / "samples.schema.json").read_text(encoding="utf-8"))
    assert published["$defs"] == json.loads(json.dumps(schemas.SCHEMAS))


@pytest.mark.parametrize("name", GOOD)
def test_what_is_written_is_as_the_schema_has_it(name: str) -> None:
    assert parse(json.dumps(GOOD[name]), schemas.SCHEMAS[name]) == GOOD[name]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "Expecting value in line 1"),
        ("[1,\n2", "in line 2"),
        ("NaN", "NaN is no number"),
        ("[-Infinity]", "-Infinity is no number"),
        ("1e999", "too large"),
        ("1" * 4001, "too large"),
        ('{"a": 1, "b": {"c": 1, "c": 1}}', "twice"),
        ("[" * 200_000 + "]" * 200_000, "nested too deep"),
        ("[" * 2_000_000, "too many"),
        ("[" + "0," * 9_000_000 + "0]", "too many"),
        (" " * (schemas.MOST_CHARACTERS + 1), "too long"),
    ],
    ids=lambda value: value[:20],
)
def test_text_that_is_refused(text: str, match: str) -> None:
    with pytest.raises(JsonError, match=match):
        parse(text)


@pytest.mark.parametrize(
    ("place", "value", "where"),
    [
        (("camera", "times"), [], r"camera\.times has a wrong number"),
        (("camera", "times"), [True], r"camera\.times\[0\] must be of type number"),
        (("camera", "times"), ["0"], r"camera\.times\[0\]"),
        (("camera", "matrices"), [[1.0] * 11], r"camera\.matrices\[0\] has a wrong number of items: 11"),
        (("camera", "matrices"), [[1e16] * 12], r"camera\.matrices\[0\] is out of range"),
        (("objects", 0, "index"), 0.5, r"objects\[0\]\.index must be of type integer"),
        (("objects", 0, "deforming"), 1, r"objects\[0\]\.deforming"),
        (("objects", 0, "name"), None, r"objects\[0\]\.name"),
        (("version",), True, "version must be 1"),
    ],
)
def test_messages_say_where(place: tuple[Any, ...], value: Any, where: str) -> None:
    values = copy.deepcopy(GOOD["potmesil:motion"])
    *way, last = place
    inner = values
    for step in way:
        inner = inner[step]
    inner[last] = value
    with pytest.raises(JsonError, match=where):
        parse(json.dumps(values), schemas.MOTION)
    with pytest.raises(InputError, match="damaged"):
        MotionPaths.from_json(json.dumps(values))


def containers(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every container in a value with each of its keys."""
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from containers(value[key])


scalars = (
    st.none()
    | st.booleans()
    | st.integers(-3, 3)
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from(["top", "center", "first", "", 1.0, 0.0, 1e15, -1e15])
    | st.text(max_size=3)
)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("name", GOOD)
@given(data=st.data(), value=anything, change=st.sampled_from(["set", "delete", "repeat"]))
def test_the_check_agrees_with_jsonschema(name: str, data: Any, value: Any, change: str) -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="the package jsonschema is not installed")
    values = copy.deepcopy(GOOD[name])
    container, key = data.draw(st.sampled_from(list(containers(values))))
    if change == "delete":
        del container[key]
    elif change == "repeat" and isinstance(container, list):
        container.append(container[key])
    else:
        container[key] = value
    said = jsonschema.Draft202012Validator(schemas.SCHEMAS[name]).is_valid(values)
    try:
        parse(json.dumps(values), schemas.SCHEMAS[name])
        own = True
    except JsonError as error:
        own = False
        assert str(error).isprintable()  # noqa: PT017
    assert own == said


@given(value=anything, data=st.data())
def test_any_json_is_read_or_announced(value: Any, data: Any) -> None:
    for name, read, announced in (
        ("potmesil:motion", MotionPaths.from_json, InputError),
        ("potmesil:lamps", lamps_from_json, InputError),
        ("potmesil:shutter", parse_curve, SettingsError),
        ("potmesil:shutter", lambda text: attributes_from_json(parse(text, schemas.SHUTTER)), ValueError),
    ):
        values = copy.deepcopy(GOOD[name])
        container, key = data.draw(st.sampled_from(list(containers(values))))
        container[key] = value
        for text in (json.dumps(value), json.dumps(values)):
            try:
                read(text)
            except announced:
                continue


@pytest.mark.parametrize(
    ("camera", "thing"),
    [
        ([1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0], [1e-40, 0, 0, 0, 0, 1e-40, 0, 0, 0, 0, 1e-40, 0]),
        # Each can be inverted, their product not in floating point; processing ended in a traceback.
        (
            [24.0, 0, -1e15, 0, 100.0, 24.0, 12.0, 0, 0, 0, 1.0, 0],
            [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 1e15, 1.0, 0],
        ),
    ],
)
def test_what_cannot_be_inverted_is_damaged(camera: list[float], thing: list[float]) -> None:
    values = copy.deepcopy(GOOD["potmesil:motion"])
    values["camera"]["matrices"] = [camera]
    values["objects"][0]["matrices"] = [thing] * 3
    with pytest.raises(InputError, match="damaged"):
        MotionPaths.from_json(json.dumps(values))


@pytest.mark.parametrize("length", [math.inf, math.nan, 1e300])
def test_ways_of_no_length_have_the_most_instants(length: float) -> None:
    assert instants_for(length) == instants_for(1e6)


def test_numbers_are_finite_all_the_way() -> None:
    values = copy.deepcopy(GOOD["potmesil:motion"])
    values["camera"]["matrices"] = [[1e15, *[0.0] * 4, 1e15, *[0.0] * 4, 1e15, 1e15]]
    path = MotionPaths.from_json(json.dumps(values))
    assert math.isfinite(float(np.abs(path.reprojection(path.objects[0], 0.25)).max()))
