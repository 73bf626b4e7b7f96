"""What a power cut leaves: only what was forced onto the disk, in the order in which it was."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.execution.run_progress import Progress
from testbench.records.disk.journal import journal_batches
from testbench.records.disk.replacing import replaced_file, replaced_folder
from testbench.records.session.session import Session


class Disk:
    """A disk that keeps of each file what it had when it was last synced."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.safe: dict[str, int] = {}
        self.syncs: Counter[str] = Counter()
        self.log: list[tuple[str, str]] = []
        self._fsync, self._replace, self._rename = os.fsync, os.replace, os.rename
        monkeypatch.setattr(os, "fsync", self._sync)
        monkeypatch.setattr(os, "replace", self._replaced)
        monkeypatch.setattr(os, "rename", self._renamed)

    def _sync(self, opened: int) -> None:
        self._fsync(opened)
        name = str(Path(f"/proc/self/fd/{opened}").readlink())
        self.safe[name] = os.stat(opened).st_size
        self.syncs[Path(name).name] += 1
        self.log.append(("sync", name))

    def _replaced(self, source, target, **options) -> None:
        self.log.append(("name", str(source)))
        self._replace(source, target, **options)

    def _renamed(self, source, target, **options) -> None:
        self.log.append(("name", str(source)))
        self._rename(source, target, **options)


@pytest.fixture
def disk(monkeypatch) -> Disk:
    return Disk(monkeypatch)


def test_a_run_has_all_but_its_last_second_on_the_disk(tiny, tmp_path, clock, disk):
    left: dict[str, bytes] = {}
    at: list[float] = []

    def cut(progress: Progress) -> None:
        if progress.time < 4 or left:
            return
        at.append(progress.time)
        (folder,) = (tmp_path / "logs").iterdir()
        for file in [*folder.glob("*.arrows"), folder / "events.jsonl"]:
            left[file.name] = file.read_bytes()[: disk.safe.get(str(file), 0)]

    options = RunOptions(tmp_path / "logs", speed="realtime", clock=clock, progress=cut)
    session = execute(plan(tiny), options=options)
    assert set(left) == {"arm.arrows", "imu_hand.arrows", "events.jsonl"}
    for name in ("arm.arrows", "imu_hand.arrows"):
        file = tmp_path / name
        file.write_bytes(left[name])
        times = [batch.column("host_time_ns").to_numpy() for batch in journal_batches(file)[1]]
        assert times and times[-1][-1] / 1e9 > at[0] - 1.3, name
    assert b'"step_settled"' in left["events.jsonl"]
    # once a second and at the end, neither more seldom nor with every piece
    seconds = session.manifest.duration_s
    for name in left:
        assert seconds - 2 <= disk.syncs[name] <= seconds + 4, name
    assert disk.safe[str(session.path / "events.jsonl")] == left_of(session, "events.jsonl")


def left_of(session: Session, name: str) -> int:
    return (session.path / name).stat().st_size


def test_a_file_is_on_the_disk_before_it_takes_its_name_and_then_the_name_is(tmp_path, disk):
    with replaced_file(tmp_path / "out") as partial:
        partial.write_text("whole")
        written = str(partial)
    assert disk.log == [("sync", written), ("name", written), ("sync", str(tmp_path))]
    assert disk.safe[written] == len("whole")


def test_the_files_of_a_folder_are_on_the_disk_before_it_takes_its_place(tmp_path, disk):
    (tmp_path / "out").mkdir()
    summary = tmp_path / "summary.json"
    summary.write_text("old")
    with replaced_folder(tmp_path / "out", summary) as new:
        for name in ("a.parquet", "summary.json"):
            (new / name).write_text("new")
        files = {str(new / name) for name in ("a.parquet", "summary.json")}
        folder = str(new)
        assert summary.read_text() == "old"
    named = disk.log.index(("name", folder))
    before = {name for kind, name in disk.log[:named] if kind == "sync"}
    assert before >= files | {folder}
    assert disk.log[-1] == ("sync", str(tmp_path))
    assert summary.read_text() == "new"


def test_an_old_summary_never_stands_beside_new_tables(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    summary = tmp_path / "summary.json"
    summary.write_text("old")
    real = Path.rename

    def seen(self: Path, target: Path) -> Path:
        assert not summary.exists()
        return real(self, target)

    monkeypatch.setattr(Path, "rename", seen)
    with replaced_folder(tmp_path / "out", summary) as new:
        (new / "summary.json").write_text("new")
    assert summary.read_text() == "new"
