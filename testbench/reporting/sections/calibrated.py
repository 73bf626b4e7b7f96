"""What a calibration is told by, in its report and its certificate alike."""

from __future__ import annotations

import numpy as np

from testbench.frames import STANDARD_GRAVITY

MILLI_G = 1e3 / STANDARD_GRAVITY
SUFFIXES = {"_mm_s2": "mm/s²", "_mg": "mg", "_deg": "deg", "_ut": "µT"}
"""How names of held-out figures end, and the units that they mean."""


def figure_words(name: str) -> tuple[str, str]:
    """A held-out figure's name in words, and its unit."""
    for suffix, unit in SUFFIXES.items():
        if name.endswith(suffix):
            return name.removesuffix(suffix).replace("_", " ").replace("rms", "RMS"), unit
    return name.replace("_", " "), ""


def gravity_errors(readings: np.ndarray) -> np.ndarray:
    """How far mean readings are from the length of gravity, shape (n,) [mg].

    Args:
        readings: Shape (n, 3) [m/s^2].
    """
    return (np.linalg.norm(readings, axis=1) - STANDARD_GRAVITY) * MILLI_G


def sentence(remark: str) -> str:
    """A remark as a sentence."""
    return f"{remark[:1].upper()}{remark[1:].rstrip('.')}."
