"""Every key of a manifest, whoever writes it, is in docs/session_format.md, and every key there is
written by somebody.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench import execute, plan
from testbench.clock import SystemClock
from testbench.drivers.arms.replay import ReplayArm
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError
from testbench.execution import RunOptions
from testbench.execution.device_recorder import record_devices
from testbench.execution.devices import open_devices
from testbench.execution.executor import execute_on_arm
from testbench.execution.run_progress import Progress
from testbench.execution.sensors import Sensors
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.formats.vendors.imu_tk import COUNTS_PER_M_S2
from testbench.pipeline.analyse import Result
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from tests.asking import going_on
from tests.conftest import FakeClock
from tests.drivers.fake_dots import Bench, FakeDot
from tests.execution.test_record import Feeder
from tests.lock_step.bench import virtual_bench
from tests.system.test_xarm_arm import MOVES, plan_of

PAGE = Path(__file__).parents[2] / "docs" / "session_format.md"
TIME = np.arange(400) / 100
UP = np.tile([0.0, 0.0, 9.80665], (400, 1))
REST = np.zeros((400, 3))


def documented() -> dict[str, set[str]]:
    """Kinds of session by key, of the tables under `manifest.json`; `<sensor>` and `<joint>` stand
    for any name, a last `*` for anything.
    """
    section = PAGE.read_text(encoding="utf-8").split("### manifest.json")[1].split("\n## ")[0]
    result = {}
    for line in section.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) == 3:
            kinds = (
                {"run", "import", "recording"} if cells[1] == "all" else set(cells[1].split(", "))
            )
            result |= dict.fromkeys(re.findall(r"`([^`]+)`", cells[0]), kinds)
    return result


def keys(value: Any, path: str = "") -> Iterator[str]:
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from keys(inner, f"{path}.{key}" if path else key)
    else:
        yield path


def pattern(key: str) -> str:
    """A regular expression for a documented key."""
    text = re.escape(key).replace("<sensor>", "[^.]+").replace("<joint>", "[^.]+")
    return text.replace(r"\.\*", r"(\..+)?")


def table(
    path: Path, columns: dict[str, np.ndarray], above: str = "", separator: str = ","
) -> Path:
    rows = zip(*([f"{value:.9g}" for value in column] for column in columns.values()), strict=True)
    path.write_text(
        above
        + separator.join(columns)
        + "\n"
        + "\n".join(separator.join(row) for row in rows)
        + "\n"
    )
    return path


def xyz(form: str, array: np.ndarray, axes: str = "XYZ") -> dict[str, np.ndarray]:
    return {form.format(axis): array[:, i] for i, axis in enumerate(axes)}


def imports(folder: Path) -> Iterator[Session]:
    clock = FakeClock()

    def load(
        name: str,
        files: list[Path],
        options: Options | None = None,
        truth: TruthOptions | None = None,
    ) -> Session:
        return import_recording(name, files, folder / f"session_{name}", clock, options, truth)

    above = (
        "sep=,\nDeviceTag:,left\nFirmwareVersion:,2.0.0\nFilterProfile:,General\n"
        "OutputRate:,60Hz\nStartTime:,now\n\n"
    )
    dot = (
        {"PacketCounter": np.arange(400), "SampleTimeFine": 16667 * np.arange(400)}
        | xyz("Acc_{}", UP)
        | xyz("Gyr_{}", REST)
    )
    yield load("xsens_dot", [table(folder / "dot.csv", dot, above)])
    above = "// DeviceId: 00B432CC\n// ProductCode: MTw\n// Firmware Version: 4.6.0\n"
    above += "// Filter Profile: human\n// Update Rate: 100.0Hz\n"
    mtw = {"PacketCounter": np.arange(400)} | xyz("Acc_{}", UP) | xyz("Gyr_{}", REST)
    yield load("mtw", [table(folder / "MT_0120-000_00B432CC.txt", mtw, above, "\t")])
    for kind, values in (("acc", 32768 + COUNTS_PER_M_S2 * UP), ("gyro", 32768 + REST)):
        np.savetxt(
            folder / f"pair_{kind}.mat", np.column_stack([TIME, np.round(values)]), fmt="%.4f"
        )
    yield load("imu_tk", [folder / "pair_acc.mat", folder / "pair_gyro.mat"])
    (folder / "map.yaml").write_text(
        "description: counts\nrate_hz: 100\nsensors: {imu: {acc: {columns: [x, y, z], unit: g, "
        "offset: 32768, scale: 1.0e-3}, "
        "gyr: {columns: [u, v, w], unit: deg/s, full_scale: 2000}}}\n"
    )
    counts = table(
        folder / "counts.csv",
        xyz("{}", 32768 + 1000 * UP / 9.80665, "xyz") | xyz("{}", REST, "uvw"),
    )
    (folder / "poses.txt").write_text("0,-90,-90,-90,90,180\n")
    truth = TruthOptions(
        folder / "poses.txt", "ur3e", {"": "wrist_3_link"}, dwell=2.0, move=1.0, offset=0.0
    )
    yield load("generic", [counts], Options(str(folder / "map.yaml")), truth)
    (folder / "reference.yaml").write_text(
        "description: with a reference\nrate_hz: 100\nsensors: {imu: {acc: {columns: [x, y, z], "
        "unit: m/s^2}, truth: {columns: [q, i, j, k], order: wxyz, world: unknown}}}\n"
    )
    level = dict(zip("qijk", np.tile([[1.0], [0.0], [0.0], [0.0]], 400), strict=True))
    referred = table(folder / "referred.csv", xyz("{}", UP, "xyz") | level)
    again = import_recording(
        "generic",
        [referred],
        folder / "session_reference",
        clock,
        Options(str(folder / "reference.yaml")),
    )
    yield again
    sensor = "{acc: {columns: [x, y, z], unit: m/s^2}, gyr: {columns: [u, v, w], unit: rad/s}}"
    (folder / "knee.yaml").write_text(
        "description: a knee and its angle\nrate_hz: 100\nsensors:\n"
        f"  thigh: {sensor}\n  shank: {sensor}\n"
        "joints: {knee_r: {proximal: thigh, distal: shank, definition: knee}}\n"
        "alignment: {method: standing}\n"
        "truth_angles: {file: bend.csv, time: {column: t, unit: s}, unit: deg, offset_s: 0.5, "
        "joints: {knee_r: {flexion: bend}}}\n"
    )
    table(folder / "bend.csv", {"t": TIME, "bend": 20 * TIME})
    both = table(folder / "both.csv", xyz("{}", UP, "xyz") | xyz("{}", REST, "uvw"))
    mapped = Options(str(folder / "knee.yaml"))
    yield import_recording("generic", [both], folder / "session_knee", clock, mapped)


@contextmanager
def live_devices() -> Iterator[tuple[Feeder, Bench]]:
    """A serial board and an Xsens DOT that send as long as the context lasts."""
    board, bench = Feeder(), Bench(FakeDot("D4:22:CD:00:00:01"))
    ended = threading.Event()

    def live() -> None:
        for number in range(10_000):
            if ended.wait(1 / 60):
                return
            if bench.dots[0].streaming is not None:
                bench.dots[0].send(bench.dots[0].payload(number))

    life = threading.Thread(target=live)
    life.start()
    try:
        yield board, bench
    finally:
        ended.set()
        life.join()
        board.close()
        bench.close()


def recordings(folder: Path) -> Iterator[Session]:
    with live_devices() as (board, bench):
        devices = open_devices(
            [f"{board.port}:mpu6050_plain"],
            [bench.dots[0].address],
            bluetooth=bench.loop,
        )
        yield record_devices(devices, folder, duration_s=0.6)


def runs(folder: Path, tiny: Path, short_plan: Plan) -> Iterator[Session]:
    """A run that broke off and was resumed, a replay with live sensors, and runs on emulated
    arms.
    """
    the_plan = plan(tiny)

    def fail(progress: Progress) -> None:
        raise DriverError("told to fail")

    with pytest.raises(DriverError, match="told to fail"):
        execute(
            the_plan,
            folder,
            options=RunOptions(clock=FakeClock(), progress=fail, session_name="broken"),
        )
    broken = run(going_on(folder / "broken"), Watcher(clock=FakeClock())).session
    yield broken
    text = tiny.read_text(encoding="utf-8")
    sensors = text.split("sensors:\n")[1].split("motion:")[0]
    two = text.replace(sensors, sensors.replace("hand", "board") + sensors.replace("hand", "dot"))
    (folder / "two.yaml").write_text(two, encoding="utf-8")
    with live_devices() as (board, bench):
        time = SessionTime(SystemClock())
        named = [f"board={board.port}:mpu6050_plain"], [f"dot={bench.dots[0].address}"]
        devices = open_devices(*named, time, bluetooth=bench.loop)
        moved = plan(folder / "two.yaml")
        arm = ReplayArm(moved.robot, broken.path, time)
        yield execute_on_arm(moved, arm, Sensors.live(moved, devices), RunOptions(folder))
    with virtual_bench() as bench:
        told = {"checklist": {"by": "a test"}, "resumes": {"session": "none", "steps": []}}
        yield bench.drive(short_plan, bench.ur(), folder, **told)
        yield bench.drive(plan_of(folder, "moves", MOVES)[1], bench.xarm(), folder)


@pytest.fixture(scope="module")
def written(
    quick: Result,
    tiny: Path,
    short_plan: Plan,
    tmp_path_factory: pytest.TempPathFactory,
) -> dict[str, set[str]]:
    """Kinds of session by the keys that were written into their manifests."""
    pytest.importorskip("serial")
    folder = tmp_path_factory.mktemp("kinds")
    found: dict[str, set[str]] = {}
    for session in [
        quick.session,
        *imports(folder),
        *recordings(folder),
        *runs(folder / "runs", tiny, short_plan),
    ]:
        for key in keys(session.manifest.content):
            found.setdefault(key, set()).add(session.manifest.kind)
    return found


def test_every_key_that_is_written_is_documented_for_its_kind_of_session(
    written: dict[str, set[str]],
) -> None:
    known = documented()
    assert len(known) > 40
    for key, kinds in written.items():
        fitting = [allowed for name, allowed in known.items() if re.fullmatch(pattern(name), key)]
        assert fitting, f"docs/session_format.md does not say what {key} is"
        assert kinds <= set.union(*fitting), (
            f"{key} is written by {kinds}, documented for {fitting}"
        )


def test_every_key_that_is_documented_is_written_by_each_kind_that_is_named(
    written: dict[str, set[str]],
) -> None:
    for name, kinds in documented().items():
        found = [own for key, own in written.items() if re.fullmatch(pattern(name), key)]
        assert found, f"nothing writes {name}"
        assert set.union(*found) == kinds, (
            f"{name} is documented for {kinds}, but written by {set.union(*found)}"
        )
