"""Whether the true angles that a joint was given are those of another joint.

Joints of one gait turn in one rhythm: the hip's flexion fits the knee's at some shift of the times,
and is judged as if it were. Another joint of the recording that it fits far better tells.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.estimation.joints.angle_fits import angle_fits, estimated_rate, true_rate
from testbench.estimation.signals.recording import JointTruth
from testbench.model.joint_angle import INDEX
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit, JointEstimate
from testbench.records.specs.protocol import JointDefinition

SURELY, HARDLY, LEFT = 0.9, 0.95, 0.5
"""A truth is another joint's if its rates correlate with that one's by `SURELY` and more, with its
own by less than `HARDLY`, and that one leaves less than `LEFT` of the variance that its own leaves
[1]. Two joints of a simulated walk correlate by 0.74 at their best shift, a joint with its own
truth by 0.99.
"""


def angle_of_another(
    name: str,
    joints: Mapping[str, JointDefinition],
    estimates: Mapping[str, JointEstimate],
    truth: JointTruth,
    clock: ClockFit,
) -> Finding | None:
    """What is to be said of a true flexion that moves as that of another joint does, or None.

    Args:
        name: Of the joint that the truth was given to.
        joints: As defined, by name.
        estimates: Of them.
        truth: The true angles.
        clock: Of the joint against them.
    """
    own = clock.correlation
    if truth.same_clock:
        own = _correlation(name, joints, estimates, truth)
    if own > HARDLY or clock.refused in ("unit", "still", "no overlap"):
        return None
    own = max(own, 0.0) if np.isfinite(own) else 0.0
    ends = {joints[name].proximal, joints[name].distal}
    others = {
        other: _correlation(other, joints, estimates, truth, joints[name])
        for other, joint in joints.items()
        if other in estimates and {joint.proximal, joint.distal} != ends
    }
    best = max(others, key=lambda other: others[other], default=None)
    if best is None or others[best] < SURELY or 1 - others[best] ** 2 > LEFT * (1 - own**2):
        return None
    return finding(
        "truth.of_another_joint", other=best, correlation=others[best], own_correlation=own
    )


def _correlation(
    name: str,
    joints: Mapping[str, JointDefinition],
    estimates: Mapping[str, JointEstimate],
    truth: JointTruth,
    given: JointDefinition | None = None,
) -> float:
    """How the rate of a joint's flexion correlates with that of a truth: at the best shift, or as
    the times are read where both are on one clock; -1 where nothing tells [1].

    Args:
        name: Of the joint.
        joints: As defined, by name.
        estimates: Of them.
        truth: The true angles.
        given: The joint that they were given to, where it is another one.
    """
    found, joint = estimates[name], joints[name]
    place, true_place = [INDEX[joint.flexion]], [INDEX[(given or joint).flexion]]
    own = [angles for (_, label), angles in found.angles.items() if label == joint.label][:1]
    if not own:
        return -1.0
    if not truth.same_clock:
        (fit,) = angle_fits(found, own, truth, place, true_place)
        return float(np.nan_to_num(fit.correlation, nan=-1.0))
    true, measured = (
        true_rate(truth, true_place),
        estimated_rate(found.host_time_ns, own[0][:, place]),
    )
    if len(true.time) < 2 or len(measured.time) < 2:
        return -1.0
    inside = true.known_at(measured.time)
    expected, rate = np.interp(measured.time[inside], true.time, true.rate), measured.rate[inside]
    if len(rate) < 2 or not expected.std() or not rate.std():
        return -1.0
    return float(np.corrcoef(rate, expected)[0, 1])
