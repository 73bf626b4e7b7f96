"""Parse a board's lines by their format, fast enough for several boards at hundreds a second."""

from __future__ import annotations

import math
from dataclasses import dataclass

from testbench.drivers.imus.line_format import (
    ACCELERATION_UNITS,
    FIELD_UNITS,
    RATE_UNITS,
    SEPARATORS,
    TIME_UNITS,
    AccelerationColumns,
    AngularRateColumns,
    Checksum,
    CounterColumn,
    LineFormat,
    MagneticFieldColumns,
    QuaternionColumns,
    TemperatureColumn,
    TimeColumn,
)

NEAR_FULL_SCALE = 0.999
"""Readings from this part of the full scale on count as saturated: the last count or printed digit
lies just below it.
"""
BEYOND_FULL_SCALE = 1.05
"""Readings beyond this part of it cannot come from the sensor; a digit was lost or doubled on the
line.
"""
QUATERNION_TOLERANCE = 0.05
"""A quaternion's norm may differ from 1 by as much, as boards print few digits."""

LATEST_NS = 2**62
"""Times beyond this do not fit in a recording [ns]: 146 years."""


@dataclass(slots=True)
class Line:
    """What a line said.

    Attributes:
        time_ns: The board's clock [ns], as sent; None without a time column.
        counter: As sent, or None.
        values: Angular rate [rad/s], specific force [m/s^2], field [uT] and quaternion
            (q_earth_from_sensor, w x y z), the latter two where the format has them.
        saturated: A reading is at full scale.
        temperature: [degC], or None.
    """

    time_ns: int | None
    counter: int | None
    values: tuple[float, ...]
    saturated: bool
    temperature: float | None


class MalformedLine(ValueError):
    """A line does not fit its format; says why."""


class LineParser:
    """Parses lines of one format.

    Args:
        line_format: The format.
    """

    def __init__(self, line_format: LineFormat):
        self._separator = SEPARATORS[line_format.separator]
        self._prefix = line_format.prefix.encode("ascii")
        self._comments = tuple(text.encode("ascii") for text in line_format.comment_prefixes)
        self._checksum: Checksum | None = line_format.checksum
        self._width = line_format.width
        self._zero = [0.0] * self._width
        self._factor = [1.0] * self._width
        self._limits: list[tuple[int, float, float]] = []
        self._time: tuple[int, int] | None = None
        self._counter: int | None = None
        self._temperature: int | None = None
        self._conjugate = False
        self._quaternion: list[int] = []
        self._order = self._arrange(line_format)

    def _arrange(self, line_format: LineFormat) -> list[int]:
        """Note where each quantity stands; returns the columns in the order of `Line.values`,
        without the quaternion.
        """
        places: dict[tuple[str, str], int] = {}
        at = 0
        for column in line_format.columns:
            match column:
                case TimeColumn():
                    self._time = (at, TIME_UNITS[column.unit])
                case CounterColumn():
                    self._counter = at
                case TemperatureColumn():
                    self._temperature = at
                    self._zero[at], self._factor[at] = (
                        column.zero_counts,
                        1 / (column.counts_per_unit or 1.0),
                    )
                case QuaternionColumns():
                    self._quaternion = [
                        at + column.order.index(part) for part in ("w", "x", "y", "z")
                    ]
                    self._conjugate = column.rotates == "sensor_from_earth"
                case AccelerationColumns() | AngularRateColumns() | MagneticFieldColumns():
                    unit = (ACCELERATION_UNITS | RATE_UNITS | FIELD_UNITS)[column.unit]
                    for i, axis in enumerate(column.axes, at):
                        sign = -1.0 if axis.startswith("-") else 1.0
                        places[column.quantity, axis[-1]] = i
                        self._zero[i], self._factor[i] = (
                            column.zero_counts,
                            sign * unit / (column.counts_per_unit or 1.0),
                        )
                        if column.full_scale is not None:
                            full = column.full_scale * unit
                            self._limits.append(
                                (i, NEAR_FULL_SCALE * full, BEYOND_FULL_SCALE * full)
                            )
                case _:
                    pass
            at += column.width
        kinds = ("angular_rate", "acceleration", "magnetic_field")
        return [
            places[kind, axis]
            for kind in kinds
            for axis in ("x", "y", "z")
            if (kind, axis) in places
        ]

    # One piece, since it runs once a sample and calls would cost more than the checks.
    def parse(self, line: bytes) -> Line | None:
        """Read one line, without its end; None for a comment or an empty line.

        Raises:
            MalformedLine: It does not fit the format.
        """
        line = line.strip()
        if not line or (self._comments and line.startswith(self._comments)):
            return None
        if self._prefix:
            if not line.startswith(self._prefix):
                raise MalformedLine(f"does not begin with {self._prefix.decode()!r}")
            line = line[len(self._prefix) :]
        if self._checksum is not None:
            line = self._checked(line, self._checksum)
        fields = line.split(self._separator)
        if len(fields) != self._width:
            raise MalformedLine(f"has {len(fields)} columns, not {self._width}")
        try:
            values = [
                (float(text) - zero) * factor
                for text, zero, factor in zip(fields, self._zero, self._factor, strict=True)
            ]
        except ValueError:
            raise MalformedLine("holds something that is no number") from None
        if b"_" in line or not math.isfinite(sum(values)):  # float() reads 1_0, nan and inf
            raise MalformedLine("holds something that is no finite number")
        time = None if self._time is None else round(values[self._time[0]] * self._time[1])
        if time is not None and abs(time) > LATEST_NS:
            raise MalformedLine("holds a time that no board counts to")
        saturated = False
        for i, near, beyond in self._limits:
            size = abs(values[i])
            if size >= near:
                if size > beyond:
                    raise MalformedLine("holds a reading beyond the sensor's range")
                saturated = True
        reading = tuple([values[i] for i in self._order])
        if self._quaternion:
            reading += self._orientation(values)
        return Line(
            time,
            None if self._counter is None else int(values[self._counter]),
            reading,
            saturated,
            None if self._temperature is None else values[self._temperature],
        )

    def _checked(self, line: bytes, checksum: Checksum) -> bytes:
        """The line without its check digits, if they are right."""
        body, mark, digits = line.rpartition(checksum.mark.encode())
        if not mark:
            raise MalformedLine("has no checksum")
        value = 0
        if checksum.algorithm == "xor":
            for byte in body:
                value ^= byte
        else:
            value = sum(body) % 256
        try:
            sent = int(digits, 16)
        except ValueError:
            raise MalformedLine("has a checksum that is no hexadecimal number") from None
        if sent != value:
            raise MalformedLine(f"has checksum {sent:02X}, but its content gives {value:02X}")
        return body

    def _orientation(self, values: list[float]) -> tuple[float, ...]:
        w, x, y, z = (values[i] for i in self._quaternion)
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1) > QUATERNION_TOLERANCE:
            raise MalformedLine(f"holds a quaternion of norm {norm:.3f}")
        sign = -1.0 if self._conjugate else 1.0
        return (w / norm, sign * x / norm, sign * y / norm, sign * z / norm)
