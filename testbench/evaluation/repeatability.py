"""Equal sessions: what others of the same protocol came to."""

from __future__ import annotations

from collections.abc import Mapping
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
        known = {content_of(session): session.name}
        for other in list_sessions(session.path.parent / Path(folder)):
            same = other.path.resolve() == session.path.resolve()
            if same or why_unequal(session, other, known):
                continue
            with suppress(SessionError):  # damaged, or not evaluated
                metrics = Evaluation.load(other.path).metrics
                known[content_of(other)] = other.name
                for metric in metrics:
                    if metric.value is not None and np.isfinite(metric.value):
                        values.setdefault(key_of(metric), []).append(metric.value)
        return EqualSessions(values)


def content_of(session: Session) -> frozenset[str]:
    """The hashes of what was recorded, by which a copy is known."""
    return frozenset(session.manifest.files.values())


def why_unequal(session: Session, other: Session, known: Mapping[frozenset[str], str]) -> str:
    """Why another session is no repetition of this one; "" where it is one.

    Both must share protocol, robot, steps and analysis, but neither the limits nor the
    specimens of the sensors.

    Args:
        session: That is judged.
        other: Of the folder.
        known: Names of the sessions that count already, by their content.
    """
    own, its = session.manifest, other.manifest
    if other.status is not RunStatus.COMPLETED:
        return f"its status is {other.status}"
    if own.kind != its.kind:
        return f"it is a session of another kind ({its.kind})"
    if own.protocol.name != its.protocol.name:
        return f"its protocol is {its.protocol.name}"
    if set(own.sensors) != set(its.sensors):
        return f"its sensors are {', '.join(sorted(its.sensors))}"
    try:
        differs = _what_it_did(session) != _what_it_did(other)
    except SessionError as error:
        return f"it is damaged: {error}"
    if differs:
        return "its robot, its steps or its analysis are others"
    name = known.get(content_of(other))
    return "" if name is None else f"it holds the same samples as {name}"


def _what_it_did(session: Session) -> Any:
    sensors = {
        name: sensor.model_copy(update={"part": None})
        for name, sensor in session.analysis.sensors.items()
    }
    analysis = session.analysis.model_copy(update={"accept": [], "sensors": sensors})
    steps = [(step.section, step.name, step.kind, step.variables) for step in session.steps]
    return session.manifest.robot.name, analysis, steps
