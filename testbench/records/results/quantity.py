"""A quantity as certificates state it: no digit finer than the second of its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Self

from pydantic import Field

from testbench.records.results.numbers import exponent_of
from testbench.records.specs.strict import StrictModel

MOST_DECIMALS, MOST_DIGITS = 5, 6
"""What has more decimals, or more digits before the point, is written with a power of ten."""
NOT_KNOWN = "not known"
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


class Quantity(StrictModel):
    """A value with its expanded uncertainty, both rounded to the second significant digit of the
    latter (JCGM 100:2008, 7.2.6), to that of the value itself where none is stated.
    """

    shown: str = Field(description="Both as they stand on the certificate.")
    value: float | None = Field(description="Rounded; null: not observed.")
    expanded_uncertainty: float | None = Field(description="Rounded; null: not stated.")
    coverage_factor: float | None = Field(description="k, for 95 %; null: not stated.")
    lacking: str = Field(default="", description="Why there is no value, or no uncertainty.")

    @classmethod
    def of(
        cls, value: float | None, expanded: float | None, k: float | None, lacking: str = ""
    ) -> Self:
        """A value as it is stated.

        Args:
            value: In its unit; None where there is none.
            expanded: Its expanded uncertainty in the same unit; None where it is not known.
            k: Coverage factor of that.
            lacking: Why one of both is not known.
        """
        if value is None or not isfinite(value):
            return cls(
                shown="–",
                value=None,
                expanded_uncertainty=None,
                coverage_factor=None,
                lacking=lacking or NOT_KNOWN,
            )
        if expanded is None or not isfinite(expanded) or expanded <= 0:
            rounded = rounding(value, value)
            return cls(
                shown=rounded.words(value),
                value=rounded.number(value),
                expanded_uncertainty=None,
                coverage_factor=None,
                lacking=lacking or NOT_KNOWN,
            )
        rounded = rounding(value, expanded)
        return cls(
            shown=rounded.words(value, expanded),
            value=rounded.number(value),
            expanded_uncertainty=rounded.number(expanded),
            coverage_factor=None if k is None else round(k, 2),
            lacking=lacking,
        )

    @classmethod
    def count(cls, number: int) -> Self:
        """A count, which is exact."""
        return cls(
            shown=str(number),
            value=float(number),
            expanded_uncertainty=None,
            coverage_factor=None,
            lacking="a count, which is exact",
        )


@dataclass(frozen=True)
class Rounding:
    """How a value and its uncertainty are written alike.

    Attributes:
        decimals: After the point; negative where tens, hundreds, ... are not known.
        power: Of ten, that is written behind both.
    """

    decimals: int
    power: int

    def number(self, value: float) -> float:
        """Rounded."""
        return round(value, self.decimals) + 0.0  # no negative zero

    def digits(self, value: float) -> str:
        """Rounded, in units of the power of ten, with a true minus sign."""
        shown = f"{self.number(value) / 10.0**self.power:.{self.decimals + self.power}f}"
        return shown.replace("-", "−")

    def words(self, value: float, expanded: float | None = None) -> str:
        """A value, with its uncertainty where there is one."""
        both = self.digits(value) if expanded is None else f"{self.digits(value)} ± "
        both += "" if expanded is None else self.digits(expanded)
        if not self.power:
            return both
        raised = f"·10{str(self.power).translate(_RAISED)}"
        return both + raised if expanded is None else f"({both}){raised}"


def rounding(value: float, expanded: float) -> Rounding:
    """The rounding to the second significant digit of an uncertainty.

    Args:
        value: That is rounded.
        expanded: Its uncertainty; the value itself where that is not known.
    """
    decimals = 1 - exponent_of(expanded)
    largest = exponent_of(max(abs(value), abs(expanded)))
    plain = 0 <= decimals <= MOST_DECIMALS and largest < MOST_DIGITS
    return Rounding(decimals, 0 if plain else largest)
