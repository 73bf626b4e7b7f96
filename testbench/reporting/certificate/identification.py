"""What identifies a certificate's sensors and session: as they state it themselves, as the
laboratory states it, or blank.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.clock import utc_shown
from testbench.exceptions import InputError, NotFoundError
from testbench.records.results.certificate import Entry, Item
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.parts import part_of
from testbench.records.session.samples import TEMPERATURE
from testbench.records.session.session import Session
from testbench.records.specs.laboratory import Laboratory, Statement
from testbench.reporting.sections.run import duration, simulated_parts

BY_DEVICE = "as the device states it"
BY_LABORATORY = "as the laboratory states it; not read from the device"
IN_GENERAL = "as the laboratory states it for all its certificates"
TAGS = ("device_tag", "tag", "device_id", "address")
"""Keys of a sensor under which its maker's other marks stand."""


def items_of(session: Session, sensors: Sequence[str], stated: Statement) -> list[Item]:
    """The sensors that results are of.

    Args:
        session: The recording.
        sensors: Their names.
        stated: What is stated beside the session.

    Raises:
        NotFoundError: Something is stated of a sensor that results are not of.
        InputError: It contradicts what the device states, or names no sensor where there are
            several.
    """
    serial = _by_sensor(stated.serial_numbers, sensors, "--serial-number")
    firmware = _by_sensor(stated.firmwares, sensors, "--firmware")
    return [_item(session, name, serial.get(name), firmware.get(name)) for name in sensors]


def _item(session: Session, name: str, serial: str | None, firmware: str | None) -> Item:
    record = session.manifest.sensors[name]
    entries = [
        Entry(name="Kind", value=record.description or record.preset or record.driver),
        _identity(session, name, ("Serial number", "serial_number", "--serial-number"), serial),
        _identity(session, name, ("Firmware", "firmware", "--firmware"), firmware),
    ]
    tag = next((value for key in TAGS if (value := _stated(record, key))), None)
    if tag is not None:
        entries.append(Entry(name="Device tag", value=tag, remark=BY_DEVICE))
    if record.rate_hz is not None:
        entries.append(
            Entry(name="Rate", value=f"{record.rate_hz:.4g} Hz", remark="nominal, or as measured")
        )
    scale = record.full_scale
    if scale is not None and (scale.acc_m_s2 or scale.gyr_rad_s):
        ranges = [
            f"{value:.3g} {unit}"
            for value, unit in (
                (scale.acc_m_s2, "m/s²"),
                (scale.gyr_rad_s and float(np.degrees(scale.gyr_rad_s)), "deg/s"),
            )
            if value
        ]
        entries.append(Entry(name="Full scale", value=", ".join(ranges)))
    return Item(sensor=name, entries=entries)


def _identity(
    session: Session, sensor: str, what: tuple[str, str, str], given: str | None
) -> Entry:
    """A mark of a device: title, key of the manifest, and option by which it is stated."""
    title, key, option = what
    record = session.manifest.sensors[sensor]
    own = _stated(record, key)
    if own is not None and given not in (None, own):
        raise InputError(
            f"sensor {sensor} states the {title.lower()} {own}, and {option} {given} contradicts it"
        )
    if own is not None:
        return Entry(name=title, value=own, remark=BY_DEVICE)
    if record.simulated:
        if given is not None:
            raise InputError(f"sensor {sensor} is simulated, and has no {title.lower()}: {option}")
        part = part_of(session) or "simulated"
        return Entry(name=title, value=None, remark=f"a model has none: {part}")
    if given is not None:
        return Entry(name=title, value=given, remark=BY_LABORATORY)
    return Entry(name=title, value=None, remark=f"the session does not state it; {option} does")


def _stated(record: SensorRecord, key: str) -> str | None:
    """What a sensor's record says under a key that it may have."""
    value = getattr(record, key, None)
    return None if value in (None, "") else str(value)


