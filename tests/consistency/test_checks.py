"""Faults put into a recording that is right are named, and a right one raises no warning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.consistency import Consistency, refuse_contradictions
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM, to_earth_frame
from testbench.records.findings.finding import Severity
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.faults import FAULTS, NAMED, UNCHECKED, Fault, outcome, warnings
from tests.benchmarks.recordings import Known, check_samples, of_arrays, simulated


@pytest.fixture(scope="module")
def known() -> Known:
    """Half a minute of turns and rests of a sensor with a magnetometer and an orientation."""
    return simulated(4)


def _pieces(samples: ImuSamples, size: int) -> list[ImuSamples]:
    fields = ("device_time_ns", "host_time_ns", "gyr", "acc", "mag", "device_q")
    return [
        replace(
            samples,
            **{name: getattr(samples, name)[at : at + size] for name in fields},
            counter=samples.counter[at : at + size],
            saturated=samples.saturated[at : at + size],
        )
        for at in range(0, len(samples), size)
    ]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_named(known: Known, fault: Fault) -> None:
    found = outcome(fault, check_samples([fault.put(known.samples)]), set())
    assert found == (UNCHECKED if fault.name.endswith("without an orientation") else NAMED)


@pytest.mark.parametrize("seed", range(5, 8))
def test_a_recording_that_is_right_raises_no_warning(seed: int) -> None:
    assert warnings(simulated(seed).samples) == set()


def test_pieces_are_looked_at_as_the_whole_is(known: Known) -> None:
    mirrored = replace(known.samples, gyr=known.samples.gyr * [1, 1, -1])
    watched = Consistency()
    pieces = _pieces(mirrored, 1000)
    assert list(watched.watch(pieces)) == pieces
    (found,) = [one for one in watched.findings() if one.severity is Severity.WARNING]
    assert found.code == "consistency.gyr_mirrored"
    assert found.values["axes"] == ["x: +x, y: +y, z: -z"]
    assert "{x: +x, y: +y, z: -z}" in str(found) and "{{" not in str(found)
    assert "gyr.axes" in found.remedy


def test_a_fault_that_begins_late_is_seen_by_what_comes_before_and_after(known: Known) -> None:
    still = np.zeros((20_000, 3)) + [0.001, 0.002, -0.001]
    rng = np.random.default_rng(3)
    gyr = still + rng.normal(0, 0.003, still.shape)
    acc = still + [0, 0, 9.8] + rng.normal(0, 0.03, still.shape)
    turned = known.samples
    late = of_arrays(
        known.rate,
        np.concatenate([gyr, turned.gyr * [-1, 1, 1]]),
        np.concatenate([acc, turned.acc]),
    )
    assert warnings(late) == {"gyr_mirrored"}


@pytest.mark.parametrize("earth", ["NED", "NWU"])
def test_a_direction_is_told_whatever_earth_its_numbers_were_taken_to_be_of(known, earth):
    turn = np.array(Q_ENU_FROM[earth])
    written = rotation.conjugate(to_earth_frame(known.samples.device_q, earth))
    wrong = replace(known.samples, device_q=rotation.multiply(turn, written))
    (found,) = [one for one in check_samples([wrong]) if one.severity is Severity.WARNING]
    assert found.code == "consistency.orientation_reading"
    assert found.values["keys"] == ["direction: sensor_from_earth"]


def test_a_sensor_that_never_turns_is_said_to_be_unchecked() -> None:
    rng = np.random.default_rng(1)
    gyr, acc = rng.normal(0, 0.002, (3000, 3)), rng.normal(0, 0.02, (3000, 3)) + [0, 0, 9.81]
    (found,) = check_samples([of_arrays(100.0, gyr, acc)])
    assert (found.code, found.severity) == ("consistency.unchecked", Severity.NOTE)
    assert "gyroscope against accelerometer: sign of x" in found.values["what"]


def test_dropouts_repetitions_and_absurd_numbers_do_not_mislead(known: Known) -> None:
    gyr, acc = known.samples.gyr.copy(), known.samples.acc.copy()
    gyr[300:340], acc[300:340] = 0, 0
    gyr[500:540], acc[500:540] = gyr[500], acc[500]
    gyr[700], acc[705], acc[710, 1] = np.nan, 1e300, np.inf
    assert warnings(replace(known.samples, gyr=gyr, acc=acc)) == set()


@pytest.mark.parametrize("missing", ["gyr", "acc"])
def test_a_sensor_without_one_of_the_triads_is_not_accused(known: Known, missing: str) -> None:
    empty = np.full_like(known.samples.gyr, np.nan)
    assert warnings(replace(known.samples, mag=None, **{missing: empty})) == set()


def test_what_cannot_be_right_is_asked_about_unless_it_was_confirmed(known: Known) -> None:
    found = check_samples([replace(known.samples, acc=known.samples.acc / 9.80665)])
    with pytest.raises(InputError, match=r"sensor 'imu'.*looks like g taken.*--unit acc=UNIT"):
        refuse_contradictions("imu", found)
    refuse_contradictions("imu", found, {"acc"})


@pytest.mark.parametrize("seed", [38, 80])
def test_a_bias_of_one_is_not_gravity_in_g(seed: int):
    (removed,) = (fault for fault in FAULTS if fault.name == "acc: gravity removed")
    without = removed.put(simulated(seed).samples)
    told = {found.code: found for found in check_samples([without])}
    assert told["consistency.no_gravity"].values["norm_m_s2"] == pytest.approx(1, abs=0.02)
    assert "consistency.acc_unit" not in told
