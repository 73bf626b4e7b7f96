"""Several sensors and their truths: one that moved as the truth of another says is not judged."""

from __future__ import annotations

from collections.abc import Mapping

from testbench.estimation.alignment.true_motion import TrueMotion, sensor_clock, turning_instants
from testbench.estimation.alignment.truth_reading import confused, fit_rates
from testbench.estimation.signals.access import SampleAccess
from testbench.records.findings.finding import Finding
from testbench.records.session.manifest import SensorRecord

WELL, BEST = 0.95, 0.999
"""A truth that explains more is the sensor's own; one that steps or parts besides is so only beyond
the second: the other leg of a walk, half a stride later, explains up to 99 % [1].
"""
ODD = {"truth.stepped", "truth.parts", "truth.parts_throughout"}
"""What is found, too, where a truth is that of a body which moves nearly alike."""
MISREAD = {"truth.order", "truth.direction", "truth.order_or_direction"}
"""What is wrong with a truth that is the sensor's own."""
ANY_AXES = 0.0
"""A walk turns about little more than one axis; how fast tells one body from another [1]."""
BY_A_WRONG_TRUTH = {"clock.no_common_motion", "clock.periodic", "truth.foreign", *ODD}
"""What is found where a sensor is compared with what another one went through."""


def name_confused(
    found: Mapping[str, TrueMotion],
    access: Mapping[str, SampleAccess],
    described: Mapping[str, SensorRecord],
    align: bool,
) -> dict[str, Finding]:
    """Sensors that moved as the truth of another says, by name.

    Args:
        found: Each sensor and its truth.
        access: To the samples of each.
        described: What is known of each.
        align: Whether clocks are to be fitted.
    """
    result = {}
    for name, own in found.items():
        if own.truth is None or own.unaligned in MISREAD:
            continue
        read = access[name]
        instants = turning_instants(read, own.clock, described[name])
        fit = None
        if own.unaligned not in ("clock.no_common_motion", "clock.no_overlap"):
            fit = fit_rates(read.turned, instants, own.truth, ANY_AXES)
            odd = any(found.code in ODD for found in own.findings)
            if fit is None or fit.explained > (BEST if odd else WELL):
                continue
        others = {}
        for other, motion in found.items():
            if other != name and motion.truth is not None:
                times = None
                if align:
                    clock = sensor_clock(
                        read.samples, motion.truth, described[name], align, read.every
                    )
                    if clock.method == "arrival":
                        continue
                    times = turning_instants(read, clock, described[name])
                others[other] = motion.truth, times
        wrong = confused(read.turned, instants, fit, others, ANY_AXES)
        if wrong is not None:
            result[name] = wrong
    return result


def in_place_of_comparison(findings: list[Finding], why: Finding) -> list[Finding]:
    """Findings of a sensor whose truth is another's: what the comparison of both said gives way.

    Args:
        findings: So far.
        why: Says whose truth it is.
    """
    kept = [
        found
        for found in findings
        if found.code not in BY_A_WRONG_TRUTH and not found.code.startswith("axes.")
    ]
    return [*kept, why]
