"""What is derived from a session is written by one process at a time, and read whole."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import threading
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from testbench import estimate, evaluate
from testbench.estimation.filters import get_filter
from testbench.exceptions import SessionError
from testbench.pipeline.analyse import analyse, judge_again
from testbench.records.results import estimate as estimate_record
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session import session_lock as lock_module
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_lock, session_locked
from testbench.reporting.report import report
from tests.asking import analysis
from tests.house import ROOT
from tests.patience import PATIENCE_S
from tests.processes import FORKS, forked

ASK = """\
import sys
from pathlib import Path
import testbench.records.session.session_lock as lock

lock.TELL_S = 0
with lock.session_lock(Path(sys.argv[1]), 0.2):
    pass
"""


def hold(session: Path, tell: Connection) -> None:
    """Tell that a session is held, and hold it."""
    with session_lock(session):
        tell.send("held")
        signal.pause()


def take(session: Path, tell: Connection) -> None:
    """Take a session at once, and tell what came of it."""
    try:
        with session_lock(session, 0):
            tell.send("taken")
    except SessionError as error:
        tell.send(str(error))


@pytest.fixture(scope="module")
def made(quick):
    """Two estimates of one session by one filter: with other parameters, and with those of the
    protocol.
    """
    other = estimate(quick.session, [get_filter("madgwick_imu", {"beta": 2.0})])
    return {"other": other, "own": estimate(quick.session, ["madgwick_imu"])}


@pytest.fixture
def session(quick, tmp_path) -> Session:
    shutil.copytree(quick.session.path, tmp_path / "session")
    return Session(tmp_path / "session")


@pytest.fixture
def holder(tmp_path):
    """A living process that works on `tmp_path / "session"`."""
    (tmp_path / "session").mkdir(exist_ok=True)
    told, tell = FORKS.Pipe(duplex=False)
    process = forked(hold, tmp_path / "session", tell)
    tell.close()
    assert told.recv() == "held"
    yield process
    process.kill()
    process.join()


def orientations(made: Estimate) -> dict[str, np.ndarray]:
    return {name: own.orientation["madgwick_imu"] for name, own in made.sensors.items()}


def waits_for_the_first(monkeypatch) -> threading.Event:
    """Set once somebody finds a session taken and begins to wait for it."""
    waiting = threading.Event()
    monkeypatch.setattr(lock_module, "TELL_S", 0.0)
    monkeypatch.setattr(lock_module, "_tell", lambda *_: waiting.set())
    return waiting


@pytest.mark.parametrize("held_after", [1, 2, 3])
def test_two_estimates_that_are_saved_at_once_never_mix(held_after, made, session, monkeypatch):
    real, count = estimate_record.write_parquet, 0
    in_the_midst, go_on = threading.Event(), threading.Event()

    def slow(*arguments):
        nonlocal count
        real(*arguments)
        if threading.current_thread().name == "other":
            count += 1
            if count == held_after:
                in_the_midst.set()
                assert go_on.wait(60)

    monkeypatch.setattr(estimate_record, "write_parquet", slow)
    waiting = waits_for_the_first(monkeypatch)
    threads = [
        threading.Thread(target=saved.save, args=[session.path], name=name)
        for name, saved in made.items()
    ]
    threads[0].start()
    assert in_the_midst.wait(60)
    threads[1].start()
    assert waiting.wait(60)
    go_on.set()
    for thread in threads:
        thread.join()
    loaded = Estimate.load(session.path)
    (which,) = [
        name
        for name, one in made.items()
        if one.filter_parameters["madgwick_imu"] == loaded.filter_parameters["madgwick_imu"]
    ]
    assert which == "own", "the later one waited, and then replaced the earlier one"
    for name, q in orientations(made[which]).items():
        np.testing.assert_array_equal(orientations(loaded)[name], q)


def test_estimate_evaluation_and_report_are_of_one_another(session, monkeypatch):
    """One that works on a session is slow in evaluating; the other, with another filter, comes
    after it with all that it writes.
    """
    evaluating, go_on = threading.Event(), threading.Event()

    def slow(*arguments):
        if threading.current_thread().name == "first":
            evaluating.set()
            assert go_on.wait(60)
        return evaluate(*arguments)

    monkeypatch.setattr("testbench.pipeline.analyse.evaluate", slow)
    report(session)
    waiting = waits_for_the_first(monkeypatch)
    threads = [
        threading.Thread(target=judge_again, args=[session, analysis(name)], name=thread)
        for thread, name in (("first", "vqf_6d"), ("second", "madgwick_imu"))
    ]
    threads[0].start()
    assert evaluating.wait(60)
    threads[1].start()
    assert waiting.wait(60)
    assert "madgwick_imu" not in (session.path / "estimate" / "estimate.json").read_text()
    go_on.set()
    for thread in threads:
        thread.join()
    assert list(Estimate.load(session.path).filter_parameters) == ["madgwick_imu"]
    assert {row.filter for row in Evaluation.load(session.path).orientation} == {"madgwick_imu"}
    assert "vqf_6d" not in (session.path / "report.html").read_text().split("</script>")[-1]


def test_who_has_a_session_may_take_it_again_and_another_process_may_not(session):
    told, tell = FORKS.Pipe(duplex=False)
    with session_lock(session.path), session_lock(session.path):
        forked(take, session.path, tell).join(60)
    assert told.poll() and "is being worked on by another process" in told.recv()


def test_the_later_process_is_refused_once_it_has_waited(session, holder, monkeypatch):
    monkeypatch.setattr(lock_module, "WAIT_S", 0.2)
    before = {path: path.stat().st_mtime_ns for path in session.path.rglob("*")}
    for stage in (analyse, judge_again, report):
        with pytest.raises(SessionError, match=r"session is being worked on by another process"):
            stage(session)
    assert {path: path.stat().st_mtime_ns for path in session.path.rglob("*")} == before


def test_whoever_waits_is_told_once_for_which_process(tmp_path, holder, monkeypatch, caplog):
    monkeypatch.setattr(lock_module, "TELL_S", 0.0)
    with (
        pytest.raises(SessionError, match=rf"by another process, {holder.pid} \(python"),
        session_lock(tmp_path / "session", 0.2),
    ):
        pass
    (told,) = caplog.messages
    assert told.startswith(
        f"waiting for {tmp_path / 'session'}, which another process, {holder.pid} (python"
    )
    assert len(told) < 300 and "\n" not in told


def test_whoever_waits_for_a_thread_is_told_so(session, monkeypatch, caplog):
    monkeypatch.setattr(lock_module, "TELL_S", 0.0)
    refused: list[str] = []

    def other() -> None:
        try:
            with session_lock(session.path, 0.1):
                pass
        except SessionError as error:
            refused.append(str(error))

    with session_lock(session.path):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert "is being worked on by another thread of this process" in refused[0]
    assert len(caplog.messages) == 1


def test_a_wait_is_told_on_stderr_where_nobody_has_set_up_another_way(tmp_path, holder):
    command = [sys.executable, "-c", ASK, str(tmp_path / "session")]
    told = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S
    ).stderr
    assert told.startswith(f"waiting for {tmp_path / 'session'}, which another process, ")


def test_the_later_process_waits_for_the_earlier_one(tmp_path, holder, monkeypatch):
    monkeypatch.setattr(lock_module, "TELL_S", 0.0)
    monkeypatch.setattr(lock_module, "_tell", lambda *_: holder.kill())  # once it waits
    with session_lock(tmp_path / "session", 60):
        holder.join(60)
        assert holder.exitcode == -signal.SIGKILL


def test_a_killed_process_keeps_nobody_away(tmp_path, holder):
    holder.kill()
    holder.join()
    with session_lock(tmp_path / "session", 0):
        pass
    assert not list((tmp_path / "session").iterdir())


def test_a_session_is_free_after_a_failure(session):
    @session_locked
    def failing(session: Session) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        failing(session)
    free = threading.Event()

    def other() -> None:
        with session_lock(session.path, 0):
            free.set()

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert free.is_set()


def test_a_session_on_a_file_system_without_locks_is_worked_on(session, monkeypatch):
    def none(*arguments) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(lock_module.fcntl, "flock", none)
    with session_lock(session.path):
        pass


def test_locks_leave_no_open_file(tmp_path):
    def opened() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    before = opened()
    with session_lock(tmp_path), session_lock(tmp_path):
        assert opened() == before + 2
    assert opened() == before
    assert not list(tmp_path.iterdir())
