"""Doubtful samples: every fault put in at random is flagged where it is, and sound recordings, of
any part at rest or in motion, raise nothing.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from testbench.consistency.doubtful import (
    CLIPPED,
    CLIPPED_RATE,
    SATURATED,
    SPIKE,
    STUCK,
    STUCK_AXIS,
    ZEROS,
    Belief,
    Gates,
    doubts_on,
    without,
)
from testbench.consistency.traits import Traits
from testbench.frames import NANOSECONDS
from testbench.model.imu import TriadModel
from testbench.records.session.manifest import FullScale
from testbench.records.session.samples import ImuSamples
from testbench.records.specs.exclusion import Exclusion
from testbench.records.specs.sensor import list_presets, load_preset
from tests.benchmarks.long_recordings import orientation
from tests.estimation.assessed import assess

SECONDS, RESTS = 60.0, ((0.0, 6.0), (25.0, 33.0))
NOISY = [preset for preset in list_presets() if preset != "ideal"]


@cache
def recorded(preset: str, seed: int = 0, rate: float = 100.0) -> ImuSamples:
    """A part carried about by hand, with rests, by its data sheet."""
    sheet = load_preset(preset)
    index = np.arange(int(SECONDS * rate))
    time = index / rate
    still = np.zeros(len(index), dtype=bool)
    for begin, end in RESTS:
        still |= (time >= begin) & (time < end)
    # time stands still in a rest, and comes to it and goes on smoothly
    speed = np.convolve(np.pad(~still, 25, mode="edge"), np.hanning(51) / 25, mode="valid")
    at = np.cumsum(speed) / rate
    turned = orientation(at, seed)
    gyr = np.zeros((len(index), 3))
    gyr[1:] = (turned[:-1].inv() * turned[1:]).as_rotvec() * rate
    shake = 4.0 * np.sin(np.outer(at, [5.1, 6.3, 4.2]) * 2) * speed[:, None]
    acc = turned.inv().apply(np.array([0.0, 0.0, 9.80665]) + shake)
    mag = turned.inv().apply([0.0, 24.0, -39.0])
    triads = {"acc": (sheet.accelerometer, acc), "gyr": (sheet.gyroscope, gyr)}
    if sheet.magnetometer is not None:
        triads["mag"] = sheet.magnetometer, mag
    read = {
        key: TriadModel(own.triad(), rate, seed, key).measure(x) for key, (own, x) in triads.items()
    }
    saturated = np.logical_or.reduce([marks for _, marks in read.values()])
    stamps = np.round(time * NANOSECONDS).astype(np.int64)
    columns = {key: readings for key, (readings, _) in read.items()}
    return ImuSamples(
        device_time_ns=stamps,
        host_time_ns=stamps,
        counter=index,
        saturated=saturated,
        device_q=None,
        **({"mag": None} | columns),
    )


def changed(samples: ImuSamples, **columns: np.ndarray) -> ImuSamples:
    return replace(samples, **columns)


def places(rng: np.random.Generator, count: int, longest: int, shortest: int = 8) -> list[slice]:
    """Some stretches that do not touch one another."""
    starts = rng.choice(np.arange(2, count // 200 - 1), 6, replace=False) * 200
    return [slice(start, start + int(rng.integers(shortest, longest))) for start in starts]


def spoilt(samples: ImuSamples, kind: str, keys: tuple[str, ...], rng: np.random.Generator):
    """The samples with a fault in some triads, and where it is."""
    where = np.zeros(len(samples), dtype=bool)
    columns = {key: getattr(samples, key).copy() for key in keys}
    for place in places(rng, len(samples), 9 if kind in {"spike", "absurd", "inf"} else 150):
        if kind in {"spike", "absurd", "inf"}:
            place = slice(place.start, place.start + 1)
        for key, column in columns.items():
            if kind == "zeros":
                column[place] = 0.0
            elif kind == "stuck":
                column[place] = column[place.start - 1]
            else:
                usual = {"gyr": np.radians(2000.0), "acc": 156.0, "mag": 1200.0}[key]
                value = {"spike": usual, "absurd": 1e300, "inf": np.inf}[kind]
                column[place, rng.integers(3)] = value * rng.choice([-1, 1])
        where[place] = True
    return changed(samples, **columns), where


TRIADS = [("gyr",), ("acc",), ("mag",), ("gyr", "acc"), ("gyr", "acc", "mag")]


@pytest.mark.parametrize("kind", ["zeros", "stuck", "spike", "absurd", "inf"])
def test_a_fault_put_in_anywhere_is_flagged_there_and_nowhere_else(kind):
    rng = np.random.default_rng(7)
    faulty = found = wrong = 0
    for seed, preset in enumerate(NOISY):
        for keys in TRIADS:
            samples = recorded(preset, seed)
            own = tuple(key for key in keys if getattr(samples, key) is not None)
            if not own:
                continue
            spoilt_samples, where = spoilt(samples, kind, own, rng)
            flagged = doubts_on(spoilt_samples, Belief()).flagged
            faulty, found = faulty + where.sum(), found + (flagged & where).sum()
            near = where.copy()
            if kind == "stuck":  # a coarse part may have read the same just before or after
                near[1:] |= where[:-1]
                near[:-1] |= where[1:]
            wrong += (flagged & ~near & ~samples.saturated).sum()
    assert found >= 0.98 * faulty
    assert wrong == 0


def reasons(samples: ImuSamples, belief: Belief | None = None) -> dict[str, int]:
    """Flagged samples by reason, but for those that the sensor marks itself."""
    doubts = doubts_on(samples, belief or Belief())
    counts = {reason: int(flag.sum()) for reason, flag in doubts.flags.items()}
    return {reason: count for reason, count in counts.items() if reason != SATURATED}


@pytest.mark.parametrize("preset", list_presets())
@pytest.mark.parametrize("rate", [50.0, 400.0])
def test_a_sound_recording_of_every_part_raises_nothing(preset, rate):
    model = load_preset(preset).accelerometer.triad().noise_density.any()
    belief = Belief(has_noise=bool(model))
    for seed in range(3):
        assert reasons(recorded(preset, seed, rate), belief) == {}


@pytest.mark.parametrize("counts", [1, 4, 20, 1000])
def test_a_coarse_reading_that_repeats_at_rest_is_no_frozen_one(counts):
    """From a gyroscope that reads 0 most of the time to one that resolves its noise."""
    samples = recorded("xsens_dot", 3)
    noise = np.std(samples.gyr[50:500], axis=0).mean()
    coarse = {
        "gyr": np.round(samples.gyr / noise * counts / 4) * noise * 4 / counts,
        "acc": np.round(samples.acc * counts * 4) / counts / 4,
        "mag": np.round(samples.mag * counts) / counts,
    }
    assert reasons(changed(samples, **coarse)) == {}


def test_a_rest_of_counts_is_none_of_clipped_or_frozen_readings():
    """As imu_tk's: 16 bits, one axis after the other along gravity, few distinct values."""
    rng = np.random.default_rng(0)
    gravity = np.repeat(9.81 * np.vstack([np.eye(3), -np.eye(3)]), 1000, axis=0)
    acc = np.round((gravity + 0.02 * rng.standard_normal(gravity.shape)) * 400) / 400
    gyr = np.round(0.004 * rng.standard_normal(gravity.shape) * 400) / 400
    stamps = np.arange(len(acc)) * 10_000_000
    nothing = np.zeros(len(acc), dtype=bool)
    samples = ImuSamples(stamps, stamps, gyr, acc, None, None, np.arange(len(acc)), nothing)
    assert reasons(samples) == {}


