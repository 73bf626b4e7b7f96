"""Distances and ranges of a plan, against what is worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import SensorRangeError
from testbench.model.collision import FLOOR, CollisionModel
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import Floor, Robot, load_robot

BOX = """\
<robot name="boom">
  <link name="base"/>
  <link name="arm"/>
  <link name="tool">
    <collision><origin xyz="0 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.8"/><limit lower="-3" upper="3" velocity="3" effort="1"/>
  </joint>
  <joint name="bend" type="revolute">
    <parent link="arm"/><child link="tool"/><axis xyz="0 1 0"/>
    <origin xyz="0.6 0 0"/><limit lower="-3" upper="3" velocity="3" effort="1"/>
  </joint>
</robot>
"""


@pytest.mark.parametrize("height_mm", [0.0, 120.0, -30.0])
@pytest.mark.parametrize("tilt_deg", [0.0, 25.0])
def test_the_distance_to_the_floor_is_that_of_a_ball_on_a_boom(tmp_path, height_mm, tilt_deg):
    file = tmp_path / "boom.urdf"
    file.write_text(BOX)
    plain = load_robot(file)
    base = plain.spec.base.model_copy(update={"rotation_deg": {"XYZ": (0.0, -tilt_deg, 0.0)}})
    floor = Floor(height_mm=height_mm)
    spec = plain.spec.model_copy(update={"floor": floor, "base": base})
    model = CollisionModel(Kinematics(Robot(spec, plain.urdf, plain.text, plain.file)))
    for angle in np.radians([0, 20, 35]):
        # the base leans by the tilt: the joint stands lower, and the boom dips by less
        tilt = np.radians(tilt_deg)
        height = 0.8 * np.cos(tilt) - 0.6 * np.sin(angle - tilt)
        found = model.nearest(np.array([angle, 0.3]))
        assert FLOOR in (found.first, found.second)
        wanted = height - 0.05 - height_mm / 1000
        assert found.distance == pytest.approx(wanted, abs=1e-4)


def test_the_clearance_of_a_plan_is_the_smallest_on_its_way_in_millimetres(planned):
    check = planned(
        "{name: far, move_to_deg: [0, -90, 40, 0, 0, 0]}",
        "{name: near, move_to_deg: [0, -90, 136, 0, 0, 0]}",
        "{name: back, move_to_deg: [0, -90, 40, 0, 0, 0]}",
    ).check
    model = CollisionModel(Kinematics(load_robot("ur3e")))
    bent = model.nearest(np.radians([0, -90, 136, 0, 0, 0])).distance
    assert bent < model.nearest(np.radians([0, -90, 40, 0, 0, 0])).distance
    assert check.clearance.distance_mm == pytest.approx(1000 * bent, abs=1)
    assert check.clearance.step in {"near", "back"}


SPIN = (
    "{name: spin, sweep: {wrist_3_joint: {sine: {amplitude_deg: 15, frequency_hz: 1, cycles: 3}}}}"
)
TOP = """\
name: trial
purpose: For a test
robot: ur3e
sensors:
  hand:
    preset: ideal
    parameters: {parameters}
    link: wrist_3_link
    mounting: {{rotation_deg: {{XYZ: [0, 90, 0]}}, position_mm: [300, 0, 0]}}
"""


def spinning(planned, parameters: str = "{}"):
    """A sensor 300 mm out of the last joint's axis, its z axis pointing away from that."""
    return planned(
        "{move_to_deg: [0, -90, 0, -90, 0, 0], motion: {speed: 0.1, acceleration: 0.1, jerk: 0.1}}",
        SPIN,
        top=TOP.format(parameters=parameters),
    )


def test_what_a_sensor_feels_in_a_plan_is_what_its_lever_makes_of_the_turn(planned):
    the_plan = spinning(planned)
    use = the_plan.check.sensors[0]
    amplitude, omega = np.radians(15), 2 * np.pi
    assert use.peak_rate_deg_s == pytest.approx(np.degrees(amplitude * omega), rel=0.01)
    spin = the_plan.steps[1]
    instants = np.arange(spin.start_ns, spin.settled_ns, 1_000_000)
    turn, rate, acceleration = (values[:, 5] for values in the_plan.trajectory.at(instants))
    tangential, radial = 0.3 * acceleration, -0.3 * rate**2
    # the last axis is level: gravity turns in the plane of the lever
    felt = [
        max(
            np.abs(tangential + 9.80665 * np.cos(turn + start)).max(),
            np.abs(radial + 9.80665 * np.sin(turn + start)).max(),
        )
        for start in np.radians([0, 90, 180, 270])
    ]
    assert min(abs(use.peak_specific_force_m_s2 / value - 1) for value in felt) < 1e-3


def test_a_range_is_refused_that_the_lever_alone_exceeds(planned):
    peak = spinning(planned).check.sensors[0].peak_specific_force_m_s2
    assert peak > 12
    enough, short = (
        f"{{accelerometer: {{range_g: {share * peak / 9.80665}}}}}" for share in (1.01, 0.99)
    )
    spinning(planned, enough)
    with pytest.raises(SensorRangeError) as caught:
        spinning(planned, short)
    assert caught.value.value == pytest.approx(peak, rel=1e-3)
    assert caught.value.step == "spin"
