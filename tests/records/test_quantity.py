"""A certified quantity has no digit finer than the second of its uncertainty."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.records.results.numbers import decimals_by
from testbench.records.results.quantity import NOT_KNOWN, Quantity


@pytest.mark.parametrize(
    ("value", "expanded", "shown"),
    [
        (0.123456, 0.00123, "0.1235 ± 0.0012"),
        (5.67, 0.0996, "5.67 ± 0.10"),
        (-5.67, 0.0994, "−5.670 ± 0.099"),
        (56789.0, 1249.0, "(5.68 ± 0.12)·10⁴"),
        (1.2345e-6, 3.2e-8, "(1.234 ± 0.032)·10⁻⁶"),
        (0.5, 12.0, "0 ± 12"),
        (-0.001, 0.2, "0.00 ± 0.20"),
        (0.08765, None, "0.088"),
        (0.08765, math.nan, "0.088"),
        (0.08765, 0.0, "0.088"),
        (None, 0.1, "–"),
        (math.nan, 0.1, "–"),
    ],
)
def test_it_is_shown_to_two_digits_of_its_uncertainty(value, expanded, shown) -> None:
    assert Quantity.of(value, expanded, 2.0).shown == shown


def test_what_is_missing_has_a_reason() -> None:
    assert Quantity.of(1.0, None, None).lacking == NOT_KNOWN
    assert Quantity.of(None, 0.1, 2.0, "the rest was too short").lacking == "the rest was too short"
    assert Quantity.of(1.0, 0.1, 1.96123).coverage_factor == 1.96


@given(
    st.floats(-1e7, 1e7).filter(lambda v: v == 0 or abs(v) > 1e-9),
    st.floats(1e-9, 1e7),
)
def test_the_numbers_are_those_that_are_shown(value: float, expanded: float) -> None:
    """The record holds no more than the page, and neither is off by more than half a digit."""
    quantity = Quantity.of(value, expanded, 2.0)
    assert quantity.value is not None and quantity.expanded_uncertainty is not None
    unit = 10.0 ** (int(f"{expanded:.1e}".partition("e")[2]) - 1)
    assert abs(quantity.value - value) <= 0.5001 * unit
    assert quantity.expanded_uncertainty == pytest.approx(float(f"{expanded:.1e}"), rel=1e-9)
    assert quantity.value / unit == pytest.approx(round(quantity.value / unit), rel=1e-12, abs=1e-6)


def test_an_uncertainty_that_rounds_up_to_the_next_power_has_two_digits_as_well() -> None:
    assert decimals_by(0.0996) == 2
    assert decimals_by(0.0994) == 3
