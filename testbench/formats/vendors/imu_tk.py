"""imu_tk: a pair of text files, each with the columns time [s], x, y, z.

One is of the accelerometer, one of the gyroscope.

The example of imu_tk (Pretto and Grisetti) holds raw counts of an Xsens MTi, unsigned 16 bit around
32768. A session holds SI units, so raw counts are scaled by nominal factors, which stand in the
manifest: counts = value x counts_per_unit + offset gives them back exactly. The factors come from
that example itself: a sphere through its static poses with |g| = 9.81744 m/s^2 gives 413 counts per
m/s^2; the turns between the poses give 4800 counts per rad/s (imu_tk starts its own search from
6258, and ends near 4780). Real offsets are tens to hundreds of counts away from 32768: that is what
a calibration is for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.names import sensor_name
from testbench.formats.options import Options
from testbench.formats.plausibility import gather, told_unit
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.suitable import suited_recording
from testbench.formats.table_sensors import asked_stamps
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.samples_stream import Quantities, SampleStream, measured_rate, stack
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import TextTable, decimal_of, guess_separator, head_of
from testbench.records.findings.catalogue import finding

NAMES = ["time", "x", "y", "z"]
OFFSET = 32768
COUNTS_PER_M_S2, COUNTS_PER_RAD_S = 413.0, 4800.0
LOCAL_GRAVITY = 9.81744
"""Where the example was recorded (Padua), by imu_tk's example program [m/s^2]."""
SAME_TIME_S = 1e-6


@dataclass
class PairedTable:
    """Two files with the same times, as one source with the columns time, acc_x .. gyr_z."""

    acc: TextTable
    gyr: TextTable

    @property
    def file(self) -> Path:
        """Of the accelerometer."""
        return self.acc.file

    @property
    def names(self) -> list[str]:
        """Of both."""
        return ["time", *(f"{kind}_{axis}" for kind in ("acc", "gyr") for axis in "xyz")]

    def chunks(self, kinds: Mapping[str, Kind]) -> Iterator[Columns]:
        """Rows of both files side by side; see `Source.chunks`."""
        wanted: dict[str, Kind] = dict.fromkeys(NAMES, "float")
        readers = (self.acc.chunks(wanted), self.gyr.chunks(wanted))
        held = [np.empty((0, 4)), np.empty((0, 4))]
        row = 0
        while True:
            for i, reader in enumerate(readers):
                if not len(held[i]):
                    held[i] = np.column_stack(
                        [*next(reader, dict.fromkeys(NAMES, np.empty(0))).values()]
                    )
            count = min(len(held[0]), len(held[1]))
            if not count:
                break
            acc, gyr = held[0][:count], held[1][:count]
            apart = ~(np.abs(acc[:, 0] - gyr[:, 0]) <= SAME_TIME_S)
            if apart.any():
                i = int(np.argmax(apart))
                raise self.gyr.problem(
                    f"time {gyr[i, 0]:.10g}, where {self.acc.file.name} has {acc[i, 0]:.10g}: not "
                    "a pair",
                    row + i,
                )
            held = [held[0][count:], held[1][count:]]
            row += count
            arrays = [acc[:, 0], *acc[:, 1:].T, *gyr[:, 1:].T]
            yield {
                name: array for name, array in zip(self.names, arrays, strict=True) if name in kinds
            }
        longer = self.acc if len(held[0]) else self.gyr
        if len(held[0]) or len(held[1]):
            raise longer.problem(
                f"has more samples than the other file, which ends after {row}", row
            )

    def problem(self, message: str, row: int | None = None) -> FileProblems:
        """Of the accelerometer's file."""
        return self.acc.problem(message, row)


