"""The sessions of both sides of a comparison: opened, and found comparable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from testbench.evaluation.comparable import why_incomparable
from testbench.evaluation.repeatability import content_of
from testbench.exceptions import InputError, SessionError
from testbench.pipeline.request import CompareRequest
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import Session, list_sessions


@dataclass(frozen=True)
class _Opened:
    """Sessions of one side, and what was passed over.

    Attributes:
        sessions: That count, oldest first where they were found in a folder.
        named: Whether each was named by itself.
        left_out: Why others do not count, in sentences.
    """

    sessions: list[Session]
    named: list[bool]
    left_out: list[str]


def sides_of(asked: CompareRequest) -> tuple[list[Session], list[Session], list[str]]:
    """The sessions of both sides that can be compared, and why others are left out.

    Raises:
        InputError: One that was named cannot be compared, or a side has none that can.
    """
    if not asked.new:
        raise InputError("name one session at least to compare with the base")
    new = _opened(asked.new, asked.verify, set())
    base = _opened([asked.base], asked.verify, {own.path.resolve() for own in new.sessions})
    reference = _reference(base, new)
    taken = {content_of(session) for session in new.sessions}
    left_out = [*base.left_out, *new.left_out]
    sides = []
    for opened, place, others in ((base, asked.base, taken), (new, ", ".join(asked.new), set())):
        kept, why_not = _comparable(opened, reference, others)
        if not kept:
            told = " ".join([*why_not, *opened.left_out])
            raise InputError(
                f"{place} holds no session to compare with {reference.path}"
                + (f" ({told})" if told else "")
            )
        left_out += why_not
        sides.append(kept)
    return sides[0], sides[1], left_out


def _comparable(
    opened: _Opened, reference: Session, others: set[frozenset[str]]
) -> tuple[list[Session], list[str]]:
    """The sessions of a side that count, and why others do not, in sentences.

    Args:
        opened: Of the side.
        reference: That they are to be comparable to.
        others: What the other side holds; a copy of it in a folder does not count.

    Raises:
        InputError: One that was named cannot be compared.
    """
    kept, why_not = [], []
    known: set[frozenset[str]] = set()
    for session, named in zip(opened.sessions, opened.named, strict=True):
        why, content = why_incomparable(reference, session), content_of(session)
        if not why and content in known:
            why = "it holds the same samples as another one of this side"
        if not why and not named and content in others:
            why = "it holds the same samples as one of the other side"
        if why and named:
            raise InputError(f"{session.path} cannot be compared with {reference.path}: {why}")
        if why:
            why_not.append(f"{session.name} is left out: {why}.")
            continue
        known.add(content)
        kept.append(session)
    return kept, why_not


def _reference(base: _Opened, new: _Opened) -> Session:
    """The session that all others must be comparable to: one that was named, else the newest.

    Raises:
        InputError: There is none at all.
    """
    every = [
        *zip(base.sessions, base.named, strict=True),
        *zip(new.sessions, new.named, strict=True),
    ]
    named = [session for session, own in every if own]
    if not every:
        raise InputError(
            "there is no session to compare; " + " ".join([*base.left_out, *new.left_out])
        )
    return named[0] if named else every[-1][0]


def _opened(names: Sequence[str], verify: bool, taken: set[Path]) -> _Opened:
    """Sessions by their folders, or all below a folder that is none.

    Args:
        names: Of sessions and folders.
        verify: Whether raw files are compared with their hashes.
        taken: Sessions of the other side; a folder that holds them, too, is compared without them.

    Raises:
        InputError: A name is neither, or a session stands on both sides.
        SessionError: A session that was named is not what was recorded.
    """
    sessions: list[Session] = []
    named: list[bool] = []
    left_out: list[str] = []
    for name in names:
        path = Path(name)
        found = [] if _is_session(path) else list_sessions(path) if path.is_dir() else []
        if not found or _is_session(path):
            session = open_for_analysis(path, verify)
            if session.path.resolve() in taken:
                raise InputError(
                    f"{path} stands on both sides; filters within one session are compared by "
                    "`testbench evaluate`"
                )
            sessions.append(session)
            named.append(True)
            continue
        for other in found:
            if other.path.resolve() in taken:
                continue
            try:
                sessions.append(open_for_analysis(other.path, verify))
                named.append(False)
            except SessionError as error:
                left_out.append(f"{other.name} is left out: {error}.")
    return _Opened(sessions, named, left_out)


def _is_session(path: Path) -> bool:
    try:
        Session(path)
    except SessionError:
        return False
    return True
