"""Line format: how a board writes its samples as text; docs/devices.md explains every key."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from testbench.exceptions import NotFoundError
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.shipped import shipped_names
from testbench.records.specs.strict import StrictModel

PRESETS = Path(__file__).resolve().parent / "presets"

TIME_UNITS = {"s": NANOSECONDS, "ms": 1_000_000, "us": 1_000, "ns": 1}
"""Nanoseconds in each unit."""
ACCELERATION_UNITS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000}
"""m/s^2 in each unit."""
_DEG = 3.141592653589793 / 180
RATE_UNITS = {"rad/s": 1.0, "deg/s": _DEG, "mdeg/s": _DEG / 1000}
"""rad/s in each unit."""
FIELD_UNITS = {"uT": 1.0, "nT": 1e-3, "G": 100.0, "mG": 0.1}
"""Microtesla in each unit."""
SEPARATORS = {"space": None, "comma": b",", "semicolon": b";", "tab": b"\t"}
"""Bytes between columns; None stands for any run of blanks."""

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class TimeColumn(StrictModel):
    """The device's own clock."""

    quantity: Literal["time"]
    unit: Literal["s", "ms", "us", "ns"] = Field(description="Unit of the column.")
    wrap_bits: int | None = Field(
        default=None, ge=8, le=63, description="Width of the board's counter; null: never wraps."
    )

    @property
    def width(self) -> int:
        return 1


class _Scaled(StrictModel):
    """A physical quantity, in its unit or in raw counts."""

    counts_per_unit: float | None = Field(
        default=None,
        gt=0,
        description="Counts in one unit, for raw readings: value = (column - zero_counts) / "
        "counts_per_unit.",
    )
    zero_counts: float = Field(default=0.0, description="Column value that stands for zero.")


class _Vector(_Scaled):
    """Neighbouring columns of one triad."""

    axes: list[Axis] = Field(
        default=["x", "y", "z"],
        min_length=1,
        max_length=3,
        description="Axis of the sensor that each column holds; a minus sign turns it round.",
    )
    full_scale: float | None = Field(
        default=None,
        gt=0,
        description="Range, +- [unit]; readings at it are marked saturated, and ones beyond it are "
        "refused.",
    )

    @property
    def width(self) -> int:
        return len(self.axes)


class AccelerationColumns(_Vector):
    """Specific force."""

    quantity: Literal["acceleration"]
    unit: Literal["m/s^2", "g", "mg"] = Field(
        description="Unit of the columns, after counts_per_unit."
    )


class AngularRateColumns(_Vector):
    """Angular rate."""

    quantity: Literal["angular_rate"]
    unit: Literal["rad/s", "deg/s", "mdeg/s"] = Field(
        description="Unit of the columns, after counts_per_unit."
    )


class MagneticFieldColumns(_Vector):
    """Magnetic field."""

    quantity: Literal["magnetic_field"]
    unit: Literal["uT", "nT", "G", "mG"] = Field(
        description="Unit of the columns, after counts_per_unit."
    )


class QuaternionColumns(StrictModel):
    """The board's own orientation; four columns."""

    quantity: Literal["quaternion"]
    order: list[Literal["w", "x", "y", "z"]] = Field(
        default=["w", "x", "y", "z"],
        min_length=4,
        max_length=4,
        description="Order of the columns.",
    )
    rotates: Literal["earth_from_sensor", "sensor_from_earth"] = Field(
        default="earth_from_sensor", description="Which vectors the quaternion turns into which."
    )

    @property
    def width(self) -> int:
        return 4

    @model_validator(mode="after")
    def _each_part_once(self) -> QuaternionColumns:
        if len(set(self.order)) < 4:
            raise ValueError("order must name w, x, y and z once each")
        return self


class TemperatureColumn(_Scaled):
    """Temperature; its mean is recorded as an event now and then."""

    quantity: Literal["temperature"]
    unit: Literal["degC"] = Field(
        default="degC", description="Unit of the column, after counts_per_unit."
    )

    @property
    def width(self) -> int:
        return 1


class CounterColumn(StrictModel):
    """A number that grows by one from line to line, so that lost lines are counted."""

    quantity: Literal["counter"]
    wrap_bits: int | None = Field(
        default=None, ge=4, le=63, description="Width of the counter; null: never wraps."
    )

    @property
    def width(self) -> int:
        return 1


