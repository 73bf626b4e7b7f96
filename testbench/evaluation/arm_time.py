"""Whether the arm's recording can be believed in time: no motion before its command, and few
samples that did not come.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from testbench.evaluation.judged import SETTLING_NS
from testbench.frames import NANOSECONDS
from testbench.model.truth import WIDEST_GAP_NS
from testbench.records.disk.tables import read_parquet_batches
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.layout import ARM, table_file
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Session

DEPARTED_RAD = float(np.radians(0.05))
"""The arm has left a pose when a joint is so far away [rad]: beyond the noise of encoders and a
settled pose may be off. A motion that begins gently gets there 60 ms late; that much of a lead is
not seen here, but by the driver, from the references.
"""
LEAD_NS = 5_000_000
"""A motion that precedes its command by more is told [ns]; the clocks are matched to less."""
FOLLOWING_NS = 20_000_000
"""A step that begins later after the one before may have a way of its own between them [ns]."""
MISSED_SHARE = 0.01
"""A larger share of the controller's samples that did not come is told."""
UNSURE_S = 0.002
"""Arm times that may be off by more are doubtful [s]: at 131 deg/s, the speed of quick protocols,
that is 0.26 deg.
"""
DOUBTS = frozenset(f"arm_time.{kind}" for kind in ("early", "missed", "step", "doubtful", "unsure"))
"""Codes of findings after which no session passes: when the arm was where is not sure enough."""


def arm_findings(session: Session) -> list[Finding]:
    """What must be known of the arm's recording.

    None where the bench did not record an arm.
    """
    if (
        session.robot is None
        or not session.has_protocol
        or not (session.path / table_file(ARM)).is_file()
    ):
        return []
    arm = session.manifest.arm.record
    if arm is None or arm.simulated:  # a model and its commands have one clock; no sample is missed
        return []
    leads, steps, count, gap_ns = _look(session, arm.commanded)
    found = _clock_findings(session)
    early = [lead for lead in leads if lead > LEAD_NS]
    if early:
        lead = max(early) / NANOSECONDS
        found.append(finding("arm_time.early", lead_s=lead, early=len(early), steps=steps))
    unsure = session.manifest.arm.timing.clock_unsure_s
    if unsure > UNSURE_S:
        found.append(finding("arm_time.unsure", unsure_ms=1e3 * unsure, sure_ms=1e3 * UNSURE_S))
    missed = session.manifest.arm.timing.samples_missed
    if missed > MISSED_SHARE * (missed + count) or (missed and gap_ns > WIDEST_GAP_NS):
        found.append(
            finding(
                "arm_time.missed",
                missed=missed,
                share_percent=100 * missed / (missed + count),
                gap_s=gap_ns / NANOSECONDS,
                widest_s=WIDEST_GAP_NS / NANOSECONDS,
            )
        )
    return found


def _clock_findings(session: Session) -> list[Finding]:
    """What the driver found of the clocks while it recorded."""
    found = []
    for event in session.events:
        at = event.host_time_ns / NANOSECONDS
        by, lead = event.details.get("by_s"), event.details.get("lead_s")
        if event.event == "arm_time_step" and isinstance(by, int | float):
            found.append(finding("arm_time.step", by_s=abs(by), at_s=at))
        elif event.event == "arm_time_doubtful" and isinstance(lead, int | float):
            found.append(finding("arm_time.doubtful", lead_s=lead, at_s=at))
    return found


def _look(session: Session, commanded: bool) -> tuple[list[int], int, int, int]:
    """Go through the arm's recording once, in pieces.

    Args:
        session: The recording.
        commanded: Whether the arm was told to move; the steps of a log are found by its motion, so
            that this cannot precede them.

    Returns:
        By how much motions precede their commands [ns]; how many steps that could be seen of;
        number of samples; longest gap between them [ns].
    """
    waits = _waits(session) if commanded else []
    assert session.robot is not None
    columns = [f"q_measured_{joint}_rad" for joint in session.robot.joint_names]
    rest: dict[int, np.ndarray] = {}
    departed: dict[int, int] = {}
    count, gap, last = 0, 0, np.zeros(0, dtype=np.int64)
    for piece in read_parquet_batches(session.path / table_file(ARM), ["host_time_ns", *columns]):
        times = piece["host_time_ns"]
        q = np.column_stack([piece[column] for column in columns])
        gap = max(gap, int(np.diff(np.concatenate([last, times])).max(initial=0)))
        count, last = count + len(times), times[-1:]
        for k, (begin, end) in enumerate(waits):
            rows = slice(np.searchsorted(times, begin), np.searchsorted(times, end))
            if rows.start >= rows.stop or k in departed:
                continue
            away = np.abs(q[rows] - rest.setdefault(k, q[rows.start])).max(axis=1) > DEPARTED_RAD
            if away.any():
                departed[k] = end - int(times[rows.start + int(away.argmax())])
    return list(departed.values()), len(waits), count, gap


def _waits(session: Session) -> list[tuple[int, int]]:
    """From when to when the arm rests before a commanded motion [ns]."""
    steps: list[PlannedStep] = sorted(session.steps, key=lambda step: step.start_ns)
    waits = []
    for before, step in pairwise(steps):
        begin = before.settled_ns + SETTLING_NS
        if (
            step.settled_ns > step.start_ns >= begin
            and step.start_ns - before.end_ns < FOLLOWING_NS
        ):
            waits.append((begin, step.start_ns))
    return waits
