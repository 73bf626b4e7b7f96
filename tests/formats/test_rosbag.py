"""Bags of ROS, written by kept libraries, and by this bench's own export."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.records.session.session import Session
from tests.formats.bags import START_NS, Ros, write_bag
from tests.told import codes


@pytest.fixture
def load(tmp_path, clock):
    def read(*files: Path) -> Session:
        return import_recording("rosbag", list(files), tmp_path / "session", clock)

    return read


FORMS = {"ros1": (True, "a.bag"), "sqlite": (False, "folder"), "mcap": (False, "a.mcap")}


@pytest.mark.parametrize("form", FORMS)
def test_inertial_messages_and_their_field_are_read(tmp_path, motion, load, form):
    ros1, name = FORMS[form]
    ros, m = Ros.of(ros1), motion(400)
    late = motion(300)
    others = [
        (topic, kind, time + 500_000_000, message)
        for topic, kind, time, message in ros.imus(late, "/hand/imu/data_raw", known=False)
    ]
    for _, _, time, message in others:
        stamp = ros.header(time, "hand").stamp
        message.header.stamp.sec, message.header.stamp.nanosec = stamp.sec, stamp.nanosec
    messages = ros.imus(m, "/foot/imu/data") + ros.fields(m, "/foot/imu/mag") + others
    session = load(write_bag(tmp_path / name, ros, messages))
    assert session.sensor_names == ["foot", "hand"]
    samples, second = session.imu("foot"), session.imu("hand")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-12)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-12)
    np.testing.assert_allclose(samples.mag, m.mag, atol=0.05)
    np.testing.assert_allclose(samples.device_q, m.q, atol=1e-12)
    assert second.device_q is None
    assert (samples.host_time_ns[0], second.host_time_ns[0]) == (0, 500_000_000)
    assert session.manifest.recorded_utc == "2023-11-14T22:13:20+00:00"


def test_headers_without_stamps_leave_the_times_of_the_recording(tmp_path, motion, load):
    ros, m = Ros.of(False), motion(200)
    session = load(write_bag(tmp_path / "a.mcap", ros, ros.imus(m, "/imu", stamped=False)))
    assert session.manifest.sensors["imu"].rate_hz == pytest.approx(100)
    assert "time.of_recorder" in codes(session)


def test_a_file_of_the_writer_of_mcap_is_read(tmp_path, motion, load):
    writer_module = pytest.importorskip("mcap_ros2.writer")
    from testbench.formats.exporters.ros_messages import IMU, SCHEMAS

    m = motion(150)
    with (tmp_path / "theirs.mcap").open("wb") as file:
        writer = writer_module.Writer(file)
        schema = writer.register_msgdef(IMU, SCHEMAS[IMU])
        for i, t in enumerate(m.t):
            time = START_NS + round(1e9 * t)
            seconds, nanoseconds = divmod(time, 1_000_000_000)
            triads = {
                name: dict(zip("xyz", row.tolist(), strict=True))
                for name, row in (
                    ("angular_velocity", m.gyr[i]),
                    ("linear_acceleration", m.acc[i]),
                )
            }
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "a"},
                "orientation": dict(zip("wxyz", m.q[i].tolist(), strict=True)),
                **triads,
                **{f"{name}_covariance": [0.0] * 9 for name in (*triads, "orientation")},
            }
            writer.write_message("/imu", schema, message, time, time)
        writer.finish()
    samples = load(tmp_path / "theirs.mcap").imu("imu")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-12)
    np.testing.assert_allclose(samples.device_q, m.q, atol=1e-12)


def test_files_of_a_split_bag_are_one_recording(tmp_path, motion, load):
    ros, m = Ros.of(True), motion(400)
    messages = ros.imus(m, "/imu/data")
    files = [
        write_bag(tmp_path / "b.bag", ros, messages[:250]),
        write_bag(tmp_path / "a.bag", ros, messages[250:]),
    ]
    np.testing.assert_allclose(load(*files).imu("imu").gyr, m.gyr, atol=1e-12)


def test_what_is_no_recording_of_a_sensor_is_refused(tmp_path, motion, load):
    ros, m = Ros.of(False), motion(100)
    other = write_bag(tmp_path / "mag.mcap", ros, ros.fields(m, "/mag"))
    with pytest.raises(FileProblems, match=r"no topic of sensor_msgs/msg/Imu; the bag has /mag"):
        load(other)
    back = ros.imus(m, "/imu")
    for i in range(60, 100):
        stamp, earlier = back[i][3].header.stamp, back[i - 60][3].header.stamp
        stamp.sec, stamp.nanosec = earlier.sec, earlier.nanosec + 5
    with pytest.raises(FileProblems, match=r"/imu, message 61: time goes back"):
        load(write_bag(tmp_path / "back.mcap", ros, back))
    whole = write_bag(tmp_path / "a.bag", Ros.of(True), Ros.of(True).imus(m, "/imu"))
    (tmp_path / "cut.bag").write_bytes(whole.read_bytes()[:3000])
    with pytest.raises(FileProblems, match=r"cut\.bag: not a readable bag"):
        load(tmp_path / "cut.bag")
    (tmp_path / "a.csv").write_text("a,b\n")
    with pytest.raises(FileProblems, match=r"not a bag: none of \.bag, \.db3, \.mcap"):
        load(tmp_path / "a.csv")


def test_mcap_of_other_messages_is_told_from_a_damaged_one(tmp_path, load, motion):
    writer_module = pytest.importorskip("mcap.writer")
    with (tmp_path / "json.mcap").open("wb") as file:
        writer = writer_module.Writer(file)
        writer.start()
        schema = writer.register_schema("Imu", "jsonschema", b"{}")
        channel = writer.register_channel("/imu", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(FileProblems, match="is MCAP, but its messages are not those of ROS 2"):
        load(tmp_path / "json.mcap")
    ros = Ros.of(False)
    whole = write_bag(tmp_path / "a.mcap", ros, ros.imus(motion(100), "/imu")).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileProblems, match=r"`mcap recover cut\.mcap` makes a whole one"):
        load(tmp_path / "cut.mcap")


def test_without_the_package_the_way_to_install_it_is_said(tmp_path, load, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(InputError, match=r"extra 'ros'.*pip install 'imu-testbench\[ros\]'"):
        load(tmp_path / "a.mcap")


def test_case_22_an_mcap_given_to_a_table_reader_is_told_from_text(cases, tmp_path, clock, load):
    from testbench.formats.options import Options

    folder = cases / "22_mcap_and_bag"
    options = Options(mapping=str(folder / "map.yaml"))
    with pytest.raises(
        FileProblems, match=r"this is an MCAP file, not a text file; .*testbench import rosbag"
    ):
        import_recording("generic", [folder / "x.mcap"], tmp_path / "a", clock, options)
    with pytest.raises(FileProblems, match=r"x\.mcap: not a readable bag"):
        load(folder / "x.mcap")
