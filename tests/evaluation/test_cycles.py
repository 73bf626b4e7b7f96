"""Average cycles: a known error of range, offset and noise comes back, a cut that is shifted is
seen, and a run has them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from testbench.evaluation.cycles import (
    POINTS,
    chain_cycles,
    coefficient_of_multiple_correlation,
    cut_cycles,
    cycle_findings,
    cycle_tables,
    joint_cycles,
)
from testbench.evaluation.flexion import JointErrors
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.plan import PlannedCycles, PlannedStep
from testbench.reporting.report import report
from tests.told import told

HZ, AMPLITUDE, CENTRE = 0.8, np.radians(25), np.radians(40)
START_S = 3.0
PLANNED = PlannedCycles(HZ, 1 / HZ, 12, 14 / HZ)
END_S = START_S + PLANNED.motion_s
STEP = PlannedStep(
    4,
    "walk",
    "evaluation",
    "walk, all",
    "sweep",
    {"a": 1.0},
    int(3e9),
    int(END_S * 1e9),
    int(END_S * 1e9) + 10**9,
    cycles=PLANNED,
)
instants = np.arange(0, int((END_S + 1) * 1e9), 10**7) + np.random.default_rng(1).integers(
    -(10**6), 10**6, 2150
)
IN_STEP = (instants >= STEP.start_ns) & (instants <= STEP.settled_ns)


def phase(time_ns=instants):
    return 2 * np.pi * HZ * (time_ns / 1e9 - START_S)


def wave(time_ns=instants):
    """The true angle, 15 to 65 deg; its phase counts from the start of the sweep."""
    return CENTRE + AMPLITUDE * np.sin(phase(time_ns))


def joint(error, true=None, step=STEP, rows=None):
    true = wave() if true is None else true
    rows = np.flatnonzero(IN_STEP) if rows is None else rows
    key = ("vqf_6d", "ZXZ")
    errors = JointErrors(
        "knee",
        None,
        instants,
        true,
        {key: true + error},
        {key: error},
        {},
        {},
        [(step, rows)],
        {},
        np.zeros((len(true), 2)),
    )
    return joint_cycles(errors)


def test_a_known_error_of_range_offset_and_noise_comes_back():
    gain, offset, noise = 0.06, np.radians(-1.5), np.radians(0.4)
    error = gain * (wave() - CENTRE) + offset
    [(clean, average)] = joint(error)
    assert (clean.joint, clean.filter, clean.sequence, clean.section, clean.step) == (
        "knee",
        "vqf_6d",
        "ZXZ",
        "walk",
        4,
    )
    assert (clean.cycles, clean.left_out, clean.frequency_hz, clean.variables) == (
        12,
        0,
        HZ,
        {"a": 1.0},
    )
    assert clean.true_rom_deg == pytest.approx(50, abs=0.05)
    assert clean.rom_error_deg == pytest.approx(0.06 * 50, abs=0.01)
    assert clean.rom_deg == pytest.approx(clean.true_rom_deg + clean.rom_error_deg)
    assert clean.mean_error_deg == pytest.approx(-1.5, abs=0.02)  # 0 and 100 % are both counted
    assert clean.rmse_deg == pytest.approx(np.hypot(1.5, 0.06 * 25 / np.sqrt(2)), abs=0.02)
    assert clean.error_sd_deg < 0.01 and clean.true_sd_deg < 0.05
    percent = np.linspace(0, 1, POINTS)
    np.testing.assert_allclose(
        average["true"], CENTRE + AMPLITUDE * np.sin(2 * np.pi * percent), atol=np.radians(0.05)
    )
    np.testing.assert_allclose(
        average["estimated"],
        CENTRE + offset + (1 + gain) * AMPLITUDE * np.sin(2 * np.pi * percent),
        atol=np.radians(0.05),
    )
    white = np.random.default_rng(3).normal(0, noise, len(instants))
    [(noisy, average)] = joint(error + white)
    assert noisy.error_sd_deg == pytest.approx(
        0.4, rel=0.25
    )  # interpolation between samples takes up to half the variance
    assert noisy.mean_error_deg == pytest.approx(-1.5, abs=0.05)
    assert (
        0 < noisy.rom_error_deg - clean.rom_error_deg < 4 * 0.4
    )  # noise widens what it is laid upon
    assert noisy.rom_error_sd_deg > 10 * clean.rom_error_sd_deg
    assert noisy.cmc < 1


def test_a_cut_that_is_shifted_is_seen():
    [(_, right)] = joint(np.zeros(len(instants)))
    assert right["true"][[0, 25, 50, 75, 100]] == pytest.approx(
        CENTRE + AMPLITUDE * np.array([0, 1, 0, -1, 0]), abs=np.radians(0.1)
    )
    for part in (0.02, -0.05, 0.5):
        moved = round(part / HZ * 1e9)
        step = replace(STEP, start_ns=STEP.start_ns + moved, settled_ns=STEP.settled_ns + moved)
        [(_, found)] = joint(np.zeros(len(instants)), step=step)
        shift = np.interp(
            np.linspace(0, 1, POINTS) + part,
            np.linspace(-1, 2, 301),
            np.tile(right["true"][:-1], 4)[:301],
        )
        np.testing.assert_allclose(found["true"], shift, atol=np.radians(0.1))
        assert abs(found["true"] - right["true"]).max() > np.radians(2.5)


def test_an_estimate_that_is_late_shows_in_the_error_of_the_cycle_and_not_in_its_range():
    late = 0.02
    [(row, average)] = joint(wave(instants - int(late * 1e9)) - wave())
    assert row.rom_error_deg == pytest.approx(0, abs=0.02)
    assert row.mean_error_deg == pytest.approx(0, abs=0.05)
    assert np.degrees(average["error"][0]) == pytest.approx(-25 * 2 * np.pi * HZ * late, rel=0.02)
    assert row.rmse_deg == pytest.approx(25 * 2 * np.pi * HZ * late / np.sqrt(2), rel=0.02)


def test_cycles_of_the_wrong_length_are_remarked_upon():
    wrong = replace(STEP, cycles=replace(PLANNED, frequency_hz=1.03 * HZ))
    found = joint(np.zeros(len(instants)), step=wrong)
    assert found[0][0].true_sd_deg > 5
    [note] = told(cycle_findings("joint 'knee'", [wrong], found))
    assert (
        note.startswith("joint 'knee': the true angle of knee in step 4 differs")
        and "not periodic as planned" in note
    )
    assert told(cycle_findings("joint 'knee'", [STEP], joint(np.zeros(len(instants))))) == []


@pytest.mark.parametrize("late", [-1.0, 0.8])
def test_a_sweep_that_did_not_last_as_planned_is_not_cut(late):
    step = replace(STEP, settled_ns=STEP.settled_ns + int(late * 1e9))
    assert joint(np.zeros(len(instants)), step=step) == []
    [note] = told(cycle_findings("here", [step], []))
    assert f"lasted {PLANNED.motion_s + late:.2f} s where 17.50 s were planned" in note


def test_cycles_with_gaps_are_left_out_and_short_gaps_are_not_gaps():
    third = START_S + 3.4 / HZ
    for part, left_out in ((0.03, 0), (0.1, 1)):
        within = (instants / 1e9 > third) & (instants / 1e9 < third + part / HZ)
        [(row, _)] = joint(np.zeros(len(instants)), rows=np.flatnonzero(IN_STEP & ~within))
        assert (row.cycles, row.left_out) == (12 - left_out, left_out)
    unknown = np.where(abs(instants / 1e9 - third) < 0.02, np.nan, 0.0)
    [(row, _)] = joint(unknown)
    assert (row.cycles, row.left_out) == (11, 1)


def test_only_whole_cycles_of_the_judged_part_count():
    judged = IN_STEP & (instants / 1e9 > START_S + 3.2 / HZ) & (instants / 1e9 < START_S + 9.9 / HZ)
    [(row, average)] = joint(np.zeros(len(instants)), rows=np.flatnonzero(judged))
    assert (row.cycles, row.left_out) == (5, 0)
    assert average["true"][25] == pytest.approx(CENTRE + AMPLITUDE, abs=np.radians(0.1))
    two = judged & (instants / 1e9 < START_S + 6.5 / HZ)
    assert joint(np.zeros(len(instants)), rows=np.flatnonzero(two)) == []
    [note] = told(cycle_findings("here", [STEP], []))
    assert "no average cycle of 1 of 1 sweeps: fewer than 3" in note


def test_without_planned_cycles_and_without_motion_there_is_nothing():
    assert cut_cycles(replace(STEP, cycles=None), instants, wave(), wave()) is None
    assert joint(np.zeros(len(instants)), step=replace(STEP, cycles=None)) == []
    assert joint(np.zeros(len(instants)), true=np.full(len(instants), CENTRE)) == []


def test_the_joints_of_a_chain_are_cut_by_the_steps_of_their_section():
    names = ["hip", "knee"]
    zero = np.zeros((len(instants), 3, 2))
    estimate = ChainEstimate(
        section="walk",
        state="fourier",
        sensors=["a"],
        joints=names,
        facts={},
        host_time_ns=instants,
        mean=zero,
        sd=zero,
    )
    series = {"host_time_ns": instants, "judged": IN_STEP}
    for i, name in enumerate(names):
        error = np.full(len(instants), np.radians(i + 1.0))
        series |= {f"{name}_rad": wave() + error, f"{name}_error_rad": error}
    elsewhere = replace(STEP, section="other", index=5)
    found = [row for row, _ in chain_cycles([elsewhere, STEP], estimate, series)]
    assert [(row.joint, row.filter, row.sequence, row.step) for row in found] == [
        ("hip", "fourier", None, 4),
        ("knee", "fourier", None, 4),
    ]
    assert [row.mean_error_deg for row in found] == pytest.approx([1, 2])


def written_out(estimated, true):
    """The published double sums, term by term."""
    cycles, frames = len(true), len(true[0])
    above = below = 0.0
    for g in range(cycles):
        grand = sum(estimated[g][f] + true[g][f] for f in range(frames)) / (2 * frames)
        for f in range(frames):
            middle = (estimated[g][f] + true[g][f]) / 2
            for y in (estimated[g][f], true[g][f]):
                above += (y - middle) ** 2 / (cycles * frames * (2 - 1))
                below += (y - grand) ** 2 / (cycles * (2 * frames - 1))
    return 1 - above / below


@given(arrays(float, (2, 3, 5), elements=st.floats(-2, 2, width=16)))
def test_the_coefficient_of_multiple_correlation_is_that_of_its_authors(curves):
    if np.ptp(curves, axis=(0, 2)).max() < 1e-3:
        assert coefficient_of_multiple_correlation(curves[0], curves[0]) is None
        return
    squared = written_out(curves[0].tolist(), curves[1].tolist())
    found = coefficient_of_multiple_correlation(*curves)
    if squared > 1e-9:
        assert found == pytest.approx(np.sqrt(squared), rel=1e-9)
    elif squared < -1e-9:
        assert found is None


def test_an_offset_lowers_the_coefficient_as_it_should():
    true = np.tile(np.sin(np.linspace(0, 2 * np.pi, 100, endpoint=False)), (4, 1))
    for offset in (0.0, 0.1, 0.5):
        expected = np.sqrt(1 - (offset**2 / 2) / (200 * (0.5 + offset**2 / 4) / 199))
        assert coefficient_of_multiple_correlation(true + offset, true) == pytest.approx(expected)
    assert coefficient_of_multiple_correlation(true + 3, true) is None


def test_rows_and_average_cycles_come_back_from_disk(tmp_path):
    two = [
        found for offset in (0.01, 0.02) for found in joint(np.full(len(instants), offset))
    ]  # as of two joints, one after the other
    assert not cycle_tables([]).series
    result = Evaluation(session="s", **vars(cycle_tables(two)))
    result.save(tmp_path)
    found = Evaluation.load(tmp_path)
    assert found.cycles == result.cycles and len(found.cycles) == 2
    table = found.series["cycles"]
    second = table["row"] == 1
    assert table["cycle_percent"][second].tolist() == list(range(POINTS))
    np.testing.assert_allclose(table["error_rad"][second], 0.02)
    np.testing.assert_allclose(table["estimated_rad"] - table["true_rad"], table["error_rad"])


SQUATS = {"amplitude_deg": 40, "frequency_hz": 0.5, "cycles": 5}


@pytest.fixture(scope="module")
def squat(run_protocol, altered_protocol):
    def change(spec):
        spec["sections"][1]["steps"][0]["sweep"] = {
            "ankle": {"sine": SQUATS | {"amplitude_deg": 12}},
            "knee": {"sine": SQUATS},
        }
        spec["sections"][1]["steps"].append({"sweep": {"knee": {"sine": SQUATS | {"cycles": 2}}}})
        spec["estimate"]["chain"] = {
            "states": ["kinematic"],
            "settling_s": 1,
            "jerk_deg_s3_sqrthz": 2000,
        }
        for name in ("shank", "thigh"):
            spec["sensors"][name]["segment"] = {"name": name}
        spec["joints"] = {
            "knee_flexion": {
                "proximal": "shank",
                "distal": "thigh",
                "sequence": "YXZ",
                "flexion": "first",
            }
        }

    return run_protocol(altered_protocol("squat", change))


def test_a_run_has_the_cycles_of_the_chain_and_of_the_joints_that_the_protocol_defines(squat):
    rows = squat.evaluation.cycles
    assert {(row.joint, row.filter, row.sequence) for row in rows} == {
        ("knee_flexion", "vqf_6d", "YXZ"),
        ("ankle", "kinematic", None),
        ("knee", "kinematic", None),
    }
    (sweep, short) = [step for step in squat.session.steps if step.kind == "sweep"]
    assert short.cycles.count == 2 and {row.step for row in rows} == {sweep.index}
    for row in rows:
        assert (row.cycles, row.frequency_hz) == (5, 0.5)
        assert row.true_rom_deg == pytest.approx(24 if row.joint == "ankle" else 80, rel=0.05)
        assert abs(row.rom_error_deg) < 1 and row.true_sd_deg < 0.2 and row.cmc > 0.99
    assert not [note for note in squat.evaluation.notes if "cycle" in note]


def test_the_report_shows_the_cycles_of_the_run(squat):
    page = report(squat.session, squat.estimate, squat.evaluation).read_text()
    assert "Average cycle: knee_flexion, section squats" in page
    assert "Average cycle: joints of the chain, section squats" in page
    assert page.count('"cycle [%]"') == 3  # one figure a joint
    assert "fewer than 3" not in page
