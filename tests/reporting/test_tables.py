"""Numbers, units and names are shown as people write them."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.reporting.figures import heat_map
from testbench.reporting.render import _breakable, _code
from testbench.reporting.tables import counted, significant_digits, unit_words


@pytest.mark.parametrize(
    ("value", "count", "shown"),
    [
        (0.13, 3, "0.130"), (0.0754, 3, "0.0754"), (4000.0, 3, "4000"), (0.8750131, 6, "0.875013"), (6.61e-5, 3, "6.61·10⁻⁵"),
        (9.1e-7, 2, "9.1·10⁻⁷"), (-2.113e-07, 3, "−2.11·10⁻⁷"), (9.999, 3, "10.0"), (2.5e7, 2, "2.5·10⁷"), (0.0, 3, "0"),
        (None, 3, "–"), (float("nan"), 3, "–"),
    ],
)  # fmt: skip
def test_significant_digits_keep_their_zeros_and_none_has_to_be_counted(value: float | None, count: int, shown: str) -> None:
    assert significant_digits(value, count) == shown


def test_units_are_written_by_hand() -> None:
    written = ["µg/√Hz", "deg/s/√Hz", "m/s/√h", "µT", "µT/√Hz", "m/s²", "mg", "us"]
    ascii_units = ["ug/sqrt(Hz)", "deg/s/sqrt(Hz)", "m/s/sqrt(h)", "uT", "uT/sqrt(Hz)", "m/s^2", "mg", "us"]
    assert [unit_words(unit) for unit in ascii_units] == written
    assert unit_words(None) is None


def test_counts_agree_with_their_nouns() -> None:
    assert [counted(n, "row") for n in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]


def test_long_names_may_break_between_their_parts_and_markup_stays_text() -> None:
    assert _breakable("elbow.flexion_deg 0.5 <b>") == "elbow.<wbr>flexion_<wbr>deg 0.5 &lt;b&gt;"
    assert _code("what `a --b` takes, <i>") == "what <code>a --b</code> takes, &lt;i&gt;"


def test_maps_end_where_their_cells_do_and_dust_is_not_crossed() -> None:
    z = [[0.0, 1.0, 20.0 + 1e-14], [0.0, 1.0, 20.0]]
    figure = heat_map("t", [-20.0, 0.0, 20.0], ["a", "b"], np.array(z), "x", "y", "z", 20.0)
    assert figure["layout"]["xaxis"]["range"] == [-30.0, 30.0]
    assert figure["layout"]["yaxis"]["range"] == [-0.5, 1.5]
    assert len(figure["data"]) == 1
    assert heat_map("t", [0.0, 1.0], [0.0, 1.0], np.array([[0.0, 1.5649]] * 2), "x", "y", "z", 1.5649)["data"][0][
        "zmax"
    ] == pytest.approx(1.57)
