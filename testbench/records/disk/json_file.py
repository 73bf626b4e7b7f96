"""JSON as a person can read it, from dataclasses and arrays too."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from testbench.exceptions import SessionError
from testbench.records.disk.replacing import write_text

LARGEST_JSON = 200_000_000
"""Bytes of a JSON file that is read; evaluations of the longest campaigns are a tenth of it."""


def write_json(path: Path, data: Any) -> None:
    """Write readable JSON in one step; see `json_text`."""
    write_text(path, json_text(data))


def json_text(data: Any) -> str:
    """Readable JSON of mappings, lists, dataclasses, arrays and numbers, one value a line.

    NaN becomes null, as JSON wants.
    """
    try:
        return orjson.dumps(data, default=_plain, option=_READABLE).decode() + "\n"
    except orjson.JSONEncodeError:  # an integer beyond 64 bits, or a file's name that is no text
        return json.dumps(_plain_tree(data), indent=2, allow_nan=False) + "\n"


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        SessionError: The file is missing or not JSON.
    """
    try:
        if path.stat().st_size > LARGEST_JSON:
            raise SessionError(
                f"{path} has {path.stat().st_size} bytes, more than the {LARGEST_JSON} allowed"
            )
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


def plain_values(value: Any) -> Any:
    """The value as JSON knows it: mappings, lists and numbers, of dataclasses and arrays, too.

    NaN becomes null.
    """
    return json.loads(json_text(value))


_READABLE = orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS


def _plain(value: Any) -> Any:
    """What orjson does not know by itself."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in JSON")


def _plain_tree(value: Any) -> Any:
    """The same without orjson."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain_tree(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain_tree(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain_tree(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
