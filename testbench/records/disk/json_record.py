"""Results as JSON on disk: dataclasses, read back and checked by their types."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BeforeValidator, ConfigDict, PlainValidator, TypeAdapter, ValidationError

from testbench.exceptions import SessionError
from testbench.records.disk.json_file import read_json
from testbench.records.disk.yaml_file import dotted, fault_sentence

T = TypeVar("T")

AS_WRITTEN = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
"""Of a dataclass that is read back, and of those in it: no key that it does not know."""


def _number(value: Any) -> Any:
    return float("nan") if value is None else value


def _array(value: Any) -> np.ndarray:
    try:
        return np.array(value, dtype=float)  # None becomes NaN
    except TypeError:
        raise ValueError("these are no numbers") from None


Number = Annotated[float, BeforeValidator(_number)]
"""A number, NaN where it is not known; JSON has no NaN, and null stands for it."""
Array = Annotated[np.ndarray, PlainValidator(_array)]
"""An array of such numbers, of whatever shape."""


def read_record(
    file: Path,
    kind: TypeAdapter[T],
    version: int,
    remedy: str,
    upgrade: Callable[[dict[str, Any]], None] | None = None,
) -> T:
    """Read a result.

    Args:
        file: JSON, with the version of its schema.
        kind: What it holds.
        version: Of the schema, that is read.
        remedy: What to do where it cannot be read.
        upgrade: Brings what an earlier version of the bench wrote into the form of this one, in
            place; None where none is needed.

    Raises:
        SessionError: It is missing or damaged, or was written by another version.
    """
    data = read_json(file)
    if not isinstance(data, dict):
        raise SessionError(f"{file} is damaged: it is no mapping; {remedy}")
    found = data.pop("schema_version", None)
    if found != version:
        raise SessionError(
            f"{file} is of schema {found!r:.50}; this version reads {version}: {remedy}"
        )
    if upgrade is not None:
        upgrade(data)
    try:
        return kind.validate_python(data)
    except ValidationError as error:
        raise SessionError(
            f"{file} is damaged or was written by another version, at {first_problem(error)}; "
            f"{remedy}"
        ) from None


def first_problem(error: ValidationError) -> str:
    """Where the first of the problems lies, and what it is, in a line."""
    fault = error.errors(include_url=False)[0]
    place = dotted(fault["loc"])[:200] or "its top"
    return f"{place}: {fault_sentence(fault)[:200]}"
