"""What the command line and JSON files say of special effects, in the units that people type."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, Final, TypeAlias

from . import schemas
from .effects import KINDS, UNITS, check_value
from .errors import InputError, SettingsError
from .keys import parse_keys

_OFF: Final = "off"
_HUGE: Final = 1e300
_MOST_CHARACTERS: Final = 1 << 20
_FLAGS: Final = {"on": True, "true": True, _OFF: False, "false": False}

# For each effect its fields in the core's units; None for one that is off.
Values: TypeAlias = dict[str, dict[str, Any] | None]


def with_options(base: Mapping[str, dict[str, Any] | None], said: Sequence[str], frame: int | None) -> Values:
    """Return effects with what options say of them at a frame.

    Parameters
    ----------
    base : mapping
        The effects without the options, for `effects.effects_from_json`.
    said : sequence of str
        ``star`` switches an effect on, ``star=off`` off, ``star.rotation=30`` sets one of its fields and
        switches it on. Numbers may have keys, as in ``star.rotation=1=0,24=90``.
    frame : int or None
        The frame that keys are looked up at.

    Returns
    -------
    dict
        For `effects.effects_from_json`.

    Raises
    ------
    SettingsError
        If there is no such effect or field, or it cannot have the value.
    """
    found: Values = dict(base)
    for text in said:
        target, given, value = text.partition("=")
        name, dotted, item_name = target.strip().partition(".")
        items = _fields_of(name)
        if not dotted:
            if given and value.strip() != _OFF:
                raise SettingsError(
                    f"'{text}' sets no field; write {name}, {name}=off or {name}.FIELD=VALUE."
                )
            found[name] = None if given else dict(found.get(name) or {})
            continue
        if not given:
            raise SettingsError(f"'{text}' has no value; write {target}=VALUE.")
        item = _field_of(name, item_name, items)
        core = _from_text(f"{name}.{item_name}", value.strip(), item, frame)
        found[name] = {**(found.get(name) or {}), item_name: core}
    return found


def read_effects(path: Path) -> Values:
    """Read effects from a JSON file: ``{"star": {"lines": 4, "rotation": 30}, "grain": {}}``.

    Parameters
    ----------
    path : Path
        The file, with values in the units that people type. An effect of ``null`` is off.

    Returns
    -------
    dict
        For `effects.effects_from_json`.

    Raises
    ------
    InputError
        If the file cannot be read or is no such object.
    SettingsError
        If there is no such effect or field, or it cannot have the value.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(_MOST_CHARACTERS + 1)
        if len(text) > _MOST_CHARACTERS:
            raise InputError(f"'{path}' is too long for a file of effects.")
        values = schemas.parse(text)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror}.") from None
    except schemas.JsonError as error:
        raise InputError(f"'{path}' is no JSON file: {error}.") from None
    except ValueError:
        raise InputError(f"'{path}' is no JSON file.") from None
    if not isinstance(values, dict) or not all(
        said is None or isinstance(said, dict) for said in values.values()
    ):
        raise InputError(f'\'{path}\' must hold an object such as {{"star": {{"lines": 4}}}}.')
    found: Values = {}
    for name, said in values.items():
        items = _fields_of(name)
        found[name] = said and {
            key: _from_json(f"{name}.{key}", value, _field_of(name, key, items))
            for key, value in said.items()
        }
        if said is not None and not said:
            found[name] = {}
    return found


def described() -> list[dict[str, Any]]:
    """Return what there is to set: for each field its name, unit, default, range and what it is.

    Returns
    -------
    list of dict
        Ready for JSON, numbers in the units that people type; ``None`` where there is no limit.
    """
    rows = []
    for name, kind in KINDS.items():
        for item in fields(kind):
            about, unit = item.metadata, item.metadata["unit"]
            limits = [_in_unit(about[end], unit) if "least" in about else None for end in ("least", "most")]
            rows.append(
                {
                    "name": f"{name}.{item.name}",
                    "unit": unit,
                    "default": _in_unit(item.default, unit),
                    "least": limits[0],
                    "most": limits[1],
                    "choices": list(about.get("choices", ())),
                    "about": about["about"],
                }
            )
    return rows


def _in_unit(value: Any, unit: str) -> Any:
    if isinstance(value, bool | str):
        return value
    if isinstance(value, tuple):
        return list(value)
    if isinstance(value, int):
        return value
    # Rounded, since 10 um are 9.999999999999999e-06 m over 1e-6.
    return float(f"{value / UNITS[unit]:.9g}") if math.isfinite(value) else None


def _fields_of(name: str) -> dict[str, Field[Any]]:
    if name not in KINDS:
        raise SettingsError(f"There is no effect {name!r:.80}; there are {', '.join(KINDS)}.")
    return {item.name: item for item in fields(KINDS[name])}


def _field_of(name: str, item_name: str, items: dict[str, Field[Any]]) -> Field[Any]:
    if item_name not in items:
        raise SettingsError(f"'{name}' has no {item_name!r:.80}; it has {', '.join(items)}.")
    return items[item_name]


def _from_text(name: str, text: str, item: Field[Any], frame: int | None) -> Any:
    """Return the value of a field that a word of the command line gives."""
    about = item.metadata
    if "choices" in about or "path" in about:
        return _from_json(name, text, item)
    if "flag" in about:
        if text not in _FLAGS:
            raise SettingsError(f"{name} is on or off, not '{text}'.")
        return _FLAGS[text]
    if "color" in about:
        try:
            return _from_json(name, [float(part) for part in text.split(",")], item)
        except ValueError as error:
            if isinstance(error, SettingsError):
                raise
            raise SettingsError(f"{name} is three numbers such as 1,0.9,0.8, not '{text}'.") from None
    try:
        keys = parse_keys(text)
    except SettingsError as error:
        raise SettingsError(f"{name}: {error}") from None
    if isinstance(item.default, int):
        for value in keys.values:
            _from_json(name, value, item)
        # Between keys whole numbers step.
        return _from_json(name, math.floor(keys.at(frame)), item)
    return _from_json(name, keys.at(frame), item)


def _from_json(name: str, value: Any, item: Field[Any]) -> Any:
    """Return a field's value in the core's units, checked."""
    about = item.metadata
    wrong = SettingsError(f"{name} cannot be {value!r:.80}.")
    if "least" in about:
        if not _is_number(value):
            raise wrong
        if isinstance(item.default, int):
            if not (math.isfinite(value) and float(value).is_integer()):
                raise SettingsError(f"{name} must be a whole number, not {value:g}.")
            value = int(value)
        else:
            value = value * UNITS[about["unit"]]
    elif "flag" in about:
        if not isinstance(value, bool):
            raise wrong
    elif "color" in about:
        if not isinstance(value, list) or not all(map(_is_number, value)):
            raise wrong
        value = tuple(float(v) for v in value)
    elif not isinstance(value, str):
        raise wrong
    check_value(name, value, item)
    return value


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that a float can hold; Python's whole numbers have no end."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isinstance(value, float) or abs(value) < _HUGE
