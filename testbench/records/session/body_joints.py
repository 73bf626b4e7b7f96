"""The joints of a session: those of the arm's segments, and those of a body that no arm carries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from testbench.exceptions import SessionError
from testbench.records.specs.protocol import Analysis, Body, BodyJoint


def with_body(analysis: Analysis, sensors: Sequence[str], file: Path) -> Analysis:
    """The analysis of a session, in which every joint stands among `joints`.

    Those whose sensors no arm carries are joints of the body, however they came into the manifest.

    Args:
        analysis: As the manifest has it.
        sensors: Names of those that were recorded.
        file: The manifest, for messages.

    Raises:
        SessionError: A joint or the body speaks of a sensor that there is not, or of one on the arm
            that stands for no segment.
    """
    body = analysis.body or Body()

    def damaged(where: str, what: str) -> SessionError:
        return SessionError(f"{file}: the analysis is damaged: {where} {what}")

    for key, names in (("segments", body.segments), ("alignment.forward", body.alignment.forward)):
        for name in names:
            if name not in sensors:
                raise damaged(
                    f"body.{key}", f"is of '{name}'; the sensors are {', '.join(sensors)}"
                )
    joints = {**analysis.joints, **body.joints}
    of_body = dict(body.joints)
    for name, joint in joints.items():
        ends = {"proximal": joint.proximal, "distal": joint.distal}
        for end, sensor in ends.items():
            if sensor not in sensors:
                raise damaged(
                    f"joints.{name}.{end}", f"is '{sensor}'; the sensors are {', '.join(sensors)}"
                )
        placed = [sensor for sensor in ends.values() if sensor in analysis.sensors]
        without = [sensor for sensor in placed if analysis.sensors[sensor].segment is None]
        if len(placed) == 2 and name not in body.joints:
            if without:
                raise damaged(f"joints.{name}", f"needs the segment of sensor '{without[0]}'")
            continue
        own = joint if isinstance(joint, BodyJoint) else BodyJoint(**vars(joint))
        joints[name] = of_body[name] = own
    if not of_body:
        return analysis
    whole = body.model_copy(update={"joints": of_body})
    return analysis.model_copy(update={"joints": joints, "body": whole})
