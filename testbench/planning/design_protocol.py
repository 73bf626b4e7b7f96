"""A designed calibration as a protocol file."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import yaml

from testbench.planning.experiment_design import Design
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot


@dataclass(frozen=True)
class Draft:
    """A designed protocol for which the ways between the poses are still sought.

    Attributes:
        name: Of the protocol.
        purpose: Of the protocol, as it is written there.
        robot: The arm that makes it.
        sensor_name: What the protocol calls the sensor.
        sensor: The sensor that is calibrated.
        design: Poses and turns.
        notes: Lines of comment for the head of the file.
    """

    name: str
    purpose: str
    robot: Robot
    sensor_name: str
    sensor: Sensor
    design: Design
    notes: Sequence[str]

    def text(self, via_home: Collection[int]) -> str:
        """The YAML of the protocol.

        Args:
            via_home: Poses that are reached by way of home, by their index.
        """
        lines = [
            "# yaml-language-server: $schema=schema.json",
            *(f"# {note}" for note in self.notes),
        ]
        head = {
            "name": self.name,
            "purpose": self.purpose,
            "robot": self.robot.name,
            "sensors": {
                self.sensor_name: self.sensor.model_dump(exclude_defaults=True, exclude_none=True)
            },
        }
        lines.append(yaml.safe_dump(head, sort_keys=False, width=120).rstrip())
        lines += [
            "",
            f"variables: {{dwell_s: {self.design.dwell:g}}}",
            "",
            "sections:",
            "  - name: poses",
            "    role: calibration",
            "    steps:",
        ]
        for k, q in enumerate(self.design.q):
            if k in via_home:
                lines.append(f"      - {{name: home before pose {k + 1}, move_to: home}}")
            angles = ", ".join(f"{round(math.degrees(angle), 6):g}" for angle in q)
            lines.append(
                f"      - {{name: pose {k + 1}, move_to_deg: [{angles}], dwell_s: dwell_s}}"
            )
            for turn in self.design.turns:
                if turn.pose == k:
                    shape = (
                        f"amplitude_deg: {math.degrees(turn.amplitude):g}, rate_deg_s: "
                        f"{math.degrees(turn.rate):g}"
                    )
                    joint = self.robot.joint_names[turn.joint]
                    lines.append(
                        f"      - {{name: turn {joint}, sweep: {{{joint}: {{trapezoid: "
                        f"{{{shape}}}}}}}, dwell_s: 1}}"
                    )
        lines += ["", "estimate: {filters: [vqf_6d], align: heading}", ""]
        return "\n".join(lines)
