"""Gyroscope calibration from rests and turns: bias, scale, misalignment, response to force.

The model is that of Tedaldi, Pretto & Menegatti, A robust and easy to implement method for IMU
calibration without external equipments, ICRA 2014, with the bias subtracted and the response to
specific force beside it:

    w = T K (raw - b - G f),   T = [[1, -yz, zy], [xz, 1, -zx], [-xy, yx, 1]],   K = diag(scale)

where ij is the small turn of sensing axis i about axis j.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import chdtri

from testbench.estimation.calibration.turn_integration import IntegratedTurns, TurnIntegration
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest, Turn
from testbench.estimation.calibration.whitening import Whitening
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.integrators import Stages, get_integrator
from testbench.model.statistics.least_squares import FitParameter, PoorExcitation, solve
from testbench.model.statistics.linear import widened_by_misfit
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

SCALE_SIZE = 0.05
"""Standard deviation of scales and misalignments beforehand [1, rad], above any data sheet."""
BIAS_SIZE = np.radians(20.0)
"""What is known of a bias beforehand [rad/s]: the zero-rate output of consumer MEMS data sheets
(PS-MPU-6000A: +-20 deg/s).
"""
G_SIZE = np.radians(0.5) / STANDARD_GRAVITY
"""What is known of the response to force beforehand [rad/s/(m/s^2)]: 0.1 to 0.5 deg/s/g in consumer
MEMS data sheets.
"""
IN_RUN = np.radians(10 / 3600)
"""How far a bias at rest may be from that of a turn [rad/s]: an in-run bias of 10 deg/h, of
consumer MEMS data sheets.
"""
LEAST_NOISE = 1e-9
"""Below this a sensor counts as free of noise [rad/s]; weights stay finite."""
FEWEST_SAMPLES = 10
SHORTEST_CHUNK = 3
"""Samples of a chunk: integrators whose rates inside a step come from the samples beside need as
many.
"""
WINDOW_S = 0.5
"""Length of the chunks whose turn is compared with the arm's [s]: long against a sample, short
against a motion.
"""

FEWEST_SPARE = 5
"""Degrees of freedom that `gravity_turns` must leave: with four, Student's 95 % interval is 1.4
times the normal one.
"""

AXES = "xyz"
ELEMENTS = (
    ("yz", 0, 1, -1.0),
    ("zy", 0, 2, 1.0),
    ("xz", 1, 0, 1.0),
    ("zx", 1, 2, -1.0),
    ("xy", 2, 0, -1.0),
    ("yx", 2, 1, 1.0),
)
"""Misalignments with their row, column and sign in T."""
SCALES, MISALIGNMENTS, BIAS, G = slice(0, 3), slice(3, 9), slice(9, 12), slice(12, 21)


@dataclass(frozen=True)
class RestReading:
    """What a gyroscope reads at rest.

    Attributes:
        bias: Mean, shape (3,) [rad/s].
        sd: Standard uncertainty of it as the bias of a turn, shape (3,) [rad/s].
        noise: Of one sample, about each axis alike [rad/s].
        samples: How many.
    """

    bias: np.ndarray
    sd: np.ndarray
    noise: float
    samples: int


def read_rests(rests: Sequence[Rest], in_run: float = IN_RUN) -> RestReading:
    """Bias and noise by the rests.

    Where the rests scatter about their mean more than their noise explains but once in a thousand,
    as by a response to gravity, that scatter is the uncertainty.

    Raises:
        InputError: Too few samples.
    """
    counts = np.array([len(rest.gyr) for rest in rests])
    if counts.sum() < FEWEST_SAMPLES or (counts < 2).any():
        raise InputError(
            f"the bias of a gyroscope needs {FEWEST_SAMPLES} samples at rest, two in each rest; "
            f"there are {counts.sum()}"
        )
    means = np.array([rest.gyr.mean(axis=0) for rest in rests])
    inside = sum(
        ((rest.gyr - mean) ** 2).sum(axis=0) for rest, mean in zip(rests, means, strict=True)
    )
    variance = inside / max(counts.sum() - len(rests), 1)
    bias = counts @ means / counts.sum()
    white = variance / counts.sum()
    if len(rests) > 1:
        share = counts / counts.sum()
        among = (share @ (means - bias) ** 2) / (len(rests) - 1)
        by_noise = chdtri(len(rests) - 1, 0.001) / (len(rests) - 1)
        white = np.where(among > by_noise * white, among, white)
    noise = max(float(np.sqrt(variance.mean())), LEAST_NOISE)
    return RestReading(bias, np.sqrt(white + in_run**2), noise, int(counts.sum()))


def unrested(turns: Sequence[Turn]) -> RestReading:
    """What is known of a gyroscope that was never recorded at rest: nothing of its bias beyond data
    sheets, and the noise by second differences of its rates.

    Args:
        turns: At least one.
    """
    bent = np.concatenate([np.diff(turn.gyr, n=2, axis=0) for turn in turns])
    # a second difference of white noise has 1 + 4 + 1 times its variance; the median leaves the
    # ends of moves out, and is 0.6745 of a normal deviation
    noise = float(np.median(np.abs(bent))) / 0.6745 / np.sqrt(6.0)
    return RestReading(np.zeros(3), np.full(3, BIAS_SIZE), max(noise, LEAST_NOISE), 0)


def static_bias(recording: GyroscopeRecording, in_run: float = IN_RUN) -> TriadCalibration:
    """The mean at rest as bias, and nothing else.

    Raises:
        InputError: Too few samples at rest.
    """
    reading = read_rests(recording.rests, in_run)
    names = tuple(f"gyr_bias_{axis}" for axis in AXES)
    left = np.concatenate([rest.gyr - reading.bias for rest in recording.rests])
    fit = Fit(
        names,
        ("rad/s",) * 3,
        reading.bias,
        np.diag(reading.sd**2),
        residuals=left,
        residual_unit="rad/s",
        condition=1.0,
    )
    return TriadCalibration("static_bias", bias=reading.bias, fits=(fit,))


def gravity_turns(
    recording: GyroscopeRecording,
    integrator: str = "rk4",
    stages: Stages | None = None,
    g_sensitivity: bool = False,
    in_run: float = IN_RUN,
) -> TriadCalibration:
    """Scale and misalignment by gravity before and after each turn (Tedaldi et al. 2014).

    Turning the direction before by the integrated rates must give the direction after. Of the
    difference, the two components across that direction count, each weighed by the noise of the
    rates and of the directions. The bias is that of the rests, with its uncertainty: it is fitted
    along, so that what is not known of it widens the rest. Where there are no rests the turns alone
    tell it.

    Args:
        recording: Rests, and turns with `up_before` and `up_after`; at least seven, about different
            axes.
        integrator: See `testbench.model.integrators`.
        stages: Where its rates come from, its best if None.
        g_sensitivity: Whether to fit the response to specific force too, from rests and turns that
            know the force.
        in_run: What the bias of a turn may differ from that at rest [rad/s].

    Raises:
        PoorExcitation: The turns do not determine a parameter.
        InputError: Nothing to calibrate from.
    """
    # Longer than a screen: what is compared and what makes it independent share the turns.
    turns = [
        turn for turn in recording.turns if turn.up_before is not None and turn.up_after is not None
    ]
    if not turns:
        raise InputError(
            "gravity_turns needs turns between two rests whose direction of gravity is known; "
            "there are none"
        )
    rests = _rests_with_force(recording, turns) if g_sensitivity else []
    rows, names = (
        2 * len(turns) + 3 * max(len(rests), 1),
        [p.name for p in _parameters(np.zeros(3), g_sensitivity)],
    )
    if rows - len(names) < FEWEST_SPARE:
        raise PoorExcitation(
            names,
            float("inf"),
            f"{len(turns)} turns and the rests give {rows} numbers for {len(names)} parameters; "
            f"{FEWEST_SPARE} more than that "
            "are needed to tell turns that fit from turns that are merely bent to fit",
        )
    reading = read_rests(recording.rests, in_run) if recording.rests else unrested(turns)
    integration = TurnIntegration(turns, get_integrator(integrator), stages)
    before, after = (
        np.array([getattr(turn, key) for turn in turns], dtype=float)
        for key in ("up_before", "up_after")
    )
    across = _across(after)
    shared = np.array(
        [np.array_equal(a, b) for a, b in zip(after[:-1], before[1:], strict=True)], dtype=bool
    )

    def compare(ends: IntegratedTurns) -> tuple[np.ndarray, np.ndarray]:
        """Difference (m, 2) and what a turn of the end does to it (m, 2, 3)."""
        turned = rotation.rotate(rotation.conjugate(ends.q_before_from_after), before)
        return np.einsum("mji,mj->mi", across, turned), np.einsum(
            "mji,mjk->mik", across, _skew(turned)
        )

    def whiten(ends: IntegratedTurns) -> Whitening:
        return Whitening.of(
            turns, np.array([turn.up_sd for turn in turns]), reading.noise, across, ends, shared
        )

    advice = "more turns, about other axes and from other poses, are needed"
    fit = _search(
        integration, compare, whiten, _RestRows(reading, rests, in_run), g_sensitivity, advice
    )
    return _result(
        "gravity_turns", fit, (f"integrated by {integrator} with {integration.stages} rates",)
    )


def attitude(
    recording: GyroscopeRecording,
    integrator: str = "rk4",
    stages: Stages | None = None,
    window: float | None = WINDOW_S,
    g_sensitivity: bool = True,
    in_run: float = IN_RUN,
) -> TriadCalibration:
    """Scale, misalignment, bias and response to force by an arm that knows every orientation.

    Each chunk of a turn, integrated, must turn as the arm did: three numbers for each chunk, where
    gravity gives two for each turn.

    Args:
        recording: Turns with `q_world_from_sensor`, and rests.
        integrator: See `testbench.model.integrators`.
        stages: Where its rates come from, its best if None.
        window: Length of a chunk [s]; the whole turn if None.
        g_sensitivity: Whether to fit the response to specific force, which every turn must then
            know; rests that know it help.
        in_run: What the bias of a turn may differ from that at rest [rad/s].

    Raises:
        PoorExcitation: The turns do not determine a parameter.
        InputError: Nothing to calibrate from.
    """
    # Longer than a screen: what is compared and what makes it independent share the turns.
    turns = [
        chunk
        for turn in recording.turns
        if turn.q_world_from_sensor is not None
        for chunk in _chunks(turn, window)
    ]
    if not turns:
        raise InputError(
            "attitude needs turns whose orientation is known at every sample; there are none"
        )
    rests = _rests_with_force(recording, turns) if g_sensitivity else []
    reading = read_rests(recording.rests, in_run)
    integration = TurnIntegration(turns, get_integrator(integrator), stages)
    truths = [turn.q_world_from_sensor for turn in turns if turn.q_world_from_sensor is not None]
    last = [-2 if integration.stages == "measured" and len(q) % 2 == 0 else -1 for q in truths]
    ends = np.array(
        [
            rotation.multiply(rotation.conjugate(q[0]), q[k])
            for q, k in zip(truths, last, strict=True)
        ]
    )
    identity = np.broadcast_to(np.eye(3), (len(turns), 3, 3))
    shared = np.array([np.array_equal(a[-1], b[0]) for a, b in pairwise(truths)], dtype=bool)

    def compare(found: IntegratedTurns) -> tuple[np.ndarray, np.ndarray]:
        difference = rotation.multiply(rotation.conjugate(ends), found.q_before_from_after)
        return rotation.to_rotation_vector(difference), identity

    def whiten(found: IntegratedTurns) -> Whitening:
        return Whitening.of(
            turns,
            np.array([turn.attitude_sd for turn in turns]),
            reading.noise,
            identity,
            found,
            shared,
        )

    advice = "motion about other axes, and other poses, are needed"
    fit = _search(
        integration, compare, whiten, _RestRows(reading, rests, in_run), g_sensitivity, advice
    )
    chunks = "whole turns" if window is None else f"chunks of {window:g} s"
    return _result(
        "attitude", fit, (f"{chunks}, integrated by {integrator} with {integration.stages} rates",)
    )


def _rests_with_force(recording: GyroscopeRecording, turns: Sequence[Turn]) -> list[Rest]:
    """The rests that a response to force can be fitted to.

    Raises:
        InputError: The force is not known in every turn.
    """
    if any(turn.force is None for turn in turns):
        raise InputError(
            "a response to specific force can only be fitted to turns whose force is known"
        )
    return [rest for rest in recording.rests if rest.force is not None]


def _chunks(turn: Turn, window: float | None) -> list[Turn]:
    """A turn cut into chunks that share their borders.

    Two samples left at the end are too few to integrate, and join the last chunk.
    """
    if window is None:
        return [turn]
    size, last = max(round(window / turn.interval), 1), len(turn.gyr) - 1
    borders = [*range(0, last, size), last]
    if len(borders) > 2 and borders[-1] - borders[-2] < min(SHORTEST_CHUNK - 1, size):
        del borders[-2]
    return [turn.part(begin, end + 1) for begin, end in pairwise(borders)]


def _across(direction: np.ndarray) -> np.ndarray:
    """Two unit vectors across each direction, as columns, shape (m, 3) to (m, 3, 2)."""
    return np.array([np.linalg.svd(d[None])[2][1:].T for d in direction])


def _skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices of the cross product with each vector, shape (m, 3) to (m, 3, 3)."""
    return np.cross(vectors[:, None, :], np.eye(3)).transpose(0, 2, 1)


