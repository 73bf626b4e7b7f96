"""MCAP files read by the ROS 2 decoder of mcap_ros2, and by rerun: neither shares code with the
exporter.
"""

from __future__ import annotations

import subprocess
from collections import defaultdict
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2._dynamic import serialize_dynamic
from mcap_ros2.decoder import DecoderFactory
from scipy.spatial.transform import Rotation

from testbench.exceptions import InputError
from testbench.formats.exporters import ExportSource, mcap_file, write_export
from testbench.formats.exporters.cdr import CdrLayout
from testbench.formats.exporters.ros_messages import (
    IMU,
    JOINT_STATE,
    MAGNETIC_FIELD,
    SCHEMAS,
    TF_MESSAGE,
    imu_layout,
    joint_state_layout,
    magnetic_field_layout,
    transforms_layout,
)
from testbench.reporting.viewer import process
from tests.patience import PATIENCE_S
from tests.reporting.test_viewer import chunks_of


def read(path: Path) -> dict[str, list]:
    """(log time [ns], decoded message) by topic."""
    messages = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            messages[channel.topic].append((message.log_time, decoded))
    return messages


@pytest.fixture(scope="module")
def file(source, tmp_path_factory) -> Path:
    own = ExportSource(source.session, source.estimate, "vqf_6d")
    return write_export("mcap", own, tmp_path_factory.mktemp("mcap") / "quick.mcap").path


@pytest.fixture(scope="module")
def messages(file) -> dict[str, list]:
    return read(file)


def stamp_ns(header) -> int:
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def xyz(vector) -> list[float]:
    return [vector.x, vector.y, vector.z]


def wxyz(q) -> list[float]:
    return [q.w, q.x, q.y, q.z]


def start_ns(source: ExportSource) -> int:
    return (
        int(datetime.fromisoformat(source.session.manifest.started_utc).timestamp()) * 1_000_000_000
    )


def test_the_file_is_a_ros2_recording_with_every_topic(file, messages):
    with file.open("rb") as opened:
        reader = make_reader(opened)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        (metadata,) = reader.iter_metadata()
    kinds = {
        channel.topic: summary.schemas[channel.schema_id].name
        for channel in summary.channels.values()
    }
    assert kinds == {
        "/arm/imu/data": IMU,
        "/arm/imu/mag": MAGNETIC_FIELD,
        "/forearm/imu/data": IMU,
        "/forearm/imu/mag": MAGNETIC_FIELD,
        "/joint_states": JOINT_STATE,
        "/tf": TF_MESSAGE,
        "/tf_static": TF_MESSAGE,
    }
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert summary.statistics.message_count == sum(map(len, messages.values()))
    assert "vqf_6d" in metadata.metadata["orientation"]


@pytest.mark.parametrize("sensor", ["arm", "forearm"])
def test_imu_messages_hold_raw_samples_and_the_orientation_of_the_filter(messages, source, sensor):
    raw, estimated, received = (
        source.imus[sensor],
        source.estimate.sensors[sensor],
        messages[f"/{sensor}/imu/data"],
    )
    assert len(received) == len(raw)
    np.testing.assert_array_equal(
        [stamp_ns(m.header) for _, m in received], start_ns(source) + estimated.host_time_ns
    )
    np.testing.assert_array_equal(
        [time for time, _ in received], [stamp_ns(m.header) for _, m in received]
    )
    np.testing.assert_array_equal([xyz(m.angular_velocity) for _, m in received], raw.gyr)
    np.testing.assert_array_equal([xyz(m.linear_acceleration) for _, m in received], raw.acc)
    np.testing.assert_array_equal(
        [wxyz(m.orientation) for _, m in received], estimated.orientation["vqf_6d"]
    )
    assert {m.header.frame_id for _, m in received} == {f"imu_{sensor}"}
    assert {tuple(m.orientation_covariance) for _, m in received} == {(0.0,) * 9}


def test_the_magnetic_field_is_in_tesla(messages, source):
    field = np.array([xyz(m.magnetic_field) for _, m in messages["/forearm/imu/mag"]])
    np.testing.assert_allclose(field, 1e-6 * source.imus["forearm"].mag, rtol=1e-14)
    assert 2e-5 < np.linalg.norm(field, axis=1).mean() < 7e-5  # the earth's field


def test_joint_states_are_those_of_the_arm(messages, source):
    arm, received = source.session.arm(), messages["/joint_states"]
    assert {tuple(m.name) for _, m in received} == {tuple(arm.joint_names)}
    np.testing.assert_array_equal([m.position for _, m in received], arm.q_measured)
    np.testing.assert_array_equal([m.velocity for _, m in received], arm.v_measured)
    assert {len(m.effort) for _, m in received} == {0}
    np.testing.assert_array_equal(
        [stamp_ns(m.header) for _, m in received], start_ns(source) + arm.host_time_ns
    )


