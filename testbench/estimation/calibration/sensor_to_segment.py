"""How a sensor sits on its segment: from directions known in both, or from the arm's kinematics.

Both give q_segment_from_sensor with the covariance of a small rotation about the axes of the
segment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.alignment.hand_eye import solve_hand_eye
from testbench.estimation.alignment.shown_mounting import REFUSED
from testbench.estimation.calibration.triad_model import AXES
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation, covariance_of
from testbench.records.results.fit import Fit

VAGUE = np.radians(10.0)
"""A mounting that is known no better than this about some axis is refused [rad]; by eye it is known
as well.
"""
ADVICE = "directions or rotations about a second axis are needed"
NAMES = tuple(f"rotation_{i}" for i in AXES)


@dataclass(frozen=True)
class SegmentMounting:
    """How a sensor sits on its segment.

    Attributes:
        q_segment_from_sensor: Shape (4,).
        fit: Its rotation vector [rad]; the covariance is that of a small rotation about the axes of
            the segment.
        method: Which of the functions found it.
        remarks: What a user must know, as sentences.
    """

    q_segment_from_sensor: np.ndarray
    fit: Fit
    method: str
    remarks: tuple[str, ...] = ()


def from_directions(
    in_sensor: np.ndarray, in_segment: np.ndarray, sd: np.ndarray
) -> SegmentMounting:
    """From directions known in both, such as gravity and the axis of a hinge (Wahba's problem).

    Shuster & Oh, Three-axis attitude determination from vector observations, J. Guidance and
    Control 4(1), 1981.

    Args:
        in_sensor: Directions in the sensor, shape (k, 3), of any length, k >= 2.
        in_segment: The same directions in the segment, shape (k, 3), of any length.
        sd: Standard deviation of each direction [rad], shape (k,).

    Raises:
        PoorExcitation: The directions lie along one line.
    """
    sensor, segment = (
        v / np.linalg.norm(v, axis=1, keepdims=True) for v in (in_sensor, in_segment)
    )
    weight = 1 / sd**2
    profile = (segment * weight[:, None]).T @ sensor
    strength = np.linalg.svd(profile, compute_uv=False)
    if strength[1] <= REFUSED**2 * strength[0]:
        raise PoorExcitation(NAMES, float(np.sqrt(strength[0] / max(strength[1], 1e-300))), ADVICE)
    R = rotation.nearest_rotation(profile)
    left = segment - sensor @ R.T
    # information of a small rotation: the sum of w (v'v 1 - v v')
    J = np.zeros((len(segment), 3, 3))
    x, y, z = segment.T  # the better known side: noise must not count as motion
    J[:, 0, 1], J[:, 0, 2], J[:, 1, 2] = z, -y, x
    J -= np.swapaxes(J, 1, 2)
    J *= np.sqrt(weight)[:, None, None]
    covariance, condition = covariance_of(J.reshape(-1, 3) * VAGUE, 1.0, NAMES, ADVICE)
    q = rotation.from_matrix(R)
    return _mounting(q, covariance * VAGUE**2, float("inf"), condition, left, "directions")


def from_arm_kinematics(
    q_world_from_segment: np.ndarray,
    q_earth_from_sensor: np.ndarray,
    independent: float | None = None,
) -> SegmentMounting:
    """From orientations along a motion, by the arm and by a filter whose earth is not known.

    Args:
        q_world_from_segment: By the arm, shape (n, 4).
        q_earth_from_sensor: By the filter, at the same instants, shape (n, 4).
        independent: How many of the samples count as independent; all if None.

    Raises:
        PoorExcitation: The motion is about one axis.
    """
    found = solve_hand_eye(q_world_from_segment, q_earth_from_sensor, independent)
    if not found.trusted or (found.mounting_sd > VAGUE).any():
        raise PoorExcitation(NAMES, 1 / max(found.observability, 1e-12), ADVICE)
    mounting = found.q_body_from_sensor
    R = rotation.to_matrix(mounting)
    covariance = R @ found.mounting_covariance @ R.T
    dof = 3 * float(independent or len(q_world_from_segment)) - 6
    return _mounting(
        mounting,
        covariance,
        dof,
        1 / found.observability,
        np.array([found.residual]),
        "arm_kinematics",
    )


def _mounting(
    q: np.ndarray,
    covariance: np.ndarray,
    dof: float,
    condition: float,
    residuals: np.ndarray,
    method: str,
) -> SegmentMounting:
    fit = Fit(
        NAMES, ("rad",) * 3, rotation.to_rotation_vector(q), covariance, dof, condition, residuals
    )
    return SegmentMounting(q, fit, method)
