"""Gait: strides, events and the path of each sensor, in memory and on disk."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter, with_config

from testbench.records.disk.json_file import write_json
from testbench.records.disk.json_record import AS_WRITTEN, Number, read_record
from testbench.records.disk.replacing import replaced_folder, stored
from testbench.records.disk.tables import read_parquet, write_parquet
from testbench.records.findings.finding import Finding
from testbench.records.session.layout import GAIT, GAIT_SUMMARY, table_file, walk_table
from testbench.records.session.session_lock import session_lock

SCHEMA_VERSION = 1
NAN = float("nan")

Place = Literal["foot", "shank", "wrist", "chest"]
PLACES: tuple[Place, ...] = ("foot", "shank", "wrist", "chest")


@dataclass(frozen=True, kw_only=True)
class Stride:
    """One stride of the leg, or one gait cycle where no foot was measured.

    Attributes:
        begin_s: When the foot stood before it, time since the start of the session; of a cycle, its
            beginning.
        end_s: When it stood after it.
        tc_s: Terminal contact: the foot leaves the ground.
        ic_s: Initial contact: it comes down.
        stride_time_s: From the initial contact before to this one.
        swing_s: From terminal to initial contact.
        length_m: On the ground, from stand to stand.
        length_sd_m: Its standard uncertainty.
        rise_m: How much higher the foot stands after it.
        clearance_m: How far the sensor rises above the line from stand to stand.
        turn_deg: By how much the foot turns about the vertical, anticlockwise.
        x_m: Where it ends, counted from the start of the path along its heading there.
        y_m: And to the left of its heading there.
        z_m: And above it.
        turning: Whether it turns by more than a straight stride does.
        counted: Whether it is in the means.
        left_out: Why it is not; "" where it is.
    """

    begin_s: Number
    end_s: Number
    tc_s: Number = NAN
    ic_s: Number = NAN
    stride_time_s: Number = NAN
    swing_s: Number = NAN
    length_m: Number = NAN
    length_sd_m: Number = NAN
    rise_m: Number = NAN
    clearance_m: Number = NAN
    turn_deg: Number = NAN
    x_m: Number = NAN
    y_m: Number = NAN
    z_m: Number = NAN
    turning: bool = False
    counted: bool = True
    left_out: str = ""


STRIDE_COLUMNS = tuple(entry.name for entry in fields(Stride))


@dataclass(frozen=True, kw_only=True)
class GaitRow:
    """A quantity over the strides that count.

    Attributes:
        quantity: Its name, with the unit.
        count: Of strides.
        mean: Over them.
        sd: From stride to stride.
        least: The smallest.
        most: The largest.
    """

    quantity: str
    count: int
    mean: Number
    sd: Number
    least: Number
    most: Number


@dataclass(frozen=True, kw_only=True)
class SensorGait:
    """What one sensor says of a walk: its entry in gait.json.

    Attributes:
        sensor: Its name.
        on: Where it sits; "" where that cannot be known.
        known_by: "told", "name" or "motion".
        side: "left", "right" or "" where its name does not say.
        method: "strapdown", "regression", or "" where nothing could be had.
        parameters: Of the regression, a name of `PUBLISHED`.
        mounting: How it is worn, for the regression.
        filter: Whose orientation the regression took.
        floor: "level" where all stands were taken for equally high, else "any".
        strides: In order.
        rows: Means over those that count.
        distance_m: Length of the path, the sum of the strides.
        cadence_steps_min: Steps of both feet a minute, while walking.
        stance_percent: Part of the stride that the foot is on the ground.
        closure_mm: How far the end of the path lies from its start.
        closure_horizontal_mm: Likewise on the ground.
        closure_sd_mm: Standard uncertainty of the end against the start, the root of the sum of the
            variances of x, y and z.
        path_heading_deg: By how much its path was turned to fit the corners that were typed.
        innovation: Mean normalised innovation squared of the zero velocities [1].
        findings: What was noticed.
    """

    sensor: str
    on: str = ""
    known_by: str = ""
    side: str = ""
    method: str = ""
    parameters: str = ""
    mounting: str = ""
    filter: str = ""
    floor: str = ""
    strides: list[Stride] = field(default_factory=list)
    rows: list[GaitRow] = field(default_factory=list)
    distance_m: Number = NAN
    cadence_steps_min: Number = NAN
    stance_percent: Number = NAN
    closure_mm: Number = NAN
    closure_horizontal_mm: Number = NAN
    closure_sd_mm: Number = NAN
    path_heading_deg: Number = NAN
    innovation: Number = NAN
    findings: list[Finding] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class SymmetryRow:
    """A quantity of two feet.

    Attributes:
        quantity: Its name, with the unit.
        left: Mean of the left foot.
        right: Mean of the right foot.
        difference_percent: Left less right, by the mean of both (Robinson et al. 1987).
    """

    quantity: str
    left: Number
    right: Number
    difference_percent: Number


@dataclass(frozen=True, kw_only=True)
class GaitCheck:
    """A quantity against what a person counted or measured.

    Attributes:
        sensor: Whose.
        quantity: Its name, with the unit.
        value: Estimated.
        truth: As typed.
        error: Estimated less true; of a distance from the path of the corners, that distance.
        error_percent: By the truth; NaN where that says nothing.
    """

    sensor: str
    quantity: str
    value: Number
    truth: Number
    error: Number
    error_percent: Number = NAN


@dataclass(frozen=True, kw_only=True)
class Gait:
    """The gait of a session.

    Attributes:
        session: Its name.
        fingerprint: Of the recording it was made from.
        sensors: By name.
        symmetry: Of a left and a right foot.
        checks: Against what a person typed.
        corners_m: Of the path that was walked, as typed.
        findings: On the whole.
        walks: Signals of each sensor by name: `time_s`, position `x_m`, `y_m`, `z_m`, and what the
            events were found in; each of shape (n,).
    """

    session: str
    fingerprint: str
    sensors: dict[str, SensorGait]
    symmetry: list[SymmetryRow] = field(default_factory=list)
    checks: list[GaitCheck] = field(default_factory=list)
    corners_m: list[tuple[float, float]] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    walks: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)

    def all_findings(self) -> list[Finding]:
        """Of the whole and of each sensor."""
        return [*self.findings, *(f for own in self.sensors.values() for f in own.findings)]

    def summary(self) -> dict[str, Any]:
        """All but the signals, for JSON."""
        return {entry.name: getattr(self, entry.name) for entry in fields(_GaitHead)}

    def save(self, session_folder: Path) -> None:
        """Write the folder `gait` of a session, in place of an earlier one."""
        target = session_folder / GAIT
        with session_lock(session_folder), stored(target), replaced_folder(target) as folder:
            for name, columns in self.walks.items():
                content = {"content": "where a sensor went, and what its gait events were found in"}
                write_parquet(folder / table_file(walk_table(name)), columns, content)
            kept = {"schema_version": SCHEMA_VERSION} | self.summary()
            write_json(folder / GAIT_SUMMARY, kept | {"walks": list(self.walks)})

    @staticmethod
    def lies_in(session_folder: Path) -> bool:
        """Whether a session has one."""
        return (session_folder / GAIT / GAIT_SUMMARY).is_file()

    @staticmethod
    def load(session_folder: Path) -> Gait:
        """Read the folder `gait` of a session.

        Raises:
            SessionError: It is missing or damaged.
        """
        folder = session_folder / GAIT
        with session_lock(session_folder):
            head = read_record(
                folder / GAIT_SUMMARY, _as_written(), SCHEMA_VERSION, "run `testbench gait` again"
            )
            walks = {
                name: read_parquet(folder / table_file(walk_table(name))) for name in head.walks
            }
        own = {entry.name: getattr(head, entry.name) for entry in fields(_GaitHead)}
        return Gait(**own, walks=walks)


@dataclass(frozen=True, kw_only=True)
class _GaitHead:
    """What a gait and its summary share."""

    session: str
    fingerprint: str
    sensors: dict[str, SensorGait]
    symmetry: list[SymmetryRow]
    checks: list[GaitCheck]
    corners_m: list[tuple[float, float]]
    findings: list[Finding]


@with_config(AS_WRITTEN)
@dataclass(frozen=True, kw_only=True)
class _GaitSummary(_GaitHead):
    """The content of gait.json."""

    walks: list[str]


@cache
def _as_written() -> TypeAdapter[_GaitSummary]:
    return TypeAdapter(_GaitSummary)
