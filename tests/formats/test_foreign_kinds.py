"""The campaign of mutated files has every format and every kind of truth."""

from __future__ import annotations

from testbench.formats import FORMATS, TRUTHS
from tests.benchmarks.foreign_kinds import KINDS


def test_every_format_and_every_truth_is_mutated() -> None:
    assert {name.partition(",")[0] for name in KINDS} == {*FORMATS, "--guess", "truth"}
    truths = [name.split()[1].strip(",") for name in KINDS if name.startswith("truth")]
    assert {*truths} == {*TRUTHS}
