"""Quijano & Valencia (2018), tables 4.1 to 4.4: the published numbers, and the study on a few short
runs.
"""

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.records.specs.published_chain import load_published_chain
from testbench.studies.bench import StudyBench
from testbench.studies.chain.comparison import (
    AXES,
    FITTED,
    FOURIER,
    KINEMATIC,
    OFF,
    PRINTED,
    reference_5,
)
from testbench.studies.chain.figures import boxes, figures
from testbench.studies.chain.motions import GAIT, PENDULUM, STEPS, TWO, VARIED, WALKS
from testbench.studies.chain.study import findings, fourier_changes, tables, uncovered
from tests.studies.hostile import complaints, missing

RUNS = 3
"""Of a rig: two have an interval that says nothing."""
FIGURES = ["Errors of the seven axes, as figure 4.37", "RMS over the seven axes by the number"]
FIGURES += ["shank, rate about", "shank, force along", "thigh, rate about", "knee, ", "ankle, "]
FIGURES += [f"{sensor}, rate" for sensor in ("pelvis", "thigh_r", "shank_r", "foot_r")]
FIGURES += list(AXES.values())
"""Figures 3.2 to 3.4, 4.3 to 4.19, 4.29 to 4.35 and 4.37 of the source."""


def test_the_published_numbers_are_those_of_the_source():
    published = load_published_chain()
    sums = {"4.1": (0.112, 0.083), "4.2": (0.2098, 0.1950)}  # a digit copied wrongly changes one
    for table in published.servo_rms:
        found = tuple(
            round(float(np.sum(table.states[state])), 4) for state in ("kinematic", "fourier")
        )
        assert found == pytest.approx(sums[table.table], abs=1e-9)
    means = [row.mean_error_deg for row in published.gait.rows]
    assert np.mean(means) == pytest.approx(published.gait.mean_error_deg, abs=5e-5)
    assert published.gait.mean_magnitude_deg == pytest.approx(0.4979, abs=5e-5)
    assert {(row.joint, row.axis) for row in published.gait.rows} == set(AXES)


@pytest.fixture(scope="module")
def study(altered_protocol, tmp_path_factory):
    """A quarter of the swings and squats, eight strides by the cheaper model of the sensors.

    One walker, and three runs of each rig with sensors of their own.
    """

    def fewer(spec):
        for sweep in spec["sections"][1]["steps"][0]["sweep"].values():
            sweep["sine"]["cycles"] = 7
        spec["estimate"]["chain"]["settling_s"] = 3

    def walk(spec):
        spec["variables"]["strides"] = 8
        spec["estimate"]["chain"] |= {"scales": False, "settling_s": 4}

    sources = {name: altered_protocol(name, fewer) for name in ("pendulum", "squat")}
    sources["gait"] = altered_protocol("gait", walk)
    bench = StudyBench(tmp_path_factory.mktemp("logs"), SystemClock(), parts=1)
    return reference_5(bench, sources, with_report=False, rigs_a_part=RUNS)


@pytest.mark.slow
def test_the_fourier_state_gains_where_the_motion_is_made_of_its_harmonics(study):
    for own in (study.rigs[PENDULUM.name], study.rigs["squat, one frequency"]):
        for joint in own.joints:
            change = own.change(joint, "acceleration_rmse_deg_s2")
            assert change.percent < -50 and change.verdict == "less", joint


@pytest.mark.slow
@pytest.mark.parametrize("motion", [STEPS, TWO])
def test_it_loses_where_the_motion_is_not(study, motion):
    own = study.rigs[motion.name]
    for joint in own.joints:
        change = own.change(joint, "rmse_deg")
        assert change.percent > 200 and change.verdict == "more", joint


@pytest.mark.slow
def test_strides_that_vary_cost_the_fourier_state_and_not_the_kinematic_one(study):
    alike, varied = (study.walks[motion.name] for motion in (GAIT, VARIED))
    for state, most in ((KINEMATIC, 1.5), (FOURIER, np.inf)):
        ratio = np.mean(varied.seven("rmse_deg", state)) / np.mean(alike.seven("rmse_deg", state))
        assert ratio < most, state
    fourier = [np.mean(own.seven("rmse_deg", FOURIER)) for own in (alike, varied)]
    assert fourier[1] > 1.2 * fourier[0]


@pytest.mark.slow
def test_wrong_placement_costs_degrees_and_the_fit_takes_most_of_it_back(study):
    stated = np.mean(study.walks[VARIED.name].seven("rmse_deg", KINEMATIC))
    off, fitted = (
        np.mean(study.placed[place].seven("rmse_deg", KINEMATIC)) for place in (OFF, FITTED)
    )
    assert off > 1.0 and stated < 0.5
    assert fitted < 0.6 * off


@pytest.mark.slow
def test_the_filter_of_the_text_follows_the_motion(study):
    """Its error is larger than ours, and it is no nonsense."""
    own = study.rigs[PENDULUM.name]
    for state in (KINEMATIC, FOURIER):
        ours, theirs = (
            own.errors["knee", name].mean("rmse_deg") for name in (state, PRINTED[state])
        )
        assert ours < theirs < 30
        assert all(row.correlation > 0.9 for row in own.errors["knee", PRINTED[state]].rows)


@pytest.mark.slow
def test_what_is_said_is_what_the_numbers_say(study):
    for own in (*study.rigs.values(), *study.walks.values()):
        for name, change in fourier_changes(own).items():
            if own.motion in WALKS:
                assert change.interval is None and change.verdict == "not shown"
                continue
            low, high = change.interval
            shown = "more" if low > 0 else "less" if high < 0 else "not shown"
            assert change.verdict == shown, name
    for (_, joint, _), errors in uncovered(study).items():
        assert np.mean([row.covered_percent for row in errors.rows]) < 80, joint
    said = " ".join(findings(study))
    assert "which is not made of the state's harmonics" in said
    for name in study.usual:
        assert f"each sensor by vqf_6d, {name}" in said


@pytest.mark.slow
def test_a_critical_reader_finds_nothing(study):
    record = StudyRecord(
        "reference-5",
        "",
        "",
        "",
        "2026-01-01T00:00:00Z",
        {"parts": RUNS},
        (),
        findings(study),
        tables(study, load_published_chain()),
        (boxes(study),),
        curves=figures(study),
    )
    assert complaints(record, ("harmonics",)) == []
    assert missing(record, FIGURES) == []
    harmonics = record.table("harmonics")
    alone = harmonics.columns.index("gait, each stride alike, series alone [deg]")
    assert harmonics.rows[3].values[alone] < 0.05 < harmonics.rows[0].values[alone]
    vary = harmonics.columns.index("gait, strides that vary, series alone [deg]")
    assert harmonics.rows[-1].values[vary] > 10 * harmonics.rows[-1].values[alone]


@pytest.mark.slow
def test_every_number_has_a_session(study):
    assert len(study.sessions) == 4 * RUNS + 2 + 1
    assert all(Session(path).path.is_dir() for path in study.sessions)