@pytest.mark.parametrize(("key", "times"), [("mag", 4), ("mag", 10), ("gyr", 2)])
def test_a_quantity_of_a_lower_rate_is_told_and_not_called_frozen(key, times):
    samples = recorded("xsens_dot", 1)
    held = np.repeat(getattr(samples, key)[::times], times, axis=0)[: len(samples)]
    seldom = getattr(samples, key).copy()
    seldom[np.arange(len(seldom)) % times > 0] = np.nan
    for column in (held, seldom):
        gates = Gates(Traits().add(changed(samples, **{key: column})), Belief())
        assert gates.slower() == {key: pytest.approx(times, rel=0.03)}
        assert reasons(changed(samples, **{key: column})) == {}
    given = without(
        changed(samples, **{key: held}),
        doubts_on(changed(samples, **{key: held}), Belief()).unknown,
        for_filters=True,
    )
    new = np.isfinite(getattr(given, key)).all(axis=1)
    assert new.mean() == pytest.approx(1 / times if key == "mag" else 1.0, abs=0.01)


def test_a_magnetometer_of_a_lower_rate_that_drops_out_is_still_found_out():
    samples = recorded("xsens_dot", 1)
    held = np.repeat(samples.mag[::4], 4, axis=0)
    held[2000:2400] = held[1999]
    counts = reasons(changed(samples, mag=held))
    assert counts.keys() == {STUCK} and counts[STUCK] == pytest.approx(400, abs=4)


