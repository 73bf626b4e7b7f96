"""What is drawn of a session while it is recorded, chunk by chunk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr

from testbench.frames import NANOSECONDS
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event, Session
from testbench.records.specs.robot import Robot
from testbench.reporting.page.palette import COLOURS, REFERENCE, filter_colours, rgb
from testbench.reporting.viewer.live_layout import LiveContent, live_layout
from testbench.reporting.viewer.scene import (
    ARM_RATE,
    AXES_RATE,
    ESTIMATED_LENGTH,
    SIDE_BY_SIDE_LENGTH,
    WORLD,
    Cells,
    DrawnArm,
    axes_each,
    log_axes,
    log_mounted_sensor,
    log_names,
    send_poses,
    shades,
)
from testbench.reporting.viewer.signals import (
    moving_phase,
    name_sections,
    send_events,
    send_rows,
    send_states,
    style_lines,
    style_vector,
)
from testbench.reporting.viewer.timeline import send

PATHS = {"planned": ((130, 136, 145), 0.001), "ahead": ((250, 170, 40), 0.003)}
"""Colour and radius [m] of the way of a sensor as planned: all of it, and what comes next."""
SIGNAL_RATE, ANGLE_RATE = 125.0, 20.0
"""Most rows a second of a sensor's signals, and of errors and angles [Hz]."""


class Thinner:
    """Lets some of the instants of a stream through, about so many a second.

    Args:
        rate: Most instants in a second [Hz].
    """

    def __init__(self, rate: float):
        self._interval_ns = round(NANOSECONDS / rate)
        self._last = -1

    def rows(self, time_ns: np.ndarray) -> np.ndarray:
        """The first instant in each interval, by index.

        Args:
            time_ns: Of a chunk behind those before, shape (n,).
        """
        slots = time_ns // self._interval_ns
        new = slots > np.maximum.accumulate(np.r_[self._last, slots[:-1]])
        if len(slots):
            self._last = max(self._last, int(slots.max()))
        return np.flatnonzero(new)


