"""Times of a truth in a file of its own, and where they lie among those of the samples."""

from __future__ import annotations

from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.common_clock import OVERLAP_NS, stream_of, unix_zero_ns
from testbench.formats.recording import Recording
from testbench.formats.stamps import LOWEST_HZ, LOWEST_OF_TRUTH_HZ, Asking, Stamps, read_stamps
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.recognise import find_time
from testbench.formats.tables.text_table import TextTable
from testbench.formats.tables.units import SECONDS, unit_names
from testbench.formats.truth.joint_cells import JointCells
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

TOO_LONG = 30.0
"""A truth that lasts so many times as long as the samples is asked about."""
ABOUT = 10.0
"""A log is kept for up to so many times as long as its recording, or for that part of it."""


def truth_stamps(
    table: TextTable | ParquetTable | JointCells, rate: float | None, answered: str | None
) -> Stamps | None:
    """How the times of a truth are read; None where it has none, or a rate is stated instead.

    Args:
        table: Of the truth.
        rate: That a person stated [Hz].
        answered: Unit that a person stated.

    Raises:
        InputError: The unit cannot be right; says how to state it.
    """
    found = find_time(table.names)
    if found is None or rate is not None:
        return None
    column, stated = found
    lowest = LOWEST_HZ if stated is None else LOWEST_OF_TRUTH_HZ
    asking = Asking(f"{table.file}", answered, "--truth-time-unit UNIT", lowest_hz=lowest)
    return read_stamps(table, column, stated, asking)


def ask_if_too_long(recording: Recording, file: Path, duration_ns: int) -> None:
    """Ask for the unit of a truth's times, which nobody states, where they are far too long.

    Args:
        recording: With the samples.
        file: Of the truth.
        duration_ns: Of the truth, taken for seconds [ns].

    Raises:
        InputError: In another unit the truth would be about as long as the samples.
    """
    lasts = []
    for sensor in recording.sensors.values():
        stream = stream_of(sensor)
        if stream is None:
            return
        begin = stream.first_time_ns()
        last = stream.goes_on_until(begin + round(duration_ns / TOO_LONG))
        if last is None:
            return
        lasts.append(last - begin)
    longest = max(lasts, default=0)
    for unit in ("ms", "us", "ns"):
        length = duration_ns * SECONDS[unit]
        if longest / ABOUT <= length <= longest * ABOUT:
            took, own, meant = (x / NANOSECONDS for x in (duration_ns, longest, length))
            raise InputError(
                f"{file}: its times, taken for seconds, last {took:.4g} s, and the recording "
                f"{own:.4g} s; in {unit} they would last {meant:.4g} s. In which unit are they? "
                f"Answer with --truth-time-unit {unit} ({', '.join(unit_names('time'))}); "
                "--truth-time-unit s confirms seconds"
            )


def later_than_samples_ns(
    recording: Recording, unix_ns: int | None, duration_ns: int
) -> tuple[int, list[Finding]]:
    """By how much a truth begins after the samples, where both have Unix times, else 0 [ns].

    Args:
        recording: With the samples.
        unix_ns: Unix time at which the truth begins [ns], None where its times are none.
        duration_ns: Of the truth [ns].

    Returns:
        The offset, and what is to be said of it.
    """
    zeros = [unix_zero_ns(sensor) for sensor in recording.sensors.values()]
    known = [zero for zero in zeros if zero is not None]
    if unix_ns is None or len(known) != len(zeros) or max(known) - min(known) > OVERLAP_NS:
        return 0, []
    offset = unix_ns - min(known)
    apart, how = -offset - duration_ns, "before them and ends before they begin"
    if offset > 0:
        ends = []
        for sensor in recording.sensors.values():
            stream = stream_of(sensor)
            ends.append(None if stream is None else stream.goes_on_until(unix_ns))
        last = [end for end in ends if end is not None]
        apart, how = (unix_ns - max(last), "after them") if len(last) == len(ends) else (0, "")
    if apart > 0:
        seconds = abs(offset) / NANOSECONDS
        return 0, [finding("clock.truth_apart", apart_s=seconds, how=how)]
    return offset, [finding("clock.truth", offset_s=offset / NANOSECONDS)]
