"""An arm's own kinematics: the corrections of its DH parameters.

Its maker measured them and its controller keeps them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.strict import StrictModel

Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class DhTable(StrictModel):
    """One number for each joint, base first."""

    theta_rad: Six = [0.0] * 6
    d_m: Six = [0.0] * 6
    a_m: Six = [0.0] * 6
    alpha_rad: Six = [0.0] * 6


class ArmCalibration(StrictModel):
    """The content of a calibration.yaml.

    The corrections are those of the controller's file calibration.conf (delta_theta, delta_d,
    delta_a, delta_alpha), which are added to the nominal parameters of the same convention
    (Universal Robots, DH parameters).
    """

    robot: str = Field(description="Name of the robot it belongs to.")
    serial: str | None = Field(
        default=None,
        description="Serial number of the arm; compared at connection where it is given.",
    )
    corrections: DhTable = Field(description="Added to the nominal parameters.")

    @model_validator(mode="after")
    def _flange_is_a_rotation_and_a_shift(self) -> ArmCalibration:
        if self.corrections.a_m[5] != 0 or self.corrections.alpha_rad[5] != 0:
            raise ValueError(
                "corrections of a_m and alpha_rad of the last joint must be 0: they would move the "
                "flange off its axis"
            )
        return self


def load_arm_calibration(path: Path) -> ArmCalibration:
    """Read a calibration.

    Raises:
        FileProblems: It is malformed.
    """
    return load_yaml(path, ArmCalibration).value
