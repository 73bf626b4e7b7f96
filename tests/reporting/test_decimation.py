"""Decimation keeps every extreme and every gap."""

from __future__ import annotations

import numpy as np

from testbench.reporting.page.decimation import Envelope


def test_short_signals_stay_as_they_are() -> None:
    envelope = Envelope(np.arange(10.0))
    assert np.array_equal(envelope(np.arange(10.0) ** 2), np.arange(10.0) ** 2)


def test_a_single_peak_survives() -> None:
    time, value = np.arange(100_000) * 0.01, np.zeros(100_000)
    value[54_321] = 7.0
    envelope = Envelope(time, points=1000)
    reduced = envelope(value)
    assert len(reduced) == len(envelope.time) == 1000
    assert reduced.max() == 7.0
    assert abs(envelope.time[np.argmax(reduced)] - 543.21) < 2.0


def test_each_span_gives_its_lowest_and_highest_value() -> None:
    time = np.arange(6000.0)
    value = np.random.default_rng(3).normal(size=6000)
    reduced = Envelope(time, points=200)(value).reshape(-1, 2)
    spans = np.array_split(value, 100)
    # Spans are equal in time, not in samples: an edge may fall one sample off.
    assert np.mean(reduced[:, 0] == [span.min() for span in spans]) > 0.9
    assert np.mean(reduced[:, 1] == [span.max() for span in spans]) > 0.9


def test_samples_that_do_not_count_leave_a_gap() -> None:
    keep = np.ones(10_000, dtype=bool)
    keep[2000:4000] = False
    value = np.where(keep, 1.0, 1e6)
    envelope = Envelope(np.arange(10_000.0), keep, points=500)
    reduced = envelope(value)
    inside = (envelope.time > 2050) & (envelope.time < 3950)
    assert np.isnan(reduced[inside]).all()
    assert np.nanmax(reduced) == 1.0


def test_times_with_holes_are_drawn_as_holes() -> None:
    time = np.concatenate([np.arange(0.0, 5000.0), np.arange(20_000.0, 25_000.0)])
    reduced = Envelope(time, points=500)(np.ones(10_000))
    assert np.isnan(reduced).mean() > 0.5
