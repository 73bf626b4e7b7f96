"""A recorded session: the files that are promised, what they say, and that the same seed writes the
same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from testbench import execute, plan
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.exceptions import DriverError, NotFoundError, RunInterrupted, SessionError
from testbench.execution import RunOptions, truth
from testbench.execution.recovery import recover
from testbench.execution.run_progress import Progress
from testbench.model.joint_motion import Smoothing
from testbench.records.disk.journal import journal_batches
from testbench.records.disk.tables import read_parquet
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.asking import planned
from tests.system.crashes import SEED, killed_at

RAW = ["arm.parquet", "imu_hand.parquet", "truth_hand.parquet", "plan.parquet"]


@pytest.fixture(scope="module")
def tiny_plan(tiny):
    return plan(tiny)


def test_a_session_holds_the_files_that_are_promised(quick):
    found = {path.name for path in quick.session.path.iterdir()}
    assert found == {
        "manifest.json",
        "protocol.yaml",
        "robot.yaml",
        "robot.urdf",
        "plan.parquet",
        "arm.parquet",
        "events.jsonl",
        "imu_arm.parquet",
        "imu_forearm.parquet",
        "truth_arm.parquet",
        "truth_forearm.parquet",
        "estimate",
        "evaluation",
        "evaluation.json",
    }


def test_the_manifest_says_how_it_went_with_what_and_from_which_files(quick):
    manifest = json.loads((quick.session.path / "manifest.json").read_text())
    assert manifest["schema_version"] == 1
    assert manifest["status"] == "completed"
    assert manifest["seed"] == 1
    assert manifest["started_utc"] == "2026-01-02T03:04:05+00:00"
    assert manifest["plan"]["hash"] == planned("quick").hash
    assert set(manifest["sensors"]) == {"arm", "forearm"}
    assert {"numpy", "pin", "vqf", "imu-testbench"} <= set(manifest["software"])
    assert manifest["duration_s"] == pytest.approx(planned("quick").duration + 1, abs=0.02)
    for name, digest in manifest["files"].items():
        assert hashlib.sha256((quick.session.path / name).read_bytes()).hexdigest() == digest, name
    assert {"arm.parquet", "imu_arm.parquet", "truth_arm.parquet", "events.jsonl"} <= set(
        manifest["files"]
    )


def test_protocol_and_robot_are_kept_verbatim(quick):
    session, the_plan = quick.session, planned("quick")
    assert (
        session.path / "protocol.yaml"
    ).read_bytes() == the_plan.protocol.document.file.read_bytes()
    assert (session.path / "robot.urdf").read_bytes() == the_plan.robot.urdf.read_bytes()
    assert (session.path / "robot.yaml").read_text() == the_plan.robot.text


def test_foreign_readers_find_the_documented_columns_types_and_notes(quick):
    imu = pd.read_parquet(quick.session.path / "imu_arm.parquet")
    assert list(imu.columns) == [
        "device_time_ns",
        "host_time_ns",
        "counter",
        "gyr_x_rad_s",
        "gyr_y_rad_s",
        "gyr_z_rad_s",
        "acc_x_m_s2",
        "acc_y_m_s2",
        "acc_z_m_s2",
        "mag_x_uT",
        "mag_y_uT",
        "mag_z_uT",
        "device_q_w",
        "device_q_x",
        "device_q_y",
        "device_q_z",
        "saturated",
    ]
    assert imu["device_time_ns"].dtype == imu["host_time_ns"].dtype == np.int64
    assert not imu.isna().any().any()
    truth = pd.read_parquet(quick.session.path / "truth_arm.parquet")
    assert list(truth.columns[:5]) == [
        "host_time_ns",
        *(f"q_world_from_sensor_{part}" for part in "wxyz"),
    ]
    np.testing.assert_allclose(np.linalg.norm(truth.iloc[:, 1:5], axis=1), 1, atol=1e-12)
    notes = pq.read_schema(quick.session.path / "imu_arm.parquet").metadata
    assert b"sensor frame" in notes[b"content"] and b"q_earth_from_sensor" in notes[b"device_q"]
    arm = pd.read_parquet(quick.session.path / "arm.parquet")
    assert "q_measured_wrist_3_joint_rad" in arm and "v_measured_elbow_joint_rad_s" in arm


def test_the_truth_is_made_of_measured_angles_and_is_not_the_plan(quick):
    arm = quick.session.arm()
    assert np.abs(arm.q_sent - arm.q_measured).max() > 1e-3  # the servo lags
    truth = quick.session.truth("forearm")
    step = next(step for step in quick.session.steps if step.kind == "sweep")
    moving = (truth.host_time_ns > step.start_ns) & (truth.host_time_ns < step.settled_ns)
    measured = np.interp(truth.host_time_ns[moving], arm.host_time_ns, arm.v_measured[:, 5])
    np.testing.assert_allclose(
        np.linalg.norm(truth.rate[moving], axis=1), np.abs(measured), atol=2e-3
    )


def test_the_same_seed_writes_the_same_bytes_and_another_one_other_noise(
    tiny_plan, tmp_path, clock
):
    first, again, other = (
        execute(tiny_plan, tmp_path, seed, RunOptions(clock=clock)) for seed in (5, 5, 6)
    )
    for name in RAW:
        assert (first.path / name).read_bytes() == (again.path / name).read_bytes(), name
    assert (first.path / "events.jsonl").read_bytes() == (again.path / "events.jsonl").read_bytes()
    assert not np.array_equal(first.imu("hand").acc[:100], other.imu("hand").acc[:100])
    assert not np.array_equal(first.arm().q_measured, other.arm().q_measured)
    assert (first.path / "plan.parquet").read_bytes() == (other.path / "plan.parquet").read_bytes()


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_a_run_in_real_time_writes_the_bytes_of_a_fast_one_and_keeps_its_rhythm(
    tiny_plan, tmp_path, clock, seed
):
    fast = execute(tiny_plan, tmp_path, seed, RunOptions(clock=clock))
    assert clock.slept == []
    started = clock.now_ns
    slow = execute(tiny_plan, tmp_path, seed, RunOptions(speed="realtime", clock=clock))
    for name in RAW:
        assert (fast.path / name).read_bytes() == (slow.path / name).read_bytes(), name
    assert (clock.now_ns - started) / 1e9 == pytest.approx(tiny_plan.duration + 1, abs=0.1)
    assert max(clock.slept) <= 0.1 + 1e-9


def test_steps_start_settle_and_end_in_order_and_the_run_frames_them(quick):
    events = quick.session.events
    assert events[0].event == "run_started" and events[-1].event == "run_completed"
    times = [event.host_time_ns for event in events]
    assert times == sorted(times)
    in_order = [(e.details["index"], e.event) for e in events if e.event.startswith("step_")]
    kinds = ("step_started", "step_settled", "step_ended")
    assert in_order == [(i, kind) for i in range(len(planned("quick").steps)) for kind in kinds]


def test_the_steps_read_back_are_the_steps_planned(quick):
    for found, wanted in zip(quick.session.steps, planned("quick").steps, strict=True):
        for key in (
            "index",
            "section",
            "role",
            "name",
            "kind",
            "variables",
            "start_ns",
            "settled_ns",
            "end_ns",
        ):
            assert getattr(found, key) == getattr(wanted, key)


def test_a_second_run_in_the_same_second_gets_a_folder_of_its_own(tiny_plan, tmp_path, clock):
    names = [execute(tiny_plan, tmp_path, options=RunOptions(clock=clock)).name for _ in range(3)]
    assert names == ["20260102T030405Z_tiny", "20260102T030405Z_tiny_2", "20260102T030405Z_tiny_3"]
    assert [session.name for session in list_sessions(tmp_path)] == names


def test_progress_counts_up_to_the_end(tiny_plan, tmp_path, clock):
    seen: list[Progress] = []
    execute(
        tiny_plan, tmp_path, options=RunOptions(speed="realtime", clock=clock, progress=seen.append)
    )
    assert [p.time for p in seen] == sorted(p.time for p in seen)
    assert seen[-1].time == pytest.approx(seen[-1].duration)
    assert {p.step for p in seen} == {step.name for step in tiny_plan.steps}


def test_a_sensor_that_fails_is_a_bench_error_and_the_session_keeps_what_was_recorded(
    tiny_plan, tmp_path, clock, monkeypatch
):
    honest = SimulatedImu.read

    def failing(self, until_ns):
        if until_ns > 2_500_000_000:
            raise DriverError("sensor hand: the connection was lost")
        return honest(self, until_ns)

    monkeypatch.setattr(SimulatedImu, "read", failing)
    with pytest.raises(DriverError, match="connection was lost"):
        execute(tiny_plan, tmp_path, options=RunOptions(speed="realtime", clock=clock))
    (session,) = list_sessions(tmp_path)
    assert session.status is RunStatus.ERROR
    assert "connection was lost" in session.manifest.message
    assert session.events[-1].event == "run_error"
    assert session.imu("hand").host_time_ns[-1] > 2_300_000_000
    assert not list(session.path.glob("*.arrows")) and not list(session.path.glob("*.partial"))


def test_a_bug_in_a_driver_closes_the_session_too(tiny_plan, tmp_path, clock, monkeypatch):
    def broken(self, until_ns):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(SimulatedImu, "read", broken)
    with pytest.raises(ZeroDivisionError):
        execute(tiny_plan, tmp_path, options=RunOptions(clock=clock))
    (session,) = list_sessions(tmp_path)
    assert session.status is RunStatus.ERROR


def test_the_operators_stop_keeps_the_recording_up_to_rest(tiny_plan, tmp_path, clock):
    def stop_at_half(progress: Progress) -> None:
        if progress.time > 2:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)  # a shell's background job ignores it
    with pytest.raises(RunInterrupted, match="interrupted by the operator") as caught:
        execute(
            tiny_plan,
            tmp_path,
            options=RunOptions(speed="realtime", clock=clock, progress=stop_at_half),
        )
    session = caught.value.session
    assert caught.value.exit_code == 130
    whole = f"{len(session.steps)} of {len(tiny_plan.steps)} steps are whole"
    assert str(caught.value).endswith(f"what was recorded is kept in {session.path}: {whole}")
    assert session.status is RunStatus.INTERRUPTED
    assert session.events[-1].event == "run_interrupted"
    arm = session.arm()
    assert 2.9 < arm.host_time_ns[-1] / 1e9 < 3.3
    assert np.abs(arm.v_measured[-5:]).max() < np.radians(0.5)
    assert len(session.truth("hand").host_time_ns) == len(arm.host_time_ns)
    assert signal.getsignal(signal.SIGINT) is before  # and Ctrl-C is itself again


def test_joint_accelerations_are_the_derivative_of_the_rates():
    t = np.arange(0, 4, 0.008)
    rate = np.sin(2 * np.pi * 0.5 * t)[:, None]
    zero = np.zeros_like(rate)
    samples = ArmSamples(["j"], (t * 1e9).astype(np.int64), zero, zero, rate)
    expected = 2 * np.pi * 0.5 * np.cos(2 * np.pi * 0.5 * t)
    assert (
        np.abs(
            Smoothing.of(samples.host_time_ns).acceleration(samples.v_measured)[:, 0] - expected
        ).max()
        < 0.01 * np.pi
    )


@pytest.mark.parametrize("count", [0, 1, 4, 5, 6, 13])
def test_the_truth_of_a_few_samples_is_no_error(count):
    t = np.arange(count)
    zero = np.zeros((count, 2))
    assert Smoothing.of(t * 8_000_000).acceleration(zero).shape == (count, 2)


def test_a_folder_that_is_no_session_is_refused_in_a_sentence(tmp_path, quick):
    with pytest.raises(SessionError, match="does not exist"):
        Session(tmp_path / "nowhere")
    with pytest.raises(SessionError, match=r"no manifest\.json"):
        Session(tmp_path)
    with pytest.raises(NotFoundError, match="known: arm, forearm"):
        quick.session.imu("leg")


def test_a_session_of_a_newer_schema_is_refused(tmp_path):
    (tmp_path / "manifest.json").write_text('{"schema_version": 99}')
    with pytest.raises(SessionError, match="schema 99"):
        Session(tmp_path)


@pytest.fixture(scope="module")
def killed(tmp_path_factory, tiny_plan):
    """The folder of a run in real time that was killed after 1.6 s, and how far it had come [s]."""
    protocol = tiny_plan.protocol.document.file
    return killed_at(protocol, tmp_path_factory.mktemp("killed"), 1.6)


def test_a_killed_run_leaves_all_but_its_last_second_in_readable_journals(killed):
    folder, reached = killed
    assert reached > 1.4
    for name in ("arm", "imu_hand"):
        _, batches = journal_batches(folder / f"{name}.arrows")
        last = max(batch["host_time_ns"].to_numpy()[-1] for batch in batches) / 1e9
        assert last > reached - 1
    assert Session(folder).status is RunStatus.RUNNING


def test_reading_a_killed_run_says_how_to_recover_it(killed):
    session = Session(killed[0])
    with pytest.raises(SessionError, match="recover"):
        session.imu("hand")


def test_a_recovered_run_equals_the_beginning_of_an_undisturbed_one(
    killed, tiny_plan, tmp_path, clock
):
    shutil.copytree(killed[0], tmp_path / "killed")
    session = recover(Session(tmp_path / "killed"))
    assert session.status is RunStatus.ABORTED
    assert "recovered" in session.manifest.message
    assert not list(session.path.glob("*.arrows"))
    whole = execute(tiny_plan, tmp_path, SEED, RunOptions(clock=clock))
    for found, expected in ((session.imu("hand"), whole.imu("hand")), (session.arm(), whole.arm())):
        n = len(found.host_time_ns)
        assert 0 < n < len(expected.host_time_ns)
        for key, column in found.to_columns().items():
            np.testing.assert_array_equal(column, expected.to_columns()[key][:n])
    assert session.truth("hand") is not None
    assert recover(session).manifest == session.manifest  # a second time changes nothing


def test_the_truth_of_a_long_run_is_the_same_in_pieces(quick, tmp_path, monkeypatch):
    session, folder = quick.session, tmp_path
    shutil.copy(session.path / "arm.parquet", folder)
    monkeypatch.setattr(truth, "BLOCK", 500)
    truth.write_truth(folder, session.robot, session.analysis.sensors)
    for name in session.sensor_names:
        pieces, whole = (
            read_parquet(folder / f"truth_{name}.parquet"),
            read_parquet(session.path / f"truth_{name}.parquet"),
        )
        assert list(pieces) == list(whole)
        for column, values in whole.items():
            np.testing.assert_allclose(pieces[column], values, rtol=0, atol=1e-9, err_msg=column)
