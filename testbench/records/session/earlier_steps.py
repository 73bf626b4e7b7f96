"""What of a protocol a session lacks, and what of it lies in the session that it goes on from."""

from __future__ import annotations

from dataclasses import dataclass

from testbench.exceptions import SessionError
from testbench.records.session.layout import PLAN
from testbench.records.session.plan import judged_steps, stored_steps
from testbench.records.session.session import Session

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
                f"goes on from session {self.session}, and has all {self.planned} evaluated steps "
                "itself"
            )
        more = len(self.names) - MOST_NAMES
        listed = "; ".join(self.names[:MOST_NAMES]) + (f"; and {more} more" if more > 0 else "")
        return (
            f"goes on from session {self.session}: {len(self.names)} of {self.planned} evaluated "
            "steps lie there and are not in "
            f"these results ({listed}); read both reports beside each other"
        )


def earlier_steps(session: Session) -> EarlierSteps | None:
    """What another session has of this one's plan.

    None where it goes on from none, or its plan cannot be read.
    """
    resumes = session.manifest.resumes
    if resumes is None or resumes.steps is None:
        return None
    try:
        judged = judged_steps(stored_steps(session.path / PLAN))
    except SessionError:
        return None
    names = [step.name for step in judged if step.index not in resumes.steps]
    return EarlierSteps(resumes.session, names, len(judged))


def unfinished_steps(session: Session) -> list[int]:
    """Indices of the planned steps that were not finished; none where nothing was planned."""
    planned = session.manifest.plan.check.steps or 0
    resumes = session.manifest.resumes
    wanted = None if resumes is None else resumes.steps
    left_out = set() if wanted is None else set(range(planned)) - set(wanted)
    done = {step.index for step in session.steps} | left_out
    return [index for index in range(planned) if index not in done]
