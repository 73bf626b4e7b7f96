"""TRC: markers as tab-separated text (Motion Analysis; OpenSim user guide, Marker (.trc) Files).

Line 2 names the keys of line 3 (DataRate, Units, ...); line 4 has Frame#, Time and each marker
above its three columns; the data follow below line 5.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.fields import BLANKS, split_line
from testbench.formats.tables.text_table import guess_separator, head_of
from testbench.formats.truth.number_rows import number_rows, rows_apart
from testbench.formats.truth.tracked import METRES, Tracked, points, stated_rate, tracked_times

COUNT = "NumFrames"
"""Key of the number of frames."""


def is_trc(lines: list[str]) -> bool:
    """Whether the first line is that of such a file."""
    return lines[0].startswith("PathFileType")


def read_trc(file: Path, rate: float | None) -> Tracked:
    """Markers of a file.

    Args:
        file: To read.
        rate: In place of its times [Hz], or None.

    Raises:
        FileProblems: It is malformed; names the line.
    """
    lines = head_of(file)

    def refuse(message: str, line: int | None = None) -> FileProblems:
        return FileProblems(file, [Problem(message, line=line)])

    titles = next((i for i, line in enumerate(lines) if line.lstrip().startswith("Frame#")), None)
    if titles is None or titles < 3:
        raise refuse("a TRC file without the line of titles that begins with Frame#")
    keys, values = (
        split_line(lines[i], guess_separator(lines[i])) for i in (titles - 2, titles - 1)
    )
    header = dict(zip(keys, values, strict=False))
    unit = header.get("Units", "mm").lower()
    if unit not in METRES:
        raise refuse(f"the unit of its markers is '{unit}'; known: mm, cm, m", titles)
    separator = guess_separator(lines[titles])
    if separator == BLANKS:
        raise refuse("the columns must be apart by tabs", titles + 1)
    cells = split_line(lines[titles], separator)
    names = [cell for cell in cells[2:] if cell]
    if len(cells) < 3 or not cells[1].lower().startswith("time") or not names:
        raise refuse("the titles must be Frame#, Time and the markers", titles + 1)
    rows = number_rows(file, titles + 3, separator, 2 + 3 * len(names))
    stated = stated_rate(header.get("DataRate"))
    times = tracked_times(file, len(rows), rows[:, 1], rate, stated, titles + 3)
    found = Tracked("TRC", times, points(np.array(rows[:, 2:]), names, METRES[unit]))
    found.findings += rows_apart(file, COUNT, header.get(COUNT), len(rows))
    return found
