"""The extended Kalman filter of Quijano & Valencia 2018 as its text prints it.

State: angle, rate and acceleration of each joint (eqs 3.19, 3.23), or the coefficients of a Fourier
series of four harmonics (eq 3.20) that do not change (L609), each with the segment lengths of eq
3.23 beside. Process noise Q = I and measurement noise R = 1000 I a sample (section 3.5), all states
0.1 and P = I at the start (section 3.3). The sensors have no errors of their own: what its vectors
W and Z were is not said.

What the text leaves open is settled in its favour: the base frequency is that of the motion, and
lengths start at those of the model, not at 0.1 m. Gravity stands in the sensor's frame, where an
accelerometer feels it; eqs 3.33 to 3.42 add it in another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.run import ChainSamples
from testbench.estimation.chain.sensors import ChainSensors, read_placement

START, PROCESS, MEASUREMENT = 0.1, 1.0, 1000.0
"""All states at the start; Q and R over the identity, a sample."""
HARMONICS = 4


@dataclass(frozen=True)
class Printed:
    """What the filter says after each sample of the first sensor.

    Attributes:
        time: Shape (n,) [s].
        mean: Angles [rad], rates [rad/s] and accelerations [rad/s^2], shape (n, 3, m).
        sd: Their standard deviations by the filter, likewise.
    """

    time: np.ndarray
    mean: np.ndarray
    sd: np.ndarray


def run_as_printed(
    sensors: ChainSensors, samples: ChainSamples, frequency: float | None
) -> Printed:
    """Run the filter over samples.

    Args:
        sensors: The chain, where its sensors are taken to sit.
        samples: What they read; those of the others are interpolated to the first one's instants.
        frequency: Base frequency of the Fourier state [Hz]; None for the kinematic one.
    """
    time, readings = _together(samples, len(sensors.sensors))
    m, lengths = len(sensors.joints), Constants.of(sensors, 0.0, 0.0, 1.0)
    motion_states = m * (2 * HARMONICS + 1) if frequency is not None else 3 * m
    n = motion_states + len(lengths.names)
    x = np.full(n, START)
    x[motion_states:] = _model_lengths(sensors, lengths)
    P, R = np.eye(n), MEASUREMENT * np.eye(readings.shape[1])
    means, sds = np.empty((len(time), 3, m)), np.empty((len(time), 3, m))
    for i, now in enumerate(time):
        if i > 0:
            F = _transition(n, m, now - time[i - 1], frequency)
            x = F @ x  # eq. 3.11
            P = F @ P @ F.T + PROCESS * np.eye(n)  # eq. 3.12
        D = _by_states(m, n, now - time[0], frequency)
        predicted, H = _predicted(sensors, lengths, x, D)
        # eqs 3.13 to 3.16
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        x = x + K @ (readings[i] - predicted)
        P = P - K @ H @ P
        P = 0.5 * (P + P.T)
        means[i] = np.einsum("omn,n->om", D, x)
        sds[i] = np.sqrt(np.maximum(np.einsum("omn,nk,omk->om", D, P, D, optimize=True), 0.0))
    return Printed(time, means, sds)


def _together(samples: ChainSamples, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Instants of the first sensor [s], and rates and forces of all at these, shape (n, 6 s)."""
    time = samples.time[samples.sensor == 0]
    columns = [
        np.interp(time, samples.time[samples.sensor == s], samples.reading[samples.sensor == s, r])
        for s in range(count)
        for r in range(6)
    ]
    return time, np.column_stack(columns)


def _model_lengths(sensors: ChainSensors, lengths: Constants) -> np.ndarray:
    """Of the segments whose lengths are states, as the model has them, shape (l,) [m]."""
    first = 6 * len(sensors.sensors)
    found = np.zeros(len(lengths.names))
    for s, j in zip(*np.nonzero(lengths.lengths >= 0), strict=True):
        found[lengths.lengths[s, j] - first] = np.linalg.norm(sensors.offsets[s, j])
    return found


def _transition(n: int, m: int, dt: float, frequency: float | None) -> np.ndarray:
    """F, shape (n, n): constant acceleration (eq. 3.23), or coefficients that do not change."""
    F = np.eye(n)
    if frequency is None:
        joints = np.arange(m)
        F[joints, m + joints] = F[m + joints, 2 * m + joints] = dt
        F[joints, 2 * m + joints] = 0.5 * dt**2
    return F


def _by_states(m: int, n: int, elapsed: float, frequency: float | None) -> np.ndarray:
    """Angles, rates and accelerations by the states, of which they are linear, shape (3, m, n)."""
    D, joints = np.zeros((3, m, n)), np.arange(m)
    if frequency is None:
        for order in range(3):
            D[order, joints, order * m + joints] = 1.0
        return D
    D[0, joints, joints] = 1.0
    for k in range(1, HARMONICS + 1):
        # eq. 3.20 and its first two derivatives by time
        w = 2 * np.pi * k * frequency
        c, s = np.cos(w * elapsed), np.sin(w * elapsed)
        at_a, at_b = m * (2 * k - 1) + joints, m * 2 * k + joints
        for order, (by_a, by_b) in enumerate(((c, s), (-w * s, w * c), (-(w**2) * c, -(w**2) * s))):
            D[order, joints, at_a], D[order, joints, at_b] = by_a, by_b
    return D


def _predicted(
    sensors: ChainSensors, lengths: Constants, x: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Readings of all sensors in a state, shape (6 s,), and H, shape (6 s, n)."""
    count, first = len(sensors.sensors), 6 * len(sensors.sensors)
    states = len(x) - len(lengths.names)
    own = x[states:]
    known = lengths.lengths >= 0
    offsets = sensors.offsets.copy()
    sizes = np.linalg.norm(offsets[known], axis=1)
    offsets[known] *= (own[lengths.lengths[known] - first] / sizes)[:, None]
    placed = replace(sensors, offsets=offsets)
    motion = np.einsum("omn,n->om", D, x)
    reading, by_q, by_v, by_a = placed.readings(*motion)
    H = by_q @ D[0] + by_v @ D[1] + by_a @ D[2]
    by_place, nothing = np.zeros((6, 6 + sensors.columns.shape[1])), np.zeros(6)
    for s in range(count):
        if not known[s].any():
            continue
        # a reading is linear in lengths; by_place is by the relative length of the model's
        read_placement(sensors.arrays, s, motion, nothing, by_place)
        for j in np.flatnonzero(known[s]):
            at = lengths.lengths[s, j] - first
            H[s, :, states + at] += by_place[:, 6 + j] / np.linalg.norm(sensors.offsets[s, j])
    return reading.reshape(-1), H.reshape(6 * count, -1)
