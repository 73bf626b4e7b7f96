"""What a calibration came to, with the evidence that its report shows.

Only the calibration itself is kept as a file.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.records.results.calibration_file import SensorCalibration


@dataclass(frozen=True)
class CalibrationPoses:
    """The rests that an accelerometer was calibrated from.

    Attributes:
        start: Host times at which they begin, shape (k,) [s].
        end: Host times at which they end, shape (k,) [s].
        raw: Mean readings as read, shape (k, 3) [m/s^2].
        corrected: Mean readings by the calibration, shape (k, 3) [m/s^2].
        expected: Readings by the arm, shape (k, 3) [m/s^2], or None.
        sd: Of single readings before and after the correction, pooled over the rests, shape (2, 3)
            [m/s^2].
    """

    start: np.ndarray
    end: np.ndarray
    raw: np.ndarray
    corrected: np.ndarray
    expected: np.ndarray | None
    sd: np.ndarray


@dataclass(frozen=True)
class Agreement:
    """How far two ways to find rests agree.

    Attributes:
        first: Name of the one way.
        second: Name of the other.
        counts: Intervals of each.
        matched: Rests that both found.
        iou: Samples at rest by both over samples at rest by either; NaN where neither found any.
        start_later_s: How much later a rest begins by the second, mean over matched ones.
        end_later_s: How much later a rest ends by the second, mean over matched ones.
        border_abs_s: Mean size of those differences.
    """

    first: str
    second: str
    counts: tuple[int, int]
    matched: int
    iou: float
    start_later_s: float
    end_later_s: float
    border_abs_s: float


@dataclass(frozen=True)
class CalibrationResult:
    """A calibration and what it was made from.

    Attributes:
        calibration: For the file.
        poses: Of the accelerometer.
        segmentation: By which witness the rests were taken.
        agreements: How far the witnesses agree.
        held_out: Where the held-out figures come from, a phrase.
        remarks: What was left out, and why.
    """

    calibration: SensorCalibration
    poses: CalibrationPoses
    segmentation: str
    agreements: list[Agreement]
    held_out: str
    remarks: list[str] = field(default_factory=list)
