"""A file that the named format refuses is recognised, and the way to read it said."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from testbench.exceptions import FileProblems
from testbench.formats import import_recording

STO = "DataType=Quaternion\nversion=3\nendheader\ntime\ta_imu\n0\t1,0,0,0\n"
FILES = {
    "a.mcap": (b"\x89MCAP0\r\n" + bytes(64), "testbench import rosbag a.mcap"),
    "a.bag": (b"#ROSBAG V2.0\n" + bytes(64), "testbench import rosbag a.bag"),
    "a.db3": (b"SQLite format 3\x00" + bytes(64), "testbench import rosbag a.db3"),
    "a.sto": (STO.encode(), "testbench import opensim_sto a.sto"),
    "a.c3d": (b"\x02\x50" + bytes(600), "give it as --truth a.c3d"),
    "a.trc": (b"PathFileType\t4\t(X/Y/Z)\ta.trc\n", "give it as --truth a.trc"),
    "take.csv": (b"Format Version,1.23,Take Name,a\n\n", "give it as --truth take.csv"),
    "trial.csv": (b"Trajectories\n100\n,,A:S1,,\n", "give it as --truth trial.csv"),
    "q.tsv": (b"NO_OF_FRAMES\t3\nNO_OF_MARKERS\t4\n", "give it as --truth q.tsv"),
    "dot.csv": (b"sep=,\nDeviceTag:,a\nOutputRate:,60Hz\n", "testbench import xsens_dot dot.csv"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_another_kind_is_named(name, tmp_path, clock):
    content, said = FILES[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileProblems) as refused:
        import_recording("ngimu", [tmp_path / name], tmp_path / "session", clock)
    assert said in str(refused.value)


def test_a_broad_trial_given_to_the_reader_of_apdm_is_named(tmp_path, clock):
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        for name in ("imu_gyr", "imu_acc", "imu_mag"):
            file[name] = np.zeros((20, 3))
    with pytest.raises(FileProblems, match=r"testbench import broad b\.hdf5"):
        import_recording("apdm", [tmp_path / "b.hdf5"], tmp_path / "session", clock)


def test_nothing_is_said_of_a_file_that_nobody_knows(tmp_path, clock):
    (tmp_path / "x.csv").write_text("apples,pears\n1,2\n")
    with pytest.raises(FileProblems) as refused:
        import_recording("ngimu", [tmp_path / "x.csv"], tmp_path / "session", clock)
    assert "looks like" not in str(refused.value)
