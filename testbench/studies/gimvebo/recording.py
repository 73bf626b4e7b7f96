"""A session of the protocol gimvebo_gyro, cut into what calibrations are made from and judged
by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import TrueVector, static_poses
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest, Turn
from testbench.exceptions import SessionError
from testbench.frames import NANOSECONDS
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session

SENSOR = "imu"
REST_SAMPLES, TURN_SAMPLES = 100, 200
"""As Botina & Vergara 2018, section 3: 100 accelerations at rest on either side of 200 angular
rates.
"""
SETTLING_S = 0.5
"""A pose counts from this long after the arm was to have come to rest [s]."""
NONE = TriadCalibration("none")


@dataclass(frozen=True)
class Part:
    """One sensor on the gimbal: what its session gives.

    Attributes:
        session: Its name.
        gravity: Magnitude [m/s^2].
        accelerometer: Fitted to the section `poses`.
        fit: Rests and turns of the section `fit`, gravity by the calibrated accelerometer.
        held_out: Rests and turns of the section `held_out`, gravity by the same.
        held_out_raw: As held_out, gravity by the raw accelerometer.
        held_out_rests: Raw accelerations in the rests between the held-out turns, shape (n, 3) each
            [m/s^2].
    """

    session: str
    gravity: float
    accelerometer: TriadCalibration
    fit: GyroscopeRecording
    held_out: GyroscopeRecording
    held_out_raw: GyroscopeRecording
    held_out_rests: tuple[np.ndarray, ...]


def read_part(session: Session, estimate: Estimate) -> Part:
    """Cut a session at the steps of its protocol, on the clock that the estimate fitted.

    Raises:
        SessionError: Samples are missing, or a step is too short.
    """
    samples, time = session.imu(SENSOR), estimate.sensors[SENSOR].host_time_ns
    if len(samples) < 2 or (np.diff(samples.counter) != 1).any():
        raise SessionError(
            f"{session.path}: samples of '{SENSOR}' are missing; this study needs them all"
        )
    assert session.robot is not None  # the protocol ran on an arm
    gravity = float(np.linalg.norm(session.robot.gravity))
    interval = float(time[-1] - time[0]) / NANOSECONDS / (len(time) - 1)
    settling = round(SETTLING_S * NANOSECONDS)
    rests = np.array(
        [
            [
                np.searchsorted(time, step.settled_ns + settling, side="right"),
                np.searchsorted(time, step.end_ns),
            ]
            for step in session.steps
            if step.section == "poses"
        ]
    )
    poses = static_poses(samples.acc, rests, times=time / NANOSECONDS, true=TrueVector(gravity))
    accelerometer = norm_only(poses)
    left = np.linalg.norm(accelerometer.apply(poses.mean), axis=1) / gravity - 1
    up_sd = max(float(np.sqrt(np.mean(left**2))), 1e-6)
    cut = _Cut(samples.acc, samples.gyr, interval, up_sd)
    begins = {name: _begins(session, time, name, len(samples)) for name in ("fit", "held_out")}
    borders = [_rests(begin)[0] for begin in begins["held_out"]] + [
        _rests(begins["held_out"][-1])[1]
    ]
    return Part(
        session.name,
        gravity,
        accelerometer,
        cut(begins["fit"], accelerometer),
        cut(begins["held_out"], accelerometer),
        cut(begins["held_out"], NONE),
        tuple(samples.acc[slice(*border)] for border in borders),
    )


def _begins(session: Session, time: np.ndarray, section: str, n: int) -> list[int]:
    """The last sample before each move of a section."""
    steps = [step for step in session.steps if step.section == section]
    begins = [int(np.searchsorted(time, step.start_ns)) - 1 for step in steps]
    if not begins or begins[0] < REST_SAMPLES or begins[-1] + TURN_SAMPLES + REST_SAMPLES > n:
        raise SessionError(f"{session.path}: section '{section}' lacks the rests around its moves")
    if (np.diff(begins) < TURN_SAMPLES + REST_SAMPLES - 1).any():
        raise SessionError(
            f"{session.path}: the moves of section '{section}' follow one another too soon"
        )
    return begins


def _rests(begin: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Rows of the rests before and after the move that begins there; the last sample of one is the
    first of the turn.
    """
    after = begin + TURN_SAMPLES - 1
    return (begin + 1 - REST_SAMPLES, begin + 1), (after, after + REST_SAMPLES)


@dataclass(frozen=True)
class _Cut:
    """Rests and turns of raw samples at a regular interval [s]; up_sd: see `Turn`."""

    acc: np.ndarray
    gyr: np.ndarray
    interval: float
    up_sd: float

    def __call__(self, begins: list[int], accelerometer: TriadCalibration) -> GyroscopeRecording:
        force = accelerometer.apply(self.acc)
        rests, turns = [], []
        for begin in begins:
            (b0, b1), (a0, a1) = _rests(begin)
            before, after = force[b0:b1].mean(axis=0), force[a0:a1].mean(axis=0)
            rests.append(Rest(self.gyr[b0:b1], before))
            turn = slice(begin, begin + TURN_SAMPLES)
            up, then = before / np.linalg.norm(before), after / np.linalg.norm(after)
            turns.append(
                Turn(self.gyr[turn], self.interval, up, then, force=force[turn], up_sd=self.up_sd)
            )
        return GyroscopeRecording(rests, turns)
