"""How emulated joints move: commanded references, limits, and the servo that follows.

Makers publish neither the filter of their servo commands nor the servo. Here a streamed target
passes a critically damped filter that lags a ramp by the lookahead time (for UR's `servoj` at the
default gain of 300; a higher gain shortens it by its square root), and the servo is that of the
robot file. A move is a trapezoid of speed along the straight line between the joint angles, as UR's
script manual describes `movej`.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from testbench.model.servo import servo_update
from testbench.records.specs.robot import Robot

NOMINAL_GAIN = 300.0
"""Gain of `servoj` at which the lookahead time is the lag (the script manual's default)."""
SPEED_TRIP = 1.05
"""A reference that exceeds a joint's speed limit by this factor trips a protective stop."""
HARD_STOP_FACTOR = 1.0
"""A protective stop decelerates with this share of the acceleration limits."""


class Mode(StrEnum):
    """What makes the reference."""

    HOLD = "hold"
    MOVE = "move"
    SERVO = "servo"
    SPEED = "speed"
    STOP = "stop"


class Joints:
    """References and servos of the joints, one control period at a time.

    Args:
        robot: Limits, servo and encoders.
        q: Joint angles at the start, shape (n,) [rad].
        seed: Of the encoders' noise.
        period: Of the controller [s]; that of the robot file if None.
    """

    def __init__(self, robot: Robot, q: np.ndarray, seed: int = 0, period: float | None = None):
        self.robot, self.period = robot, period or 1.0 / robot.spec.rates.control_hz
        self._limits = robot.velocity_limits
        self._accelerations = robot.acceleration_limits
        self._low, self._high = robot.position_limits.T
        self._phi, self._now, self._following = servo_update(robot, self.period)
        self._rng = np.random.default_rng(seed)
        self.mode = Mode.HOLD
        self.q_reference, self.v_reference = q.astype(float).copy(), np.zeros(len(q))
        self.a_reference = np.zeros(len(q))
        self._state = np.stack([self.q_reference, self.v_reference])
        self._pending: tuple[np.ndarray, float, float] | None = None
        self._deceleration = 1.0
        self._measure()

    @property
    def at_rest(self) -> bool:
        """Whether no reference moves any more."""
        return self.mode is Mode.HOLD

    @property
    def steady(self) -> bool:
        """Whether the joints themselves have come to rest."""
        return self.at_rest and float(np.abs(self._state[1]).max()) < 1e-3

    def move(self, target: np.ndarray, speed: float, acceleration: float) -> None:
        """Go to joint angles in a straight line.

        Args:
            target: Joint angles, shape (n,) [rad].
            speed: Of the leading joint [rad/s].
            acceleration: Of the leading joint [rad/s^2].
        """
        if np.abs(self.v_reference).max() > 1e-9:
            self.stop(acceleration)
            self._pending = (target.copy(), speed, acceleration)
            return
        self._start, self._way = self.q_reference.copy(), target - self.q_reference
        self._length = float(np.abs(self._way).max())
        if self._length < 1e-12:
            self.mode = Mode.HOLD
            return
        share = np.abs(self._way) / self._length  # of the leading joint's speed
        moving = share > 1e-12
        self._speed = min(speed, float((self._limits[moving] / share[moving]).min()))
        self._acceleration = min(
            acceleration, float((self._accelerations[moving] / share[moving]).min())
        )
        self._speed = min(self._speed, math.sqrt(self._length * self._acceleration))
        self._elapsed, self.mode = 0.0, Mode.MOVE

    def servo(self, target: np.ndarray, lookahead: float, gain: float) -> None:
        """Follow a target.

        Args:
            target: Joint angles, shape (n,) [rad].
            lookahead: From 0.03 to 0.2 (script manual) [s].
            gain: From 100 to 2000 (script manual).
        """
        self._target = target.copy()
        lookahead, gain = min(max(lookahead, 0.03), 0.2), min(max(gain, 100.0), 2000.0)
        self._omega = 2 / lookahead * math.sqrt(gain / NOMINAL_GAIN)
        self.mode, self._pending = Mode.SERVO, None

    def speed(self, rates: np.ndarray, acceleration: float) -> None:
        """Approach joint rates, and keep them.

        Args:
            rates: Joint rates, shape (n,) [rad/s].
            acceleration: Of the leading joint [rad/s^2].
        """
        self._rates, self._acceleration = rates.copy(), acceleration
        self.mode, self._pending = Mode.SPEED, None

    def stop(self, deceleration: float) -> None:
        """Come to rest with a deceleration of the leading joint [rad/s^2]."""
        self._pending = None
        self._deceleration = max(deceleration, 1e-3)
        if self.mode is not Mode.HOLD:
            self.mode = Mode.STOP

    def stop_hard(self) -> None:
        """Come to rest as fast as the limits allow."""
        self.stop(HARD_STOP_FACTOR * float(self._accelerations.min()))

    def step(self, scaling: float) -> str | None:
        """Advance by one control period.

        Args:
            scaling: The speed slider, 0 to 1; it stretches the time of `movej` and scales `speedj`.

        Returns:
            Why the controller must stop for its own protection, or None.
        """
        before, rates = self.q_reference, self.v_reference
        self.q_reference, self.v_reference = self._reference(scaling)
        self.a_reference = (self.v_reference - rates) / self.period
        x = self._state
        self._state = (
            self._phi @ x
            + np.outer(self._now, before)
            + np.outer(self._following, self.q_reference)
        )  # angle and rate of every joint
        self._measure()
        if np.any(np.abs(self.v_reference) > SPEED_TRIP * self._limits):
            worst = int(np.argmax(np.abs(self.v_reference) / self._limits))
            return (
                f"joint {worst + 1} was asked to move at "
                f"{math.degrees(abs(self.v_reference[worst])):.0f} deg/s"
            )
        if np.any((self.q_reference < self._low) | (self.q_reference > self._high)):
            return "a joint was asked to leave its range"
        return None

    def _reference(self, scaling: float) -> tuple[np.ndarray, np.ndarray]:
        q, v, dt = self.q_reference, self.v_reference, self.period
        if self.mode is Mode.MOVE:
            return self._along(scaling)
        if self.mode is Mode.SERVO:
            a = self._omega**2 * (self._target - q) - 2 * self._omega * v
            v = v + np.clip(a, -self._accelerations, self._accelerations) * dt
            return q + v * dt, v
        if self.mode is Mode.SPEED:
            change = scaling * self._rates - v
            largest = float(np.abs(change).max())
            v = v + change * min(1.0, self._acceleration * dt / largest) if largest > 0 else v
            return q + v * dt, v
        if self.mode is Mode.STOP:
            speed = float(np.abs(v).max())
            slower = max(speed - self._deceleration * dt, 0.0)
            if slower == 0.0:
                self.mode = Mode.HOLD
                if self._pending is not None:
                    pending, self._pending = self._pending, None
                    self.v_reference = np.zeros_like(v)
                    self.move(*pending)
                return q, np.zeros_like(v)
            v = v * (slower / speed)
            return q + v * dt, v
        return q, np.zeros_like(v)

    def _along(self, scaling: float) -> tuple[np.ndarray, np.ndarray]:
        """Trapezoid of speed along the straight line, its time stretched by the speed slider."""
        self._elapsed += self.period * scaling
        speed, acceleration, length = self._speed, self._acceleration, self._length
        ramp = speed / acceleration
        duration = length / speed + ramp
        t = min(self._elapsed, duration)
        if t < ramp:
            s, rate = acceleration * t**2 / 2, acceleration * t
        elif t < duration - ramp:
            s, rate = speed * (t - ramp / 2), speed
        else:
            rest = duration - t
            s, rate = length - acceleration * rest**2 / 2, acceleration * rest
        if t >= duration:
            self.mode = Mode.HOLD
            return self._start + self._way, np.zeros_like(self._way)
        return self._start + self._way * (s / length), self._way * (rate * scaling / length)

    def _measure(self) -> None:
        servo = self.robot.spec.servo
        noise = self._rng.standard_normal((2, len(self.q_reference)))
        q = self._state[0] + math.radians(servo.encoder_noise_deg) * noise[0]
        if servo.encoder_resolution_deg:
            count = math.radians(servo.encoder_resolution_deg)
            q = np.round(q / count) * count
        self.q_measured = q
        self.v_measured = self._state[1] + math.radians(servo.velocity_noise_deg_s) * noise[1]
