"""A recording, cut into what calibrations of a gyroscope are made from and judged by.

A session of the protocol gimvebo_gyro is cut at its steps; any other one at its rests, of which
every second rest and turn is held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration import prepared as made_ready
from testbench.estimation.calibration.gyroscope import gravity_turns, static_bias
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import StaticPoses, TrueVector, static_poses
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest, Turn
from testbench.exceptions import InputError, SessionError
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.integrators import Stages
from testbench.model.truth import truth_at
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session

SENSOR = "imu"
SECTIONS = ("poses", "fit", "held_out")
"""Of a protocol whose session is cut at its steps."""
REST_S, TURN_S = 2.0, 4.0
"""As Botina & Vergara 2018, section 3: 100 accelerations at rest on either side of 200 angular
rates, at 20 ms [s].
"""
SETTLING_S = 0.5
"""A pose counts from this long after the arm was to have come to rest [s]."""
FEWEST_RESTS, FEWEST_TURNS, FEWEST_APART = 18, 7, 14
"""Of a recording without sections: nine parameters of the accelerometer by every second rest, and
seven turns of the gyroscope; so many turns that every second one can be held out.
"""
NONE = TriadCalibration("none")


@dataclass(frozen=True)
class Part:
    """One sensor that was turned from rest to rest: what its session gives.

    Attributes:
        session: Its name.
        gravity: Magnitude [m/s^2].
        accelerometer: Fitted to poses that are not held out.
        fit: Rests and turns that a gyroscope is calibrated from, gravity by the calibrated
            accelerometer.
        held_out: Rests and turns that judge it, gravity by the same.
        held_out_raw: As held_out, gravity by the raw accelerometer.
        held_out_rests: Raw accelerations in the rests that are held out, shape (n, 3) each [m/s^2].
        true_turns: True q_before_from_after of each held-out turn in the axes of the calibrated
            accelerometer, shape (m, 4); None where nobody knows.
        stages: Where integrators get the rates inside a step; their best if None.
        fitted: Whether the turns that judge are those that were fitted, for want of others.
    """

    session: str
    gravity: float
    accelerometer: TriadCalibration
    fit: GyroscopeRecording
    held_out: GyroscopeRecording
    held_out_raw: GyroscopeRecording
    held_out_rests: tuple[np.ndarray, ...]
    true_turns: np.ndarray | None = None
    stages: Stages | None = None
    fitted: bool = False

    @property
    def knows_force(self) -> bool:
        """Whether the force was recorded in motion, which a response to it asks for."""
        return all(turn.force is not None for turn in self.fit.turns)

    def every(self, count: int) -> Part:
        """As of a sensor that takes only one sample of so many while it turns."""
        keys = ("fit", "held_out", "held_out_raw")
        return replace(self, **{key: getattr(self, key).every(count) for key in keys})

    @property
    def interval(self) -> float:
        """Between samples [s]."""
        return self.held_out.turns[0].interval


def bias_of(part: Part) -> TriadCalibration:
    """The bias alone of a gyroscope: by its rests, or where none was recorded by its turns."""
    if part.fit.rests:
        return static_bias(part.fit)
    return TriadCalibration("turns", bias=gravity_turns(part.fit).bias)


def has_sections(session: Session) -> bool:
    """Whether a session was run by a protocol with the sections of gimvebo_gyro."""
    return {*SECTIONS} <= {step.section for step in session.steps}


def lacking(session: Session) -> list[str]:
    """What a session without sections lacks to be cut; empty where nothing is."""
    names = session.sensor_names
    if len(names) != 1:
        return [f"one sensor (there are {len(names)}: {', '.join(names)})"]
    samples = session.imu(names[0])
    missing = [
        f"readings of the {title}"
        for key, title in (("acc", "accelerometer"), ("gyr", "gyroscope"))
        if not np.isfinite(getattr(samples, key)).any()
    ]
    if missing:
        return missing
    wanted = f"{FEWEST_RESTS} rests with {FEWEST_TURNS} turns between them"
    try:
        prepared = made_ready.prepare(CalibrationRecording.of(session, names[0]), None)
    except InputError as error:
        return [f"{wanted} ({error})"]
    rests = len(prepared.rests)
    turns = rests - 1 if prepared.parted is None else len(prepared.parted.turns)
    if rests >= FEWEST_RESTS and turns >= FEWEST_TURNS:
        return []
    return [f"{wanted} (there are {rests} and {max(turns, 0)})"]


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
    up_sd = _up_sd(poses, accelerometer, gravity)
    cut = _Cut(
        samples.acc,
        samples.gyr,
        interval,
        up_sd,
        (round(REST_S / interval), round(TURN_S / interval)),
    )
    begins = {name: _begins(session, time, name, cut) for name in ("fit", "held_out")}
    borders = [cut.rests(begin)[0] for begin in begins["held_out"]]
    borders += [cut.rests(begins["held_out"][-1])[1]]
    return Part(
        session.name,
        gravity,
        accelerometer,
        cut(begins["fit"], accelerometer),
        cut(begins["held_out"], accelerometer),
        cut(begins["held_out"], NONE),
        tuple(samples.acc[slice(*border)] for border in borders),
        _true_turns(session, time, begins["held_out"], cut, poses, accelerometer),
    )


def read_recording(session: Session) -> Part:
    """Cut a recording at its rests; every second rest and turn is held out.

    Raises:
        InputError: It never rests.
        PoorExcitation: The rests do not determine the accelerometer.
    """
    (sensor,) = session.sensor_names
    ready = made_ready.prepare(CalibrationRecording.of(session, sensor), None)
    apart = ready.parted is not None  # each turn then has two rests of its own
    even = np.arange(len(ready.rests)) // (2 if apart else 1) % 2 == 0
    accelerometer = norm_only(ready.poses.subset(even))
    recording, raw = (ready.gyroscope_recording(each) for each in (accelerometer, None))
    fitted = len(recording.turns) < FEWEST_APART
    own, other = (slice(None), slice(None)) if fitted else (slice(0, None, 2), slice(1, None, 2))
    judged = GyroscopeRecording(recording.rests[other], recording.turns[other])
    return Part(
        session.name,
        float(np.linalg.norm(ready.gravity)),
        accelerometer,
        GyroscopeRecording(recording.rests[own], recording.turns[own]),
        judged,
        GyroscopeRecording(raw.rests[other], raw.turns[other]),
        tuple(ready.samples.acc[slice(*border)] for border in ready.rests[~even]),
        _known_turns(judged.turns, ready, accelerometer),
        fitted=fitted,
    )


def _known_turns(
    turns: Sequence[Turn], ready: made_ready.Prepared, accelerometer: TriadCalibration
) -> np.ndarray | None:
    """True turns of a recording with a truth, in the axes of the calibrated accelerometer."""
    attitudes = [turn.q_world_from_sensor for turn in turns]
    if ready.poses.expected is None or any(q is None for q in attitudes):
        return None
    axes = _calibrated_axes(accelerometer.apply(ready.poses.mean), ready.poses.expected)
    before, after = (np.array([q[k] for q in attitudes if q is not None]) for k in (0, -1))
    return _in_axes(rotation.multiply(rotation.conjugate(before), after), axes)


def _up_sd(poses: StaticPoses, accelerometer: TriadCalibration, gravity: float) -> float:
    """Standard uncertainty of gravity's direction by what the calibration leaves of its norm."""
    left = np.linalg.norm(accelerometer.apply(poses.mean), axis=1) / gravity - 1
    return max(float(np.sqrt(np.mean(left**2))), 1e-6)