class LiveScene:
    """Draws what comes of a session.

    Args:
        recording: To draw into.
        session: That is recorded.
        content: What it will hold.
        filters: Those that may run, for their colours.
        steps: Of its plan.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        session: Session,
        content: LiveContent,
        filters: Sequence[str],
        steps: Sequence[PlannedStep] = (),
    ):
        self._recording, self._content = recording, content
        self._colours = filter_colours(list(filters)) | {"true": REFERENCE, "arm": REFERENCE}
        self._robot = session.robot
        self._arm: DrawnArm | None = None
        self._thin: dict[str, Thinner] = {}
        self._styled: dict[str, list[str]] = {}
        self._section = ""
        recording.send_blueprint(live_layout(content))
        recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        recording.log("/", rr.CoordinateFrame(WORLD), static=True)
        if self._robot is not None:
            self._arm = DrawnArm(recording, self._robot)
            for which in PATHS:
                recording.log(f"path/{which}", rr.CoordinateFrame(WORLD), static=True)
            for name, sensor in session.analysis.sensors.items():
                log_mounted_sensor(recording, name, sensor)
        if steps:
            name_sections(recording, [step.section for step in steps])
        for name, keys in content.signals.items():
            for key in keys:
                if key != "temperature":
                    style_vector(recording, f"imu/{name}/{key}")

    def _rows(self, path: str, time_ns: np.ndarray, rate: float) -> np.ndarray:
        return self._thin.setdefault(path, Thinner(rate)).rows(time_ns)

    def arm(self, samples: ArmSamples) -> None:
        """What the arm reported, and how far its joints are from their limits."""
        rows = self._rows("arm", samples.host_time_ns, ARM_RATE)
        time, q = samples.host_time_ns[rows], samples.q_measured[rows]
        if self._arm is None or self._robot is None or not len(rows):
            return
        self._arm.move(time, q)
        names = samples.joint_names
        few = self._rows("margins", time, ANGLE_RATE)
        position, speed = _margins(self._robot, q[few], samples.v_measured[rows][few])
        self.lines("margins/position", time[few], dict(zip(names, position.T, strict=True)))
        self.lines("margins/speed", time[few], dict(zip(names, speed.T, strict=True)))

    def imu(self, name: str, samples: ImuSamples, time_ns: np.ndarray) -> None:
        """Raw signals of a sensor.

        Args:
            name: Of the sensor.
            samples: What it delivered.
            time_ns: When they were taken, which may be steadier than when they arrived, host time,
                shape (n,).
        """
        rows = self._rows(f"imu/{name}", time_ns, SIGNAL_RATE)
        time = time_ns[rows]
        if not len(rows):
            return
        send_rows(self._recording, f"imu/{name}/rate_deg_s", time, np.degrees(samples.gyr[rows]))
        send_rows(self._recording, f"imu/{name}/specific_force_m_s2", time, samples.acc[rows])
        if samples.mag is not None:
            send_rows(self._recording, f"imu/{name}/magnetic_field_uT", time, samples.mag[rows])
        if samples.temperature is not None:
            few = rows[self._rows(f"imu/{name}/temperature", time, 1.0)]
            one = {"temperature": samples.temperature[few]}
            self.lines(f"imu/{name}/temperature", time_ns[few], one)

    def lines(self, path: str, time_ns: np.ndarray, values: Mapping[str, np.ndarray]) -> None:
        """Points of the lines of one plot.

        Args:
            path: Of the plot.
            time_ns: Host times, shape (n,) [ns].
            values: Of each line, by its name, shape (n,) each, in the plot's unit.
        """
        if not len(time_ns) or not values:
            return
        names = list(values)
        if self._styled.get(path) != names:
            own = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
            style_lines(self._recording, path, names, own | self._colours)
            self._styled[path] = names
        send_rows(self._recording, path, time_ns, np.column_stack(list(values.values())))

    def angles(self, path: str, time_ns: np.ndarray, values: Mapping[str, np.ndarray]) -> None:
        """Angles as lines of one plot [deg], as often as is looked at.

        Args:
            path: Of the plot.
            time_ns: Host times, shape (n,) [ns].
            values: Of each line, by its name, shape (n,) each [rad].
        """
        rows = self._rows(path, time_ns, ANGLE_RATE)
        shown = {name: np.degrees(own[rows]) for name, own in values.items()}
        self.lines(path, time_ns[rows], shown)

    def axes(
        self,
        sensor: str,
        time_ns: np.ndarray,
        estimated: Mapping[str, np.ndarray],
        position: np.ndarray | None,
    ) -> None:
        """The axes that filters estimate.

        Args:
            sensor: Its name.
            time_ns: Host times, shape (n,) [ns].
            estimated: q_world_from_sensor by filter, shape (n, 4) each.
            position: Of the sensor, shape (n, 3) [m]; beside one another if None.
        """
        rows = self._rows(f"axes/{sensor}", time_ns, AXES_RATE)
        place = self._content.sensors.index(sensor)
        sensors = self._content.sensors
        cells = Cells(len(sensors), axes_each(len(sensors), self._content.axes))
        if position is None:
            estimated = dict(list(estimated.items())[: cells.axes])
        where = f"sensors/{sensor}/estimated" if position is not None else f"orientations/{sensor}"
        new = self._styled.get(where) != list(estimated)
        self._styled[where] = list(estimated)
        for i, (name, q) in enumerate(estimated.items()):
            path, colour = f"{where}/{name}", self._colours[name]
            if new and position is None:
                log_axes(self._recording, path, SIDE_BY_SIDE_LENGTH, shades(colour))
            elif new:
                log_axes(self._recording, path, ESTIMATED_LENGTH, [rgb(colour)] * 3)
            beside = np.tile(cells.places(place, i)[0], (len(rows), 1))
            at = beside if position is None else position[rows]
            send_poses(self._recording, path, time_ns[rows], q[rows], at)
        if new and position is None:
            self._name_axes(cells)

    def _name_axes(self, cells: Cells) -> None:
        """The names beneath the axes that stand beside one another."""
        labels = []
        for place, sensor in enumerate(self._content.sensors):
            for i, name in enumerate(self._styled.get(f"orientations/{sensor}", [])):
                said = f"{sensor}: {name}" if i == 0 else name
                labels.append((said, cells.places(place, i)[1]))
        log_names(self._recording, labels)

    def path(self, which: str, points: np.ndarray, at_ns: int | None = None) -> None:
        """The way of a sensor as planned.

        Args:
            which: Of `PATHS`.
            points: In the world, shape (n, 3) [m].
            at_ns: From when on it is shown [ns]; always if None.
        """
        colour, radius = PATHS[which]
        strips = rr.LineStrips3D([points], colors=colour, radii=radius)
        if at_ns is None:
            self._recording.log(f"path/{which}", strips, static=True)
        else:
            columns = rr.LineStrips3D.columns(strips=[points], colors=[colour], radii=[radius])
            send(self._recording, f"path/{which}", np.array([at_ns]), columns)

    def events(self, events: Sequence[Event]) -> None:
        """What happened, and which step began."""
        send_events(self._recording, events)
        for event in events:
            at = event.host_time_ns
            if event.event == "step_started":
                section = str(event.details.get("section", ""))
                if section != self._section:
                    send_states(self._recording, "section", [(at, section)])
                    self._section = section
                kind = str(event.details.get("kind", ""))
                send_states(self._recording, "phase", [(at, moving_phase(kind))])
            elif event.event == "step_settled":
                send_states(self._recording, "phase", [(at, "dwell")])

    def state(self, at_ns: int, text: str) -> None:
        """What is shown beside the bench, as Markdown, from a host time on [ns]."""
        columns = rr.TextDocument.columns(text=[text], media_type=["text/markdown"])
        send(self._recording, "live/state", np.array([at_ns]), columns)


def _margins(robot: Robot, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far joints are from the nearer of their limits [deg], and what part of their fastest
    speed they move at [%], shape (n, n_joints) each; NaN where a joint has no limit.
    """
    low, high = robot.position_limits.T
    nearest = np.degrees(np.minimum(q - low, high - q))
    nearest[:, ~np.isfinite(nearest).all(axis=0)] = np.nan
    return nearest, 100 * np.abs(v) / robot.velocity_limits
