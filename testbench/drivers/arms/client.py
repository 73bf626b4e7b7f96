"""What the process that drives an arm asks of the client library for its controller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from testbench.clock import Clock, SystemClock, seconds
from testbench.drivers.arms.controller_clock import ControllerClock
from testbench.drivers.arms.helper import Helper
from testbench.drivers.arms.settings import LinkSettings
from testbench.drivers.arms.standing import Standing

SMOOTHING = 0.1
"""Weight of the newest sample in the smoothed angles that decide whether a pose is reached:
encoders are noisy.
"""
MOVES_RAD = 0.001
"""An angle so far from its smoothed value moves; the smoothed value follows at once [rad]."""
SILENT_S = 3.0
"""A controller that sent nothing for so long after it was connected is silent [s]."""
FASTEST_RAD_S, NOISE_RAD = 12.6, 0.02
"""Rates beyond this, and joint angles that change by more than it allows, are none [rad/s]: twice
the fastest joint of the arms that are driven (2 pi rad/s, UR3e's data sheet); and give or take so
much [rad].
"""
LAG_RAD = 0.2
"""Where the controller is going may jump by so much more [rad]: to where the arm is, when it is
stopped.
"""
FURTHEST_RAD = 12.6
"""Joint angles beyond this are none [rad]: twice the range of the arms that are driven (one turn to
either side).
"""
LARGEST_STEP_NS = 60 * 1_000_000_000
"""Stamps that part from the time of arrival by more within one sample are none [ns]."""
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
        garbled: Why what the controller sent cannot be true; empty while it can.
        may_move: Whether, by the newest sample, something on the controller may move the arm.
        own_process: Whether it has the process to itself, so that threads and limits are its own.
        helper: Makes connections where this process may not; None where it may.
    """

    own_process = False
    helper: Helper | None = None

    def __init__(self, settings: LinkSettings, time: Clock | None = None):
        self.settings, self.time = settings, time or SystemClock()
        self.clock = ControllerClock()
        self.q = self.v = self.q_target = self.q_smooth = np.zeros(settings.joints)
        self.slider = 1.0
        self.listening = self.may_move = False
        self.garbled = ""
        self._stamp_ns = -1
        self._gap_ns = (0, 0)
        self._arrival = self.now()

    def now_ns(self) -> int:
        """Host time [ns]."""
        return self.time.monotonic_ns()

    def now(self) -> float:
        """Host time [s]."""
        return seconds(self.time)

    def _note(
        self,
        stamp_ns: int,
        arrival_ns: int,
        q: np.ndarray,
        v: np.ndarray,
        target: np.ndarray,
    ) -> tuple[int, int] | None:
        """Take in a sample.

        Args:
            stamp_ns: Of the controller's clock.
            arrival_ns: When it arrived, host time.
            q: Measured joint angles, shape (n,) [rad].
            v: Measured joint rates, shape (n,) [rad/s].
            target: Joint angles that the controller is going to, shape (n,) [rad].

        Returns:
            Its host time [ns], and how many samples were missed before it; None where it cannot be
            true, which `garbled` then says.
        """
        first = self._stamp_ns < 0
        self.garbled = self.garbled or self._nonsense(stamp_ns, arrival_ns, q, v, target)
        if self.garbled:
            return None
        missed = (
            0
            if first
            else max(round((stamp_ns - self._stamp_ns) * 1e-9 * self.settings.record_hz) - 1, 0)
        )
        self._gap_ns = (self._stamp_ns, stamp_ns) if missed else (0, 0)
        self._stamp_ns, self._arrival = stamp_ns, 1e-9 * arrival_ns
        self.q, self.v, self.q_target = q, v, target
        self.q_smooth = q if first else self.q_smooth + SMOOTHING * (q - self.q_smooth)
        if float(np.abs(q - self.q_smooth).max()) > MOVES_RAD:
            self.q_smooth = q
        return self.clock.host_ns(stamp_ns, arrival_ns), missed

    def _nonsense(
        self,
        stamp_ns: int,
        arrival_ns: int,
        q: np.ndarray,
        v: np.ndarray,
        target: np.ndarray,
    ) -> str:
        """Why a sample cannot be true, by the one before it; empty where it can. Arguments as those
        of `_note`.
        """
        if not np.isfinite([q, v, target]).all():
            return "joint angles that are no numbers"
        largest = float(np.abs([q, target]).max())
        if largest > FURTHEST_RAD:
            return f"a joint angle of {np.degrees(largest):.3g} deg"
        fastest = float(np.abs(v).max())
        if fastest > FASTEST_RAD_S:
            return f"a joint rate of {np.degrees(fastest):.3g} deg/s"
        if self._stamp_ns < 0:
            return ""
        if self._gap_ns[0] < stamp_ns < self._gap_ns[1]:
            return "samples out of their order"
        passed = max(stamp_ns - self._stamp_ns, arrival_ns - round(1e9 * self._arrival), 0)
        if abs(stamp_ns - self._stamp_ns) > LARGEST_STEP_NS + arrival_ns - 1e9 * self._arrival:
            return f"a clock that steps by {1e-9 * (stamp_ns - self._stamp_ns):.3g} s"
        for old, new, most in ((self.q, q, NOISE_RAD), (self.q_target, target, LAG_RAD)):
            jump = float(np.abs(new - old).max())
            if jump > FASTEST_RAD_S * 1e-9 * passed + most:
                return f"joint angles that jump by {np.degrees(jump):.3g} deg"
        return ""

    def _check_sense(self) -> None:
        """Whether what comes can be true.

        Raises:
            ArmFault: It cannot.
        """
        if self.garbled:
            raise ArmFault(
                "garbled",
                f"the controller's data cannot be true ({self.garbled}): they were altered on the "
                "way, or it is broken",
            )

    @property
    def stuck_for(self) -> float:
        """How long the client library has been at one command [s]; 0 while it is at none."""
        return 0.0

    @property
    def lost(self) -> str:
        """Why a connection to the controller is of no use any more; empty while all are."""
        return ""

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
    def stop_from_outside(self, deceleration: float) -> Standing:
        """Stop the arm over connections of their own, and look whether it stands still; never
        raises, and takes no longer than `Link` waits [rad/s^2].
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the controller; never raises."""
