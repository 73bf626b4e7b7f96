"""Frame alignment: heading of a filter's earth and error of the mounting, from a known pose.

Two rotations stand between what a filter says and the truth: the unknown heading acts on the left
(about the vertical, one angle, new at each power-up), the mounting acts on the right (in the
sensor). One known pose gives three numbers: the heading is the rotation about the vertical that
explains most, the rest is put to the mounting.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.alignment.hand_eye import solve_hand_eye
from testbench.estimation.alignment.shown_mounting import DOUBTFUL
from testbench.estimation.alignment.vector_mounting import VectorMounting
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import FrameFit

LEVEL_WITHIN = np.radians(10.0)
"""A world that leans by more against the sensor's vertical is not level: filters are not that wrong
on the whole of a motion [rad].
"""
SURE_WITHIN = np.radians(5.0)
"""A filter that leaves more after alignment is too wrong to say that the world leans [rad]."""
FAR_BEYOND = 5.0
"""Unless the world leans by so many times as much: a truth that drifts leaves more, too."""
HARDLY_DEG = 1.0
"""Standard uncertainty of a mounting above which little motion is remarked on [deg]."""


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
    q_earth_from_sensor: np.ndarray,
    q_world_from_sensor: np.ndarray,
    seconds: float,
    up_known: bool = True,
) -> FrameFit:
    """Alignment from the whole of a motion: world and mounting together.

    What the motion cannot show, and only that, is held: where the world is level if its vertical is
    known, else at the mounting that is believed. A world that cannot be level counts as unknown.

    Args:
        q_earth_from_sensor: By the filter, shape (n, 4).
        q_world_from_sensor: The truth at the same instants, shape (n, 4).
        seconds: How long the motion lasts; a pair a second counts as independent.
        up_known: Whether the z axis of the truth's world is said to point up.
    """
    pairs, independent = (q_world_from_sensor, q_earth_from_sensor), max(seconds, 1.0)
    solution = solve_hand_eye(*pairs, independent, up_known)
    heading, tilt = heading_and_tilt(solution.q_world_from_earth)
    # where the tilt was chosen to be small, a small one says less
    within = LEVEL_WITHIN if solution.trusted else LEVEL_WITHIN / 2
    level = up_known and float(np.linalg.norm(tilt)) <= within
    if up_known and not level and not solution.trusted:
        solution = solve_hand_eye(*pairs, independent, False)
        heading, tilt = heading_and_tilt(solution.q_world_from_earth)
    if level and len(solution.blind) > 1:  # no motion: only the heading is unknown
        error = rotation.multiply(q_world_from_sensor, rotation.conjugate(q_earth_from_sensor))
        heading = float(rotation.heading_angle(rotation.mean(error)))
        return FrameFit(
            float(np.degrees(heading)),
            method="heading",
            observability=solution.observability,
            undetermined=solution.blind.tolist(),
            held_by="mounting",
        )
    leaning = float(np.linalg.norm(tilt))
    sure = solution.residual <= max(SURE_WITHIN, leaning / FAR_BEYOND)
    return FrameFit(
        float(np.degrees(heading)),
        _degrees(rotation.to_rotation_vector(solution.q_body_from_sensor)),
        "motion",
        _degrees(tilt),
        _degrees(solution.mounting_sd),
        solution.observability,
        residual_deg=float(np.degrees(solution.residual)),
        covariance_deg2=(solution.covariance * np.degrees(1.0) ** 2).tolist(),
        undetermined=solution.blind.tolist(),
        held_by=solution.held_by,
        up_known=up_known and (level or solution.trusted or not sure),
        leans=up_known and not level and sure,
    )


def heading_and_tilt(q_world_from_earth: np.ndarray) -> tuple[float, np.ndarray]:
    """The turn about the vertical [rad], and what is left as a rotation vector, shape (3,) [rad].

    Args:
        q_world_from_earth: Shape (4,).
    """
    heading = float(rotation.heading_angle(q_world_from_earth))
    tilt = rotation.multiply(q_world_from_earth, rotation.from_heading(-heading))
    return heading, rotation.to_rotation_vector(tilt)


HELD = {
    "mounting": "where the mounting is nearest to the one that is believed",
    "vertical": "where the z axis of the truth's world points up",
}


def findings_on(fit: FrameFit, filter_name: str) -> list[Finding]:
    """What an alignment by motion could not determine, or hardly.

    Args:
        fit: The alignment.
        filter_name: Whose it is.
    """
    found = []
    if len(fit.undetermined) == 1:
        axis = _axis_text(np.array(fit.undetermined[0][:3]))
        found.append(finding("frames.undetermined", axis=axis, held=HELD[fit.held_by]))
    elif fit.undetermined:
        found.append(finding("frames.still"))
    elif fit.observability is not None and fit.observability < DOUBTFUL and fit.covariance_deg2:
        values, vectors = np.linalg.eigh(np.array(fit.covariance_deg2)[:3, :3])
        if np.sqrt(max(values[-1], 0.0)) > HARDLY_DEG:
            axis = _axis_text(vectors[:, -1])
            reached, wanted = fit.observability, DOUBTFUL
            found.append(
                finding(
                    "frames.hardly", filter=filter_name, axis=axis, reached=reached, wanted=wanted
                )
            )
    if fit.leans:
        code = "frames.not_level" if fit.up_known else "frames.up_undetermined"
        found.append(finding(code, tilt_deg=round(float(np.linalg.norm(fit.tilt_deg)))))
    elif not fit.up_known:
        found.append(finding("frames.up_unknown"))
    return found


def _axis_text(axis: np.ndarray) -> str:
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    axis = axis * (1 if axis[np.argmax(np.abs(axis))] > 0 else -1)
    return ", ".join(f"{part + 0.0:.2f}" for part in np.round(axis, 2))


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


def _degrees(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = np.degrees(vector)
    return float(x), float(y), float(z)
