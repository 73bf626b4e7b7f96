"""Strapdown navigation of a foot-mounted sensor with zero-velocity updates, and its smoother.

E. Foxlin: Pedestrian tracking with shoe-mounted inertial sensors, IEEE Computer Graphics and
Applications 25(6), 2005, for the error-state filter that is told of each stance. D. S. Colomar,
J.-O. Nilsson, P. Händel: Smoothing for ZUPT-aided INSs, IPIN 2012, for the fixed-interval smoother
over it; here in the form of A. E. Bryson and M. Frazier (G. J. Bierman, Fixed interval smoothing
with discrete measurements, International Journal of Control 18(1), 1973), which inverts no
covariance of the state.

Errors are those of position, velocity, attitude (about the axes of the world), of the biases of
gyroscope and accelerometer, and of the position at the last stance, three each. The last makes the
uncertainty of each stride a part of the state. Memory is bounded: the filter runs forward once,
keeping its state at the beginning of each chunk, and again chunk by chunk on the way back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from testbench.estimation.filters.maths import tilt, turned
from testbench.estimation.gait.strapdown_errors import (
    carry_back,
    carry_covariance,
    invert_three,
    make_symmetric,
)
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.rotation import product

STATES = 18
"""Of the errors: position 0, velocity 3, attitude 6, gyroscope's bias 9, accelerometer's bias 12,
position at the last stance 15.
"""
NOMINAL = 17
"""Kept of a sample: position 0, velocity 3, quaternion 6, biases 10 and 13, and 16: whether its
zero velocity was refused.
"""
COLUMNS = 14
"""Of a row: rate 0, force 3, time before it 6, what is known at it 7 to 11, uncertainty of the mean
force 12 and rate 13 since the sample before; see `rows_of`.
"""
CHUNK = 4096
"""Samples whose covariances are in memory at once."""

BETWEEN_SAMPLES = 1 / np.sqrt(12.0)
"""Between two samples a reading may have been anywhere between both: of their difference, the
standard uncertainty of a rectangular distribution (GUM 4.3.7).

It puts the error of a stride where it arises: at the impact of the heel, which no sensor of a few
hundred hertz resolves, and not evenly over the swing.
"""
FORCE_NOISE = 0.02
"""Of the force [m/s/sqrt(s)]: noise of consumer parts (100 to 300 ug/sqrt(Hz) are .001 to .003),
and cross-axis errors of up to 1 % in the swing.
"""
RATE_NOISE = np.radians(0.02)
"""Of the rate [rad/sqrt(s)]: twice the .01 deg/s/sqrt(Hz) of consumer parts' data sheets."""
RATE_BIAS_WALK = np.radians(0.002)
"""Of the gyroscope's bias [rad/s/sqrt(s)]: about .1 deg/s in an hour."""
FORCE_BIAS_WALK = 1e-4
"""Of the accelerometer's bias [m/s^2/sqrt(s)]."""
FORCE_BIAS_SD = 0.1
"""Of the accelerometer's bias at the start [m/s^2]: 10 mg."""
VELOCITY_SD, TILT_SD = 0.1, 0.05
"""At the start, in a stance [m/s], [rad]."""
TIED = 1e-4
"""Position and heading are counted from the start: held there to this [m], [rad]."""
UNKNOWN_FORCE = 20.0
"""Noise where no force was measured [m/s/sqrt(s)]."""
UNKNOWN_RATE = 0.5
"""Noise of the rate there [rad/sqrt(s)]."""
UNTOLD = 1e8
"""Variance of a coordinate that a measurement says nothing of [m^2]."""
FIRST = (3, 9, 0)
"""Errors that the three kinds of measurement are of: velocity, gyroscope's bias, position."""
REFUSED_OVER = 30.0
"""A zero velocity whose first normalised innovation squared exceeds this is none: a moment of the
swing that looks like a stance. (Of 3 degrees of freedom 16 is exceeded once in a thousand.)
"""


