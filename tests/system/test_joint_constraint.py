"""A joint's axes against a gyroscope that turns the heading away, from the protocol to the
report.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.results.estimate import Estimate
from testbench.reporting.report import report

# A bias of the gyroscope that nothing takes out: mahony_imu, without its integral, lets the heading
# go.
PROTOCOL = """\
name: constrained
purpose: An uncorrected gyroscope on a joint of two axes
robot: ur3e
sensors:
  arm:
    preset: xsens_dot
    link: wrist_1_link
    segment: {name: upper_arm}
    mounting: {rotation_deg: {XYZ: [90, 0, 0]}, position_mm: [0, 45, 0]}
  forearm:
    preset: xsens_dot
    parameters: {gyroscope: {bias_sd_deg_s: 0.3}}
    link: wrist_3_link
    segment: {name: forearm}
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
joints:
  free: {proximal: arm, distal: forearm, sequence: ZXZ}
  kept:
    proximal: arm
    distal: forearm
    sequence: ZXZ
    constraint:
      proximal_axis: [0, 1, 0]
      distal_axis: [0, 0, 1]
      angle_deg: 90
      axes_sd_deg: 1
      drift_deg: 10
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: [180, -90, -90, -45, 90, 0], dwell_s: 4}]
  - name: moving
    steps:
      - sweep:
          wrist_1_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.1, cycles: 9}}
          wrist_2_joint: {sine: {amplitude_deg: 30, frequency_hz: 0.2, cycles: 18}}
          wrist_3_joint: {sine: {amplitude_deg: 50, frequency_hz: 0.3, cycles: 27}}
estimate:
  filters: [device, ecompass, mahony_imu]
  filter_parameters: {mahony_imu: {ki: 0}}
  calibrate: none
"""


@pytest.fixture(scope="module")
def result(run_protocol, tmp_path_factory):
    file = tmp_path_factory.mktemp("constrained") / "constrained.yaml"
    file.write_text(PROTOCOL)
    return run_protocol(file)


def total(result, joint, name):
    """RMS total error over the sweep [rad]."""
    series = result.evaluation.series[f"joint_{joint}"]
    return float(np.sqrt(np.mean(series[f"{name}_total_error_rad"][series["judged"]] ** 2)))


def test_the_drift_of_the_heading_is_taken_out(result):
    estimate, session = result.estimate, result.session
    time = estimate.joints["kept"].host_time_ns
    headings = []
    for name in ("arm", "forearm"):
        sensor = estimate.sensors[name]
        q = rotation.interpolate(sensor.host_time_ns, sensor.orientation["mahony_imu"], time)
        error = rotation.multiply(q, rotation.conjugate(truth_at(session.truth(name), time)))
        headings.append(rotation.heading_angle(error))
    judged = time > session.steps[0].end_ns
    apart = np.degrees(rotation.wrap(headings[0] - headings[1]))[judged]
    taken = np.degrees(estimate.joints["kept"].headings["mahony_imu"].heading)[judged]
    known = np.isfinite(apart)
    assert np.abs(apart[known]).max() > 8
    assert np.sqrt(np.mean((taken - apart)[known] ** 2)) < 2
    assert total(result, "kept", "mahony_imu") < total(result, "free", "mahony_imu") / 3


def test_filters_that_need_no_help_are_left_alone(result):
    """A magnetometer's heading is the filter's own affair, and nobody knows what the device
    uses.
    """
    assert list(result.estimate.joints["kept"].headings) == ["mahony_imu"]
    assert result.estimate.joints["free"].headings == {}
    for name in ("device", "ecompass"):
        assert total(result, "kept", name) == total(result, "free", name)


def test_what_was_taken_out_is_kept_and_shown(result):
    again = Estimate.load(result.session.path).joints["kept"]
    found = result.estimate.joints["kept"].headings["mahony_imu"]
    np.testing.assert_array_equal(again.headings["mahony_imu"].heading, found.heading)
    np.testing.assert_array_equal(again.headings["mahony_imu"].sd, found.sd)
    page = report(result.session).read_text(encoding="utf-8")
    assert "Headings kept together by the axes of kept" in page
    assert "Headings kept together by the axes of free" not in page
