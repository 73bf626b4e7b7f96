"""Of a long truth and a long arm those rows are read that interpolation asks for: it gives the same
numbers.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench import estimate, evaluate
from testbench.model.truth import truth_at
from testbench.pipeline.analyse import Result
from testbench.records.disk import neighbouring_rows
from testbench.records.disk.neighbouring_rows import Instants, read_near
from testbench.records.session.session import Session


@settings(max_examples=50)
@given(
    st.lists(st.integers(0, 1000), min_size=1, max_size=60, unique=True),
    st.lists(st.integers(-100, 1100), max_size=40),
)
def test_interpolation_between_the_rows_that_were_read_is_that_between_all(
    tmp_path_factory, times, instants
):
    times, instants = np.sort(np.array(times, np.int64)), np.sort(np.array(instants, np.int64))
    values = np.sin(times.astype(float))
    path = tmp_path_factory.mktemp("near") / "table.parquet"
    pq.write_table(pa.table({"host_time_ns": times, "value": values}), path, row_group_size=7)
    found = read_near(path, {"host_time_ns": "host_time_ns", "value": "value"}, instants)
    assert len(found["value"]) <= 3 * len(instants) + 2
    np.testing.assert_array_equal(
        np.interp(instants, found["host_time_ns"], found["value"]),
        np.interp(instants, times, values),
    )


def test_few_rows_of_a_truth_are_read_and_they_give_the_same_orientations(
    quick: Result, monkeypatch
):
    session = Session(quick.session.path)
    name = session.sensor_names[0]
    instants = quick.estimate.sensors[name].host_time_ns[::10]
    expected = truth_at(session.truth(name), instants)
    monkeypatch.setattr(neighbouring_rows, "MOST_ROWS", 100)
    close = session.near(Instants({name: instants}, instants))
    assert (
        len(close.truth(name).host_time_ns)
        <= 3 * len(instants) + 2
        < len(session.truth(name).host_time_ns)
    )
    np.testing.assert_array_equal(truth_at(close.truth(name), instants), expected)
    whole, part = session.arm(), close.arm()
    assert len(part.host_time_ns) < len(whole.host_time_ns)
    for j in range(len(whole.joint_names)):
        np.testing.assert_array_equal(
            np.interp(instants, part.host_time_ns, part.q_measured[:, j]),
            np.interp(instants, whole.host_time_ns, whole.q_measured[:, j]),
        )


def test_a_session_that_is_read_in_part_is_judged_alike(quick: Result, monkeypatch):
    monkeypatch.setattr(neighbouring_rows, "MOST_ROWS", 100)
    session = Session(quick.session.path)
    estimated = estimate(session)
    for name, sensor in estimated.sensors.items():
        assert sensor.clock == quick.estimate.sensors[name].clock
        for key, q in sensor.orientation.items():
            np.testing.assert_allclose(
                q, quick.estimate.sensors[name].orientation[key], atol=2e-5
            )  # frames: fewer rows
    found = evaluate(session, quick.estimate)
    for name in ("orientation", "joint_angle", "orientation_summary", "joint_summary"):
        for row, expected in zip(
            getattr(found, name), getattr(quick.evaluation, name), strict=True
        ):
            if hasattr(row, "total_rmse_deg"):
                assert row.total_rmse_deg == pytest.approx(expected.total_rmse_deg, rel=1e-9)
            else:
                assert repr(row)[:80] == repr(expected)[:80]
    for table, columns in found.series.items():
        for key, values in columns.items():
            np.testing.assert_array_equal(values, quick.evaluation.series[table][key])
    for budget, expected in zip(found.uncertainty, quick.evaluation.uncertainty, strict=True):
        assert budget.expanded_deg == pytest.approx(expected.expanded_deg, rel=0.05)
