"""Which sessions can be compared, and what is not the same in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from testbench.evaluation.paired_errors import Judged
from testbench.exceptions import InputError
from testbench.records.results.estimate import Estimate
from testbench.records.results.session_comparison import Differing
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.parts import part_of
from testbench.records.session.session import RunStatus, Session
from testbench.records.specs.protocol import Sensor

NOT_STATED = "not stated"


def why_incomparable(one: Session, other: Session) -> str:
    """Why two sessions cannot be compared; "" where they can.

    They must have recorded, or simulated, the same protocol step by step, with sensors and joints
    of the same names. Arm, sensors, filters, limits and dates may be others.
    """
    own, its = one.manifest, other.manifest
    if other.status is not RunStatus.COMPLETED:
        return f"its status is {other.status}"
    if own.kind != its.kind:
        return f"it is a session of another kind ({its.kind}, not {own.kind})"
    if one.simulated != other.simulated:
        return (
            f"it {_origin(other)}, and {one.name} {_origin(one)}: what is simulated says nothing "
            "of what is real"
        )
    if one.has_protocol and own.protocol.name != its.protocol.name:
        return f"its protocol is {its.protocol.name}, not {own.protocol.name}"
    if set(own.sensors) != set(its.sensors):
        return f"its sensors are {', '.join(sorted(its.sensors))}"
    if _joints(one) != _joints(other):
        return "its joints are defined otherwise"
    if _steps(one) != _steps(other):
        return "its steps are others"
    return ""


def _origin(session: Session) -> str:
    return f"has simulated {' and '.join(session.simulated)}" if session.simulated else "is real"


def _joints(session: Session) -> dict[str, Any]:
    return {name: joint.model_dump() for name, joint in session.analysis.joints.items()}


def _steps(session: Session) -> list[Any]:
    return [(step.section, step.role, step.kind, step.variables) for step in session.steps]


def differing(
    base: Sequence[tuple[Judged, Estimate]], new: Sequence[tuple[Judged, Estimate]]
) -> list[Differing]:
    """What is not the same on both sides.

    Args:
        base: Sessions of one side, with their estimates.
        new: Those of the other.
    """
    sides = [[_traits(one.session, estimate) for one, estimate in side] for side in (base, new)]
    found = []
    for what in dict.fromkeys(what for side in sides for traits in side for what in traits):
        values = [
            list(dict.fromkeys(traits.get(what, NOT_STATED) for traits in side)) for side in sides
        ]
        if set(values[0]) != set(values[1]):
            found.append(Differing(what, *values))
    return found


def _traits(session: Session, estimate: Estimate) -> dict[str, str]:
    """What a session is told apart from others by, each by its name for people."""
    manifest = session.manifest
    found = {"part": part_of(session) or NOT_STATED}
    for name, record in manifest.sensors.items():
        found |= _of_sensor(session, name, record)
    found["arm"] = ", ".join(filter(None, (manifest.robot.name, manifest.arm.driver))) or NOT_STATED
    for name, parameters in estimate.filter_parameters.items():
        found |= _flat({name: parameters})
    stored = [name for name, own in estimate.sensors.items() if own.stored_calibration is not None]
    settings = session.analysis.estimate
    found["calibration"] = f"stored, of {', '.join(stored)}" if stored else settings.calibrate
    found["alignment"] = settings.align
    environment = manifest.environment
    if environment is not None:
        field = " ".join(f"{value:.4g}" for value in environment.magnetic_field_uT)
        found["magnetic field"] = f"{field} uT, {len(environment.dipoles)} sources beside it"
    found |= {f"version of {name}": own for name, own in manifest.software.items()}
    found["date"] = (manifest.recorded_utc or manifest.started_utc or NOT_STATED)[:10]
    return found


def _of_sensor(session: Session, name: str, record: SensorRecord) -> dict[str, str]:
    """What a sensor is, what it runs, and where it sits."""
    told = record.description or record.preset or record.driver or NOT_STATED
    rate = "" if record.rate_hz is None else f", {record.rate_hz:.4g} Hz"
    firmware = (record.model_extra or {}).get("firmware")
    found = {f"sensor {name}": f"{told}{rate}"}
    found[f"firmware of {name}"] = NOT_STATED if firmware is None else str(firmware)
    placed = session.analysis.sensors.get(name)
    if placed is not None:
        mounted = _flat(placed.mounting.model_dump())
        found[f"mounting of {name}"] = f"{placed.link}, {', '.join(mounted.values())}"
        found |= _flat({name: _sheet(placed)})
    return found


def _sheet(placed: Sensor) -> Mapping[str, Any]:
    """The parameters that a sensor is simulated by; those of the protocol alone where its preset is
    not at hand, and none of a sensor that has no sheet.
    """
    try:
        return placed.imu().model_dump()
    except InputError:
        return placed.parameters


def _flat(values: Mapping[str, Any], before: str = "") -> dict[str, str]:
    """A tree of parameters by their whole names."""
    found: dict[str, str] = {}
    for key, value in values.items():
        name = f"{before}{key}"
        found |= _flat(value, f"{name}.") if isinstance(value, Mapping) else {name: str(value)}
    return found
