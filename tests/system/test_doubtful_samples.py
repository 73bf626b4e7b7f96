"""Doubtful samples from a recording to its results: a dropout costs what lost packets cost, however
it was written, and is in no mean; nothing odd makes numpy warn on a terminal.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.io

from testbench.consistency.doubtful import Belief, doubts_on
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.frames import NANOSECONDS
from testbench.records.session.manifest import FullScale
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.specs.exclusion import Exclusion
from testbench.records.specs.protocol import Analysis, Estimation
from testbench.reporting.report import report
from tests.benchmarks.long_recordings import orientation
from tests.conftest import FakeClock

RATE, SECONDS = 100.0, 60.0
GAP = slice(3500, 3620)
"""While the sensor turns."""


def samples_of() -> tuple[ImuSamples, Truth]:
    """Twenty seconds of rest, then hand-held motion."""
    rng = np.random.default_rng(2)
    index = np.arange(int(RATE * SECONDS))
    time = index / RATE
    turned = orientation(time, 3)
    gyr = (orientation(time - 1 / RATE, 3).inv() * turned).as_rotvec() * RATE
    gyr += 0.003 * rng.standard_normal(gyr.shape)
    acc = turned.inv().apply([0, 0, 9.80665]) + 0.02 * rng.standard_normal(gyr.shape)
    mag = turned.inv().apply([0, 20.0, -40.0]) + 0.2 * rng.standard_normal(gyr.shape)
    stamps = np.round(time * NANOSECONDS).astype(np.int64)
    fine = np.zeros(len(index), dtype=bool)
    samples = ImuSamples(stamps, stamps, gyr, acc, mag, None, index, fine)
    return samples, Truth(stamps[::2], turned.as_quat(scalar_first=True)[::2])


def with_rows(samples: ImuSamples, rows: slice, value: float, *keys: str) -> ImuSamples:
    columns = {key: getattr(samples, key).copy() for key in keys}
    for column in columns.values():
        column[rows] = value
    return replace(samples, **columns)


def lost(samples: ImuSamples, rows: slice) -> ImuSamples:
    kept = np.delete(np.arange(len(samples)), rows)
    columns = {key: column for key, column in vars(samples).items() if column is not None}
    return ImuSamples.from_groups({key: column[kept] for key, column in columns.items()})


def judged(folder, clock, samples: ImuSamples, truth: Truth | None, details, **settings):
    """A session of samples, written to a folder, with its estimate and evaluation."""
    filters = ["vqf_6d", "vqf_9d", "madgwick_imu", "mekf"]
    own = Estimation(filters=filters, align="motion", calibrate="none", **settings)
    sensor = ImportedSensor([samples], RATE, "made up", truth, details)
    recording = Recording("odd", "odd", {"imu": sensor}, Analysis(estimate=own))
    session = write_recording(recording, [folder.parent / "a.csv"], "made up", folder, clock)
    estimated = estimate(session)
    return session, estimated, evaluate(session, estimated)


@pytest.fixture
def evaluated(tmp_path, clock):
    """Writes a session of samples, and gives it with its estimate and evaluation."""

    def run(samples: ImuSamples, truth: Truth | None = None, details=None, **settings):
        folder = tmp_path / f"s{len(list(tmp_path.iterdir()))}"
        return judged(folder, clock, samples, truth, details or {}, **settings)

    return run


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> dict[str, float]:
    """Errors where no sample is doubtful, by filter [deg]."""
    folder = tmp_path_factory.mktemp("clean") / "session"
    return errors(judged(folder, FakeClock(), *samples_of(), {})[2])


def errors(evaluation) -> dict[str, float]:
    return {row.filter: row.total_rmse_deg for row in evaluation.orientation}


def test_a_dropout_costs_what_lost_packets_cost_however_it_was_written(evaluated, clean):
    samples, truth = samples_of()
    everything = ("gyr", "acc", "mag")
    ways = {
        "lost": lost(samples, GAP),
        "nan": with_rows(samples, GAP, np.nan, *everything),
        "zeros": with_rows(samples, GAP, 0.0, *everything),
    }
    for way, spoilt in ways.items():
        _, estimated, evaluation = evaluated(spoilt, truth)
        sensor = estimated.sensors["imu"]
        assert (~sensor.flagged).sum() == GAP.start, way  # a heading is lost for good after 1.2 s
        assert sensor.flagged[-1]
        assert not (sensor.static & ~sensor.flagged)[GAP.start :].any()
        for key, error in errors(evaluation).items():
            assert error < 1.1 * clean[key] + 0.2, (way, key)


@pytest.mark.parametrize("keys", [("gyr", "acc", "mag"), ("acc",), ("mag",), ("gyr",)])
def test_a_short_dropout_is_bridged_and_only_its_own_samples_are_left_out(evaluated, clean, keys):
    samples, truth = samples_of()
    short = slice(3500, 3515)
    _, estimated, evaluation = evaluated(with_rows(samples, short, 0.0, *keys), truth)
    sensor = estimated.sensors["imu"]
    assert np.flatnonzero(sensor.flagged).tolist() == list(range(3500, 3515))
    assert sensor.quality["zeros"] == 15
    (told,) = [found for found in evaluation.findings if found.code == "samples.zeros"]
    assert told.values["count"] == 15 and "keep: [zeros]" in told.remedy
    for key, error in errors(evaluation).items():
        assert error < 1.1 * clean[key] + 0.2, key


def test_filters_go_on_by_the_gyroscope_where_the_force_is_missing_for_long(evaluated):
    samples, truth = samples_of()
    _, estimated, evaluation = evaluated(with_rows(samples, slice(3500, 3800), 0.0, "acc"), truth)
    sensor = estimated.sensors["imu"]
    assert sensor.flagged.sum() == 300 + 101  # and a second to settle; the heading is not lost
    assert errors(evaluation)["vqf_6d"] < 1.0


def test_a_mean_at_rest_counts_no_zeros(evaluated):
    samples, truth = samples_of()
    spoilt = with_rows(samples, slice(200, 250), 0.0, "gyr", "acc", "mag")
    _, estimated, evaluation = evaluated(spoilt, truth)
    assert not any(found.code == "rest.norm" for found in estimated.sensors["imu"].findings)
    assert not estimated.sensors["imu"].static[200:250].any()
    means = np.array([row.mean for row in evaluation.noise if row.quantity == "acc"])
    assert len(means) == 3 and np.linalg.norm(means) == pytest.approx(1000.0, rel=0.01)  # mg


def test_what_is_excluded_is_left_out_with_its_reason(evaluated):
    samples, truth = samples_of()
    out = [
        Exclusion(from_s=35.0, to_s=35.1, reason="cable touched", sensors=["imu"]),
        Exclusion(from_s=45.0, to_s=45.1, reason="of another", sensors=["other"]),
    ]
    _, estimated, evaluation = evaluated(samples, truth, exclude=out)
    assert np.flatnonzero(estimated.sensors["imu"].flagged).tolist() == list(range(3500, 3511))
    (told,) = [found for found in evaluation.findings if found.code.startswith("samples.")]
    assert told.code == "samples.excluded" and "cable touched" in told.sentence


def test_a_stated_full_scale_marks_what_reaches_it(evaluated):
    samples, truth = samples_of()
    limit = 0.8 * float(np.abs(samples.gyr).max())
    cut = replace(samples, gyr=np.clip(samples.gyr, -limit, limit))
    where = (np.abs(samples.gyr) >= limit).any(axis=1)
    details = {"full_scale": {"gyr_rad_s": limit}}
    session, estimated, _ = evaluated(cut, truth, details)
    assert session.manifest.sensors["imu"].full_scale == FullScale(gyr_rad_s=limit)
    assert estimated.sensors["imu"].flagged[where].all()
    assert estimated.sensors["imu"].quality["saturated"] >= where.sum()


def _without(*keys: str) -> Callable[[ImuSamples], ImuSamples]:
    return lambda samples: with_rows(samples, slice(None), np.nan, *keys)


def _first(count: int, at: int = 0) -> Callable[[ImuSamples], ImuSamples]:
    return lambda samples: lost(lost(samples, slice(at + count, None)), slice(0, at))


def _infinite(samples: ImuSamples) -> ImuSamples:
    spoilt = with_rows(samples, slice(3500, 3510), np.inf, "acc", "gyr")
    return with_rows(spoilt, slice(4000, 4001), -np.inf, "mag")


ODD = {
    "accelerometer alone": _without("gyr", "mag"),
    "gyroscope alone": _without("acc", "mag"),
    "no field": _without("mag"),
    "infinite": _infinite,
    "absurd": lambda samples: with_rows(samples, slice(3500, 3510), -1e300, "acc"),
    "zeros throughout": lambda samples: with_rows(samples, slice(None), 0.0, "gyr", "acc", "mag"),
    "ten at rest": _first(10),
    "ten in motion": _first(10, 3500),
    "a rest of a sample": _first(60, 3500),
}


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize("known", [True, False], ids=["truth", "no truth"])
def test_nothing_odd_makes_numpy_warn(evaluated, kind, known):
    samples, truth = samples_of()
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        session, estimated, evaluation = evaluated(ODD[kind](samples), truth if known else None)
        estimated.save(session.path)
        evaluation.save(session.path)
        report(session)


def test_case_18_a_dropout_written_as_zeros(cases, tmp_path, clock):
    folder = cases / "18_dropout_written_as_zeros"
    options = Options(str(folder / "map.yaml"))
    files = [folder / "data.csv"]
    session = import_recording("generic", files, tmp_path / "s", clock, options)
    estimated = estimate(session)
    assert estimated.sensors["imu"].quality["zeros"] == 20
    assert errors(evaluate(session, estimated))["vqf_6d"] < 1.6  # 1.41 without the dropout


def test_case_23_an_accelerometer_alone(cases, tmp_path, clock):
    folder = cases / "23_accelerometer_only_warnings"
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        options = Options(str(folder / "map.yaml"))
        files = [folder / "data.csv"]
        session = import_recording("generic", files, tmp_path / "s", clock, options)
        evaluate(session, estimate(session))


REAL = {
    "12_undisturbed_slow_translation_C.mat": {"stuck": 70},
    "26_disturbed_phone_vibration_A.mat": {"stuck": 5},
}
"""What trials of BROAD show: gyroscope, accelerometer and magnetometer repeat the same sample for
0.25 s, and for 6 samples in a fast turn.
"""


def test_real_recordings_raise_only_what_they_show(data):
    for file in sorted((data / "broad").glob("*.mat")):
        trial = scipy.io.loadmat(file)
        readings = [np.ascontiguousarray(trial[f"imu_{key}"]) for key in ("gyr", "acc", "mag")]
        assert doubted(*readings) == REAL.get(file.name, {}), file.name
    gyr, acc = (np.loadtxt(data / "imu_tk" / f"xsens_{key}.mat")[:, 1:] for key in ("gyro", "acc"))
    assert doubted((gyr - 32768) / 2000, (acc - 32768) / 400) == {}
    walk = np.loadtxt(data / "xio_walk" / "short_walk.csv", delimiter=",", skiprows=1)
    assert doubted(np.radians(walk[:, 1:4]), 9.80665 * walk[:, 4:7]) == {}
    feet = np.loadtxt(data / "gaitmap" / "imu_sample.csv", delimiter=",", skiprows=2)[:, 1:]
    for foot in (0, 1):  # titles: acc_x of the left, acc_x of the right, acc_y of the left, ...
        assert doubted(np.radians(feet[:, 6 + foot :: 2]), feet[:, foot:6:2]) == {}


def doubted(gyr: np.ndarray, acc: np.ndarray, mag: np.ndarray | None = None) -> dict[str, int]:
    """Doubtful samples by reason."""
    stamps = np.arange(len(gyr)) * 5_000_000
    fine = np.zeros(len(gyr), dtype=bool)
    samples = ImuSamples(stamps, stamps, gyr, acc, mag, None, np.arange(len(gyr)), fine)
    flags = doubts_on(samples, Belief()).flags
    return {reason: int(flag.sum()) for reason, flag in flags.items()}
