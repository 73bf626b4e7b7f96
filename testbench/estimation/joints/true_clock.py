"""The clock of a joint against that of angles that another system gave of it.

Both say how fast the joint turned. The length of a rate depends neither on the zero of an angle nor
on its sign, so that a truth which counts otherwise is aligned all the same, and judged as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from testbench.estimation.joints.angle_fits import UNFITTED, angle_fits
from testbench.estimation.joints.angle_of_another import angle_of_another
from testbench.estimation.signals.recording import JointTruth
from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import INDEX, decomposition_of
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit, JointEstimate
from testbench.records.specs.protocol import JointDefinition

SHIFT_TOLD_S = 0.05
"""Smaller shifts are not told [s]."""
AGREE_S = 0.02
"""Joints that differ by less are by one clock: filters delay each by some milliseconds [s]."""
AS_STATED = {"still", "periodic"}
"""Why no clock was fitted, where a stated offset holds all the same."""
ANOTHER = "angle of another joint"
DEGREES = 180 / np.pi
"""Degrees that were taken for radians hardly move, and are looked at so many times as large [1]."""


def with_true_clocks(
    joints: Mapping[str, JointDefinition],
    estimates: Mapping[str, JointEstimate],
    truths: Mapping[str, JointTruth],
) -> dict[str, JointEstimate]:
    """Joints with their clock against that of their true angles, where they have such.

    Args:
        joints: As defined, by name.
        estimates: Of them.
        truths: Of those whose angles another system gave.
    """
    result = dict(estimates)
    clocks, told = {}, {}
    for name, truth in truths.items():
        if name in result:
            clocks[name], told[name] = _clock(result[name], joints[name], truth)
            another = angle_of_another(name, joints, result, truth, clocks[name])
            if another is not None:
                clocks[name], told[name] = replace(UNFITTED, refused=ANOTHER), [another]
    for name, clock in _shared(clocks).items():
        found = [*result[name].findings, *told[name]]
        result[name] = replace(result[name], true_clock=clock, findings=found)
    return result


def _shared(clocks: Mapping[str, ClockFit]) -> dict[str, ClockFit]:
    """The clocks of joints, of which those that agree are that which is known best.

    The true angles of a recording come with one file, and so by one clock; how well a joint tells
    it depends on its motion.

    Args:
        clocks: Of each joint by itself.
    """
    fitted = [clock for clock in clocks.values() if clock.method == "angular_rate"]
    if not fitted:
        return dict(clocks)
    best = min(fitted, key=lambda clock: clock.offset_sd_s)
    return {
        name: best
        if clock.method == "angular_rate" and abs(clock.offset_s - best.offset_s) < AGREE_S
        else clock
        for name, clock in clocks.items()
    }


def _clock(
    found: JointEstimate, joint: JointDefinition, truth: JointTruth
) -> tuple[ClockFit, list[Finding]]:
    """The clock of a joint, and what is to be said of it."""
    if truth.same_clock:
        return _as_read(found, truth)
    own = [angles for (_, label), angles in found.angles.items() if label == joint.label]
    flexion = [INDEX[joint.flexion]]
    best = UNFITTED if own else replace(UNFITTED, refused="unknown")
    for places in (flexion, truth.angles.given):
        fits = list(angle_fits(found, own, truth, places, places))
        best = max([*fits, best], key=lambda fit: (fit.method == "angular_rate", _known(fit)))
        if best.method == "angular_rate":
            break
    if best.refused == "still":
        larger = angle_fits(found, own, truth, flexion, flexion, DEGREES)
        best = next((fit for fit in larger if fit.method == "angular_rate"), best)
    if best.method != "angular_rate" and truth.near and best.refused in AS_STATED:
        return ClockFit(), [finding("clock.joint_as_stated")]
    told = _told(best)
    if best.refused == "no common motion":
        told += _exchanged(found, own, joint, truth)
    return best, told


def _known(fit: ClockFit) -> float:
    return fit.correlation if np.isfinite(fit.correlation) else -1.0


def _as_read(found: JointEstimate, truth: JointTruth) -> tuple[ClockFit, list[Finding]]:
    """Of a truth on the clock of the samples; refused where both never overlap."""
    time = truth.angles.host_time_ns
    if len(time) and len(found.host_time_ns):
        begin, end = found.host_time_ns[[0, -1]]
        first, last = time[[0, -1]]
        if begin <= last and first <= end:
            return ClockFit(), []
        told = finding(
            "clock.no_overlap",
            begin_s=float(begin) / NANOSECONDS,
            end_s=float(end) / NANOSECONDS,
            truth_begin_s=float(first) / NANOSECONDS,
            truth_end_s=float(last) / NANOSECONDS,
        )
        return replace(UNFITTED, refused="no overlap"), [told]
    return replace(UNFITTED, refused="unknown"), [finding("clock.still")]


def _told(fit: ClockFit) -> list[Finding]:
    """What is to be said of a clock that was, or was not, fitted."""
    if fit.method == "angular_rate":
        shift = fit.shift_s
        if shift is None or abs(shift) < SHIFT_TOLD_S:
            return []
        return [finding("clock.shifted", shift_s=shift, correlation=fit.correlation)]
    if fit.refused == "periodic":
        shifts = ", ".join(f"{shift:+.2f}" for shift in fit.candidates_s)
        return [finding("clock.periodic", shifts_s=shifts)]
    if fit.refused == "unit":
        assert fit.unit_factor is not None
        return [finding("clock.truth_unit", factor=fit.unit_factor)]
    if fit.refused == "no common motion":
        return [finding("clock.no_common_motion", correlation=max(_known(fit), 0.0))]
    return [finding("clock.still")] if fit.refused == "still" else []


def _exchanged(
    found: JointEstimate, own: list[np.ndarray], joint: JointDefinition, truth: JointTruth
) -> list[Finding]:
    """Whether a true angle moves as another angle of the joint does."""
    names, said = decomposition_of(joint).names, []
    for place in truth.angles.given:
        for other in range(3):
            fits = angle_fits(found, own[:1], truth, [other], [place])
            if other != place and any(fit.method == "angular_rate" for fit in fits):
                code = "truth.angle_of_another"
                said.append(finding(code, angle=names[place], other=names[other]))
    return said
