"""Arrays of MATLAB and HDF5, read by a mapping."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from testbench.exceptions import BenchError, FileProblems
from tests.formats.foreign_arrays import mat73_with_objects, mat_with_objects
from tests.formats.mapped.mappings import ARRAYS, check
from tests.told import codes


@pytest.mark.parametrize("kind", ["mat5", "packed", "mat7.3", "hdf5"])
def test_arrays_read_by_their_path_beside_objects_of_matlab(kind, motion, load, tmp_path):
    m = motion(600)
    struct = {"t": m.t, "acc": m.acc, "gyr": m.gyr}
    flat = {f"imu/{name}": values for name, values in struct.items()}
    path = tmp_path / ("d.h5" if kind == "hdf5" else "d.mat")
    if kind == "hdf5":
        with h5py.File(path, "w") as file:
            for name, values in flat.items():
                file.create_dataset(name, data=values, chunks=True, compression="gzip")
    elif kind == "mat7.3":
        mat73_with_objects(path, flat)
    else:
        mat_with_objects(path, {"imu": struct, "fs": 100.0}, packed=kind == "packed")
    session = load(ARRAYS, path)
    check(session.imu("imu"), m, 1e-12)
    assert ("structure.closed" in codes(session)) == (kind != "hdf5")


def test_single_columns_of_an_array_and_of_records(motion, load, tmp_path):
    m = motion(600)
    wide = np.column_stack([m.t, m.acc, m.gyr])
    records = np.zeros(600, dtype=[("t", "f8"), ("acc", "f4", 3), ("gyr", "f4", 3)])
    records["t"], records["acc"], records["gyr"] = m.t, m.acc, m.gyr
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["wide"], file["log/imu"] = wide, records
    columns = [f"'wide[{i}]'" for i in range(1, 8)]
    text = ARRAYS.replace("imu/t", columns[0])
    text = text.replace("array: imu/acc", f"columns: [{', '.join(columns[1:4])}]")
    text = text.replace("array: imu/gyr", f"columns: [{', '.join(columns[4:])}]")
    check(load(text, tmp_path / "d.h5").imu("imu"), m, 1e-12)
    check(load(ARRAYS.replace("imu/", "log/imu/"), tmp_path / "d.h5").imu("imu"), m)


def test_what_does_not_fit_in_a_file_of_arrays_is_named(motion, load, tmp_path):
    m = motion(600)
    content = {"imu": {"t": m.t[:-1], "acc": m.acc, "gyr": m.gyr, "wide": np.ones((600, 5))}}
    path = mat_with_objects(tmp_path / "d.mat", content)
    with pytest.raises(FileProblems, match=r"must be as long: .*imu/t has 599 rows"):
        load(ARRAYS, path)
    with pytest.raises(FileProblems, match=r"map.yaml:5:\d+: .*'imu/ac' is not there; d.mat has"):
        load(ARRAYS.replace("imu/acc", "imu/ac"), path)
    with pytest.raises(FileProblems, match=r"'walk' is not there.*walk \(table\) only MATLAB"):
        load(ARRAYS.replace("imu/acc", "walk"), path)
    with pytest.raises(FileProblems, match=r"'imu/wide' has 5 columns, where 3 are needed"):
        load(ARRAYS.replace("imu/acc", "imu/wide"), path)
    with pytest.raises(FileProblems, match="either columns, or array"):
        load(ARRAYS.replace("array: imu/acc, ", ""), path)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".parquet"])
def test_damaged_files_of_arrays_are_refused(suffix, motion, load, tmp_path):
    path = tmp_path / f"d{suffix}"
    savemat(tmp_path / "sound.mat", {"imu": {"t": motion(600).t}})
    for content in (
        b"",
        b"\x89HDF\r\n\x1a\n" + bytes(90),
        (tmp_path / "sound.mat").read_bytes()[:900],
    ):
        path.write_bytes(content)
        with pytest.raises(BenchError, match=path.name):
            load(ARRAYS, path)
