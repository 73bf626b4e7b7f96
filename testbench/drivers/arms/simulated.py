"""A simulated arm: servo lag, noisy and rounding encoders, and joints slightly off from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from testbench.clock import SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.catalogue import SIM
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.session_time import VirtualTime
from testbench.exceptions import DriverError
from testbench.frames import NANOSECONDS
from testbench.model.noise import random_stream
from testbench.model.servo import servo_parameters, servo_update
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event, step_events
from testbench.records.session.trajectory import Trajectory, TrueState
from testbench.records.specs.robot import Robot

STOP_TIME_S = 0.5
KEPT_INSTANTS = 256
"""Control instants that stay known after the next reading: a sensor's jitter may ask for a moment
before its beginning.
"""


class SimulatedArm(SteppingArm):
    """An arm in virtual time, which follows the plan to the nanosecond.

    Each joint follows its reference as a second-order servo, solved exactly between control
    instants. Its true angle differs from the servo's by a repeatability error that is redrawn with
    every move and blends over the move; its reading is the servo's angle, rounded and noisy.
    `true_state` is what the simulated sensors feel; nothing else may ask for it.

    Args:
        robot: Servo, encoder and rates.
        seed: Of the run.
        joint_errors: Whether the joints' zeros are off as the robot file's uncertainty says; drawn
            once for the run, felt by the sensors and not seen by the encoders.
        time: Of the session; as fast as the machine goes if None.
    """

    entry = SIM
    time: VirtualTime
    usual_guards = None
    attended = False
    coming = ""
    rests_after_ns = NANOSECONDS

    def __init__(
        self,
        robot: Robot,
        seed: int,
        joint_errors: bool = False,
        time: VirtualTime | None = None,
    ):
        self.robot, self.seed = robot, seed
        self.time = time or VirtualTime(SystemClock())
        self.zero_errors = (
            draw_zero_errors(robot, seed) if joint_errors else np.zeros(len(robot.joint_names))
        )
        self._period_ns = round(NANOSECONDS / robot.spec.rates.control_hz)
        self._every = max(round(robot.spec.rates.control_hz / robot.spec.rates.record_hz), 1)
        self._noise = random_stream(seed, "arm", "encoder")
        self._reference: Trajectory | None = None
        self._stopped_at: int | None = None
        self._planned: list[Event] = []
        self._told = self._read_ns = 0
        self._waits: list[Event] = []

    def connect(self) -> None:
        """Nothing to connect to."""

    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """The plan was checked, and is followed as a whole."""

    def prepare(self, plan: Plan) -> None:
        """Take the plan; draw the repeatability error of each of its moves."""
        self._reference = plan.trajectory
        self._end_ns = int(plan.trajectory.time_ns[-1])
        self._planned = step_events(plan.steps)
        self._error = self._repeatability(plan)
        q0 = plan.trajectory.q[0]
        self._servo = np.stack([q0, np.zeros_like(q0)])
        self._update = servo_update(self.robot, self._period_ns / NANOSECONDS)
        e0 = self._error.q[0]
        self._times = np.zeros(1, dtype=np.int64)
        self._true = np.stack([q0 + e0, np.zeros_like(q0), np.zeros_like(q0)])[None]
        self._next = 1
        self._kicked = False

    def kickoff(self) -> None:
        """Begin."""
        if self._reference is None:
            raise DriverError("the simulated arm was started before it was prepared")
        self.time.start()
        self._kicked = True

    def next_ns(self, after_ns: int) -> int:
        """Not past the end of the motion at one go."""
        until_ns = super().next_ns(after_ns)
        return min(until_ns, self._end_ns) if after_ns < self._end_ns else until_ns

    def read(self, until_ns: int) -> ArmSamples:
        """Let virtual time pass."""
        if self._reference is None or not self._kicked:
            raise DriverError("the simulated arm was read before it was started")
        self.time.wait_until(until_ns)
        self._read_ns = max(self._read_ns, until_ns)
        last = (
            until_ns // self._period_ns + 1
        )  # one control period ahead, so that sensors can interpolate
        ticks = np.arange(self._next - 1, last + 1)
        times = ticks * self._period_ns
        sent = self._sent(times)
        servo = servo_response(*self._update, self._servo, sent)
        omega, damping = servo_parameters(self.robot)
        acceleration = omega**2 * (sent - servo[:, 0]) - 2 * damping * omega * servo[:, 1]
        error = np.stack(self._error.at(times), axis=1)
        true = np.concatenate([servo, acceleration[:, None]], axis=1) + error
        self._times = np.concatenate([self._times[-KEPT_INSTANTS:], times[1:]])
        self._true = np.concatenate([self._true[-KEPT_INSTANTS:], true[1:]])
        self._servo, self._next = servo[-1], last + 1
        keep = ticks[1:] % self._every == 0
        return self._samples(times[1:][keep], sent[1:][keep], servo[1:][keep])

    def true_state(self, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """True motion of the joints at times within what was just read.

        Args:
            time_ns: Shape (n,) [ns].

        Returns:
            Joint angles [rad], rates [rad/s] and accelerations [rad/s^2], each of shape
            (n, n_joints).
        """
        return Trajectory(self._times, self._true[:, 0], self._true[:, 1], self._true[:, 2]).at(
            time_ns
        )

    @property
    def felt(self) -> TrueState:
        return self.true_state

    @property
    def finished(self) -> bool:
        return self._reference is not None and self._read_ns >= self._end_ns

    def events(self) -> list[Event]:
        """What the plan says of the time that was read; the end of it belongs to the next."""
        begin, end_ns = self._told, self._read_ns if self._stopped_at is None else 0
        while self._told < len(self._planned) and self._planned[self._told].host_time_ns < end_ns:
            self._told += 1
        waits, self._waits = self._waits, []
        return waits + self._planned[begin : self._told]

    def pause(self) -> bool:
        """Rest at once: virtual time stands still."""
        self.time.hold()
        self._waits.append(Event(self.time.now_ns(), "paused", {}))
        return True

    def resume(self) -> None:
        self.time.go_on()
        self._waits.append(Event(self.time.now_ns(), "resumed", {}))

    def stop(self) -> None:
        """Freeze the reference; the servo brings the joints to rest."""
        self.time.go_on()
        if self._stopped_at is None and self._reference is not None:
            self._stopped_at = (self._next - 1) * self._period_ns

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"speed": self.time.speed}

    def close(self) -> None:
        """Nothing to let go of."""

    def _sent(self, times: np.ndarray) -> np.ndarray:
        assert self._reference is not None
        if self._stopped_at is None:
            return self._reference.at(times)[0]
        q, v, _ = self._reference.at(np.array([self._stopped_at]))
        t = np.clip((times - self._stopped_at) / NANOSECONDS, 0.0, STOP_TIME_S)[:, None]
        return np.asarray(q + v * (t - t**2 / (2 * STOP_TIME_S)))

    def _samples(self, times: np.ndarray, sent: np.ndarray, servo: np.ndarray) -> ArmSamples:
        spec = self.robot.spec.servo
        noise = self._noise.standard_normal((len(times), 2, sent.shape[1]))
        q = servo[:, 0] + np.radians(spec.encoder_noise_deg) * noise[:, 0]
        if spec.encoder_resolution_deg:
            count = np.radians(spec.encoder_resolution_deg)
            q = np.round(q / count) * count
        v = servo[:, 1] + np.radians(spec.velocity_noise_deg_s) * noise[:, 1]
        return ArmSamples(self.robot.joint_names, times, sent, q, v)

    def _repeatability(self, plan: Plan) -> Trajectory:
        """Error of the true angles: that of the zeros, and another of each move, blended smoothly
        over it.
        """
        sd = np.radians(self.robot.spec.servo.repeatability_deg)
        rng = random_stream(self.seed, "arm", "repeatability")
        joints = len(self.robot.joint_names)
        times, errors = [0], [sd * rng.standard_normal(joints)]
        for step in plan.steps:
            if step.settled_ns > step.start_ns:
                if step.start_ns > times[-1]:
                    times.append(step.start_ns)
                    errors.append(errors[-1])
                times.append(step.settled_ns)
                errors.append(sd * rng.standard_normal(joints))
        end = max(plan.trajectory.time_ns[-1], times[-1]) + 3600 * NANOSECONDS
        q = np.array([*errors, errors[-1]]) + self.zero_errors
        return Trajectory(
            np.array([*times, end], dtype=np.int64), q, np.zeros_like(q), np.zeros_like(q)
        )


def simulated_arm(plan: Plan, wanted: WantedArm, time: VirtualTime | None = None) -> SimulatedArm:
    """The model of a plan's arm."""
    joint_errors = plan.protocol.spec.environment.joint_errors
    return SimulatedArm(plan.robot, wanted.seed, joint_errors, time)


