"""Xsens DOT: three real files of the vendor's app, and every payload mode written by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.pipeline.analyse import analyse
from testbench.records.session.session import Session
from tests.asking import analysis

ABOVE = (
    "sep=,\nDeviceTag:,left\nFirmwareVersion:,2.0.0\nSyncStatus:,{sync}\nOutputRate:,{rate}Hz\n"
    "StartTime: ,now\n\n"
)
UP = np.array([0.0, 0.0, 9.80665])


def ticks(n: int, rate: float = 60.0, start: int = 1_000_000) -> np.ndarray:
    return (start + np.round(np.arange(n) * 1e6 / rate).astype(np.int64)) % 2**32


@pytest.fixture
def dot(table, xyz, tmp_path, clock):
    """Writes and imports one file with the wanted groups of columns."""

    def make(
        groups: dict[str, np.ndarray],
        above: str = ABOVE.format(sync="Un-synced", rate=60),
        rate: float = 60.0,
        **more,
    ) -> Session:
        n = len(next(iter(groups.values())))
        columns = {
            "PacketCounter": np.arange(1, n + 1),
            "SampleTimeFine": ticks(n, rate),
        } | more.pop("first", {})
        patterns = {"Quat": ("Quat_{}", "WXYZ"), "dq": ("dq_{}", "WXYZ"), "dv": ("dv[{}]", "123")}
        for name, array in groups.items():
            pattern, axes = patterns.get(name, (name + "_{}", "XYZ"))
            columns |= xyz(pattern, array, axes)
        path = table(
            "left_20260101_101010_123.csv", columns | more.pop("last", {}), above, form="%.12g"
        )
        return import_recording(
            "xsens_dot", [path], tmp_path / "session", clock, more.pop("options", None)
        )

    return make


@pytest.fixture
def real(data, tmp_path, clock) -> Session:
    return import_recording(
        "xsens_dot", sorted((data / "xsens_dot").glob("*.csv")), tmp_path / "real", clock
    )


@pytest.mark.data
def test_the_real_files_have_the_right_rate_duration_and_names(real):
    assert real.sensor_names == ["Pelvis", "RFemur", "RTibia"]
    assert real.manifest.samples == {"Pelvis": 382, "RFemur": 381, "RTibia": 382}
    assert {s.rate_hz for s in real.manifest.sensors.values()} == {60.0}
    assert real.manifest.duration_s == pytest.approx(6.3668, abs=1e-3)
    for name in real.sensor_names:
        samples = real.imu(name)
        np.testing.assert_array_equal(np.diff(samples.device_time_ns), 16_667_000)
        np.testing.assert_array_equal(np.diff(samples.counter), 1)
        assert np.isnan(samples.gyr).all() and samples.mag is None and not samples.saturated.any()


@pytest.mark.data
def test_synchronised_real_files_share_the_sensors_clock(real):
    starts = {name: real.imu(name).host_time_ns[0] for name in real.sensor_names}
    assert starts == {
        "RTibia": 0,
        "Pelvis": 16_667_000,
        "RFemur": 33_334_000,
    }  # by SampleTimeFine of their first rows
    assert any("Synced" in note for note in real.manifest.notes)


@pytest.mark.data
def test_specific_force_of_the_real_files_gives_back_their_free_acceleration(real, data):
    raw = np.genfromtxt(next((data / "xsens_dot").glob("Pelvis*")), delimiter=",", skip_header=12)
    samples = real.imu("Pelvis")
    np.testing.assert_array_equal(samples.device_q, raw[:, 2:6])
    orientation = Rotation.from_quat(
        samples.device_q, scalar_first=True
    )  # which brings them to unit length
    np.testing.assert_allclose(orientation.apply(samples.acc) - UP, raw[:, 6:9], atol=2e-5)
    assert np.linalg.norm(samples.acc, axis=1).mean() == pytest.approx(9.81, abs=0.15)


@pytest.mark.data
@pytest.mark.filterwarnings("default")
def test_the_real_files_go_through_every_later_stage(real):
    result = analyse(real, analysis())
    assert set(result.estimate.sensors["Pelvis"].orientation) == {"device"}


def test_rates_and_specific_force_are_read_in_their_units(dot, motion):
    m = motion(300, 60.0)
    session = dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr), "Mag": m.mag / 40.0})
    samples = session.imu("left")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-9)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-9)
    np.testing.assert_allclose(samples.mag, m.mag, atol=1e-8)
    assert session.analysis.estimate.filters == ["vqf_6d", "vqf_9d", "fusion", "madgwick_imu"]
    assert session.manifest.sensors["left"].device_tag == "left"


def test_quaternion_and_free_acceleration_give_the_specific_force_exactly(dot, motion):
    m = motion(300, 60.0)
    orientation = Rotation.from_quat(m.q, scalar_first=True)
    free = np.stack([np.sin(m.t), np.cos(3 * m.t), 0.3 * m.t], axis=1)
    samples = dot({"Quat": m.q, "FreeAcc": free}).imu("left")
    np.testing.assert_allclose(samples.acc, orientation.inv().apply(free + UP), atol=1e-9)


def test_euler_angles_are_roll_pitch_yaw_about_the_earth(dot, motion):
    m = motion(300, 60.0)
    yaw_pitch_roll = Rotation.from_quat(m.q, scalar_first=True).as_euler("ZYX", degrees=True)
    samples = dot(
        {"Euler": yaw_pitch_roll[:, ::-1], "FreeAcc": np.zeros((300, 3)), "Gyr": np.degrees(m.gyr)}
    ).imu("left")
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-5)  # but for its noise


def test_increments_over_an_interval_become_rates(dot, motion):
    m = motion(300, 60.0)
    dq = Rotation.from_rotvec(m.gyr / 60.0).as_quat(scalar_first=True)
    samples = dot({"dq": dq, "dv": m.acc / 60.0, "Mag": m.mag / 40.0}).imu("left")
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-8)
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-8)


@pytest.mark.parametrize("rate", [1.0, 20.0, 120.0])
def test_other_output_rates(dot, motion, rate):
    m = motion(200, rate)
    session = dot(
        {"Acc": m.acc, "Gyr": np.degrees(m.gyr)},
        above=ABOVE.format(sync="Synced", rate=f"{rate:g}"),
        rate=rate,
    )
    assert session.manifest.sensors["left"].rate_hz == rate
    assert session.manifest.duration_s == pytest.approx(199 / rate, rel=1e-5)


def test_a_header_that_lies_about_the_rate_is_not_believed(dot, motion):
    m = motion(300, 60.0)
    session = dot(
        {"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, above=ABOVE.format(sync="Synced", rate=120)
    )
    assert session.manifest.sensors["left"].rate_hz == pytest.approx(60, rel=1e-3)
    assert any("say 60 Hz, the header says 120 Hz" in note for note in session.manifest.notes)


@pytest.mark.parametrize("above", ["", "sep=,\n", "DeviceTag:,left\n\n"])
def test_the_preamble_may_be_short_or_missing(dot, motion, above):
    m = motion(300, 60.0)
    session = dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, above=above)
    assert session.manifest.sensors["left"].rate_hz == pytest.approx(60, rel=1e-3)


def test_the_clock_goes_on_when_its_32_bits_are_full(dot, motion):
    m = motion(300, 60.0)
    stamps = ticks(300, 60.0, 2**32 - 2_000_000)
    samples = dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, first={"SampleTimeFine": stamps}).imu(
        "left"
    )
    assert stamps[-1] < stamps[0]
    np.testing.assert_allclose(np.diff(samples.device_time_ns), 16_666_667, atol=1000)


def test_lost_packets_show_in_the_counter_over_its_wrap(dot, motion):
    m = motion(300, 60.0)
    counter = (65_500 + np.arange(300) + (np.arange(300) > 99) * 5) % 65_536
    samples = dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, first={"PacketCounter": counter}).imu(
        "left"
    )
    assert sorted(set(np.diff(samples.counter))) == [1, 6]


@pytest.mark.parametrize("fault", ["zero", "two zero", "old time", "old place"])
def test_a_stale_first_row_is_dropped_and_said(dot, motion, fault):
    m = motion(300, 60.0)
    stamps, acc, gyr = ticks(300), m.acc.copy(), np.degrees(m.gyr)
    dropped = 1
    if fault == "zero":
        acc[0] = gyr[0] = 0
    elif fault == "two zero":
        acc[:2] = gyr[:2] = 0
        dropped = 2
    elif fault == "old time":
        stamps[0] -= 700_000
    else:
        acc[0] = [9.8, 0.1, 0.1]
    session = dot({"Acc": acc, "Gyr": gyr}, first={"SampleTimeFine": stamps})
    samples = session.imu("left")
    assert (
        len(samples) == 300 - dropped
        and samples.counter[0] == dropped + 1
        and samples.host_time_ns[0] == 0
    )
    np.testing.assert_allclose(samples.acc[0], m.acc[dropped], atol=1e-9)
    (said,) = [own for own in session.manifest.findings if own.code == "structure.stale_rows"]
    assert said.values == {"count": dropped} and said.where == "left"


def test_a_sound_first_row_is_kept_even_if_the_sensor_moves(dot, motion):
    m = motion(300, 60.0)
    session = dot({"Acc": m.acc[100:], "Gyr": np.degrees(m.gyr[100:]), "Quat": m.q[100:]})
    assert len(session.imu("left")) == 200


def test_status_bits_and_clip_counts_mark_saturation(dot, motion):
    m = motion(300, 60.0)
    status = np.zeros(300)
    status[[5, 6, 7]] = 1, 256, 512
    samples = dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, last={"Status": status}).imu("left")
    assert list(np.flatnonzero(samples.saturated)) == [5, 6]


def test_files_that_are_not_synchronised_each_begin_at_zero(table, xyz, motion, tmp_path, clock):
    m = motion(300, 60.0)
    files = []
    for i, name in enumerate(("arm", "hand")):
        columns = {
            "PacketCounter": np.arange(300),
            "SampleTimeFine": ticks(300, start=10_000_000 * (i + 1)),
        }
        files.append(
            table(
                f"{name}.csv",
                columns | xyz("Acc_{}", m.acc),
                ABOVE.format(sync="Un-synced", rate=60),
            )
        )
    session = import_recording("xsens_dot", files, tmp_path / "session", clock)
    assert [session.imu(name).host_time_ns[0] for name in ("arm", "hand")] == [0, 0]
    assert any("do not say Synced" in note for note in session.manifest.notes)


def test_files_of_the_same_name_are_told_apart_by_their_tags_and_tags_lead_nowhere(
    table, xyz, motion, tmp_path, clock
):
    m = motion(300, 60.0)
    files = []
    for tag in ("../../evil", "left foot"):
        columns = {"PacketCounter": np.arange(300), "SampleTimeFine": ticks(300)} | xyz(
            "Acc_{}", m.acc
        )
        files.append(
            table(
                f"{len(files)}/dot.csv", columns, f"sep=,\nDeviceTag:,{tag}\nOutputRate:,60Hz\n\n"
            )
        )
    session = import_recording("xsens_dot", files, tmp_path / "session", clock)
    assert session.sensor_names == ["evil", "left_foot"]
    assert {path.name for path in (tmp_path / "session").glob("*.parquet")} == {
        "imu_evil.parquet",
        "imu_left_foot.parquet",
    }


def test_decimal_commas_between_semicolons_are_read(table, xyz, motion, tmp_path, clock):
    m = motion(300, 60.0)
    columns = (
        {"PacketCounter": np.arange(300), "SampleTimeFine": ticks(300)}
        | xyz("Acc_{}", m.acc)
        | xyz("Gyr_{}", np.degrees(m.gyr))
    )
    path = table("d.csv", columns, "sep=;\n", separator=";", decimal=",", form="%.10g")
    np.testing.assert_allclose(
        import_recording("xsens_dot", [path], tmp_path / "s", clock).imu("d").acc, m.acc, atol=1e-8
    )


def test_another_unit_than_the_formats_is_asked_for_and_answered(dot, motion, tmp_path):
    m = motion(600, 60.0)
    with pytest.raises(
        InputError, match=r"gyroscope turns 5\d\.\d times too little.*--unit gyr=UNIT"
    ):
        dot({"Acc": m.acc, "Gyr": m.gyr})
    with pytest.raises(
        InputError,
        match=r"\|acc\| at rest is 1 m/s\^2.*looks like g taken for m/s\^2.*--unit acc=UNIT",
    ):
        dot({"Acc": m.acc / 9.80665, "Gyr": np.degrees(m.gyr)})
    assert not (tmp_path / "session").exists()
    session = dot(
        {"Acc": m.acc / 9.80665, "Gyr": m.gyr}, options=Options(units={"acc": "g", "gyr": "rad/s"})
    )
    np.testing.assert_allclose(session.imu("left").gyr, m.gyr, atol=1e-9)


def test_free_acceleration_alone_is_no_specific_force(dot, motion):
    with pytest.raises(FileProblems, match="has no column of samples"):
        dot({"Temperature": motion(20, 60.0).acc})


def test_nothing_is_written_when_a_late_row_is_at_fault(dot, motion, tmp_path):
    m = motion(300, 60.0)
    stamps = ticks(300)
    stamps[250:] -= 500_000
    with pytest.raises(
        FileProblems, match=r"left_\d+_\d+_\d+\.csv:259: time goes back from 5\.\d+ s to 4"
    ):
        dot({"Acc": m.acc, "Gyr": np.degrees(m.gyr)}, first={"SampleTimeFine": stamps})
    assert not (tmp_path / "session").exists()


def test_no_files_at_all(tmp_path: Path, clock) -> None:
    with pytest.raises(InputError, match="at least one file"):
        import_recording("xsens_dot", [], tmp_path / "session", clock)
