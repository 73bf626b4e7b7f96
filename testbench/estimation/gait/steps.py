"""Steps: from the initial contact of one foot to that of the other, where both carry sensors.

The step of a foot ends with its own contact; double support begins there, and lasts until the other
foot leaves the ground (Perry & Burnfield, Gait Analysis, 2nd ed., 2010, chapter 1).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from testbench.estimation.gait.strides import (
    DOUBLE_SUPPORT,
    LONGEST_STRIDE_S,
    STEP_TIME,
    row_of,
)
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.gait import SensorGait

NOT_SHARED = {
    "clock.own",
    "clock.power_up",
    "clock.seconds",
    "clock.unsynced",
    "clock.stations",
    "clock.apart",
}
"""Findings by which the sensors of an import are not on one clock."""
ALTERNATING = 0.7
"""Part of the contacts that come after one of the other foot, at least [1]: turns break the row."""
SIDES = ("left", "right")


@dataclass(frozen=True)
class _Contact:
    """An initial contact of one foot.

    Attributes:
        time_s: When.
        side: Of which foot.
        leaves_s: When that foot leaves the ground next; infinite where it does not.
        counted: Whether the stride that it ends is in the means.
    """

    time_s: float
    side: str
    leaves_s: float
    counted: bool


def with_steps(
    sensors: Mapping[str, SensorGait], noted: Iterable[Finding]
) -> tuple[dict[str, SensorGait], list[Finding]]:
    """Sensors with the times of steps among their means, and what is to be said of both feet.

    Args:
        sensors: By name.
        noted: What was noticed when they were recorded or imported.
    """
    found = dict(sensors)
    feet = {
        side: [own for own in sensors.values() if own.side == side and own.on == "foot"]
        for side in SIDES
    }
    if any(len(own) != 1 or not _contacts(own[0]) for own in feet.values()):
        return found, []
    if NOT_SHARED & {own.code for own in noted}:
        return found, [finding("gait.no_common_clock", "gait")]
    contacts = [contact for own in feet.values() for contact in _contacts(own[0])]
    contacts.sort(key=lambda contact: contact.time_s)
    pairs = [
        (first, second)
        for first, second in pairwise(contacts)
        if second.time_s - first.time_s < LONGEST_STRIDE_S
    ]
    other = [pair for pair in pairs if pair[0].side != pair[1].side]
    if len(other) < ALTERNATING * len(pairs) or not other:
        percent = 100 * len(other) / max(len(pairs), 1)
        return found, [finding("gait.not_alternating", "gait", share_percent=percent)]
    counted = [pair for pair in other if pair[0].counted and pair[1].counted]
    for side, (own,) in feet.items():
        steps = [b.time_s - a.time_s for a, b in counted if b.side == side]
        # the other foot, which came down before, leaves after this one has come down
        both = [a.leaves_s - b.time_s for a, b in counted if b.side == side]
        rows = [
            row_of(quantity, np.array(values))
            for quantity, values in (
                (STEP_TIME, steps),
                (DOUBLE_SUPPORT, [value for value in both if np.isfinite(value)]),
            )
            if values
        ]
        found[own.sensor] = replace(own, rows=[*own.rows, *rows])
    return found, []


def _contacts(own: SensorGait) -> list[_Contact]:
    """The initial contacts of a foot, in order."""
    known = [stride for stride in own.strides if np.isfinite(stride.ic_s)]
    leaves = [stride.tc_s for stride in known[1:]] + [float("inf")]
    return [
        _Contact(stride.ic_s, own.side, then, stride.counted)
        for stride, then in zip(known, leaves, strict=True)
    ]
