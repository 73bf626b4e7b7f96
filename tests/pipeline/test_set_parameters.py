"""Parameters of filters that a person sets for one analysis: `--set filter.parameter=value`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation import estimate
from testbench.estimation.filters import get_filter
from testbench.exceptions import BenchError, InputError, NotFoundError
from testbench.pipeline.kept_estimate import load_or_estimate
from testbench.pipeline.request import TuneRequest
from testbench.pipeline.tune import tune
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from tests.asking import analysis


def command(*arguments: object) -> str:
    """What a command says that must end well."""
    result = CliRunner().invoke(app, [str(word) for word in arguments], catch_exceptions=False)
    assert result.exit_code in (0, 1), result.output
    return result.output


@pytest.fixture(scope="module")
def shaken(run_protocol, altered_protocol) -> Session:
    """A short session whose protocol gives its filter a parameter."""

    def change(content):
        content["estimate"] = {
            "filters": ["madgwick_imu", "vqf_6d"],
            "filter_parameters": {"madgwick_imu": {"beta": 0.2}},
        }
        content["accept"] = []

    return run_protocol(altered_protocol("quick", change)).session


@pytest.fixture
def session(shaken: Session, tmp_path: Path) -> Session:
    return Session(shutil.copytree(shaken.path, tmp_path / shaken.name))


@pytest.fixture(scope="module")
def tuned(shaken: Session, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tuning of the filter: beta is tuned, zeta and the gate stay at their defaults."""
    file = tmp_path_factory.mktemp("tuned") / "tuned.json"
    tune(
        TuneRequest(
            sessions=(shaken.path,),
            filter="madgwick_imu",
            out=file,
            tuned=("beta",),
            values=3,
            refinement=False,
        )
    )
    return file


def test_what_is_set_holds_before_tuned_before_the_protocols_before_the_defaults(session, tuned):
    best = json.loads(tuned.read_text())["parameters"]["beta"]
    for options, beta, zeta in (
        ([], 0.2, 0.0),
        (["--set", "madgwick_imu.zeta=0.01"], 0.2, 0.01),
        (["--tuned", tuned], best, 0.0),
        (["--tuned", tuned, "--set", "madgwick_imu.zeta=0.01"], best, 0.01),
        (["--tuned", tuned, "--set", "madgwick_imu.beta=0.12"], 0.12, 0.0),
    ):
        command("estimate", session.path, *options)
        found = Estimate.load(session.path)
        assert found.filter_parameters["madgwick_imu"] == {
            "beta": beta,
            "zeta": zeta,
            "acc_gate_m_s2": 0.0,
        }
        assert ("madgwick_imu" in found.tuned) == ("--tuned" in options and beta == best)
        assert found.set_parameters == (
            {"madgwick_imu": [options[-1].split(".")[1].split("=")[0]]}
            if "--set" in options
            else {}
        )


def test_a_filter_runs_with_what_is_set_and_the_report_says_so(session):
    said = command("report", session.path, "--set", "vqf_6d.tau_acc_s=1.5")
    expected = estimate(session, [get_filter("vqf_6d", {"tau_acc_s": 1.5})])
    stored = Estimate.load(session.path)
    for name, sensor in expected.sensors.items():
        np.testing.assert_array_equal(
            stored.sensors[name].orientation["vqf_6d"], sensor.orientation["vqf_6d"]
        )
    html = (session.path / "report.html").read_text(encoding="utf-8")
    assert "tau_acc_s set for this estimate" in html
    note = "vqf_6d ran with tau_acc_s 1.5, set for this estimate"
    assert note in html and f"note: {note}" in said
    assert note in Evaluation.load(session.path).notes


def test_a_run_is_analysed_with_what_is_set(tiny, tmp_path):
    command("run", tiny, "--logs", tmp_path, "--no-report", "--set", "vqf_6d.tau_acc_s=1.5")
    (session,) = tmp_path.iterdir()
    assert Estimate.load(session).filter_parameters["vqf_6d"]["tau_acc_s"] == 1.5


def test_a_filter_that_is_set_runs_beside_the_protocols(session):
    command("evaluate", session.path, "--set", "mahony_imu.kp=1", "--set", "mahony_imu.ki=0.01")
    stored = Estimate.load(session.path)
    assert list(stored.filter_parameters) == ["madgwick_imu", "vqf_6d", "mahony_imu"]
    assert stored.filter_parameters["mahony_imu"]["ki"] == 0.01
    assert stored.set_parameters == {"mahony_imu": ["kp", "ki"]}


@pytest.mark.parametrize("verb", ["estimate", "evaluate", "report", "export", "run"])
@pytest.mark.parametrize(
    ("given", "kind", "words"),
    [
        (
            "madgwick_imu.betta=0.1",
            NotFoundError,
            "unknown parameter of the filter madgwick_imu 'betta'; known: beta, zeta",
        ),
        ("madgwik.beta=0.1", NotFoundError, "unknown filter 'madgwik'; known: device, gyro"),
        ("madgwick_imu.beta=-1", InputError, "beta is -1 rad/s; it must be at least 0"),
        ("madgwick_imu.beta=nan", InputError, "beta is nan; it must be a finite number"),
        ("vqf_6d.rest_bias=2", InputError, "rest_bias is 2; a switch is 0"),
        ("madgwick_imu.beta=strong", InputError, "'strong' is no number"),
        ("beta=0.1", InputError, "write it as FILTER.PARAMETER=VALUE"),
        ("madgwick_imu.beta", InputError, "write it as FILTER.PARAMETER=VALUE"),
    ],
)
def test_what_cannot_be_set_is_refused_in_the_words_of_a_protocol(
    shaken, tiny, tmp_path, verb, given, kind, words
):
    options = {
        "run": [tiny, "--logs", tmp_path / "logs"],
        "export": [shaken.path, "--to", "csv", "--out", tmp_path / "out"],
    }.get(verb, [shaken.path])
    before = sorted((shaken.path / "estimate").iterdir())
    result = CliRunner().invoke(app, [verb, *map(str, options), "--set", given])
    assert type(result.exception) is kind and result.exception.exit_code == 2
    assert words in str(result.exception)
    assert not list(tmp_path.iterdir())
    assert sorted((shaken.path / "estimate").iterdir()) == before


