"""Several sensors and their truths: one that moved as the truth of another says is not judged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.estimation.alignment.true_motion import TrueMotion, sensor_clock, turning_instants
from testbench.estimation.alignment.truth_reading import RateFit, confused, fit_rates
from testbench.estimation.signals.access import SampleAccess
from testbench.records.findings.finding import Finding
from testbench.records.session.manifest import SensorRecord

WELL, BEST = 0.95, 0.999
"""A truth that explains more is the sensor's own; one that steps or parts besides is so only beyond
the second: the other leg of a walk, half a stride later, explains up to 99 % [1].
"""
ODD = {"truth.stepped", "truth.parts", "truth.parts_throughout"}
"""What is found, too, where a truth is that of a body which moves nearly alike."""
MISREAD = {
    "truth.order",
    "truth.direction",
    "truth.order_or_direction",
    "truth.joints_not_judged",
    "truth.not_the_links",
}
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
        read = access[name]
        compared = _compared(own, read, described[name])
        if compared is None:
            continue
        instants, fit = compared
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


def is_suspect(own: TrueMotion, read: SampleAccess, described: SensorRecord) -> bool:
    """Whether a sensor may have moved as the truth of another says; what others went through need
    not be known for it.

    Args:
        own: The sensor and its truth.
        read: Its samples.
        described: What is known of it.
    """
    return _compared(own, read, described) is not None


def _compared(
    own: TrueMotion, read: SampleAccess, described: SensorRecord
) -> tuple[np.ndarray, RateFit | None] | None:
    """Instants that a sensor's rates are of, shape (n,) [ns], and how well its own truth fits them;
    None where that says nothing, or is its own.
    """
    if own.truth is None or own.unaligned in MISREAD:
        return None
    instants = turning_instants(read, own.clock, described)
    if own.unaligned in ("clock.no_common_motion", "clock.no_overlap"):
        return instants, None
    fit = fit_rates(read.turned, instants, own.truth, ANY_AXES)
    odd = any(found.code in ODD for found in own.findings)
    if fit is None or fit.explained > (BEST if odd else WELL):
        return None
    return instants, fit


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
