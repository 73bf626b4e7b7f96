"""Further sessions of the same protocol, found in a folder and judged as this one was."""

from __future__ import annotations

from pathlib import Path

from testbench.evaluation import evaluate
from testbench.evaluation.repeatability import content_of, why_unequal
from testbench.evaluation.repeats import with_repeats
from testbench.exceptions import InputError, SessionError
from testbench.pipeline.kept_estimate import estimate_of
from testbench.pipeline.loaded_analysis import LoadedAnalysis
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import RepeatedSession
from testbench.records.session.parts import part_of
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import Session, damaged_sessions, list_sessions


def judged_with_repeats(
    session: Session, estimated: Estimate, evaluated: Evaluation, loaded: LoadedAnalysis
) -> Evaluation:
    """An evaluation with the sessions beside it that the request names; as it is if it names none.

    Nothing is written into the further sessions.

    Args:
        session: The recording.
        estimated: Of it.
        evaluated: Of that.
        loaded: The request for both.

    Raises:
        InputError: The folder is none, or holds no further session of this kind; says of each what
            is another.
    """
    if loaded.asked.repeats is None:
        return evaluated
    folder = Path(loaded.asked.repeats)
    if not folder.is_dir():
        raise InputError(f"--repeats {folder} is no folder")
    left: dict[str, str] = dict.fromkeys(damaged_sessions(folder), "it is damaged")
    taken: dict[str, Evaluation] = {}
    records = [_record(session)]
    known = {content_of(session): session.name}
    for other in list_sessions(folder):
        if other.path.resolve() == session.path.resolve():
            continue
        why = _why_changed(other) if loaded.asked.verify else ""
        why = why or why_unequal(session, other, known)
        own = None if why else estimate_of(other, loaded)
        if own is not None and own.filter_parameters != estimated.filter_parameters:
            why = "its filters, or their parameters, are others; run `testbench estimate` on both"
        if why or own is None:
            left[other.name] = why or "nothing can be estimated of it"
            continue
        known[content_of(other)] = other.name
        taken[other.name] = evaluate(other, own, loaded.settings(other))
        records.append(_record(other))
    if not taken:
        told = "; ".join(f"{name}: {why}" for name, why in left.items())
        raise InputError(
            f"--repeats {folder} holds no further session of this protocol"
            + (f" ({told})" if told else "")
        )
    found = with_repeats(evaluated, list(taken.values()), records)
    for name, why in left.items():
        found.findings.append(finding("repeats.left_out", session=name, why=why))
    parts = {record.part for record in records}
    part = parts.pop() if len(parts) == 1 else None
    if part is not None:
        found.findings.append(finding("repeats.one_part", part=part))
    return found


def _why_changed(other: Session) -> str:
    """Which of its raw files are not what was recorded; "" where all are."""
    try:
        open_for_analysis(other.path)
    except SessionError as error:
        return str(error)
    return ""


def _record(session: Session) -> RepeatedSession:
    recorded = session.manifest.recorded_utc or session.manifest.started_utc
    return RepeatedSession(session.name, part_of(session), recorded)
