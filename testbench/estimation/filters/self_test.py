"""The self-test of orientation filters: no frame, sign, order or unit can be wrong unseen."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from testbench.estimation.filters.base import OrientationFilter
from testbench.estimation.filters.diagnosis import diagnose
from testbench.estimation.filters.known_motions import Check, KnownMotion, judge, recordings


@dataclass(frozen=True)
class SelfTest:
    """What the self-test found of a filter.

    Attributes:
        filter: Its name.
        checks: In order.
        reason: Why it fails, in words; empty if it passes.
        known: Whether it is known to fail, because it repeats a publication with its errors.
    """

    filter: str
    checks: list[Check]
    reason: str
    known: bool

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        checks = [asdict(check) | {"passed": check.passed} for check in self.checks]
        return {
            "filter": self.filter,
            "passed": self.passed,
            "reason": self.reason,
            "known": self.known,
            "checks": checks,
        }


def output_fault(kind: OrientationFilter, case: KnownMotion) -> str:
    """What is wrong with the form of a filter's output; empty if nothing is."""
    given = [key for key in ("device_q", "intervals") if getattr(case.samples, key) is not None]
    before = [np.array(getattr(case.samples, key)) for key in ("gyr", "acc", "mag", *given)]
    try:
        q = kind.run(case.samples)
        after = [np.array(getattr(case.samples, key)) for key in ("gyr", "acc", "mag", *given)]
        again = kind.run(case.samples)
    except Exception as error:
        return f"it raises {error!r}"
    if any(not np.array_equal(old, new) for old, new in zip(before, after, strict=True)):
        return "it writes into the samples it is given"
    if not isinstance(q, np.ndarray) or q.shape != (len(case.samples), 4):
        shape = q.shape if isinstance(q, np.ndarray) else type(q).__name__
        return f"it gives {shape}; an array of shape ({len(case.samples)}, 4) is wanted"
    if not np.isfinite(q).all():
        return "it gives numbers that are not finite"
    if np.abs(np.linalg.norm(q, axis=1) - 1).max() > 1e-3:
        return "its quaternions have not unit length"
    if not np.array_equal(q, again):
        return "it gives something else when it is run again: it must not remember an earlier run"
    return ""


def self_test(kind: OrientationFilter) -> SelfTest:
    """Test a filter, and say what is wrong with it where that can be told.

    A device's orientation is given to a filter that needs it: right, in an earth of another
    heading.

    Args:
        kind: Any filter.
    """
    known = bool(kind.known_faults)
    groups = recordings(kind.needs)
    fault = output_fault(kind, groups["turn about +x"][1])
    if fault:
        return SelfTest(kind.name, [Check("output", None, 0.0, "any motion")], fault, known)
    checks = judge(kind.run, kind.needs, groups)
    if all(check.passed for check in checks):
        return SelfTest(kind.name, checks, "", known)
    return SelfTest(kind.name, checks, kind.known_faults or diagnose(kind, checks), known)