@dataclass(frozen=True)
class Known:
    """What is known at each sample beside the readings; 0 where nothing is.

    Attributes:
        velocity_sd: Standard uncertainty of "its velocity is 0", shape (n,) [m/s].
        begins: 1 at the first sample of each interval of zero velocity, 2 where it is a rest that
            cannot be refused, shape (n,).
        rate_sd: Of "it does not turn", shape (n,) [rad/s].
        height_sd: Of "it is at the height of the start", shape (n,) [m].
        anchor: Whether a stride ends and the next one begins here, shape (n,), bool.
    """

    velocity_sd: np.ndarray
    begins: np.ndarray
    rate_sd: np.ndarray
    height_sd: np.ndarray
    anchor: np.ndarray


@dataclass(frozen=True)
class Track:
    """Where a sensor went; the world is z up, x towards the sensor's heading at the start.

    Attributes:
        position: Counted from the start, shape (n, 3) [m].
        velocity: Shape (n, 3) [m/s].
        q_world_from_sensor: Shape (n, 4).
        gyr_bias: Shape (n, 3) [rad/s].
        position_covariance: At each anchor, shape (m, 3, 3) [m^2].
        stride_covariance: Of the way since the anchor before, shape (m, 3, 3) [m^2].
        innovation: Mean normalised innovation squared of the first zero velocity of each stance, by
            its three degrees of freedom [1]; NaN without one.
        refused: Samples whose zero velocity was refused, shape (n,), bool.
    """

    position: np.ndarray
    velocity: np.ndarray
    q_world_from_sensor: np.ndarray
    gyr_bias: np.ndarray
    position_covariance: np.ndarray
    stride_covariance: np.ndarray
    innovation: float
    refused: np.ndarray


def rows_of(gyr: np.ndarray, acc: np.ndarray, steps: np.ndarray, known: Known) -> np.ndarray:
    """All that the filter takes, a row a sample, shape (n, COLUMNS).

    Args:
        gyr: Angular rate, shape (n, 3) [rad/s].
        acc: Specific force, shape (n, 3) [m/s^2].
        steps: Time before each sample, shape (n,) [s].
        known: Beside them.
    """
    of_each = (known.velocity_sd, known.begins, known.rate_sd, known.height_sd, known.anchor)
    between = BETWEEN_SAMPLES * _jumps(acc), BETWEEN_SAMPLES * _jumps(gyr)
    return np.column_stack([gyr, acc, steps, *of_each, *between]).astype(float)


def _jumps(readings: np.ndarray) -> np.ndarray:
    """Size of the difference from the sample before, shape (n, 3) to (n,); 0 where unknown."""
    return rotation.lengths(np.nan_to_num(np.diff(readings, axis=0, prepend=readings[:1])))


def navigate(rows: np.ndarray, force: np.ndarray, bias: np.ndarray, bias_sd: float) -> Track:
    """Run the filter and the smoother, from a first sample in a stance.

    Args:
        rows: As of `rows_of`, shape (n, COLUMNS).
        force: Mean specific force of the first stance, shape (3,) [m/s^2].
        bias: Of the gyroscope at the start, shape (3,) [rad/s].
        bias_sd: Its standard uncertainty [rad/s].
    """
    state = np.zeros(NOMINAL)
    state[6:10] = tilt(force)
    state[10:13] = bias
    sds = [TIED] * 3 + [VELOCITY_SD] * 3 + [TILT_SD] * 2 + [TIED]
    sds += [bias_sd] * 3 + [FORCE_BIAS_SD] * 3 + [TIED] * 3
    cov = np.diag(np.square(np.array(sds)))
    starts = range(0, len(rows), CHUNK)
    at_start = []
    score = np.zeros(2)
    store = _store(min(CHUNK, len(rows)))
    for start in starts:
        at_start.append((state.copy(), cov.copy()))
        _forward(rows, start, state, cov, score, store)
    anchors = int(rows[:, 11].sum())
    smoothed = np.empty((len(rows), NOMINAL))
    covariances = np.empty((anchors, 2, 3, 3))
    costate, information = np.zeros(STATES), np.zeros((STATES, STATES))
    left = anchors
    for start, (state, cov) in zip(reversed(starts), reversed(at_start), strict=True):
        if len(starts) > 1:
            _forward(rows, start, state, cov, np.zeros(2), store)
        left = _backward(rows, start, store, (costate, information), smoothed, covariances, left)
    return Track(
        smoothed[:, 0:3],
        smoothed[:, 3:6],
        smoothed[:, 6:10],
        smoothed[:, 10:13],
        covariances[:, 0],
        covariances[:, 1],
        score[0] / (3 * score[1]) if score[1] else float("nan"),
        smoothed[:, 16] > 0,
    )