@dataclass(frozen=True)
class _RestRows:
    """What the rests say of the bias, and of the response to gravity.

    Attributes:
        reading: Their mean and noise.
        rests: Those whose force counts; none compares the bias alone with the reading.
        in_run: What all rests together may differ from the turns by [rad/s].
    """

    reading: RestReading
    rests: Sequence[Rest]
    in_run: float

    def __call__(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differences of unit variance, shape (3 r,), and their derivatives, shape (3 r, p)."""
        p, r = len(theta), max(len(self.rests), 1)
        slope = np.zeros((r, 3, p))
        slope[:, :, BIAS] = np.eye(3)
        if not self.rests:
            return (theta[BIAS] - self.reading.bias) / self.reading.sd, slope[0] / self.reading.sd[
                :, None
            ]
        means = np.array([rest.gyr.mean(axis=0) for rest in self.rests])
        force = np.array([rest.force for rest in self.rests])
        for axis in range(3):
            slope[:, axis, 12 + 3 * axis : 15 + 3 * axis] = force
        white = self.reading.noise**2 / np.array([len(rest.gyr) for rest in self.rests])
        inverse = np.linalg.inv(np.linalg.cholesky(np.diag(white) + self.in_run**2))
        left = theta[BIAS] + force @ theta[G].reshape(3, 3).T - means
        return (inverse @ left).ravel(), np.einsum("rs,sap->rap", inverse, slope).reshape(-1, p)


Compare = Callable[[IntegratedTurns], tuple[np.ndarray, np.ndarray]]


def _search(
    integration: TurnIntegration,
    compare: Compare,
    whiten: Callable[[IntegratedTurns], Whitening],
    rest_rows: _RestRows,
    g_sensitivity: bool,
    advice: str,
) -> Fit:
    """Least squares over turns and rests, the scatter known.

    The covariance is widened where the residuals are larger, and never narrowed.

    Small differences at the ends say that the arm repeats well. They say nothing of the bias and
    the response to gravity, which the rests and their in-run bias decide.

    Args:
        integration: The turns.
        compare: Differences at their ends, shape (m, k), and what a small turn of an end does to
            them, shape (m, k, 3).
        whiten: What makes them independent and of unit variance.
        rest_rows: What the rests say.
        g_sensitivity: Whether to fit G.
        advice: Against poor excitation.
    """
    parameters = _parameters(rest_rows.reading.bias, g_sensitivity)
    known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def integrate(theta: np.ndarray) -> IntegratedTurns:
        return integration.run(
            matrix_of(theta)[0], theta[BIAS], theta[G].reshape(3, 3) if g_sensitivity else None
        )

    def evaluate(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        key = theta.tobytes()
        if key not in known:
            known.clear()
            ends = integrate(theta)
            difference, by_end = compare(ends)
            by_theta = [ends.by_matrix @ matrix_of(theta)[1], ends.by_bias] + (
                [ends.by_g] if g_sensitivity else []
            )
            slope = (by_end @ np.concatenate(by_theta, axis=2)).reshape(-1, len(theta))
            left, rest_slope = rest_rows(theta)
            known[key] = (
                np.concatenate([white(difference.ravel()), left]),
                np.vstack([white(slope), rest_slope]),
            )
        return known[key]

    white = whiten(integrate(np.array([parameter.start for parameter in parameters])))
    fit = solve(
        lambda theta: evaluate(theta)[0],
        parameters,
        jacobian=lambda theta: evaluate(theta)[1],
        known_scatter=True,
        residual_unit="standard deviations",
        advice=advice,
    )
    return widened_by_misfit(fit)


def _parameters(bias: np.ndarray, g_sensitivity: bool) -> list[FitParameter]:
    result = [FitParameter(f"gyr_scale_{axis}", "1", 1.0, SCALE_SIZE) for axis in AXES]
    result += [
        FitParameter(f"gyr_misalignment_{name}", "rad", 0.0, SCALE_SIZE) for name, *_ in ELEMENTS
    ]
    result += [
        FitParameter(f"gyr_bias_{axis}", "rad/s", float(bias[i]), BIAS_SIZE)
        for i, axis in enumerate(AXES)
    ]
    if g_sensitivity:
        result += [
            FitParameter(f"gyr_g_{a}{b}", "rad/s/(m/s^2)", 0.0, G_SIZE) for a in AXES for b in AXES
        ]
    return result


def matrix_of(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """T K of scales and misalignments, and its derivative.

    Args:
        theta: Three scales [1], then six misalignments [rad] in the order of `ELEMENTS`, shape (p,)
            with p >= 9.

    Returns:
        T K, shape (3, 3), and its elements, row by row, by the nine parameters, shape (9, 9).
    """
    scale, T = theta[SCALES], np.eye(3)
    slope = np.zeros((3, 3, 9))
    for k, (_, row, column, sign) in enumerate(ELEMENTS):
        T[row, column] = sign * theta[3 + k]
        slope[row, column, 3 + k] = sign * scale[column]
    for column in range(3):
        slope[:, column, column] = T[:, column]
    return T * scale, slope.reshape(9, 9)


def _result(method: str, fit: Fit, remarks: tuple[str, ...]) -> TriadCalibration:
    matrix, _ = matrix_of(fit.values)
    g_matrix = fit.values[G].reshape(3, 3) if len(fit.values) == G.stop else np.zeros((3, 3))
    return TriadCalibration(
        method, matrix, fit.values[BIAS], g_matrix, fits=(fit,), remarks=remarks
    )


def gravity_direction_errors(
    calibration: TriadCalibration,
    turns: Sequence[Turn],
    integrator: str = "rk4",
    stages: Stages | None = None,
) -> np.ndarray:
    """Angle between gravity after each turn as integrated and as measured, shape (m,) [rad].

    Args:
        calibration: To correct with; `TriadCalibration("none")` for raw readings.
        turns: With `up_before` and `up_after`; turns that the calibration was not made from, if it
            is to be judged.
        integrator: See `testbench.model.integrators`.
        stages: Where its rates come from, its best if None.
    """
    if calibration.reference is not None:
        turns = [turn.without_drift(calibration.drift, calibration.reference) for turn in turns]
    integration = TurnIntegration(turns, get_integrator(integrator), stages)
    ends = integration.run(
        calibration.matrix, calibration.bias, calibration.g_matrix
    ).q_before_from_after
    before, after = (
        np.array([getattr(turn, key) for turn in turns], dtype=float)
        for key in ("up_before", "up_after")
    )
    turned = rotation.rotate(rotation.conjugate(ends), before)
    return np.arctan2(
        np.linalg.norm(np.cross(turned, after), axis=1), np.sum(turned * after, axis=1)
    )


def validated(
    calibration: TriadCalibration,
    held_out: Sequence[Turn],
    integrator: str = "rk4",
    stages: Stages | None = None,
) -> TriadCalibration:
    """The calibration with the errors of gravity's direction on turns that it was not made from."""
    figures = turn_figures(gravity_direction_errors(calibration, held_out, integrator, stages))
    return replace(calibration, validation={**calibration.validation, **figures})


def turn_figures(errors: np.ndarray) -> dict[str, float]:
    """Errors of gravity's direction on turns held out, as figures of a validation.

    Args:
        errors: Angles, shape (m,) [rad].
    """
    error_deg = np.degrees(errors)
    return {
        "gravity_direction_median_deg": float(np.median(error_deg)),
        "gravity_direction_rms_deg": float(np.sqrt(np.mean(error_deg**2))),
        "gravity_direction_max_deg": float(np.max(error_deg)),
        "held_out_turns": float(len(error_deg)),
    }
