"""A robot's log as it was read: joint angles, with times or without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from testbench.exceptions import InputError
from testbench.records.findings.finding import Finding


def _no_lines(message: str, _row: int) -> InputError:
    return InputError(message)


@dataclass(frozen=True)
class RobotLog:
    """Joint angles in the robot's order.

    Attributes:
        time_ns: From the first row, shape (n,), int64, or None for a list without times.
        q: Shape (n, n_joints) [rad].
        unix_ns: Unix time of the first row [ns], None where its times are none.
        findings: What was noticed of its times.
        time_stated: Whether its title or a person states the unit of its times.
        problem: The error that says a message of a row (from 0), with file and line.
    """

    time_ns: np.ndarray | None
    q: np.ndarray
    unix_ns: int | None = None
    findings: list[Finding] = field(default_factory=list)
    time_stated: bool = True
    problem: Callable[[str, int], InputError] = _no_lines
