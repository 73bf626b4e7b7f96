"""What moves in space: the arm, the true axes of its sensors, and the axes that the filters
estimate.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.urdf

from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.results.estimate import Estimate
from testbench.records.session.samples import ArmSamples, Truth
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot
from testbench.reporting.page.palette import rgb
from testbench.reporting.viewer.timeline import departing, every, send

WORLD = "bench"
ARM_RATE, AXES_RATE = 50.0, 20.0
"""Rates of what moves [Hz]."""
SIDE_BY_SIDE_LENGTH = 0.15
STILL = 1e-4
"""A joint is drawn anew once it is off by more than this [rad]."""
TURNED = 2e-3
"""Axes are drawn anew once a part of their quaternion is off by more than this, a quarter of a
degree turned and less than a pixel, or their place by as many metres.
"""
MOST_POSES = 20_000
"""Of one body, over the whole of a long recording."""
TRUE_AXES = ((230, 60, 60), (60, 170, 60), (70, 110, 240))
TRUE_LENGTH, ESTIMATED_LENGTH = 0.12, 0.085
ROW, COLUMN = 0.4, 0.4
"""Distances between the axes that stand side by side, the least between columns [m]."""
WIDE = 1.8
"""Part of the height of all rows that the columns may take, up to three times the least distance
apart.
"""
MOST_ROWS, MOST_COLUMNS = 8, 5
"""Of axes that stand side by side: more sensors go on beside the others, and of more filters the
last ones have no axes.
"""
MOST_LEVEL = 4
"""Names that stand beside one another on one level."""


class DrawnArm:
    """The arm by its meshes, moved by its joints' angles.

    Args:
        recording: To draw into.
        robot: The arm.
    """

    def __init__(self, recording: rr.RecordingStream, robot: Robot):
        self._recording = recording
        with tempfile.TemporaryDirectory() as folder:
            urdf = Path(folder) / "robot.urdf"
            urdf.write_text(viewable_urdf(robot), encoding="utf-8")
            tree = rr.urdf.UrdfTree.from_file_path(
                urdf,
                entity_path_prefix="arm",
                frame_prefix="arm/",
                static_transform_entity_path="arm/transforms",
            )
            tree.log_urdf_to_recording(recording)
            recording.flush()
        base = Pose.from_placement(robot.spec.base)
        root = f"arm/{tree.root_link().name}"
        recording.log("arm/base", _transform(base, WORLD, root), static=True)
        self._joints = [(name, tree.get_joint_by_name(name)) for name in robot.joint_names]

    def move(self, time_ns: np.ndarray, q: np.ndarray) -> None:
        """Let it stand as it did.

        Args:
            time_ns: Host times, shape (n,) [ns].
            q: Angles in the robot's order, shape (n, n_joints) [rad].
        """
        for column, (name, joint) in enumerate(self._joints):
            if joint is None or not len(q):
                continue
            rows = departing(q[:, [column]], STILL)
            transforms = joint.compute_transform_columns(q[rows, column].tolist(), clamp=False)
            send(self._recording, f"arm/joints/{name}", time_ns[rows], transforms)


def log_arm(recording: rr.RecordingStream, robot: Robot, samples: ArmSamples) -> None:
    """The arm as its joints were measured."""
    shown = every(samples.host_time_ns, ARM_RATE, MOST_POSES)
    DrawnArm(recording, robot).move(samples.host_time_ns[shown], samples.q_measured[shown])


def viewable_urdf(robot: Robot) -> str:
    """The URDF with absolute mesh addresses and without what the viewer must not draw or cannot
    find.
    """
    root = ElementTree.fromstring(robot.urdf.read_text(encoding="utf-8"))
    for parent in list(root.iter()):
        for child in list(parent):
            if (
                not isinstance(child.tag, str)
                or child.tag in {"collision", "gazebo", "transmission"}
                or child.tag.startswith("{")
            ):
                parent.remove(child)
            elif child.tag == "visual" and (mesh := child.find("geometry/mesh")) is not None:
                file = _mesh_file(robot, mesh.get("filename", ""))
                if file is None:
                    parent.remove(child)
                else:
                    mesh.set("filename", file.as_posix())
    return ElementTree.tostring(root, encoding="unicode")


def _mesh_file(robot: Robot, address: str) -> Path | None:
    """Where a mesh lies, or None."""
    for prefix in ("package://", "model://", "file://"):
        address = address.removeprefix(prefix)
    for folder in [*robot.mesh_folders(), Path("/")]:
        file = (folder / address).resolve()
        if file.is_file():
            return file
    return None


def log_mounted_sensor(recording: rr.RecordingStream, name: str, sensor: Sensor) -> None:
    """A sensor on its link: the housing and the true axes, which the arm carries along."""
    pose = Pose.from_placement(sensor.mounting)
    path = f"sensors/{name}/true"
    frame = f"sensor/{name}"
    recording.log(path, _transform(pose, f"arm/{sensor.link}", frame), static=True)
    recording.log(
        path, rr.CoordinateFrame(frame), _axes(TRUE_LENGTH, TRUE_AXES, 0.0035), static=True
    )
    housing = rr.Boxes3D(
        half_sizes=[[0.018, 0.015, 0.0055]],
        colors=[(250, 170, 40)],
        labels=[name],
        show_labels=True,
        fill_mode="solid",
    )
    recording.log(f"sensors/{name}/housing", rr.CoordinateFrame(frame), housing, static=True)


def log_estimated_sensor(
    recording: rr.RecordingStream,
    session: Session,
    name: str,
    estimate: Estimate,
    arm: ArmSamples,
    colours: dict[str, str],
) -> None:
    """The axes that each filter estimates, in the filter's colour, where the arm carries the
    sensor.
    """
    robot, sensor, own = (
        session.robot,
        session.analysis.sensors.get(name),
        estimate.sensors.get(name),
    )
    if robot is None or sensor is None or own is None or not own.orientation:
        return
    time = own.host_time_ns[every(own.host_time_ns, AXES_RATE, MOST_POSES)]
    q = np.column_stack(
        [
            np.interp(time, arm.host_time_ns, arm.q_measured[:, i])
            for i in range(arm.q_measured.shape[1])
        ]
    )
    position = (
        Kinematics(robot)
        .frame_motion(sensor.link, q, offset=Pose.from_placement(sensor.mounting))
        .position
    )
    for key, orientation in own.orientation.items():
        shown = orientation[every(own.host_time_ns, AXES_RATE, MOST_POSES)]
        path = f"sensors/{name}/estimated/{key}"
        log_moving_axes(
            recording, path, time, shown, position, ESTIMATED_LENGTH, [rgb(colours[key])] * 3
        )


def column_width(rows: int, columns: int) -> float:
    """Distance between columns [m]: of many rows, seen from afar, the names beneath the axes would
    overlap.
    """
    return float(np.clip(WIDE * ROW * rows / max(columns, 1), COLUMN, 3 * COLUMN))


@dataclass(frozen=True)
class Cells:
    """Where the axes of sensors stand beside one another, each with its name beneath or before it.

    Attributes:
        sensors: How many there are.
        axes: Most axes of one sensor.
    """

    sensors: int
    axes: int

    @property
    def rows(self) -> int:
        """Sensors above one another."""
        return -(-max(self.sensors, 1) // _blocks(self.sensors))

    @property
    def columns(self) -> int:
        """Axes beside one another."""
        return _blocks(self.sensors) * self.axes

    @property
    def width(self) -> float:
        """Distance between columns [m]."""
        return column_width(self.rows, self.columns)

    def places(self, sensor: int, cell: int) -> tuple[np.ndarray, np.ndarray]:
        """Where the axes of a cell are, and where its name is, shape (3,) each [m].

        Args:
            sensor: Its place among the sensors.
            cell: Of the sensor's axes.
        """
        width, column = self.width, sensor // self.rows * self.axes + cell
        aside, below = (0.5 * (width - COLUMN), 0.0) if width > 2 * COLUMN else (0.0, 0.45 * ROW)
        # long names side by side would cover each other
        if self.columns > MOST_LEVEL and column % 2:
            below += 0.2 * ROW
        place = np.array([0.0, width * column, -ROW * (sensor % self.rows)])
        return place, place - [0.0, aside, below]


def _blocks(sensors: int) -> int:
    """Into how many columns of sensors they are divided."""
    return -(-max(sensors, 1) // MOST_ROWS)


def axes_each(sensors: int, axes: int) -> int:
    """How many of the axes of a sensor there is room for.

    Args:
        sensors: How many stand side by side.
        axes: Most axes that one of them has.
    """
    return min(axes, max(1, MOST_COLUMNS // _blocks(sensors)))


def log_names(recording: rr.RecordingStream, labels: Sequence[tuple[str, np.ndarray]]) -> None:
    """The names of axes that stand side by side.

    Args:
        recording: To draw into.
        labels: Each name and its place, shape (3,) [m].
    """
    if labels:
        texts, places = zip(*labels, strict=True)
        points = rr.Points3D(
            places, labels=texts, radii=0.001, colors=(150, 150, 150), show_labels=True
        )
        recording.log("orientations/names", rr.CoordinateFrame(WORLD), points, static=True)


def log_side_by_side(
    recording: rr.RecordingStream,
    truths: dict[str, Truth | None],
    estimate: Estimate | None,
    colours: dict[str, str],
    columns: int,
    orders: Mapping[str, Sequence[str]],
) -> None:
    """True and estimated axes of every sensor, each with its name beneath, or before it.

    Args:
        recording: To draw into.
        truths: By sensor.
        estimate: Of the orientations.
        colours: By filter.
        columns: Most axes of one sensor.
        orders: Filters of each sensor, those that are wanted most first.
    """
    labels: list[tuple[str, np.ndarray]] = []
    cells = Cells(len(truths), columns)
    for sensor, (name, truth) in enumerate(truths.items()):
        axes = [] if truth is None else [("true", truth.host_time_ns, truth.q_world_from_sensor)]
        own = None if estimate is None else estimate.sensors.get(name)
        if own is not None:
            axes += [(key, own.host_time_ns, own.orientation[key]) for key in orders[name]]
        for i, (key, time, q) in enumerate(axes[:columns]):
            place, beneath = cells.places(sensor, i)
            labels.append((f"{name}: {key}" if i == 0 else key, beneath))
            chosen = every(time, AXES_RATE, MOST_POSES)
            known = np.isfinite(q[chosen]).all(axis=1)
            log_moving_axes(
                recording,
                f"orientations/{name}/{key}",
                time[chosen][known],
                q[chosen][known],
                np.tile(place, (int(known.sum()), 1)),
                SIDE_BY_SIDE_LENGTH,
                shades(colours.get(key)),
            )
    log_names(recording, labels)


def shades(colour: str | None) -> list[tuple[int, int, int]]:
    """Colours of three axes: red, green and blue, with a filter's in them if there is one."""
    return list(TRUE_AXES) if colour is None else [_tinted(axis, rgb(colour)) for axis in TRUE_AXES]


