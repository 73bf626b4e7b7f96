"""The fields of a line of text: where they stand apart, and which are numbers or missing."""

from __future__ import annotations

import csv
import re

BLANKS = " "
"""The separator of files whose columns stand apart by any number of spaces and tabs."""
MISSING = ["", "NaN", "nan", "NAN", "NA", "N/A", "null", "-nan", "#N/A"]
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?|[-+]?(inf|nan)", re.IGNORECASE)


def split_line(line: str, separator: str) -> list[str]:
    """The fields of a line, without blanks and quotes around them."""
    if separator == BLANKS:
        return line.split()
    if '"' in line:
        return [part.strip() for part in next(csv.reader([line], delimiter=separator), [])]
    return [part.strip() for part in line.split(separator)]
