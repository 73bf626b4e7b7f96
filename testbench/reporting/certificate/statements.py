"""What every certificate states beside its results: whence, how sure, how far, and what not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, Severity
from testbench.records.results.calibration_file import FindingEntry
from testbench.records.results.certificate import Entry
from testbench.records.session.manifest import ENDED, RunStatus
from testbench.records.session.session import Session
from testbench.records.specs.laboratory import Laboratory
from testbench.reporting.certificate import words
from testbench.reporting.certificate.parts import Parts
from testbench.reporting.sections.run import simulated_parts

PARTIAL = "run.resumed"
"""A note that says that some of the results lie in another session."""


def weighty(findings: Iterable[Finding], others: Sequence[str] = ()) -> list[FindingEntry]:
    """Findings that may change a conclusion, each once.

    Args:
        findings: All that was noticed.
        others: What the results are not of: findings of these are left out.
    """
    told = {
        str(own): own
        for own in findings
        if (own.severity is Severity.WARNING or own.code == PARTIAL) and own.where not in others
    }
    return [FindingEntry.model_validate(asdict(own)) for own in told.values()]


def ended_early(session: Session) -> list[Finding]:
    """That a run did not complete, where no evaluation says so."""
    if session.status is RunStatus.COMPLETED:
        return []
    message = session.manifest.message or "it did not finish"
    return [finding("run.incomplete", how=ENDED[session.status], message=message)]


def simulated_sentences(session: Session) -> list[str]:
    """What a simulated certificate is worth; none where nothing was simulated."""
    parts = simulated_parts(session)
    if not parts:
        return []
    return [words.SIMULATED.format(parts=parts)]


def traceability_of(session: Session, laboratory: Laboratory, parts: Parts) -> list[str]:
    """What the results are traceable to, which the bench knows nothing of.

    Args:
        session: The recording.
        laboratory: Who states a traceability, if anybody does.
        parts: What the results were held against, and whether that can be traceable.
    """
    if simulated_parts(session):
        return [words.NOTHING_MEASURED, *parts.references]
    if parts.untraceable:
        return [parts.untraceable, *parts.references]
    if laboratory.traceability:
        stated = words.LABORATORY_STATES.format(text=laboratory.traceability.strip())
        return [*parts.references, stated]
    return [words.NOT_TRACEABLE, *parts.references]


def arm_reference(session: Session) -> list[str]:
    """What an arm's orientations rest on."""
    robot = session.robot
    if robot is None:
        return []
    why = " ".join(robot.spec.uncertainty.why.split())
    return [words.ARM_REFERENCE.format(arm=robot.name, why=why)]


def truth_references(session: Session) -> list[str]:
    """What the truth is: the arm's, or that which came with a recording."""
    if session.has_protocol:
        return arm_reference(session)
    told = []
    for name, record in session.manifest.sensors.items():
        if session.truth_file(name) is not None:
            known = "nobody states how far it may be off"
            if record.truth_sd_deg is not None:
                known = f"standard uncertainty {record.truth_sd_deg:.2g} deg about each axis"
                known += f", {record.truth_sd_from}" if record.truth_sd_from else ""
            truth = record.truth or "the orientations that came with the recording"
            told.append(f"Reference of {name}: {truth}; {known}.")
    return told


def validity_of(session: Session, laboratory: Laboratory) -> list[str]:
    """What any results hold for."""
    told = [words.ONLY_ITEMS, words.NO_INTERVAL, words.IN_FULL]
    if simulated_parts(session) or laboratory.accreditation is None:
        return [*told, words.NO_ACCREDITATION]
    return [*told, words.ACCREDITATION.format(text=laboratory.accreditation)]


def blanks(entries: Iterable[tuple[str, Entry]]) -> list[str]:
    """What was left blank, and why, a phrase each.

    Args:
        entries: With the sensor that each is of, "" for none.
    """
    return [
        f"{own.name[:1].lower()}{own.name[1:]}{f' of {sensor}' if sensor else ''} ({own.remark})"
        for sensor, own in entries
        if own.value is None
    ]
