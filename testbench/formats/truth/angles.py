"""Truth of joints: angles over time that another system computed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.recording import ImportedAngles, Recording
from testbench.formats.truth.angle_names import Chosen
from testbench.formats.truth.angle_table import AngleTable, AngleUnit, plain_title
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.manifest import JointTruthRecord
from testbench.records.session.samples import TrueAngles
from testbench.records.specs.anatomy import JointKind, kind_of, side_of

FARTHEST_RAD = 4 * np.pi
"""No joint of a body turns so far: such numbers are degrees [rad]."""
LEAST_ROWS = 10
"""An angle with fewer known rows is none."""


def give_angles(
    recording: Recording,
    table: AngleTable,
    chosen: Iterable[Chosen],
    answered: AngleUnit | None,
    record: JointTruthRecord,
) -> None:
    """Give joints the columns of a table as their true angles.

    Args:
        recording: Whose joints; is changed.
        table: The truth, its times on the host's clock as far as they are known.
        chosen: Which column is which angle.
        answered: Unit of the angles that a person stated.
        record: What is known of the truth's time.

    Raises:
        InputError: The unit is not known or cannot be; says how to state it.
    """
    by_joint: dict[str, list[Chosen]] = {}
    for own in chosen:
        by_joint.setdefault(own.joint, []).append(own)
    columns = [own for columns in by_joint.values() for own in columns]
    units = _units(table, columns, answered, recording.findings)
    fresh = np.diff(table.time_ns, prepend=table.time_ns[:1] - 1) > 0
    for name, columns in by_joint.items():
        angles = np.full((len(table.time_ns), 3), np.nan)
        for own in columns:
            angles[:, own.place] = own.sign * _radians(own, table.values(own.column), units)
        where, told = f"joint '{name}'", [str(own) for own in columns]
        recording.findings.append(
            finding("truth.angles", where, system=table.system, rows=len(angles), columns=told)
        )
        if recording.analysis.body is not None:
            ends = recording.analysis.body.joints[name]
            recording.findings += _of_both_sides(where, name, ends.proximal, ends.distal, columns)
            recording.findings += _named_otherwise(where, kind_of(name, ends), columns)
        recording.findings += _lost(where, columns, table.time_ns, angles)
        true = TrueAngles(table.time_ns[fresh], angles[fresh])
        source = f"{table.system}: {', '.join(told)}"
        own_record = record.model_copy(update={"truth": source})
        recording.angles[name] = ImportedAngles(true, own_record)
    recording.findings += table.findings


def _of_both_sides(
    where: str, joint: str, proximal: str, distal: str, columns: list[Chosen]
) -> list[Finding]:
    """What is to be said where names tell of the left and of the right: walking legs turn alike,
    half a stride apart, which may be taken for a clock.
    """
    names = dict.fromkeys([joint, proximal, distal, *(own.column for own in columns)])
    left = [name for name in names if side_of(name) == "left"]
    right = [name for name in names if side_of(name) == "right"]
    return [finding("truth.both_sides", where, left=left, right=right)] if left and right else []


def _named_otherwise(where: str, kind: JointKind | None, columns: list[Chosen]) -> list[Finding]:
    """Columns that are called after another joint than the one they are given to."""
    said = []
    for own in columns:
        called = kind_of(plain_title(own.column))
        if kind is not None and called not in (kind, None):
            values = {"column": own.column, "called": called, "kind": kind}
            said.append(finding("truth.named_otherwise", where, **values))
    return said


def _units(
    table: AngleTable,
    chosen: list[Chosen],
    answered: AngleUnit | None,
    findings: list[Finding],
) -> dict[str, AngleUnit]:
    """The unit of each column: as answered, else as the file states it, else by the size of all.

    Args:
        table: The truth.
        chosen: The columns.
        answered: Unit that a person stated.
        findings: What was noticed; is added to.

    Raises:
        InputError: It is open.
    """
    stated = {own.column: answered or table.unit_of(own.column) for own in chosen}
    unstated = [column for column, unit in stated.items() if unit is None]
    if unstated:
        largest = max(_largest(table.values(column)) for column in unstated)
        if largest <= FARTHEST_RAD:
            raise InputError(
                f"is the truth {', '.join(unstated)} in degrees or radians (the largest is "
                f"{largest:.4g})? Answer with --joint-unit deg|rad, or with `unit` of "
                "`truth_angles` in the mapping"
            )
        findings.append(finding("truth.joint_degrees", largest=largest))
    return {column: unit or "deg" for column, unit in stated.items()}


def _radians(own: Chosen, values: np.ndarray, units: dict[str, AngleUnit]) -> np.ndarray:
    """A column in radians, if it can be an angle of a joint.

    Args:
        own: The column.
        values: As in the file, shape (n,).
        units: By column.

    Raises:
        InputError: It cannot.
    """
    known, largest, unit = int(np.isfinite(values).sum()), _largest(values), units[own.column]
    if known < LEAST_ROWS:
        raise InputError(f"the truth {own} has {known} known rows; {LEAST_ROWS} are needed")
    factor = 1.0 if unit == "rad" else np.pi / 180
    if largest * factor <= FARTHEST_RAD:
        return np.asarray(values * factor)
    told = "; if they are degrees, state --joint-unit deg" if unit == "rad" else ""
    raise InputError(
        f"the truth {own} goes up to {largest:.4g} {unit}, and no joint of a body turns so far"
        f"{told}"
    )


def _largest(values: np.ndarray) -> float:
    """Largest magnitude of what is known."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _lost(
    where: str, columns: list[Chosen], time_ns: np.ndarray, angles: np.ndarray
) -> list[Finding]:
    """Where the angles of a joint are not all known."""
    known = np.isfinite(angles[:, [own.place for own in columns]]).all(axis=1)
    lost = int(np.sum(~known))
    if not lost:
        return []
    longest = float(np.diff(time_ns[known]).max(initial=0)) / NANOSECONDS
    return [finding("truth.angles_lost", where, lost=lost, rows=len(known), longest_s=longest)]
