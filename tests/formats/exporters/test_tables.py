"""Tables read back by pandas hold what the session and its estimate hold."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from testbench.formats.exporters import ExportSource, write_export
from testbench.formats.exporters.tables import all_tables, grouped, unit_of
from testbench.records.session.samples import AXES, QUATERNION, names

WXYZ = list(QUATERNION)


@pytest.fixture(scope="module", params=["csv", "parquet"])
def folder(request, source, tmp_path_factory) -> Path:
    return write_export(
        request.param, source, tmp_path_factory.mktemp("tables") / request.param
    ).path


def table(folder: Path, name: str) -> pd.DataFrame:
    file = folder / f"{name}.parquet"
    return pd.read_parquet(file) if file.is_file() else pd.read_csv(folder / f"{name}.csv")


def test_there_is_a_table_for_every_sensor_truth_joint_the_arm_and_the_steps(folder):
    tables = ["imu_arm", "imu_forearm", "truth_arm", "truth_forearm", "joint_elbow", "arm", "steps"]
    assert sorted(path.stem for path in folder.iterdir()) == sorted([*tables, "export"])
    index = json.loads((folder / "export.json").read_text())
    assert {
        name: (entry["rows"], list(entry["units"])) for name, entry in index["tables"].items()
    } == {name: (len(table(folder, name)), list(table(folder, name).columns)) for name in tables}


@pytest.mark.parametrize("sensor", ["arm", "forearm"])
def test_raw_samples_and_estimates_stand_side_by_side_bit_for_bit(folder, source, sensor):
    read, raw, estimated = (
        table(folder, f"imu_{sensor}"),
        source.imus[sensor],
        source.estimate.sensors[sensor],
    )
    np.testing.assert_array_equal(read["host_time_ns"], estimated.host_time_ns)
    np.testing.assert_array_equal(read["time_s"], estimated.host_time_ns / 1e9)
    np.testing.assert_array_equal(read["arrival_time_ns"], raw.host_time_ns)
    np.testing.assert_array_equal(read["device_time_ns"], raw.device_time_ns)
    for prefix, unit, array in (
        ("gyr", "rad_s", raw.gyr),
        ("acc", "m_s2", raw.acc),
        ("mag", "uT", raw.mag),
    ):
        np.testing.assert_array_equal(read[[f"{prefix}_{axis}_{unit}" for axis in AXES]], array)
    for key, q in estimated.orientation.items():
        np.testing.assert_array_equal(
            read[[f"{key}_q_world_from_sensor_{part}" for part in WXYZ]], q
        )
    assert read["saturated"].dtype == read["static"].dtype == read["flagged"].dtype == bool
    np.testing.assert_array_equal(read["static"], estimated.static)


def test_the_truth_beside_the_samples_is_the_truth(folder, source):
    read, truth = table(folder, "imu_forearm"), source.truths["forearm"]
    q = read[names("true_q_world_from_sensor", "", QUATERNION)].to_numpy()
    known = np.isfinite(q).all(axis=1)
    assert known.mean() > 0.99
    nearest = np.abs(
        truth.host_time_ns[:, None] - read["host_time_ns"].to_numpy()[known][None, ::20]
    ).argmin(axis=0)
    cosine = np.abs(np.sum(truth.q_world_from_sensor[nearest] * q[known][::20], axis=1))
    assert (
        np.degrees(2 * np.arccos(np.clip(cosine, 0, 1))).max() < 0.6
    )  # half an interval of the arm, at 2 rad/s


def test_flexions_are_those_that_were_judged(folder, quick):
    read, series = table(folder, "joint_elbow"), quick.evaluation.series["joint_elbow"]
    np.testing.assert_array_equal(read["host_time_ns"], series["host_time_ns"])
    for sequence in ("ZXZ", "YXZ"):
        column = f"vqf_6d_{sequence}_flexion_rad"
        np.testing.assert_array_equal(read[column], series[column])
    inside = read["true_ZXZ_flexion_rad"].notna()
    rms = np.sqrt(
        np.mean((read["vqf_6d_ZXZ_flexion_rad"] - read["true_ZXZ_flexion_rad"])[inside] ** 2)
    )
    assert np.degrees(rms) < 3


def test_the_arm_and_the_steps_are_as_recorded(folder, source):
    arm = table(folder, "arm")
    for name, column in source.session.arm().to_columns().items():
        np.testing.assert_array_equal(arm[name], column)
    steps = table(folder, "steps")
    assert steps["name"].tolist() == [step.name for step in source.session.steps]
    assert [json.loads(text) for text in steps["variables"]] == [
        step.variables for step in source.session.steps
    ]
    assert steps["end_s"].iloc[-1] == pytest.approx(source.session.steps[-1].end_ns / 1e9)


def test_one_filter_may_be_asked_for(source):
    tables = all_tables(ExportSource(source.session, source.estimate, "vqf_9d"))
    keys = {
        column.split("_q_world")[0]
        for column in tables["imu_arm"]
        if "_q_world_from_sensor_w" in column
    }
    assert keys == {"vqf_9d", "true"}
    assert not any("fusion" in column for column in tables["joint_elbow"])


@pytest.mark.parametrize("name", ["csv", "parquet"])
def test_what_is_unknown_is_missing_and_never_a_number(name, imported_source, tmp_path):
    folder = write_export(name, imported_source, tmp_path / name).path
    assert sorted(path.stem for path in folder.iterdir()) == ["export", "imu_imu", "truth_imu"]
    read = table(folder, "imu_imu")
    lost = (read["time_s"] >= 12) & (read["time_s"] < 13)
    columns = names("true_q_world_from_sensor", "", QUATERNION)
    assert read.loc[lost, columns].isna().all(axis=None)
    assert read.loc[~lost, columns].notna().all(axis=None)
    assert not any(column.startswith(("mag_", "device_q")) for column in read)
    if name == "csv":
        assert "nan" not in (folder / "imu_imu.csv").read_text().lower()


def test_every_number_in_a_table_has_its_unit(source):
    for columns in all_tables(source).values():
        for name, values in columns.items():
            free = (
                name in {"counter", "index"}
                or "q_world_from_sensor" in name
                or name.startswith("device_q_")
            )
            if values.dtype.kind in "fi" and not free:
                assert unit_of(name), name


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("gyr_x_rad_s", "rad/s"),
        ("acc_z_m_s2", "m/s^2"),
        ("q_sent_elbow_joint_rad", "rad"),
        ("host_time_ns", "ns"),
        ("time_s", "s"),
    ]
    + [("mag_y_uT", "uT"), ("saturated", ""), ("vqf_6d_q_world_from_sensor_w", "")],
)
def test_a_unit_is_read_from_the_end_of_a_name(column, unit):
    assert unit_of(column) == unit


def test_parts_of_a_vector_are_brought_together():
    columns = {
        name: np.full(3, i)
        for i, name in enumerate(["time_s", *names("gyr", "_rad_s"), *names("a_q", "", QUATERNION)])
    }
    result = grouped(columns)
    assert {name: values.shape for name, values in result.items()} == {
        "time_s": (3,),
        "gyr_rad_s": (3, 3),
        "a_q": (3, 4),
    }
    np.testing.assert_array_equal(result["gyr_rad_s"][0], [1, 2, 3])
