"""What of a protocol lies in the session that another one goes on from."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.parquet as pq

from testbench.records.layout import PLAN
from testbench.records.session import Session

MOST_NAMES = 12
"""Steps that are named; of more the number is said."""


@dataclass(frozen=True)
class EarlierSteps:
    """Steps of the plan that are to be judged and that a resuming session was not to do again.

    Attributes:
        session: The one it goes on from, which has them.
        names: Of the steps, in the order of the plan.
        planned: How many steps of the plan are to be judged.
    """

    session: str
    names: list[str]
    planned: int

    @property
    def sentence(self) -> str:
        """For people."""
        if not self.names:
            return (
                f"goes on from session {self.session}, and has all {self.planned} judged steps "
                "itself"
            )
        more = len(self.names) - MOST_NAMES
        listed = "; ".join(self.names[:MOST_NAMES]) + (f"; and {more} more" if more > 0 else "")
        return (
            f"goes on from session {self.session}: {len(self.names)} of {self.planned} judged "
            "steps lie there and are not in "
            f"these results ({listed}); read both reports beside each other"
        )


def earlier_steps(session: Session) -> EarlierSteps | None:
    """What another session has of this one's plan; None where it goes on from none, or its plan
    cannot be read.
    """
    resumes = session.manifest.get("resumes")
    wanted = resumes.get("steps") if isinstance(resumes, dict) else None
    if not isinstance(resumes, dict) or not isinstance(wanted, list):
        return None
    try:
        notes = pq.read_schema(session.path / PLAN).metadata or {}
        steps = [
            (int(step["index"]), str(step["role"]), str(step["name"]))
            for step in json.loads(notes[b"steps"])
        ]
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError):
        return None
    judged = (
        [step for step in steps if step[1] == "evaluation"]
        or [step for step in steps if step[1] != "calibration"]
        or steps
    )
    names = [name for index, _, name in judged if index not in wanted]
    return EarlierSteps(str(resumes.get("session")), names, len(judged))
