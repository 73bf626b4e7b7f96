"""What enters a session's own calibration, and how sure it says to be."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from testbench import estimate, execute, plan
from testbench.estimation.calibration.calibration_sections import corrected, fit_sections
from testbench.estimation.calibration.static_poses import GYRO_IN_RUN, fit_static_poses
from testbench.estimation.signals.time_alignment import PART_ERROR_S, fit_clock
from testbench.estimation.signals.uniform import UniformSamples
from testbench.execution import RunOptions
from testbench.records.disk.tables import read_parquet, write_parquet
from testbench.records.results.estimate import CalibrationFit
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import Session
from tests.conftest import FakeClock
from tests.estimation.test_static_poses import GRAVITY, SIX, Part
from tests.estimation.test_time_alignment import recording

POSES = """\
name: poses
purpose: A sensor calibrated in a few poses
robot: ur3e
sensors: {hand: {preset: xsens_dot, link: wrist_3_link}}
sections:
  - name: calibration
    role: calibration
    steps:
      - {dwell_s: 1}
      - {move_to_deg: {wrist_1_joint: 0}, dwell_s: 1}
      - {move_to_deg: {wrist_2_joint: 0}, dwell_s: 1}
      - {move_to_deg: {wrist_3_joint: 90}, dwell_s: 1}
      - {move_to_deg: {wrist_1_joint: -180}, dwell_s: 1}
estimate: {filters: [gyro], align: none, calibrate: static_poses}
"""


@pytest.fixture(scope="module")
def posed(tmp_path_factory) -> Session:
    folder = tmp_path_factory.mktemp("poses")
    (folder / "poses.yaml").write_text(POSES)
    return execute(plan(folder / "poses.yaml"), folder, 3, RunOptions(clock=FakeClock()))


def spoilt(session: Session, folder: Path, change) -> Session:
    """A copy whose samples within the dwell of its last pose are changed."""
    shutil.copytree(session.path, folder / "copy")
    file = folder / "copy" / "imu_hand.parquet"
    columns = {key: np.array(values) for key, values in read_parquet(file).items()}
    step = session.steps[-1]
    rows = (columns["host_time_ns"] > step.settled_ns) & (columns["host_time_ns"] < step.end_ns)
    change(columns, rows)
    write_parquet(file, columns)
    return Session(folder / "copy")


def test_a_pose_that_was_saturated_does_not_calibrate(posed, tmp_path):
    sound = estimate(posed).sensors["hand"].calibration

    def saturate(columns, rows):
        columns["saturated"][rows] = True
        columns["acc_x_m_s2"][rows] += 3.0

    found = estimate(spoilt(posed, tmp_path, saturate)).sensors["hand"].calibration
    assert (sound.poses, found.poses) == (5, 4)
    np.testing.assert_allclose(found.acc_bias, sound.acc_bias, atol=0.15)


def resting(q: np.ndarray, part: Part, spans: list[tuple[float, float]]):
    """A sensor that stands in poses, each for a span of time, and what it reads; 100 Hz."""
    n = 100 * int(spans[-1][1] + 1)
    time = np.arange(n) * 10_000_000
    acc, gyr, orientation = np.zeros((n, 3)), np.zeros((n, 3)), np.tile(q[0], (n, 1))
    for pose, (begin, end) in zip(q, spans, strict=True):
        rows = slice(int(100 * begin), int(100 * end))
        count = rows.stop - rows.start
        own_acc, own_gyr = part.rest(pose[None], count)
        acc[rows], gyr[rows], orientation[rows] = own_acc[0], own_gyr[0], pose
    samples = ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, bool))
    return samples, time, Truth(time, orientation)


def step(index: int, begin: float, end: float, role="calibration", kind="move") -> PlannedStep:
    """A step that takes its first half for the way."""
    ns = [int(1e9 * value) for value in (begin, (begin + end) / 2, end)]
    return PlannedStep(index, role, role, "pose", kind, {}, *ns)


def test_only_dwells_of_calibration_poses_calibrate():
    part = Part(4)
    spans = [(2.0 * i, 2.0 * i + 2) for i in range(len(SIX))]
    samples, time, truth = resting(SIX, part, spans)
    # what is read on the way, in sweeps and in other sections is nonsense
    for i in range(len(SIX)):
        samples.acc[200 * i : 200 * i + 95] += 5.0
    samples.acc[200 * 4 : 200 * 6] += 5.0
    steps = [step(i, *spans[i]) for i in range(4)]
    steps += [step(4, *spans[4], kind="sweep"), step(5, *spans[5], role="evaluation")]
    run = SimpleNamespace(steps=steps, gravity=GRAVITY)
    fit, told = fit_sections(run, samples, time, np.ones(len(time), bool), truth)
    assert fit.poses == 4 and not told
    np.testing.assert_allclose(fit.acc_bias, part.bias, atol=0.1)


def test_the_uncertainty_of_a_gyroscopes_bias_holds_what_it_wanders_by_within_a_run():
    errors, stated = [], []
    rng = np.random.default_rng(6)
    for seed in range(80):
        part = Part(seed, g_sd=1e-5)
        acc, gyr = part.rest(SIX, 300)
        wandered = GYRO_IN_RUN * rng.standard_normal(3)
        fit = fit_static_poses(acc, [own + wandered for own in gyr], list(SIX), GRAVITY)
        errors.append(fit.gyr_bias - part.gyr_bias)
        stated.append(fit.gyr_bias_sd)
    assert np.min(stated) >= GYRO_IN_RUN
    assert 0.7 < np.sqrt(np.mean(np.square(np.array(errors) / stated))) < 1.2


def test_a_crooked_mounting_is_turned_back_and_a_g_sensitivity_is_of_the_axis_that_reads():
    part = Part(2, g_sd=0.0)
    part.g_matrix[1, 2] = 5e-4
    acc, gyr = part.rest(SIX, 500)
    fit = fit_static_poses(acc, gyr, list(SIX), GRAVITY)
    assert fit.gyr_g_matrix[1, 2] == pytest.approx(5e-4, rel=0.2)
    assert abs(fit.gyr_g_matrix[2, 1]) < 1e-4


def test_a_rate_of_an_instant_is_taken_for_the_interval_before_it_by_its_mean():
    gyr = np.array([[1.0, 0, 0], [3.0, 0, 0], [7.0, 0, 0]])
    uniform = UniformSamples(0.01, gyr, np.zeros((3, 3)), None, None)
    nothing = CalibrationFit()
    for sampling, wanted in (("instantaneous", [1, 2, 5]), ("integrated", [1, 3, 7])):
        assert corrected(uniform, nothing, sampling).gyr[:, 0].tolist() == wanted


def test_a_clocks_offset_is_as_sure_as_the_ends_of_a_drifting_recording():
    scores = []
    for seed in range(40):
        fit = fit_clock(*recording(0.0, 100.0, noise=0.02, seed=seed))
        scores.append((fit.offset_s - 0.0) / fit.offset_sd_s)
    # the offset is that at the beginning, half a minute from where it is best known
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.15
    exact = fit_clock(*recording(0.0, 100.0, noise=0.0))
    assert exact.offset_sd_s >= PART_ERROR_S == 50e-6


def test_a_rate_that_is_late_is_told_from_a_clock_that_is():
    samples, truth = recording(0.05, 0.0, noise=0.0)
    late = dataclasses.replace(samples, device_time_ns=samples.device_time_ns + 8_000_000)
    assert fit_clock(late, truth, rate_delay=0.008).offset_s == pytest.approx(0.05, abs=2e-4)