class IgnoredColumns(StrictModel):
    """Columns that hold something else."""

    quantity: Literal["ignored"]
    count: int = Field(default=1, ge=1, le=100, description="How many columns.")

    @property
    def width(self) -> int:
        return self.count


Column = Annotated[
    TimeColumn
    | AccelerationColumns
    | AngularRateColumns
    | MagneticFieldColumns
    | QuaternionColumns
    | TemperatureColumn
    | CounterColumn
    | IgnoredColumns,
    Field(discriminator="quantity"),
]


class Checksum(StrictModel):
    """Two or more hexadecimal digits at the end of the line, after a mark."""

    algorithm: Literal["xor", "sum"] = Field(
        description="Over the bytes between prefix and mark: exclusive or (as in NMEA 0183), or "
        "sum modulo 256."
    )
    mark: str = Field(
        default="*", min_length=1, max_length=1, description="Character before the digits."
    )


class LineFormat(StrictModel):
    """How a board writes its samples."""

    description: str = Field(min_length=1, description="What the board is, in a line.")
    source: str = Field(default="", description="Where the numbers come from.")
    rate_hz: float = Field(gt=0, le=10_000, description="Nominal number of lines in a second [Hz].")
    baud_rate: int = Field(
        default=115_200, ge=300, le=12_000_000, description="Speed of the port [bit/s]."
    )
    separator: Literal["space", "comma", "semicolon", "tab"] = Field(
        default="space", description="What stands between columns; space: any run of blanks."
    )
    prefix: str = Field(
        default="",
        max_length=32,
        description="What every line of data begins with; lines without it are faults.",
    )
    comment_prefixes: list[Annotated[str, Field(min_length=1, max_length=32)]] = Field(
        default=["#"],
        description="Lines that begin so are passed over: comments, headers, greetings.",
    )
    columns: list[Column] = Field(
        min_length=1, max_length=64, description="The columns from left to right."
    )
    checksum: Checksum | None = Field(
        default=None, description="Check digits at the end of the line; null: none."
    )
    settle_s: float = Field(
        default=0.0,
        ge=0,
        le=30,
        description="Time from opening the port to start_command [s]: some boards reboot.",
    )
    start_command: str = Field(
        default="", max_length=200, description="Text sent to make the board begin."
    )
    stop_command: str = Field(default="", max_length=200, description="Text sent to make it stop.")

    @model_validator(mode="after")
    def _is_complete(self) -> LineFormat:
        kinds = [column.quantity for column in self.columns]
        for kind in ("time", "quaternion", "temperature", "counter"):
            if kinds.count(kind) > 1:
                raise ValueError(f"columns: {kind} stands {kinds.count(kind)} times")
        for kind in ("acceleration", "angular_rate", "magnetic_field"):
            axes = sorted(
                axis[-1]
                for column in self.columns
                if column.quantity == kind
                for axis in column.axes  # type: ignore[union-attr]
            )
            if axes != ["x", "y", "z"] and (axes or kind != "magnetic_field"):
                found = ", ".join(axes) or "none"
                raise ValueError(
                    f"columns: {kind} needs the axes x, y and z once each, not {found}"
                )
        for text in (self.prefix, self.start_command, self.stop_command, *self.comment_prefixes):
            if not text.isascii():
                raise ValueError(f"{text!r} is not ASCII, which is what boards speak")
        return self

    @property
    def width(self) -> int:
        """Number of columns."""
        return sum(column.width for column in self.columns)

    def has(self, quantity: str) -> bool:
        """Whether a column holds it."""
        return any(column.quantity == quantity for column in self.columns)


def load_line_format(name: str | Path) -> LineFormat:
    """A line format by the name of one that ships with the bench, or from a YAML file.

    Raises:
        NotFoundError: It looks like a name, but no such format ships; lists those that do.
        FileProblems: The file is missing or malformed.
    """
    text = str(name)
    if text in list_line_formats():
        return load_yaml(PRESETS / f"{text}.yaml", LineFormat).value
    if not text.endswith((".yaml", ".yml")) and "/" not in text:
        raise NotFoundError("line format", text, [*list_line_formats(), "or a .yaml file"])
    return load_yaml(text, LineFormat).value


def list_line_formats() -> list[str]:
    """Names of the line formats that ship with the bench."""
    return shipped_names(PRESETS)
