"""How a sensor sits on its segment: by a known pose, directions known in both, or kinematics.

All give q_segment_from_sensor with the covariance of a small rotation about the axes of the
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


def from_static_pose(
    q_earth_from_sensor: np.ndarray,
    q_earth_from_segment: np.ndarray,
    independent: float = 1.0,
    pose_sd: float = 0.0,
) -> SegmentMounting:
    """From orientations in a known pose (Castellanos Alonso 2023, eqs 2.2 and 2.4).

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        q_earth_from_segment: The pose, shape (4,); its earth must have the filter's heading.
        independent: How many of the samples count as independent: a filter's errors last for
            seconds.
        pose_sd: Standard deviation of the pose itself about each axis [rad].
    """
    q = rotation.mean(q_earth_from_sensor)
    mounting = rotation.multiply(rotation.conjugate(q_earth_from_segment), q)  # eqs 2.2, 2.4
    spread = rotation.to_rotation_vector(
        rotation.multiply(
            rotation.multiply(rotation.conjugate(q_earth_from_segment), q_earth_from_sensor),
            rotation.conjugate(mounting),
        )
    )
    n = len(spread)
    covariance = spread.T @ spread / max(n - 1, 1) / min(independent, n) + pose_sd**2 * np.eye(3)
    dof = float("inf") if pose_sd > 0 or independent <= 1 else min(independent, n) - 1
    return _mounting(
        mounting,
        covariance,
        dof,
        1.0,
        spread,
        "static_pose",
        (
            (
                "the filter's inclination error in this pose, and a difference of heading, are "
                "part of "
                "the mounting"
            ),
        ),
    )


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
    return _wahba(sensor, segment, 1 / sd**2, "directions", known=True, independent=None)


def from_rates(
    rate_in_sensor: np.ndarray, rate_in_segment: np.ndarray, independent: float | None = None
) -> SegmentMounting:
    """From angular rates: those of the gyroscope and those that the arm's kinematics give its link.

    Args:
        rate_in_sensor: By the gyroscope, bias taken away, shape (n, 3) [rad/s].
        rate_in_segment: By the arm, at the same instants, shape (n, 3) [rad/s].
        independent: How many of the samples count as independent; all if None.

    Raises:
        PoorExcitation: The motion is about one axis.
    """
    return _wahba(
        rate_in_sensor,
        rate_in_segment,
        np.ones(len(rate_in_sensor)),
        "rates",
        known=False,
        independent=independent,
    )


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


def _wahba(
    sensor: np.ndarray,
    segment: np.ndarray,
    weight: np.ndarray,
    method: str,
    *,
    known: bool,
    independent: float | None,
) -> SegmentMounting:
    """Weighted least squares on segment = R sensor; information of a small rotation is the sum of w
    (v'v 1 - v v').
    """
    profile = (segment * weight[:, None]).T @ sensor
    strength = np.linalg.svd(profile, compute_uv=False)
    if strength[1] <= REFUSED**2 * strength[0]:
        raise PoorExcitation(NAMES, float(np.sqrt(strength[0] / max(strength[1], 1e-300))), ADVICE)
    R = rotation.nearest_rotation(profile)
    left = segment - sensor @ R.T
    J = np.zeros((len(segment), 3, 3))
    x, y, z = segment.T  # the better known side: noise must not count as motion
    J[:, 0, 1], J[:, 0, 2], J[:, 1, 2] = z, -y, x
    J -= np.swapaxes(J, 1, 2)
    J *= np.sqrt(weight)[:, None, None]
    count = len(sensor) * (2 if known else 3) - 3  # a direction has two numbers, a vector three
    share = 1.0 if independent is None else max(len(sensor) / independent, 1.0)
    variance = 1.0 if known else float(np.sum(weight[:, None] * left**2)) / max(count, 1) * share
    covariance, condition = covariance_of(J.reshape(-1, 3) * VAGUE, variance, NAMES, ADVICE)
    dof = float("inf") if known else max(count / share, 1.0)
    return _mounting(rotation.from_matrix(R), covariance * VAGUE**2, dof, condition, left, method)


def _mounting(
    q: np.ndarray,
    covariance: np.ndarray,
    dof: float,
    condition: float,
    residuals: np.ndarray,
    method: str,
    remarks: tuple[str, ...] = (),
) -> SegmentMounting:
    fit = Fit(
        NAMES, ("rad",) * 3, rotation.to_rotation_vector(q), covariance, dof, condition, residuals
    )
    return SegmentMounting(q, fit, method, remarks)
