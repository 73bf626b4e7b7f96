"""Requests: records that compare by content, go through JSON unchanged and hold nothing alive."""

from __future__ import annotations

import pickle
import weakref
from math import pi
from pathlib import Path

import pytest
from pydantic import ValidationError

from testbench.emulation.request import EmulationRequest
from testbench.exceptions import ArmRefused, FileProblems, InputError, NotFoundError
from testbench.pipeline import run as running
from testbench.pipeline.analyse import analyse
from testbench.pipeline.design import design
from testbench.pipeline.request import (
    AnalysisRequest,
    ArmRequest,
    DesignRequest,
    ExportRequest,
    Request,
    RunRequest,
    StudyRequest,
)
from testbench.pipeline.run import prepare, run
from testbench.pipeline.watcher import Consent, Watcher
from testbench.planning.experiment_design import Wanted
from testbench.studies import wanted_studies
from testbench.studies.bench import StudyBench
from tests.asking import analysis, run_of
from tests.conftest import FakeClock


def whole() -> Request:
    """With something in every corner."""
    return Request(
        run=RunRequest(
            protocol=Path("protocols/quick.yaml"),
            arm=ArmRequest(driver="replay", log=Path("log.csv"), serial=("a=b:c",)),
            seed=3,
        ),
        analysis=AnalysisRequest(
            filters=("vqf_6d", "mine.py:Mine"),
            parameters={"vqf_6d": {"tau_acc_s": 2.5, "rest_bias": 0}},
            tunings=(Path("a.json"),),
            exports=(ExportRequest(format="csv"),),
        ),
    )


def test_a_request_goes_through_json_and_to_another_process_unchanged():
    others = (
        StudyRequest(name="gimvebo", protocol=Path("own.yaml"), seed=2, parts=3),
        DesignRequest(out=Path("best.yaml"), robot="gimvebo", joints=("x", "y"), dwell_s=2.5),
        EmulationRequest(arm="ur", at_deg=(0.0, -90.0), own={"local_control": True}),
    )
    for asked in (Request(), whole(), *others):
        for again in (
            type(asked).model_validate_json(asked.model_dump_json()),
            pickle.loads(pickle.dumps(asked)),
        ):
            assert again == asked and hash(again) == hash(asked) and again.key == asked.key


def test_what_is_the_same_has_one_key_and_what_differs_another():
    asked = whole()
    changed = AnalysisRequest(
        **{**dict(asked.analysis), "parameters": {"vqf_6d": {"rest_bias": 0, "tau_acc_s": 2.5}}}
    )
    assert changed == asked.analysis and changed.key == asked.analysis.key
    keys = {
        run_of("quick").key,
        run_of("quick", seed=1).key,
        run_of("quick", report=True).key,
        run_of("elbow_flexion").key,
        whole().key,
    }
    assert len(keys) == 5
    assert run_of("quick").key == run_of(Path("quick")).key


def test_what_a_study_runs_is_told_by_its_request():
    reproduced = [study.name for study in wanted_studies(StudyRequest())]
    assert reproduced == [f"reference-{i}" for i in range(1, 6)]
    assert [study.name for study in wanted_studies(StudyRequest(name="gimvebo"))] == ["gimvebo"]
    with pytest.raises(NotFoundError, match="unknown study 'bode'"):
        wanted_studies(StudyRequest(name="bode"))
    with pytest.raises(InputError, match="takes neither --protocol nor --session"):
        wanted_studies(StudyRequest(protocol="quick"))
    asked = StudyRequest(name="gimvebo", seed=4, parts=2, logs="kept", protocol="own.yaml")
    bench = StudyBench.of(asked, FakeClock())
    assert (bench.logs, list(bench.seeds), bench.protocol) == (Path("kept"), [4, 5], "own.yaml")


def test_a_design_is_asked_for_in_degrees_and_made_in_radians(monkeypatch):
    given = []
    monkeypatch.setattr(
        "testbench.pipeline.design.design_protocol", lambda *words: given.append(words)
    )
    asked = DesignRequest(
        out="best.yaml", robot="ur3e", link="tool0", poses=8, turns=3, turn_deg=180, criterion="A"
    )
    design(asked)
    ((out, robot, like, sensor, wanted, link),) = given
    assert (out, robot, like, sensor, link) == (
        Path("best.yaml"),
        "ur3e",
        "calibration_3d",
        None,
        "tool0",
    )
    assert wanted == Wanted(8, 3, None, "A", 5.0, pi)


