"""Ferraris: the accelerometer from six faces up, the gyroscope from a known turn about each axis.

Ferraris, Grimaldi & Parvis, Procedure for effortless in-field calibration of three-axial rate gyro
and accelerometers, Sensors and Materials 7(5), 1995, eqs 9 to 23. The response is not split into
scale and rotation here: it is their product K R. Each result is a linear combination of means, so
its covariance follows from theirs.

The faces are taken to be exactly level: what a crooked table or housing adds looks like cross-axis
error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.calibration.attitude_aided import calibration_of
from testbench.estimation.calibration.faces import face_of, need_all_faces, six_faces
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES, Tolerance
from testbench.estimation.calibration.turns import GyroscopeRecording, Turn
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

ABOUT_ONE_AXIS = 0.95
"""A turn is about one axis where this share of it is, as a face is up (`faces.LEAST_SHARE`)."""
LEVEL = "the faces are taken to be exactly level; what tilts them looks like cross-axis error"


@dataclass(frozen=True)
class FerrarisTurn:
    """One turn about one axis of the sensor, from rest to rest.

    Attributes:
        rate: Raw, shape (n, 3) [rad/s].
        force: By the calibrated accelerometer, shape (n, 3) [m/s^2].
        interval: Between samples [s].
    """

    rate: np.ndarray
    force: np.ndarray
    interval: float


def ferraris(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Bias (eq. 20) and response (eqs 21 to 23) of an accelerometer.

    Args:
        poses: With each face up once at least.
        tolerance: For the unit.

    Raises:
        PoorExcitation: A face is never up.
    """
    mean, covariance = six_faces(poses)
    combine = np.zeros((12, 18))  # response row by row, then bias, by readings pose by pose
    for j in range(3):
        up, down = 2 * j, 2 * j + 1
        for i in range(3):
            combine[3 * i + j, [3 * up + i, 3 * down + i]] = np.array([0.5, -0.5]) / poses.magnitude
        # bias, eq. 20; response above, eqs 21 to 23
        combine[9 + j, [3 * up + j, 3 * down + j]] = 0.5
    noise = np.zeros((18, 18))
    for face in range(6):
        noise[3 * face : 3 * face + 3, 3 * face : 3 * face + 3] = covariance[face]
    names = (*_response_names(), *(f"bias_{i}" for i in AXES))
    fit = Fit(
        names,
        ("1",) * 9 + (tolerance.unit,) * 3,
        combine @ mean.reshape(-1),
        combine @ noise @ combine.T,
        condition=1.0,
    )
    return calibration_of(fit, "ferraris", remarks=(LEVEL,))


