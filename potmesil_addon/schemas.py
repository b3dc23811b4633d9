"""What JSON text from a file may say: the schemas of the ``potmesil:`` attributes, and the check.

The schemas are JSON Schema (draft 2020-12). The check knows the few of its words that they use.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NoReturn, TypeAlias

Schema: TypeAlias = Mapping[str, Any]

MOST_CHARACTERS: Final = 1 << 25
MOST_CONTAINERS: Final = 1 << 20
MOST_VALUES: Final = 1 << 23
"""Objects and lists, and values in them, of one text: Python takes 20 times the memory of the text."""

_MOST_DIGITS: Final = 4000
_LARGEST: Final = 1e15
"""Metres, or pixels times metres, that no scene reaches; products of matrices of such numbers are finite."""

_MOST_FRAMES: Final = 1e6

_NUMBER: Final[Schema] = {"type": "number", "minimum": -_LARGEST, "maximum": _LARGEST}


def _list_of(items: Schema, least: int, most: int) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


def _object_of(required: Sequence[str], **properties: Schema) -> dict[str, Any]:
    return {"type": "object", "required": list(required), "properties": properties}


_TRACK: Final = {
    "times": _list_of({"type": "number", "minimum": -_MOST_FRAMES, "maximum": _MOST_FRAMES}, 1, 100_000),
    "matrices": _list_of(_list_of(_NUMBER, 12, 12), 1, 100_000),
}

_SHARE: Final = {"minimum": 0, "maximum": 1}
_PAIRS: Final = _list_of(_list_of(_NUMBER, 2, 2), 0, 100_000)

MOTION: Final[Schema] = _object_of(
    ("version", "camera", "objects"),
    version={"const": 1},
    camera=_object_of(("times", "matrices"), **_TRACK),
    objects=_list_of(
        _object_of(
            ("name", "index", "box", "deforming", "times", "matrices"),
            name={"type": "string"},
            index={"type": "integer", "minimum": -(2**32), "maximum": 2**32},
            box=_list_of(_list_of(_NUMBER, 3, 3), 2, 2),
            deforming={"type": "boolean"},
            **_TRACK,
        ),
        0,
        100_000,
    ),
)

LAMPS: Final[Schema] = _object_of(
    ("version", "places"), version={"const": 1}, places=_list_of(_list_of(_NUMBER, 4, 4), 0, 100_000)
)

CURVE: Final[Schema] = _PAIRS

SHUTTER: Final[Schema] = _object_of(
    (),
    frames={"type": ["number", "null"], "exclusiveMinimum": 0, "maximum": _LARGEST},
    position={"enum": ["start", "center", "end", None]},
    curve={**_PAIRS, "type": ["array", "null"]},
    openings={**_PAIRS, "type": ["array", "null"], "maxItems": 1000},
    blade_time={"type": ["number", "null"], "minimum": 0, "maximum": 0.5},
    slit={
        **_object_of(
            ("edge", "width"),
            edge={"enum": ["top", "bottom", "left", "right"]},
            width={"type": "number", **_SHARE},
        ),
        "type": ["object", "null"],
    },
    flash={
        **_object_of(
            ("curtain", "share", "duration", "count"),
            curtain={"enum": ["first", "second"]},
            share={"type": "number", **_SHARE},
            duration={"type": "number", "exclusiveMinimum": 0, "maximum": 1},
            count={"type": "integer", "minimum": 1, "maximum": 1000},
        ),
        "type": ["object", "null"],
    },
)

FILTER: Final[Schema] = _object_of(
    ("pixel_variance", "sample_variance"),
    pixel_variance={"type": "number", "minimum": 0, "maximum": _LARGEST},
    sample_variance={"type": "number", "minimum": 0, "maximum": _LARGEST},
)

SCHEMAS: Final[Mapping[str, Schema]] = {
    "potmesil:motion": MOTION,
    "potmesil:lamps": LAMPS,
    "potmesil:shutter": SHUTTER,
    "potmesil:filter": FILTER,
}
"""By attribute."""


class JsonError(ValueError):
    """A text is no JSON, or not what it should be; the message says where."""


def parse(text: str, schema: Schema | None = None) -> Any:
    """Return the value of a JSON text.

    Parameters
    ----------
    text : str
        JSON as the standard has it: numbers are finite, and no key stands twice in an object.
    schema : mapping, optional
        What it must be.

    Returns
    -------
    object
        Of dict, list, str, int, float, bool and None.

    Raises
    ------
    JsonError
        If it is not so, or too long.
    """
    if len(text) > MOST_CHARACTERS:
        raise JsonError("it is too long")
    if text.count("[") + text.count("{") > MOST_CONTAINERS or text.count(",") > MOST_VALUES:
        raise JsonError("it holds too many values")
    try:
        value = json.loads(
            text,
            parse_constant=_no_constant,
            parse_float=_finite,
            parse_int=_whole,
            object_pairs_hook=_without_doubles,
        )
    except JsonError:
        raise
    except json.JSONDecodeError as error:
        raise JsonError(f"{error.msg} in line {error.lineno}") from None
    except RecursionError:
        raise JsonError("it is nested too deep") from None
    except ValueError as error:
        raise JsonError(str(error)) from None
    if schema is not None:
        check(value, schema)
    return value


def check(value: Any, schema: Schema, where: str = "the text") -> None:
    """Raise for a value that is not as a schema has it.

    Parameters
    ----------
    value : object
        From `parse`.
    schema : mapping
        JSON Schema of these words: type, const, enum, minimum, exclusiveMinimum, maximum, minItems, maxItems,
        items, required and properties.
    where : str
        What the value is, for the message.

    Raises
    ------
    JsonError
        If it is not so.
    """
    kinds = schema.get("type")
    if kinds is not None:
        names = [kinds] if isinstance(kinds, str) else kinds
        if not any(_KINDS[name](value) for name in names):
            raise JsonError(f"{where} must be of type {' or '.join(names)}")
    if "const" in schema and not _same(value, schema["const"]):
        raise JsonError(f"{where} must be {schema['const']}")
    if "enum" in schema and not any(_same(value, choice) for choice in schema["enum"]):
        raise JsonError(f"{where} must be one of {', '.join(map(str, schema['enum']))}")
    if isinstance(value, dict):
        for name in schema.get("required", ()):
            if name not in value:
                raise JsonError(f"{where} must have {name}")
        for name, inner in schema.get("properties", {}).items():
            if name in value:
                check(value[name], inner, f"{where}.{name}" if where != "the text" else name)
    elif isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", math.inf):
            raise JsonError(f"{where} has a wrong number of items: {len(value)}")
        inner = schema.get("items")
        # Numbers at once, as there may be many.
        if inner is not None and inner.get("type") == "number" and set(map(type, value)) <= {int, float}:
            if value:
                _check_range(min(value), inner, where)
                _check_range(max(value), inner, where)
        elif inner is not None:
            for n, item in enumerate(value):
                check(item, inner, f"{where}[{n}]")
    elif _is_number(value):
        _check_range(value, schema, where)


def _check_range(value: float, schema: Schema, where: str) -> None:
    least, most = schema.get("minimum", -math.inf), schema.get("maximum", math.inf)
    if not least <= value <= most or not value > schema.get("exclusiveMinimum", -math.inf):
        raise JsonError(f"{where} is out of range")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


_KINDS: Final[Mapping[str, Callable[[Any], bool]]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "number": _is_number,
    "integer": lambda value: _is_number(value) and value == math.floor(value),
}


def _same(value: Any, other: Any) -> bool:
    """Return whether two plain values are equal; 1 is 1.0 and not true."""
    return isinstance(value, bool) == isinstance(other, bool) and bool(value == other)


def _no_constant(name: str) -> NoReturn:
    raise JsonError(f"{name} is no number of JSON")


def _finite(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise JsonError("a number is too large")
    return number


def _whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise JsonError("a number is too large")
    return int(text)


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise JsonError("a key stands twice")
    return found