Store = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Of each sample of a chunk: state (NOMINAL,), covariance (18, 18), rotation and the cross product
of the force in the world side by side (3, 6); of each of its three kinds of update: gain (18, 3),
weight S^-1 (3, 3) and S^-1 z (3,).
"""


def _store(count: int) -> Store:
    return (
        np.empty((count, NOMINAL)),
        np.empty((count, STATES, STATES)),
        np.empty((count, 3, 6)),
        np.empty((count, 3, STATES, 3)),
        np.empty((count, 3, 3, 3)),
        np.empty((count, 3, 3)),
    )


@njit(cache=True)
def _matrix(state: np.ndarray) -> np.ndarray:
    """The rotation matrix of a state, shape (NOMINAL,) to (3, 3)."""
    # R of a unit quaternion (Solà, Quaternion kinematics for the error-state Kalman filter, 2017,
    # section 2)
    w, x, y, z = state[6], state[7], state[8], state[9]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@njit(cache=True)
def _corrected(state: np.ndarray, error: np.ndarray) -> None:
    """Add errors to a nominal state.

    Args:
        state: Shape (NOMINAL,); updated.
        error: Shape (18,).
    """
    # what is added: position, velocity, biases
    for i in range(3):
        state[i] += error[i]
        state[3 + i] += error[3 + i]
        state[10 + i] += error[9 + i]
        state[13 + i] += error[12 + i]
    # q <- exp(e / 2) q: errors of attitude turn about the axes of the world
    turn = turned(1.0, 0.0, 0.0, 0.0, error[6], error[7], error[8])
    q = product(turn, (state[6], state[7], state[8], state[9]))
    state[6], state[7], state[8], state[9] = q


@njit(cache=True)
def _predicted(
    row: np.ndarray, before: np.ndarray, state: np.ndarray, cov: np.ndarray, turn: np.ndarray
) -> None:
    """The strapdown equations over one step, by the trapezium rule, and P <- F P F' + Q.

    Args:
        row: As of `rows_of`, shape (COLUMNS,).
        before: The row before it, shape (COLUMNS,).
        state: Shape (NOMINAL,); updated.
        cov: P, shape (18, 18); updated.
        turn: Filled as for `carry_covariance`, shape (3, 6).
    """
    h = row[6]
    first, last = _matrix(state), state[6:10]
    w, x, y, z = last[0], last[1], last[2], last[3]
    # q <- q exp(h (w - b) / 2), the rate by the trapezium rule
    rx = h * (0.5 * (before[0] + row[0]) - state[10])
    ry = h * (0.5 * (before[1] + row[1]) - state[11])
    rz = h * (0.5 * (before[2] + row[2]) - state[12])
    w, x, y, z = turned(w, x, y, z, rx, ry, rz)
    size = np.sqrt(w * w + x * x + y * y + z * z)
    last[0], last[1], last[2], last[3] = w / size, x / size, y / size, z / size
    then = _matrix(state)
    force = np.zeros(3)
    # f = R (a - b), the mean of both ends of the step
    for i in range(3):
        for j in range(3):
            force[i] += 0.5 * first[i, j] * (before[3 + j] - state[13 + j])
            force[i] += 0.5 * then[i, j] * (row[3 + j] - state[13 + j])
    measured = np.isfinite(force[0] + force[1] + force[2])
    # without a force: as at rest, and as unsure as `UNKNOWN_FORCE`
    if not measured:
        force[0], force[1], force[2] = 0.0, 0.0, STANDARD_GRAVITY
    for i in range(3):
        # v <- v + h (f + g), p <- p + h (v + v') / 2
        speed = state[3 + i]
        state[3 + i] += h * (force[i] - (STANDARD_GRAVITY if i == 2 else 0.0))
        state[i] += 0.5 * h * (speed + state[3 + i])
        for j in range(3):
            # R halfway, the attitude that F takes
            turn[i, j] = 0.5 * (first[i, j] + then[i, j])
            turn[i, 3 + j] = 0.0
    # -[f x]: how an error of attitude turns the force, d(v)/dt = -[f x] e (Foxlin 2005)
    turn[0, 4], turn[0, 5] = force[2], -force[1]
    turn[1, 3], turn[1, 5] = -force[2], force[0]
    turn[2, 3], turn[2, 4] = force[1], -force[0]
    carry_covariance(cov, turn, h)
    # Q: white noise over the step, and what no sample shows between this one and the last
    q_force, q_rate = UNKNOWN_FORCE**2 * h, UNKNOWN_RATE**2 * h
    if measured:
        q_force, q_rate = FORCE_NOISE**2 * h, RATE_NOISE**2 * h
    q_force += (h * row[12]) ** 2
    q_rate += (h * row[13]) ** 2
    for i in range(3):
        cov[3 + i, 3 + i] += q_force
        cov[6 + i, 6 + i] += q_rate
        # biases walk
        cov[9 + i, 9 + i] += RATE_BIAS_WALK**2 * h
        cov[12 + i, 12 + i] += FORCE_BIAS_WALK**2 * h


@njit(cache=True)
def _updated(
    state: np.ndarray,
    cov: np.ndarray,
    first: int,
    z: np.ndarray,
    variances: np.ndarray,
    kept: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Use a measurement of three neighbouring errors; P <- P - K S K'.

    Args:
        state: Shape (NOMINAL,); updated.
        cov: P, shape (18, 18); updated.
        first: Which error the first of the three is.
        z: What was measured less what was predicted, shape (3,).
        variances: Of it, shape (3,).
        kept: Filled with the gain K (18, 3), S^-1 (3, 3) and S^-1 z (3,).
    """
    gain, weight, weighted = kept
    s, error = np.empty((3, 3)), np.zeros(STATES)
    # S = H P H' + V, H taking three errors that follow one another
    for i in range(3):
        for j in range(3):
            s[i, j] = cov[first + i, first + j] + (variances[i] if i == j else 0.0)
    invert_three(s, weight)
    for i in range(3):
        # S^-1 z, which the smoother takes (Bierman 1973)
        weighted[i] = weight[i, 0] * z[0] + weight[i, 1] * z[1] + weight[i, 2] * z[2]
    # K = P H' S^-1, and the error K z
    for i in range(len(cov)):
        for j in range(3):
            gain[i, j] = 0.0
            for k in range(3):
                gain[i, j] += cov[i, first + k] * weight[k, j]
            error[i] += gain[i, j] * z[j]
    # P <- P - K H P, which is P - K S K'
    across = cov[first : first + 3, :].copy()
    for i in range(len(cov)):
        for j in range(len(cov)):
            for k in range(3):
                cov[i, j] -= gain[i, k] * across[k, j]
    make_symmetric(cov)
    _corrected(state, error)


