"""A designed calibration from its wishes to its checked protocol file, with the gain over another protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from testbench.exceptions import CollisionError, InputError, NotFoundError
from testbench.model.calibration_information import pose_information
from testbench.planning.design_protocol import protocol_text
from testbench.planning.experiment_design import ACCELEROMETER_SIZE, ARM_DIRECTION, Design, Designer, Wanted
from testbench.planning.optimal_design import efficiency
from testbench.planning.planner import plan
from testbench.records.plan import Plan
from testbench.records.protocol_file import load_protocol
from testbench.records.robot import load_robot

MOST_DETOURS = 20
LEFT_OUT = "The moves between poses turn the gyroscope too; they are left out of what is predicted for it."


@dataclass(frozen=True)
class PredictedRow:
    """Predicted standard uncertainty by the protocol compared with and by the design; None where undetermined."""

    parameter: str
    unit: str
    compared: float | None
    designed: float | None
    ratio: float | None


@dataclass(frozen=True)
class DesignedProtocol:
    """What came out.

    Attributes:
        plan: Checked. compared: Name of the protocol compared with. rows: The table, each protocol as it is. efficiency: By
        how much the accelerometer's variances fall at as many visits and as much time at rest; None where the other protocol
        does not determine them. sentence: The same in words, with what it rests on.
    """

    plan: Plan
    compared: str
    rows: list[PredictedRow]
    efficiency: float | None
    sentence: str


def design_protocol(out: Path, robot_name: str, like: str, sensor_name: str | None, wanted: Wanted) -> DesignedProtocol:
    """Design, compare, check and write a calibration protocol; see `pipeline.design_calibration`."""
    if out.suffix not in {".yaml", ".yml"}:
        raise InputError(f"{out}: a protocol is a .yaml file")
    if out.exists():
        raise InputError(f"{out} exists already; nothing was written")
    if not out.parent.is_dir():
        raise InputError(f"{out} cannot be written: there is no folder {out.parent}")
    protocol = load_protocol(like)
    sensors = protocol.spec.sensors
    if sensor_name is None and len(sensors) > 1:
        raise InputError(f"the protocol {like} has several sensors ({', '.join(sensors)}); say which with --sensor")
    name = sensor_name or next(iter(sensors))
    if name not in sensors:
        raise NotFoundError("sensor", name, list(sensors))
    robot = load_robot(robot_name)
    designer = Designer(robot, sensors[name])
    design = designer.design(wanted)
    q, dwell = designer.poses_of(plan(protocol, robot))
    lost = [name for name, sd in design.accelerometer.items() if not np.isfinite(sd)]
    if lost:
        raise InputError(f"poses of these joints leave {', '.join(lost)} undetermined; let other joints move with --joints")
    compared = designer.judged(q, [], dwell)
    rows = _rows(compared, design)
    gain = _gain(designer, q, dwell, design, wanted)
    sentence = _sentence(gain, like, wanted)
    chosen = f"{wanted.poses} poses and {wanted.turns} turns"
    purpose = f"{chosen} chosen to leave the calibration least uncertain ({wanted.criterion}-optimal)"
    notes = [f"Designed for {robot.name}: {sentence}", LEFT_OUT]

    def text(via_home: set[int]) -> str:
        return protocol_text(out.stem, purpose, robot, name, sensors[name], design, via_home, notes)

    via_home, checked = _checked(text, len(design.q))
    out.write_text(text(via_home), encoding="utf-8")
    return DesignedProtocol(checked, like, rows, gain, sentence)


def _checked(text: Callable[[set[int]], str], poses: int) -> tuple[set[int], Plan]:
    """The poses that must be reached by way of home, and the plan that passes every check."""
    via_home: set[int] = set()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "design.yaml"
        for _ in range(MOST_DETOURS):
            file.write_text(text(via_home), encoding="utf-8")
            try:
                return via_home, plan(load_protocol(file))
            except CollisionError as error:
                blocked = [k for k in range(poses) if error.step == f"pose {k + 1}"]
                if not blocked or blocked[0] in via_home:
                    raise InputError(f"no clear way was found: {error}; let other joints move with --joints") from None
                via_home.add(blocked[0])
    raise InputError(f"no clear way through {poses} poses was found in {MOST_DETOURS} tries; ask for fewer")


def _gain(designer: Designer, q: np.ndarray, dwell: float, design: Design, wanted: Wanted) -> float | None:
    """Ratio of the accelerometer's variances at as many visits and as much time at rest; None where it is not determined.

    What does not average out over a rest, in-run bias and the arm's direction, is drawn anew for each visit: a protocol of
    fewer poses is compared as if it came back to them until both have paid as many visits.
    """
    share = len(q) * dwell / len(design.q)
    before = pose_information(designer.force(q), designer.noise(share)).sum(axis=0) * (len(design.q) / len(q))
    if np.linalg.matrix_rank(before * np.outer(ACCELEROMETER_SIZE, ACCELEROMETER_SIZE), tol=1e-6) < len(before):
        return None
    after = pose_information(designer.force(design.q), designer.noise(share)).sum(axis=0)
    return efficiency(after, before, ACCELEROMETER_SIZE, wanted.criterion)


def _sentence(gain: float | None, like: str, wanted: Wanted) -> str:
    if gain is None:
        return f"{like} does not determine the accelerometer; this design does"
    kind = "geometric mean" if wanted.criterion == "D" else "sum"
    return (
        f"the {kind} of the accelerometer's variances falls {gain:.2f} times against {like} with as many visits and as much "
        f"time at rest, with the arm's direction known to {np.degrees(ARM_DIRECTION):g} deg in each"
    )


def _rows(compared: Design, design: Design) -> list[PredictedRow]:
    def finite(value: float) -> float | None:
        return value if np.isfinite(value) else None

    rows = []
    for before, after in ((compared.accelerometer, design.accelerometer), (compared.gyroscope, design.gyroscope)):
        for name in before:
            unit = "m/s^2" if name.startswith("acc_bias") else "rad/s" if name == "gyr_bias" else "1"
            unit = "rad/s/(m/s^2)" if name.startswith("gyr_g") else unit
            ratio = before[name] / after[name] if np.isfinite(before[name]) and np.isfinite(after[name]) else None
            rows.append(PredictedRow(name, unit, finite(before[name]), finite(after[name]), ratio))
    return rows
