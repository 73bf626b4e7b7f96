"""Names from files and units from titles."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.tables.recognise import find_sensors, find_time
from testbench.formats.tables.units import find_unit


@given(st.text(max_size=200))
def test_any_text_becomes_a_harmless_name(text: str) -> None:
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", sensor_name(text))


@given(st.lists(st.text(max_size=80), max_size=12))
def test_names_are_unique_also_on_disks_that_ignore_case(texts: list[str]) -> None:
    names = unique_names(texts)
    assert len({name.lower() for name in names}) == len(texts)
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", name) for name in names)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("../../etc/passwd", "etc_passwd"),
        ("Left foot", "Left_foot"),
        ("00B432CC", "imu_00B432CC"),
        ("", "imu"),
        ("..", "imu"),
        ("é", "imu"),
    ],
)
def test_no_name_leads_out_of_the_folder(text: str, name: str) -> None:
    assert sensor_name(text) == name


def test_the_stamp_of_the_vendors_app_is_left_out() -> None:
    assert stem_without_stamp("Pelvis_20210820_202113_836") == "Pelvis"
    assert stem_without_stamp("trial_7") == "trial_7"


@pytest.mark.parametrize(
    ("quantity", "text", "factor"),
    [
        ("acc", "g", 9.80665),
        ("acc", "mg", 9.80665e-3),
        ("acc", "m/(s^2)", 1),
        ("acc", "m/s²", 1),
        ("gyr", "dps", np.pi / 180),
        ("gyr", "°/s", np.pi / 180),
        ("gyr", "rad/s", 1),
        ("mag", "G", 100),
        ("mag", "gauss", 100),
        ("mag", "mG", 0.1),
        ("mag", "uT", 1),
        ("mag", "µT", 1),
        ("mag", "nT", 1e-3),
    ],
)
def test_units_by_their_usual_spellings(quantity: str, text: str, factor: float) -> None:
    assert find_unit(quantity, text).factor == pytest.approx(factor)


def test_an_unknown_unit_is_refused_with_those_that_exist() -> None:
    with pytest.raises(NotFoundError, match="m/s\\^2, g, mg"):
        find_unit("acc", "furlong")
    with pytest.raises(InputError, match="unknown quantity 'speed'"):
        Options(units={"speed": "m/s"})


def test_an_answer_that_nobody_asked_for_is_refused() -> None:
    with pytest.raises(InputError, match="--unit mag=uT, --rate: has no effect"):
        Options(units={"mag": "uT"}, rate=50.0).check_all_used("broad")


def test_titles_in_many_styles_are_recognised() -> None:
    for titles in (
        ["AccX", "AccY", "AccZ"],
        [" Acc_X ", "Acc_Y", "Acc_Z"],
        ["acc_x [g]", "acc_y [g]", "acc_z [g]"],
        ["Accelerometer X (g)", "Accelerometer Y (g)", "Accelerometer Z (g)"],
        ["accel.x", "accel.y", "accel.z"],
    ):
        (found,) = find_sensors(titles).values()
        assert found.columns["acc"] == titles
    sensors = find_sensors(
        [f"IMU{n} {kind}{axis}" for n in (1, 2) for kind in ("Acc", "Gyr") for axis in "XYZ"]
    )
    assert list(sensors) == ["IMU1", "IMU2"]
    assert find_sensors(["q0", "q1", "q2", "q3"])[""].columns == {
        "quaternion": ["q0", "q1", "q2", "q3"]
    }
    assert find_sensors(["AccX", "AccY", "temperature"]) == {}


def test_a_title_states_its_unit() -> None:
    titles = [f"Gyroscope {axis} (deg/s)" for axis in "XYZ"]
    assert find_sensors(titles)[""].units == {"gyr": "deg/s"}
    assert find_time(["n", "Time (s)"]) == ("Time (s)", "s")
    assert find_time(["timestamp_ms"]) == ("timestamp_ms", "ms")
    assert find_time(["time_s"]) == ("time_s", "s")
    assert find_time(["temperature"]) is None
