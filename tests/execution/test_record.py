"""`testbench record`: devices on pseudo-terminals become a session that the later stages read;
interruptions keep it whole.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench import Session
from testbench.cli.app import app
from testbench.drivers.imus.base import Imu
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, InputError, RunInterrupted, SessionError
from testbench.execution import RunOptions
from testbench.execution import devices as live_devices
from testbench.execution.device_recorder import record_devices
from testbench.execution.devices import Devices, open_devices, scan_devices
from testbench.execution.recovery import recover
from testbench.pipeline.analyse import analyse
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Event, RunStatus
from tests.asking import analysis
from tests.patience import PATIENCE_S

pytest.importorskip("serial")


class Feeder:
    """A board that writes `t ax ay az gx gy gz` in ms, g and deg/s to a pseudo-terminal until it is
    closed.
    """

    def __init__(self, rate: float = 100.0):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)  # a board does not wait for anybody to listen
        self.port, self.rate, self.ended = os.ttyname(self.slave), rate, threading.Event()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        begin, k = time.monotonic(), 0
        while not self.ended.wait(max(begin + k / self.rate - time.monotonic(), 0)):
            wobble, other = 0.01 * math.sin(3 * k), 0.01 * math.cos(3 * k)
            third = 0.01 * math.sin(5 * k)
            text = (
                f"{k * 1000 / self.rate:.0f} {wobble:.4f} {other:.4f} {1 - wobble:.4f} "
                f"{wobble:.4f} {20 + other:.4f} {third:.4f}\n"
            )
            with suppress(BlockingIOError):
                os.write(self.master, text.encode())
            k += 1

    def close(self) -> None:
        self.ended.set()
        self.thread.join()
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def board() -> Iterator[Feeder]:
    feeder = Feeder()
    yield feeder
    feeder.close()


def command(*arguments: str, **options: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "testbench", "record", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def wait_for_samples(logs: Path) -> Path:
    """The session's folder, once a few samples are on disk."""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        for journal in logs.glob("*/imu_*.arrows"):
            if journal.stat().st_size > 4000:
                return journal.parent
        time.sleep(0.02)
    raise AssertionError("nothing was recorded")


def test_a_recording_is_a_session_that_is_estimated_evaluated_and_reported(
    board: Feeder, tmp_path: Path
) -> None:
    devices = open_devices([f"wrist={board.port}:mpu6050_plain"], [])
    session = record_devices(devices, tmp_path, duration_s=1.2, name="desk")
    assert session.status is RunStatus.COMPLETED and session.path.name.endswith("_desk")
    manifest = session.manifest.content
    assert manifest["kind"] == "recording" and manifest["duration_s"] == 1.2
    assert (
        session.robot is None
        and session.arm() is None
        and session.truth("wrist") is None
        and not session.steps
    )
    samples = session.imu("wrist")
    assert 60 < len(samples) <= 121
    assert manifest["sensors"]["wrist"]["statistics"]["samples"] == len(samples)
    assert manifest["sensors"]["wrist"]["statistics"]["rate_hz"] == pytest.approx(100)
    np.testing.assert_array_equal(np.diff(samples.device_time_ns), 10_000_000)
    np.testing.assert_allclose(samples.gyr[:, 1], np.radians(20), atol=np.radians(0.011))
    assert [event.event for event in session.events if event.event.startswith("recording")] == [
        "recording_started",
        "recording_completed",
    ]
    assert {event.details["sensor"] for event in session.events if event.event == "connected"} == {
        "wrist"
    }
    assert not list(session.path.glob("*.arrows"))
    result = analyse(session)
    assert list(result.estimate.sensors["wrist"].orientation) == ["vqf_6d"]
    assert result.evaluation.outcome == "not_measured" and not result.evaluation.metrics
    assert "nothing was evaluated: no truth is known of any sensor" in result.evaluation.notes
    assert result.report is not None and result.report.stat().st_size > 10_000


def test_the_command_line_records_and_evaluates_with_exit_0(board: Feeder, tmp_path: Path) -> None:
    shell = CliRunner()
    ran = shell.invoke(
        app,
        [
            "record",
            "--serial",
            f"{board.port}:mpu6050_plain",
            "--duration",
            "0.6",
            "--logs",
            str(tmp_path),
            "--json",
        ],
    )
    assert ran.exit_code == 0, ran.output
    answer = json.loads(ran.stdout)
    assert answer["status"] == "completed" and answer["sensors"]["serial1"]["samples"] > 20
    for stage in ("estimate", "evaluate"):
        done = shell.invoke(app, [stage, answer["session"], "--json"])
        assert done.exit_code == 0, done.output
        json.loads(done.stdout)


