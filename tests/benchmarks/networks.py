"""A network that goes bad at every moment of a run, through the makers' client libraries.

Each disturbance x moment is one combination; every third of the trials is a repetition. The
emulated controller is the judge: two seconds after a connection broke no joint moves and no program
plays. The session must be closed, the cause one that the disturbance can have, and the run must go
on from there once the network is good again.
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.clock import SystemClock
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.drivers.session_time import SessionTime
from testbench.emulation.disturbances import AT_ONCE, Disturbance
from testbench.emulation.proxy import Proxy
from testbench.exceptions import ArmRefused, BenchError
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.pipeline.prepared import make_plan
from testbench.pipeline.request import ArmRequest
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, Session, list_sessions
from tests.asking import going_on, run_of
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.emulated_arms import (
    COMMAND_PORT,
    SHORT,
    Emulated,
    emulated_ur,
    emulated_xarm,
    free_address,
)

REPEATS = 3
MOMENTS = ("before", "move", "sweep", "dwell", "close")
REST_S = 2.0
"""The arm must be at rest so long after a connection broke [s]."""
PORTS = {"ur": (29999, 30001, 30002, 30003, 30004), "xarm": (COMMAND_PORT, 30000, 30002)}
REPORTS = {"ur": 30004, "xarm": 30000}
LOST = {"disconnect", "driver"}
LATE = {"report_silence", "slow_response", "tracking_error", "not_reached", "refused"}
ENDED = {"program_stopped", "silence", "connection", "not_ready"}
ALTERED = LOST | LATE | ENDED | {"garbled", "protective_stop", "mode_changed", "controller_error"}
"""Causes that disturbances can have; altered commands can do anything."""


@dataclass(frozen=True)
class Trial:
    """One combination.

    Attributes:
        maker: Of the arm.
        disturbance: Of its network.
        causes: Words that name it truly.
        moment: Of the run.
        breaks: Whether the run must end by it, at once.
    """

    maker: str
    disturbance: Disturbance
    causes: set[str]
    moment: str
    breaks: bool

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.maker} {self.disturbance}"


def _of(maker: str, commands: int) -> Iterator[tuple[Disturbance, set[str], bool]]:
    reports = REPORTS[maker]
    yield Disturbance("reset", None, reports), LOST, True
    yield Disturbance("reset"), LOST, True
    yield Disturbance("half_close", None, reports, "down"), LOST, True
    yield Disturbance("half_close", None, commands, "up"), LOST, True
    yield Disturbance("stall", None, reports, "down"), LATE | LOST, True
    yield Disturbance("stall"), LATE | LOST | ENDED, True
    yield Disturbance("refuse"), LOST | ENDED, True
    yield Disturbance("delay", 0.2), LATE | LOST | ENDED, False
    yield Disturbance("delay", 1.0), LATE | LOST | ENDED, False
    yield Disturbance("jitter", 0.3), LATE | LOST | ENDED, False
    yield Disturbance("corrupt", 0.002), ALTERED, False
    yield Disturbance("reorder", 0.5), ALTERED, False


def all_trials() -> list[Trial]:
    """Every combination once, in an order of which any part is a sample."""
    trials = [
        Trial(maker, disturbance, causes, moment, breaks)
        for moment in MOMENTS
        for maker, commands in (("ur", 30004), ("xarm", COMMAND_PORT))
        for disturbance, causes, breaks in _of(maker, commands)
    ]
    return [trials[k] for k in np.random.default_rng(51).permutation(len(trials))]


@dataclass
class Judge:
    """Strikes at a moment, and looks at the emulated arm afterwards."""

    trial: Trial
    proxy: Proxy
    robot: Emulated
    status: str = ""
    _moved: bool = False
    _thread: threading.Thread | None = field(default=None, repr=False)

    def strike(self) -> None:
        """Now."""
        if self._thread is None:
            own = self.trial.disturbance
            self.proxy.strike(own.fault, own.value, own.port, own.direction)
            self._thread = threading.Thread(target=self._look, daemon=True)
            self._thread.start()

    def heed(self, progress: Any) -> None:
        """Strike when the moment has come."""
        moment, step = self.trial.moment, progress.step
        if moment == "before":
            due = progress.doing.startswith("the arm goes")
        elif moment == "close":
            due = progress.doing.startswith("recording goes on")
        elif progress.doing or self._thread is not None:
            return
        else:
            moving = ", moving" in self.robot.control("status")
            self._moved = self._moved or (moving and step == "out")
            due = {
                "move": step == "out" and moving,
                "sweep": step == "wave" and moving,
                "dwell": step == "out" and self._moved and not moving,
            }[moment]
        if due:
            self.strike()

    def _look(self) -> None:
        time.sleep(REST_S)
        self.status = self.robot.control("status")

    @property
    def struck(self) -> bool:
        """Whether it did; then waits for the look."""
        if self._thread is not None:
            self._thread.join()
        return self._thread is not None


def drive(plan: Plan, address: str, logs: Path, tell: Callable[[Any], None]) -> Session:
    """A run with simulated sensors and the product's own patience."""
    time_ = SessionTime(SystemClock())
    if plan.robot.name == "xarm6":
        arm: Any = XArm(plan.robot, xarm_settings(plan, f"{address}:{COMMAND_PORT}"), time_)
    else:
        arm = UrArm(plan.robot, ur_settings(plan, address), time_)
    return execute_on_arm(plan, arm, Sensors.simulated(plan, 1), RunOptions(logs, 1, progress=tell))


