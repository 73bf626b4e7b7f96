"""A session that is being recorded, as it is drawn: chunk by chunk, in the order of its streams."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from testbench.estimation.filters import OrientationFilter, get_filter
from testbench.evaluation.running_error import TRUE, RunningJoint
from testbench.exceptions import BenchError
from testbench.execution.guards import GuardWatch
from testbench.execution.resume import stored_protocol
from testbench.frames import NANOSECONDS
from testbench.pipeline.live_sensor import ArmTrack, LiveSensor
from testbench.pipeline.live_words import Doing, table_of_sensors
from testbench.records.session.layout import PLAN
from testbench.records.session.plan import PlannedStep, stored_steps, stored_trajectory
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event, Session
from testbench.records.session.session_tail import News
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol_arm import Guards
from testbench.records.specs.protocol_file import load_protocol

if TYPE_CHECKING:
    from testbench.reporting.viewer import LiveContent, LiveScene

MOST_FILTERS = 4
"""So many filters run on each sensor, the first ones of the protocol that do not look ahead."""
TOLD_NS = NANOSECONDS // 2
"""State, links and margins are drawn this often [ns]."""
AHEAD_S = 5.0
"""So much of the path to come is drawn [s]."""
PATH_POINTS, AHEAD_POINTS = 4000, 50
ALIGNED_NS = 5 * NANOSECONDS
"""Where no step is evaluated, headings are aligned for so long [ns]."""


class LiveSession:
    """Draws a session while it is recorded.

    Args:
        session: Of any status.
        recording: Of the viewer, to draw into.

    Attributes:
        last_ns: The latest instant that was drawn [ns].
    """

    def __init__(self, session: Session, recording: Any):
        self.session, self.last_ns = session, 0
        analysis, robot = session.analysis, session.robot
        self._plan = _Plan(session)
        self._arm = ArmTrack(robot, analysis.sensors) if robot is not None else None
        kinds = _causal(session)
        self.sensors = {name: LiveSensor(name, kinds, self._arm) for name in session.sensor_names}
        self._joints: dict[str, RunningJoint] = {}
        if self._arm is not None:
            self._joints = {
                name: RunningJoint(
                    joint, analysis.sensors[joint.proximal], analysis.sensors[joint.distal]
                )
                for name, joint in analysis.joints.items()
            }
        self._guards = _guards(session)
        self._doing = Doing(session.manifest.plan.check.steps, self._plan.steps)
        self._told_ns = -TOLD_NS
        self._held_ns = None if self._plan.evaluates else ALIGNED_NS
        self.scene = self._scene(recording, [kind.name for kind in kinds])

    @property
    def counts(self) -> dict[str, int]:
        """How many samples of each sensor were read."""
        return {name: sensor.count for name, sensor in self.sensors.items()}

    def _scene(self, recording: Any, filters: list[str]) -> LiveScene:
        from testbench.reporting.viewer import LiveScene

        scene = LiveScene(
            recording, self.session, self._content(filters), filters, self._plan.steps
        )
        if self._arm is not None and self._plan.trajectory is not None:
            scene.path("planned", self._arm.path(self._carried, self._plan.rough()))
        return scene

    def _content(self, filters: list[str]) -> LiveContent:
        """What the viewer is laid out for."""
        from testbench.reporting.viewer import LiveContent

        signals = {}
        for name, record in self.session.manifest.sensors.items():
            signals[name] = ["rate_deg_s", "specific_force_m_s2"]
            signals[name] += ["magnetic_field_uT"] if record.magnetometer else []
            signals[name] += ["temperature"] if record.temperature else []
        reach = None
        if self._arm is not None:
            rough = self._plan.rough()
            points = [self._arm.path(name, rough) for name in self.session.analysis.sensors]
            far = [float(np.linalg.norm(own, axis=1).max()) for own in points if len(own)]
            reach = max([0.3, *far])
        return LiveContent(
            self.session.sensor_names,
            signals,
            max(len(filters), 1),
            reach,
            {name: joint.label for name, joint in self._joints.items()},
            judged=self._arm is not None and bool(filters),
            guarded=self._guards is not None,
            stepped=bool(self._plan.steps),
        )

    @property
    def _carried(self) -> str:
        """The sensor whose path is drawn: the last one, as it is farthest out in protocols."""
        return list(self.session.analysis.sensors)[-1]

    def take(self, news: News) -> None:
        """Draw what came."""
        if news.arm is not None and self._arm is not None:
            self._arm.add(news.arm)
            self.scene.arm(news.arm)
            self.last_ns = max(self.last_ns, int(news.arm.host_time_ns[-1]))
        for name, samples in news.imus.items():
            self.scene.imu(name, samples, self.sensors[name].take(samples))
            self.last_ns = max(self.last_ns, int(samples.host_time_ns[-1]))
        for event in news.events:
            self._note(event)
        self.scene.events(news.events)
        self._draw_motion()
        if self._guards is not None:
            self._look_at_guards(self._guards, news)
        if self.last_ns - self._told_ns >= TOLD_NS:
            self._tell()

    def _note(self, event: Event) -> None:
        """Keep what an event says of the state of things."""
        self._doing.note(event)
        self.last_ns = max(self.last_ns, event.host_time_ns)
        evaluated = event.event == "step_started" and event.details.get("role") == "evaluation"
        if evaluated and self._held_ns is None:
            self._held_ns = event.host_time_ns

    def _draw_motion(self) -> None:
        """Axes, errors and joint angles where arm and sensors are known by now."""
        for name, sensor in self.sensors.items():
            moved = sensor.moved(self._held_ns)
            if moved is None:
                continue
            self.scene.axes(name, moved.time_ns, moved.estimated, moved.position)
            if moved.true is not None:
                self.scene.angles(f"errors/{name}/total", moved.time_ns, moved.errors)
                for joint in self._joints.values():
                    joint.add(name, moved.time_ns, {TRUE: moved.true, **moved.estimated})
        for name, joint in self._joints.items():
            time_ns, flexion = joint.take(self._held_ns)
            if TRUE in flexion:
                path, true = f"joints/{name}/{joint.label}", flexion[TRUE]
                errors = {key: own - true for key, own in flexion.items() if key != TRUE}
                self.scene.angles(f"{path}/flexion", time_ns, flexion)
                self.scene.angles(f"{path}/error", time_ns, errors)
        if self._arm is not None:
            pending = [own.pending_ns for own in self.sensors.values()]
            known = [ns for ns in pending if ns is not None]
            self._arm.forget(min([*known, self._arm.until_ns - NANOSECONDS]))

    def _look_at_guards(self, guards: GuardWatch, news: News) -> None:
        """How near each guard is to its limit, by the subject that is nearest."""
        joints = [] if self.session.robot is None else self.session.robot.joint_names
        arm = news.arm or _no_arm(joints)
        imus = dict.fromkeys(self.sensors, _no_samples()) | news.imus
        events: dict[str, list[Event]] = {}
        for event in news.events:
            events.setdefault(str(event.details.get("sensor", "")), []).append(event)
        guards.look(self.last_ns, arm, imus, events)

    def _tell(self) -> None:
        """Draw state, links and margins."""
        now = np.array([self.last_ns])
        if self._told_ns < 0 and self.last_ns > 2 * TOLD_NS:  # opened late
            self.scene.state(0, f"Nobody looked on until {self.last_ns / NANOSECONDS:.1f} s.")
        self._told_ns = self.last_ns
        own = self.sensors
        self.scene.lines("link/rate_hz", now, {k: np.array([s.rate_hz]) for k, s in own.items()})
        ages = {k: np.array([(self.last_ns - s.last_ns) * 1e-6]) for k, s in own.items()}
        self.scene.lines("link/age_ms", now, ages)
        self.scene.lines("link/lost", now, {k: np.array([float(s.lost)]) for k, s in own.items()})
        for guard, share in self._shares().items():
            said = guard.rpartition("_")[0].replace("_", " ")
            one = {said: np.array([100 * share])}
            self.scene.lines(f"margins/guards/{guard}", now, one)
        ahead = self._ahead()
        if ahead is not None:
            self.scene.path("ahead", ahead, self.last_ns)
        self.scene.state(self.last_ns, self._text())

    def _shares(self) -> dict[str, float]:
        """How much of its limit each guard came to, of its worst subject."""
        found: dict[str, float] = {}
        for (guard, _), share in (self._guards.shares if self._guards is not None else {}).items():
            found[guard] = max(share, found.get(guard, 0.0))
        return found

    def _ahead(self) -> np.ndarray | None:
        """Where the sensor farthest out goes next, shape (n, 3) [m]; None at the end."""
        knots = self._plan.trajectory
        if knots is None or self._arm is None:
            return None
        begin = self.last_ns - self._doing.shift_ns
        times = np.linspace(begin, begin + AHEAD_S * NANOSECONDS, AHEAD_POINTS).astype(np.int64)
        return self._arm.path(self._carried, knots.at(times)[0])

    def _text(self, over: str = "") -> str:
        """What is shown beside the bench."""
        rms: dict[str, Mapping[str, float | None]] = {
            name: {key: sensor.running.rms(key) for key in sensor.filters.names}
            for name, sensor in self.sensors.items()
        }
        rms |= {
            f"{name} {joint.label}": {key: joint.rms(key) for key in self._filters}
            for name, joint in self._joints.items()
        }
        held = self._held_ns is not None
        return "\n\n".join(
            [
                *self._doing.lines(self.last_ns, self._plan.duration_s, over),
                table_of_sensors(self.sensors, self._doing.batteries, self.last_ns),
                *self._doing.errors(rms if self._arm is not None else {}, held),
            ]
        )

    @property
    def _filters(self) -> list[str]:
        """Filters that run on any sensor."""
        return list(dict.fromkeys(n for own in self.sensors.values() for n in own.filters.names))

    def ended(self, session: Session) -> None:
        """Say how it ended.

        Args:
            session: As its manifest says now.
        """
        status = str(session.status)
        over = status if status != "running" else "cut off: the last sample is shown"
        self._tell()
        self.scene.state(self.last_ns, self._text(over))


class _Plan:
    """What a session was to do; nothing where there is no plan."""

    def __init__(self, session: Session):
        file = session.path / PLAN
        self.steps: list[PlannedStep] = []
        self.trajectory: Trajectory | None = None
        if file.is_file() and session.robot is not None:
            self.steps = stored_steps(file)
            self.trajectory = stored_trajectory(file, session.robot.joint_names)

    @property
    def duration_s(self) -> float | None:
        """How long it takes [s]; None where it is open."""
        return None if self.trajectory is None else self.trajectory.duration

    @property
    def evaluates(self) -> bool:
        """Whether a step is evaluated."""
        return any(step.role == "evaluation" for step in self.steps)

    def rough(self) -> np.ndarray:
        """Joint angles along the motion, shape (n, n_joints) [rad]."""
        if self.trajectory is None:
            return np.zeros((0, 0))
        first, last = int(self.trajectory.time_ns[0]), int(self.trajectory.time_ns[-1])
        return self.trajectory.at(np.linspace(first, last, PATH_POINTS).astype(np.int64))[0]


def _causal(session: Session) -> list[OrientationFilter]:
    """The filters that run beside a recording: of its protocol, with their parameters."""
    settings = session.analysis.estimate
    kinds = [get_filter(name, settings.filter_parameters.get(name)) for name in settings.filters]
    return [kind for kind in kinds if kind.causal][:MOST_FILTERS]


def _guards(session: Session) -> GuardWatch | None:
    """The limits that the recording is held to; None where it is held to none."""
    manifest, guards = session.manifest, None
    if manifest.protocol.file is not None:
        try:
            with stored_protocol(session) as file:
                guards = load_protocol(file).spec.guards
        except (BenchError, OSError):  # it is only looked at
            guards = None
    record = manifest.arm.record
    if guards is None and record is not None and record.simulated:
        return None
    live = manifest.kind == "recording" or not manifest.simulated_sensors
    return GuardWatch(guards or Guards(), session.sensor_names, live)


def _no_samples() -> ImuSamples:
    """No sample of a sensor."""
    none, time = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    return ImuSamples(time, time, none, none, None, None, time, np.zeros(0, dtype=bool))


def _no_arm(joints: list[str]) -> ArmSamples:
    """No sample of an arm."""
    none = np.zeros((0, len(joints)))
    return ArmSamples(joints, np.zeros(0, dtype=np.int64), none, none, none)