@pytest.mark.parametrize(
    ("duration", "code", "status"), [(None, 0, "completed"), ("60", 130, "interrupted")]
)
def test_ctrl_c_is_the_end_of_an_open_recording_and_an_interruption_of_a_timed_one(
    board: Feeder, tmp_path: Path, duration: str | None, code: int, status: str
) -> None:
    timed = ["--duration", duration] if duration else []
    ran = command("--serial", f"{board.port}:mpu6050_plain", "--logs", str(tmp_path), *timed)
    path = wait_for_samples(tmp_path)
    ran.send_signal(signal.SIGINT)
    _, err = ran.communicate(timeout=PATIENCE_S)
    assert ran.returncode == code, err
    session = Session(path)
    assert session.status == status and len(session.imu("serial1")) > 5
    assert session.events[-1].event == f"recording_{status}"
    assert "Traceback" not in err


def test_a_killed_recording_keeps_what_was_on_disk_and_can_be_recovered(
    board: Feeder, tmp_path: Path
) -> None:
    ran = command("--serial", f"{board.port}:mpu6050_plain", "--logs", str(tmp_path))
    path = wait_for_samples(tmp_path)
    with pytest.raises(SessionError, match="still being recorded"):
        recover(Session(path))
    ran.kill()
    ran.communicate(timeout=PATIENCE_S)
    assert Session(path).status is RunStatus.RUNNING
    session = recover(Session(path))
    assert session.status is RunStatus.ABORTED and "recovered" in session.manifest.message
    samples = session.imu("serial1")
    assert len(samples) > 5 and (np.diff(samples.device_time_ns) == 10_000_000).all()
    assert session.events[-1].event == "recording_aborted"
    assert recover(session) is session
    analyse(session, analysis())


class Scripted(Imu):
    """Three samples a read; events and failures as told."""

    rate, has_magnetometer, has_orientation = 10.0, False, True

    def __init__(self, fails_at: int = 10**6, refuses: bool = False, mute: bool = False):
        self.reads, self.fails_at, self.refuses, self.mute = 0, fails_at, refuses, mute
        self.stopped = 0

    def kickoff(self) -> None:
        if self.refuses:
            raise DriverError("the cable is cut")

    def read(self, until_ns: int) -> ImuSamples:
        self.reads += 1
        if self.reads >= self.fails_at:
            raise DriverError("the sensor is on fire")
        count = np.arange(0 if self.mute else 3) + 3 * self.reads
        n = len(count)
        q = np.tile([1.0, 0, 0, 0], (n, 1))
        gyr, acc = np.outer(count, [1e-3, 0, 0]), np.tile([0, 0, 9.81], (n, 1))
        return ImuSamples(count * 10**8, count * 10**8, gyr, acc, None, q, count, np.zeros(n, bool))

    def stop(self) -> None:
        self.stopped += 1

    def describe(self) -> dict[str, Any]:
        return {"driver": "scripted", "rate_hz": self.rate}

    def events(self) -> list[Event]:
        return [Event(self.reads, "hiccup", {"depth": self.reads})]


def make_devices(clock: Any, **imus: Imu) -> Devices:
    return Devices(dict(imus), SessionTime(clock))


def test_events_of_every_device_are_recorded_under_its_name_in_order(
    clock: Any, tmp_path: Path
) -> None:
    session = record_devices(
        make_devices(clock, b=Scripted(), a=Scripted()),
        tmp_path,
        1.0,
        options=RunOptions(clock=clock),
    )
    hiccups = [
        (e.details["sensor"], e.details["depth"]) for e in session.events if e.event == "hiccup"
    ]
    assert hiccups[:4] == [("b", 1), ("a", 1), ("b", 2), ("a", 2)]
    assert all(sensor in {"a", "b"} for sensor, _ in hiccups)


def test_a_device_that_fails_closes_the_session_as_an_error_and_releases_the_others(
    clock: Any, tmp_path: Path
) -> None:
    good, bad = Scripted(), Scripted(fails_at=3)
    with pytest.raises(DriverError, match="on fire"):
        record_devices(
            make_devices(clock, good=good, bad=bad), tmp_path, 60.0, options=RunOptions(clock=clock)
        )
    (path,) = tmp_path.iterdir()
    session = Session(path)
    assert session.status is RunStatus.ERROR and "on fire" in session.manifest.message
    assert len(session.imu("good")) >= 6 and len(session.imu("bad")) == 6
    assert good.stopped and bad.stopped


