"""The plug is pulled, or the disk is full, while files take their names: in recovery, resumption,
and all that is derived.
"""

from __future__ import annotations

import errno
import itertools
import json
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench import estimate, evaluate, execute, plan
from testbench.exceptions import InputError, SessionError, StorageError
from testbench.execution import RunOptions
from testbench.execution.recovery import recover
from testbench.pipeline.analyse import analyse
from testbench.pipeline.exports import export
from testbench.pipeline.request import ExportRequest
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher
from testbench.planning import planner
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import RunStatus, Session
from testbench.reporting.report import report
from tests.asking import analysis, going_on
from tests.conftest import FakeClock
from tests.processes import NO_DISK, bench, small_disk
from tests.system.crashes import comparable, killed_at

# A process that is gone closes no files; here they are closed when they are collected.
pytestmark = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning"
)

OPERATIONS = ("fsync", "rename", "replace", "unlink", "rmdir", "mkdir")


class Cut(BaseException):
    """The process is gone."""


@contextmanager
def cut_before(number: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """From its operation of that number on, the file system hears nothing more of this process;
    yields what was done before.
    """
    done: list[str] = []

    def counting(name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            if len(done) >= number:
                raise Cut
            done.append(name)
            return real(*arguments, **options)

        return call

    with monkeypatch.context() as patched:
        for name in OPERATIONS:
            patched.setattr(os, name, counting(name, getattr(os, name)))
        yield done


def cuts(
    action: Callable[[Path], object],
    start: Path,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    every: int = 1,
) -> Iterator[Path]:
    """Copies of a session in which an action was cut off, one for each of its operations on files,
    or for every so many of them.
    """
    for number in itertools.count(step=every):
        copy = folder / f"cut_{number}" / start.name
        shutil.copytree(start, copy)
        with cut_before(number, monkeypatch):
            try:
                action(copy)
            except Cut:
                cut = True
            else:
                cut = False
        if not cut:
            assert number > 1
            return
        yield copy


def raw(session: Session) -> dict[str, bytes]:
    """Content of every raw file, and of the manifest."""
    return {path.name: path.read_bytes() for path in session.path.iterdir() if path.is_file()}


@pytest.fixture(scope="module")
def cut_off(tiny, tmp_path_factory) -> Path:
    """A session whose run was killed, with its journals."""
    folder, _ = killed_at(tiny, tmp_path_factory.mktemp("cut_off"), 3.0)
    assert list(folder.glob("*.arrows"))
    return folder


def test_a_recovery_that_is_cut_off_anywhere_is_made_good_by_the_next(
    cut_off, tmp_path, monkeypatch
):
    shutil.copytree(cut_off, tmp_path / "run")
    expected = raw(recover(Session(tmp_path / "run")))
    for copy in cuts(lambda path: recover(Session(path)), cut_off, tmp_path, monkeypatch):
        assert raw(recover(Session(copy))) == expected


@pytest.mark.slow
def test_a_resumption_that_is_cut_off_anywhere_is_gone_on_with(
    cut_off, tiny, tmp_path, monkeypatch
):
    the_plan = plan(tiny)

    def again(path: Path) -> Session:
        session = recover(Session(path))
        return execute(
            the_plan, seed=5, options=RunOptions(speed="fast", clock=FakeClock(), resumed=session)
        )

    shutil.copytree(cut_off, tmp_path / "run")
    whole = again(tmp_path / "run")
    for copy in cuts(again, cut_off, tmp_path, monkeypatch, every=6):  # a run each: not all
        session = Session(copy)
        if session.status is not RunStatus.COMPLETED:
            session = run(going_on(copy), Watcher(clock=FakeClock())).session
        for name in ("arm", "imu_hand", "truth_hand"):
            assert (session.path / f"{name}.parquet").read_bytes() == (
                whole.path / f"{name}.parquet"
            ).read_bytes()


@pytest.fixture(scope="module")
def judged(tiny, tmp_path_factory) -> Path:
    """A session with an estimate and an evaluation by one filter, and a report."""
    session = execute(
        plan(tiny), tmp_path_factory.mktemp("judged"), 5, RunOptions(clock=FakeClock())
    )
    made = estimate(session, ["vqf_6d"])
    made.save(session.path)
    evaluate(session, made).save(session.path)
    report(session)
    return session.path


def test_an_estimate_that_is_cut_off_leaves_the_old_one_or_none(judged, tmp_path, monkeypatch):
    session = Session(judged)
    by = {
        "madgwick_imu": estimate(session, ["madgwick_imu"]),
        "vqf_6d": estimate(session, ["vqf_6d"]),
    }
    found = set()
    for copy in cuts(by["madgwick_imu"].save, judged, tmp_path, monkeypatch):
        try:
            loaded = Estimate.load(copy)
        except SessionError:
            found.add("none")
        else:
            (name,) = loaded.filter_parameters
            found.add(name)
            assert list(loaded.sensors["hand"].orientation) == [name]
            np.testing.assert_array_equal(
                loaded.sensors["hand"].orientation[name], by[name].sensors["hand"].orientation[name]
            )
        by["vqf_6d"].save(copy)  # whatever was left lying does no harm
        assert list(Estimate.load(copy).filter_parameters) == ["vqf_6d"]
        assert not list(copy.glob("*.partial"))
    assert found == {"vqf_6d", "none", "madgwick_imu"}


def test_an_evaluation_that_is_cut_off_leaves_the_old_one_or_none(judged, tmp_path, monkeypatch):
    session = Session(judged)
    old, new = (evaluate(session, estimate(session, [name])) for name in ("vqf_6d", "madgwick_imu"))
    assert comparable(old) != comparable(new)
    for copy in cuts(new.save, judged, tmp_path, monkeypatch):
        try:
            loaded = Evaluation.load(copy)
        except SessionError:
            assert not (copy / "evaluation.json").is_file()
            continue
        which = {row.filter for row in loaded.orientation}
        assert which in ({"vqf_6d"}, {"madgwick_imu"})
        assert {f"{name}_total_rad" for name in which} == {
            key for key in loaded.series["orientation_hand"] if "_total_" in key
        }


def test_a_report_that_is_cut_off_leaves_the_old_one(judged, tmp_path, monkeypatch):
    before = (judged / "report.html").read_bytes()
    for copy in cuts(lambda path: report(Session(path)), judged, tmp_path, monkeypatch):
        assert (copy / "report.html").read_bytes() == before


def test_nothing_that_is_derived_is_written_through_a_link(judged, tmp_path):
    session, home = tmp_path / "stranger", tmp_path / "home"
    shutil.copytree(judged, session)
    home.mkdir()
    planted = [
        *("report.html", "report.partial", "evaluation.json", "evaluation.partial"),
        *("manifest.partial", "estimate.partial"),
    ]
    for name in planted:
        (home / name).write_text("precious")
        (session / name).unlink(missing_ok=True)
        (session / name).symlink_to(home / name)
    for name in ("estimate", "evaluation"):
        (home / name).mkdir()
        (home / name / "notes").write_text("precious")
        shutil.rmtree(session / name)
        (session / name).symlink_to(home / name)
    analyse(Session(session), analysis("vqf_6d", report=True))
    assert Evaluation.load(session).orientation and (session / "report.html").stat().st_size > 1000
    for name in planted:
        assert (home / name).read_text() == "precious"
    for name in ("estimate", "evaluation"):
        assert [path.name for path in (home / name).iterdir()] == ["notes"]
        assert not (session / name).is_symlink()


def test_an_export_does_not_follow_a_link_out_of_the_session(judged, tmp_path):
    session = Path(shutil.copytree(judged, tmp_path / "session"))
    home = tmp_path / "home"
    home.mkdir()
    (session / "export").symlink_to(home)
    with pytest.raises(InputError, match="is a symbolic link, and is not written to"):
        export(Session(session), ExportRequest(format="csv"))
    assert not list(home.iterdir())


def test_events_that_are_a_link_are_not_written_to(cut_off, tmp_path):
    shutil.copytree(cut_off, tmp_path / "run")
    (tmp_path / "diary").write_bytes((tmp_path / "run" / "events.jsonl").read_bytes())
    (tmp_path / "run" / "events.jsonl").unlink()
    (tmp_path / "run" / "events.jsonl").symlink_to(tmp_path / "diary")
    before = (tmp_path / "diary").read_bytes()
    with pytest.raises(SessionError, match=r"events\.jsonl is a symbolic link"):
        recover(Session(tmp_path / "run"))
    assert (tmp_path / "diary").read_bytes() == before


@pytest.mark.parametrize("stage", ["estimate", "evaluate", "report"])
def test_a_full_disk_leaves_the_session_and_what_was_derived_before(stage, judged, tmp_path):
    size = sum(file.stat().st_size for file in judged.rglob("*") if file.is_file()) // 1024
    disk = tmp_path / "disk"
    done = bench(
        *(stage, disk / judged.name, "--json"),
        around=partial(small_disk, disk, size + 200, judged),
    )
    if NO_DISK in done.stderr:
        pytest.skip(NO_DISK)
    assert done.returncode == 3, done.stderr
    said = json.loads(done.stderr.splitlines()[-1])
    assert (
        "there is no room left on the disk; the recording is as it was" in said["error"]["message"]
    )
    assert "Traceback" not in done.stderr
    kept = tmp_path / "disk_kept" / judged.name
    for file in (file for file in judged.rglob("*") if file.is_file()):
        assert (kept / file.relative_to(judged)).read_bytes() == file.read_bytes(), file.name
    assert {path.name for path in kept.iterdir()} == {path.name for path in judged.iterdir()}


@pytest.mark.parametrize(
    "command", ["recover {}", "run --no-report --resume {}"], ids=["recover", "resume"]
)
def test_a_full_disk_in_recovery_or_resumption_says_which_session_and_what_to_do(
    command, cut_off, tmp_path
):
    size = sum(file.stat().st_size for file in cut_off.rglob("*") if file.is_file()) // 1024
    session = tmp_path / "disk" / "run"
    done = bench(
        *command.format(session).split(),
        around=partial(small_disk, session.parent, size + 100, cut_off),
    )
    if NO_DISK in done.stderr:
        pytest.skip(NO_DISK)
    assert done.returncode == 3, done.stderr
    assert done.stderr.splitlines()[-1] == (
        f"error: {session} cannot be written: there is no room left on the disk; nothing of the "
        "recording is lost; make room, "
        f"then `testbench recover {session}`"
    )
    kept = tmp_path / "disk_kept" / "run"
    assert not list(kept.glob("*.partial"))
    assert raw(recover(Session(kept))) == raw_of_recovered(cut_off, tmp_path)


def raw_of_recovered(session: Path, folder: Path) -> dict[str, bytes]:
    """What a recovery with room enough makes of a session of the same name."""
    shutil.copytree(session, folder / "roomy" / session.name)
    return raw(recover(Session(folder / "roomy" / session.name)))


@pytest.mark.parametrize("begun", ["by a resumption", "anew"])
def test_a_disk_that_is_full_before_a_run_begins_says_what_to_do(
    begun, cut_off, tiny, tmp_path, monkeypatch
):
    def full(*arguments: Any, **options: Any) -> None:
        raise OSError(
            errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left on device"
        )

    shutil.copytree(cut_off, tmp_path / "run")
    recovered = recover(Session(tmp_path / "run"))
    before = raw(recovered)
    monkeypatch.setattr(
        "testbench.records.disk.journal.Journal.append"
        if begun != "anew"
        else "pathlib.Path.write_text",
        full,
    )
    if begun == "anew":
        with pytest.raises(
            StorageError,
            match=r"new cannot be written: there is no room .*; nothing was recorded; make room",
        ):
            execute(plan(tiny), tmp_path, options=RunOptions(clock=FakeClock(), session_name="new"))
        return
    with pytest.raises(StorageError, match=r"make room, then `testbench run --resume .*run`"):
        execute(
            plan(tiny),
            seed=5,
            options=RunOptions(speed="fast", clock=FakeClock(), resumed=recovered),
        )
    monkeypatch.undo()
    after = raw(Session(tmp_path / "run"))
    assert {name: after[name] for name in before if name != "manifest.json"} == {
        name: content for name, content in before.items() if name != "manifest.json"
    }
    assert (
        run(going_on(tmp_path / "run"), Watcher(clock=FakeClock())).session.status
        is RunStatus.COMPLETED
    )


@contextmanager
def killed_while_it_is_checked() -> Iterator[None]:
    """Planning that comes to the check of the motion, and no farther."""
    planner.check_plan = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
    yield


def test_a_kill_while_it_is_planned_leaves_nothing(tiny, tmp_path):
    run = ("run", tiny, "--logs", tmp_path / "logs", "--no-report")
    assert bench(*run, around=killed_while_it_is_checked).returncode == -signal.SIGKILL
    assert not (tmp_path / "logs").exists()