def test_an_unknown_key_of_a_request_is_refused():
    with pytest.raises(ValidationError, match="confirmed"):
        ArmRequest(confirmed=True)


def test_everything_a_request_names_is_refused_before_anything_moves(tiny, tmp_path):
    logs = tmp_path / "logs"
    malformed = tmp_path / "tuned.json"
    malformed.write_text("{}", encoding="utf-8")
    for asked, kind, words in (
        (analysis(calibrations=tmp_path / "gone"), InputError, "no such calibration"),
        (analysis(tunings=(malformed,)), FileProblems, "tuned.json"),
        (analysis("kalman"), NotFoundError, "unknown filter 'kalman'"),
        (analysis(parameters={"vqf_6d": {"tau": 1}}), NotFoundError, "known: tau_acc_s"),
        (analysis(exports=(ExportRequest(format="xlsx"),)), NotFoundError, "export format 'xlsx'"),
        (
            analysis("vqf_6d", exports=(ExportRequest(format="sto", filter="vqf_9d"),)),
            NotFoundError,
            "unknown filter 'vqf_9d'; known: truth, vqf_6d",
        ),
        (analysis("vqf_9d", parameters={"gyro": {}}), InputError, "not among those to run"),
    ):
        with pytest.raises(kind, match=words):
            run(Request(run=RunRequest(protocol=tiny, logs=logs), analysis=asked))
    with pytest.raises(InputError, match="name a protocol"):
        run(Request(run=RunRequest(logs=logs)))
    assert not logs.exists()


def test_a_request_alone_moves_no_arm(tiny, tmp_path):
    """Consent is no part of it: a request may be kept, and carried out again when nobody looks."""
    arm = ArmRequest(driver="ur", host="127.99.99.99", simulate_imus=True)
    asked = run_of(tiny, arm=arm, logs=tmp_path / "logs")
    seen = []
    with pytest.raises(ArmRefused, match="this was a dry run"):
        run(asked, Watcher(motion=seen.append))
    with pytest.raises(ArmRefused, match="hazards must be confirmed"):
        run(asked, Watcher(motion=seen.append, consent=Consent(motion=True)))
    assert [prepared.plan.protocol.spec.name for prepared in seen] == ["tiny", "tiny"]
    assert not (tmp_path / "logs").exists()


def test_a_plan_made_once_serves_runs_that_differ_in_seed_and_report(tiny, tmp_path, clock):
    prepared = prepare(run_of(tiny))
    seen = []
    results = [
        run(
            run_of(tiny, seed=seed, report=seed == 1, logs=tmp_path),
            Watcher(clock, seen.append),
            prepared,
        )
        for seed in (0, 1)
    ]
    assert [result.report is not None for result in results] == [False, True]
    assert [result.session.manifest.seed for result in results] == [0, 1]
    assert all(found.plan is prepared.plan for found in seen)


def test_the_plan_of_a_run_is_let_go_of_before_its_recording_is_analysed(
    tiny, tmp_path, clock, monkeypatch
):
    """That of eight hours is as large as what an analysis keeps of a sensor."""
    plans, held = [], []

    def analysed(*asked, **how):
        held.append(plans[0]() is not None)
        return analyse(*asked, **how)

    monkeypatch.setattr(running, "analyse", analysed)
    watcher = Watcher(clock, lambda prepared: plans.append(weakref.ref(prepared.plan.trajectory)))
    run(run_of(tiny, logs=tmp_path), watcher)
    assert held == [False]


def test_an_analysis_writes_the_exports_that_it_names(tiny, tmp_path, clock):
    wanted = ExportRequest(format="csv", out=tmp_path / "tables", filter="vqf_6d")
    asked = Request(
        run=RunRequest(protocol=tiny, logs=tmp_path / "logs"), analysis=analysis(exports=(wanted,))
    )
    (exported,) = run(asked, Watcher(clock)).exports
    assert exported.path == tmp_path / "tables" and exported.filters == ["vqf_6d"]
    assert (tmp_path / "tables" / "imu_hand.csv").is_file()
