"""Files for OpenSim, read by OpenSim itself."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError
from testbench.formats.exporters import ExportSource, write_export
from testbench.formats.exporters.opensim_sto import Q_GROUND_FROM_WORLD, column_names
from testbench.formats.exporters.source import true_orientation
from testbench.model import rotation

needs_opensim = pytest.mark.skipif(
    importlib.util.find_spec("opensim") is None,
    reason="opensim is not installed; it has wheels for Linux x86-64 only",
)


@pytest.fixture(scope="module")
def osim() -> Any:
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    return opensim


def export(source: ExportSource, folder: Path, name: str, **options: Any) -> Path:
    own = ExportSource(source.session, source.estimate, **options)
    return write_export(name, own, folder / f"out.{name}").path


def quaternions(table: Any) -> np.ndarray:
    """Shape (n, sensors, 4)."""
    rows = [table.getRowAtIndex(i) for i in range(table.getNumRows())]
    return np.array(
        [[[row.getElt(0, j).get(k) for k in range(4)] for j in range(row.size())] for row in rows]
    )


def text_rows(path: Path) -> np.ndarray:
    """The numbers of a file, without OpenSim."""
    lines = path.read_text().split("endheader\n")[1].splitlines()[1:]
    return np.array([[float(x) for x in re.split(r"[\t,]", line)] for line in lines])


def degrees_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    pair = [Rotation.from_quat(q.reshape(-1, 4), scalar_first=True) for q in (a, b)]
    return np.degrees((pair[0] * pair[1].inv()).magnitude())


@needs_opensim
def test_opensim_reads_the_orientations_of_every_sensor(osim, source, tmp_path):
    table = osim.TimeSeriesTableQuaternion(
        str(export(source, tmp_path, "sto", wanted="vqf_6d", frame="world"))
    )
    assert list(table.getColumnLabels()) == ["upper_arm_imu", "forearm_imu"]
    assert float(table.getTableMetaDataString("DataRate")) == pytest.approx(60, rel=0.01)
    time_ns = np.round(np.array(table.getIndependentColumn()) * 1e9).astype(np.int64)
    estimated = source.estimate.sensors
    assert np.isin(time_ns, estimated["arm"].host_time_ns).all() and len(time_ns) > 0.99 * len(
        estimated["arm"].host_time_ns
    )
    q, first = quaternions(table), np.searchsorted(estimated["arm"].host_time_ns, time_ns)
    assert degrees_between(q[:, 0], estimated["arm"].orientation["vqf_6d"][first]).max() < 1e-6
    other = estimated["forearm"]
    assert (
        degrees_between(
            q[:, 1], rotation.interpolate(other.host_time_ns, other.orientation["vqf_6d"], time_ns)
        ).max()
        < 1e-6
    )


@needs_opensim
def test_the_ground_frame_is_what_opensense_makes_of_the_world_frame(osim, source, tmp_path):
    (tmp_path / "world").mkdir()
    ground = osim.TimeSeriesTableQuaternion(str(export(source, tmp_path, "sto", wanted="vqf_6d")))
    world = osim.TimeSeriesTableQuaternion(
        str(export(source, tmp_path / "world", "sto", wanted="vqf_6d", frame="world"))
    )
    x, y, z = (osim.CoordinateAxis(i) for i in range(3))
    turn = osim.Rotation(
        osim.SpaceRotationSequence, -np.pi / 2, x, 0.0, y, 0.0, z
    )  # sensor_to_opensim_rotations -pi/2 0 0
    osim.OpenSenseUtilities.rotateOrientationTable(world, turn)
    assert degrees_between(quaternions(ground), quaternions(world)).max() < 1e-5


def test_the_ground_has_the_worlds_up_along_y():
    np.testing.assert_allclose(
        rotation.rotate(Q_GROUND_FROM_WORLD, np.eye(3)),
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        atol=1e-15,
    )


def test_the_file_looks_as_opensense_wants_it(source, tmp_path):
    lines = export(source, tmp_path, "sto", wanted="truth").read_text().splitlines()
    end = lines.index("endheader")
    header = dict(line.split("=", 1) for line in lines[:end])
    assert (
        header["DataType"] == "Quaternion"
        and header["version"] == "3"
        and "OpenSimVersion" in header
    )
    assert header["filter"] == "truth" and "y up" in header["frame"]
    assert lines[end + 1] == "time\tupper_arm_imu\tforearm_imu"
    assert all(len(line.split("\t")) == 3 and line.count(",") == 6 for line in lines[end + 2 :])


def test_quaternions_are_unit_and_their_signs_do_not_jump(source, tmp_path):
    rows = text_rows(export(source, tmp_path, "sto", wanted="vqf_9d"))
    for columns in (slice(1, 5), slice(5, 9)):
        np.testing.assert_allclose(np.linalg.norm(rows[:, columns], axis=1), 1, atol=1e-8)
        assert (np.sum(rows[1:, columns] * rows[:-1, columns], axis=1) > 0.9).all()
    assert (np.diff(rows[:, 0]) > 0).all()


def test_a_sensor_without_a_segment_is_called_after_itself(source, imported_source, quick):
    assert column_names(imported_source) == ["imu_imu"]
    sensors = dict(source.session.analysis.sensors)
    sensors["arm"] = sensors["arm"].model_copy(update={"segment": sensors["forearm"].segment})
    session = type(source.session)(source.session.path)
    session.__dict__["analysis"] = source.session.analysis.model_copy(update={"sensors": sensors})
    assert column_names(ExportSource(session, quick.estimate)) == [
        "arm_imu",
        "forearm_imu",
    ]  # two on one segment


def test_a_gap_that_is_bridged_is_told(imported_source, tmp_path):
    for key, gap in (("vqf_6d", "1.01"), ("truth", "1.01")):
        own = ExportSource(imported_source.session, imported_source.estimate, key)
        notes = write_export("sto", own, tmp_path / f"{key}.sto").notes
        assert any(f"1 gap of {gap} s" in note for note in notes), notes
        assert np.isfinite(text_rows(tmp_path / f"{key}.sto")).all()


@needs_opensim
def test_opensim_reads_the_joint_angles_in_degrees(osim, source, quick, tmp_path):
    path = export(source, tmp_path, "mot", wanted="vqf_6d")
    table, storage = osim.TimeSeriesTable(str(path)), osim.Storage(str(path))
    assert table.getTableMetaDataString("inDegrees") == "yes" and storage.isInDegrees()
    labels = list(table.getColumnLabels())
    assert labels[:4] == ["elbow_flexion", "elbow_ZXZ_first", "elbow_ZXZ_second", "elbow_ZXZ_third"]
    assert labels[-6:] == [f"{name}_measured" for name in source.session.arm().joint_names]
    assert (
        storage.getSize() == table.getNumRows()
        and storage.getColumnLabels().getSize() == 1 + len(labels)
    )
    series = quick.evaluation.series["joint_elbow"]
    time_ns = np.round(np.array(table.getIndependentColumn()) * 1e9).astype(np.int64)
    rows = np.searchsorted(series["host_time_ns"], time_ns)
    np.testing.assert_array_equal(series["host_time_ns"][rows], time_ns)
    flexion = table.getDependentColumn("elbow_flexion").to_numpy()
    # The evaluation's series keeps seven digits, the exported column nine decimals.
    np.testing.assert_allclose(
        flexion, np.degrees(series["vqf_6d_ZXZ_flexion_rad"][rows]), atol=1e-5
    )
    measured = table.getDependentColumn("wrist_3_joint_measured").to_numpy()
    np.testing.assert_allclose(measured, np.degrees(series["reference_rad"][rows]), atol=1e-8)


def test_the_true_joint_angle_follows_the_arms_joint(source, tmp_path):
    path = export(source, tmp_path, "mot", wanted="truth")
    names = path.read_text().split("endheader\n")[1].splitlines()[0].split("\t")
    rows = text_rows(path)
    error = rows[:, names.index("elbow_flexion")] - np.abs(rows[:, names.index("wrist_3_joint")])
    assert np.abs(error[rows[:, 0] > 6]).max() < 0.05  # from the reference pose on


def test_the_header_counts_rows_and_columns(source, tmp_path):
    path = export(source, tmp_path, "mot")
    header, rows = path.read_text().split("endheader\n")[0], text_rows(path)
    assert f"nRows={rows.shape[0]}\nnColumns={rows.shape[1]}\n" in header


def test_angles_do_not_jump_at_half_a_turn(source, tmp_path):
    rows = text_rows(export(source, tmp_path, "mot", wanted="vqf_6d"))
    assert np.abs(np.diff(rows[:, 1:], axis=0)).max() < 180


def test_a_session_without_joints_and_arm_has_no_motion_file(imported_source, tmp_path):
    for wanted in (None, "truth", "vqf_6d"):
        own = ExportSource(imported_source.session, imported_source.estimate, wanted)
        with pytest.raises(InputError, match=r"no joint angles.*--joint NAME=PROXIMAL:DISTAL"):
            write_export("mot", own, tmp_path / "out.mot")
    assert list(tmp_path.iterdir()) == []


def test_truth_is_unknown_in_gaps_and_outside_and_exact_at_its_own_instants(imported_source):
    truth = imported_source.truths["imu"]
    known = np.isfinite(truth.q_world_from_sensor).all(axis=1)
    np.testing.assert_array_equal(
        true_orientation(truth, truth.host_time_ns)[known], truth.q_world_from_sensor[known]
    )
    outside = np.array([-1, 12_500_000_000, truth.host_time_ns[-1] + 1])
    assert np.isnan(true_orientation(truth, outside)).all()
    between = true_orientation(truth, truth.host_time_ns[100:200] + 5_000_000)
    angle = np.sin((np.arange(100, 200) + 0.5) / 100)
    assert degrees_between(between, rotation.from_heading(angle)).max() < 0.01