@njit(cache=True)
def _still(row: np.ndarray, state: np.ndarray, cov: np.ndarray, score: np.ndarray) -> bool:
    """Whether the zero velocity of a sample is used; counts innovations of intervals that begin.

    Args:
        row: As of `rows_of`, shape (COLUMNS,).
        state: Shape (NOMINAL,); its mark of refusal is updated.
        cov: P, shape (18, 18).
        score: Sum and number of normalised innovations squared, shape (2,); updated.
    """
    if row[7] <= 0.0:
        state[16] = 0.0
        return False
    if row[8] > 0.0:
        # z' S^-1 z of the first zero velocity of an interval: chi-square of 3 degrees of freedom
        # (Bar-Shalom, Li & Kirubarajan, Estimation with Applications, 2001, section 5.4)
        s, weight, size = np.empty((3, 3)), np.empty((3, 3)), 0.0
        for i in range(3):
            for j in range(3):
                s[i, j] = cov[3 + i, 3 + j] + (row[7] ** 2 if i == j else 0.0)
        invert_three(s, weight)
        for i in range(3):
            for j in range(3):
                size += state[3 + i] * weight[i, j] * state[3 + j]
        state[16] = 1.0 if row[8] < 2.0 and size > REFUSED_OVER else 0.0
        if state[16] == 0.0:
            score[0] += size
            score[1] += 1.0
    return bool(state[16] == 0.0)


