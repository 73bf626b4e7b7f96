"""Logs of arms, URDFs, joint angles, calibrations and rests of public reports, kept beside the
repository: each gives the right value, or a message that says what is wrong.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from testbench import plan
from testbench.estimation.calibration.session_calibration import calibrate
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.pipeline.analyse import analyse
from testbench.records.session.session import Session
from tests.asking import analysis


@pytest.fixture(scope="module")
def arms() -> Path:
    folder = os.environ.get("TESTBENCH_CASES")
    if not folder:
        pytest.skip("TESTBENCH_CASES is not set; it names the folder of situations of users")
    own = Path(folder) / "arms_calibration_joints"
    if not own.is_dir():
        pytest.skip(f"TESTBENCH_CASES names {folder}, which has no folder arms_calibration_joints")
    return own


@pytest.fixture
def brought(arms, tmp_path, clock):
    """Imports the recording of a case, with one of its logs of a UR3e as the truth."""

    def bring(case: str, log: str | None = None, unit: str | None = None) -> Session:
        folder = arms / case
        given = {"robot": "ur3e", "links": {"": "wrist_3_link"}, "joint_unit": unit}
        truth = None if log is None else TruthOptions(folder / log, **given)
        options = Options(mapping=str(folder / "map.yaml"))
        out = tmp_path / (log or "session").replace(".", "_")
        return import_recording("generic", [folder / "imu.csv"], out, clock, options, truth)

    return bring


def error_deg(session: Session) -> float:
    (row,) = analyse(session, analysis("vqf_6d")).evaluation.orientation
    return row.total_rmse_deg


@pytest.mark.parametrize(
    ("case", "mended", "whole", "unit"),
    [
        ("01_arm_log_wrapped_at_180", "log.csv", "unwrapped.csv", "rad"),
        ("03_arm_log_rows_of_zeros", "log.csv", "gap.csv", "rad"),
    ],
)
def test_a_log_that_is_mended_gives_the_error_of_the_whole_one(brought, case, mended, whole, unit):
    errors = [error_deg(brought(case, log, unit)) for log in (mended, whole)]
    assert errors[0] == pytest.approx(errors[1], abs=0.01) and errors[1] < 0.5


@pytest.mark.parametrize("case", ["04_joint_states_csv_of_a_bag", "05_joint_states_of_plotjuggler"])
def test_a_log_of_another_layout_is_read(brought, case):
    assert error_deg(brought(case, "log.csv", "rad")) < 0.5


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("02_arm_log_several_turns_in_radians", r"log\.csv: .*largest is 14\.52.*--joint-unit"),
        ("19_arm_log_time_in_ms", r"log\.csv: .*--truth-time-unit ms"),
    ],
)
def test_a_log_without_its_units_is_asked_about(brought, case, said):
    with pytest.raises(InputError, match=said):
        brought(case, "log.csv")


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("06_urdf_upper_limit_without_lower", r"joint j2: .*-170\.00 deg"),
        ("08_urdf_limits_all_zero", r"arm\.urdf:7: joint j1: .*no range.*(?s:.)*joint j3"),
        ("09_urdf_mimic_joint_in_the_chain", r"arm\.urdf:9: joint j3: it mimics j2"),
        ("10_urdf_zero_axis", r"arm\.urdf:7: joint j1: it has no axis"),
        ("16_cardan_middle_angle_past_90", r"p\.yaml:8:3: .*-90 to 90 deg only.*This fits"),
        ("17_symmetric_sequence_and_negative_flexion", r"p\.yaml:8:3: .*no sign.*This fits"),
    ],
)
def test_what_cannot_be_planned_is_refused_by_name(arms, case, said):
    with pytest.raises(InputError, match=said):
        plan(arms / case / "p.yaml")


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("07_urdf_lower_limit_without_upper", "joint j2 states no upper limit, which is 0"),
        ("11_urdf_limits_in_degrees", "j1 may turn 29 times round and turns at 10313 deg/s"),
        ("12_urdf_package_mesh_beside/my_arm/urdf", ""),
        ("18_pose_in_radians_as_measured", "looks like radians"),
    ],
)
def test_what_is_doubtful_is_warned_of(arms, case, said):
    assert said in "\n".join(plan(arms / case / "p.yaml").check.warnings)


@pytest.mark.parametrize(
    ("case", "acc", "gyr", "span_s"),
    [
        ("13_noise_of_a_low_passed_sensor", 101.0, 0.0101, 30.0),
        ("14_noise_at_5_hz", 644.0, 0.036, 120.0),
    ],
)
def test_noise_at_rest_is_that_of_the_sensor(brought, case, acc, gyr, span_s):
    rows = analyse(brought(case), analysis("vqf_6d")).evaluation.noise
    assert len(rows) == 6
    for row in rows:
        true = {"acc": acc, "gyr": gyr}[row.quantity]
        assert row.noise_density == pytest.approx(true, abs=2.5 * row.noise_density_sd)
        assert row.bias_instability is None and row.span_s == pytest.approx(span_s, abs=0.3)
    for quantity, true in (("acc", acc), ("gyr", gyr)):
        found = [row.noise_density for row in rows if row.quantity == quantity]
        assert np.mean(found) == pytest.approx(true, rel=0.07)


def test_a_clipped_gyroscope_is_not_calibrated(brought):
    session = brought("15_calibrate_clipped_gyroscope")
    with pytest.raises(InputError, match=re.escape("the gyroscope is clipped (x at 59.99 deg/s")):
        calibrate(session, "imu", ["norm_only", "gravity_turns"])
