"""Tables that nothing can be computed of are refused, in a sentence with file, column and row."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbench.exceptions import SessionError
from testbench.model.statistics.intervals import median_interval
from testbench.records.session.session import Session
from testbench.records.session.sound_tables import Times

DAY_NS = 86_400_000_000_000
IMU, TRUTH, ARM = "imu_arm.parquet", "truth_arm.parquet", "arm.parquet"
Q = "q_world_from_sensor_"


@pytest.fixture
def damaged(quick, tmp_path):
    """A copy of a session in which columns of a table are others."""

    def make(file: str, change) -> Session:
        copy = tmp_path
        for name in ("manifest.json", "robot.yaml", "robot.urdf", file):
            shutil.copy(quick.session.path / name, copy)
        table = pq.read_table(copy / file)
        columns = {name: table[name].to_numpy().copy() for name in table.column_names}
        change(columns)
        written = pa.table(columns).replace_schema_metadata(table.schema.metadata)
        pq.write_table(written, copy / file)
        return Session(copy)

    return make


def put(name, row, value):
    def change(columns):
        columns[name][row] = value

    return change


def added(name, begin, value):
    def change(columns):
        columns[name][begin:] += value

    return change


def typed(name, kind):
    def change(columns):
        columns[name] = columns[name].astype(kind)

    return change


def zeros(columns):
    for part in "wxyz":
        columns[f"{Q}{part}"][7] = 0.0


def turned(name):
    def change(columns):
        columns[name] = columns[name][::-1].copy()

    return change


DAMAGES = {
    "host time goes back": (IMU, put("host_time_ns", 9, 0), "host_time_ns goes back in row 9"),
    "device time is turned round": (
        IMU,
        turned("device_time_ns"),
        "device_time_ns goes back in row",
    ),
    "device time is none": (IMU, put("device_time_ns", 800, 2**63 - 1), "which is no time"),
    "device time is negative": (IMU, put("device_time_ns", 3, -(2**63)), "which is no time"),
    "numbers in half the width": (IMU, typed("acc_x_m_s2", np.float32), "holds float, not double"),
    "no time at all": (IMU, lambda columns: columns.pop("host_time_ns"), "lacks the column"),
    "a gap of years": (IMU, added("device_time_ns", 9, 800 * DAY_NS), "spans 800 days"),
    "the device's clock stood": (IMU, put("device_time_ns", slice(None), 5), "stood still"),
    "text": (IMU, typed("gyr_x_rad_s", str), "column gyr_x_rad_s holds string, not double"),
    "times as numbers": (IMU, typed("device_time_ns", float), "holds double, not int64"),
    "marks as numbers": (IMU, typed("saturated", float), "holds double, not bool"),
    "a true orientation is none": (TRUTH, zeros, f"{Q[:-1]} has length 0 in row 7"),
    "true times are none": (TRUTH, put("host_time_ns", 4, -(2**62)), "which is no time"),
    "an arm's angle is none": (
        ARM,
        put("q_measured_wrist_3_joint_rad", 100, np.nan),
        "q_measured is no number in row 100",
    ),
    "an arm was sent nowhere": (
        ARM,
        put("q_sent_wrist_3_joint_rad", 100, np.nan),
        "q_sent is no number in row 100",
    ),
    "an arm's times are turned round": (
        ARM,
        turned("host_time_ns"),
        "host_time_ns goes back in row",
    ),
    "an arm's angle is text": (
        ARM,
        typed("q_measured_elbow_joint_rad", str),
        "holds string, not double",
    ),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_table_is_one_sentence(damaged, name):
    file, change, said = DAMAGES[name]
    session = damaged(file, change)
    read = {IMU: lambda: session.imu("arm"), TRUTH: lambda: session.truth("arm"), ARM: session.arm}
    with pytest.raises(SessionError) as told:
        read[file]()
    assert file in str(told.value) and said in str(told.value)


def test_times_are_looked_at_beyond_the_borders_of_pieces():
    times = Times(Path("t.parquet"), "host_time_ns")
    times.look(np.arange(5))
    assert not times.stood
    with pytest.raises(SessionError, match="goes back in row 7, from 9 to 3"):
        times.look(np.array([8, 9, 3]))


def test_the_usual_interval_of_packets_is_the_mean():
    assert median_interval(np.array([0, 10, 20, 35])) == 10.0
    packets = np.repeat(np.arange(50) * 30, 3)
    assert median_interval(packets) == pytest.approx(49 * 30 / 149)
    assert median_interval(np.array([3])) == median_interval(np.array([3, 3])) == 0.0
