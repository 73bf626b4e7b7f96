"""What was not aligned to the truth is not judged, and that is said."""

from __future__ import annotations

from dataclasses import replace

from testbench.evaluation import evaluate
from testbench.records.results.estimate import Estimate, FrameFit


def changed(estimate: Estimate, **parts) -> Estimate:
    """With another forearm."""
    forearm = replace(estimate.sensors["forearm"], **parts)
    return replace(estimate, sensors=estimate.sensors | {"forearm": forearm})


def test_a_sensor_whose_truth_cannot_be_compared_is_not_judged_nor_is_its_joint(quick):
    found = evaluate(quick.session, changed(quick.estimate, unaligned="clock.periodic"))
    assert {row.sensor for row in found.orientation} == {"arm"}
    assert not found.joint_angle and not found.joint_summary
    codes = {(own.code, own.where) for own in found.findings}
    assert ("judged.not_aligned", "forearm") in codes
    assert ("judged.joint_not_aligned", "joint 'elbow'") in codes


def test_only_the_filter_that_was_not_aligned_is_left_out(quick):
    key, *others = quick.estimate.sensors["forearm"].orientation
    frames = quick.estimate.sensors["forearm"].frames | {key: FrameFit(refused="no dwell")}
    found = evaluate(quick.session, changed(quick.estimate, frames=frames))
    assert {row.filter for row in found.orientation if row.sensor == "forearm"} == set(others)
    assert {row.filter for row in found.joint_angle} == set(others)
    (told,) = (own for own in found.findings if own.code == "judged.not_aligned")
    assert told.values["filters"] == [key]
