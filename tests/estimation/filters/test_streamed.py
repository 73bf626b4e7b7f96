"""Filters that are given samples as they come say what they say of the whole."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.filters import get_filter
from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.filters.streamed import StreamedFilters, joined
from testbench.model import rotation
from testbench.records.session.samples import ImuSamples

RATE = 100.0


def turning(count: int, magnetometer: bool = False) -> ImuSamples:
    """A sensor that turns about a level axis and back, without noise."""
    time = np.arange(count) / RATE
    angle, rate = np.sin(time), np.cos(time)
    q = rotation.from_euler("XYZ", np.column_stack([angle, 0 * angle, 0 * angle]))
    acc = rotation.rotate(rotation.conjugate(q), np.tile([0.0, 0.0, 9.81], (count, 1)))
    gyr = np.column_stack([rate, 0 * rate, 0 * rate])
    stamps = np.round(time * 1e9).astype(np.int64)
    field = rotation.rotate(rotation.conjugate(q), np.tile([0.0, 20.0, -40.0], (count, 1)))
    mag = field if magnetometer else None
    none = np.zeros(count, dtype=bool)
    return ImuSamples(stamps, stamps, gyr, acc, mag, None, np.arange(count), none)


def streamed(filters: StreamedFilters, samples: ImuSamples, size: int) -> tuple[ImuSamples, dict]:
    parts, found = [], []
    for begin in range(0, len(samples), size):
        ready, q = filters.take(samples.rows(slice(begin, begin + size)))
        if ready is not None:
            parts.append(ready)
            found.append(q)
    return joined(parts), {k: np.concatenate([q[k] for q in found]) for k in found[0]}


@pytest.mark.parametrize("size", [1, 10, 1000])
def test_chunks_give_what_the_whole_gives(size: int) -> None:
    samples = turning(400)
    own, q = streamed(StreamedFilters([get_filter("vqf_6d"), get_filter("fusion")]), samples, size)
    np.testing.assert_array_equal(own.device_time_ns, samples.device_time_ns)
    for name in ("vqf_6d", "fusion"):
        whole = get_filter(name).run(UniformSamples(1 / RATE, samples.gyr, samples.acc))
        np.testing.assert_allclose(q[name], whole, atol=1e-9)


def test_what_looks_ahead_or_needs_what_is_not_there_is_left_out() -> None:
    kinds = [get_filter(name) for name in ("vqf_offline", "vqf_9d", "device", "vqf_6d")]
    filters = StreamedFilters(kinds)
    assert filters.take(turning(200))[1].keys() == {"vqf_6d"}
    assert filters.names == ["vqf_6d"]
    with_field = StreamedFilters(kinds)
    with_field.take(turning(200, magnetometer=True))
    assert with_field.names == ["vqf_9d", "vqf_6d"]


def test_lost_samples_cost_no_time_and_after_a_long_gap_filters_begin_anew() -> None:
    samples = turning(1000)
    kept = np.ones(1000, dtype=bool)
    kept[300:305] = False
    filters = StreamedFilters([get_filter("gyro")])
    _, q = streamed(filters, samples.rows(kept), 50)
    _, whole = streamed(StreamedFilters([get_filter("gyro")]), samples, 50)
    apart = rotation.angle(rotation.multiply(rotation.conjugate(whole["gyro"][kept]), q["gyro"]))
    assert np.degrees(apart.max()) < 0.2
    assert filters.begun == 1
    kept[500:700] = False
    filters = StreamedFilters([get_filter("gyro")])
    streamed(filters, samples.rows(kept), 50)
    assert filters.begun == 2
