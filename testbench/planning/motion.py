"""Timing of motion: the one door to ruckig.

Moves go from rest to rest, jerk-limited and as fast as the scaled limits allow, every joint
arriving together. Ruckig's intermediate waypoints would call a cloud service and are not used;
moves are chained.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import ruckig

from testbench.exceptions import PlanError
from testbench.frames import NANOSECONDS
from testbench.planning.expansion import Command, FourierCommand, SineCommand, TrapezoidCommand
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol_steps import Motion
from testbench.records.specs.robot import Robot

KNOTS_A_CYCLE, SINE_KNOT_S = 50, 0.004
"""Knots of a sine a cycle of its fastest harmonic, and their least spacing; the quintic between so
many follows a sine to 1e-9 of its amplitude. Hours of slow sweeps stay small.
"""


ATTEMPTS, JERK_STEP = 10, 1e-3
"""Tries of a move on which ruckig fails, each with this much less jerk (relative)."""


class MotionBuilder:
    """Builds the knots of a trajectory command by command, starting at rest at the robot's home.

    Args:
        robot: Its limits, scaled per command, bound the motion.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self.now_ns = 0
        self.q = robot.home.copy()
        self._ruckig = ruckig.Ruckig(len(self.q))
        self._time = [np.zeros(1, dtype=np.int64)]
        self._states = [np.stack([self.q, np.zeros_like(self.q), np.zeros_like(self.q)])[None]]

    def add(self, command: Command) -> tuple[int, int, int]:
        """Append a command.

        Returns:
            Start of its motion, end of its motion, end of its dwell [ns].

        Raises:
            PlanError: Ruckig finds no motion.
        """
        start = self.now_ns
        if command.target is not None:
            self.move(np.where(np.isnan(command.target), self.q, command.target), command.motion)
        if command.sweeps:
            self._sweep(command)
        settled = self.now_ns
        self.hold(command.dwell)
        return start, settled, self.now_ns

    def move(self, target: np.ndarray, motion: Motion, speed: np.ndarray | None = None) -> None:
        """Append a move from rest to rest.

        Args:
            target: Joint angles to reach, shape (n_joints,) [rad].
            motion: Scaling of the limits.
            speed: In place of the scaled limits of velocity, shape (n_joints,) [rad/s].

        Raises:
            PlanError: Ruckig finds no motion.
        """
        if np.array_equal(target, self.q):
            return
        path = self._fastest(target, motion, speed)
        duration_ns = max(math.ceil(path.duration * NANOSECONDS), 1)
        switches = np.concatenate([np.cumsum(profile.t) for profile in path.profiles[0]])
        times = np.unique(np.round(switches * NANOSECONDS).astype(np.int64))
        times = times[(times > 0) & (times < duration_ns)]
        states = np.array([path.at_time(t / NANOSECONDS) for t in times]).reshape(
            -1, 3, len(self.q)
        )
        self._append(times, states)
        self._rest(duration_ns, target)

    def _fastest(
        self, target: np.ndarray, motion: Motion, speed: np.ndarray | None
    ) -> ruckig.Trajectory:
        """Ruckig's time-optimal move.

        Ruckig fails on some moves whose profile lies exactly between two of its shapes; a slightly
        smaller jerk takes them off the border.
        """
        limits = self.robot.velocity_limits * motion.speed
        inputs = ruckig.InputParameter(len(self.q))
        inputs.current_position, inputs.target_position = self.q.tolist(), target.tolist()
        inputs.max_velocity = (limits if speed is None else np.minimum(limits, speed)).tolist()
        inputs.max_acceleration = (self.robot.acceleration_limits * motion.acceleration).tolist()
        failure = ""
        for attempt in range(ATTEMPTS):
            inputs.max_jerk = (
                self.robot.jerk_limits * motion.jerk * (1 - JERK_STEP * attempt)
            ).tolist()
            path = ruckig.Trajectory(len(self.q))
            try:
                result = self._ruckig.calculate(inputs, path)
            except ruckig.RuckigError as error:
                failure = str(error).strip().splitlines()[0]
                continue
            # ruckig 0.19 answers -101 (its trajectory would last too long), which its Python does
            # not know
            except ValueError:
                failure = "it would last too long for ruckig"
                continue
            if result in (ruckig.Result.Working, ruckig.Result.Finished):
                return path
            failure = result.name
        raise PlanError(f"no motion from {_degrees(self.q)} to {_degrees(target)} deg: {failure}")

    def hold(self, seconds: float) -> None:
        """Append a rest."""
        duration = round(seconds * NANOSECONDS)
        if duration > 0:
            self._rest(duration, self.q)

    def trajectory(self) -> Trajectory:
        """All that was appended."""
        q, v, a = (
            np.concatenate([states[:, order] for states in self._states]) for order in range(3)
        )
        return Trajectory(np.concatenate(self._time), q, v, a)

    def _append(self, times: np.ndarray, states: np.ndarray) -> None:
        if len(times):
            self._time.append(self.now_ns + times)
            self._states.append(states)

    def _rest(self, duration_ns: int, q: np.ndarray) -> None:
        zero = np.zeros_like(q)
        self._append(np.array([duration_ns], dtype=np.int64), np.stack([q, zero, zero])[None])
        self.now_ns += duration_ns
        self.q = q.copy()

    def _sweep(self, command: Command) -> None:
        trapezoids = [sweep for sweep in command.sweeps if isinstance(sweep, TrapezoidCommand)]
        waves = [sweep for sweep in command.sweeps if not isinstance(sweep, TrapezoidCommand)]
        if trapezoids and (waves or len(trapezoids) > 1):
            raise PlanError(
                "a trapezoid sweeps one joint alone; only sines and Fourier series can run together"
            )
        for trapezoid in trapezoids:
            self._trapezoid(trapezoid, command.motion)
        if waves:
            self._waves(waves)

    def _trapezoid(self, sweep: TrapezoidCommand, motion: Motion) -> None:
        centre, target, speed = self.q.copy(), self.q.copy(), np.full(len(self.q), np.inf)
        target[sweep.joint] += sweep.amplitude
        limit = self.robot.velocity_limits[sweep.joint] * motion.speed
        if sweep.rate > limit:
            raise PlanError(
                f"joint {self.robot.joint_names[sweep.joint]}: a rate of "
                f"{math.degrees(sweep.rate):.2f} deg/s exceeds {math.degrees(limit):.2f} deg/s "
                "(limit times motion.speed)"
            )
        speed[sweep.joint] = sweep.rate
        for _ in range(sweep.cycles):
            for goal in (target, centre):
                self.move(goal, motion, speed)
                self.hold(sweep.hold)

    def _waves(self, sweeps: list[SineCommand | FourierCommand]) -> None:
        """Sines and Fourier series under their fades.

        The longest decides the duration, the others rest at their end.
        """
        durations = [(sweep.cycles + 2 * sweep.ramp_cycles) / sweep.frequency for sweep in sweeps]
        total_ns = round(max(durations) * NANOSECONDS)
        times = _knots(sweeps, durations, total_ns)
        states = np.zeros((len(times), 3, len(self.q)))
        states[:, 0] = self.q
        for sweep, duration in zip(sweeps, durations, strict=True):
            t = times / NANOSECONDS
            state = (
                faded_sine(t, sweep, duration)
                if isinstance(sweep, SineCommand)
                else faded_series(t, sweep, duration)
            )
            inside = t < duration
            for order in range(3):
                states[inside, order, sweep.joint] += state[order][inside]
        self._append(times, states)
        self._rest(total_ns, self.q)


