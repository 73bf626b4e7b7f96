"""One sensor while a session is written: its filters beside the arm, its link and its clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.filters.streamed import StreamedFilters
from testbench.evaluation.running_error import RunningOrientation
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot

EARLIEST_NS = 10 * NANOSECONDS
"""The least delay of so long tells how the sensor's clock stands to the host's [ns]."""
RATE_NS = NANOSECONDS
"""The rate is that of the last samples, over so long [ns]."""


class ArmTrack:
    """Where the arm was lately.

    Args:
        robot: The arm.
        sensors: That it carries, by name.
    """

    def __init__(self, robot: Robot, sensors: Mapping[str, Sensor]):
        self._kinematics = Kinematics(robot)
        self._sensors = dict(sensors)
        self._times = np.zeros(0, dtype=np.int64)
        self._q = np.zeros((0, len(robot.joint_names)))

    def add(self, samples: ArmSamples) -> None:
        """What the arm reported, behind what it reported before."""
        self._times = np.concatenate([self._times, samples.host_time_ns])
        self._q = np.concatenate([self._q, samples.q_measured])

    @property
    def until_ns(self) -> int:
        """The last instant that is known [ns]; -1 before any."""
        return int(self._times[-1]) if len(self._times) else -1

    def at(self, sensor: str, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q_world_from_sensor, shape (n, 4), and position [m], shape (n, 3), of a sensor.

        Args:
            sensor: Its name.
            time_ns: Host times that the arm is known at, shape (n,).
        """
        q = np.column_stack([np.interp(time_ns, self._times, joint) for joint in self._q.T])
        own = self._sensors[sensor]
        pose = Pose.from_placement(own.mounting)
        motion = self._kinematics.frame_motion(own.link, q, offset=pose)
        return motion.q_world_from_frame, motion.position

    def path(self, sensor: str, q: np.ndarray) -> np.ndarray:
        """Where a sensor is, shape (n, 3) [m].

        Args:
            sensor: Its name.
            q: Joint angles, shape (n, n_joints) [rad].
        """
        own = self._sensors[sensor]
        pose = Pose.from_placement(own.mounting)
        return self._kinematics.frame_motion(own.link, q, offset=pose).position

    def forget(self, before_ns: int) -> None:
        """Let go of what nobody asks for any more, but for one sample."""
        first = max(int(np.searchsorted(self._times, before_ns)) - 1, 0)
        self._times, self._q = self._times[first:], self._q[first:]


@dataclass(frozen=True)
class Moved:
    """A chunk of the motion of one sensor.

    Attributes:
        time_ns: Host times by the earliest arrivals, shape (n,).
        true: q_world_from_sensor by the arm, shape (n, 4); None without one.
        position: By the arm, shape (n, 3) [m]; None without one.
        estimated: By filter, q_world_from_sensor where there is an arm and q_earth_from_sensor
            where there is none, shape (n, 4).
        errors: By filter, the angle against the arm, shape (n,) [rad].
    """

    time_ns: np.ndarray
    true: np.ndarray | None
    position: np.ndarray | None
    estimated: dict[str, np.ndarray]
    errors: dict[str, np.ndarray] = field(default_factory=dict)


class LiveSensor:
    """What is known of one sensor so far.

    Args:
        name: Of the sensor.
        kinds: Filters to run on it.
        arm: That carries it; None without one.

    Attributes:
        running: Its errors.
        count: Samples so far.
        lost: Samples that its counter passed over.
        last_ns: When the last one arrived.
    """

    def __init__(self, name: str, kinds: Sequence[OrientationFilter], arm: ArmTrack | None):
        self.name, self._arm = name, arm
        self.filters = StreamedFilters(kinds)
        self.running = RunningOrientation()
        self._begun = 0
        self._waiting: list[tuple[np.ndarray, dict[str, np.ndarray]]] = []
        self._times: list[np.ndarray] = []
        self._delays: deque[tuple[int, int]] = deque()
        self._arrivals = np.zeros(0, dtype=np.int64)
        self._counter: int | None = None
        self.count = self.lost = 0
        self.last_ns = 0

    def take(self, samples: ImuSamples) -> np.ndarray:
        """Samples behind those of the call before.

        Returns:
            When they were taken, host time by the earliest arrivals, shape (n,) [ns].
        """
        self.count += len(samples)
        counters = (
            samples.counter if self._counter is None else np.r_[self._counter, samples.counter]
        )
        self.lost += int(np.maximum(np.diff(counters) - 1, 0).sum())
        self._counter, self.last_ns = int(samples.counter[-1]), int(samples.host_time_ns[-1])
        arrivals = np.concatenate([self._arrivals, samples.host_time_ns])
        self._arrivals = arrivals[arrivals > self.last_ns - RATE_NS]
        time_ns = self._host_times(samples)
        self._times.append(time_ns)
        ready, orientations = self.filters.take(samples)
        if self.filters.begun != self._begun:
            self._begun = self.filters.begun
            self.running.forget()
        if ready is not None:
            self._waiting.append((np.concatenate(self._times), orientations))
            self._times = []
        return time_ns

    @property
    def rate_hz(self) -> float:
        """Samples a second of those that arrived in the last one."""
        span = int(self._arrivals[-1] - self._arrivals[0]) if len(self._arrivals) else 0
        return (len(self._arrivals) - 1) * NANOSECONDS / span if span else 0.0

    def _host_times(self, samples: ImuSamples) -> np.ndarray:
        """When samples were taken, by the earliest arrivals of late, shape (n,) [ns].

        What every sample needs on its way stays in it.
        """
        delay = int((samples.host_time_ns - samples.device_time_ns).min())
        now = int(samples.host_time_ns[-1])
        self._delays.append((now, delay))
        while self._delays[0][0] < now - EARLIEST_NS:
            self._delays.popleft()
        return samples.device_time_ns + min(own for _, own in self._delays)

    @property
    def pending_ns(self) -> int | None:
        """The first instant that waits for the arm; None if none does."""
        return int(self._waiting[0][0][0]) if self._waiting else None

    def moved(self, held_ns: int | None) -> Moved | None:
        """What came since the last call and can be compared with the arm by now.

        Args:
            held_ns: From when on headings are held [ns]; None for not yet.
        """
        if not self._waiting:
            return None
        time = np.concatenate([own for own, _ in self._waiting])
        names = self.filters.names
        q = {name: np.concatenate([own[name] for _, own in self._waiting]) for name in names}
        if self._arm is None:
            self._waiting = []
            return Moved(time, None, None, q)
        done = int(np.searchsorted(time, self._arm.until_ns, side="right"))
        self._waiting = [(time[done:], {k: own[done:] for k, own in q.items()})]
        if done == len(time):
            self._waiting = []
        if not done:
            return None
        true, position = self._arm.at(self.name, time[:done])
        shown = {name: own[:done] for name, own in q.items()}
        found, errors = self.running.take(time[:done], true, shown, held_ns)
        return Moved(time[:done], true, position, found, errors)
