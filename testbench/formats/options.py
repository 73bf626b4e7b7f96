"""What a person tells an importer beyond the files: answers to what a file leaves open."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.tables.units import QUANTITIES, Unit, find_unit

ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252")
"""Of text files, as Python knows them."""


@dataclass
class Options:
    """Answers for an importer.

    One that no importer asked for is refused, because it would silently do nothing.

    Attributes:
        mapping: Path or name of a mapping of the generic format.
        rate: Sampling rate [Hz].
        units: Unit by quantity (acc, gyr, mag, time).
        axes: Axis map for every sensor, by name or as "x: -z, y: -y, z: -x".
        recorded_at: When it was recorded, ISO 8601, where the files do not say, or say it wrongly.
        encoding: Of text files; None to go by their first bytes.
        hemisphere: Where it was recorded, which tells whether the magnetic field points down.
        simulated: Whether the samples come from a model.
        asked: What an importer has asked for so far.
    """

    mapping: str | None = None
    rate: float | None = None
    units: dict[str, str] = field(default_factory=dict)
    axes: str | None = None
    recorded_at: str | None = None
    encoding: str | None = None
    hemisphere: Literal["north", "south"] | None = None
    simulated: bool = False
    asked: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        for quantity, unit in self.units.items():
            if quantity not in (*QUANTITIES, "time"):
                raise InputError(
                    f"--unit {quantity}={unit}: unknown quantity '{quantity}'; known: "
                    f"{', '.join(QUANTITIES)}, time"
                )
            find_unit(quantity, unit)
        if self.encoding is not None and self.encoding not in ENCODINGS:
            raise NotFoundError("encoding (--encoding)", self.encoding, list(ENCODINGS))
        if self.rate is not None and not 0.01 <= self.rate <= 100_000:
            raise InputError(
                f"--rate {self.rate:g}: a sampling rate lies between 0.01 and 100000 Hz"
            )

    def unit(self, quantity: str, stated: str | None) -> Unit | None:
        """The unit of a quantity.

        It is as the person says, else as the file or its format states, else None.

        Args:
            quantity: "acc", "gyr", "mag" or "time".
            stated: Name of the unit, None where neither file nor format states one.
        """
        self.asked.add(quantity)
        name = self.units.get(quantity, stated)
        return None if name is None else find_unit(quantity, name)

    def answered(self, quantity: str) -> bool:
        """Whether the person stated the unit, which settles every doubt."""
        return quantity in self.units

    def rate_or(self, stated: float | None) -> float | None:
        """The rate that the person says, else the given one [Hz]."""
        self.asked.add("rate")
        return self.rate if self.rate is not None else stated

    def encoding_or(self, stated: str | None) -> str | None:
        """The encoding of text files that the person says, else the given one."""
        self.asked.add("encoding")
        return self.encoding if self.encoding is not None else stated

    def mapping_name(self) -> str | None:
        """The mapping, if one was given."""
        self.asked.add("mapping")
        return self.mapping

    def check_all_used(self, format_name: str) -> None:
        """Refuse what was said but not needed.

        Raises:
            InputError: Names the options that have no effect.
        """
        given = [
            f"--unit {quantity}={unit}"
            for quantity, unit in self.units.items()
            if quantity not in self.asked
        ]
        given += ["--rate"] if self.rate is not None and "rate" not in self.asked else []
        given += ["--mapping"] if self.mapping is not None and "mapping" not in self.asked else []
        given += (
            ["--encoding"] if self.encoding is not None and "encoding" not in self.asked else []
        )
        if given:
            raise InputError(
                f"{', '.join(given)}: has no effect on files of the format {format_name}; leave it "
                "out"
            )
