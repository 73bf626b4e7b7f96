"""What the steps of building one sensor from a mapping share."""

from __future__ import annotations

from dataclasses import dataclass, field

from testbench.formats.mapped.files import Files, Meant, Place
from testbench.formats.mapping import SensorColumns
from testbench.formats.options import Options
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding


@dataclass
class Build:
    """What the steps of building one sensor share.

    Attributes:
        place: Of the sensor in the mapping.
        spec: The sensor there.
        meant: Its name and files.
        files: Of the whole recording.
        options: Answers of a person.
        findings: What was noticed so far; is added to.
    """

    place: Place
    spec: SensorColumns
    meant: Meant
    files: Files
    options: Options
    findings: list[Finding] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Of the sensor."""
        return self.meant.name

    def notice(self, code: str, **values: str | float) -> None:
        """Add a finding on this sensor."""
        self.findings.append(finding(code, self.name, **values))