def test_a_number_that_fills_a_dropout_is_none_of_the_readings_and_a_held_one_is():
    samples = recorded("xsens_dot", 3)
    filled, held = samples.gyr.copy(), samples.gyr.copy()
    held[1000:1060] = held[1000]
    for filler in (-7.0, -0.5):  # the larger one is no end of a range, for all axes repeat it
        filled[1000:1060] = filler
        assert reasons(changed(samples, gyr=filled)) == {STUCK: 60}
    assert reasons(changed(samples, gyr=held)) == {STUCK: 59}


@pytest.mark.parametrize("key", ["gyr", "acc"])
def test_readings_cut_off_at_a_range_are_found_without_a_status_bit(key):
    samples = recorded("xsens_dot", 2)
    column = getattr(samples, key) * (4.0 if key == "acc" else 3.0)
    limit = 0.6 * np.abs(column).max()
    cut = np.clip(column, -limit, limit)
    where = (np.abs(column) >= limit).any(axis=1)
    name = {"acc": "acc_m_s2", "gyr": "gyr_rad_s"}[key]
    for belief in (Belief(), Belief(full_scale=FullScale(**{name: limit}))):
        doubts = doubts_on(changed(samples, **{key: cut}), belief)
        flagged = doubts.flags.get(CLIPPED, doubts.flags.get(SATURATED))
        assert (flagged & where).sum() >= 0.98 * where.sum()
        assert (flagged & ~where).sum() <= 0.02 * where.sum()
    beyond = FullScale(**{name: 2 * limit})
    assert reasons(changed(samples, **{key: cut}), Belief(full_scale=beyond)) == {}
    assert reasons(changed(samples, **{key: cut}), Belief(keep=frozenset({"clipped"}))) == {}


def test_a_clipped_rate_is_a_bound_that_filters_get_and_statistics_do_not():
    samples = recorded("xsens_dot", 2)
    cut = changed(samples, gyr=np.clip(3 * samples.gyr, -2.5, 2.5))
    doubts = doubts_on(cut, Belief())
    clipped = doubts.flags[CLIPPED]
    assert clipped.sum() > 10 and (doubts.unknown[clipped] == CLIPPED_RATE).all()
    assert np.isnan(without(cut, doubts.unknown).gyr[clipped]).all()
    np.testing.assert_array_equal(without(cut, doubts.unknown, for_filters=True).gyr, cut.gyr)


def test_what_a_person_vouches_for_stays_in_and_what_a_person_takes_out_goes():
    samples = recorded("xsens_dot", 4)
    acc = samples.acc.copy()
    acc[1000:1100] = 0.0
    acc[2000:2040] = acc[2000]
    acc[3000, 1] = 150.0
    spoilt_samples = changed(samples, acc=acc)
    assert reasons(spoilt_samples) == {ZEROS: 100, STUCK: 39, SPIKE: 1}
    kept = Belief(keep=frozenset({"zeros", "stuck", "spike"}))
    assert reasons(spoilt_samples, kept) == {}
    out = Belief(exclude=[Exclusion(from_s=40.0, to_s=41.0, reason="cable touched")])
    assert reasons(samples, out) == {"excluded: cable touched": 101}


def test_a_triad_that_never_measured_is_not_used_and_named():
    samples = recorded("xsens_dot", 5)
    rest = np.zeros(len(samples), dtype=bool)
    for column in (np.zeros((len(samples), 3)), np.tile([20.0, 3.0, -40.0], (len(samples), 1))):
        quality, known = assess(changed(samples, mag=column), rest)
        assert not quality.flagged[~samples.saturated].any()
        assert known.mag is not None and np.isnan(known.mag).all()
        assert any("magnetometer reads the same" in str(found) for found in quality.findings)


