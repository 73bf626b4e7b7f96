"""Compiled kernels on disk, after the program was replaced in place.

Numba keeps an index beside each module with kernels. The types that they were compiled for are
pickled in it, named tuples by module and name of their class; the stamp of the index, date and size
of that one module, is looked at only after it is unpickled. A class that a newer version has moved
is then not found, and the kernel cannot be called (numba 0.68.1, `numba.core.caching`). Here an
entry that cannot be read is no entry: the kernel is compiled again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pickle import UnpicklingError
from typing import Any

from numba.core import caching

UNREADABLE = (AttributeError, ImportError, EOFError, IndexError, UnpicklingError)
"""What unpickling raises on what another version has written, or half of it (docs of `pickle`)."""


def _forgiving(read: Callable[..., Any], nothing: Callable[[], Any]) -> Callable[..., Any]:
    """A method that reads of the cache, and finds nothing where it cannot."""

    @wraps(read)
    def tried(*arguments: Any) -> Any:
        try:
            return read(*arguments)
        except UNREADABLE:
            return nothing()

    return tried


def forgive() -> None:
    """Let every kernel of this process be compiled anew where what is kept of it is unreadable."""
    file = caching.IndexDataCacheFile
    for name, nothing in (("_load_index", dict), ("_load_data", type(None))):
        read = getattr(file, name, None)
        if read is not None and not hasattr(read, "__wrapped__"):
            setattr(file, name, _forgiving(read, nothing))