def one(trial: Trial, robot: Emulated, plan: Plan, folder: Path) -> dict[str, Any]:
    """What became of a trial, and what was wrong with it."""
    logs, error, wrong = folder / "logs", None, list[str]()
    with Proxy(free_address(), robot.address, PORTS[trial.maker]) as proxy:
        judge = Judge(trial, proxy, robot)
        if trial.moment == "before" and trial.disturbance.fault not in AT_ONCE:
            judge.strike()
        try:
            drive(plan, proxy.address, logs, judge.heed)
        except BenchError as failure:
            error = failure
        except Exception as failure:
            wrong.append(f"a traceback: {type(failure).__name__}: {failure}")
        struck = judge.struck
        session = next(iter(list_sessions(logs)), None)
        cause, seen = _cause(session)
        wrong += _wrong(trial, error, session, cause, judge.status if struck else None)
        proxy.clear()
        going = session is not None and session.status is RunStatus.ERROR
        if going and not wrong and trial.moment != "before":
            wrong += _resumed(trial, proxy.address, session, folder / "again")
    robot.control("clear")
    robot.wait_until("at rest")
    return {
        "trial": f"{trial.name}, {trial.moment}",
        "maker": trial.maker,
        "ended": "completed" if error is None else str(error).partition("\n")[0],
        "cause": cause,
        "arm": seen,
        "words": _words(session)[-400:] if wrong else "",
        "wrong": wrong,
    }


def _cause(session: Session | None) -> tuple[str, str]:
    events = session.events if session is not None else []
    told = [event.details for event in events if event.event == "arm_fault"]
    return (str(told[0]["fault"]), str(told[0]["arm"])) if told else ("", "")


def _words(session: Session | None) -> str:
    """What the driving process left on stderr."""
    events = session.events if session is not None else []
    return "".join(str(own.details["text"]) for own in events if own.event == "driver_words")


def _wrong(
    trial: Trial,
    error: BenchError | None,
    session: Session | None,
    cause: str,
    status: str | None,
) -> list[str]:
    """What is not as required."""
    wrong = [] if status is not None else ["the moment never came"]
    moving = status is not None and ("at rest" not in status or "PLAYING" in status)
    late = trial.moment == "close" or trial.breaks
    if moving and late and (error is not None or trial.moment == "close"):
        wrong.append(f"{REST_S:g} s later: {status}")
    if error is None:
        if trial.breaks and trial.moment not in {"before", "close"}:
            wrong.append("it was not noticed")
        if session is None or session.status is not RunStatus.COMPLETED:
            wrong.append("no completed session")
        return wrong
    if error.exit_code != 3 and not isinstance(error, ArmRefused):
        wrong.append(f"exit code {error.exit_code}")
    if session is not None:
        if session.status is not RunStatus.ERROR or list(session.path.glob("*.arrows")):
            wrong.append("the session was not closed")
        if cause not in trial.causes:
            wrong.append(f"cause {cause or 'unnamed'}")
    return wrong


def _resumed(trial: Trial, address: str, session: Session, logs: Path) -> list[str]:
    """What keeps the run from going on, now that the network is good."""
    host = address if trial.maker == "ur" else f"{address}:{COMMAND_PORT}"
    arm = ArmRequest(driver=trial.maker, host=host, simulate_imus=True)
    consent = Watcher(consent=Consent(motion=True, hazards_checked=True))
    try:
        result = run(going_on(session.path, arm=arm, seed=1, logs=logs), consent)
    except BenchError as failure:
        return [f"not resumed: {str(failure).splitlines()[0]}"]
    return [] if result.session.status is RunStatus.COMPLETED else ["the resumption is not whole"]


def trials(numbers: range) -> Iterator[dict[str, Any]]:
    """Trials by their numbers; the controllers stay the same."""
    combinations = all_trials()
    with ExitStack() as stack, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robots = {
            "ur": stack.enter_context(emulated_ur()),
            "xarm": stack.enter_context(emulated_xarm()),
        }
        plans = _plans(folder)
        for number in numbers:
            trial = combinations[number % len(combinations)]
            found = one(trial, robots[trial.maker], plans[trial.maker], folder / str(number))
            print(f"{number}: {found['trial']}: {found['cause'] or found['ended']}", flush=True)
            for line in found["wrong"]:
                print(f"    WRONG: {line}", flush=True)
            yield found


def _plans(folder: Path) -> dict[str, Plan]:
    made = {}
    for maker, text in (("ur", SHORT), ("xarm", _for_xarm(SHORT))):
        path = folder / f"{maker}.yaml"
        path.write_text(text, encoding="utf-8")
        made[maker] = make_plan(run_of(path))
    return made


def _for_xarm(text: str) -> str:
    for old, new in (
        ("robot: ur3e", "robot: xarm6"),
        ("link: wrist_3_link", "link: link6"),
        ("wrist_3_joint", "joint6"),
        (", wrist_1_joint: -70", ""),
        ("amplitude_deg: 6", "amplitude_deg: 4"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def bench_networks(count: int = REPEATS * len(all_trials())) -> bool:
    """Print what came of it; whether all was as required."""
    found = resumed("networks", count, trials)
    rows: list[list[str | Text]] = []
    for maker in PORTS:
        own = [each for each in found if each["maker"] == maker]
        wrong = [each for each in own if each["wrong"]]
        kinds = Counter(each["cause"] or "borne" for each in own)
        rows.append(
            [
                Text(maker),
                str(len({each["trial"] for each in own})),
                str(len(own)),
                str(len(own) - len(wrong)),
                Text(", ".join(f"{kind} {times}" for kind, times in kinds.most_common())),
            ]
        )
    columns = ["arm", "combinations", "trials", "as required", "causes"]
    show("A network that goes bad in a run", columns, rows)
    for each in found:
        for line in each["wrong"]:
            print(f"  {each['trial']}: {line} ({each['ended']})")
    return not any(each["wrong"] for each in found)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        sys.exit(not bench_networks(count_of(REPEATS * len(all_trials()), __doc__)))