@njit(cache=True)
def _measured(
    kind: int, row: np.ndarray, state: np.ndarray, z: np.ndarray, variances: np.ndarray
) -> int:
    """What is known at a sample: zero velocity (kind 0), no turn (1), the height (2).

    Args:
        kind: Of the measurement.
        row: As of `rows_of`, shape (COLUMNS,).
        state: Shape (NOMINAL,).
        z: Filled with what was measured less what was predicted, shape (3,).
        variances: Filled with its variances, shape (3,).

    Returns:
        Which error the first of the three is.
    """
    sd = row[7] if kind == 0 else row[8 + kind]
    for i in range(3):
        variances[i] = sd * sd
        if kind == 0:
            # v = 0, so that z = -v
            z[i] = -state[3 + i]
        elif kind == 1:
            # w = 0, so that the reading is the bias
            z[i] = row[i] - state[10 + i]
        else:
            # the height is 0; nothing is said of the other two
            z[i] = -state[2] if i == 2 else 0.0
            variances[i] = sd * sd if i == 2 else UNTOLD
    return FIRST[kind]


@njit(cache=True)
def _forward(
    rows: np.ndarray,
    start: int,
    state: np.ndarray,
    cov: np.ndarray,
    score: np.ndarray,
    store: Store,
) -> None:
    """The filter over a chunk, as many samples as the store has room for.

    Args:
        rows: As of `rows_of`, shape (n, COLUMNS).
        start: First row of the chunk.
        state: Before the chunk, shape (NOMINAL,); updated.
        cov: P, shape (18, 18); updated.
        score: As of `_still`, shape (2,); updated.
        store: Filled.
    """
    states, covs, turns, gains, weights, weighted = store
    z, variances = np.empty(3), np.empty(3)
    for k in range(min(len(states), len(rows) - start)):
        row = rows[start + k]
        if start + k > 0:
            _predicted(row, rows[start + k - 1], state, cov, turns[k])
        still = _still(row, state, cov, score)
        for kind in range(3):
            # no update, unless one is made
            gains[k, kind, 0, 0] = np.nan
            if still if kind == 0 else row[8 + kind] > 0.0:
                first = _measured(kind, row, state, z, variances)
                kept = gains[k, kind], weights[k, kind], weighted[k, kind]
                _updated(state, cov, first, z, variances, kept)
        states[k] = state
        covs[k] = cov
        # the error at this anchor becomes that of the last one: the rows and columns of position
        if row[11] > 0.0:
            for i in range(3):
                cov[15 + i] = cov[i]
            for i in range(len(cov)):
                for j in range(3):
                    cov[i, 15 + j] = cov[i, j]


