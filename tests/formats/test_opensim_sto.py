"""Tables of orientations: those that OpenSim itself writes, and this bench."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems
from testbench.formats import import_recording
from testbench.records.session.session import Session

HEADER = "DataRate=100\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.5\n{more}endheader\n"


@pytest.fixture
def load(tmp_path, clock):
    def read(file: Path) -> Session:
        return import_recording("opensim_sto", [file], tmp_path / "session", clock)

    return read


def written(path: Path, m, q: np.ndarray, more: str = "") -> Path:
    rows = [
        f"{t:.9f}\t{','.join(f'{x:.9f}' for x in row)}\t1,0,0,0"
        for t, row in zip(m.t, q, strict=True)
    ]
    titles = "time\tpelvis_imu\tfemur_r_imu\n"
    path.write_text(HEADER.format(more=more) + titles + "\n".join(rows) + "\n")
    return path


@pytest.mark.skipif(
    importlib.util.find_spec("opensim") is None,
    reason="opensim is not installed; it has wheels for Linux x86-64 only",
)
def test_a_file_of_opensims_own_writer_is_read(tmp_path, motion, load):
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    m = motion(300)
    table = opensim.TimeSeriesTableQuaternion()
    table.setColumnLabels(["pelvis_imu", "tibia_r_imu"])
    for t, q in zip(m.t.tolist(), m.q.tolist(), strict=True):
        row = opensim.RowVectorQuaternion(2)
        for column in range(2):
            for part, value in enumerate(q):
                row.updElt(0, column).set(part, value)
        table.appendRow(t, row)
    table.addTableMetaDataString("DataRate", "100")
    opensim.STOFileAdapterQuaternion.write(table, str(tmp_path / "theirs.sto"))
    session = load(tmp_path / "theirs.sto")
    assert session.sensor_names == ["pelvis_imu", "tibia_r_imu"]
    q = session.imu("tibia_r_imu").device_q
    assert np.abs(np.sum(q * m.q, axis=1)).min() > 1 - 1e-9
    assert session.manifest.sensors["tibia_r_imu"].rate_hz == pytest.approx(100)


def test_a_world_that_the_header_calls_y_up_is_turned_back(tmp_path, motion, load):
    m = motion(300)
    turned = Rotation.from_euler("x", -90, degrees=True) * Rotation.from_quat(
        m.q, scalar_first=True
    )
    more = "frame=opensim ground, y up: world turned by -90 deg about x\n"
    session = load(written(tmp_path / "a.sto", m, turned.as_quat(scalar_first=True), more))
    assert np.abs(np.sum(session.imu("pelvis_imu").device_q * m.q, axis=1)).min() > 1 - 1e-9


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("endheader\n", ""), "no line 'endheader'"),
        (("DataType=Quaternion", "DataType=double"), "a table of double, where orientations"),
        (("\t1,0,0,0\n", "\t1,0,0\n"), r"a\.sto:7: has 8 numbers where 9 are expected"),
        (("\t1,0,0,0\n", "\t1,0,0,up\n"), r"a\.sto:7: 'up' is not a number"),
        (("femur_r_imu", "pelvis_imu"), r"a\.sto:6: a body stands twice"),
        (("0.030000000\t", "nan\t"), r"a\.sto:10: the time is missing here"),
        (("time\t", "zeit\t"), r"a\.sto:6: the titles must be time"),
    ],
)
def test_what_is_no_such_table_is_refused_with_its_line(tmp_path, motion, load, change, said):
    m = motion(100)
    path = written(tmp_path / "a.sto", m, m.q)
    path.write_text(path.read_text().replace(*change, 1))
    with pytest.raises(FileProblems, match=said):
        load(path)
