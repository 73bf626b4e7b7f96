"""After a long gap filters begin anew: what follows is as the same samples imported alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.signals import access
from testbench.frames import NANOSECONDS
from tests.conftest import FakeClock
from tests.system.test_doubtful_samples import errors, judged, lost, samples_of, with_rows

GAP = slice(2200, 2500)
ALL = ("gyr", "acc", "mag")


def alone(folder, rows: slice):
    """Errors of some rows as a recording of their own, over what a gap before would leave."""
    samples, truth = samples_of()
    own = samples.rows(rows)
    begin = own.device_time_ns[0]
    first = begin + NANOSECONDS if rows.start else begin
    known = truth.host_time_ns > first
    own = replace(own, device_time_ns=own.device_time_ns, counter=own.counter)
    held = replace(
        truth,
        q_world_from_sensor=np.where(known[:, None], truth.q_world_from_sensor, np.nan),
    )
    _, estimated, evaluation = judged(folder, FakeClock(), own, held, {})
    return estimated.sensors["imu"], errors(evaluation)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    return alone(tmp_path_factory.mktemp("fresh") / "session", slice(GAP.stop, None))


def spoilt_by(way: str):
    samples, truth = samples_of()
    return {
        "lost": lambda: lost(samples, GAP),
        "nan": lambda: with_rows(samples, GAP, np.nan, *ALL),
        "zeros": lambda: with_rows(samples, GAP, 0.0, *ALL),
        "no rates": lambda: with_rows(samples, GAP, np.nan, "gyr"),
        "counted": lambda: lost(samples, GAP),
        "uncounted": lambda: replace(
            lost(samples, GAP), counter=np.arange(len(samples) - GAP.stop + GAP.start)
        ),
    }[way](), truth


@pytest.mark.parametrize("way", ["lost", "nan", "zeros", "no rates", "uncounted"])
def test_the_error_after_a_gap_is_that_of_a_fresh_start(way, fresh, tmp_path):
    samples, truth = spoilt_by(way)
    _, estimated, evaluation = judged(tmp_path / "s", FakeClock(), samples, truth, {})
    sensor, expected = estimated.sensors["imu"], fresh[1]
    assert "gap.restarted" in {own.code for own in sensor.findings}
    # a second before the gap's end and after it apart, all is judged
    left = sensor.left_out.sum() - (0 if len(samples) < 6000 else GAP.stop - GAP.start)
    assert left == pytest.approx(101, abs=3)
    after = errors(evaluation)
    for key, error in expected.items():
        assert after[key] < 1.15 * error + 0.1, key
    assert not np.isnan(sensor.orientation["vqf_6d"]).any()


def test_a_filter_begins_as_it_does_with_the_rest_alone(fresh, tmp_path):
    """The inclination after the gap is that of the piece to the last bit but for the frames."""
    samples, truth = spoilt_by("lost")
    _, estimated, _ = judged(tmp_path / "s", FakeClock(), samples, truth, {})
    found, expected = estimated.sensors["imu"], fresh[0]
    count = len(expected.host_time_ns)
    for key in ("vqf_9d", "mekf", "madgwick_imu"):
        a, b = found.orientation[key][-count:], expected.orientation[key]
        # each step of the sensor in its own axes, which no frame changes but the mounting
        steps = [_angles(q) for q in (a, b)]
        np.testing.assert_allclose(*steps, atol=3e-5)  # by the clock that each fits


def _angles(q: np.ndarray) -> np.ndarray:
    """Between one orientation and the next, shape (n - 1,) [rad], by scipy."""
    turned = Rotation.from_quat(np.asarray(q, float), scalar_first=True)
    return (turned[:-1].inv() * turned[1:]).magnitude()


def test_the_heading_does_not_step_by_more_than_it_must(tmp_path):
    samples, _ = samples_of()
    gap = slice(600, 900)  # at rest
    _, estimated, _ = judged(tmp_path / "s", FakeClock(), lost(samples, gap), None, {})
    q = estimated.sensors["imu"].orientation["vqf_6d"]
    step = 2 * np.arccos(min(abs(float(q[gap.start] @ q[gap.start - 1])), 1.0))
    assert np.degrees(step) < 20  # what it turned meanwhile is not known


def test_pieces_of_a_long_recording_begin_anew_as_the_whole_does(tmp_path, monkeypatch):
    samples, truth = spoilt_by("lost")
    _, whole, _ = judged(tmp_path / "a", FakeClock(), samples, truth, {})
    monkeypatch.setattr(access, "MOST_KEPT", len(samples) - 1)
    monkeypatch.setattr(access, "PIECE", 700)
    _, pieces, _ = judged(tmp_path / "b", FakeClock(), samples, truth, {})
    one, other = whole.sensors["imu"], pieces.sensors["imu"]
    assert other.every == 2
    for key in ("mekf", "madgwick_imu"):
        a, b = one.orientation[key][1::2], other.orientation[key]
        turned = [Rotation.from_quat(np.asarray(x, float), scalar_first=True) for x in (a, b)]
        assert np.degrees((turned[0].inv() * turned[1]).magnitude()).max() < 0.5, key
    assert other.apart is not None and one.apart is not None
    assert (other.apart > 0).mean() == pytest.approx((one.apart > 0).mean(), abs=0.01)


@pytest.mark.parametrize("lengths", [(1, 1), (2, 3), (5, 9)])
def test_crumbs_between_gaps_stop_no_filter(lengths, tmp_path):
    samples, truth = samples_of()
    kept = np.r_[0:2000, 2200 : 2200 + lengths[0], 2400 : 2400 + lengths[1], 2600:4000, 4200:6000]
    _, estimated, evaluation = judged(tmp_path / "s", FakeClock(), samples.rows(kept), truth, {})
    sensor = estimated.sensors["imu"]
    assert all(np.isfinite(q).all() for q in sensor.orientation.values())
    assert sensor.left_out[2000 : 2000 + sum(lengths)].all()
    assert all(error < 3 for error in errors(evaluation).values())
    assert len(sensor.frames_apart) == 2


def test_without_a_truth_nothing_beyond_a_gap_is_compared(tmp_path):
    samples, _ = spoilt_by("lost")
    _, estimated, _ = judged(tmp_path / "s", FakeClock(), samples, None, {})
    sensor = estimated.sensors["imu"]
    assert sensor.flagged[GAP.start :].all() and not sensor.flagged[: GAP.start].any()
    assert sensor.apart is None
