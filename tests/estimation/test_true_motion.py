"""What is said of a truth that cannot be that of its samples as they stand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from testbench.estimation.alignment.axes import findings_on, identify_axes
from testbench.estimation.alignment.true_motion import TrueMotion, true_motion
from testbench.estimation.signals import truth_faults, truth_steps
from testbench.estimation.signals.time_alignment import fit_clock
from testbench.model import rotation
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.samples import ImuSamples, Truth
from tests.benchmarks.recordings import Known, simulated

IMPORTED = SensorRecord(driver="imported")


@pytest.fixture(scope="module")
def known() -> Known:
    return simulated(4)


def truth_of(samples: ImuSamples, rows: int = 0) -> Truth:
    """The orientation of the samples, so many rows later."""
    assert samples.device_q is not None
    at = np.clip(np.arange(len(samples)) - rows, 0, len(samples) - 1)
    return Truth(samples.host_time_ns, samples.device_q[at])


def told(samples: ImuSamples, truth: Truth, align: bool = False) -> TrueMotion:
    measured = np.ones(len(samples), dtype=bool)
    access: Any = SimpleNamespace(samples=samples, turned=samples, measured=measured, every=1)
    file: Any = SimpleNamespace(thinned=lambda: truth, is_long=False)
    return true_motion(access, file, IMPORTED, align)


def test_a_truth_on_the_samples_clock_that_comes_late_is_named(known):
    late = round(0.2 * known.rate)
    (found,) = told(known.samples, truth_of(known.samples, late)).findings
    assert found.code == "clock.late"
    assert found.values["late_s"] == pytest.approx(late / known.rate, abs=0.01)
    assert told(known.samples, truth_of(known.samples)).findings == []


def test_a_delay_of_two_samples_is_named_where_the_body_turns_far_in_it(known):
    (found,) = told(known.samples, truth_of(known.samples, 2)).findings
    assert found.code == "clock.late"
    assert found.values["late_s"] == pytest.approx(2 / known.rate, abs=0.6 / known.rate)
    assert found.values["turn_deg"] > 1
    slow = replace(known.samples, gyr=0.02 * known.samples.gyr)  # turns of which it is no delay
    q = rotation.to_rotation_vector(truth_of(known.samples, 2).q_world_from_sensor)
    slowly = Truth(slow.host_time_ns, rotation.from_rotation_vector(0.02 * q))
    assert "clock.late" not in {own.code for own in told(slow, slowly).findings}


def test_a_truth_that_is_on_another_clock_than_is_said_is_not_compared(known):
    away = told(known.samples, truth_of(known.samples, round(4 * known.rate)))
    (found,) = away.findings
    assert away.unaligned == found.code == "clock.not_common"
    assert found.values["late_s"] == pytest.approx(4, abs=0.05)


def test_a_log_of_joints_that_froze_is_compared_beside_that(known):
    samples = known.samples
    truth = truth_of(samples)
    frozen = slice(len(samples) // 5, 3 * len(samples) // 5)
    q, rate = truth.q_world_from_sensor.copy(), samples.gyr.copy()
    q[frozen], rate[frozen] = q[frozen.start], 0.0
    held = Truth(truth.host_time_ns, q, rate)
    assert fit_clock(samples, held, common_host=False).refused == "no common motion"
    found = told(samples, held, align=True)
    assert found.clock.method == "angular_rate" and not found.unaligned
    assert "truth.frozen" in {own.code for own in found.findings}


def test_a_truth_that_moves_otherwise_is_not_compared(known):
    other = truth_of(simulated(5).samples)
    rows = min(len(known.samples), len(other.host_time_ns))
    foreign = Truth(known.samples.host_time_ns[:rows], other.q_world_from_sensor[:rows])
    found = told(known.samples, foreign)
    assert found.unaligned == "truth.foreign"


def test_a_truth_that_stands_still_while_the_sensor_turns_is_not_compared(known):
    q = np.tile(known.samples.device_q[:1], (len(known.samples), 1))
    found = told(known.samples, Truth(known.samples.host_time_ns, q), align=True)
    assert found.unaligned == "clock.truth_still"


def test_a_large_bias_is_no_fault_of_the_truth(known):
    biased = replace(known.samples, gyr=known.samples.gyr + np.radians([20, -5, 3]))
    assert told(biased, truth_of(biased)).findings == []


def test_a_truth_that_steps_all_the_time_is_compared_in_linear_time(known, monkeypatch):
    asked = []
    misfit = truth_steps._misfit
    monkeypatch.setattr(truth_steps, "_misfit", lambda *some: asked.append(1) or misfit(*some))
    truth = truth_of(known.samples)
    steps = np.arange(len(known.samples)) // 12
    turns = np.radians(40.0) * np.stack([np.sin(2.4 * steps), steps % 3, np.cos(steps)], axis=1)
    q = rotation.multiply(truth.q_world_from_sensor, rotation.from_rotation_vector(turns))
    truth_faults.find_faults(
        known.samples, known.samples.host_time_ns, replace(truth, q_world_from_sensor=q)
    )
    assert 0 < len(asked) <= (truth_steps.MOST_CLASSES + 1) * (steps[-1] + 1)


def test_axes_at_rest_are_not_told_against_a_world_that_leans(known):
    samples = known.samples
    lean = rotation.from_rotation_vector(np.radians([50.0, 0.0, 20.0]))
    q = rotation.multiply(lean, samples.device_q)
    static = np.linalg.norm(samples.gyr - np.median(samples.gyr, axis=0), axis=1) < 0.1
    down = np.array([0.0, 0.0, -9.80665])
    for world, sees in ((q, False), (samples.device_q, True)):
        axes = identify_axes(
            samples, samples.host_time_ns, static, Truth(samples.host_time_ns, world), down
        )
        assert (axes["acc"].axes is not None) == sees
        assert findings_on({"acc": axes["acc"]}) == []


@pytest.mark.parametrize(("gain", "named"), [(1.15, True), (0.85, True), (1.04, False)])
def test_a_gain_that_the_truth_denies_is_named(known, gain, named):
    samples = replace(known.samples, gyr=gain * known.samples.gyr)
    static = np.zeros(len(samples), dtype=bool)
    down = np.array([0.0, 0.0, -9.80665])
    axes = identify_axes(samples, samples.host_time_ns, static, truth_of(samples), down)
    assert [one.code for one in findings_on(axes)] == (["axes.gain"] if named else [])
