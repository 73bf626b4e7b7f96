"""Two plans have one hash exactly where they are the same motion of the same arm."""

from __future__ import annotations

import shutil
from dataclasses import replace

from testbench.records.specs.robot import Robot


def test_whatever_a_plan_consists_of_is_in_its_hash(planned, tmp_path):
    def made():
        return planned("{move_to_deg: {wrist_3_joint: 30}, dwell_s: 1}")

    plan = made()
    assert plan.hash == made().hash
    motion, robot = plan.trajectory, plan.robot
    others = [
        replace(plan, trajectory=replace(motion, **{key: getattr(motion, key) + 1}))
        for key in ("time_ns", "q", "v", "a")
    ]
    others.append(replace(plan, steps=[replace(plan.steps[0], end_ns=1), *plan.steps[1:]]))
    urdf = shutil.copy(robot.urdf, tmp_path / "other.urdf")
    with urdf.open("a") as file:
        file.write("<!-- another -->")
    others.append(replace(plan, robot=Robot(robot.spec, urdf, robot.text, robot.file)))
    others.append(replace(plan, robot=Robot(robot.spec, robot.urdf, f"{robot.text}#", robot.file)))
    hashes = {plan.hash, *(other.hash for other in others)}
    assert len(hashes) == 1 + len(others)
