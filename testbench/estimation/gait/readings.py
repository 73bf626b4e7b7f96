"""The readings of a worn sensor on a regular grid, and what is doubtful in them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.consistency.doubtful import CLIPPED, SATURATED
from testbench.estimation.calibration.stored_calibration import corrector
from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.signals.access import MOST_AT_ONCE, WholeRecording
from testbench.estimation.signals.recording import SensorRecording
from testbench.estimation.signals.segmentation import detect_static, intervals_of
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.estimate import ClockFit

REST_S = 1.0
"""A still interval of this length is a rest; within a step no foot stands so still for so long."""
HOLE_S = 0.1
"""Over a longer hole in the rates nothing is known of the way."""


@dataclass(frozen=True)
class Readings:
    """What a worn sensor read.

    Attributes:
        time: Since the start of the session, shape (n,) [s].
        uniform: On a regular grid, n samples; the force is NaN where nothing was measured.
        clipped: Whether a triad was at full scale, shape (n,), bool.
        rests: Still intervals of at least `REST_S`, begin and end (exclusive), shape (k, 2).
        bias: Of the gyroscope, by the rests, else by its steadiest moments, shape (3,) [rad/s].
        derived: Whether the rates are those of the device's own orientation.
        holes: How many holes without rows there were; these are the readings of the longest stretch
            without one.
    """

    time: np.ndarray
    uniform: UniformSamples
    clipped: np.ndarray
    rests: np.ndarray
    bias: np.ndarray
    derived: bool = False
    holes: int = 0

    @property
    def interval(self) -> float:
        """Between samples [s]."""
        return self.uniform.interval

    @property
    def rate(self) -> np.ndarray:
        """Angular rate without its bias, shape (n, 3) [rad/s]."""
        return np.asarray(self.uniform.gyr - self.bias)

    @property
    def acc(self) -> np.ndarray:
        """Specific force, shape (n, 3) [m/s^2]."""
        return self.uniform.acc


def fits_in_memory(recording: SensorRecording) -> bool:
    """Whether a walk can be reckoned of it: the smoother needs all samples at once."""
    return recording.raw.count <= MOST_AT_ONCE


def readings_of(recording: SensorRecording, stored: SensorCalibration | None = None) -> Readings:
    """Prepare a sensor's samples.

    Args:
        recording: One that `fits_in_memory`.
        stored: A stored calibration, applied to all that is read.
    """
    correct = [] if stored is None else [corrector(stored)]
    access = WholeRecording(recording.raw, recording.belief, *correct)
    uniform, rows = access.regular(ClockFit())
    derived = not uniform.has("gyr") and uniform.has("device_q")
    if derived:
        uniform = replace(uniform, gyr=_derived(uniform))
    grid = np.arange(len(uniform))
    time = np.interp(grid, rows, access.samples.host_time_ns / NANOSECONDS)
    static = detect_static(uniform.gyr, uniform.interval, rows)
    flags = access.quality(static[rows]).flags
    clipped = np.zeros(len(uniform), dtype=bool)
    for reason in (CLIPPED, SATURATED):
        if reason in flags:
            clipped[rows[flags[reason]]] = True
    known = np.zeros(len(uniform), dtype=bool)
    known[rows] = access.measured | clipped[rows]
    for begin, end in intervals_of(~known, max(round(HOLE_S / uniform.interval), 1)):
        uniform.acc[begin:end] = np.nan
    stretch, holes = _longest_stretch(time)
    uniform, static, time = _piece(uniform, stretch, time), static[stretch], time[stretch]
    rests = intervals_of(static, max(round(REST_S / uniform.interval), 1))
    bias = _bias(uniform, static, rests)
    return Readings(time, _finite(uniform), clipped[stretch], rests, bias, derived, holes)


def _longest_stretch(time: np.ndarray) -> tuple[slice, int]:
    """The longest stretch whose rows follow one another, and the holes between stretches.

    A file without a counter has no rows where it has none: on the grid such a hole is one step.

    Args:
        time: Of the rows of the grid, shape (n,) [s].
    """
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    breaks = np.flatnonzero(steps > max(HOLE_S, 2.5 * usual)) + 1
    ends = np.concatenate([[0], breaks, [len(time)]])
    lasting = time[ends[1:] - 1] - time[ends[:-1]]
    longest = int(np.argmax(lasting))
    return slice(int(ends[longest]), int(ends[longest + 1])), len(breaks)


def _piece(uniform: UniformSamples, rows: slice, time: np.ndarray) -> UniformSamples:
    """Some rows of a grid; where they are not all, by their own interval."""
    if rows == slice(0, len(uniform)):
        return uniform
    own = time[rows]
    interval = float(own[-1] - own[0]) / max(len(own) - 1, 1)
    return replace(uniform.piece(rows), interval=interval, intervals=None)


def _derived(uniform: UniformSamples) -> np.ndarray:
    """Rates of the device's own orientation, each over the interval before it, shape (n, 3)."""
    q = uniform.device_q
    assert q is not None
    turns = rotation.to_rotation_vector(rotation.multiply(rotation.conjugate(q[:-1]), q[1:]))
    return np.vstack([np.zeros((1, 3)), turns / uniform.steps()[1:, None]])


def _finite(uniform: UniformSamples) -> UniformSamples:
    """A gyroscope that never read anything stands still, and its force is unknown."""
    if np.isfinite(uniform.gyr).all():
        return uniform
    lost = ~np.isfinite(uniform.gyr).all(axis=1)
    acc, gyr = uniform.acc.copy(), uniform.gyr.copy()
    acc[lost], gyr[lost] = np.nan, 0.0
    return replace(uniform, acc=acc, gyr=gyr)


def _bias(uniform: UniformSamples, static: np.ndarray, rests: np.ndarray) -> np.ndarray:
    """Mean rate of the rests; without one the median of the slowest twentieth of the samples."""
    still = np.zeros(len(uniform), dtype=bool)
    for begin, end in rests:
        still[begin:end] = True
    if still.any():
        return np.asarray(uniform.gyr[still].mean(axis=0))
    size = np.linalg.norm(np.nan_to_num(uniform.gyr), axis=1)
    slowest = size <= np.quantile(size, 0.05)
    return np.asarray(np.median(np.nan_to_num(uniform.gyr[slowest]), axis=0))