def _knots(
    sweeps: list[SineCommand | FourierCommand], durations: list[float], total_ns: int
) -> np.ndarray:
    """Times of the knots within waves, shape (n,) [ns].

    They lie evenly between the ends of their fades, where their jerk jumps.
    """
    fastest = max(
        s.frequency * (1 if isinstance(s, SineCommand) else len(s.amplitudes)) for s in sweeps
    )
    spacing = max(1 / (KNOTS_A_CYCLE * fastest), SINE_KNOT_S)
    ends = [
        time
        for s, duration in zip(sweeps, durations, strict=True)
        for time in _fade_ends(s, duration)
    ]
    edges = [0.0]
    for time in sorted(ends):
        if edges[-1] + SINE_KNOT_S <= time <= total_ns / NANOSECONDS - SINE_KNOT_S:
            edges.append(time)
    edges.append(total_ns / NANOSECONDS)
    spans = itertools.pairwise(edges)
    parts = [
        np.linspace(a, b, max(math.ceil((b - a) / spacing - 1e-6), 2) + 1)[:-1] for a, b in spans
    ]
    return np.unique(np.round(np.concatenate(parts) * NANOSECONDS).astype(np.int64))[1:]


def _fade_ends(sweep: SineCommand | FourierCommand, duration: float) -> tuple[float, float, float]:
    ramp = sweep.ramp_cycles / sweep.frequency
    return ramp, duration - ramp, duration


