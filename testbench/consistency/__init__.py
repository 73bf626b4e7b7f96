"""Self-consistency: whether the quantities of a sensor can all be what they are taken for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from testbench.consistency.checks import CONTRADICTIONS, check_excerpt
from testbench.consistency.excerpt import Thinner
from testbench.consistency.looked import UNKNOWN_UP, Up
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

MOST_AT_REST = 10 * STANDARD_GRAVITY
"""|acc| at rest that no person can confirm [m/s^2]: counts, or mg, in a wrong unit."""


class Consistency:
    """What the quantities of a sensor say of one another, without a truth, of samples that go by on
    their way elsewhere.
    """

    def __init__(self) -> None:
        self._thinner = Thinner()

    def look(self, chunk: ImuSamples) -> None:
        """Take the next samples.

        Args:
            chunk: In the order of time, in the units of a session.
        """
        self._thinner.add(chunk)

    def watch(self, chunks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        """The chunks as they are, each looked at before it goes on."""
        for chunk in chunks:
            self.look(chunk)
            yield chunk

    def findings(self, up: Up = UNKNOWN_UP) -> list[Finding]:
        """What was noticed of the chunks that went by.

        Args:
            up: What is known of the vertical beside them.
        """
        excerpt = self._thinner.excerpt()
        return [] if excerpt is None else check_excerpt(excerpt, up)


def refuse_contradictions(
    sensor: str, findings: Iterable[Finding], answered: Collection[str] = ()
) -> None:
    """Ask about what cannot be right, unless a person confirmed it.

    Args:
        sensor: Its name.
        findings: On its samples.
        answered: Quantities whose units were stated: "acc", "gyr", "mag", "time".

    Raises:
        InputError: Says what is seen, what it means, and how to answer.
    """
    for found in findings:
        norm = found.values.get("norm_m_s2")
        if isinstance(norm, float) and norm > MOST_AT_REST:
            raise InputError(
                f"sensor '{sensor}': |acc| is {norm:.4g} m/s^2 at rest or on the average, where "
                "gravity is 9.81: no unit that is stated can confirm that. Raw counts want the "
                "keys acc.scale (1/16384 of 2 g ranges of 16 bits) and acc.unit of a mapping; "
                "`testbench import --guess FILE` looks which"
            )
        about = CONTRADICTIONS.get(found.code)
        if about is not None and not about & set(answered):
            raise InputError(f"sensor '{sensor}': {found}")
