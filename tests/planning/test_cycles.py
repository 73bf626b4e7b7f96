import itertools
import json
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench import Session, plan
from testbench.exceptions import SessionError
from testbench.planning.cycles import common_frequency, planned_cycles
from testbench.planning.expansion import FourierCommand, SineCommand
from testbench.records.session.plan import PlannedCycles
from tests.asking import planned


def sine(frequency, cycles, ramp=1.0, amplitude=0.2, joint=0):
    return SineCommand(joint, amplitude, frequency, cycles, ramp, 0.0)


def lasting(*sweeps):
    return max((sweep.cycles + 2 * sweep.ramp_cycles) / sweep.frequency for sweep in sweeps)


def cycles_of(*sweeps):
    return planned_cycles(sweeps, lasting(*sweeps))


def test_the_fades_are_left_out_and_cycles_begin_where_the_phase_does():
    assert cycles_of(sine(0.5, 4)) == PlannedCycles(0.5, 2.0, 4, 12.0)
    assert cycles_of(sine(0.75, 13, ramp=0.5)) == PlannedCycles(
        0.75, pytest.approx(1 / 0.75), 12, pytest.approx(14 / 0.75)
    )
    assert cycles_of(sine(0.5, 1, ramp=0.5)) is None


def test_joints_of_several_frequencies_share_the_cycle_of_all():
    found = cycles_of(sine(0.25, 12), sine(0.5, 24, ramp=2, joint=1), sine(0.75, 40, joint=2))
    assert (found.frequency_hz, found.first_s, found.count) == (0.25, 4.0, 12)
    assert cycles_of(sine(0.5, 12), sine(0.5 * np.sqrt(2), 12, joint=1)) is None
    still = sine(0.3, 12, amplitude=0.0, joint=1)
    assert cycles_of(sine(0.5, 12), still).frequency_hz == 0.5
    assert cycles_of(still) is None


def test_harmonics_of_a_fourier_series_have_its_base_for_their_cycle():
    series = FourierCommand(0, (0.0, 0.1), (0.0, 0.0), 0.875, 24, 2)
    assert cycles_of(series) == PlannedCycles(
        0.875, pytest.approx(2 / 0.875), 24, pytest.approx(32)
    )


@given(st.lists(st.integers(1, 40), min_size=1, max_size=5), st.integers(1, 30), st.integers(1, 30))
def test_every_frequency_is_a_whole_multiple_of_the_common_one_and_no_higher_one_is_common(
    multiples, above, below
):
    base = above / below
    found = common_frequency([k * base for k in multiples])
    assert found == pytest.approx(base * np.gcd.reduce(multiples), rel=1e-9)


@pytest.mark.parametrize(
    ("protocol", "section", "expected"),
    [
        ("gait", "walking", (0.875, 2 / 0.875, 24)),
        ("chain_ur3e", "waves", (0.25, 4, 12)),
        ("pendulum", "swing", (0.6, 1 / 0.6, 30)),
        ("timing_audit", None, None),
    ],
)
def test_the_planned_motion_repeats_from_cycle_to_cycle(protocol, section, expected):
    made = plan(protocol)
    periodic = [
        step for step in made.steps if step.cycles is not None and section in (None, step.section)
    ]
    assert periodic
    for step in periodic:
        cycles = step.cycles
        if expected is not None:
            assert (cycles.frequency_hz, cycles.first_s, cycles.count) == pytest.approx(expected)
        place = np.arange(cycles.count)[:, None] + np.linspace(0, 1, 50)
        times = step.start_ns + (1e9 * (cycles.first_s + place / cycles.frequency_hz)).astype(
            np.int64
        )
        q = made.trajectory.at(times.ravel())[0].reshape(*times.shape, -1)
        assert np.ptp(q[0], axis=0).max() > np.radians(2)
        for one, another in itertools.pairwise(q):
            np.testing.assert_allclose(one, another, atol=np.radians(1e-3))


def test_a_trapezoid_goes_there_and_back_in_every_cycle(altered_protocol):
    def change(spec):
        spec["sections"][1]["steps"] = [
            {
                "sweep": {
                    "knee": {
                        "trapezoid": {
                            "amplitude_deg": 20,
                            "rate_deg_s": 30,
                            "cycles": 5,
                            "hold_s": 0.3,
                        }
                    }
                }
            }
        ]
        del spec["estimate"]["chain"], spec["accept"]

    made = plan(altered_protocol("pendulum", change))
    (step,) = [step for step in made.steps if step.kind == "sweep"]
    assert (step.cycles.count, step.cycles.first_s) == (5, 0)
    assert step.cycles.count / step.cycles.frequency_hz == pytest.approx(
        (step.settled_ns - step.start_ns) / 1e9
    )
    quarter = np.array([0.5, 1.5, 2.5]) / step.cycles.frequency_hz - 0.15
    turned = made.trajectory.at(step.start_ns + (1e9 * quarter).astype(np.int64))[0][:, 0]
    np.testing.assert_allclose(turned, np.radians(20), atol=1e-6)


def test_a_session_knows_the_cycles_of_its_plan(quick):
    for found, wanted in zip(quick.session.steps, planned("quick").steps, strict=True):
        assert found.cycles == wanted.cycles
    (sweep,) = [step for step in quick.session.steps if step.cycles is not None]
    assert sweep.cycles == PlannedCycles(0.5, 2.0, 2, 8.0)
    stated = pq.read_schema(quick.session.path / "plan.parquet").metadata[b"steps"]
    assert stated.count(b'"cycles"') == 1


@pytest.mark.parametrize(
    "damage",
    [
        3,
        {"frequency_hz": 0.5},
        {"frequency_hz": 0, "first_s": 0, "count": 1, "motion_s": 1},
        {"frequency_hz": 1, "first_s": -1, "count": 1, "motion_s": 1},
    ],
)
def test_cycles_that_cannot_be_are_called_damaged(quick, tmp_path, damage):
    for name in ("manifest.json", "events.jsonl"):
        shutil.copy(quick.session.path / name, tmp_path)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    del manifest["files"]["events.jsonl"]
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    lines = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    for line in lines:
        if "cycles" in line:
            line["cycles"] = damage
    (tmp_path / "events.jsonl").write_text("\n".join(json.dumps(line) for line in lines))
    with pytest.raises(SessionError, match=r"is damaged: of step .* are no cycles"):
        _ = Session(tmp_path).steps
