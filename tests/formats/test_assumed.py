"""What a format takes for granted is said, until a person says it."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.formats import import_recording
from testbench.formats.assumed import assumed_units, derived_quantities
from testbench.formats.options import Options
from tests.told import codes, told

UNITS = {"acc": "m/s^2", "gyr": "deg/s", "mag": "au"}


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ({}, {"unit.local_field", "unit.by_format"}),
        ({"mag": "uT"}, {"unit.by_format"}),
        ({"acc": "g", "gyr": "rad/s"}, {"unit.local_field"}),
        ({"acc": "g", "gyr": "rad/s", "mag": "uT"}, set()),
    ],
)
def test_units_of_the_format_are_said_unless_a_person_states_them(answers, said) -> None:
    found = assumed_units("hand", UNITS, Options(units=answers))
    assert {own.code for own in found} == said
    assert all(own.where == "hand" and "--unit" in own.remedy for own in found)


def test_a_unit_of_the_format_is_said_with_its_quantity() -> None:
    (found,) = assumed_units("hand", {"acc": "g"}, Options())
    assert found.values == {"quantities": ["acc"], "units": ["acc in g"]}
    assert told([found])[0].startswith("hand: the file states no unit of its acc - by its format")


HAS = {"acc": True, "dv": False, "free": False, "gyr": True, "dq": False}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, []),
        ({"acc": False, "dv": True, "free": True}, ["derived.force_of_velocity"]),
        ({"acc": False, "free": True}, ["derived.force_of_free"]),
        ({"gyr": False, "dq": True}, ["derived.rate_of_orientation"]),
        ({"gyr": False}, ["derived.missing"]),
    ],
)
def test_what_a_quantity_is_computed_from_is_said(changed, said) -> None:
    assert [own.code for own in derived_quantities("hand", HAS | changed)] == said


def test_units_that_titles_state_are_not_said(table, xyz, motion, tmp_path, clock) -> None:
    m = motion(300)
    time = {"Time (s)": m.t}
    stated = time | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
    stated |= xyz("Accelerometer {} (g)", m.acc / 9.80665)
    files = [table("sensors.csv", stated)]
    session = import_recording("ngimu", files, tmp_path / "session", clock)
    assert not {"unit.by_format", "unit.local_field"} & codes(session)
