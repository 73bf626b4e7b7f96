"""Corrections of an arm's kinematics that no factory calibration has are refused, and doubtful ones
said.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from testbench.exceptions import InputError
from testbench.model.dh_calibration import calibrated
from testbench.model.dh_plausibility import Deviation, flange_deviation
from testbench.pipeline.prepared import make_plan
from testbench.pipeline.request import ArmRequest
from testbench.records.specs.arm_calibration import ArmCalibration, DhTable
from testbench.records.specs.robot import load_robot
from tests.asking import run_of


def deviation(folder: Path, name: str = "ur3e", **table: list[float]) -> Deviation:
    nominal = load_robot(name)
    return flange_deviation(
        nominal,
        calibrated(
            nominal, ArmCalibration(robot=name, corrections=DhTable.model_validate(table)), folder
        ),
    )


def test_a_single_correction_moves_and_turns_the_flange_as_it_must(tmp_path):
    raised = deviation(
        tmp_path, d_m=[0.003, 0, 0, 0, 0, 0.0]
    )  # the whole arm, along the axis of joint 1
    assert (raised.shift_mm, raised.turn_deg) == pytest.approx((3, 0), abs=1e-6)
    turned = deviation(tmp_path, theta_rad=[0, 0, 0, 0, 0, 0.01])  # the flange about itself
    assert (turned.shift_mm, turned.turn_deg) == pytest.approx((0, np.degrees(0.01)), abs=1e-6)
    # about joint 1: an arc at the flange's distance from that axis, which is largest of the
    # stretched arm
    swung = deviation(tmp_path, theta_rad=[0.001, 0, 0, 0, 0, 0.0])
    reach = np.hypot(0.24355 + 0.2132, 0.13105 + 0.0921)
    assert swung.turn_deg == pytest.approx(np.degrees(0.001))
    assert 1000 * 0.001 * reach * 0.999 < swung.shift_mm < 1000 * 0.001 * (reach + 0.0854)


def test_shifts_that_cancel_are_no_deviation(tmp_path):
    assert deviation(tmp_path, d_m=[0, 0.3, -0.25, -0.05, 0, 0.0]).shift_mm < 1e-6


def plan_with(folder: Path, protocol: Path, **table: list[float]):
    file = folder / "calibration.yaml"
    file.write_text(yaml.safe_dump({"robot": "ur3e", "corrections": table}), encoding="utf-8")
    return make_plan(run_of(protocol, arm=ArmRequest(kinematics=file)))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"d_m": [0.4, 0, 0, 0, 0, 0.0]}, "move the flange by up to 400 mm"),
        ({"theta_rad": [0, 0, 0, 0, 0, 1.5]}, "turn it by up to 85.9 deg"),
        ({"alpha_rad": [0, 0, 0, 0.04, 0, 0.0]}, "more than the 20 mm and 2 deg allowed"),
    ],
    ids=["millimetres", "degrees", "a little too much"],
)
def test_what_can_be_no_factory_calibration_is_refused_with_its_units(tiny, tmp_path, table, said):
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        plan_with(tmp_path, tiny, **table)
    assert "calibration.yaml" in str(caught.value)
    assert "lengths are in metres, angles in radians" in str(caught.value)


def test_the_twists_of_a_public_calibration_pass_without_a_word(tiny, tmp_path):
    twists = [*np.radians([0.066, 0.205, 0.225, 0.023, 0.115]).tolist(), 0.0]  # docs/uncertainty.md
    assert not [
        w for w in plan_with(tmp_path, tiny, alpha_rad=twists).check.warnings if "kinematics" in w
    ]


def test_a_doubtful_calibration_is_among_the_warnings_of_the_plan(tiny, tmp_path):
    (doubt,) = [
        w
        for w in plan_with(tmp_path, tiny, d_m=[0.008, 0, 0, 0, 0, 0.0]).check.warnings
        if "kinematics" in w
    ]
    assert "by up to 8 mm" in doubt and "in metres and radians?" in doubt
