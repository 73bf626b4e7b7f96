"""Requests on recordings without a truth: compared, tuned, refused and exported."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from testbench.estimation import estimate
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.pipeline.analyse import analyse, judge_again
from testbench.pipeline.exports import export
from testbench.pipeline.kept_estimate import load_or_estimate
from testbench.pipeline.request import AnalysisRequest, ExportRequest, TuneRequest
from testbench.pipeline.tune import tune
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from tests import without_truth as made
from tests.asking import analysis


@pytest.fixture(scope="module")
def dots(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return made.two_dots(tmp_path_factory.mktemp("dots"))


@pytest.fixture(scope="module")
def imu(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return made.one_imu(tmp_path_factory.mktemp("imu"))


@pytest.mark.parametrize("act", [analyse, judge_again, load_or_estimate])
def test_filters_that_cannot_run_leave_a_good_estimate_where_it_is(dots, act):
    analyse(dots, analysis())
    before = Estimate.load(dots.path)
    with pytest.raises(InputError, match=r"vqf_6d: the sensor gives no gyr \(thigh, shank\)"):
        act(dots, analysis("vqf_6d", "vqf_9d"))
    after = Estimate.load(dots.path)
    assert set(after.sensors["thigh"].orientation) == {"device"}
    assert after.filter_parameters == before.filter_parameters
    assert Evaluation.load(dots.path).angle_ranges


def test_an_empty_estimate_that_is_kept_is_refused_as_well(dots, tmp_path):
    copied = Session(shutil.copytree(dots.path, tmp_path / "empty"))
    asked = analysis("vqf_6d")
    estimate(copied, ["vqf_6d"]).save(copied.path)
    with pytest.raises(InputError, match="vqf_6d cannot run"):
        load_or_estimate(copied, asked)


def test_one_filter_that_runs_is_enough(dots):
    result = analyse(dots, analysis("device", "vqf_6d"))
    assert set(result.estimate.sensors["shank"].orientation) == {"device"}


def test_the_filter_that_is_compared_with_is_run_where_it_was_not(imu):
    found = judge_again(imu, AnalysisRequest(filters=("vqf_6d",), compare="device"))
    assert [(row.first, row.second) for row in found.comparison] == [("vqf_6d", "device")]
    again = judge_again(imu, AnalysisRequest(compare="fusion"))
    assert {row.second for row in again.comparison} == {"fusion"}


def test_nothing_to_compare_with_is_refused(tmp_path):
    session = made.accelerometer_alone(tmp_path)
    with pytest.raises(InputError, match="device cannot run"):
        judge_again(session, AnalysisRequest(compare="device"))
    with pytest.raises(NotFoundError):
        judge_again(session, AnalysisRequest(compare="devise"))


def test_a_tuning_to_the_device_says_that_it_is_no_truth(imu, tmp_path):
    file = tmp_path / "near.json"
    asked = TuneRequest(
        sessions=(imu.path,),
        filter="madgwick_imu",
        out=file,
        compare="device",
        tuned=("beta",),
        values=3,
        refinement=False,
    )
    found = tune(asked)
    assert (found.comparison, found.objective) == ("device", "total_difference_rms_deg")
    assert found.value <= found.default_value
    assert json.loads(file.read_text())["comparison"] == "device"
    judged = judge_again(imu, AnalysisRequest(tunings=(str(file),)))
    assert judged.tuned[0].comparison == "device"
    assert any("near device, which is a comparison and no truth" in note for note in judged.notes)


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"objective": "total_rmse_deg"}, NotFoundError, "objective of a comparison"),
        ({"compare": "madgwick_imu"}, InputError, "near itself"),
        ({"compare": None}, SessionError, "truth is not known"),
        ({"compare": None, "objective": "total_difference_rms_deg"}, NotFoundError, "objective"),
    ],
)
def test_a_tuning_that_makes_no_sense_is_refused(imu, tmp_path, changed, error, words):
    own = {"compare": "device", "tuned": ("beta",), "values": 3, "refinement": False} | changed
    out = tmp_path / "t.json"
    with pytest.raises(error, match=words):
        tune(TuneRequest(sessions=(imu.path,), filter="madgwick_imu", out=out, **own))
    assert not out.exists()


def test_an_export_of_an_empty_estimate_carries_the_devices_orientation(dots, tmp_path):
    copied = Session(shutil.copytree(dots.path, tmp_path / "empty"))
    estimate(copied, ["vqf_6d"]).save(copied.path)
    out = tmp_path / "tables"
    written = export(copied, ExportRequest(format="parquet", out=out))
    assert written.filters == ["device"]
    table = pq.read_table(Path(written.path) / "imu_shank.parquet")
    w = table["device_q_world_from_sensor_w"].to_numpy()
    assert np.isfinite(w).all()


def test_an_export_without_any_orientation_says_so_or_is_refused(tmp_path):
    session = made.accelerometer_alone(tmp_path)
    tables = export(session, ExportRequest(format="csv", out=tmp_path / "tables"))
    assert tables.filters == []
    assert "no orientation is in it, for no filter could run" in tables.notes
    with pytest.raises(InputError, match="no filter ran"):
        export(session, ExportRequest(format="sto", out=tmp_path / "a.sto"))