# One piece: the loops of a product of matrices of three rows.
@njit(cache=True)
def _unused(
    costate: np.ndarray,
    information: np.ndarray,
    first: int,
    kept: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Costate and information before a measurement was used (Bierman 1973).

    c <- c - H' (K' c + S^-1 z), I <- (1 - K H)' I (1 - K H) + H' S^-1 H

    Args:
        costate: c, shape (18,); updated.
        information: I, shape (18, 18); updated.
        first: Which error the first of the three is that H takes.
        kept: As of `_updated`.
    """
    gain, weight, weighted = kept
    across, own, along = np.zeros((3, STATES)), weight.copy(), weighted.copy()
    # along = K' c + S^-1 z, across = K' I
    for i in range(3):
        for k in range(len(information)):
            along[i] += gain[k, i] * costate[k]
            for j in range(len(information)):
                across[i, j] += gain[k, i] * information[k, j]
    # own = K' I K + S^-1, of (1 - K H)' I (1 - K H) + H' S^-1 H
    for i in range(3):
        for j in range(3):
            for k in range(len(information)):
                own[i, j] += across[i, k] * gain[k, j]
    for i in range(3):
        # c - H' along; I - H' K' I - I K H + H' own H
        costate[first + i] -= along[i]
        for j in range(len(information)):
            information[first + i, j] -= across[i, j]
            information[j, first + i] -= across[i, j]
    for i in range(3):
        for j in range(3):
            information[first + i, first + j] += own[i, j]


@njit(cache=True)
def _of_anchor(cov: np.ndarray, information: np.ndarray, out: np.ndarray) -> None:
    """Smoothed covariances P - P I P of the position, and of its way since the last anchor.

    Args:
        cov: P, shape (18, 18).
        information: I, shape (18, 18).
        out: Filled, shape (2, 3, 3).
    """
    half = np.zeros((6, STATES))
    whole = np.empty((6, 6))
    own = (0, 1, 2, 15, 16, 17)
    # P - P I P (Bierman 1973), of both positions alone
    for i in range(6):
        for j in range(len(cov)):
            for k in range(len(cov)):
                half[i, j] += cov[own[i], k] * information[k, j]
    for i in range(6):
        for j in range(6):
            whole[i, j] = cov[own[i], own[j]]
            for k in range(len(cov)):
                whole[i, j] -= half[i, k] * cov[k, own[j]]
    for i in range(3):
        for j in range(3):
            # var(p), and var(p - p') = A - B - B' + C of its blocks
            out[0, i, j] = whole[i, j]
            out[1, i, j] = whole[i, j] - whole[i, 3 + j] - whole[3 + i, j] + whole[3 + i, 3 + j]


# One piece: what happens at a sample, in the reverse order of `_forward`.
@njit(cache=True)
def _backward(
    rows: np.ndarray,
    start: int,
    store: Store,
    behind: tuple[np.ndarray, np.ndarray],
    smoothed: np.ndarray,
    covariances: np.ndarray,
    left: int,
) -> int:
    """The smoother over a chunk, from its end (Bierman 1973, eqs 3.8 to 3.12).

    Args:
        rows: As of `rows_of`, shape (n, COLUMNS).
        start: First row of the chunk.
        store: As `_forward` filled it.
        behind: Costate, shape (18,), and its information, shape (18, 18), of all that follows;
            updated.
        smoothed: Of the whole recording, shape (n, NOMINAL); filled.
        covariances: Of position and of the way since the last anchor, at each anchor, shape
            (m, 2, 3, 3); filled.
        left: Anchors up to the end of the chunk.

    Returns:
        Anchors before it.
    """
    states, covs, turns, gains, weights, weighted = store
    costate, information = behind
    error = np.empty(STATES)
    for k in range(min(len(states), len(rows) - start) - 1, -1, -1):
        is_anchor = rows[start + k, 11] > 0.0
        if is_anchor:
            # transposed of what `_forward` does at an anchor: c and I of the last position, set
            # to this one there, are added to those of this one
            for i in range(3):
                costate[i] += costate[15 + i]
                costate[15 + i] = 0.0
                for j in range(len(error)):
                    information[i, j] += information[15 + i, j]
                    information[15 + i, j] = 0.0
            for i in range(3):
                for j in range(len(error)):
                    information[j, i] += information[j, 15 + i]
                    information[j, 15 + i] = 0.0
        # x = x_filtered - P c (Bierman 1973)
        for i in range(len(error)):
            error[i] = 0.0
            for j in range(len(error)):
                error[i] -= covs[k, i, j] * costate[j]
        smoothed[start + k] = states[k]
        _corrected(smoothed[start + k], error)
        if is_anchor:
            left -= 1
            _of_anchor(covs[k], information, covariances[left])
        # updates are undone in reverse order
        for kind in range(2, -1, -1):
            if not np.isnan(gains[k, kind, 0, 0]):
                kept = gains[k, kind], weights[k, kind], weighted[k, kind]
                _unused(costate, information, FIRST[kind], kept)
        if start + k > 0:
            step = rows[start + k, 6]
            carry_back(costate, information, turns[k], step)
            make_symmetric(information)
    return left
