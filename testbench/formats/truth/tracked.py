"""What a motion capture system exports: markers, rigid bodies, or both, over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, NotFoundError, Problem
from testbench.formats.truth.number_rows import line_of_row
from testbench.frames import NANOSECONDS
from testbench.records.findings.finding import Finding

METRES = {
    "mm": 1e-3,
    "millimeters": 1e-3,
    "millimetres": 1e-3,
    "cm": 1e-2,
    "centimeters": 1e-2,
    "m": 1.0,
    "meters": 1.0,
    "metres": 1.0,
}
"""Metres of one unit of length, by its name in small letters."""
FARTHEST_M = 1e4
"""No camera sees so far: a marker beyond it is lost [m]."""
SLOWEST_HZ, FASTEST_HZ = 0.1, 100_000.0
"""Rates of frames that a header may state: another number there is none [Hz]."""
LARGEST_PART = 1.1
"""No part of a unit quaternion is larger: beyond it the orientation is lost."""


@dataclass
class Tracked:
    """Markers and rigid bodies.

    Attributes:
        system: Kind of the file, for people.
        time_ns: From the first frame, shape (n,), int64, increasing.
        markers: By name, shape (n, 3) [m] in the world of the file; NaN where lost.
        bodies: q_world_from_body by name, shape (n, 4); NaN where lost.
        left_out: Bodies that the file has, but not as this bench can read them, and why.
        findings: What was noticed.
    """

    system: str
    time_ns: np.ndarray
    markers: dict[str, np.ndarray] = field(default_factory=dict)
    bodies: dict[str, np.ndarray] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    def marker(self, name: str) -> np.ndarray:
        """A marker by its name, or by what follows the subject's (`Anna:KNEE` is `KNEE`).

        Raises:
            NotFoundError: There is none, or several subjects have one; lists those that exist.
        """
        if name in self.markers:
            return self.markers[name]
        ends = [key for key in self.markers if key.rpartition(":")[2].strip() == name]
        if len(ends) == 1:
            return self.markers[ends[0]]
        raise NotFoundError("marker", name, list(self.markers))


def frame_times(count: int, rate: float) -> np.ndarray:
    """Times of frames at a rate [Hz], shape (count,), int64 [ns]."""
    return np.round(np.arange(count) * (NANOSECONDS / rate)).astype(np.int64)


def stated_rate(text: str | None) -> float | None:
    """The rate of frames that a header states [Hz]; None where it is none.

    Args:
        text: As it stands in the file, or None.
    """
    try:
        rate = float((text or "").strip().replace(",", "."))
    except ValueError:
        return None
    return rate if SLOWEST_HZ <= rate <= FASTEST_HZ else None


def stamped(seconds: np.ndarray) -> np.ndarray | None:
    """Times from the first on.

    Args:
        seconds: Of the frames, shape (n,) [s].

    Returns:
        Shape (n,), int64 [ns]; None where they do not increase.
    """
    if not np.isfinite(seconds).all() or np.any(np.diff(seconds) <= 0):
        return None
    return np.round((seconds - seconds[0]) * NANOSECONDS).astype(np.int64)


def tracked_times(
    file: Path,
    count: int,
    seconds: np.ndarray | None,
    rate: float | None,
    stated: float | None = None,
    first_line: int | None = None,
) -> np.ndarray:
    """Times of frames: at a person's rate, else as stamped, else at the rate of the file.

    Args:
        file: Of the frames.
        count: Number of frames, n.
        seconds: Their stamps, shape (n,) [s]; None where it has none.
        rate: That a person states [Hz], or None.
        stated: That the file states [Hz], or None.
        first_line: At which or below which its rows begin, from 1; None of a file without lines.

    Returns:
        From the first frame on, shape (n,), int64 [ns].

    Raises:
        FileProblems: Nothing tells them, or they go back, as where two recordings were joined.
    """
    if rate is not None:
        return frame_times(count, rate)
    if seconds is not None:
        _refuse_return(file, seconds, first_line)
    times = None if seconds is None else stamped(seconds)
    if times is not None:
        return times
    if stated is not None:
        return frame_times(count, stated)
    seen, line = "it has no times", None
    if seconds is not None:
        row = int(np.flatnonzero(~(np.diff(seconds, prepend=-np.inf) > 0))[0])
        seen = f"its times do not increase at row {row + 1} ({seconds[row]:g} s)"
        line = None if first_line is None else line_of_row(file, first_line, row)
    message = f"{seen}, and it states no rate; state one with --truth-rate HZ"
    raise FileProblems(file, [Problem(message, line=line)])


def _refuse_return(file: Path, seconds: np.ndarray, first_line: int | None) -> None:
    """Raise where stamps go back, shape (n,) [s]: what follows is not what came before."""
    back = np.flatnonzero(np.diff(seconds) < 0)
    if len(back):
        row = int(back[0]) + 1
        line = None if first_line is None else line_of_row(file, first_line, row)
        message = (
            f"its times go back at row {row + 1}, from {seconds[row - 1]:g} to {seconds[row]:g} s, "
            "as where two recordings were joined; keep one of them, or state with --truth-rate HZ "
            "that the rows follow each other evenly"
        )
        raise FileProblems(file, [Problem(message, line=line)])


def quaternions(values: np.ndarray) -> np.ndarray:
    """Orientations as a file has them, NaN where they are none.

    Args:
        values: w x y z, shape (n, 4); NaN or all zero where lost.

    Returns:
        Shape (n, 4).
    """
    q = np.array(values, dtype=float)
    q[~(np.all(np.abs(q) <= LARGEST_PART, axis=1) & np.any(q != 0, axis=1))] = np.nan
    return q


def points(values: np.ndarray, names: Sequence[str], unit: float) -> dict[str, np.ndarray]:
    """Markers of columns x, y, z side by side.

    Args:
        values: Shape (n, 3 k); NaN or all three zero where a marker was lost.
        names: Of the k markers.
        unit: Metres of one.

    Returns:
        By name, shape (n, 3) [m]; of a name that stands twice the first.
    """
    result: dict[str, np.ndarray] = {}
    for i, name in enumerate(names):
        own = values[:, 3 * i : 3 * i + 3] * unit
        own[~np.any(own != 0, axis=1)] = np.nan
        own[~np.all(np.abs(own) <= FARTHEST_M, axis=1)] = np.nan
        result.setdefault(name, own)
    return result
