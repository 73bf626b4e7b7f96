"""What a hostile reader asks of a study first, as a checklist."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

import numpy as np

from testbench.records.results.study import StudyRecord, StudyTable

VERDICTS = re.compile(r"\b(best|worst|better|worse|less|more) (than|of|in|error)\b")
PUBLISHED = re.compile(r"publi(shed|cation)|printed|thesis", re.IGNORECASE)


def complaints(record: StudyRecord, one_part: Collection[str] = ()) -> list[str]:
    """What is wrong with a study; empty where nothing is.

    Args:
        record: Of the study.
        one_part: Keys of tables that are of one part, or of none, and say so.
    """
    found = [*_rows(record), *_reasons(record), *_figures(record)]
    parts = record.settings.get("parts", 1)
    if parts == 1:
        found += [f"a verdict of one part: {f}" for f in record.findings if VERDICTS.search(f)]
    else:
        found += [
            f"table {table.key} has no spread over {parts} parts"
            for table in record.tables
            if table.key not in one_part and not table.spread
        ]
    return found


def published_words(record: StudyRecord) -> list[str]:
    """Where a study of the user's own data speaks of what was published."""
    found = [f for f in record.findings if PUBLISHED.search(f)]
    for table in record.tables:
        found += [f"{table.key}: {row.label}" for row in table.rows if row.published]
        found += [f"{table.key}: {text}" for text in (table.why, table.table) if text]
        found += [f"{table.key}: why" for _ in table.reasons]
    return found + [
        curve.name
        for figure in record.curves
        for curve in figure.curves
        if curve.kind == "published" or PUBLISHED.search(curve.name)
    ]


def captions(record: StudyRecord) -> list[str]:
    """Of all figures."""
    return [figure.caption for figure in (*record.figures, *record.curves, *record.surfaces)]


def missing(record: StudyRecord, wanted: Iterable[str]) -> list[str]:
    """Figures of a list that the report has not: none begins with these words."""
    there = captions(record)
    return [words for words in wanted if not any(caption.startswith(words) for caption in there)]


def _rows(record: StudyRecord) -> Iterable[str]:
    for table in record.tables:
        for row in table.rows:
            where = f"table {table.key}, {row.title}"
            if "as printed" in row.label and not row.printed:
                yield f"{where}: which print?"
            if row.other and any(row.ratio(i) is not None for i in range(len(row.values))):
                yield f"{where}: a ratio of two definitions"
            if all(value is None for value in (*row.values, *row.published)):
                yield f"{where} is empty"
        yield from _named_twice(table)


def _named_twice(table: StudyTable) -> Iterable[str]:
    titles = [row.title for row in table.rows]
    return [f"table {table.key} has two rows {t}" for t in set(titles) if titles.count(t) > 1]


def _reasons(record: StudyRecord) -> Iterable[str]:
    there = {*(table.key for table in record.tables), *captions(record)}
    for table in record.tables:
        for reason in table.reasons:
            if reason.run and reason.run not in there:
                yield f"table {table.key}: no run '{reason.run}' for: {reason.claim}"


def _figures(record: StudyRecord) -> Iterable[str]:
    for boxes in record.figures:
        if not boxes.boxes:
            yield f"figure {boxes.caption} is empty"
    for figure in record.curves:
        for curve in figure.curves:
            if not np.isfinite(curve.y).any():
                yield f"figure {figure.caption}: {curve.name} is empty"
    for surface in record.surfaces:
        if not np.isfinite(surface.z).any():
            yield f"figure {surface.caption} is empty"
