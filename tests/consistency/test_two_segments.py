"""Segments that swing and are waved about: their accelerations last as long as their turns do."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.records.findings.finding import Severity
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import check_samples
from tests.system import two_segments


def recorded(scene: two_segments.Scene, name: str, seed: int) -> ImuSamples:
    read = two_segments.readings(scene, name, seed)
    time_ns = np.round(read["t"] * 1e9).astype(np.int64)
    index = np.arange(len(time_ns))
    sound = np.zeros(len(index), dtype=bool)
    return ImuSamples(time_ns, time_ns, read["gyr"], read["acc"], None, None, index, sound)


def warned(samples: ImuSamples) -> set[str]:
    return {
        one.code.removeprefix("consistency.")
        for one in check_samples([samples])
        if one.severity is Severity.WARNING
    }


@pytest.mark.parametrize(
    ("kind", "seed", "size", "most_hz"),
    [
        ("stick", 2, 0.8, 0.6),
        ("stick", 1, 0.3, 0.5),
        ("pendulum", 2, 0.9, 0.8),
        ("pendulum", 1, 0.5, 1.5),
    ],
)
def test_right_axes_and_scales_are_not_doubted(monkeypatch, kind, seed, size, most_hz) -> None:
    """The four were: a bias of slow turning, and an axis that was put along gravity."""
    waves = two_segments.waves
    monkeypatch.setattr(
        two_segments, "waves", lambda rng, time, *_: waves(rng, time, size, most_hz)
    )
    scene = getattr(two_segments, kind)(seed)
    for name in scene.segments:
        assert warned(recorded(scene, name, seed)) == set(), name


def test_a_wrong_unit_of_a_stick_is_named_all_the_same() -> None:
    samples = recorded(two_segments.stick(0), "lower", 0)
    wrong = ImuSamples(**{**vars(samples), "gyr": np.degrees(samples.gyr)})
    assert "gyr_unit" in warned(wrong)
