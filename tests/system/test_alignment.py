"""Recordings of other laboratories: aligned wherever that is possible, and judged only there."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.formats.truth.attach import TruthOptions
from testbench.formats.truth.reference import reference_truth
from testbench.formats.vendors import broad
from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.results.estimate import Estimate
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.specs.protocol import Analysis, Estimation
from tests.system.two_segments import (
    DRIFT_PPM,
    FINE,
    RATE,
    export,
    pendulum,
    readings,
    reference,
    stick,
    write_orientations,
)


@pytest.fixture
def judge(tmp_path, clock):
    """Record a scene, change what the reference system says, estimate and evaluate."""

    def run(scene, change=None):
        time, orientations = reference(scene, 1)
        if change is not None:
            time, orientations = change(time, orientations)
        sensors = {}
        for i, name in enumerate(scene.segments):
            truth = reference_truth(
                name, np.round(1e9 * time).astype(np.int64), orientations[name], IDENTITY, None, []
            )
            samples = samples_of(readings(scene, name, 10 + i))
            sensors[name] = ImportedSensor([samples], RATE, "made up", truth)
        settings = Estimation(filters=["vqf_6d"], align="motion", calibrate="none")
        recording = Recording("lab", "a lab", sensors, Analysis(estimate=settings))
        folder = tmp_path / ("as it is" if change is None else "changed")
        session = write_recording(recording, [tmp_path / "a"], "lab", folder, clock)
        estimated = estimate(session)
        return session, estimated, evaluate(session, estimated)

    return run


IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def samples_of(read) -> ImuSamples:
    """Readings as samples, the arrival not known."""
    device = np.round(1e9 * read["t"]).astype(np.int64)
    count, clean = len(device), np.zeros(len(device), dtype=bool)
    host = device - device[0]
    return ImuSamples(device, host, read["gyr"], read["acc"], None, None, np.arange(count), clean)


@pytest.fixture
def judge_files(tmp_path, clock):
    """The same by way of CSV files and a mapping."""

    def run(scene, change=None, add=""):
        mapping, files = export(scene, tmp_path / "files", 1)
        if change is not None:
            write_orientations(tmp_path / "files" / "optical.csv", *change(*reference(scene, 1)))
        mapping.write_text(mapping.read_text() + add)
        session = import_recording(
            "generic", files, tmp_path / "session", clock, Options(str(mapping))
        )
        estimated = estimate(session, ["vqf_6d"])
        return session, estimated, evaluate(session, estimated)

    return run


@pytest.fixture(scope="module")
def sticks():
    """Two sticks with a ball joint."""
    return stick(3)


@pytest.fixture(scope="module")
def swinging():
    """A pendulum of two segments."""
    return pendulum(2)


def told(evaluation, where: str) -> dict[str, str]:
    """Findings on a sensor, by code."""
    return {own.code: str(own) for own in evaluation.findings if own.where == where}


def error_with_frames_known(scene, name: str, sensor) -> float:
    """RMS error of a filter whose world and mounting are known, but for the heading, [deg]."""
    fit = sensor.frames["vqf_6d"]
    tilt, mounting = (
        rotation.from_rotation_vector(np.radians(np.array(part)))
        for part in (fit.tilt_deg, fit.mounting_deg)
    )
    left = rotation.multiply(tilt, rotation.from_heading(np.radians(fit.heading_deg)))
    own = rotation.multiply(
        rotation.multiply(rotation.conjugate(left), sensor.orientation["vqf_6d"]), mounting
    )
    time = sensor.host_time_ns * 1e-9 + scene.apart
    inside = (time > scene.apart) & (time < scene.time[-1])
    rows = np.round(time[inside] * FINE).astype(int)
    segment = scene.segments[name]
    true = (segment.level_from_body * segment.body_from_sensor)[rows].as_quat(scalar_first=True)
    error = rotation.multiply(true, rotation.conjugate(own[inside]))
    heading = rotation.heading_angle(rotation.mean(error))
    left_over = rotation.multiply(rotation.conjugate(rotation.from_heading(heading)), error)
    return float(np.degrees(np.sqrt(np.mean(rotation.angle(left_over) ** 2))))


def relative_error(session, estimated) -> float:
    """RMS error of the orientation of the lower sensor against the upper one [deg]."""
    upper, lower = (estimated.sensors[name] for name in ("upper", "lower"))
    time = upper.host_time_ns
    true = [truth_at(session.truth(name), time) for name in ("upper", "lower")]
    known = np.isfinite(true[0][:, 0]) & np.isfinite(true[1][:, 0])
    found = rotation.interpolate(lower.host_time_ns, lower.orientation["vqf_6d"], time)
    pair = upper.orientation["vqf_6d"][known], found[known]
    difference = rotation.multiply(
        rotation.conjugate(rotation.multiply(rotation.conjugate(pair[0]), pair[1])),
        rotation.multiply(rotation.conjugate(true[0][known]), true[1][known]),
    )
    return float(np.degrees(np.sqrt(np.mean(rotation.angle(difference) ** 2))))


@pytest.mark.parametrize("kind", ["swinging", "sticks"])
def test_an_unknown_world_mounting_and_clock_cost_next_to_nothing(judge_files, kind, request):
    scene = request.getfixturevalue(kind)
    session, estimated, evaluation = judge_files(scene)
    for row in evaluation.orientation:
        sensor = estimated.sensors[row.sensor]
        expected = scene.apart * (1 + 1e-6 * DRIFT_PPM)
        assert abs(sensor.clock.offset_s - expected) < 3 * sensor.clock.offset_sd_s + 1e-3
        assert sensor.clock.drift_ppm == pytest.approx(DRIFT_PPM, abs=60)
        known = error_with_frames_known(scene, row.sensor, sensor)
        assert row.total_rmse_deg < 1.2 * known + 0.02
        assert sensor.frames["vqf_6d"].residual_deg == pytest.approx(row.total_rmse_deg, rel=0.05)
        assert "clock.shifted" in told(evaluation, row.sensor)
    assert {row.sensor for row in evaluation.orientation} == {"upper", "lower"}
    assert relative_error(session, estimated) < 1.5


def test_a_motion_about_one_axis_leaves_one_angle_which_is_named_and_not_judged(judge, swinging):
    _, estimated, evaluation = judge(swinging)
    for name, segment in swinging.segments.items():
        (direction,) = estimated.sensors[name].frames["vqf_6d"].undetermined
        swing = (segment.level_from_body[0].inv() * segment.level_from_body).as_rotvec()
        hinge = np.linalg.svd(swing, full_matrices=False)[2][0]
        axis = np.array(direction[:3]) / np.linalg.norm(direction[:3])
        assert abs(axis @ segment.body_from_sensor.inv().apply(hinge)) > 0.99
        assert "about one axis" in told(evaluation, name)["frames.undetermined"]
        assert "frames.up_undetermined" in told(evaluation, name)
        (row,) = (own for own in evaluation.orientation if own.sensor == name)
        assert np.isnan(row.heading_rmse_deg) and np.isnan(row.inclination_rmse_deg)
    assert np.isfinite([row.total_rmse_deg for row in evaluation.orientation]).all()
    parts = {own.part for own in evaluation.orientation_summary}
    assert parts == {"total"}


def test_a_level_world_is_kept_level_where_the_motion_does_not_tell(judge, swinging):
    scene = replace(swinging, world_from_level=Rotation.from_euler("Z", 1.0))
    _, estimated, evaluation = judge(scene)
    for name, segment in scene.segments.items():
        fit = estimated.sensors[name].frames["vqf_6d"]
        assert fit.held_by == "vertical" and fit.up_known
        found = Rotation.from_rotvec(np.radians(fit.mounting_deg))
        assert np.degrees((found * segment.body_from_sensor.inv()).magnitude()) < 3.0
        assert "where the z axis" in told(evaluation, name)["frames.undetermined"]
    assert all(np.isfinite(row.heading_rmse_deg) for row in evaluation.orientation)


def turned(q: np.ndarray, rows: np.ndarray, by: Rotation) -> np.ndarray:
    """Orientations of which some are of another body."""
    changed = q.copy()
    changed[rows] = (Rotation.from_quat(q[rows], scalar_first=True) * by).as_quat(scalar_first=True)
    return changed


def relabelled(after: float):
    """A reference that takes one body for another from some time on."""
    by = Rotation.from_euler("X", 50, degrees=True)

    def change(time, q):
        return time, q | {"lower": turned(q["lower"], time > after, by)}

    return change


def test_a_truth_that_steps_is_cut_and_what_is_too_short_is_left_out_and_counted(judge, sticks):
    _, estimated, evaluation = judge(sticks, relabelled(62))
    assert "truth.stepped" in told(evaluation, "lower")
    assert "truth.stepped" not in told(evaluation, "upper")
    assert "truth.aligned_apart" not in told(evaluation, "lower")
    sensor = estimated.sensors["lower"]
    assert sensor.quality["the truth has stepped"] == pytest.approx(8 * RATE, abs=5)
    assert not sensor.is_apart.any() and not sensor.frames_apart
    (row,) = (own for own in evaluation.orientation if own.sensor == "lower")
    assert row.total_rmse_deg < 3 and row.total_max_deg < 8


@pytest.mark.parametrize("kind", ["swinging", "sticks"])
def test_both_halves_of_a_truth_that_steps_are_judged_each_in_its_own_frames(judge, kind, request):
    scene = request.getfixturevalue(kind)
    unstepped = judge(scene)[2]
    session, estimated, evaluation = judge(scene, relabelled(35))
    expected, found = (halves(own, 35) for own in (unstepped, evaluation))
    for own, usual in zip(found, expected, strict=True):
        assert 30 * RATE < own.size <= usual.size
        assert rms(own) < 1.3 * rms(usual)
    sensor = estimated.sensors["lower"]
    assert sensor.quality["the truth has stepped"] < 0.5 * RATE
    (fits,) = sensor.frames_apart
    away = Rotation.from_rotvec(np.radians(fits["vqf_6d"].mounting_deg)).inv() * (
        Rotation.from_rotvec(np.radians(sensor.frames["vqf_6d"].mounting_deg))
    )
    if kind == "sticks":  # of a pendulum the turn about its axis is not determined
        assert np.degrees(away.magnitude()) == pytest.approx(50, abs=2)
    assert "truth.aligned_apart" in told(evaluation, "lower")
    assert "truth.aligned_apart" not in told(evaluation, "upper")
    estimated.save(session.path)
    kept = Estimate.load(session.path).sensors["lower"]
    assert kept.frames_apart == sensor.frames_apart and (kept.is_apart == sensor.is_apart).all()
    # the estimate itself does not step
    turns = rotation.angle(
        rotation.multiply(
            rotation.conjugate(sensor.orientation["vqf_6d"][:-1]), sensor.orientation["vqf_6d"][1:]
        )
    )
    assert np.degrees(turns.max()) < 20


def test_a_truth_that_steps_thrice_leaves_enough_to_fit_a_clock_to(judge, sticks):
    def thrice(time, q):
        lower = q["lower"]
        for i, after in enumerate((18, 35, 52)):
            by = Rotation.from_euler("XYZ"[i], 50, degrees=True)
            lower = turned(lower, time > after, by)
        return time, q | {"lower": lower}

    _, estimated, evaluation = judge(sticks, thrice)
    assert "steps 3 times" in told(evaluation, "lower")["truth.stepped"]
    sensor = estimated.sensors["lower"]
    assert sensor.clock.method == "angular_rate"
    assert sensor.clock.drift_ppm == pytest.approx(DRIFT_PPM, abs=100)
    assert sensor.is_apart.any()
    (row,) = (own for own in evaluation.orientation if own.sensor == "lower")
    assert row.total_rmse_deg < 3 and row.total_max_deg < 8


def test_a_truth_whose_time_jumps_is_not_judged_by_a_clock_between_its_halves(judge, sticks):
    def jumping(time, q):
        return time + np.where(time > 35, 0.3, 0.0), q

    _, _, evaluation = judge(sticks, jumping)
    assert "the time of one jumps" in told(evaluation, "lower")["clock.no_common_motion"]
    assert "clock.shifted" not in told(evaluation, "lower")
    assert not evaluation.orientation


def halves(evaluation, time: float) -> list[np.ndarray]:
    """Judged errors of the lower sensor before and after a time [deg]."""
    series = evaluation.series["orientation_lower"]
    total, judged = np.degrees(series["vqf_6d_total_rad"]), series["judged"]
    after = series["host_time_ns"] * 1e-9 > time
    return [total[judged & ~after], total[judged & after]]


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def test_a_truth_that_stands_still_while_the_sensor_turns_is_lost(judge, sticks):
    def held(time, q):
        lower = q["lower"].copy()
        for begin, end in ((20, 26), (60, 70)):
            rows = (time > begin) & (time < end)
            lower[rows] = lower[rows][0]
        return time, q | {"lower": lower}

    _, estimated, evaluation = judge(sticks, held)
    assert "stands still 2 times" in told(evaluation, "lower")["truth.frozen"]
    assert estimated.sensors["lower"].quality["the truth stands still"] > 0.9 * 16 * RATE
    (row,) = (own for own in evaluation.orientation if own.sensor == "lower")
    assert row.total_max_deg < 8


def test_a_lost_truth_is_counted(judge, sticks):
    def blind(time, q):
        lower = q["lower"].copy()
        lower[(time > 20) & (time < 35)] = np.nan
        return time, q | {"lower": lower}

    _, _, evaluation = judge(sticks, blind)
    assert f"{15 * RATE:.0f} of" in told(evaluation, "lower")["judged.truth_lost"]


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda t, q: (t, {"upper": q["lower"], "lower": q["upper"]}), "truth.of_another", "link"),
        (
            lambda t, q: (t, {name: own * [1, -1, -1, -1] for name, own in q.items()}),
            "truth.order_or_direction",
            "direction: sensor_from_earth",
        ),
        (
            lambda t, q: (t, {name: np.roll(own, -1, axis=1) for name, own in q.items()}),
            "truth.order_or_direction",
            "order: xyzw",
        ),
        (lambda t, q: (1000 * t, q), "clock.truth_unit", "unit"),
        (
            lambda t, q: (t, reference(stick(7), 7)[1]),
            "clock.no_common_motion",
            "nothing of it is evaluated",
        ),
    ],
    ids=["swapped", "conjugated", "order", "unit", "another recording"],
)
def test_a_truth_that_is_not_the_sensors_is_named_and_nothing_is_judged(
    judge, sticks, change, code, words
):
    _, _, evaluation = judge(sticks, change)
    for name in ("upper", "lower"):
        assert words in told(evaluation, name)[code]
        assert "judged.not_aligned" in told(evaluation, name)
        assert not any(own.startswith("axes.") for own in told(evaluation, name))
    assert not evaluation.orientation and not evaluation.orientation_summary
    assert "the arm" not in " ".join(str(own) for own in evaluation.findings)


def test_without_a_clock_to_align_the_stamps_of_both_files_keep_their_zero(judge_files, sticks):
    """Both logs begin at other stamps than 0, and not together."""
    scene = replace(sticks, apart=20.0)

    def on_one_clock(time, q):
        return time + scene.apart, q

    stated = "estimate: {align: motion, align_clock: false, filters: [vqf_6d]}\n"
    session, estimated, evaluation = judge_files(scene, on_one_clock, stated)
    first = session.truth("upper").host_time_ns[0] * 1e-9
    assert first == pytest.approx(scene.apart - 1 / RATE, abs=1e-3)
    assert estimated.sensors["upper"].host_time_ns[0] == 0
    assert all(row.total_rmse_deg < 3 for row in evaluation.orientation)
    assert len(evaluation.orientation) == 2


CASES = os.environ.get("TESTBENCH_CASES")
needs_cases = pytest.mark.skipif(
    not CASES or not Path(CASES).exists(),
    reason="TESTBENCH_CASES is not set; it names a folder of files that failed once",
)


def case(name: str) -> Path:
    """The folder of a case."""
    assert CASES is not None
    for root in (Path(CASES), Path(CASES) / "files"):
        if (root / name).is_dir():
            return root / name
    pytest.skip(f"TESTBENCH_CASES has no {name}")


@needs_cases
def test_a_truth_in_the_order_xyzw_is_named_as_that(tmp_path, clock):
    folder = case("11_truth_quaternion_order")
    session = import_recording(
        "generic",
        [folder / "data.csv"],
        tmp_path / "session",
        clock,
        Options(str(folder / "map.yaml")),
    )
    evaluation = evaluate(session, estimate(session))
    assert "`order: xyzw`" in told(evaluation, "imu")["truth.order"]
    assert not evaluation.orientation


@needs_cases
def test_an_arm_log_that_began_eight_seconds_earlier_is_aligned(tmp_path, clock):
    folder = case("16_arm_log_began_earlier")
    session = import_recording(
        "generic",
        [folder / "imu.csv"],
        tmp_path / "session",
        clock,
        Options(str(folder / "map.yaml")),
        TruthOptions(folder / "arm.csv", "ur3e", {"": "wrist_3_link"}),
    )
    evaluation = evaluate(session, estimate(session))
    assert "-8.0" in told(evaluation, "imu")["clock.shifted"]
    assert all(row.total_rmse_deg < 1.2 for row in evaluation.orientation)
    assert set(told(evaluation, "imu")) == {"clock.shifted", "judged.delay_unstated"}


@pytest.mark.parametrize("trial", ["02"])
def test_a_real_recording_is_the_same_on_another_clock_and_in_another_world(
    tmp_path, clock, data, trial
):
    """BROAD (Laidig et al. 2021), its truth a minute later, 100 ppm slow, and turned."""
    (file,) = (data / "broad").glob(f"{trial}_*.mat")
    recording = broad.read([file])
    sensor = recording.sensors["imu"]
    (samples,) = sensor.chunks
    world = Rotation.from_euler("ZYX", [70, 40, 100], degrees=True)
    rows = {}
    for moved in (False, True):
        time, q = sensor.truth.host_time_ns, sensor.truth.q_world_from_sensor.copy()
        own = samples
        if moved:
            known = np.isfinite(q[:, 0])
            q[known] = (world * Rotation.from_quat(q[known], scalar_first=True)).as_quat(
                scalar_first=True
            )
            stamps = np.round(samples.device_time_ns * (1 + 1e-4)).astype(np.int64)
            own = replace(samples, device_time_ns=stamps, host_time_ns=stamps)
            time = time + 60_000_000_000
        settings = Estimation(
            filters=["vqf_6d"], align="motion", align_clock=True, calibrate="none"
        )
        truth = Truth(time, q, judged=sensor.truth.judged)
        session = write_recording(
            replace(
                recording,
                analysis=Analysis(estimate=settings),
                sensors={"imu": replace(sensor, chunks=[own], truth=truth)},
            ),
            [file],
            "broad",
            tmp_path / str(moved),
            clock,
        )
        estimated = estimate(session)
        (rows[moved],) = evaluate(session, estimated).orientation
        drift = estimated.sensors["imu"].clock.drift_ppm
        assert drift == pytest.approx(100.0 if moved else 0.0, abs=10)
    for kind in ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"):
        assert getattr(rows[True], kind) == pytest.approx(getattr(rows[False], kind), abs=0.05)
