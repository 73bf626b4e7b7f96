"""A gyroscope that turns too far or too little by a factor that no list has."""

from __future__ import annotations

from dataclasses import replace

import pytest

from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import Known, check_samples, simulated


@pytest.fixture(scope="module")
def known() -> Known:
    return simulated(4)


def told(samples: ImuSamples, code: str) -> list[Finding]:
    return [one for one in check_samples([samples]) if one.code == code]


@pytest.mark.parametrize("gain", [0.76, 0.86, 1.28])
def test_a_wrong_gain_is_named_with_the_rate_that_explains_it_too(known: Known, gain: float):
    (found,) = told(
        replace(known.samples, gyr=known.samples.gyr / gain), "consistency.gain_or_rate"
    )
    assert found.values["gain"] == pytest.approx(gain, rel=0.03)
    assert found.values["other_rate_hz"] == pytest.approx(known.rate / gain, rel=0.03)
    assert "gyr.scale" in found.remedy and "--rate" in found.remedy


@pytest.mark.parametrize(("gain", "said"), [(0.5, 0.5), (0.65, 0.65), (1.7, 1.7), (2.0, 2.0)])
def test_a_gain_near_that_of_another_range_is_told_as_it_is(known: Known, gain: float, said: float):
    (found,) = told(
        replace(known.samples, gyr=known.samples.gyr / gain), "consistency.scale_or_rate"
    )
    assert found.values["scale"] == pytest.approx(said, rel=0.03)


@pytest.mark.parametrize("gain", [0.96, 1.0, 1.04])
def test_what_parts_are_off_by_is_not_remarked_on(known: Known, gain: float):
    scaled = replace(known.samples, gyr=known.samples.gyr / gain)
    assert told(scaled, "consistency.gain_or_rate") == []


def test_an_accelerometer_of_exactly_nothing_at_rest_has_no_gravity(known: Known):
    acc = known.samples.acc.copy()
    still = abs(known.samples.gyr - known.samples.gyr[:20].mean(axis=0)).max(axis=1) < 0.1
    acc[still] = 0.0
    acc[~still] -= acc[~still].mean(axis=0)
    assert told(replace(known.samples, acc=acc), "consistency.no_gravity")
