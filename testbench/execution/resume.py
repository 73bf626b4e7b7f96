"""Go on with a session whose run broke off: what is missing, and what has changed since."""

from __future__ import annotations

import difflib
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from testbench.exceptions import InputError, SessionError
from testbench.execution.recovery import recover
from testbench.records.session.layout import INCLUDED, MANIFEST, PROTOCOL, ROBOT, URDF
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.raw_files import Memory, check_raw_files, refuse_changed
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import deciding_versions, software_versions
from testbench.records.specs.robot import Robot, load_robot, robot_from_text

MOST_LINES = 20
"""Lines of a difference that are shown."""


def open_for_resume(path: Path) -> Session:
    """A session that can be gone on with: recovered if it was cut off.

    Raises:
        SessionError: It is no run, was completed, is still being recorded, or what it recorded was
            changed since.
    """
    session = Session(path)
    if session.manifest.kind != "run":
        raise SessionError(f"{path} is no run of a protocol; only those can be resumed")
    if session.status is RunStatus.COMPLETED:
        raise SessionError(f"{path} was completed; there is nothing to resume")
    session = recover(session)
    checked = check_raw_files(session, Memory.of(session))
    recorded = {
        name: what
        for name, what in checked.problems.items()
        if name not in {PROTOCOL, ROBOT, URDF} and not name.startswith(INCLUDED)
    }  # of the texts `differences` tells what is another
    refuse_changed(session, replace(checked, problems=recorded), remedy="")
    return session


def refuse_other_robot(session: Session, robot: str | Path | None) -> None:
    """Refuse to go on with another arm than the one that began.

    Args:
        session: To go on with.
        robot: As named today; None if none was.

    Raises:
        InputError: It is another arm, or its file differs.
    """
    if robot is None:
        return
    given, kept = load_robot(robot), stored_robot(session)
    if given.name != kept.name:
        raise InputError(
            f"{session.path} was begun on {kept.name}, and cannot be resumed on {given.name}"
        )
    if given.text != kept.text:
        raise InputError(
            f"{session.path} cannot be resumed: the robot file "
            f"differs:\n{_difference(kept.text, given.text)}"
        )


def is_own_copy(session: Session, protocol: str | Path) -> bool:
    """Whether a protocol's file is the one that the session keeps."""
    return Path(protocol).resolve() == (session.path / PROTOCOL).resolve()


def refuse_edited_protocol(session: Session, plan: Plan) -> str:
    """Refuse to go on by the session's protocol, without a word, where its file was edited since.

    Args:
        session: To go on with.
        plan: Made from the session's own copies.

    Returns:
        By which protocol the session goes on, for people.

    Raises:
        InputError: Lists what differs, and says how to go on all the same.
    """
    note, origin = (
        "resuming by the protocol that the session keeps",
        session.manifest.protocol_path,
    )
    if origin is None or "\0" in origin or not Path(origin).is_file():
        return note
    found = []
    for name, text in plan.protocol.texts().items():
        file = Path(origin).parent / name
        if file.is_file():
            today = file.read_text(encoding="utf-8", errors="replace")
            found += (
                [f"{file} was edited since:\n{_difference(text, today)}"] if today != text else []
            )
    if found:
        copy = session.path / PROTOCOL
        found.append(
            f"to go on by the protocol that the session keeps, name it: --resume {session.path} "
            f"{copy}"
        )
        raise InputError(f"{session.path} cannot be resumed: " + "\n".join(found))
    return f"{note}; {origin} is still the same"


@contextmanager
def stored_protocol(session: Session) -> Iterator[Path]:
    """The protocol of a session with those it includes, as files, while the context lasts.

    They stand under their own names.
    """
    name = _protocol_name(session)
    with TemporaryDirectory(prefix="testbench-") as folder:
        shutil.copy(session.path / PROTOCOL, Path(folder) / name)
        for included in session.path.glob(f"{INCLUDED}*"):
            shutil.copy(included, Path(folder) / included.name.removeprefix(INCLUDED))
        yield Path(folder) / name


