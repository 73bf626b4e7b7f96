"""Numbers, units and names are shown as people write them."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.reporting.page.figures import Axis, Curve, flat_on_a_linear_axis, heat_map
from testbench.reporting.page.render import _breakable, _code
from testbench.reporting.page.tables import (
    counted,
    powers_of_ten,
    significant_digits,
    to_uncertainty,
    unit_words,
)


@pytest.mark.parametrize(
    ("value", "count", "shown"),
    [
        (0.13, 3, "0.130"),
        (0.0754, 3, "0.0754"),
        (4000.0, 3, "4000"),
        (0.8750131, 6, "0.875013"),
        (6.61e-5, 3, "6.61·10⁻⁵"),
        (9.1e-7, 2, "9.1·10⁻⁷"),
        (-2.113e-07, 3, "−2.11·10⁻⁷"),
        (9.999, 3, "10.0"),
        (2.5e7, 2, "2.5·10⁷"),
        (0.0, 3, "0"),
        (None, 3, "–"),
        (float("nan"), 3, "–"),
    ],
)
def test_significant_digits_keep_their_zeros_and_none_has_to_be_counted(
    value: float | None, count: int, shown: str
) -> None:
    assert significant_digits(value, count) == shown


def test_units_are_written_by_hand() -> None:
    written = ["µg/√Hz", "deg/s/√Hz", "m/s/√h", "µT", "µT/√Hz", "m/s²", "mg", "us"]
    ascii_units = [
        "ug/sqrt(Hz)",
        "deg/s/sqrt(Hz)",
        "m/s/sqrt(h)",
        "uT",
        "uT/sqrt(Hz)",
        "m/s^2",
        "mg",
        "us",
    ]
    assert [unit_words(unit) for unit in ascii_units] == written
    assert unit_words(None) is None


def test_counts_agree_with_their_nouns() -> None:
    assert [counted(n, "row") for n in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]


def test_long_names_may_break_between_their_parts_and_markup_stays_text() -> None:
    assert _breakable("elbow.flexion_deg 0.5 <b>") == "elbow.<wbr>flexion_<wbr>deg 0.5 &lt;b&gt;"
    assert _code("what `a --b` takes, <i>") == "what <code>a --b</code> takes, &lt;i&gt;"


def test_maps_end_where_their_cells_do_and_dust_is_not_crossed() -> None:
    z = [[0.0, 1.0, 20.0 + 1e-14], [0.0, 1.0, 20.0]]
    figure = heat_map(
        "t", Axis("x", [-20.0, 0.0, 20.0]), Axis("y", ["a", "b"]), np.array(z), "z", 20.0
    )
    assert figure["layout"]["xaxis"]["range"] == [-30.0, 30.0]
    assert figure["layout"]["yaxis"]["range"] == [-0.5, 1.5]
    assert len(figure["data"]) == 1
    side, z = Axis("", [0.0, 1.0]), np.array([[0.0, 1.5649]] * 2)
    assert heat_map("t", side, side, z, "z", 1.5649)["data"][0]["zmax"] == pytest.approx(1.57)


def test_powers_of_ten_in_words_are_written_out_and_names_left_alone() -> None:
    said = powers_of_ten(
        "0.019 before and 3e-06 after; published: 8.9e-7; 1.2e+05 of them, run 5e7f, x1e-3"
    )
    assert (
        said
        == "0.019 before and 3·10⁻⁶ after; published: 8.9·10⁻⁷; 1.2·10⁵ of them, run 5e7f, x1e-3"
    )


def test_signed_errors_never_get_a_logarithmic_axis() -> None:
    flat = [
        Curve(name, [0.0, 1.0], [0.01, sign * 0.02], "#000000")
        for name, sign in (("a", 1), ("b", 1), ("c", -1))
    ]
    far = Curve("far", [0.0, 1.0], [1.0, 40.0], "#000000")
    assert flat_on_a_linear_axis([*flat[:2], far])
    assert not flat_on_a_linear_axis([*flat, far])


@pytest.mark.parametrize(
    ("value", "sd", "shown"),
    [
        (6.30405e-5, 0.00031, "0.00006"),
        (0.702587, 0.62, "0.70"),
        (123.42, 2.6, "123.4"),
        (-0.0075431, 0.00018, "−0.00754"),
        (0.123456, None, "0.123"),
        (1234.5, 250.0, "1234"),
        (None, 1.0, "–"),
    ],
)
def test_values_go_no_further_than_their_uncertainty(
    value: float | None, sd: float | None, shown: str
) -> None:
    assert to_uncertainty(value, sd) == shown
