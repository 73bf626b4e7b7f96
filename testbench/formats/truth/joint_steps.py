"""Steps of a joint log that no arm makes: whole turns of a wrapped angle, and rows of no reading.

A joint's angle that a log gives within half a turn steps by a whole one where it goes on: that is
no motion. A step faster than a joint turns is none of the arm either: a reader that has lost its
controller writes zeros or what it last held, and one row may be damaged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.truth.joint_log import RobotLog
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.specs.robot import Robot

MOST_TURNED = 1e6
"""No joint turns further [rad]."""
SLACK = 3.0
"""A joint that steps so many times faster than its highest rate did not: stamps jitter, and a rate
that a person wrote into a robot file may be lower than the arm's."""
LEAST_STEP = np.radians(0.5)
"""Steps below are of noise and rounding [rad]."""
MOST_LEFT_OUT = 0.2
"""If more than this part of the rows would be left out, it is not rows that are at fault."""
MANY = 0.01
"""Part of the rows that jump beyond which no row of its own is to blame."""
TURN = 2 * np.pi


def mended(log: RobotLog, robot: Robot) -> RobotLog:
    """A log with its whole turns undone, and without rows that no arm reaches.

    Args:
        log: With times; one without is left as it is.
        robot: Whose joints it is of.

    Raises:
        InputError: An angle cannot be one, or so much of it is impossible that something else is
            wrong; names the line where it has one.
    """
    most = np.abs(log.q).max(axis=1, initial=0.0)
    if not most.max(initial=0.0) <= MOST_TURNED:
        raise log.problem(
            f"the joint log holds an angle of {most.max():.3g} rad, which no joint turns to: its "
            "file is damaged, or the column is none of angles",
            int(np.argmax(most)),
        )
    if log.time_ns is None or len(log.q) < 2:
        return log
    time = log.time_ns / NANOSECONDS
    usual = float(np.median(np.diff(time)))
    allowed = _Allowed(robot.velocity_limits, usual)
    kept = _kept(time, log.q, allowed)
    lost = np.flatnonzero(~kept)
    ends = log.q[[0, -1]][~kept[[0, -1]]]  # no row beyond them tells on which side the fault is
    if len(lost) > MOST_LEFT_OUT * len(kept) or ends.any():
        raise _impossible(log, robot, allowed)
    findings = list(log.findings)
    if len(lost):
        first = time[lost[0]] - time[0]
        findings.append(
            finding("truth.impossible_rows", count=len(lost), first_s=float(first), rows=len(kept))
        )
    q, turns = _unwrapped(time[kept], log.q[kept], allowed)
    if turns:
        findings.append(finding("truth.whole_turns", count=turns))
    return replace(log, time_ns=log.time_ns[kept], q=q, findings=findings)


class _Allowed:
    """How far joints can have turned in a time.

    Args:
        rates: Highest of each joint, shape (k,) [rad/s].
        usual: Time between two rows, below which stamps are believed to jitter [s].
    """

    def __init__(self, rates: np.ndarray, usual: float):
        self._rates, self._usual = rates, usual

    def step(self, dt: np.ndarray | float, slack: float = SLACK) -> np.ndarray:
        """Shape (..., k) [rad]."""
        time = np.maximum(np.asarray(dt, float), self._usual)[..., None]
        return np.maximum(slack * self._rates * time, LEAST_STEP)


def without_turns(step: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Steps less the whole turns in them, where they are larger than a joint can make.

    Args:
        step: Of each joint, shape (..., k) [rad].
        allowed: How far it can have turned, same shape [rad].

    Returns:
        Same shape [rad].
    """
    return np.where(np.abs(step) > allowed, step - TURN * np.round(step / TURN), step)


def fast_rows(log: RobotLog, robot: Robot, q: np.ndarray) -> np.ndarray:
    """Whether each row after the first is further from the one before than an arm turns.

    Args:
        log: With times.
        robot: Whose joints it is of.
        q: Its angles, shape (n, k) [rad].

    Returns:
        Shape (n - 1,), bool.
    """
    assert log.time_ns is not None
    dt = np.diff(log.time_ns) / NANOSECONDS
    allowed = _Allowed(robot.velocity_limits, float(np.median(dt))).step(dt)
    return np.any(np.abs(without_turns(np.diff(q, axis=0), allowed)) > allowed, axis=1)


def _kept(time: np.ndarray, q: np.ndarray, allowed: _Allowed) -> np.ndarray:
    """Rows that the arm can have been at, by the longest piece of the log without a jump."""
    dt, raw = np.diff(time), np.diff(q, axis=0)
    may = allowed.step(dt)
    jumps = np.any(np.abs(without_turns(raw, may)) > may, axis=1)
    zero = np.asarray(~q.any(axis=1))
    border = np.flatnonzero(zero[1:] != zero[:-1])
    strict = allowed.step(dt[border], 1.0)
    jumps[border] |= np.any(np.abs(without_turns(raw[border], strict)) > strict, axis=1)
    kept = np.ones(len(q), dtype=bool)
    if not jumps.any():
        return kept
    edges = np.concatenate([[0], np.flatnonzero(jumps) + 1, [len(q)]])
    pieces = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    lengths = [0 if zero[a:b].all() else b - a for a, b in pieces]
    longest = int(np.argmax(lengths))
    for order in (range(longest + 1, len(pieces)), range(longest - 1, -1, -1)):
        ahead = order.step > 0
        last = pieces[longest][1] - 1 if ahead else pieces[longest][0]
        for i in order:
            first, end = pieces[i]
            near, far = (first, end - 1) if ahead else (end - 1, first)
            may = allowed.step(abs(time[near] - time[last]))
            off = np.abs(without_turns(q[near] - q[last], may)) > may
            kept[first:end] = not off.any() and not zero[first:end].all()
            last = far if kept[first] else last
    return kept


def _unwrapped(time: np.ndarray, q: np.ndarray, allowed: _Allowed) -> tuple[np.ndarray, int]:
    """Angles that go on where they stepped by whole turns, and how often they did."""
    step = np.diff(q, axis=0)
    turns = np.round((without_turns(step, allowed.step(np.diff(time))) - step) / TURN)
    if not turns.any():
        return q, 0
    whole = np.vstack([np.zeros(q.shape[1]), np.cumsum(turns, axis=0)])
    return q + TURN * whole, int(np.any(turns != 0, axis=1).sum())


def _impossible(log: RobotLog, robot: Robot, allowed: _Allowed) -> InputError:
    assert log.time_ns is not None
    dt = np.diff(log.time_ns) / NANOSECONDS
    may = allowed.step(dt)
    step = np.abs(without_turns(np.diff(log.q, axis=0), may))
    row, joint = np.unravel_index(int(np.argmax(step / may)), step.shape)
    rate = float(np.degrees(step[row, joint] / max(dt[row], 1e-9)))
    most = float(np.degrees(robot.velocity_limits[joint]))
    many = np.any(step > may, axis=1).mean() > MANY
    why = (
        "and so it is in many rows: the unit of the angles (--joint-unit deg|rad), that of the "
        "times (--truth-time-unit), or the arm (--robot) is another"
        if many
        else "and goes on from there: leave the rows out that hold no readings, or cut the log"
    )
    return log.problem(
        f"{robot.joint_names[joint]} turns by {np.degrees(step[row, joint]):.4g} deg from the row "
        f"before, at {rate:.4g} deg/s, where {robot.name} turns it at {most:.4g} at most, {why}",
        int(row) + 1,
    )
