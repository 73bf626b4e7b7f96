"""A certificate of any kind: what is its own, and what is the same for all kinds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from testbench.clock import utc_text
from testbench.records.results.certificate import Certificate, Kind
from testbench.records.session.session import Session
from testbench.records.specs.laboratory import Laboratory, Statement
from testbench.reporting.certificate.identification import (
    conditions_of,
    items_of,
    parties_of,
    session_entries,
)
from testbench.reporting.certificate.parts import Parts
from testbench.reporting.certificate.statements import (
    blanks,
    simulated_sentences,
    traceability_of,
    validity_of,
)


@dataclass(frozen=True)
class Issue:
    """Who issues a certificate, and when.

    Attributes:
        laboratory: That issues it.
        stated: What it states beside the session.
        moment: When.
        software: What it is set by.
    """

    laboratory: Laboratory
    stated: Statement
    moment: datetime
    software: str


@dataclass(frozen=True)
class Recorded:
    """What a certificate is of.

    Attributes:
        session: The recording, found to be what was recorded.
        sensors: Of which the results are.
        files: How many raw files were compared with their hashes.
        sealed: Whether somebody signed its manifest.
    """

    session: Session
    sensors: Sequence[str]
    files: int
    sealed: bool


def certificate_of(kind: Kind, parts: Parts, recorded: Recorded, issue: Issue) -> Certificate:
    """A certificate, with its number.

    Args:
        kind: Of which of three kinds.
        parts: What is its own.
        recorded: What it is of.
        issue: Who issues it, and when.

    Raises:
        NotFoundError: Something is stated of another sensor.
        InputError: What is stated contradicts the session.
    """
    session, laboratory, stated = recorded.session, issue.laboratory, issue.stated
    parties = parties_of(laboratory, stated)
    items = items_of(session, recorded.sensors, stated)
    described = session_entries(session, recorded.files, recorded.sealed)
    conditions = conditions_of(session, recorded.sensors, laboratory, stated)
    lone = [("", own) for own in (*parties, *described, *conditions)]
    of_items = [(item.sensor, own) for item in items for own in item.entries]
    return Certificate(
        schema_version=1,
        kind=kind,
        number="",
        title=parts.title,
        issued_utc=utc_text(issue.moment),
        issued_with=issue.software,
        simulated=" ".join(simulated_sentences(session)),
        summary=parts.summary,
        laboratory=laboratory,
        parties=parties,
        items=items,
        session=described,
        conditions=conditions,
        procedure=parts.procedure,
        results=parts.results,
        figures=parts.figures,
        findings=parts.findings,
        conformity=parts.conformity,
        uncertainty=parts.uncertainty,
        traceability=traceability_of(session, laboratory, parts),
        not_claimed=parts.not_claimed,
        validity=validity_of(session, laboratory),
        blank=blanks([*lone, *of_items]),
    ).numbered()
