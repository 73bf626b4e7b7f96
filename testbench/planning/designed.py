"""A designed calibration: from wishes to a checked protocol file, with its gain over another."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from testbench.exceptions import CollisionError, InputError, NotFoundError
from testbench.model.calibration_information import pose_information
from testbench.planning.design_protocol import Draft
from testbench.planning.experiment_design import (
    ACCELEROMETER_SIZE,
    ARM_DIRECTION,
    Design,
    Designer,
    Wanted,
)
from testbench.planning.optimal_design import efficiency
from testbench.planning.planner import find_robot, plan
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.session.plan import Plan
from testbench.records.specs.protocol import Protocol, Sensor
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import Robot, load_robot
from testbench.records.specs.strict import NAME_PATTERN

MOST_DETOURS = 20
LEFT_OUT = (
    "The moves between poses turn the gyroscope too; they are left out of what is predicted for it."
)


@dataclass(frozen=True)
class PredictedRow:
    """Standard uncertainty of one parameter as two protocols predict it.

    Attributes:
        parameter: Its name.
        unit: Its unit.
        compared: By the protocol compared with; None where it leaves the parameter undetermined.
        designed: By the design; None where it leaves the parameter undetermined.
        ratio: How many times smaller that of the design is; None where either is.
    """

    parameter: str
    unit: str
    compared: float | None
    designed: float | None
    ratio: float | None


@dataclass(frozen=True)
class DesignedProtocol:
    """What came out.

    Attributes:
        plan: Checked.
        compared: Name of the protocol compared with.
        compared_on: Name of the arm that makes it.
        rows: The table, each protocol as it is.
        efficiency: By how much the accelerometer's variances fall at as many visits and as much
            time at rest; None where the other protocol does not determine them.
        sentence: The same in words, with what it rests on.
        remark: What is left out of the prediction.
    """

    plan: Plan
    compared: str
    compared_on: str
    rows: list[PredictedRow]
    efficiency: float | None
    sentence: str
    remark: str = LEFT_OUT


class _NoWay(Exception):
    """No clear way leads to a pose, given by its index."""

    def __init__(self, pose: int, error: CollisionError):
        self.pose, self.error = pose, error


def design_protocol(
    out: Path,
    robot_name: str,
    like: str,
    sensor_name: str | None,
    wanted: Wanted,
    link: str | None = None,
) -> DesignedProtocol:
    """Design, compare, check and write a calibration protocol.

    Args:
        out: File to write.
        robot_name: Name or file of the arm.
        like: Name or file of the protocol to compare with.
        sensor_name: Its sensor that is calibrated; its only one if None.
        wanted: How many poses and turns, and how.
        link: That carries the sensor on this arm, in the mounting that `like` states; the link that
            `like` names if None.

    Raises:
        InputError: The file exists, or there is no such sensor, or no such design.
    """
    _check_file(out)
    protocol = load_protocol(like)
    sensors = protocol.spec.sensors
    name = _chosen_sensor(protocol, like, sensor_name)
    robot = load_robot(robot_name)
    sensor = sensors[name] if link is None else sensors[name].model_copy(update={"link": link})
    designer = Designer(robot, sensor)
    before, q, dwell = _compared(protocol, robot, sensors[name])
    chosen = f"{wanted.poses} poses and {wanted.turns} turns"
    purpose = (
        f"{chosen} chosen to leave the calibration least uncertain ({wanted.criterion}-optimal)"
    )
    without: set[tuple[float, ...]] = set()
    while True:
        design = designer.design(wanted, without)
        _refuse_undetermined(design)
        gain = _gain(before, q, dwell, designer, design, wanted)
        sentence = _sentence(
            gain,
            like if before.robot.name == robot.name else f"{like} on {before.robot.name}",
            wanted,
        )
        notes = [f"Designed for {robot.name}: {sentence}", LEFT_OUT]
        if link is not None:
            notes.append(
                f"The mounting is that of {like}, in the link {link}: correct it to where the "
                "sensor sits."
            )
        draft = Draft(out.stem, purpose, robot, name, sensor, design, notes)
        try:
            via_home, checked = _checked(draft)
            break
        except _NoWay as found:
            without.add(tuple(design.q[found.pose]))
            if len(without) > MOST_DETOURS:
                raise InputError(
                    f"no clear way was found: {found.error}; let other joints move with --joints"
                ) from None
    with stored_where_asked(out):
        write_text(out, draft.text(via_home), anew=True)
    rows = _rows(before.judged(q, [], dwell), design)
    return DesignedProtocol(checked, like, before.robot.name, rows, gain, sentence)


def _refuse_undetermined(design: Design) -> None:
    """Refuse poses that leave a parameter of the accelerometer unknown.

    Raises:
        InputError: Names those that they do.
    """
    lost = [parameter for parameter, sd in design.accelerometer.items() if not np.isfinite(sd)]
    if lost:
        raise InputError(
            f"poses of these joints leave {', '.join(lost)} undetermined; let other joints "
            "move with --joints"
        )


def _check_file(out: Path) -> None:
    """That a protocol can be written there."""
    if out.suffix not in {".yaml", ".yml"}:
        raise InputError(f"{out}: a protocol is a .yaml file")
    if not re.match(NAME_PATTERN, out.stem):
        raise InputError(
            f"{out}: the protocol is called after its file, by a letter, then up to 63 letters, "
            "digits and _"
        )
    if out.exists():
        raise InputError(f"{out} exists already; nothing was written")
    if not out.parent.is_dir():
        raise InputError(f"{out} cannot be written: there is no folder {out.parent}")


def _chosen_sensor(protocol: Protocol, like: str, sensor_name: str | None) -> str:
    """The sensor of that name, or the only one."""
    sensors = protocol.spec.sensors
    if sensor_name is None and len(sensors) > 1:
        raise InputError(
            f"the protocol {like} has several sensors ({', '.join(sensors)}); say which with "
            "--sensor"
        )
    name = sensor_name or next(iter(sensors))
    if name not in sensors:
        raise NotFoundError("sensor", name, list(sensors))
    return name


def _compared(
    protocol: Protocol, robot: Robot, sensor: Sensor
) -> tuple[Designer, np.ndarray, float]:
    """The static poses to compare with, shape (n, n_joints) [rad], and their dwell [s].

    They are on this arm if it can make them, else on the protocol's own.
    """
    own = find_robot(protocol, None)
    try:
        planned = plan(protocol, robot)
    except InputError:
        if robot.name == own.name:
            raise
        planned = plan(protocol, own)
    designer = Designer(planned.robot, sensor)
    return designer, *designer.poses_of(planned)


def _checked(draft: Draft) -> tuple[set[int], Plan]:
    """The poses that must be reached by way of home, and the plan that passes every check."""
    poses = len(draft.design.q)
    via_home: set[int] = set()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "design.yaml"
        for _ in range(MOST_DETOURS):
            file.write_text(draft.text(via_home), encoding="utf-8")
            try:
                return via_home, plan(load_protocol(file))
            except CollisionError as error:
                blocked = [k for k in range(poses) if error.step == f"pose {k + 1}"]
                leaving = [k for k in range(1, poses) if error.step == f"home before pose {k + 1}"]
                if leaving:
                    raise _NoWay(leaving[0] - 1, error) from None
                if not blocked:
                    raise InputError(
                        f"no clear way was found: {error}; let other joints move with --joints"
                    ) from None
                if blocked[0] in via_home or blocked[0] == 0:
                    raise _NoWay(blocked[0], error) from None
                via_home.add(blocked[0])
    raise InputError(
        f"no clear way through {poses} poses was found in {MOST_DETOURS} tries; ask for fewer"
    )


def _gain(
    compared: Designer,
    q: np.ndarray,
    dwell: float,
    designer: Designer,
    design: Design,
    wanted: Wanted,
) -> float | None:
    """Ratio of the accelerometer's variances at as many visits and as much time at rest.

    What does not average out over a rest, in-run bias and the arm's direction, is drawn anew for
    each visit: a protocol of fewer poses is compared as if it came back to them until both have
    paid as many visits. None where the ratio is not determined.
    """
    share = len(q) * dwell / len(design.q)
    before = pose_information(compared.force(q), compared.noise(share)).sum(axis=0) * (
        len(design.q) / len(q)
    )
    if np.linalg.matrix_rank(
        before * np.outer(ACCELEROMETER_SIZE, ACCELEROMETER_SIZE), tol=1e-6
    ) < len(before):
        return None
    after = pose_information(designer.force(design.q), designer.noise(share)).sum(axis=0)
    return efficiency(after, before, ACCELEROMETER_SIZE, wanted.criterion)


def _sentence(gain: float | None, like: str, wanted: Wanted) -> str:
    if gain is None:
        return f"{like} does not determine the accelerometer; this design does"
    kind = "geometric mean" if wanted.criterion == "D" else "sum"
    return (
        f"the {kind} of the accelerometer's variances falls {gain:.2f} times against {like} with "
        "as many visits and as much time at rest, with the arm's direction known to "
        f"{np.degrees(ARM_DIRECTION):g} deg in each"
    )


def _rows(compared: Design, design: Design) -> list[PredictedRow]:
    def finite(value: float) -> float | None:
        return value if np.isfinite(value) else None

    rows = []
    for before, after in (
        (compared.accelerometer, design.accelerometer),
        (compared.gyroscope, design.gyroscope),
    ):
        for name in before:
            unit = (
                "m/s^2" if name.startswith("acc_bias") else "rad/s" if name == "gyr_bias" else "1"
            )
            unit = "rad/s/(m/s^2)" if name.startswith("gyr_g") else unit
            ratio = (
                before[name] / after[name]
                if np.isfinite(before[name]) and np.isfinite(after[name])
                else None
            )
            rows.append(PredictedRow(name, unit, finite(before[name]), finite(after[name]), ratio))
    return rows
