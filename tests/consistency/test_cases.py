"""Situations from public bug reports, imported: the right thing is warned or asked about."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from tests.studies.known_recordings import FixedClock

WARNED = {
    "01_gyroscope_mirrored_no_truth": ("gyr_mirrored", r"gyr\.axes.*z: -z"),
    "02_accelerometer_sign_ios": ("orientation_down", r"acc\.scale: -1"),
    "10_device_quaternion_order": ("orientation_reading", r"quaternion\.order: xyzw"),
}
ASKED = {
    "14_gravity_removed": "Gravity seems to have been removed",
    "15_rate_wrong_by_two": r"2 times as far.*came at 25 Hz.*gyr\.scale: 2.*--rate 25",
}


@pytest.mark.parametrize("case", WARNED)
def test_the_fault_is_in_the_findings_of_the_session(
    case: str, cases: Path, tmp_path: Path
) -> None:
    code, remedy = WARNED[case]
    folder = cases / case
    session = import_recording(
        "generic",
        [folder / "data.csv"],
        tmp_path / "session",
        FixedClock(),
        Options(mapping=str(folder / "map.yaml")),
    )
    (found,) = [one for one in session.manifest.findings if one.code == f"consistency.{code}"]
    assert found.where == "imu"

    assert re.search(remedy, found.remedy)


@pytest.mark.parametrize("case", ASKED)
def test_what_cannot_be_right_is_refused_and_nothing_written(
    case: str, cases: Path, tmp_path: Path
) -> None:
    folder = cases / case
    with pytest.raises(InputError, match=ASKED[case]):
        import_recording(
            "generic",
            [folder / "data.csv"],
            tmp_path / "session",
            FixedClock(),
            Options(mapping=str(folder / "map.yaml")),
        )
    assert not (tmp_path / "session").exists()
