"""A study that runs nothing, for tests of what is done with studies."""

from __future__ import annotations

from testbench.records.results.study import StudyRecord, StudyRow, StudyTable
from testbench.studies.bench import StudyBench


def run(bench: StudyBench) -> StudyRecord:
    """One table of one row, which holds the seed."""
    table = StudyTable("t", "Seeds", ("seed",), (StudyRow("first", (bench.seed,)),), "How.")
    said = (f"The first of {bench.parts} parts has seed {bench.seed}.",)
    settings = bench.settings("none")
    return StudyRecord(
        "tiny", "Tiny", "What?", "Nobody, 2026", bench.now(), settings, (), said, (table,)
    )
