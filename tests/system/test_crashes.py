"""Runs that break off: killed, out of disk, interrupted; and what becomes of them."""

from __future__ import annotations

import json
import os
import shutil
import signal
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from testbench import execute, plan
from testbench.cli.app import app
from testbench.exceptions import InputError, RunInterrupted, SessionError
from testbench.execution import RunOptions
from testbench.execution.recovery import recover
from testbench.pipeline.analyse import analyse
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher
from testbench.records.disk.tables import read_parquet
from testbench.records.session.session import RunStatus, Session, list_sessions
from testbench.records.specs.sensor import load_preset
from testbench.records.specs.shipped import shipped_folder
from tests.asking import analysis, going_on
from tests.processes import NO_DISK, bench, small_disk, virtual_time
from tests.system.crashes import comparable, crash, moments, undisturbed

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def whole(tiny, tmp_path_factory):
    """The tiny protocol run without a break, and its evaluation."""
    return undisturbed(tiny, tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize(("speed", "part"), moments(2))
def test_a_kill_at_any_moment_loses_at_most_a_second_and_the_resumed_run_is_the_undisturbed_one(
    tiny, tmp_path, whole, speed, part
):
    outcome = crash(tiny, tmp_path, speed, part, whole)
    assert outcome.opened
    assert outcome.lost <= 1.0
    assert outcome.same_files
    assert outcome.same_evaluation


class Stop(Exception):
    pass


def broken_off(tiny_plan, logs, clock, at_s: float) -> Session:
    """A session whose run ended in an error at some time."""

    def fail(progress) -> None:
        if progress.time > at_s:
            raise Stop

    with pytest.raises(Stop):
        execute(
            tiny_plan,
            logs,
            5,
            RunOptions(speed="realtime", clock=clock, progress=fail, session_name="broken"),
        )
    return Session(logs / "broken")


@pytest.fixture(scope="module")
def tiny_plan(tiny):
    return plan(tiny)


def test_a_run_may_break_off_and_be_resumed_more_than_once(tiny_plan, tmp_path, clock, whole):
    session = broken_off(tiny_plan, tmp_path, clock, 1.0)

    def fail(progress) -> None:
        if progress.time > 3.0:
            raise Stop

    with pytest.raises(Stop):
        run(going_on(session.path), Watcher(clock=clock, progress=fail))
    assert Session(session.path).status is RunStatus.ERROR
    result = run(going_on(session.path), Watcher(clock=clock))
    assert result.session.status is RunStatus.COMPLETED
    assert len(result.session.manifest.resumed) == 2
    assert comparable(result.evaluation) == comparable(whole.evaluation)
    names = [event.event for event in result.session.events]
    assert names.count("run_resumed") == 2 and names[-1] == "run_completed"


def test_a_run_with_a_preset_file_and_a_thermometer_is_resumed(tiny, tmp_path, clock):
    preset = load_preset("xsens_dot").model_dump(mode="json") | {
        "thermometer": {"noise_sd_deg_c": 0.1}
    }
    (tmp_path / "warm.yaml").write_text(yaml.safe_dump(preset), encoding="utf-8")
    text = tiny.read_text(encoding="utf-8").replace("preset: xsens_dot", "preset: warm.yaml")
    (tmp_path / "tiny.yaml").write_text(text, encoding="utf-8")
    warm_plan = plan(tmp_path / "tiny.yaml")
    whole = execute(warm_plan, tmp_path, 5, RunOptions(clock=clock, session_name="whole"))
    session = broken_off(warm_plan, tmp_path, clock, 2.0)
    (tmp_path / "warm.yaml").unlink()  # the session has its own copy
    resumed = run(going_on(session.path), Watcher(clock=clock)).session
    assert resumed.manifest.sensors["hand"].temperature is True
    assert "temperature_deg_c" in resumed.imu_columns("hand")
    for name in ("arm", "imu_hand", "truth_hand"):
        before, after = (
            read_parquet(folder.path / f"{name}.parquet") for folder in (whole, resumed)
        )
        assert list(before) == list(after)
        for column in before:
            np.testing.assert_array_equal(before[column], after[column])


def test_a_journal_that_was_cut_off_before_its_first_row_is_recovered_with_its_columns(
    tiny, tmp_path, clock
):
    warm = tiny.read_text(encoding="utf-8").replace(
        "{clock:", "{thermometer: {noise_sd_deg_c: 0.1}, clock:"
    )
    (tmp_path / "tiny.yaml").write_text(warm, encoding="utf-8")
    session = execute(
        plan(tmp_path / "tiny.yaml"), tmp_path, 5, RunOptions(clock=clock, session_name="cut")
    )
    expected = session.imu_columns("hand")
    (session.path / "imu_hand.parquet").unlink()
    (session.path / "imu_hand.arrows").write_bytes(b"")
    manifest = session.manifest.content | {"status": "running"}
    (session.path / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    recovered = recover(Session(session.path))
    assert recovered.imu_columns("hand") == expected and "temperature_deg_c" in expected
    assert len(recovered.imu("hand")) == 0


def test_an_interrupted_run_is_resumed_without_the_stop_that_the_arm_made(
    tiny_plan, tmp_path, clock, whole
):
    def stop(progress) -> None:
        if progress.time > 2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(RunInterrupted):
        execute(
            tiny_plan,
            tmp_path,
            5,
            RunOptions(speed="realtime", clock=clock, progress=stop, session_name="broken"),
        )
    result = run(going_on(tmp_path / "broken"), Watcher(clock))
    assert comparable(result.evaluation) == comparable(whole.evaluation)


def test_a_pause_lets_virtual_time_stand_still_and_changes_nothing_else(
    tiny_plan, tmp_path, clock, whole
):
    waits: list[int] = []

    def pause(progress) -> None:
        if progress.time > 2 and not waits:
            os.kill(os.getpid(), signal.SIGUSR1)
            waits.append(len(clock.slept))

    honest = clock.sleep

    def sleep(seconds: float) -> None:
        honest(seconds)
        if waits and len(clock.slept) > waits[0] + 40:
            os.kill(os.getpid(), signal.SIGUSR2)

    clock.sleep = sleep
    session = execute(
        tiny_plan, tmp_path, 5, RunOptions(speed="realtime", clock=clock, progress=pause)
    )
    names = [event.event for event in session.events]
    assert "paused" in names and "resumed" in names
    assert comparable(analyse(session, analysis()).evaluation) == comparable(whole.evaluation)


def test_a_completed_run_or_a_recording_is_not_resumed(tiny_plan, tmp_path, clock, quick):
    with pytest.raises(SessionError, match="was completed"):
        run(going_on(quick.session.path))
    with pytest.raises(SessionError, match="does not exist"):
        run(going_on(tmp_path / "nothing"))


@pytest.mark.parametrize("what", ["protocol", "robot", "sensor", "software", "seed of the plan"])
def test_nothing_is_resumed_that_is_no_longer_the_same(tiny_plan, tmp_path, clock, what):
    session = broken_off(tiny_plan, tmp_path, clock, 1.0)
    manifest = json.loads((session.path / "manifest.json").read_text())
    expected = {
        "protocol": r"tiny\.yaml differs:\n.*\n.*\n.*\n-  speed",
        "robot": "robot file differs",
        "sensor": "sensor hand differs",
        "software": "software numpy: 1.0 before",
        "seed of the plan": "plan made from the same files is another",
    }[what]
    protocol = None
    if what == "protocol":
        text = (session.path / "protocol.yaml").read_text()
        protocol = tmp_path / "tiny.yaml"
        protocol.write_text(text + "arm: {speed_slider_percent: 50}\n")
        expected = r"tiny\.yaml differs"
    elif what == "robot":
        file = session.path / "robot.yaml"
        file.write_text(file.read_text().replace("margin_mm: 5", "margin_mm: 4"))
    elif what == "sensor":
        manifest["sensors"]["hand"]["rate_hz"] = 100.0
    elif what == "software":
        manifest["software"]["numpy"] = "1.0"
    else:
        manifest["plan"]["hash"] = "0" * 64
    (session.path / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=expected):
        run(going_on(session.path, protocol=protocol))
    assert Session(session.path).status is RunStatus.ERROR


def test_a_package_that_computed_no_raw_file_decides_nothing(tiny_plan, tmp_path, clock):
    session = broken_off(tiny_plan, tmp_path, clock, 1.0)
    manifest = json.loads((session.path / "manifest.json").read_text())
    assert "imufusion" not in manifest["software"]
    manifest["software"] |= {"vqf": "1.0", "pyarrow": "1.0", "imufusion": "1.3.3"}
    (session.path / "manifest.json").write_text(json.dumps(manifest))
    resumed = run(going_on(session.path), Watcher(clock))
    assert resumed.session.status is RunStatus.COMPLETED


def test_an_arm_of_ones_own_under_the_name_of_a_shipped_one_is_resumed_with_its_own_file(
    tiny, tmp_path, clock
):
    own = tmp_path / "own"
    shutil.copytree(shipped_folder("robots") / "ur3e", own)
    file = own / "robot.yaml"
    file.write_text(file.read_text().replace("record_hz: 125", "record_hz: 250"))
    session = broken_off(plan(tiny, own), tmp_path, clock, 1.0)
    file.write_text(file.read_text().replace("record_hz: 250", "record_hz: 500"))
    with pytest.raises(
        InputError, match=r"robot file differs:\n(.*\n)*-  record_hz: 250\n\+  record_hz: 500"
    ):
        run(going_on(session.path))
    file.write_text(file.read_text().replace("record_hz: 500", "record_hz: 250"))
    assert run(going_on(session.path), Watcher(clock)).session.status is RunStatus.COMPLETED


@contextmanager
def on_virtual_time_and_a_small_disk(folder, size_kb):
    with virtual_time(), small_disk(folder, size_kb):
        yield


@pytest.mark.parametrize("size_kb", [250, 320, 400])
def test_a_full_disk_stops_the_run_and_what_was_recorded_is_readable(tiny, tmp_path, size_kb):
    disk = tmp_path / "disk"
    done = bench(
        *("run", tiny, "--logs", disk, "--no-report", "--json", "--speed", "realtime"),
        around=partial(on_virtual_time_and_a_small_disk, disk, size_kb),
    )
    if NO_DISK in done.stderr:
        pytest.skip(NO_DISK)
    assert done.returncode == 3, done.stderr
    assert "there is no room left on the disk" in done.stderr
    assert "Traceback" not in done.stderr
    (session,) = list_sessions(tmp_path / "disk_kept")
    recovered = recover(session)
    times = read_parquet(recovered.path / "arm.parquet")["host_time_ns"]
    assert len(times) > 50 and (np.diff(times) == 8_000_000).all()
    assert len(recovered.imu("hand")) > 0


def test_sessions_are_listed_with_what_became_of_them(tiny_plan, tmp_path, clock):
    broken_off(tiny_plan, tmp_path, clock, 1.0)
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "manifest.json").write_text("{")
    done = bench("sessions", "--logs", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    listed = {entry["session"]: entry for entry in json.loads(done.stdout)["sessions"]}
    assert listed["broken"]["status"] == "error" and listed["broken"]["damage"] is None
    assert listed["damaged"]["status"] == "damaged"
    assert "manifest.json cannot be read" in listed["damaged"]["damage"]


@pytest.mark.parametrize("content", ["{", "[]", '{"outcome": ["pass"]}', '{"outcome": "splendid"}'])
def test_sessions_are_listed_though_one_has_a_broken_evaluation(
    tiny_plan, tmp_path, clock, content
):
    broken_off(tiny_plan, tmp_path, clock, 1.0)
    shutil.copytree(tmp_path / "broken", tmp_path / "sound")
    (tmp_path / "broken" / "evaluation.json").write_text(content)
    done = CliRunner().invoke(app, ["sessions", "--logs", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert (
        "broken is damaged: " in done.output
        and "evaluation.json" in done.output
        and "sound" in done.output
    )


def test_a_broken_off_run_is_resumed_on_the_command_line(tiny_plan, tmp_path, clock):
    session = broken_off(tiny_plan, tmp_path, clock, 2.0)
    command = ("run", "--resume", session.path, "--no-report", "--json")
    done = bench(*command, around=virtual_time)
    assert done.returncode == 0, done.stderr
    assert Session(session.path).status is RunStatus.COMPLETED
    again = bench(*command, around=virtual_time)
    assert again.returncode == 2
    assert "was completed" in again.stderr


def test_a_session_whose_manifest_is_damaged_says_so(tmp_path, quick):
    copy = tmp_path / "copy"
    shutil.copytree(quick.session.path, copy)
    (copy / "manifest.json").write_text("[1, 2]")
    with pytest.raises(SessionError):
        Session(copy)
