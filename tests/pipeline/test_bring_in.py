"""What an import is told of its files is told once."""

from __future__ import annotations

import pytest

from testbench.exceptions import InputError
from testbench.pipeline.bring_in import bring_in
from testbench.pipeline.request import ImportRequest, TruthRequest


@pytest.mark.parametrize(
    ("links", "name"),
    [(("upper", "fore"), "the sensor"), (("hand=upper", "hand=fore"), "hand")],
)
def test_two_answers_to_one_question_are_refused(tmp_path, links, name) -> None:
    truth = TruthRequest(file=tmp_path / "log.csv", links=links)
    asked = ImportRequest(
        format="generic", files=(tmp_path / "imu.csv",), out=tmp_path / "session", truth=truth
    )
    with pytest.raises(InputError, match=f"--link is given twice for {name}"):
        bring_in(asked)


def test_a_unit_is_stated_once(tmp_path) -> None:
    asked = ImportRequest(
        format="generic",
        files=(tmp_path / "imu.csv",),
        out=tmp_path / "session",
        units=("acc=g", "acc=m/s^2"),
    )
    with pytest.raises(InputError, match="--unit is given twice for acc"):
        bring_in(asked)


def test_the_markers_of_a_sensor_are_named_once(tmp_path) -> None:
    clusters = ("foot=M1,M2, M3", "foot=M4,M5,M6")
    truth = TruthRequest(file=tmp_path / "walk.c3d", clusters=clusters)
    asked = ImportRequest(
        format="generic", files=(tmp_path / "imu.csv",), out=tmp_path / "session", truth=truth
    )
    with pytest.raises(InputError, match="--truth-cluster is given twice for foot"):
        bring_in(asked)
