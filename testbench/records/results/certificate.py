"""Certificate: what a laboratory states of a sensor or of a test, after ISO/IEC 17025:2017, 7.8.

The record is the machine-readable form. The page is set from it and from nothing else.
"""

from __future__ import annotations

import hashlib
import json
from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from testbench.clock import utc_name
from testbench.records.disk.json_file import json_text
from testbench.records.results.calibration_file import FindingEntry
from testbench.records.results.quantity import Quantity
from testbench.records.specs.laboratory import Laboratory
from testbench.records.specs.shipped import shipped_data
from testbench.records.specs.strict import StrictModel, UtcText

DIALECT = "https://json-schema.org/draft/2020-12/schema"
SCHEMA_FILE = shipped_data("reporting", "certificate") / "schema.json"
Kind = Literal["noise", "calibration", "test"]
LETTERS: dict[Kind, str] = {"noise": "N", "calibration": "C", "test": "T"}
"""That numbers of certificates begin with."""


class Entry(StrictModel):
    """One thing that identifies something; blank on the page where nobody states it."""

    name: str = Field(description="What it is.")
    value: str | None = Field(description="null: left blank.")
    remark: str = Field(default="", description="Who states it, or why it is blank.")


class Item(StrictModel):
    """A sensor that the results are of."""

    sensor: str = Field(description="Its name in the session.")
    entries: list[Entry] = Field(description="What identifies it.")


class ResultRow(StrictModel):
    """Quantities of one kind, one a column of the table."""

    of: list[str] = Field(description="What they are, one text for each entry of the table's `of`.")
    key: str = Field(description="What the bench's own files call it.")
    unit: str = Field(description="Of all of them.")
    quantities: list[Quantity] = Field(description="One for each of the table's `columns`.")
    more: list[str] = Field(default=[], description="One for each of the table's `more`.")
    outcome: str = Field(default="", description="Of the limit: pass, marginal, fail, ...")


class ResultTable(StrictModel):
    """Results that stand beside one another."""

    title: str = Field(description="What they are.")
    of: list[str] = Field(description="Titles of the words that rows begin with.")
    columns: list[str] = Field(description="Titles of the quantities.")
    more: list[str] = Field(default=[], description="Titles of the words behind the quantities.")
    rows: list[ResultRow] = Field(description="Its rows.")
    notes: list[str] = Field(default=[], description="What is to be known of them.")


class FigureCurve(StrictModel):
    """A curve, or single points; numbers to three digits, for a picture."""

    name: str = Field(description="In the legend.")
    x: list[float] = Field(description="Abscissae, or places of rows from 0.")
    y: list[float] = Field(description="Ordinates, or values of rows.")
    lower: list[float] = Field(default=[], description="Lower ends of intervals.")
    upper: list[float] = Field(default=[], description="Upper ends of intervals.")


class Figure(StrictModel):
    """A picture of results."""

    title: str = Field(description="What is drawn.")
    kind: Literal["log_log", "points", "intervals"] = Field(
        description="Curves on two logarithmic axes, points over their number, or values with "
        "intervals, one row each."
    )
    x_title: str = Field(description="Of the abscissa.")
    y_title: str = Field(description="Of the ordinate; of intervals none.")
    curves: list[FigureCurve] = Field(description="What is drawn.")
    rows: list[str] = Field(default=[], description="Names of the rows of intervals.")
    limits: list[list[float]] = Field(default=[], description="Limits of each row.")


class Certificate(StrictModel):
    """All that a certificate states."""

    schema_version: Literal[1] = Field(description="1.")
    kind: Kind = Field(description="Of which of three kinds it is.")
    number: str = Field(description="By which it is referred to; ends in digits of its hash.")
    title: str = Field(description="Of the document.")
    issued_utc: UtcText = Field(description="When it was issued, ISO 8601.")
    issued_with: str = Field(description="Version of the bench that wrote it.")
    simulated: str = Field(description="What of it comes from a model; empty: nothing.")
    summary: list[str] = Field(description="What was found, in sentences.")
    laboratory: Laboratory = Field(description="Who issues it.")
    parties: list[Entry] = Field(description="Customer, operator, who authorises it.")
    items: list[Item] = Field(description="What was calibrated or tested.")
    session: list[Entry] = Field(description="The recording that the results are of.")
    conditions: list[Entry] = Field(description="Under which it was made.")
    procedure: list[str] = Field(description="How the results were come to.")
    results: list[ResultTable] = Field(description="The results.")
    figures: list[Figure] = Field(default=[], description="Pictures of them.")
    findings: list[FindingEntry] = Field(description="What may change a conclusion.")
    conformity: list[str] = Field(default=[], description="By which rule limits are kept.")
    uncertainty: list[str] = Field(description="What the uncertainties hold, and what not.")
    traceability: list[str] = Field(description="What the references are traceable to.")
    not_claimed: list[str] = Field(description="What the certificate does not state.")
    validity: list[str] = Field(description="What the results hold for.")
    blank: list[str] = Field(description="What was left blank, and why.")

    def numbered(self) -> Certificate:
        """The same with its number: by kind, date and the hash of its content."""
        content = self.model_copy(update={"number": ""}).text()
        short = hashlib.sha256(content.encode()).hexdigest()[:8]
        day = utc_name(datetime.fromisoformat(self.issued_utc))
        return self.model_copy(update={"number": f"{LETTERS[self.kind]}-{day}-{short}"})

    def text(self) -> str:
        """The content of its JSON file."""
        return json_text(self.model_dump(mode="json"))


def certificate_schema() -> dict[str, Any]:
    """The schema of a certificate's JSON file (JSON Schema, draft 2020-12)."""
    schema = Certificate.model_json_schema()
    for part in (schema, *schema["$defs"].values()):
        if "description" in part:
            part["description"] = " ".join(part["description"].split())
    return {"$schema": DIALECT, **schema, "title": "testbench certificate"}


def schema_text() -> str:
    """The schema as the text of the file that ships."""
    return json.dumps(certificate_schema(), indent=2, ensure_ascii=False) + "\n"
