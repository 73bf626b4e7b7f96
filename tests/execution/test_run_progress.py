"""Progress by the planned time of what is done."""

from __future__ import annotations

import pytest

from testbench import plan
from testbench.execution.motion_table import motion_rows
from testbench.execution.run_progress import Progress, ProgressMeter
from testbench.records.session.session import Event

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def the_plan():
    return plan("quick")


def test_every_planned_second_counts_the_same_and_the_end_is_the_last_step(the_plan):
    told: list[Progress] = []
    meter = ProgressMeter(the_plan, the_plan.steps, told.append)
    for step in the_plan.steps:
        meter.note(Event(step.start_ns, "step_started", {"index": step.index}))
        middle = (step.start_ns + step.end_ns) // 2
        meter.say(middle)
        assert told[-1].step == step.name
        assert told[-1].time == pytest.approx(middle / SECOND, abs=1e-6)
        assert told[-1].duration == pytest.approx(the_plan.steps[-1].end_ns / SECOND)
        meter.note(Event(step.end_ns, "step_ended", {"index": step.index}))
    meter.say(the_plan.steps[-1].end_ns)
    assert (told[-1].index, told[-1].steps) == (len(the_plan.steps) - 1, len(the_plan.steps))
    assert told[-1].time == pytest.approx(told[-1].duration)


def test_a_step_that_takes_longer_than_planned_does_not_count_for_more(the_plan):
    told: list[Progress] = []
    meter = ProgressMeter(the_plan, the_plan.steps, told.append)
    meter.note(Event(0, "step_started", {"index": 0}))
    meter.say(3600 * SECOND)
    first = the_plan.steps[0]
    assert told[-1].time == pytest.approx((first.end_ns - first.start_ns) / SECOND)


def test_the_table_of_a_motion_has_a_row_for_every_way_to_a_step_that_does_not_follow(the_plan):
    rows = motion_rows(the_plan)
    assert [row.index for row in rows] == [step.index for step in the_plan.steps]
    moved = next(
        k
        for k in range(1, len(rows))
        if rows[k].kind == "move" and rows[k].pose_deg != rows[k - 1].pose_deg
    )
    left_out = motion_rows(the_plan, [step for step in the_plan.steps if step.index != moved])
    (way,) = [k for k, row in enumerate(left_out) if row.kind == "connect"]
    assert left_out[way].pose_deg == pytest.approx(rows[moved].pose_deg)
    assert left_out[way + 1].index == moved + 1


def test_the_row_of_a_sweep_says_which_joint_turns_from_where_to_where(the_plan):
    sweeps = [row for row in motion_rows(the_plan) if row.kind == "sweep"]
    assert sweeps
    for row, step in zip(
        sweeps, [step for step in the_plan.steps if step.kind == "sweep"], strict=True
    ):
        inside = (the_plan.trajectory.time_ns >= step.start_ns) & (
            the_plan.trajectory.time_ns <= step.settled_ns
        )
        for joint, (low, high) in row.swings_deg.items():
            q = (
                the_plan.trajectory.q[inside, the_plan.robot.joint_names.index(joint)]
                * 57.29577951308232
            )
            assert (low, high) == pytest.approx((q.min(), q.max()))
            assert high - low > 0.05