def _by_sensor(given: Sequence[str], sensors: Sequence[str], option: str) -> dict[str, str]:
    """What `[SENSOR=]VALUE` says of each sensor."""
    found: dict[str, str] = {}
    for text in given:
        sensor, equals, value = text.rpartition("=")
        if not equals and len(sensors) > 1:
            raise InputError(f"{option} {text}: say of which sensor, as {sensors[0]}={text}")
        name = sensor.strip() if equals else sensors[0]
        if name not in sensors:
            raise NotFoundError("sensor of this certificate", name, list(sensors))
        if not value.strip() or name in found:
            raise InputError(f"{option} {text}: give it once a sensor, as [SENSOR=]VALUE")
        found[name] = value.strip()
    return found


def parties_of(laboratory: Laboratory, stated: Statement) -> list[Entry]:
    """Whom a certificate is for, who measured, and who authorises it."""
    operator = stated.operator or laboratory.operator
    return [
        _or_blank("Customer", stated.customer, "", "--customer states it"),
        _or_blank(
            "Operator",
            operator,
            "" if stated.operator else IN_GENERAL,
            "neither the session nor the laboratory states it; --operator does",
        ),
        _or_blank(
            "Authorised by",
            laboratory.authorised_by,
            "",
            "the laboratory file does not state it (authorised_by)",
        ),
    ]


def _or_blank(name: str, value: str | None, remark: str, blank: str) -> Entry:
    return Entry(name=name, value=value, remark=blank if value is None else remark)


def session_entries(session: Session, files: int, sealed: bool) -> list[Entry]:
    """The recording that results are of.

    Args:
        session: The recording.
        files: How many of its raw files were compared with their hashes.
        sealed: Whether somebody signed its manifest.
    """
    manifest, moment = session.manifest, session.recorded_at
    ended = session.status.value + (f": {manifest.message}" if manifest.message else "")
    seal = "there is one; by whom was not checked" if sealed else "none"
    software = ", ".join(f"{name} {own}" for name, own in manifest.software.items())
    entries = [
        Entry(name="Session", value=session.name),
        _or_blank(
            "Recorded",
            None if moment is None else utc_shown(moment),
            manifest.recorded_by or "",
            "the files that were imported do not say when",
        ),
        Entry(name="Protocol", value=manifest.protocol.name),
        Entry(name="Purpose", value=manifest.protocol.purpose),
        Entry(name="Arm", value=_arm(session)),
        Entry(name="Duration", value=duration(manifest.duration_s)),
        Entry(name="Ended", value=ended),
        Entry(name="SHA-256 of its manifest", value=session.fingerprint),
        Entry(name="SHA-256 of its plan", value=manifest.plan.hash),
        Entry(
            name="Raw files",
            value=f"{files}, each compared with the SHA-256 that the manifest states",
        ),
        Entry(name="Seal of its manifest", value=seal),
        Entry(name="Written with", value=software),
    ]
    return [own for own in entries if own.value or own.remark]


def _arm(session: Session) -> str | None:
    """The arm and where its motion comes from."""
    record, name = session.manifest.arm.record, session.manifest.robot.name
    return None if record is None else f"{name}: {record.provenance}"


def conditions_of(
    session: Session, sensors: Sequence[str], laboratory: Laboratory, stated: Statement
) -> list[Entry]:
    """Where and under which conditions a recording was made."""
    if simulated_parts(session):
        ambient = Entry(name="Ambient", value=None, remark="simulated: there was none")
        if stated.ambient is not None:
            raise InputError("--ambient states conditions of a session that is simulated")
    else:
        ambient = _or_blank(
            "Ambient",
            stated.ambient or laboratory.ambient,
            "" if stated.ambient else IN_GENERAL,
            "neither the session nor the laboratory states it; --ambient does",
        )
    return [ambient, *(_temperature(session, name) for name in sensors)]


def _temperature(session: Session, sensor: str) -> Entry:
    """How warm a part was, by itself."""
    title = f"Temperature of {sensor}"
    if TEMPERATURE in session.imu_columns(sensor):
        own = session.imu_column(sensor, TEMPERATURE)
        if np.isfinite(own).any():
            low, high = float(np.nanmin(own)), float(np.nanmax(own))
            shown = f"{low:.0f} °C" if round(low) == round(high) else f"{low:.0f} to {high:.0f} °C"
            return Entry(name=title, value=shown, remark="by its own thermometer, not calibrated")
    return Entry(name=title, value=None, remark="it was not recorded")
