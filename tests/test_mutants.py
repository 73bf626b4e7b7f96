"""The patches of `make mutants` still apply, and those who run them tell a lie from the truth."""

from __future__ import annotations

import ast
from collections import Counter

import pytest

from tests.mutants import ROOT, Mutant, mutants

ALL = mutants()


def test_every_patch_applies_to_one_place_and_is_still_python() -> None:
    for mutant in ALL:
        ast.parse(mutant.patched())


def test_every_patch_names_tests_that_there_are_and_a_lie_of_its_own() -> None:
    missing = {name for mutant in ALL for name in mutant.tests if not (ROOT / name).is_file()}
    assert missing == set()
    assert [each for each, n in Counter((m.file, m.lie) for m in ALL).items() if n > 1] == []


def test_the_patches_are_spread_over_the_program() -> None:
    by_area = Counter(mutant.area for mutant in ALL)
    assert len(ALL) >= 200
    assert min(by_area.values()) >= 10, by_area


def test_a_patch_whose_place_is_gone_is_named() -> None:
    gone = Mutant("model", "testbench/frames.py", "nothing", "no such text", "", ())
    with pytest.raises(ValueError, match=r"testbench/frames.py: nothing: .* 0 times"):
        gone.patched()
