"""When a recording was made: from its files, from a person, or said to be unknown; and what that
means for a calibration.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.estimation import estimate
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.dates import NO_ZONE, read_date, recorded_in_name
from testbench.formats.options import Options
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.calibration_file import SensorCalibration
from testbench.reporting.sections.run import facts


@pytest.mark.parametrize(
    ("text", "expected", "zoned"),
    [
        ("2021-08-20_20:21:13_835 GMT+8", "2021-08-20T12:21:13", True),  # Xsens DOT
        ("2021-08-20_20:21:13_835 GMT-3:30", "2021-08-20T23:51:13", True),
        ("2023-03-01 12:34:56", "2023-03-01T12:34:56", False),
        ("2023-03-01T12:34:56.789Z", "2023-03-01T12:34:56", True),
        ("2023-03-01T00:34:56+0200", "2023-02-28T22:34:56", True),
        ("3/1/2023 12:05:06 AM", "2023-03-01T00:05:06", False),
        ("3/1/2023 1:05:06 PM", "2023-03-01T13:05:06", False),
        ("25/12/2023 10:00:00", "2023-12-25T10:00:00", False),
        ("Wed Mar 01 12:34:56 2023", "2023-03-01T12:34:56", False),
        ("2023-03-01", "2023-03-01T00:00:00", False),
    ],
)
def test_dates_are_read_as_they_are_meant(text, expected, zoned):
    assert read_date(text) == (datetime.fromisoformat(expected).replace(tzinfo=UTC), zoned)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "now",
        "Unknown",
        "3/4/2023 10:00",
        "1970-01-01 00:00:00",
        "2023-13-01",
        "2023-02-30",
        "12:34:56",
    ],
)
def test_what_is_no_date_or_could_be_two_is_not_read(text):
    assert read_date(text) is None


@given(
    st.datetimes(datetime.fromisoformat("1991-01-01"), datetime.fromisoformat("2100-01-01")),
    st.integers(-14 * 60, 14 * 60),
)
def test_a_date_with_a_zone_survives_being_written(local, minutes):
    local = local.replace(microsecond=0)
    zone = f"{'-' if minutes < 0 else '+'}{abs(minutes) // 60:02d}:{abs(minutes) % 60:02d}"
    found = read_date(f"{local:%Y-%m-%dT%H:%M:%S}{zone}")
    assert found == (local.replace(tzinfo=UTC) - timedelta(minutes=minutes), True)


def test_names_of_files_and_folders(tmp_path):
    for name in (
        "Pelvis_20210820_202113_836.csv",
        "2021-08-20 20-21-13/NGIMU 01/sensors.csv",
        "2021-08-20T20-21-13.csv",
    ):
        found = recorded_in_name(tmp_path / name)
        assert found is not None and found.at == datetime(2021, 8, 20, 20, 21, 13, tzinfo=UTC), name
        assert NO_ZONE in found.source
    for name in ("MT_0120000B-000_00B432CC.txt", "12345678_123456.csv", "walk.csv"):
        assert recorded_in_name(tmp_path / "a" / "b" / name) is None, name


def matrix(table, name: str, stamps: list[str]):
    n = len(stamps)
    columns = {"dateTime": stamps} | {f"acc_{a}": np.full(n, float(a == "z")) for a in "xyz"}
    return table(name, columns | {f"gyr_{a}": np.zeros(n) for a in "xyz"})


def test_the_date_in_the_file_is_kept_and_a_persons_goes_before_it(table, tmp_path, clock):
    file = matrix(table, "left.csv", [f"2023-03-01 12:00:{i // 100:02d}" for i in range(300)])
    session = import_recording("matrix", [file], tmp_path / "a", clock)
    assert session.recorded_at == datetime(2023, 3, 1, 12, tzinfo=UTC)
    assert session.started == clock.utc()
    assert session.manifest.recorded_by == f"dateTime in left.csv; {NO_ZONE}"
    assert dict(facts(session))["Recorded"].startswith(
        "2023-03-01 12:00:00 UTC, by dateTime in left.csv"
    )
    stated = import_recording(
        "matrix", [file], tmp_path / "b", clock, Options(recorded_at="2023-03-01T12:00:00+02:00")
    )
    assert stated.recorded_at == datetime(2023, 3, 1, 10, tzinfo=UTC)
    assert stated.manifest.recorded_by == "stated with --recorded-at"
    with pytest.raises(InputError, match="--recorded-at yesterday: write the date as 2021-08-20"):
        import_recording("matrix", [file], tmp_path / "c", clock, Options(recorded_at="yesterday"))


@pytest.mark.data
def test_the_real_dot_files_say_when_they_were_recorded(data, tmp_path, clock):
    session = import_recording(
        "xsens_dot", sorted((data / "xsens_dot").glob("*.csv")), tmp_path / "real", clock
    )
    assert session.recorded_at is not None
    assert abs(session.recorded_at - datetime(2021, 8, 20, 12, 21, 13, tzinfo=UTC)) < timedelta(
        seconds=2
    )  # 20:21 GMT+8
    assert session.manifest.recorded_by.startswith("StartTime in ")


def test_an_unknown_date_is_said_and_chooses_between_no_calibrations(table, tmp_path, clock):
    """Imported today, recorded who knows when: the calibration nearest to today is not the nearest
    to the recording.
    """
    stamps = [f"12:00:{i // 100:02d}" for i in range(300)]
    file = matrix(table, "left.csv", stamps)
    arguments = ["import", "matrix", str(file), "--out", str(tmp_path / "cli")]
    shown = " ".join(CliRunner().invoke(app, arguments, catch_exceptions=False).output.split())
    assert "recorded: date unknown" in shown
    assert "by which the nearest of several stored calibrations is chosen" in shown
    assert "the date of the recording is unknown" not in shown  # once is enough
    session = import_recording("matrix", [file], tmp_path / "a", clock)
    assert session.recorded_at is None
    assert session.manifest.recorded_utc is None
    assert any("the date of the recording is unknown" in note for note in session.manifest.notes)
    old = SensorCalibration(
        "left",
        None,
        datetime(2023, 2, 1, tzinfo=UTC),
        "old",
        "",
        "",
        None,
        {"gyroscope": TriadCalibration("static_bias", bias=np.full(3, 0.01))},
    )
    new = replace(old, calibrated=clock.utc(), session="new")
    with pytest.raises(
        InputError,
        match="none of the 2 stored calibrations of sensor 'left' is the nearest in time",
    ):
        estimate(session, ["gyro"], [old, new])
    (remark,) = [
        str(found)
        for found in estimate(session, ["gyro"], [old]).sensors["left"].findings
        if found.code == "calibration.stored_undated"
    ]
    assert "when the session was recorded, and how long from that, is unknown" in remark
    dated = import_recording(
        "matrix", [file], tmp_path / "b", clock, Options(recorded_at="2023-02-20")
    )
    (remark,) = [
        str(found)
        for found in estimate(dated, ["gyro"], [old, new]).sensors["left"].findings
        if found.code == "calibration.stored"
    ]
    assert "session old of 2023-02-01" in remark
