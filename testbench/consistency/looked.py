"""What a recording showed so far, and what is still to be looked at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from testbench.consistency.excerpt import Excerpt
from testbench.consistency.fits import Reading
from testbench.consistency.gain import Gain
from testbench.consistency.still_intervals import Rests
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding


@dataclass(frozen=True)
class Up:
    """What is known of the vertical beside the samples of a sensor.

    Attributes:
        hemisphere: Where they were recorded, None where nobody says.
        by_truth: Whether they are compared with a truth, which tells up from down.
    """

    hemisphere: Literal["north", "south"] | None = None
    by_truth: bool = False


UNKNOWN_UP = Up()


@dataclass
class Looked:
    """What a recording showed, and what is still to be looked at.

    Attributes:
        excerpt: Of the recording.
        seconds: Of a step, by the sensor's stamps.
        findings: So far.
        unchecked: What its motion does not show.
        rests: What was read at rest, once it is looked for.
        by_gravity: How the gyroscope fits gravity; None where that was not compared.
        gain: How many times what it reads the gyroscope turned; None where nothing tells.
    """

    excerpt: Excerpt
    seconds: float
    findings: list[Finding]
    unchecked: list[str]
    rests: Rests | None = None
    by_gravity: Reading | None = None
    gain: Gain | None = None

    def tell(self, code: str, **values: str | float | list[str]) -> None:
        """Add a finding."""
        self.findings.append(finding(f"consistency.{code}", "", **values))
