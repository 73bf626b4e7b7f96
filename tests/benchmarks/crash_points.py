"""Die at each operation by which a command changes files, and see what the next one makes of it.

A child process counts what Python tells its auditors (PEP 578) of files in the folder that it works
in, and every `fsync`, before which libraries may have written anything; at the n-th it is gone
without flushing. What follows must be whole, or be refused with what to do; nothing may be believed
that is half.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import shutil
import sys
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from testbench import execute, plan
from testbench.cli import main
from testbench.clock import SystemClock
from testbench.execution import RunOptions
from testbench.pipeline.analyse import analyse
from testbench.records.results.evaluation import Evaluation
from tests.asking import analysis
from tests.benchmarks.points import Found, by, failed, tell_failures, walk
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.conftest import TINY, FakeClock
from tests.formats.conftest import turned
from tests.system.crashes import SEED, comparable

COUNT = 2000
"""More than there are."""
DEAD, FAULT = 99, 98
TICK_NS = 50_000_000
"""The clock of commands goes on by so much a reading: what is recorded is synced once a second, and
by the machine's clock more often where it is busy, so that the points were others each time.
"""
RRD_END = b"RRF2FOOT\x01\0\0\0"
"""Last bytes of a recording of the viewer that was closed."""
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate"}
FORMATS = ("csv", "parquet", "mcap", "sto", "mot", "mat", "rrd")
ENDS, DRAWN = 10, 50
"""Of the stages that take long: the first and the last points, and others by chance."""
Words = tuple[object, ...]
Around = Callable[[], AbstractContextManager[object]]
MAPPING = """\
description: a small recording
time: {column: t, unit: s}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
    truth: {columns: [qw, qx, qy, qz], order: wxyz}
