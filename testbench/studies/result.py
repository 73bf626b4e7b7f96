"""What a question to one session answers: tables, curves and surfaces, before a study keeps
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from testbench.records.results.study import StudyCurves, StudyRecord, StudySurface, StudyTable
from testbench.records.session.session_writer import software_versions


@dataclass(frozen=True)
class StudyResult:
    """All that a study found.

    Attributes:
        findings: The answer, in sentences.
        source: The publication it stands beside, as cited.
    """

    source: str
    findings: tuple[str, ...]
    tables: tuple[StudyTable, ...]
    curves: tuple[StudyCurves, ...] = ()
    surfaces: tuple[StudySurface, ...] = ()

    def table(self, key: str) -> StudyTable:
        """A table by its key.

        Raises:
            KeyError: No such table.
        """
        return {table.key: table for table in self.tables}[key]

    def record(
        self,
        name: str,
        title: str,
        question: str,
        started_utc: str,
        settings: dict[str, Any],
        sessions: Sequence[str],
        trace: str = "",
    ) -> StudyRecord:
        """The study to be kept; see `StudyRecord` for the arguments."""
        return StudyRecord(
            name,
            title,
            question,
            self.source,
            started_utc,
            settings,
            tuple(sessions),
            self.findings,
            self.tables,
            software=software_versions(),
            curves=self.curves,
            surfaces=self.surfaces,
            trace=trace,
        )
