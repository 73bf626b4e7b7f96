"""Which column is what, and what cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import FileProblems
from tests.formats.mapped.mappings import PLAIN, check


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[wx, wy, wz]", "[ax, ay, az]"), "acc and gyr are both read from ax, ay, az of data.csv"),
        (("[wx, wy, wz]", "[wx, ay, wz]"), "acc and gyr are both read from"),
        (("[wx, wy, wz]", "[5, 3, 7]"), "acc and gyr are both read from"),
        (("[wx, wy, wz]", "[wx, wx, wz]"), "the column wx stands twice"),
        (("[wx, wy, wz]", "[t, wy, wz]"), "t is both its time and its value"),
    ],
)
def test_a_column_taken_for_two_things_is_refused(plain, motion, load, change, said):
    with pytest.raises(FileProblems, match=r"map.yaml:6:\d+: .*" + said):
        load(PLAIN.replace(*change), plain(motion(300)))


def test_a_truth_that_is_the_device_quaternion_is_refused(plain, motion, load, xyz):
    m = motion(300)
    text = PLAIN + "    quaternion: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    text += "    truth: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    with pytest.raises(FileProblems, match="quaternion and truth are both read from"):
        load(text, plain(m, more=xyz("q{}", m.q, "wxyz")))


def test_columns_of_one_title_are_read_by_number_alone(motion, load, tmp_path):
    m = motion(300)
    rows = "\n".join(
        ",".join(f"{v:.9g}" for v in row) for row in np.column_stack([m.t, m.acc, m.gyr])
    )
    (tmp_path / "d.csv").write_text(f"t,x,y,z,x,y,z\n{rows}\n")
    text = PLAIN.replace("[ax, ay, az]", "[2, 3, 4]").replace("[wx, wy, wz]", "[5, 6, 7]")
    check(load(text, tmp_path / "d.csv").imu("imu"), m)
    with pytest.raises(FileProblems, match=r"more than one column 'x' \(its columns 2 and 5\)"):
        load(text.replace("[2, 3, 4]", "[x, y, z]"), tmp_path / "d.csv")


def test_shared_and_empty_columns_are_named(plain, motion, load):
    m = motion(300)
    nothing = {f"m{axis}": np.full(300, np.nan) for axis in "xyz"}
    text = PLAIN + "    mag: {columns: [mx, my, mz], unit: uT}\n"
    text += "  twin:\n    acc: {columns: [ax, ay, az], unit: m/s^2}\n"
    found = {f.code: f for f in load(text, plain(m, more=nothing)).manifest.findings}
    assert found["structure.empty_columns"].values["columns"] == "mx, my, mz"
    assert found["structure.shared_columns"].values["columns"] == ["ax", "ay", "az"]


def test_columns_by_number_without_titles(tmp_path, motion, load):
    m = motion(600)
    np.savetxt(tmp_path / "d.csv", np.column_stack([m.t, m.gyr, m.acc]), delimiter=",")
    text = (
        PLAIN.replace("column: t", "column: 1")
        .replace("[ax, ay, az]", "[5, 6, 7]")
        .replace("[wx, wy, wz]", "[2, 3, 4]")
    )
    check(load(text + "text: {header: false}\n", tmp_path / "d.csv").imu("imu"), m)