def test_a_device_that_cannot_be_opened_leaves_nothing_behind(clock: Any, tmp_path: Path) -> None:
    good = Scripted()
    with pytest.raises(DriverError, match="cable"):
        record_devices(
            make_devices(clock, good=good, bad=Scripted(refuses=True)),
            tmp_path,
            options=RunOptions(clock=clock),
        )
    assert not list(tmp_path.iterdir()) and good.stopped


def test_no_sample_at_all_is_an_error_and_some_silence_a_note(clock: Any, tmp_path: Path) -> None:
    with pytest.raises(
        DriverError, match="no device gave a sample; left: no samples; it sent nothing"
    ):
        record_devices(
            make_devices(clock, left=Scripted(mute=True)),
            tmp_path / "a",
            0.5,
            options=RunOptions(clock=clock),
        )
    session = record_devices(
        make_devices(clock, left=Scripted(mute=True), right=Scripted()),
        tmp_path / "b",
        0.5,
        options=RunOptions(clock=clock),
    )
    assert session.manifest.notes == ["left: no samples; it sent nothing"]


def test_ctrl_c_in_the_middle_of_a_timed_recording_raises_after_the_session_is_closed(
    clock: Any, tmp_path: Path
) -> None:
    class Interrupted(Scripted):
        def read(self, until_ns: int) -> ImuSamples:
            if self.reads == 2:
                signal.raise_signal(signal.SIGINT)
            return super().read(until_ns)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(RunInterrupted) as caught:
        record_devices(
            make_devices(clock, a=Interrupted()), tmp_path, 60.0, options=RunOptions(clock=clock)
        )
    assert signal.getsignal(signal.SIGINT) is before
    assert caught.value.exit_code == 130
    assert caught.value.session.status is RunStatus.INTERRUPTED


@pytest.mark.parametrize(
    ("serial", "message"),
    [
        ([], "nothing to record"),
        (["/dev/ttyACM0"], "must be PORT:FORMAT"),
        (["/dev/ttyACM0:"], "must be PORT:FORMAT"),
        (["/dev/ttyACM0:nonsense"], "unknown line format 'nonsense'; known: bno080"),
        (["/dev/ttyACM0:missing.yaml"], r"missing\.yaml: cannot be read"),
        (["a=/dev/ttyACM0:bno080", "a=/dev/ttyACM1:bno080"], "two devices are called 'a'"),
    ],
)
def test_devices_that_make_no_sense_are_refused(serial: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        open_devices(serial, [])


def test_ports_may_hold_colons_and_devices_are_named_by_hand_or_by_number() -> None:
    path = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0"
    devices = open_devices([f"{path}:bno080", f"hand={path}:mpu6050"], [])
    assert list(devices.imus) == ["serial1", "hand"]
    assert [imu.describe()["port"] for imu in devices.imus.values()] == [path, path]


@pytest.mark.parametrize(
    ("name", "duration"), [("no good", 1.0), ("../up", 1.0), ("fine", 0.0), ("fine", -1.0)]
)
def test_a_name_or_a_duration_that_cannot_be_is_refused(
    clock: Any, tmp_path: Path, name: str, duration: float
) -> None:
    with pytest.raises(InputError):
        record_devices(
            make_devices(clock, a=Scripted()), tmp_path, duration, name, RunOptions(clock=clock)
        )
    assert not list(tmp_path.iterdir())


def test_scanning_says_what_it_could_not_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Any:
        raise DriverError("no Bluetooth here")

    monkeypatch.setattr(live_devices, "BluetoothLoop", broken)
    monkeypatch.setattr(live_devices, "list_serial_ports", lambda: [{"port": "/dev/ttyACM0"}])
    assert scan_devices(0) == {
        "serial": [{"port": "/dev/ttyACM0"}],
        "dots": [],
        "notes": ["no Bluetooth here"],
    }
    heard = SimpleNamespace(
        scan=lambda duration: [{"address": "D4:22:CD:00:00:01"}], close=lambda: None
    )
    assert scan_devices(0, heard)["dots"] == [{"address": "D4:22:CD:00:00:01"}]