def _true_turns(
    session: Session,
    time: np.ndarray,
    begins: list[int],
    cut: _Cut,
    poses: StaticPoses,
    accelerometer: TriadCalibration,
) -> np.ndarray | None:
    """By the arm, from the rest before each move to the rest after it, shape (m, 4)."""
    truth = session.truth(SENSOR)
    if truth is None or session.robot is None or poses.start is None or poses.end is None:
        return None
    middle = np.round((poses.start + poses.end) / 2 * NANOSECONDS).astype(np.int64)
    attitudes = truth_at(truth, middle)
    force = rotation.rotate(rotation.conjugate(attitudes), -np.asarray(session.robot.gravity))
    axes = _calibrated_axes(accelerometer.apply(poses.mean), force)
    before, after = (
        truth_at(truth, time[np.array(begins) + shift]) for shift in (0, cut.counts[1] - 1)
    )
    return _in_axes(rotation.multiply(rotation.conjugate(before), after), axes)


def _calibrated_axes(felt: np.ndarray, true: np.ndarray) -> np.ndarray:
    """q_calibrated_from_sensor, by gravity in many poses (Wahba's problem), shape (4,).

    Args:
        felt: Specific force by the calibrated accelerometer, shape (k, 3).
        true: The same by the arm, in the sensor's axes, shape (k, 3).
    """
    found, _ = Rotation.align_vectors(felt, true)
    return np.asarray(found.as_quat(scalar_first=True))


def _in_axes(turns: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Turns of the sensor's axes as turns of others: q t conj(q)."""
    return rotation.multiply(rotation.multiply(axes, turns), rotation.conjugate(axes))


def _begins(session: Session, time: np.ndarray, section: str, cut: _Cut) -> list[int]:
    """The last sample before each move of a section."""
    rest, turn = cut.counts
    steps = [step for step in session.steps if step.section == section]
    begins = [int(np.searchsorted(time, step.start_ns)) - 1 for step in steps]
    if not begins or begins[0] < rest or begins[-1] + turn + rest > len(time):
        raise SessionError(f"{session.path}: section '{section}' lacks the rests around its moves")
    if (np.diff(begins) < turn + rest - 1).any():
        raise SessionError(
            f"{session.path}: the moves of section '{section}' follow one another too soon"
        )
    return begins


@dataclass(frozen=True)
class _Cut:
    """Rests and turns of raw samples at a regular interval.

    Attributes:
        acc: Raw, shape (n, 3) [m/s^2].
        gyr: Raw, shape (n, 3) [rad/s].
        interval: Between samples [s].
        up_sd: As `Turn` has it.
        counts: Samples of a rest and of a turn.
    """

    acc: np.ndarray
    gyr: np.ndarray
    interval: float
    up_sd: float
    counts: tuple[int, int]

    def rests(self, begin: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Rows of the rests before and after the move that begins there.

        The last sample of one is the first of the turn.
        """
        rest, turn = self.counts
        after = begin + turn - 1
        return (begin + 1 - rest, begin + 1), (after, after + rest)

    def __call__(self, begins: list[int], accelerometer: TriadCalibration) -> GyroscopeRecording:
        force = accelerometer.apply(self.acc)
        rests, turns = [], []
        for begin in begins:
            (b0, b1), (a0, a1) = self.rests(begin)
            before, after = force[b0:b1].mean(axis=0), force[a0:a1].mean(axis=0)
            rests.append(Rest(self.gyr[b0:b1], before))
            turn = slice(begin, begin + self.counts[1])
            up, then = before / np.linalg.norm(before), after / np.linalg.norm(after)
            turns.append(
                Turn(self.gyr[turn], self.interval, up, then, force=force[turn], up_sd=self.up_sd)
            )
        return GyroscopeRecording(rests, turns)
