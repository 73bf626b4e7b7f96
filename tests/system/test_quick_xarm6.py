"""The protocol for an xArm 6 has the same elbow as `quick`, and its controller can go every way by
itself.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.drivers.arms.straight_path import StraightPaths
from testbench.model.kinematics import Kinematics
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from tests.asking import run_of


@pytest.fixture(scope="module")
def both() -> tuple[Plan, Plan]:
    return make_plan(run_of("quick")), make_plan(run_of("quick_xarm6"))


def segments(plan: Plan, step: int, what: str) -> dict[str, np.ndarray]:
    """R_world_from_segment or R_world_from_sensor of every sensor at the end of a step."""
    q = plan.trajectory.at(np.array([plan.steps[step].settled_ns]))[0]
    kinematics, found = Kinematics(plan.robot), {}
    for name, sensor in plan.protocol.spec.sensors.items():
        assert sensor.segment is not None
        ((sequence, angles),) = (
            sensor.segment if what == "segment" else sensor.mounting
        ).rotation_deg.items()
        R_link_from_frame = Rotation.from_euler(sequence, angles, degrees=True).as_matrix()
        found[name] = (
            kinematics.frame_motion(sensor.link, q).R_world_from_frame[0] @ R_link_from_frame
        )
    return found


@pytest.mark.parametrize("what", ["segment", "sensor"])
def test_segments_and_sensors_stand_in_the_world_as_those_of_quick_in_every_step(both, what):
    assert [step.variables for step in both[0].steps] == [step.variables for step in both[1].steps]
    for step in range(len(both[0].steps)):
        first, second = (segments(plan, step, what) for plan in both)
        for name in first:
            np.testing.assert_allclose(first[name], second[name], atol=1e-9)


def test_every_way_between_its_poses_is_free_so_that_the_controller_can_plan_it(both):
    plan = both[1]
    assert not plan.check.warnings
    paths, before = StraightPaths(plan.robot), plan.trajectory.q[0]
    for step in plan.steps:
        after = plan.trajectory.at(np.array([step.settled_ns]))[0][0]
        assert paths.blocked(before, after) is None, step.name
        before = after
