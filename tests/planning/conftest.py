"""Protocols of a few steps."""

import pytest

from testbench import plan

TOP = """\
name: trial
purpose: For a test
robot: ur3e
sensors: {hand: {preset: ideal, link: wrist_3_link, mounting: {position_mm: [0, 0, 10]}}}
"""


@pytest.fixture
def planned(tmp_path):
    """Plans a protocol of the given steps (YAML, one a line)."""

    def make(*steps, motion="{speed: 1, acceleration: 1, jerk: 1}", robot=None, top=TOP):
        lines = "".join(f"      - {step}\n" for step in steps)
        file = tmp_path / "trial.yaml"
        file.write_text(f"{top}motion: {motion}\nsections:\n  - name: part\n    steps:\n{lines}")
        return plan(file, robot)

    return make
