"""Memory that nothing uses any more goes back to the system between pieces of work on hours."""

from __future__ import annotations

import ctypes
import sys

import pyarrow as pa


def give_back() -> None:
    """Give memory that is free back to the system.

    The C library keeps what is freed of arrays of up to 32 MB, which those of a few hours are
    (mallopt(3), M_MMAP_THRESHOLD), and so does Arrow: 0.7 GB beside 0.2 GB in use were seen.
    Elsewhere than on glibc nothing is known of that, and nothing is done.
    """
    pa.default_memory_pool().release_unused()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
