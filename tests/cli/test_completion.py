"""What a shell is offered for names of filters and methods."""

from __future__ import annotations

from testbench.cli.calibrating import _complete_method
from testbench.cli.options import complete_filter, complete_filters
from testbench.estimation.calibration.methods import METHODS
from testbench.records.specs.protocol import FILTER_NAMES


def test_filters_and_methods_are_completed() -> None:
    assert complete_filter("") == list(FILTER_NAMES)
    assert complete_filter("vqf_o") == ["vqf_offline"]
    assert _complete_method("norm") == [name for name in METHODS if name.startswith("norm")] != []


def test_the_last_of_a_list_is_completed_with_what_stands_before_it() -> None:
    assert complete_filters("vqf_6d,vqf_9") == ["vqf_6d,vqf_9d"]
    assert complete_filters("vqf_6d,vqf_6") == []  # it is taken already
