"""Filters of the user's own: classes in a Python file, or installed packages with an entry point.

They are run as code, so that only the command line and Python programs can name them, never a
protocol.
"""

from __future__ import annotations

import importlib.util
import inspect
import re
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TypeGuard

from testbench.estimation.filters import FILTERS, OrientationFilter, get_filter
from testbench.estimation.filters.base import RecursiveFilter
from testbench.estimation.filters.kernel_filter import KernelFilter
from testbench.exceptions import InputError, NotFoundError

GROUP = "testbench.filters"
QUANTITIES = ("gyr", "acc", "mag", "device_q")


def installed_filters() -> dict[str, EntryPoint]:
    """Entry points in the group `testbench.filters`, by name; nothing is imported yet."""
    return {point.name: point for point in entry_points(group=GROUP)}


def find_filter(text: str) -> OrientationFilter:
    """A filter by name, shipped or installed, or by `path/to/file.py:ClassName`.

    Raises:
        NotFoundError: No such filter, or no such class in the file; lists those that exist.
        InputError: The file cannot be imported, or the class is no filter.
    """
    file, colon, name = text.rpartition(":")
    if colon and file.endswith(".py"):
        return _from_class(_class_in(Path(file), name), text)
    if text in FILTERS:
        return get_filter(text)
    installed = installed_filters()
    if text not in installed:
        raise NotFoundError("filter", text, [*FILTERS, *installed])
    try:
        kind = installed[text].load()
    except Exception as error:
        raise InputError(f"the installed filter '{text}' cannot be imported: {error!r}") from None
    return _from_class(kind, f"the entry point '{text}'")


def _class_in(file: Path, name: str) -> object:
    module = _module(file)
    if not hasattr(module, name):
        own = [
            key
            for key, value in vars(module).items()
            if _is_filter(value) and value.__module__ == module.__name__
        ]
        raise NotFoundError(f"class in {file}", name, own)
    return getattr(module, name)


def _module(file: Path) -> ModuleType:
    if not file.is_file():
        raise InputError(f"{file}: the file does not exist")
    spec = importlib.util.spec_from_file_location(f"testbench_user_filter_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses and numba look a class's module up there
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"{file} cannot be imported: {error!r}") from None
    return module


def _is_filter(kind: object) -> TypeGuard[type[OrientationFilter]]:
    abstract = (OrientationFilter, RecursiveFilter, KernelFilter)
    return isinstance(kind, type) and issubclass(kind, OrientationFilter) and kind not in abstract


def _from_class(kind: object, text: str) -> OrientationFilter:
    """An instance of a user's class, once it is known to be a filter that fits the others."""
    if not _is_filter(kind) or inspect.isabstract(kind):
        raise InputError(
            f"{text} is no filter: it must be a class derived from OrientationFilter that has `run`"
        )
    lacking = [key for key in ("name", "needs", "source") if not hasattr(kind, key)]
    if lacking:
        raise InputError(f"{text} lacks {', '.join(lacking)}")
    if not isinstance(kind.name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", kind.name):
        raise InputError(
            f"{text}: the name is {kind.name!r}; it must be small letters, digits and underscores"
        )
    if kind.name in FILTERS and FILTERS[kind.name] is not kind:
        raise InputError(
            f"{text}: '{kind.name}' is the name of a filter of the bench; choose another"
        )
    unknown = [need for need in kind.needs if need not in QUANTITIES]
    if unknown:
        raise InputError(
            f"{text} needs {', '.join(map(str, unknown))}; known: {', '.join(QUANTITIES)}"
        )
    try:
        return kind()
    except Exception as error:
        raise InputError(f"{text} cannot be made: {error!r}") from None