def transforms(messages) -> dict[str, tuple[str, dict[int, object]]]:
    """By child frame: its parent, and its transform by stamp [ns]."""
    found: dict[str, tuple[str, dict[int, object]]] = {}
    for topic in ("/tf_static", "/tf"):
        for _, message in messages[topic]:
            for own in message.transforms:
                found.setdefault(own.child_frame_id, (own.header.frame_id, {}))[1][
                    stamp_ns(own.header)
                ] = own.transform
    return found


def world_from(frame: str, found, stamp: int) -> Rotation:
    """Rotation of a frame as a reader of the tree would chain it."""
    result = Rotation.identity()
    while frame != "world":
        parent, at = found[frame]
        transform = at[stamp] if stamp in at else next(iter(at.values()))
        assert stamp in at or len(at) == 1, frame
        result = Rotation.from_quat(wxyz(transform.rotation), scalar_first=True) * result
        frame = parent
    return result


@pytest.mark.parametrize("sensor", ["arm", "forearm"])
def test_the_tree_of_frames_leads_from_the_world_to_the_true_sensor(messages, source, sensor):
    found, truth = transforms(messages), source.truths[sensor]
    moments = list(found["wrist_3_link"][1])[::100]
    assert len(moments) > 10
    rows = np.searchsorted(truth.host_time_ns, np.array(moments) - start_ns(source))
    for moment, row in zip(moments, rows, strict=True):
        true = Rotation.from_quat(truth.q_world_from_sensor[row], scalar_first=True)
        assert (
            np.degrees((world_from(f"imu_{sensor}", found, moment) * true.inv()).magnitude()) < 1e-6
        )


def test_every_link_hangs_in_the_tree_and_the_estimated_sensors_stand_where_the_true_ones_are(
    messages, source
):
    found = transforms(messages)
    assert {
        "base_link",
        "shoulder_link",
        "wrist_3_link",
        "tool0",
        "imu_arm",
        "imu_arm_estimated",
    } <= set(found)
    assert {frame for frame, (parent, _) in found.items() if parent == "world"} == {
        "base_link",
        "imu_arm_estimated",
        "imu_forearm_estimated",
    }
    assert all(
        len(at) == 1
        for frame, (_, at) in found.items()
        if frame in {"tool0", "base_link", "imu_arm"}
    )
    q = source.estimate.sensors["arm"].orientation["vqf_6d"]
    own = found["imu_arm_estimated"][1]
    np.testing.assert_array_equal(wxyz(own[min(own)].rotation), q[0])


def test_messages_stand_in_the_order_of_their_stamps(file):
    with file.open("rb") as opened:
        times = [
            message.log_time
            for _, _, message in make_reader(opened).iter_messages(log_time_order=False)
        ]
    assert times == sorted(times)


def test_windows_of_any_length_give_the_same_messages(source, file, tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_file, "WINDOW_NS", 777_777_777)
    other = write_export(
        "mcap", ExportSource(source.session, source.estimate, "vqf_6d"), tmp_path / "other.mcap"
    ).path
    first, second = [
        [(t, str(m)) for t, m in read(path)["/forearm/imu/data"]] for path in (file, other)
    ]
    assert first == second


def test_an_imported_recording_says_where_its_orientation_is_unknown(imported_source, tmp_path):
    own = ExportSource(imported_source.session, imported_source.estimate, "truth")
    messages = read(write_export("mcap", own, tmp_path / "imported.mcap").path)
    assert set(messages) == {"/imu/imu/data", "/tf"}
    for time, message in messages["/imu/imu/data"]:
        unknown = 12.0 <= (time - start_ns(own)) / 1e9 < 13.0
        assert message.orientation_covariance[0] == (-1.0 if unknown else 0.0)
        assert np.linalg.norm(wxyz(message.orientation)) == pytest.approx(1)
    assert {t.child_frame_id for _, m in messages["/tf"] for t in m.transforms} == {"imu_imu"}


