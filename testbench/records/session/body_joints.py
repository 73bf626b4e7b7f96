"""The joints of a session: those of the arm's segments, and those of a body that no arm carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from testbench.exceptions import SessionError
from testbench.records.specs.protocol import Analysis, Body, BodyJoint, JointDefinition


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
    joints = {**analysis.joints, **body.joints}
    _check_names(body, joints, sensors, file)
    of_body = dict(body.joints)
    for name, joint in joints.items():
        if name not in body.joints and {joint.proximal, joint.distal} <= set(analysis.sensors):
            _check_segments(name, joint, analysis, file)
        else:
            own = joint if isinstance(joint, BodyJoint) else BodyJoint(**vars(joint))
            joints[name] = of_body[name] = own
    if not of_body:
        return analysis
    whole = body.model_copy(update={"joints": of_body})
    return analysis.model_copy(update={"joints": joints, "body": whole})


def _check_names(
    body: Body, joints: Mapping[str, JointDefinition], sensors: Sequence[str], file: Path
) -> None:
    """Refuse what speaks of sensors that there are not."""
    spoken = [("body.segments", "is of", name) for name in body.segments]
    spoken += [("body.alignment.forward", "is of", name) for name in body.alignment.forward]
    for name, joint in joints.items():
        spoken.append((f"joints.{name}.proximal", "is", joint.proximal))
        spoken.append((f"joints.{name}.distal", "is", joint.distal))
    for where, verb, sensor in spoken:
        if sensor not in sensors:
            raise _damaged(file, f"{where} {verb} '{sensor}'; the sensors are {', '.join(sensors)}")


def _check_segments(name: str, joint: JointDefinition, analysis: Analysis, file: Path) -> None:
    """Refuse a joint of sensors on the arm that stand for no segment."""
    for sensor in (joint.proximal, joint.distal):
        if analysis.sensors[sensor].segment is None:
            raise _damaged(file, f"joints.{name} needs the segment of sensor '{sensor}'")


def _damaged(file: Path, what: str) -> SessionError:
    return SessionError(f"{file}: the analysis is damaged: {what}")
