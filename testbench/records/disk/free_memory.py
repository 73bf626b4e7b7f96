"""Memory that nothing uses any more goes back to the system between pieces of work on hours."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

import pyarrow as pa

LEAST_HELD = 500_000_000
"""A process that holds less gives nothing back [bytes]: its next arrays would ask for it again,
which takes 4 % of the analysis of `quick`.
"""


def give_back() -> None:
    """Give memory that is free back to the system, where a process holds much.

    The C library keeps what is freed of arrays of up to 32 MB, which those of a few hours are
    (mallopt(3), M_MMAP_THRESHOLD), and so does Arrow: 0.7 GB beside 0.2 GB in use were seen.
    Elsewhere than on glibc nothing is known of that, and nothing is done.
    """
    if sys.platform != "linux" or _resident() < LEAST_HELD:
        return
    pa.default_memory_pool().release_unused()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _resident() -> int:
    """Memory that this process holds [bytes]: the second field of statm, in pages (proc(5))."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
