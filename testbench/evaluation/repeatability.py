"""Equal sessions: what others of the same protocol came to."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import SessionError
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.session.manifest import RunStatus
from testbench.records.session.session import Session, list_sessions

Key = tuple[str, str | None, str | None, str | None]


def key_of(metric: Metric) -> Key:
    """What makes two metrics the same one."""
    return metric.name, metric.filter, metric.sequence, metric.section


@dataclass(frozen=True)
class EqualSessions:
    """The metrics of sessions that did the same.

    Attributes:
        values: Of each metric, in every session that has it.
    """

    values: dict[Key, list[float]]

    @staticmethod
    def beside(session: Session, folder: str) -> EqualSessions:
        """The completed and evaluated sessions of the same protocol in a folder, but this one.

        Args:
            session: That is judged.
            folder: From the folder in which it lies.
        """
        values: dict[Key, list[float]] = {}
        wanted = _what_it_did(session)
        for other in list_sessions(session.path.parent / Path(folder)):
            if other.path.resolve() == session.path.resolve():
                continue
            with suppress(SessionError):  # damaged, or not evaluated
                if other.status is not RunStatus.COMPLETED or _what_it_did(other) != wanted:
                    continue
                for metric in Evaluation.load(other.path).metrics:
                    if metric.value is not None and np.isfinite(metric.value):
                        values.setdefault(key_of(metric), []).append(metric.value)
        return EqualSessions(values)


def _what_it_did(session: Session) -> Any:
    """What two sessions must share to be equal: protocol, robot, steps and analysis, but not the
    limits.
    """
    analysis = session.analysis.model_copy(update={"accept": []})
    steps = [(step.section, step.name, step.kind, step.variables) for step in session.steps]
    return session.manifest.protocol.name, session.manifest.robot.name, analysis, steps