# One piece: raw counts and units are two answers to one question, and differ in what they note.
def read(files: list[Path], options: Options) -> Recording:
    """Read a pair of files.

    Args:
        files: Accelerometer and gyroscope; in this order, unless their names say otherwise.
        options: Units, for files that are not raw counts.

    Raises:
        InputError: Not two files.
        FileProblems: They are no such pair.
    """
    if len(files) != 2:
        raise InputError(
            f"an imu_tk recording is a pair of files, accelerometer and gyroscope; {len(files)} "
            "were given"
        )
    acc, gyr = files
    if re.search("gyr", acc.name, re.I) and not re.search("gyr", gyr.name, re.I):
        acc, gyr = gyr, acc
    source = PairedTable(*(_table(file, options.encoding_or(None)) for file in (acc, gyr)))
    columns: dict[str, Kind] = dict.fromkeys(source.names[1:], "float")
    stamps = asked_stamps(source, "time", "s", "imu", options)

    def stream(acc_factor: float, gyr_factor: float, offset: float) -> SampleStream:
        def convert(chunk: Columns) -> Quantities:
            raw_acc, raw_gyr = (
                stack(chunk, [f"{kind}_{axis}" for axis in "xyz"]) for kind in ("acc", "gyr")
            )
            return Quantities((raw_gyr - offset) * gyr_factor, (raw_acc - offset) * acc_factor)

        return SampleStream(source, columns, convert, stamps.timeline)

    plain = stream(1.0, 1.0, 0.0)
    head = plain.first()
    rate = options.rate_or(None) or measured_rate(head)
    if rate is None:
        raise source.problem("two samples at least, at different times, are needed")
    findings = [finding("structure.pair", "imu", acc=acc.name, gyr=gyr.name)]
    details: dict[str, object] = {}
    if _raw_counts(head.acc) and _raw_counts(head.gyr):
        chosen = stream(1 / COUNTS_PER_M_S2, 1 / COUNTS_PER_RAD_S, OFFSET)
        details["raw_counts"] = {
            "formula": "counts = value * counts_per_unit + offset",
            "acc": {"offset": OFFSET, "counts_per_m_s2": COUNTS_PER_M_S2},
            "gyr": {"offset": OFFSET, "counts_per_rad_s": COUNTS_PER_RAD_S},
        }
        findings.append(
            finding(
                "unit.raw_counts",
                "imu",
                acc_counts=COUNTS_PER_M_S2,
                gyr_counts=COUNTS_PER_RAD_S,
                zero=OFFSET,
            )
        )
        findings.append(finding("unit.local_gravity", gravity_m_s2=LOCAL_GRAVITY))
        description = "raw counts of a 16-bit IMU (imu_tk), scaled nominally"
    else:
        evidence, factors = gather(plain), {}
        for quantity in ("acc", "gyr"):
            unit = options.unit(quantity, None)
            if unit is None:
                unit, said = told_unit(quantity, evidence, "imu", f"--unit {quantity}=UNIT")
                findings.append(said)
            factors[quantity] = unit.factor
        chosen = stream(factors["acc"], factors["gyr"], 0.0)
        description = "accelerometer and gyroscope (imu_tk text)"
    sensor = ImportedSensor(
        chosen,
        round(rate, 3),
        description,
        details=details,
        findings=stamps.findings,
        told=chosen.findings,
        unix=stamps.unix,
    )
    label = sensor_name(re.sub(r"[_-]?acc\w*$", "", acc.stem, flags=re.I) or acc.stem)
    return suited_recording(
        label,
        "accelerometer and gyroscope in the format of imu_tk",
        {"imu": sensor},
        findings,
    )


def _table(file: Path, encoding: str | None) -> TextTable:
    """The rows below comments and titles, if there are any."""
    lines = head_of(file, encoding)
    for number, line in enumerate(lines, 1):
        separator = guess_separator(line)
        fields = split_line(line, separator)
        if len(fields) == 4 and all(
            re.fullmatch(r"[-+]?[\d.,]+([eE][-+]?\d+)?|[Nn]a[Nn]", text) for text in fields
        ):
            decimal = decimal_of(lines[number - 1 :], separator)
            return TextTable(file, list(NAMES), number, separator, decimal, encoding)
        if re.match(r"\s*[-+.\d]", line) and line.strip():
            raise FileProblems(
                file,
                [
                    Problem(
                        "not an imu_tk file: four numbers are expected (time, x, y, z), here are "
                        f"{len(fields)} fields",
                        line=number,
                    )
                ],
            )
    raise FileProblems(
        file,
        [
            Problem(
                "not an imu_tk file: no line of its beginning holds four numbers (time, x, y, z)"
            )
        ],
    )


def _raw_counts(values: np.ndarray) -> bool:
    """Whether these are unsigned 16-bit numbers about the middle of their range."""
    known = values[np.isfinite(values)]
    if not len(known) or known.min() < 0 or known.max() > 65535:
        return False
    return bool(np.all(known == np.round(known)) and 16384 < np.median(known) < 49152)