@pytest.mark.parametrize("value", [0.0, 0.3], ids=["zero", "constant"])
@pytest.mark.parametrize("key", ["gyr", "acc"])
def test_an_axis_that_never_measured_is_named_and_its_triad_not_used(key, value):
    samples = recorded("xsens_dot", 5)
    column = getattr(samples, key).copy()
    column[:, 1] = value
    quality, known = assess(changed(samples, **{key: column}), np.zeros(len(samples), dtype=bool))
    assert np.isnan(getattr(known, key)).all()
    (found,) = [one for one in quality.findings if one.code == "samples.dead_axis"]
    assert found.values["axes"] == ["y"]


@pytest.mark.parametrize("key", ["gyr", "acc", "mag"])
def test_two_axes_that_hold_the_same_numbers_are_named_and_their_triad_not_used(key):
    samples = recorded("xsens_dot", 5)
    column = getattr(samples, key).copy()
    column[:, 1] = column[:, 2]
    quality, known = assess(changed(samples, **{key: column}), np.zeros(len(samples), dtype=bool))
    assert np.isnan(getattr(known, key)).all()
    (found,) = [one for one in quality.findings if one.code == "samples.twin_axes"]
    assert found.values["axes"] == ["y", "z"]
    column[100, 1] += 0.01
    assert not Gates(Traits().add(changed(samples, **{key: column})), Belief()).twin_axes


def test_a_reading_at_the_end_of_a_small_range_is_a_spike_among_slow_turns():
    samples = recorded("xsens_dot", 5)
    gyr = samples.gyr.copy()
    gyr[[2000, 2300], 1] = np.radians([250.0, -250.0]) + np.sign([1, -1])
    assert reasons(changed(samples, gyr=gyr)) == {SPIKE: 2}


@pytest.mark.parametrize("value", [0.0, None], ids=["zero", "frozen"])
@pytest.mark.parametrize("key", ["gyr", "acc", "mag"])
def test_an_axis_that_freezes_while_others_move_is_flagged_there(key, value):
    samples = recorded("mpu6050" if key == "gyr" else "xsens_dot", 5)
    column, place = getattr(samples, key).copy(), slice(1200, 1500)
    column[place, 2] = column[1199, 2] if value is None else value
    spoiled = changed(samples, **{key: column})
    flags = doubts_on(spoiled, Belief()).flags
    assert set(flags) - {SATURATED} == {STUCK_AXIS}
    rows = np.flatnonzero(flags[STUCK_AXIS])
    assert abs(rows[0] - 1200) <= 1 and rows[-1] == 1499 and len(rows) >= 299
    assert reasons(spoiled, Belief(keep=frozenset({"stuck"}))) == {}


def test_a_board_that_froze_for_all_of_the_recording_is_flagged_throughout():
    samples = recorded("xsens_dot", 5)
    still = {key: np.tile(getattr(samples, key)[:1], (500, 1)) for key in ("gyr", "acc", "mag")}
    few = {key: getattr(samples, key)[:500] for key in ("device_time_ns", "counter", "saturated")}
    frozen = changed(samples, host_time_ns=few["device_time_ns"], **few, **still)
    assert reasons(frozen) == {STUCK: 500}
    assert reasons(frozen, Belief(has_noise=False)) == {}


def test_a_unit_that_is_another_one_is_no_row_of_spikes():
    samples = recorded("xsens_dot", 6)
    assert reasons(changed(samples, mag=1000 * samples.mag)) == {}


def test_gates_see_the_same_in_pieces():
    rng = np.random.default_rng(3)
    samples = recorded("mpu6050_100hz", 7)
    for kind in ("zeros", "stuck"):
        faulty, _ = spoilt(samples, kind, ("gyr", "acc"), rng)
        traits, whole = Traits(), doubts_on(faulty, Belief()).flagged
        size = 777
        for begin in range(0, len(faulty), size):
            traits.add(rows(faulty, slice(begin, begin + size)))
        gates = Gates(traits, Belief())
        seen = np.zeros(len(faulty), dtype=bool)
        for begin in range(0, len(faulty), size):
            first = max(begin - gates.margin, 0)
            part = gates.doubt(rows(faulty, slice(first, begin + size + gates.margin))).flagged
            seen[begin : begin + size] = part[begin - first : begin - first + size]
        np.testing.assert_array_equal(seen, whole)


def rows(samples: ImuSamples, part: slice) -> ImuSamples:
    columns = {key: column for key, column in vars(samples).items() if column is not None}
    return ImuSamples.from_groups({key: column[part] for key, column in columns.items()})
