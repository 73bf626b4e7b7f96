"""The text files of OpenSim: a header of keys, then columns of numbers, time first."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.model.truth import WIDEST_GAP_NS


def write_text(
    path: Path,
    header: list[str],
    columns: list[str],
    time_ns: np.ndarray,
    texts: str,
    values: np.ndarray,
) -> None:
    """Write one file.

    Args:
        path: Of the file.
        header: Its lines up to `endheader`.
        columns: Names, without the time.
        time_ns: Shape (n,).
        texts: The numbers of a row after the time, as a format string.
        values: Those numbers, shape (n, k).
    """
    line = "%.9f\t" + texts + "\n"
    rows = np.column_stack(
        [time_ns / NANOSECONDS, values + 0.0]
    ).tolist()  # + 0.0: no negative zeros
    with path.open("w", encoding="ascii", errors="replace", newline="\n") as file:
        file.write("\n".join([*header, "endheader", "\t".join(["time", *columns])]) + "\n")
        file.writelines(line % tuple(row) for row in rows)


def data_rate(time_ns: np.ndarray) -> float:
    """Median rate of instants [Hz]; 0 for fewer than two.

    Args:
        time_ns: Increasing, shape (n,).
    """
    interval = median_interval(time_ns)
    return NANOSECONDS / interval if interval > 0 else 0.0


def overlap(times: dict[str, np.ndarray]) -> slice:
    """Rows of the first series that lie between the first and the last instant of every series.

    Args:
        times: By name of the series, its instants, increasing, of shape (n,) each [ns].

    Raises:
        InputError: There are none.
    """
    first = next(iter(times.values()))
    if all(len(time) for time in times.values()):
        begin, end = (
            max(time[0] for time in times.values()),
            min(time[-1] for time in times.values()),
        )
        rows = slice(*np.searchsorted(first, [begin, end + 1]).tolist())
        if rows.start < rows.stop:
            return rows
    raise InputError(f"there is no instant at which {' and '.join(times)} are all known")


def gap_notes(times: dict[str, np.ndarray], begin: int, end: int) -> list[str]:
    """A sentence for each series with gaps, across which its values are interpolated.

    Args:
        times: By name of the series, its instants, increasing, of shape (n,) each [ns].
        begin: Where the looked-at part begins [ns].
        end: Where it ends [ns].
    """
    notes = []
    for name, time in times.items():
        gaps = np.diff(time[(time >= begin) & (time <= end)]) / NANOSECONDS
        wide = gaps[gaps > WIDEST_GAP_NS / NANOSECONDS]
        if len(wide):
            gaps_are = "gap of {:.2f} s is" if len(wide) == 1 else "gaps of up to {:.2f} s are"
            notes.append(
                f"{name}: {len(wide)} {gaps_are.format(wide.max())} bridged by interpolation"
            )
    return notes