estimate: {filters: [vqf_6d], align: motion}
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended, what it said, and how many operations on files it did."""

    code: int
    out: str
    told: str
    operations: int


@dataclass(frozen=True)
class Stage:
    """A command that dies.

    Attributes:
        words: Of it, in the folder that it works in.
        check: What is wrong with what it leaves in a folder; "" where nothing is.
        long: Whether not all of its points are tried.
    """

    words: Words
    check: Callable[[Path], str]
    long: bool = False


def bench_crash_points(count: int = COUNT) -> bool:
    """Print the figures; whether nothing half was believed."""
    found = resumed("crash_points", count, walk(Crashes))
    rows: list[list[str | Text]] = [
        [Text(name), str(own[0]["of"]), str(len(own)), str(failed(own))]
        for name, own in by(found, "stage").items()
    ]
    show("Commands that died at an operation on files", ["", "points", "tried", "failed"], rows)
    return tell_failures(found, "{stage}, point {point} of {of}")


@dataclass
class Crashes:
    """A folder with a protocol, a recording of another program and two sessions, in which commands
    die.

    Args:
        folder: To work in.
        only: Names of the stages that are tried; all if empty.

    Attributes:
        counts: How many points each stage has.
        points: Stages and numbers of operations, in an order by chance, the same every time.
    """

    folder: Path
    only: tuple[str, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)
    points: list[tuple[Any, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.start = start_in(self.folder)
        self.expected: dict[str, str] = {}
        every = self._stages()
        self.stages = {name: every[name] for name in self.only or every}
        random_points = random.Random(0)
        for name, stage in self.stages.items():
            whole = self._copy(f"whole {name}")
            ended = called(whole, *stage.words)
            assert ended.code == 0, f"{name}: {ended.told}"
            self.counts[name] = ended.operations
            self._expect(name, whole)
            own = list(range(1, ended.operations + 1))
            if stage.long and len(own) > 2 * ENDS + DRAWN:
                middle = random_points.sample(own[ENDS:-ENDS], DRAWN)
                own = own[:ENDS] + middle + own[-ENDS:]
            self.points += [(name, point) for point in own]
        random_points.shuffle(self.points)

    def _stages(self) -> dict[str, Stage]:
        run = ("run", "tiny.yaml", "--seed", SEED, "--logs", "logs2", "--no-report")
        brought = ("import", "generic", "d.csv", "--mapping", "map.yaml", "--out", "logs/imported")
        judged = ("--filters", "vqf_6d")
        made = ("calibrate", "logs/session", "--out", "calibration.yaml")
        tuned = ("tune", "logs/session", "--filter", "madgwick_imu", "--parameters", "beta")
        tuned += ("--values", "3", "--no-refinement", "--out", "tuned.json")
        studied = ("study", "misalignment", "--parts", "1", "--logs", "studies")
        stages = {
            "run": Stage(run, self._after_run),
            "import": Stage(brought, self._after_import),
            "estimate": Stage(("estimate", "logs/session", *judged), self._after_estimate),
            "evaluate": Stage(("evaluate", "logs/session", *judged), self._after_estimate),
            "report": Stage(("report", "logs/session", *judged), self._after_estimate),
            "calibrate": Stage(made, lambda folder: self._after_made(folder, made)),
            "tune": Stage(tuned, lambda folder: self._after_made(folder, tuned), long=True),
            "study": Stage(studied, self._after_study, long=True),
        }
        for kind in FORMATS:
            words = ("export", "logs/session", "--to", kind, "--out", place_of(kind), "--force")

            def after(folder: Path, kind: str = kind, words: Words = words) -> str:
                return self._after_export(folder, kind, words)

            stages[f"export {kind}"] = Stage(words, after)
        return stages

    def trial(self, name: str, point: int) -> Found:
        """Let a command die at its n-th operation on files; what is wrong with what follows."""
        folder, stage = self._copy("case"), self.stages[name]
        ended = called(folder, *stage.words, point=point)
        failure = "" if ended.code == DEAD else f"ended by itself with {ended.code}"
        failure = failure or stage.check(folder)
        shutil.rmtree(folder)
        return {"stage": name, "point": point, "of": self.counts[name], "failure": failure}

    def _copy(self, name: str) -> Path:
        return Path(shutil.copytree(self.start, self.folder / name))

    def _expect(self, name: str, whole: Path) -> None:
        """Note what a command that nothing disturbs comes to."""
        if name in {"evaluate", "report"}:
            self.expected[name] = self._judged(whole / "logs" / "session")
        elif name == "import":
            self.expected[name] = self._judgement_of(whole, "logs/imported")[1]
        elif name == "run":
            (session,) = (whole / "logs2").iterdir()
            self.expected[name] = self._judged(session)
        elif name.startswith("export"):
            self.expected[name] = _listing(whole / place_of(name.split()[1]))

    def _judged(self, session: Path) -> str:
        return comparable(Evaluation.load(session))

    def _judgement_of(self, folder: Path, session: str) -> tuple[Ended, str]:
        """What `evaluate` says of a session, and what it comes to; "" where it refuses."""
        ended = called(folder, "evaluate", session)
        whole = ended.code in {0, 1}
        return ended, self._judged(folder / session) if whole else ""

    def _after_run(self, folder: Path) -> str:
        """The run is shown for what it is; what is a session is refused or whole, and gone on
        with; else it is cleared away.
        """
        logs = folder / "logs2"
        listed = _listed(folder, "logs2")
        made = list(logs.iterdir()) if logs.is_dir() else []
        if {path.name for path in made} != set(listed):
            return f"of {made} only {list(listed)} is shown"
        if not made:
            return ""
        (session,) = made
        place = f"logs2/{session.name}"
        if listed[session.name]["status"] == "no session":
            called(folder, "sessions", "--logs", "logs2", "--clean")
            return "what is no session is still there" if any(logs.iterdir()) else ""
        ended, judged = self._judgement_of(folder, place)
        if judged not in {"", self.expected["run"]}:
            return "half a run was believed"
        if not judged and "testbench recover" not in ended.told:
            return f"it was not said what to do: {ended.told}"
        if not judged:
            ended = called(folder, "run", "--resume", place, "--no-report")
            if ended.code:
                return f"it could not be gone on with: {ended.told}"
            judged = self._judged(session)
        return "" if judged == self.expected["run"] else "the resumed run is another"

    def _after_import(self, folder: Path) -> str:
        """There is all of it or nothing, and what is not there is simply imported again."""
        ended, judged = self._judgement_of(folder, "logs/imported")
        if judged not in {"", self.expected["import"]}:
            return "half an import was believed"
        if not judged and "does not exist" not in ended.told:
            return f"it was not said what to do: {ended.told}"
        if not judged:
            ended = called(folder, *self.stages["import"].words)
            if ended.code:
                return f"it could not be imported again: {ended.told}"
            judged = self._judgement_of(folder, "logs/imported")[1]
        if judged != self.expected["import"]:
            return "the second import is another"
        names = {path.name for path in (folder / "logs").iterdir()}
        return "" if names == {"session", "imported"} else f"{names} were left"

    def _after_estimate(self, folder: Path) -> str:
        """Estimate and evaluation that stand there are of one another; the next command makes them
        as if nothing had been there.
        """
        session = folder / "logs" / "session"
        if (session / "evaluation.json").is_file():
            ran = {row.filter for row in Evaluation.load(session).orientation}
            estimated = json.loads((session / "estimate" / "estimate.json").read_text())
            if ran != set(estimated["filter_parameters"]):
                return f"the evaluation of {ran} stands beside another estimate"
        page = session / "report.html"
        if page.is_file() and not page.read_text(encoding="utf-8").rstrip().endswith("</html>"):
            return "the report is half"
        called(folder, "evaluate", "logs/session", "--filters", "vqf_6d")
        if self._judged(session) != self.expected["evaluate"]:
            return "the next evaluation is another"
        left = list(session.rglob(".*.partial"))
        called(folder, "sessions", "--logs", "logs", "--clean")
        still = [path for path in left if path.exists()]
        return f"{still} stay for ever" if still else ""

    def _after_made(self, folder: Path, words: Words) -> str:
        """The file is there as a whole, or is made by the next call."""
        ended = called(folder, *words)
        if ended.code not in {0, 2} or (ended.code == 2 and "exists already" not in ended.told):
            return f"it could not be made again: {ended.told}"
        file = folder / str(words[words.index("--out") + 1])
        whole = self.folder / f"whole {words[0]}" / file.name
        lines = (path.read_text(encoding="utf-8").splitlines() for path in (file, whole))
        one, other = ([line for line in each if "utc" not in line] for each in lines)
        return "" if one == other else "what is there is another"

    def _after_study(self, folder: Path) -> str:
        """Its sessions are shown for what they are; one that is cut off is refused."""
        logs = folder / "studies"
        logs.mkdir(exist_ok=True)
        for name, entry in _listed(folder, "studies").items():
            if entry["status"] == "cut off":
                ended, judged = self._judgement_of(folder, f"studies/{name}")
                if judged or "testbench recover" not in ended.told:
                    return f"half a session was believed, or not said what to do: {ended.told}"
        called(folder, "sessions", "--logs", "studies", "--clean")
        bare = [path.name for path in logs.iterdir() if not any(path.iterdir())]
        return f"{bare} stay for ever" if bare else ""

    def _after_export(self, folder: Path, kind: str, words: Words) -> str:
        """There is nothing or all of it, and the next export makes it."""
        place, name = folder / place_of(kind), f"export {kind}"
        if place.exists() and _listing(place) != self.expected[name]:
            return "half an export has its name"
        ended = called(folder, *words)
        if ended.code:
            return f"it could not be exported again: {ended.told}"
        if _listing(place) != self.expected[name]:
            return "the next export is another"
        left = [path.name for path in folder.iterdir() if path.name.endswith(".partial")]
        return f"{left} stay for ever" if left else ""


def called(folder: Path, *words: object, point: int = 0, around: Around = nullcontext) -> Ended:
    """Run a command in a child process.

    Args:
        folder: To work in.
        words: Of the command.
        point: Operation on files at which it dies, from 1; never if 0.
        around: What it runs inside of.
    """
    said = [folder.parent / name for name in ("stdout", "stderr", "operations")]
    for file in said:
        file.write_text("")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads that the child never has
        child = os.fork()
    if child == 0:
        _run(folder, [str(word) for word in words], said, point, around)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    out, told, operations = (file.read_text(encoding="utf-8") for file in said)
    return Ended(code, out, told, int(operations or 0))


def _run(folder: Path, words: list[str], said: list[Path], point: int, around: Around) -> None:
    """Be the child."""
    code = FAULT
    try:
        files = [os.open(file, os.O_WRONLY | os.O_APPEND) for file in said]
        os.dup2(files[0], 1)
        os.dup2(files[1], 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        ticks = itertools.count(0, TICK_NS)
        steady = patch.object(SystemClock, "monotonic_ns", lambda clock: next(ticks))
        with around(), steady:
            os.chdir(folder)
            sys.argv = ["testbench", *words]
            counter = _Counter(folder, point)
            try:
                main()
                code = 0
            except SystemExit as ended:
                code = int(ended.code or 0)
            counter.on = False
        os.write(files[2], str(counter.count).encode())
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}".encode())
    finally:
        os._exit(code)


class _Counter:
    """Counts operations on files of a folder, and ends the process at one of them."""

    def __init__(self, folder: Path, point: int):
        self.count, self.on = 0, True
        self._folder, self._point = str(folder.resolve()), point
        self._sync = os.fsync
        os.fsync = self._synced
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event == "open":
            path, _, flags = arguments
            if isinstance(flags, int) and flags & WRITES and self._is_ours(path):
                self._one()
        elif event in CHANGES and self._is_ours(arguments[0]):
            self._one()

    def _synced(self, opened: int) -> None:
        self._one()
        self._sync(opened)

    def _is_ours(self, path: Any) -> bool:
        if not isinstance(path, str | bytes | os.PathLike):
            return False
        return str(Path(os.fsdecode(path)).absolute()).startswith(self._folder)

    def _one(self) -> None:
        self.count += 1
        if self.count == self._point:
            os._exit(DEAD)


def start_in(folder: Path) -> Path:
    """A folder with a protocol, a recording of another program, and a session with its report."""
    start = folder / "start"
    start.mkdir()
    (start / "tiny.yaml").write_text(TINY, encoding="utf-8")
    write_recording(start)
    options = RunOptions(clock=FakeClock(), session_name="session")
    session = execute(plan(start / "tiny.yaml"), start / "logs", SEED, options)
    analyse(session, analysis("device", report=True))
    return start


def place_of(kind: str) -> str:
    """File or folder of an export."""
    return {"csv": "exported_csv", "parquet": "exported_parquet"}.get(kind, f"exported.{kind}")


def _listing(place: Path) -> str:
    """Names and sizes: stamps of the time of writing stand in some. Of a recording of the viewer,
    whose chunks are those that its threads came to, whether it has its end.
    """
    files = [place] if place.is_file() else sorted(place.rglob("*"))
    if place.suffix == ".rrd":
        return f"{place.name}: {place.read_bytes()[-len(RRD_END) :] == RRD_END}"
    return " ".join(f"{file.name}:{file.stat().st_size}" for file in files)


def _listed(folder: Path, logs: str) -> dict[str, dict[str, Any]]:
    ended = called(folder, "sessions", "--logs", logs, "--json")
    return {entry["session"]: entry for entry in json.loads(ended.out)["sessions"]}


def write_recording(folder: Path) -> None:
    """Write a short recording of another program, `d.csv`, with a mapping of it, `map.yaml`."""
    m = turned(300)
    columns = np.column_stack([m.t, m.acc, m.gyr, m.q])
    titles = "t,ax,ay,az,wx,wy,wz,qw,qx,qy,qz"
    np.savetxt(folder / "d.csv", columns, "%.7f", ",", header=titles, comments="")
    (folder / "map.yaml").write_text(MAPPING, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(not bench_crash_points(count_of(COUNT, __doc__)))
