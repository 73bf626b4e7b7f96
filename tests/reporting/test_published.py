"""The published numbers are those of the source, and stand beside the right rows of ours."""

from __future__ import annotations

import pytest

from testbench.exceptions import NotFoundError
from testbench.records.specs.published import load_published
from testbench.reporting.sections.flexion import published_beside


def test_every_published_row_has_a_value_for_each_flexion() -> None:
    published = load_published()
    assert published.flexion_deg == [float(f) for f in range(0, 75, 5)]
    assert [row.table for row in published.flexion_mean_abs_error] == [
        "5.6",
        "5.7",
        "5.8",
        "5.9",
        "5.10",
    ]
    assert all(len(row.mean_abs_error_deg) == 15 for row in published.flexion_mean_abs_error)


def test_published_means_are_those_of_the_source() -> None:
    # Sums of the rows as printed: a digit that was copied wrongly changes one.
    sums = {"5.6": 3.55, "5.7": 43.69, "5.8": 28.97, "5.9": 22.94, "5.10": 11.35}
    for row in load_published().flexion_mean_abs_error:
        assert sum(value or 0.0 for value in row.mean_abs_error_deg) == pytest.approx(
            sums[row.table], abs=1e-9
        )


def test_published_values_are_taken_at_the_flexions_of_the_session() -> None:
    beside = published_beside(load_published(), [0.0, 33.0, 60.0])
    (row, values), *_ = beside["ZXZ"]
    assert row.table == "5.6"
    assert values == [0.0, None, 0.36]


def test_a_session_that_shares_no_flexions_gets_no_published_rows() -> None:
    assert published_beside(load_published(), [1.0, 2.0, 5.0]) == {}


def test_an_unknown_publication_is_refused_with_those_that_exist() -> None:
    with pytest.raises(NotFoundError, match="known: reference_1"):
        load_published("reference_99")


def test_published_numbers_stand_only_beside_a_joint_that_names_them() -> None:
    assert published_beside(None, load_published().flexion_deg) == {}
