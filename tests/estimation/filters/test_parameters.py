"""Parameters of filters: what is refused, what they do, and how protocols give them."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, UniformSamples, choose_filters, get_filter, kinds
from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.pipeline.prepared import make_plan
from testbench.records.results.estimate import Estimate
from testbench.records.specs.protocol import FILTER_NAMES
from tests.asking import run_of
from tests.estimation.filters.motions import heading_deg, inclination_deg, wander

ALL = [(name, parameter) for name, kind in FILTERS.items() for parameter in kind.PARAMETERS]


def test_protocols_may_name_the_filters_that_exist_and_no_others():
    assert set(kinds()) == set(FILTER_NAMES)


@pytest.mark.parametrize(("name", "parameter"), ALL, ids=[f"{name}-{p.name}" for name, p in ALL])
def test_every_parameter_is_described_and_its_default_and_plausible_values_are_allowed(
    name, parameter
):
    assert parameter.meaning and parameter.unit and parameter.source
    assert parameter.low < parameter.high
    assert parameter.scale != "log" or parameter.low > 0
    for value in (parameter.default, parameter.low, parameter.high):
        assert get_filter(name, {parameter.name: value}).parameters[parameter.name] == value


@pytest.mark.parametrize(("name", "parameter"), ALL, ids=[f"{name}-{p.name}" for name, p in ALL])
@pytest.mark.filterwarnings("error")
def test_no_parameter_is_idle_or_breaks_its_filter_within_its_plausible_range(name, parameter):
    """Each changes what the filter gives on a recording that has rest, motion, acceleration, bias
    and a disturbed field.
    """
    samples = eventful()
    runs = [
        get_filter(name, {parameter.name: value}).run(samples)
        for value in (parameter.low, parameter.high)
    ]
    for q in runs:
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-5)
    assert not np.array_equal(*runs)


@cache
def eventful() -> UniformSamples:
    """Motion with a bias, bursts of acceleration and a magnet; then rest."""
    samples, _ = wander(60, bias=(0.01, -0.02, 0.015))
    n = len(samples)
    gyr, acc, mag = samples.gyr.copy(), samples.acc.copy(), np.array(samples.mag)
    acc[1000:1300] += [2.0, -1.0, 3.0]
    mag[2000:3000] += [15.0, -10.0, 5.0]
    shaken = (
        0.02
        * (gyr[n // 2 :] - gyr[n // 2 :].mean(axis=0))
        * (np.arange(n - n // 2) < 1000)[:, None]
    )
    gyr[n // 2 :] = [0.01, -0.02, 0.015] + shaken
    acc[n // 2 :], mag[n // 2 :] = acc[n // 2], mag[n // 2]
    acc[4000:5000, 0] += 0.6 * np.sin(np.arange(1000))  # a table that shakes
    gyr[700:720] *= 10.0  # beyond the range of the least of gyroscopes
    return UniformSamples(samples.interval, gyr, acc, mag, np.tile([1.0, 0, 0, 0], (n, 1)))


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        (
            "madgwick_imu",
            {"gamma": 1.0},
            (
                "unknown parameter of the filter madgwick_imu 'gamma'; known: beta, zeta, "
                "acc_gate_m_s2"
            ),
        ),
        (
            "madgwick_imu",
            {"beta": -0.1},
            "filter madgwick_imu: beta is -0.1 rad/s; it must be at least 0",
        ),
        ("vqf_6d", {"rest_bias": 0.5}, "rest_bias is 0.5; a switch is 0 (off) or 1 (on)"),
        (
            "imufilter",
            {"linear_acc_decay": 1.5},
            "linear_acc_decay is 1.5; it must be between 0 and 1",
        ),
        ("vqf_6d", {"tau_acc_s": float("nan")}, "must be a finite number"),
        ("gyro", {"beta": 1.0}, "unknown parameter of the filter gyro 'beta'; known: none"),
    ],
)
def test_an_unknown_name_or_a_value_that_is_not_allowed_is_refused(name, parameters, words):
    with pytest.raises(InputError) as caught:
        get_filter(name, parameters)
    assert words in str(caught.value)


def test_two_filters_of_one_name_do_not_stand_beside_one_another():
    with pytest.raises(InputError, match="two of the filters are called mahony_imu"):
        choose_filters(["mahony_imu", get_filter("mahony_imu", {"kp": 2.0})])


GATED = [
    name
    for name, kind in FILTERS.items()
    if "acc_gate_m_s2" in {p.name for p in kind.PARAMETERS}
    and "euler" not in name
    and name != "madgwick_adaptive"  # which trusts no push without a gate either
]


@pytest.mark.parametrize("name", GATED)
def test_the_gate_keeps_a_push_from_tilting_the_filter(name):
    samples, true = wander(30, noise=0.1)
    acc = samples.acc.copy()
    acc[1500:1800] += [3.0, 2.0, -1.0]
    acc[1500:1800] *= 12.0 / np.linalg.norm(acc[1500:1800], axis=1)[:, None]
    pushed = UniformSamples(samples.interval, samples.gyr, acc, samples.mag)
    during = slice(1500, 1800)
    plain = inclination_deg(get_filter(name).run(pushed), true)[during].max()
    gated = inclination_deg(get_filter(name, {"acc_gate_m_s2": 0.3}).run(pushed), true)[
        during
    ].max()
    assert gated < 0.6 * plain and gated < 1.0


@pytest.mark.parametrize(
    "name",
    [name for name, kind in FILTERS.items() if "mag_gate" in {p.name for p in kind.PARAMETERS}],
)
def test_the_magnetic_gate_keeps_a_magnet_from_turning_the_filter(name):
    samples, true = wander(40, noise=0.1)
    mag = np.array(samples.mag)
    mag[1500:3000] += [20.0, 0.0, 10.0]
    near = UniformSamples(samples.interval, samples.gyr, samples.acc, mag)
    during = slice(1500, 3000)
    plain = np.abs(heading_deg(get_filter(name).run(near), true)[during]).max()
    gated = np.abs(heading_deg(get_filter(name, {"mag_gate": 0.1}).run(near), true)[during]).max()
    assert plain > 5.0 and gated < 1.5


BIAS = {
    "mahony_marg": {"kp": 0.5, "ki": 0.05},
    "madgwick_marg": {"beta": 0.05, "zeta": 0.01},
    "mekf": {},
    "ahrsfilter": {"gyr_drift_var_rad2_s2": 1e-9},
    "vqf_9d": {},
}


@pytest.mark.parametrize("name", BIAS)
def test_an_injected_bias_is_found(name):
    bias = (0.01, -0.02, 0.015)
    samples, _ = wander(120, bias=bias)
    _, state = get_filter(name, BIAS[name]).advance(samples)
    np.testing.assert_allclose(state["gyr_bias_rad_s"], bias, atol=0.004)


def test_a_real_bias_state_removes_the_drift_that_zeta_as_printed_leaves():
    """Heading with a gyroscope bias of 3 deg/s about the vertical, where the field corrects
    slowly.
    """
    samples, true = wander(120, bias=(0.0, 0.0, 0.05))
    late = slice(6000, None)
    error = {
        kind: np.abs(
            heading_deg(get_filter(kind, {"beta": 0.02, "zeta": 0.01}).run(samples), true)[late]
        ).mean()
        for kind in ("madgwick_marg", "madgwick_zeta_as_printed")
    }
    assert error["madgwick_marg"] < 1.0 < 5.0 < error["madgwick_zeta_as_printed"]


def test_a_protocol_gives_parameters_which_the_estimate_records(altered_protocol, run_protocol):
    def change(content):
        content["estimate"] = {
            "filters": ["madgwick_imu", "vqf_6d"],
            "filter_parameters": {"madgwick_imu": {"beta": 0.2}},
        }
        content["accept"] = []

    result = run_protocol(altered_protocol("quick", change))
    assert result.estimate.filter_parameters["madgwick_imu"] == {
        "beta": 0.2,
        "zeta": 0.0,
        "acc_gate_m_s2": 0.0,
    }
    assert Estimate.load(result.session.path).filter_parameters == result.estimate.filter_parameters
    other = estimate(result.session, [get_filter("madgwick_imu")])
    mine, default = (e.sensors["arm"].orientation["madgwick_imu"] for e in (result.estimate, other))
    assert not np.allclose(mine, default, atol=1e-6)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (
            {"madgwick_imu": {"betta": 0.1}},
            "unknown parameter of the filter madgwick_imu 'betta'; known: beta",
        ),
        ({"madgwick_imu": {"beta": -1}}, "it must be at least 0"),
        ({"vqf_9d": {"tau_mag_s": 3}}, "vqf_9d is not among filters"),
        ({"madgwick": {"beta": 0.1}}, "madgwick"),
        ({"madgwick_imu": {"beta": "strong"}}, "beta"),
    ],
)
def test_parameters_that_a_filter_does_not_take_are_refused_with_their_line(
    altered_protocol, parameters, words
):
    def change(content):
        content["estimate"] = {"filters": ["madgwick_imu"], "filter_parameters": parameters}
        content["accept"] = []

    path = altered_protocol("quick", change)
    with pytest.raises(FileProblems) as caught:
        make_plan(run_of(path))
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{path}:")


def test_an_unknown_filter_on_the_command_line_is_refused_before_anything_moves(tmp_path):
    with pytest.raises(NotFoundError, match="unknown filter 'kalman'"):
        CliRunner().invoke(
            app,
            ["run", "quick", "--filters", "kalman", "--logs", str(tmp_path)],
            catch_exceptions=False,
        )
    assert not list(tmp_path.iterdir())


def test_the_command_lists_every_filter_with_its_parameters():
    result = CliRunner().invoke(app, ["filters", "--json"])
    listed = {entry["name"]: entry for entry in json.loads(result.stdout)["filters"]}
    assert list(listed) == list(FILTERS)
    beta = next(p for p in listed["madgwick_imu"]["parameters"] if p["name"] == "beta")
    assert beta["default"] == 0.033 and beta["unit"] == "rad/s" and beta["low"] < beta["high"]
    assert "madgwick_imu" in CliRunner().invoke(app, ["filters"]).stdout


def test_the_page_about_filters_has_every_filter_parameter_and_default():
    page = (Path(__file__).resolve().parents[3] / "docs" / "filters.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| `")]
    for name, kind in FILTERS.items():
        (row,) = [
            row
            for row in rows
            if row[0] == f"| `{name}`" and len(row) == 5 and row[3].startswith(kind.sampling)
        ]
        assert row[1] == ", ".join(kind.needs)
        assert row[2] == (", ".join(f"`{p.name}` {p.default:g}" for p in kind.PARAMETERS) or "none")
        assert kind.source in page
        for parameter in kind.PARAMETERS:
            assert any(
                row[0] == f"| `{parameter.name}`"
                and f"`{name}`" in row[1]
                and row[5] == parameter.meaning
                for row in rows
            )
