"""An arm with kinematics of its own, as its maker measured it."""

from __future__ import annotations

import atexit
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from testbench.exceptions import InputError
from testbench.model.dh_calibration import calibrated
from testbench.model.dh_plausibility import judge_corrections
from testbench.planning.planner import find_robot
from testbench.records.specs.arm_calibration import load_arm_calibration
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import Robot


def calibrated_robot(protocol: str | Path, robot: str | Path | None, kinematics: Path) -> Robot:
    """The arm of a protocol with its own kinematics, from a calibration.yaml.

    Its corrected URDF lies in a temporary folder, which is removed when the process ends; the
    session keeps a copy. What is doubtful about the corrections is among the warnings of every plan
    for it.

    Args:
        protocol: Name or file.
        robot: Name or file of the arm as its maker states it; the protocol's if None.
        kinematics: The calibration.yaml.

    Raises:
        InputError: The calibration is another arm's, or can be no factory calibration.
    """
    calibration = load_arm_calibration(kinematics)
    nominal = find_robot(load_protocol(protocol), robot)
    folder = Path(mkdtemp(prefix="testbench-"))
    atexit.register(rmtree, folder, ignore_errors=True)  # plans read the URDF until then
    own = calibrated(nominal, calibration, folder)
    try:
        doubt = judge_corrections(nominal, own)
    except InputError as error:
        raise InputError(f"{kinematics}: {error}") from None
    if doubt is None:
        return own
    spec = own.spec.model_copy(
        update={"assumptions": [*own.spec.assumptions, f"{kinematics}: {doubt}"]}
    )
    return Robot(spec, own.urdf, own.text, own.file)