def test_a_parameter_is_set_once_and_of_a_filter_that_runs(session):
    for options, words in (
        (["--set", "gyro.a=1", "--set", "gyro.a=2"], "gives gyro.a twice"),
        (
            ["--filters", "vqf_6d", "--set", "madgwick_imu.beta=1"],
            "parameters are set of the filter madgwick_imu, which is not among those to run",
        ),
    ):
        with pytest.raises(BenchError, match=words):
            command("evaluate", session.path, *options)


def test_a_stored_estimate_is_not_taken_for_one_with_other_parameters(session):
    def beta(**asked) -> float:
        found = load_or_estimate(session, analysis("madgwick_imu", **asked))
        assert Estimate.load(session.path).filter_parameters == found.filter_parameters
        return found.filter_parameters["madgwick_imu"]["beta"]

    def written() -> int:
        return (session.path / "estimate" / "estimate.json").stat().st_mtime_ns

    set_to = {"parameters": {"madgwick_imu": {"beta": 0.12}}}
    assert beta(**set_to) == 0.12
    first = written()
    assert beta(**set_to) == 0.12 and written() == first  # the same is not computed twice
    assert load_or_estimate(session).set_parameters and written() == first  # any will do
    assert beta(parameters={"madgwick_imu": {"beta": 0.13}}) == 0.13
    assert beta() == 0.2
    assert load_or_estimate(session, analysis("madgwick_imu")).set_parameters == {}


def test_an_estimate_with_corrected_samples_is_not_taken_for_one_without(session, tmp_path):
    command("estimate", session.path, "--filters", "vqf_6d")
    plain = Estimate.load(session.path)
    name = session.sensor_names[0]
    corrected = Estimate.load(session.path)
    sensors = dict(corrected.sensors)
    object.__setattr__(sensors[name], "stored_calibration", {"methods": {}})
    corrected.save(session.path)
    again = load_or_estimate(session, analysis("vqf_6d"))
    assert again.sensors[name].stored_calibration is None
    np.testing.assert_array_equal(
        again.sensors[name].orientation["vqf_6d"], plain.sensors[name].orientation["vqf_6d"]
    )


def test_an_export_has_what_is_set_and_the_session_keeps_its_estimate(session, tmp_path):
    command("estimate", session.path)
    before = (session.path / "estimate" / "estimate.json").read_bytes()
    name = session.sensor_names[0]

    def exported(out: str, *options: str) -> np.ndarray:
        folder = tmp_path / out
        command("export", session.path, "--to", "parquet", "--out", folder, *options)
        columns = [f"vqf_6d_q_world_from_sensor_{axis}" for axis in "wxyz"]
        table = pq.read_table(folder / f"imu_{name}.parquet").select(columns)
        return np.column_stack([column.to_numpy() for column in table.columns])

    own = estimate(session, [get_filter("vqf_6d", {"tau_acc_s": 1.5})])
    expected = own.sensors[name].orientation["vqf_6d"]
    for out, options in (("all", ()), ("one", ("--filter", "vqf_6d"))):
        np.testing.assert_array_equal(
            exported(out, "--set", "vqf_6d.tau_acc_s=1.5", *options), expected
        )
    assert not np.array_equal(exported("stored"), expected)
    assert (session.path / "estimate" / "estimate.json").read_bytes() == before
    with pytest.raises(InputError, match="the true orientation has none"):
        command(
            "export",
            session.path,
            "--to",
            "csv",
            "--filter",
            "truth",
            "--set",
            "vqf_6d.tau_acc_s=1",
        )


def test_a_tuning_begins_at_what_is_set_and_keeps_what_is_not_tuned(session, tmp_path):
    arguments = ["tune", session.path, "--filter", "madgwick_imu", "--parameters", "beta"]
    search = ["--values", "3", "--no-refinement"]
    given = ["--set", "madgwick_imu.beta=0.3", "--set", "madgwick_imu.zeta=0.001"]
    command(*arguments, *search, *given, "--out", tmp_path / "a.json")
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["parameters"]["zeta"] == 0.001 and found["tuned"] == ["beta"]
    kind = get_filter("madgwick_imu", {"beta": 0.3, "zeta": 0.001})
    command("estimate", session.path, "--filters", "madgwick_imu", *given)
    assert Estimate.load(session.path).filter_parameters["madgwick_imu"] == kind.parameters
    command("evaluate", session.path)
    rows = Evaluation.load(session.path).orientation
    mean = np.mean([row.total_rmse_deg for row in rows])
    assert found["default_value"] == pytest.approx(mean, rel=1e-9)
    with pytest.raises(InputError, match="parameters are set of the filter vqf_6d"):
        command(*arguments, "--set", "vqf_6d.tau_acc_s=1", "--out", tmp_path / "b.json")