def log_moving_axes(
    recording: rr.RecordingStream,
    path: str,
    time_ns: np.ndarray,
    q_world_from_sensor: np.ndarray,
    position: np.ndarray,
    length: float,
    colours: list[tuple[int, int, int]],
) -> None:
    """Three axes and their whole motion; nothing where there is none.

    Args:
        recording: To draw into.
        path: Of the axes.
        time_ns: Host times, shape (n,) [ns].
        q_world_from_sensor: Shape (n, 4).
        position: In the world, shape (n, 3) [m].
        length: Of each axis [m].
        colours: Of each axis.
    """
    send_poses(recording, path, time_ns, q_world_from_sensor, position)
    if len(time_ns):
        log_axes(recording, path, length, colours)


def log_axes(
    recording: rr.RecordingStream,
    path: str,
    length: float,
    colours: list[tuple[int, int, int]],
) -> None:
    """Three axes, to be moved by `send_poses`."""
    axes = _axes(length, tuple(colours), 0.026 * length)
    recording.log(path, rr.CoordinateFrame(path), axes, static=True)


def send_poses(
    recording: rr.RecordingStream,
    path: str,
    time_ns: np.ndarray,
    q_world_from_sensor: np.ndarray,
    position: np.ndarray,
) -> None:
    """Where axes stand, and how they are turned.

    Args:
        recording: To draw into.
        path: Of the axes.
        time_ns: Host times, shape (n,) [ns].
        q_world_from_sensor: Shape (n, 4).
        position: In the world, shape (n, 3) [m].
    """
    if not len(time_ns):
        return
    rows = departing(np.column_stack([q_world_from_sensor, position]), TURNED)
    q = np.roll(q_world_from_sensor[rows], -1, axis=1)  # rerun wants x, y, z, w
    columns = rr.Transform3D.columns(
        translation=position[rows],
        quaternion=q,
        parent_frame=[WORLD] * len(rows),
        child_frame=[path] * len(rows),
    )
    send(recording, f"{path}/pose", time_ns[rows], columns)


def _axes(length: float, colours: tuple[tuple[int, int, int], ...], radius: float) -> rr.Arrows3D:
    return rr.Arrows3D(
        vectors=length * np.eye(3), origins=np.zeros((3, 3)), colors=colours, radii=radius
    )


def _tinted(axis: tuple[int, int, int], colour: tuple[int, int, int]) -> tuple[int, int, int]:
    """The colour of an axis with a third of a filter's in it."""
    red, green, blue = (round(0.7 * a + 0.3 * c) for a, c in zip(axis, colour, strict=True))
    return red, green, blue


def _transform(pose: Pose, parent: str, child: str) -> rr.Transform3D:
    q = np.roll(rotation.from_matrix(pose.R), -1)
    return rr.Transform3D(
        translation=pose.position, quaternion=q, parent_frame=parent, child_frame=child
    )