def _protocol_name(session: Session) -> str:
    """What the protocol's file was called."""
    file = session.manifest.protocol.file
    if file is None:
        raise SessionError(
            f"{session.path / MANIFEST} is damaged: it does not say what the protocol's file is "
            "called"
        )
    return Path(file).name


def stored_robot(session: Session) -> Robot:
    """The arm of a session, from its own copies.

    Raises:
        SessionError: They are missing.
    """
    robot = session.robot
    if robot is None:
        raise SessionError(f"{session.path} has no robot.yaml")
    return robot_from_text(session.path / ROBOT, robot.urdf)


def differences(session: Session, plan: Plan, sensors: Mapping[str, SensorRecord]) -> list[str]:
    """What is not as it was when the session began, with the lines that differ; empty if nothing.

    Args:
        session: To go on with.
        plan: Made anew, with today's software.
        sensors: Today's.
    """
    found: list[str] = []
    own, named = (
        _protocol_name(session),
        plan.protocol.document.file.name,
    )
    stored = {named: session.path / PROTOCOL}
    stored |= {file.name.removeprefix(INCLUDED): file for file in session.path.glob(f"{INCLUDED}*")}
    for name, text in plan.protocol.texts().items():
        before = stored[name].read_text(encoding="utf-8") if name in stored else ""
        if before != text:
            found.append(f"the protocol's file {name} differs:\n{_difference(before, text)}")
    if named != own:
        found.append(f"the protocol's file is called {named}, that of the session {own}")
    robot = (session.path / ROBOT).read_text(encoding="utf-8")
    today = _todays_robot(session) or plan.robot
    if robot != today.text:
        found.append(f"the robot file differs:\n{_difference(robot, today.text)}")
    if (session.path / URDF).read_text(encoding="utf-8") != plan.robot.urdf.read_text(
        encoding="utf-8"
    ):
        found.append("the robot's URDF differs")
    known = session.manifest.sensors
    for name in sorted(set(known) | set(sensors)):
        was, now = (each[name].identity() if name in each else None for each in (known, sensors))
        if was != now:
            found.append(f"sensor {name} differs: {was} before, {now} now")
    software = session.manifest.software
    changed = {
        key: (software.get(key), value)
        for key, value in deciding_versions(software_versions()).items()
        if software.get(key) != value
    }
    found += [
        f"software {key}: {before} before, {now} now"
        for key, (before, now) in sorted(changed.items())
    ]
    if not found and plan.hash != session.manifest.plan.hash:
        found.append("the plan made from the same files is another one")
    return found


def refuse_differences(session: Session, plan: Plan, sensors: Mapping[str, SensorRecord]) -> None:
    """Refuse to go on with another bench than the one that began.

    Raises:
        InputError: Lists what differs.
    """
    found = differences(session, plan, sensors)
    if found:
        raise InputError(f"{session.path} cannot be resumed: " + "\n".join(found))


def _todays_robot(session: Session) -> Robot | None:
    """The robot as it is today, from the file it was read from, or of that name where no file is
    stated; None if there is none.

    An arm's own file may bear the name of one that ships with the bench: the name alone would find
    the wrong one.
    """
    named = session.manifest.robot
    if not named.file and not named.name:
        return None
    try:
        return load_robot(Path(named.file) if named.file else str(named.name))
    except InputError:
        return None


def _difference(before: str, after: str) -> str:
    lines = list(
        difflib.unified_diff(
            before.splitlines(), after.splitlines(), "session", "now", lineterm="", n=0
        )
    )
    return "\n".join(lines[:MOST_LINES] + (["..."] if len(lines) > MOST_LINES else []))


def missing_steps(session: Session, plan: Plan) -> list[PlannedStep]:
    """Steps to do on a real arm, from the first one without complete data on.

    Before them, again, those that give the sensors their references.

    A break loses the sensors' headings and perhaps their clocks, so reference and calibration steps
    are done once more.
    """
    done = {step.index for step in session.steps}
    first = next((step.index for step in plan.steps if step.index not in done), len(plan.steps))
    again = [step for step in plan.steps if step.index < first and step.role != "evaluation"]
    return again + [step for step in plan.steps if step.index >= first]
