"""The section of the report on where its numbers come from, and how good the recording is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.session.manifest import CheckRecord
from testbench.records.session.sensor_file import SensorFile
from testbench.records.session.session import Session
from testbench.reporting.page.page import Block, Section
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    number,
)

SHOWN = {
    "schema_version",
    "session",
    "status",
    "started_utc",
    "clocks",
    "software",
    "sensors",
    "analysis",
    "kind",
    "seed",
    "protocol",
    "robot",
    "plan",
    "message",
    "duration_s",
    "files",
    "arm",
    "recorded_utc",
    "recorded_by",
    "environment",
}
"""Entries of the manifest that have a place of their own."""


def provenance_section(session: Session) -> Section:
    """Quality of the recording, and what would be needed to repeat it."""
    manifest = session.manifest
    blocks: list[Block] = [_quality(session)]
    if manifest.plan.check.joints:
        blocks.append(_joint_use(manifest.plan.check))
    status = "status of the bench" if session.has_protocol else "status"
    entries = [
        (status, session.status.value),
        ("kind", manifest.kind),
        ("seed", manifest.seed),
    ]
    entries += [("SHA-256 of the plan", manifest.plan.hash)]
    entries += [(f"version of {name}", version) for name, version in manifest.software.items()]
    entries += list(
        _scalars({key: value for key, value in manifest.content.items() if key not in SHOWN})
    )
    blocks.append(_pairs("Provenance", entries, f"How to read: {_repeatable(session)}.", False))
    files = list(manifest.files.items())
    if files:
        blocks.append(
            _pairs(
                "SHA-256 of the raw files",
                files,
                "How to read: a file whose hash differs was changed later.",
                True,
            )
        )
    return Section("provenance", "Quality and provenance", blocks)


def _repeatable(session: Session) -> str:
    """What gives the same raw files again."""
    if session.manifest.kind == "import":
        return (
            "the same files, options and versions give the same session; the files themselves are "
            "not in it"
        )
    if session.has_protocol and "arm" in session.simulated:
        return "the same plan, seed and versions give the same raw files, bit by bit"
    return (
        "what real devices measured cannot be measured again; the versions are of the software "
        "that wrote it down"
    )


@dataclass(frozen=True)
class _Counted:
    """What the raw samples of a sensor come to, looked at in pieces.

    Attributes:
        span_s: From the first to the last by the sensor's own clock [s].
        advance: By how much its counter went on.
        lost: How many numbers it left out.
        saturated: Samples at full scale.
    """

    span_s: float
    advance: int
    lost: int
    saturated: int

    @staticmethod
    def of(file: SensorFile) -> _Counted:
        """Those of a sensor."""
        advance = lost = saturated = 0
        ends, last = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        for columns in file.tables(columns=["counter", "device_time_ns", "saturated"]):
            steps = np.diff(np.concatenate([last, columns["counter"]]))
            on = steps[steps > 0]
            advance, lost = advance + int(on.sum()), lost + int((on - 1).sum())
            saturated += int(columns["saturated"].sum())
            times = columns["device_time_ns"]
            ends = np.concatenate([ends[:1], times[:1], times[-1:]])
            last = columns["counter"][-1:]
        span_s = float(ends[-1] - ends[0]) / NANOSECONDS if len(ends) else 0.0
        return _Counted(span_s, advance, lost, saturated)


def _quality(session: Session) -> Table:
    rows = []
    for name in session.sensor_names:
        n, counted = session.sample_count(name), _Counted.of(session.sensor(name))
        lost, span = counted.lost, counted.span_s
        rate = counted.advance / span if span > 0 else None
        rows.append(
            Row(
                [
                    label(name),
                    number(n, 0),
                    number(rate, 3),
                    number(lost, 0),
                    number(100 * lost / max(n + lost, 1), 2),
                    number(counted.saturated, 0),
                ]
            )
        )
    return Table(
        "Quality of the recording",
        header(
            "sensor",
            "samples",
            "rate by its own clock [Hz]",
            "samples lost",
            "lost [%]",
            "samples at full scale",
        ),
        rows,
        "How to read: lost samples are gaps of the sensor's counter; a sample at full scale is "
        "wrong in at least one axis.",
    )


def _joint_use(check: CheckRecord) -> Table:
    rows = [
        Row(
            [
                label(use.joint),
                number(use.lowest_deg, 1),
                number(use.highest_deg, 1),
                number(use.peak_speed_deg_s, 1),
                number(100 * use.peak_speed_deg_s / use.speed_limit_deg_s, 0),
                number(use.peak_acceleration_deg_s2, 0),
                number(100 * use.peak_acceleration_deg_s2 / use.acceleration_limit_deg_s2, 0),
            ]
        )
        for use in check.joints
    ]
    how = "How to read: as planned, before anything moved; 100 % is the limit in the robot file."
    near = check.clearance
    if near:
        how += (
            f" The smallest clearance was {digits(near.distance_mm, 1)} mm, between {near.first} "
            f"and {near.second} at {digits(near.time_s, 1)} s."
        )
    return Table(
        "What the plan asked of the arm",
        header(
            "joint",
            "lowest [deg]",
            "highest [deg]",
            "peak speed [deg/s]",
            "of limit [%]",
            "peak acceleration [deg/s²]",
            "of limit [%]",
        ),
        rows,
        how,
        folded=True,
    )


def _pairs(caption: str, entries: Iterable[tuple[str, Any]], how: str, folded: bool) -> Table:
    rows = [
        Row([label(name), Cell(str(value), kind="code")])
        for name, value in entries
        if value not in (None, "")
    ]
    return Table(caption, [Cell("entry"), Cell("value")], rows, how, folded=folded)


def _scalars(data: dict[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    for key, value in data.items():
        if isinstance(value, dict):
            yield from _scalars(value, f"{prefix}{key}.")
        elif not isinstance(value, list):
            yield f"{prefix}{key}", value
