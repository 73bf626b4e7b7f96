"""Bias and scale of each axis from the six faces up: half the sum and half the difference of
opposite readings.

Titterton & Weston, Strapdown Inertial Navigation Technology, 2004, chapter 8. A tilt of a face by t
changes a reading by the factor cos t only, so hand-held poses do; cross-axis errors are not seen at
all.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.faces import six_faces
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES, Tolerance
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit


def six_position(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Bias and scale of each axis.

    Args:
        poses: With each face up once at least.
        tolerance: For the unit.

    Raises:
        PoorExcitation: A face is never up.
    """
    mean, covariance = six_faces(poses)
    names: list[str] = []
    values, sums = np.zeros(6), np.zeros((6, 6))
    for axis in range(3):
        up, down = 2 * axis, 2 * axis + 1
        halves = np.array([[0.5, 0.5], [0.5 / poses.magnitude, -0.5 / poses.magnitude]])
        values[up : up + 2] = halves @ mean[[up, down], axis]
        noise = np.diag(covariance[[up, down], axis, axis])
        sums[up : up + 2, up : up + 2] = halves @ noise @ halves.T
        names += [f"bias_{AXES[axis]}", f"response_{AXES[axis]}{AXES[axis]}"]
    fit = Fit(tuple(names), (tolerance.unit, "1") * 3, values, sums, condition=1.0)
    return TriadCalibration(
        "six_position",
        np.diag(1 / values[1::2]),
        values[::2],
        fits=(fit,),
        remarks=("cross-axis errors are not seen by this method and stay in the readings",),
    )
