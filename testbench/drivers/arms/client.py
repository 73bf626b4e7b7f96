"""What the process that drives an arm asks of the client library for its controller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from testbench.clock import Clock, SystemClock, seconds
from testbench.drivers.arms.controller_clock import ControllerClock
from testbench.drivers.arms.settings import LinkSettings

SMOOTHING = 0.1
"""Weight of the newest sample in the smoothed angles that decide whether a pose is reached:
encoders are noisy.
"""
MOVES_RAD = 0.001
"""An angle so far from its smoothed value moves; the smoothed value follows at once [rad]."""
SILENT_S = 3.0
"""A controller that sent nothing for so long after it was connected is silent [s]."""
Row = tuple[Any, ...]


class ArmFault(Exception):
    """The arm cannot go on.

    Attributes:
        kind: A word for events and programs.
    """

    def __init__(self, kind: str, message: str):
        self.kind = kind
        super().__init__(message)


class ArmClient(ABC):
    """A controller as the driving loop sees it.

    Args:
        settings: Address, rates, tool.
        time: The host's clock; the machine's if None.

    Attributes:
        q: Joint angles of the newest sample, shape (n,) [rad].
        v: Joint rates of the newest sample, shape (n,) [rad/s].
        q_target: Joint angles that the controller is going to, shape (n,) [rad].
        q_smooth: Joint angles without the noise of their encoders, shape (n,) [rad].
        slider: Share of the asked speed at which the controller moves.
        listening: Whether it can be asked for samples.
    """

    def __init__(self, settings: LinkSettings, time: Clock | None = None):
        self.settings, self.time = settings, time or SystemClock()
        self.clock = ControllerClock()
        self.q = self.v = self.q_target = self.q_smooth = np.zeros(settings.joints)
        self.slider = 1.0
        self.listening = False
        self._stamp_ns = -1
        self._arrival = self.now()

    def now_ns(self) -> int:
        """Host time [ns]."""
        return self.time.monotonic_ns()

    def now(self) -> float:
        """Host time [s]."""
        return seconds(self.time)

    def _note(
        self, stamp_ns: int, q: np.ndarray, v: np.ndarray, target: np.ndarray
    ) -> tuple[int, int]:
        """Take in a sample.

        Args:
            stamp_ns: Of the controller's clock.
            q: Measured joint angles, shape (n,) [rad].
            v: Measured joint rates, shape (n,) [rad/s].
            target: Joint angles that the controller is going to, shape (n,) [rad].

        Returns:
            Its host time [ns], and how many samples were missed before it.
        """
        arrival, first = self.now_ns(), self._stamp_ns < 0
        missed = (
            0
            if first
            else max(round((stamp_ns - self._stamp_ns) * 1e-9 * self.settings.record_hz) - 1, 0)
        )
        self._stamp_ns, self._arrival = stamp_ns, self.now()
        self.q, self.v, self.q_target = q, v, target
        self.q_smooth = q if first else self.q_smooth + SMOOTHING * (q - self.q_smooth)
        if float(np.abs(q - self.q_smooth).max()) > MOVES_RAD:
            self.q_smooth = q
        return self.clock.host_ns(stamp_ns, arrival), missed

    @property
    def silent_for(self) -> float:
        """Time since the last sample [s]."""
        return self.now() - self._arrival

    def _wait_for_sample(self) -> None:
        end = self.now() + SILENT_S
        while not self.samples():
            if self.now() > end:
                raise ArmFault(
                    "silence",
                    f"the controller at {self.settings.host} takes connections and sends no data: "
                    f"none came in {SILENT_S:g} s",
                )
            self.time.sleep(0.001)

    @abstractmethod
    def connect(self) -> dict[str, Any]:
        """Connect, and say what there is; nothing moves.

        A reason to refuse the arm stands under `refused`.

        Raises:
            ArmFault: There is no controller, or none that this client can drive.
        """

    @abstractmethod
    def samples(self) -> list[Row]:
        """What came in since the last call.

        Returns:
            Host time [ns], controller time [ns], angles, rates, the driver's columns for every
            joint, its other columns, where the controller is going (angles), and the number of
            samples that were missed before it.
        """

    @abstractmethod
    def check(self) -> None:
        """Look at the controller's state and its connection.

        Raises:
            ArmFault: The arm must stop, or has stopped.
        """

    @abstractmethod
    def keep_alive(self) -> None:
        """Let the controller know that somebody is there, where it wants to know."""

    @abstractmethod
    def move(self, target: np.ndarray, speed: float, acceleration: float) -> None:
        """Begin a straight move of the joints.

        Args:
            target: Joint angles, shape (n,) [rad].
            speed: Of the leading joint [rad/s].
            acceleration: Of the leading joint [rad/s^2].
        """

    def begin_stream(self) -> None:  # noqa: B027 - most controllers take a first target at any time
        """Make ready for targets; the arm is at rest."""

    @abstractmethod
    def stream(self, target: np.ndarray) -> None:
        """Send a target.

        Args:
            target: Joint angles, shape (n,) [rad].
        """

    @abstractmethod
    def stop_stream(self, deceleration: float) -> None:
        """End streaming [rad/s^2]."""

    @abstractmethod
    def stop(self, deceleration: float) -> None:
        """Bring the arm to rest by every way there is [rad/s^2]; never raises."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the controller; never raises."""
