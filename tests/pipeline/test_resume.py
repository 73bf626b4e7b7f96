"""A run that broke off goes on as it was asked for, and a person is asked last."""

from __future__ import annotations

import json
import os
import shlex
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench.cli.options import analysis_request
from testbench.cli.running import resume_line
from testbench.drivers.arms.catalogue import ARMS
from testbench.exceptions import DriverError, InputError, RunInterrupted, SessionError
from testbench.pipeline.request import AnalysisRequest, ArmRequest, Request, RunRequest
from testbench.pipeline.run import prepare, run
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.disk.tables import read_parquet
from testbench.records.session.session import Session
from tests.asking import analysis, going_on, run_of
from tests.conftest import FakeClock
from tests.drivers.trial_arm import ENTRY, TWIN

OTHER = analysis("mahony_imu", parameters={"mahony_imu": {"kp": 0.7}})


def broken_off(protocol: Path, logs: Path, how: AnalysisRequest, **asked_for: Any) -> Session:
    """A session that was stopped after a second."""

    def stop(progress: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    asked = Request(
        run=RunRequest(protocol=protocol, logs=logs, speed="realtime", **asked_for), analysis=how
    )
    with pytest.raises(RunInterrupted) as caught:
        run(asked, Watcher(FakeClock(), progress=stop))
    assert isinstance(caught.value.session, Session)
    return caught.value.session


def change(session: Session, edit: Callable[[dict[str, Any]], None]) -> None:
    """Edit the manifest of a session."""
    file = session.path / "manifest.json"
    content = read_json(file)
    edit(content)
    write_json(file, content)


def test_a_run_that_goes_on_is_analysed_as_it_was_to_be_when_it_began(tiny, tmp_path):
    session = broken_off(tiny, tmp_path, OTHER)
    result = run(going_on(session.path), Watcher(FakeClock()))
    assert set(result.estimate.filter_parameters) == {"mahony_imu"}
    assert result.estimate.filter_parameters["mahony_imu"]["kp"] == 0.7
    assert result.report is None


def test_any_arm_in_virtual_time_completes_its_session_as_it_began(tiny, tmp_path, monkeypatch):
    """The catalogue says which arms these are, and not their names."""
    monkeypatch.setitem(ARMS, TWIN.name, TWIN)
    twin = ArmRequest(driver="twin")
    session = broken_off(tiny, tmp_path / "twin", OTHER, arm=twin, seed=5)
    with pytest.raises(InputError, match="was run by --arm twin; say that and its options again"):
        prepare(going_on(session.path))
    going = going_on(session.path, arm=twin)
    with pytest.raises(InputError, match="--seed needs a new run"):
        prepare(going_on(session.path, arm=twin, seed=6))
    line = f"testbench run --resume {session.path} --arm twin --no-report"
    assert resume_line(going, session.path) == line
    done = run(going, Watcher(FakeClock())).session
    assert (done.path, done.manifest.arm.driver, done.manifest.seed) == (session.path, "twin", 5)
    simulated = run(run_of(tiny, seed=5, logs=tmp_path / "sim"), Watcher(FakeClock())).session
    for name in ("arm.parquet", "imu_hand.parquet"):
        assert read_parquet(done.path / name).keys() == read_parquet(simulated.path / name).keys()
        for column, values in read_parquet(simulated.path / name).items():
            np.testing.assert_array_equal(read_parquet(done.path / name)[column], values, column)


def test_another_analysis_that_is_named_when_going_on_holds_alone_from_then_on(tiny, tmp_path):
    session = broken_off(tiny, tmp_path, OTHER)
    asked = Request(run=RunRequest(resume=session.path), analysis=analysis("vqf_6d", report=True))
    assert prepare(asked).analysis.asked == analysis("vqf_6d")
    result = run(asked, Watcher(FakeClock()))
    assert set(result.estimate.filter_parameters) == {"vqf_6d"}
    kept = Session(session.path).manifest.analysis_request
    assert kept == {"filters": ["vqf_6d"], "report": False}


def test_files_are_kept_by_their_whole_paths_and_a_damaged_entry_is_refused(
    tiny, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(
        "from testbench.estimation.filters.madgwick import MadgwickImu\n"
        "class Own(MadgwickImu):\n    name = 'own'\n",
        encoding="utf-8",
    )
    session = broken_off(tiny, tmp_path / "logs", analysis("own.py:Own"))
    monkeypatch.chdir("/")
    assert Session(session.path).manifest.analysis_request["filters"] == [f"{tmp_path}/own.py:Own"]
    again = Request(
        run=RunRequest(resume=session.path), analysis=analysis(f"{tmp_path}/own.py:Own")
    )
    assert prepare(again).analysis.asked.filters == (f"{tmp_path}/own.py:Own",)
    change(session, lambda content: content["analysis_request"].update(filters=7))
    with pytest.raises(SessionError, match="the analysis_request is damaged: filters: must be"):
        prepare(going_on(session.path))


@pytest.mark.parametrize(
    "kept",
    [
        {"filters": ["{}/evil.py:Evil"]},
        {"compare": "{}/evil.py:Evil"},
        {"exports": [{"format": "csv", "out": "{}/home", "force": True}]},
        {"exports": [{"format": "mcap", "filter": "{}/evil.py:Evil"}]},
    ],
)
def test_a_session_of_a_stranger_runs_no_code_and_writes_nowhere_else(tiny, tmp_path, kept):
    evil, home = tmp_path / "evil.py", tmp_path / "home"
    evil.write_text(f"from pathlib import Path\nPath({str(tmp_path / 'ran')!r}).touch()\n")
    session = broken_off(tiny, tmp_path / "logs", OTHER)
    named = json.loads(json.dumps(kept).replace("{}", str(tmp_path)))
    change(session, lambda content: content.update(analysis_request=named))
    with pytest.raises(SessionError, match="outside of the session; name it again"):
        run(going_on(session.path), Watcher(FakeClock()))
    assert not home.exists() and not (tmp_path / "ran").exists()


def test_the_line_that_goes_on_names_the_analysis_too():
    typed = ("vqf_6d,madgwick_imu", ["madgwick_imu.beta=0.1"], Path("my cal"), [Path("t.json")])
    asked = Request(run=RunRequest(protocol="quick"), analysis=analysis_request(*typed, False))
    line = resume_line(asked, Path("logs/s"))
    assert line == (
        "testbench run --resume logs/s --filters vqf_6d,madgwick_imu --set madgwick_imu.beta=0.1 "
        "--calibration 'my cal' --tuned t.json --no-report"
    )
    again = asked.model_copy(update={"run": RunRequest(protocol="p.yaml", resume="logs/s")})
    assert shlex.split(resume_line(again, Path("logs/s")))[3:5] == ["logs/s", "p.yaml"]


def test_a_person_is_asked_only_once_the_sensors_are_known_to_be_those_that_began(
    tiny, tmp_path, monkeypatch
):
    monkeypatch.setitem(ARMS, ENTRY.name, ENTRY)
    arm = ArmRequest(driver="trial", host="dark", simulate_imus=True)
    allowed = Consent(motion=True, hazards_checked=True)
    with pytest.raises(DriverError, match="it is dark") as caught:
        run(run_of(tiny, arm=arm, logs=tmp_path), Watcher(FakeClock(), consent=allowed))
    session = caught.value.session
    change(session, lambda content: content["sensors"]["hand"].update(description="another"))
    questions: list[str] = []
    asking = Consent(motion=True, ask=lambda sentence: bool(questions.append(sentence)))
    monkeypatch.setattr("testbench.pipeline.resume.refuse_differences", lambda *_: None)
    with pytest.raises(InputError, match="sensor hand differs"):
        run(going_on(session.path, arm=arm), Watcher(FakeClock(), consent=asking))
    assert not questions
