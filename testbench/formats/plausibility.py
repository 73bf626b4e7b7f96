"""Units that neither a file nor a person states, told by what the numbers say of one another.

At rest an accelerometer reads 9.81 m/s^2, and nothing else: that tells g, mg and m/s^2 apart. The
rates of a gyroscope, integrated in the right unit, turn what the accelerometer reads back to where
it was: that tells rad/s from deg/s, whatever the unit of the accelerometer.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

from testbench.consistency.evidence import Evidence, evidence_of
from testbench.exceptions import InputError
from testbench.formats.raw_counts import counts_hint, rate_factors
from testbench.formats.tables.units import Unit, find_unit, unit_names
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

UNSTATED_WITHIN = 0.2
"""|acc| at rest may differ from gravity by so much: sensors without calibration are wrong by 10 %.
"""
NO_GRAVITY_BELOW = 0.3
"""|acc| at rest in any unit: gravity is 1 g at least, so that numbers below are without it."""
MOST_CHUNKS = 20


def gather(chunks: Iterable[ImuSamples]) -> Evidence:
    """Look at the first samples of a recording, in any units."""
    return evidence_of(islice(chunks, MOST_CHUNKS))


def no_gravity(evidence: Evidence) -> bool:
    """Whether an accelerometer reads next to nothing at rest, in whatever unit."""
    return evidence.rest_norm is not None and evidence.rest_norm < NO_GRAVITY_BELOW


def unit_that_fits(quantity: str, evidence: Evidence) -> Unit | None:
    """The unit in which the numbers make sense; None where nothing, or more than one, does.

    Args:
        quantity: "acc" or "gyr".
        evidence: Of the numbers as they are.
    """
    units = [find_unit(quantity, name) for name in unit_names(quantity)]
    if quantity == "gyr":
        name = evidence.unit_of_rate(rate_factors())
        return next((unit for unit in units if unit.name == name), None)
    norm = evidence.rest_norm
    if norm is None:
        return None
    fitting = [u for u in units if abs(norm * u.factor / STANDARD_GRAVITY - 1) < UNSTATED_WITHIN]
    return fitting[0] if len(fitting) == 1 else None


def told_unit(quantity: str, evidence: Evidence, sensor: str, answer: str) -> tuple[Unit, Finding]:
    """The unit of numbers whose file states none, and the finding that says so.

    Args:
        quantity: "acc" or "gyr".
        evidence: Of the numbers as they are.
        sensor: Its name.
        answer: How a person states the unit.

    Raises:
        InputError: It cannot be told; asks the person, and says how to answer.
    """
    unit = _decide(quantity, evidence, sensor, answer)
    if quantity == "gyr":
        return unit, finding("unit.gyr_by_turns", sensor, unit=unit.name, answer=answer)
    norm = float(evidence.rest_norm or 0.0)
    return unit, finding("unit.acc_by_gravity", sensor, unit=unit.name, norm=norm, answer=answer)


def _decide(quantity: str, evidence: Evidence, sensor: str, answer: str) -> Unit:
    """The unit of numbers; raises where it cannot be told."""
    if evidence.time is not None:
        raise InputError(f"sensor '{sensor}': {evidence.time}")
    fitting = unit_that_fits(quantity, evidence)
    if fitting is not None:
        return fitting
    choices = ", ".join(unit_names(quantity))
    if quantity == "acc" and no_gravity(evidence):
        raise InputError(
            f"sensor '{sensor}': its accelerometer reads {evidence.rest_norm:.4g} at rest, which "
            "is no gravity in any unit: gravity was removed. Take the columns (or the file) with "
            f"gravity; if it is there, state the unit with {answer} ({choices})."
        )
    word = "accelerometer" if quantity == "acc" else "gyroscope"
    if quantity == "acc":
        seen = (
            "it is never at rest"
            if evidence.rest_norm is None
            else f"|acc| at rest is {evidence.rest_norm:.4g}, which is no gravity"
        )
    else:
        seen = "it hardly turns, or not as the accelerometer does, which thus cannot tell"
    raise InputError(
        f"sensor '{sensor}': in which unit is the {word}? The file does not say, and {seen}. "
        f"Answer with {answer} ({choices}).{counts_hint(quantity, evidence)}"
    )
