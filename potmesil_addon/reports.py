"""Reports: plain values as strict JSON files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from .files import whole_file


def plain(value: Any) -> Any:
    """Return values for strict JSON: NaN and infinity become None.

    Parameters
    ----------
    value : object
        Dictionaries, sequences, texts, numbers and None.

    Returns
    -------
    object
        The same with lists for sequences.
    """
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Write a report as JSON, whole or not at all; NaN and infinity become null.

    Parameters
    ----------
    path : Path
        The file.
    value : dict
        What to write.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with whole_file(path) as part:
        part.write_text(json.dumps(plain(value), indent=2) + "\n", encoding="utf-8")