def draw_zero_errors(robot: Robot, seed: int) -> np.ndarray:
    """True minus encoder angle of each joint through a whole run, shape (n_joints,) [rad]."""
    return robot.joint_angle_uncertainty * random_stream(seed, "arm", "zeros").standard_normal(
        len(robot.joint_names)
    )


@njit(cache=True)
def servo_response(
    Phi: np.ndarray, now: np.ndarray, following: np.ndarray, start: np.ndarray, sent: np.ndarray
) -> np.ndarray:
    """Angles and rates of joints that follow a reference.

    The state x of a joint is its angle and rate, u its reference: x+ = Phi x + now u + following u+
    over one control period.

    Args:
        Phi: Influence of the state, shape (2, 2).
        now: Influence of the reference at the beginning of the period, shape (2,).
        following: Influence of the reference at its end, shape (2,).
        start: First state of m joints, shape (2, m) [rad, rad/s].
        sent: Reference, shape (n, m) [rad].

    Returns:
        States, shape (n, 2, m) [rad, rad/s]; the first one is the start.
    """
    n, m = sent.shape
    states = np.empty((n, 2, m))
    states[0] = start
    for i in range(1, n):
        for j in range(m):
            q, v = states[i - 1, 0, j], states[i - 1, 1, j]
            for r in range(2):
                # x+ = Phi x + now u + following u+, exact for a reference that is straight in
                # between
                states[i, r, j] = (
                    Phi[r, 0] * q
                    + Phi[r, 1] * v
                    + now[r] * sent[i - 1, j]
                    + following[r] * sent[i, j]
                )
    return states
