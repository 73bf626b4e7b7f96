"""Frame alignment: heading of a filter's earth and error of the mounting, from a known pose.

Two rotations stand between what a filter says and the truth: the unknown heading acts on the left
(about the vertical, one angle, new at each power-up), the mounting acts on the right (in the
sensor). One known pose gives three numbers: the heading is the rotation about the vertical that
explains most, the rest is put to the mounting.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.alignment.hand_eye import solve_hand_eye
from testbench.estimation.alignment.vector_mounting import VectorMounting
from testbench.model import rotation
from testbench.records.results.estimate import FrameFit


def fit_frames(
    q_earth_from_sensor: np.ndarray, q_world_from_sensor: np.ndarray, method: str
) -> FrameFit:
    """Alignment from a reference pose.

    Args:
        q_earth_from_sensor: By the filter, over the reference pose, shape (n, 4).
        q_world_from_sensor: The truth, shape (m, 4).
        method: "heading" or "reference_pose".
    """
    estimated, true = rotation.mean(q_earth_from_sensor), rotation.mean(q_world_from_sensor)
    heading = float(rotation.heading_angle(rotation.multiply(true, rotation.conjugate(estimated))))
    mounting = np.zeros(3)
    if method == "reference_pose":
        levelled = rotation.multiply(rotation.from_heading(heading), estimated)
        mounting = rotation.to_rotation_vector(
            rotation.multiply(rotation.conjugate(true), levelled)
        )
    return FrameFit(float(np.degrees(heading)), _degrees(mounting), method)


def fit_frames_by_motion(
    q_earth_from_sensor: np.ndarray, q_world_from_sensor: np.ndarray, seconds: float
) -> tuple[FrameFit, str | None]:
    """Alignment from the whole of a motion: world and mounting together.

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        q_world_from_sensor: The truth at the same instants, shape (n, 4).
        seconds: How long the motion lasts; a pair a second counts as independent.

    Returns:
        The alignment, and what motion is missing where it is doubtful. Where it cannot be solved,
        only the heading is.
    """
    solution = solve_hand_eye(q_world_from_sensor, q_earth_from_sensor, max(seconds, 1.0))
    if not solution.trusted:
        error = rotation.multiply(q_world_from_sensor, rotation.conjugate(q_earth_from_sensor))
        heading = float(rotation.heading_angle(rotation.mean(error)))
        return FrameFit(
            float(np.degrees(heading)), method="heading", observability=solution.observability
        ), solution.warning()
    heading = float(rotation.heading_angle(solution.q_world_from_earth))
    tilt = rotation.multiply(solution.q_world_from_earth, rotation.from_heading(-heading))
    fit = FrameFit(
        float(np.degrees(heading)),
        _degrees(rotation.to_rotation_vector(solution.q_body_from_sensor)),
        "motion",
        _degrees(rotation.to_rotation_vector(tilt)),
        _degrees(solution.mounting_sd),
        solution.observability,
    )
    return fit, solution.warning()


def fit_frames_by_vectors(
    q_earth_from_sensor: np.ndarray, q_world_from_sensor: np.ndarray, mounting: VectorMounting
) -> tuple[FrameFit, str | None]:
    """Alignment with the mounting by rates and gravity; only the heading is left to the filter.

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        q_world_from_sensor: The truth at the same instants, shape (n, 4).
        mounting: How the sensor sits in its mounting as believed.
    """
    q = q_earth_from_sensor
    if mounting.trusted:
        q = rotation.multiply(q, rotation.conjugate(mounting.q_body_from_sensor))
    error = rotation.multiply(q_world_from_sensor, rotation.conjugate(q))
    heading = float(np.degrees(rotation.heading_angle(rotation.mean(error))))
    if not mounting.trusted:
        return FrameFit(
            heading, method="heading", observability=mounting.observability
        ), mounting.warning()
    turned = _degrees(rotation.to_rotation_vector(mounting.q_body_from_sensor))
    fit = FrameFit(
        heading,
        turned,
        "rates",
        mounting_sd_deg=_degrees(mounting.sd),
        observability=mounting.observability,
    )
    return fit, mounting.warning()


def apply_frames(q_earth_from_sensor: np.ndarray, fit: FrameFit) -> np.ndarray:
    """q_world_from_sensor by a filter and its alignment, shape (n, 4).

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        fit: The alignment.
    """
    if fit.method == "none":
        return q_earth_from_sensor
    tilt = rotation.from_rotation_vector(np.radians(np.array(fit.tilt_deg)))
    left = rotation.multiply(tilt, rotation.from_heading(np.radians(fit.heading_deg)))
    right = rotation.conjugate(
        rotation.from_rotation_vector(np.radians(np.array(fit.mounting_deg)))
    )
    return rotation.multiply(rotation.multiply(left, q_earth_from_sensor), right)


def _degrees(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = np.degrees(vector)
    return float(x), float(y), float(z)