def ferraris_gyroscope(
    rest: StaticPoses,
    force: StaticPoses,
    turns: Sequence[FerrarisTurn],
    angle: float,
    angle_sd: float = 0.0,
) -> TriadCalibration:
    """Bias, g-sensitivity (eq. 9) and response (eqs 12 to 15) of a gyroscope.

    Args:
        rest: Readings of the gyroscope at rest [rad/s]; of `magnitude` the specific force [m/s^2].
        force: Of the accelerometer in the same poses: it says which face is up.
        turns: About x, y and z.
        angle: Of each [rad], negative for clockwise ones.
        angle_sd: Standard deviation of each turn's angle [rad].

    Raises:
        InputError: Not three turns.
        PoorExcitation: A face is never up.
    """
    # Longer than a screen: one linear map of the means, its rows in the order of the paper.
    if len(turns) != 3:
        raise InputError(f"Ferraris needs three turns, about x, y and z; {len(turns)} were given")
    face = face_of(force.mean)
    need_all_faces(face)
    m = len(rest)
    count = np.ones(m) if rest.count is None else rest.count.astype(float)
    pooled = count / count.sum()
    differ = np.zeros((3, m))  # half the difference of opposite faces over gravity (eq. 9)
    for k in range(6):
        differ[k // 2, face == k] = (0.5, -0.5)[k % 2] / rest.magnitude / np.sum(face == k)
    lasting = np.array([len(turn.rate) * turn.interval for turn in turns])
    felt = np.array([turn.force.sum(axis=0) * turn.interval for turn in turns])
    swept = np.array([turn.rate.sum(axis=0) * turn.interval for turn in turns])
    # All that is found is linear in the means at rest and the sums over the turns, alike for each
    # axis of the gyroscope.
    found = np.zeros((7, m + 3))  # response (3), bias, g-sensitivity (3)
    found[3, :m], found[4:, :m] = pooled, differ
    # eqs 12 to 15: what was swept less bias and response to force, over the angle
    found[:3, m:] = np.eye(3) / angle
    found[:3, :m] = -(lasting[:, None] * pooled + felt @ differ) / angle
    values = found @ np.vstack([rest.mean, swept])
    response, bias, g_matrix = values[:3].T, values[3], values[4:].T
    white = (rest.variance * count[:, None]).mean(axis=0)  # of one sample
    covariance = np.zeros((21, 21))
    for i in range(3):
        noise = np.concatenate(
            [rest.variance[:, i], white[i] * lasting * np.array([turn.interval for turn in turns])]
        )
        block = [3 * i, 3 * i + 1, 3 * i + 2, 9 + i, 12 + 3 * i, 13 + 3 * i, 14 + 3 * i]
        covariance[np.ix_(block, block)] = found * noise @ found.T
    for j in range(3):  # an error of a turn's angle scales a column of the response
        column = [j, 3 + j, 6 + j]
        covariance[np.ix_(column, column)] += (
            np.outer(response[:, j], response[:, j]) * (angle_sd / angle) ** 2
        )
    fit = Fit(
        (
            *_response_names(),
            *(f"bias_{i}" for i in AXES),
            *(f"g_sensitivity_{i}{j}" for i in AXES for j in AXES),
        ),
        ("1",) * 9 + ("rad/s",) * 3 + ("rad/s/(m/s^2)",) * 9,
        np.concatenate([response.reshape(-1), bias, g_matrix.reshape(-1)]),
        covariance,
    )
    return TriadCalibration(
        "ferraris", np.linalg.inv(response), bias, g_matrix=g_matrix, fits=(fit,), remarks=(LEVEL,)
    )


def largest_turns(recording: GyroscopeRecording) -> list[int]:
    """Indices of the largest turns about x, y and z of the sensor, by its own rates.

    Raises:
        PoorExcitation: No turn is about one of the axes.
    """
    bias = np.concatenate([rest.gyr for rest in recording.rests]).mean(axis=0)
    swept = np.array(
        [(turn.gyr - bias).sum(axis=0) * turn.interval for turn in recording.turns]
    ).reshape(-1, 3)
    chosen = []
    for axis in range(3):
        about = np.abs(swept[:, axis]) >= ABOUT_ONE_AXIS * np.linalg.norm(swept, axis=1)
        known = [i for i in np.flatnonzero(about).tolist() if recording.turns[i].force is not None]
        if not known:
            names = [f"response_{i}{AXES[axis]}" for i in AXES]
            raise PoorExcitation(
                names, float("inf"), f"no turn from rest to rest is about the axis {AXES[axis]}"
            )
        chosen.append(max(known, key=lambda i: abs(swept[i, axis])))
    return chosen


def unused_turns(recording: GyroscopeRecording) -> list[Turn]:
    """Turns that Ferraris does not calibrate from: all but the largest about each axis."""
    used = largest_turns(recording)
    return [turn for i, turn in enumerate(recording.turns) if i not in used]


def ferraris_of_recording(
    recording: GyroscopeRecording, angle: float | None = None
) -> TriadCalibration:
    """The same from rests and turns, of which the largest about each axis is the known one.

    Args:
        recording: Rests with the force they feel, and each face up in one of them; turns with their
            force.
        angle: Of each known turn [rad], negative for clockwise ones (seen against the axis); None
            where nobody states it.

    Raises:
        InputError: The angle is not stated.
        PoorExcitation: A face is never up, or no turn is about one of the axes.
    """
    if angle is None:
        raise InputError(
            "the method ferraris_gyroscope needs the angle of its turns about x, y and z; state it "
            "with --turn-deg, such as "
            "--turn-deg 360 (where an arm made them, the method attitude knows it)"
        )
    rests = [rest for rest in recording.rests if rest.force is not None]
    force = np.array([rest.force for rest in rests]).reshape(-1, 3)
    magnitude = float(np.linalg.norm(force, axis=1).mean()) if len(rests) else float("nan")
    count = np.array([len(rest.gyr) for rest in rests])
    mean = np.array([rest.gyr.mean(axis=0) for rest in rests]).reshape(-1, 3)
    variance = np.array([rest.gyr.var(axis=0, ddof=1) / len(rest.gyr) for rest in rests]).reshape(
        -1, 3
    )
    still = StaticPoses(mean, variance, magnitude, count=count)
    # of the forces only the means are asked for
    felt = StaticPoses(force, np.ones_like(force), magnitude, count=count)
    largest = [recording.turns[i] for i in largest_turns(recording)]
    turns = [
        FerrarisTurn(turn.gyr, turn.force, turn.interval)
        for turn in largest
        if turn.force is not None
    ]
    found = ferraris_gyroscope(still, felt, turns, angle)
    reading = np.diag(np.linalg.inv(found.matrix))
    if (reading <= 0).any():
        told = ", ".join(
            f"{axis} {np.degrees(angle * value):.1f} deg"
            for axis, value in zip(AXES, reading, strict=True)
        )
        raise InputError(
            f"by the gyroscope its largest turns are {told}, where --turn-deg states "
            f"{np.degrees(angle):g} deg for each: one "
            "sense of turning for all three axes, negative if clockwise"
        )
    return replace(found, method="ferraris_gyroscope")


def _response_names() -> list[str]:
    return [f"response_{i}{j}" for i in AXES for j in AXES]