@pytest.mark.parametrize("date", [None, "yesterday", "2039-01-01T00:00:00+00:00"])
def test_a_date_that_stamps_cannot_hold_is_refused(date, quick, own_session, tmp_path):
    own_session.manifest = own_session.manifest.changed(started_utc=date)
    with pytest.raises(InputError, match="date"):
        write_export("mcap", ExportSource(own_session, quick.estimate), tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()


def ros_header(frame: str) -> dict:
    return {"stamp": {"sec": 7, "nanosec": 9}, "frame_id": frame}


def encoded(kind: str, message: dict) -> bytes:
    return bytes(serialize_dynamic(kind, SCHEMAS[kind])[kind](message))


STAMP = {"sec": np.array([7]), "nanosec": np.array([9])}
FRAMES = ["", "a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg"]


def vector(values) -> dict[str, float]:
    return dict(zip("xyzw", values, strict=False))


@pytest.mark.parametrize("frame", FRAMES)
def test_every_message_has_the_bytes_of_another_encoder_whatever_the_alignment(frame):
    a, b, q = (
        np.array([[1.0, 2.0, 3.0]]),
        np.array([[4.0, 5.0, -6.0]]),
        np.array([[0.1, 0.2, 0.3, 0.4]]),
    )
    zeros = [0.0] * 9
    imu = imu_layout(frame).fill(
        1, **STAMP, q_xyzw=q, q_covariance=np.zeros((1, 9)), rate=a, force=b
    )
    assert imu.tobytes() == encoded(
        IMU,
        {
            "header": ros_header(frame),
            "orientation": vector(q[0]),
            "orientation_covariance": zeros,
            "angular_velocity": vector(a[0]),
            "angular_velocity_covariance": zeros,
            "linear_acceleration": vector(b[0]),
            "linear_acceleration_covariance": zeros,
        },
    )
    field = magnetic_field_layout(frame).fill(1, **STAMP, field=a)
    expected = {
        "header": ros_header(frame),
        "magnetic_field": vector(a[0]),
        "magnetic_field_covariance": zeros,
    }
    assert field.tobytes() == encoded(MAGNETIC_FIELD, expected)
    joints = joint_state_layout("base", [frame, "elbow", "x"]).fill(
        1, **STAMP, position=a, velocity=b
    )
    expected = {
        "header": ros_header("base"),
        "name": [frame, "elbow", "x"],
        "position": list(a[0]),
        "velocity": list(b[0]),
    }
    assert joints.tobytes() == encoded(JOINT_STATE, {**expected, "effort": []})
    frames = [("world", frame), (frame, "link")]
    values = {
        f"{name}_{i}": array
        for i in range(2)
        for name, array in (*STAMP.items(), ("translation", a), ("q_xyzw", q))
    }
    tree = transforms_layout(frames).fill(1, **values)
    pose = {"translation": vector(a[0]), "rotation": vector(q[0])}
    own = [
        {"header": ros_header(parent), "child_frame_id": child, "transform": pose}
        for parent, child in frames
    ]
    assert tree.tobytes() == encoded(TF_MESSAGE, {"transforms": own})


def test_a_layout_fills_each_message_with_its_own_numbers():
    layout = CdrLayout().string("ab").slot("t", "<u4").slot("v", "<f8", 2)
    rows = layout.fill(3, t=np.array([1, 2, 3]), v=np.arange(6.0).reshape(3, 2))
    assert rows.shape == (3, 4 + 4 + 3 + 1 + 4 + 4 + 16)
    np.testing.assert_array_equal(rows[:, 12:16].copy().view("<u4")[:, 0], [1, 2, 3])
    np.testing.assert_array_equal(rows[:, 20:].copy().view("<f8"), np.arange(6.0).reshape(3, 2))


def test_rerun_decodes_every_topic(file, messages, source, tmp_path):
    target = tmp_path / "converted.rrd"
    (tmp_path / "settings").mkdir()
    program = [str(process.viewer_program()), "mcap", "convert", str(file), "-o", str(target)]
    subprocess.run(
        program,
        env=process._environment(tmp_path / "settings"),
        check=True,
        capture_output=True,
        timeout=PATIENCE_S,
    )
    rows, scalars = defaultdict(int), []
    for chunk in chunks_of(target):
        batch = chunk.to_record_batch()
        for name in ("Scalars:scalars", "Arrows3D:vectors", "Transform3D:quaternion"):
            if name in batch.schema.names:
                rows[chunk.entity_path, name] += batch.num_rows
        if chunk.entity_path == "/forearm/imu/data" and "Scalars:scalars" in batch.schema.names:
            scalars += batch.column("Scalars:scalars").to_pylist()
    assert rows["/forearm/imu/mag", "Arrows3D:vectors"] == len(messages["/forearm/imu/mag"])
    assert rows["/joint_states/position", "Scalars:scalars"] >= len(messages["/joint_states"])
    assert rows["/tf", "Transform3D:quaternion"] == sum(
        len(m.transforms) for _, m in messages["/tf"]
    )
    expected = np.hstack([source.imus["forearm"].gyr, source.imus["forearm"].acc])
    np.testing.assert_array_equal(np.array(scalars), expected)