def faded_sine(
    t: np.ndarray, sweep: SineCommand, duration: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, rate and acceleration of a sine under a fade that starts and ends at rest.

    Args:
        t: From 0 to the duration, shape (n,) [s].
        sweep: The sine.
        duration: Of the sweep [s].

    Returns:
        Offset from the centre [rad], its rate [rad/s] and acceleration [rad/s^2], each of shape
        (n,).
    """
    w, dw, ddw = _fade(t, sweep.ramp_cycles / sweep.frequency, duration)
    omega = 2 * np.pi * sweep.frequency
    s, c = np.sin(omega * t + sweep.phase), np.cos(omega * t + sweep.phase)
    q = sweep.amplitude * w * s
    v = sweep.amplitude * (dw * s + w * omega * c)
    a = sweep.amplitude * (ddw * s + 2 * dw * omega * c - w * omega**2 * s)
    return q, v, a


def faded_series(
    t: np.ndarray, sweep: FourierCommand, duration: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle, rate and acceleration of a Fourier series under the fade of `faded_sine`.

    Args:
        t: From 0 to the duration, shape (n,) [s].
        sweep: The series.
        duration: Of the sweep [s].

    Returns:
        Offset from the centre [rad], its rate [rad/s] and acceleration [rad/s^2], each of shape
        (n,).
    """
    w, dw, ddw = _fade(t, sweep.ramp_cycles / sweep.frequency, duration)
    omega = 2 * np.pi * sweep.frequency * np.arange(1, len(sweep.amplitudes) + 1)
    angle = np.outer(t, omega) + np.array(sweep.phases)
    s, c = np.array(sweep.amplitudes) * np.sin(angle), np.array(sweep.amplitudes) * np.cos(angle)
    q, v, a = s.sum(axis=1), c @ omega, -(s @ omega**2)
    return w * q, dw * q + w * v, ddw * q + 2 * dw * v + w * a


def _fade(t: np.ndarray, ramp: float, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A quintic smoothstep up over `ramp` [s] and down before `duration`, and two derivatives.

    All of shape (n,).
    """
    rising = t <= duration / 2
    u = np.clip(np.where(rising, t, duration - t) / ramp, 0.0, 1.0)
    sign = np.where(rising, 1.0, -1.0)
    w = u**3 * (10 - 15 * u + 6 * u**2)
    dw = sign * 30 * u**2 * (1 - u) ** 2 / ramp
    ddw = 60 * u * (1 - u) * (1 - 2 * u) / ramp**2
    return w, dw, ddw


def _degrees(q: np.ndarray) -> str:
    return "[" + ", ".join(f"{angle:.1f}" for angle in np.degrees(q)) + "]"
