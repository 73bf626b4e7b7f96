"""An arm with kinematics of its own leaves nothing behind."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.house import ROOT
from tests.patience import PATIENCE_S

ASK = """\
import sys
from pathlib import Path
from testbench.pipeline.own_kinematics import calibrated_robot

robot = calibrated_robot("quick", None, Path(sys.argv[1]))
print(robot.urdf, robot.urdf.is_file())
"""
ZEROS = "[0, 0, 0, 0, 0, 0]"
OWN = f"""\
robot: ur3e
serial: "20265000001"
corrections:
  theta_rad: {ZEROS}
  d_m: [0.0001, 0, 0, 0, 0, 0]
  a_m: {ZEROS}
  alpha_rad: {ZEROS}
"""


def test_the_urdf_of_an_arms_own_kinematics_is_there_until_the_process_ends(tmp_path):
    (tmp_path / "calibration.yaml").write_text(OWN, encoding="utf-8")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", ASK, str(tmp_path / "calibration.yaml")],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(temporary)},
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )
    urdf, there = done.stdout.split()
    assert there == "True" and Path(urdf).is_relative_to(temporary)
    assert not list(temporary.iterdir())
