"""Recover a session whose recording was cut off by a kill or a power cut.

Every whole batch is kept, and what is missing is said.
"""

from __future__ import annotations

from pathlib import Path

from testbench.exceptions import SessionError
from testbench.execution.truth import write_truth
from testbench.frames import NANOSECONDS
from testbench.records.disk.journal import Journal, compact
from testbench.records.disk.replacing import clear_partials, stored
from testbench.records.disk.tables import last_value
from testbench.records.session.layout import (
    ARM,
    JOURNALS,
    MANIFEST,
    imu_stream,
    sensor_of,
    table_file,
)
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event, RunStatus, Session
from testbench.records.session.session_lock import session_locked
from testbench.records.session.session_writer import file_hashes, note_end

SMALLEST_JOURNAL = 64
"""A journal of fewer bytes was cut off before its schema was whole; it held nothing."""


@session_locked
def recover(session: Session) -> Session:
    """Make a cut-off session readable; one that was closed is returned as it is.

    It may be of a run or of devices alone.

    Raises:
        SessionError: It is still being recorded, is an import, whose files still exist, or the
            arm's journal is lost, so that there is no truth.
        StorageError: The disk does not take it; nothing of the recording is lost.
    """
    if session.status is not RunStatus.RUNNING:
        return session
    if session.is_being_recorded:
        raise SessionError(f"{session.path} is still being recorded; stop that run first")
    if session.manifest.kind == "import":
        raise SessionError(session.what_to_do_cut_off)
    comfort = (
        f"nothing of the recording is lost; make room, then `testbench recover {session.path}`"
    )
    with stored(session.path, comfort):
        return _recovered(session)


def _recovered(session: Session) -> Session:
    """Turn what was recorded into tables, and close the session."""
    path = session.path
    for journal in sorted(path.glob(JOURNALS)):
        table = path / table_file(journal.stem)
        if journal.stat().st_size < SMALLEST_JOURNAL and not table.is_file():
            _write_empty(session, journal)  # cut off before its first row
        compact(journal, table)
    clear_partials(path)
    session = Session(path)
    kind, planned = "recording", ""
    if session.manifest.kind == kind:
        last_ns = max(_last_ns(session, imu_stream(name)) for name in session.sensor_names)
    else:
        _add_truth(session)
        last_ns = _last_ns(session, ARM)
        kind, planned = "run", f" of {_planned_s(session):.1f}"
    duration = last_ns / NANOSECONDS
    message = f"cut off after {duration:.1f}{planned} s and recovered"
    if last_ns == 0 and kind == "run":
        # Time 0 is when the arm stands at its start: of the way there nothing is recorded.
        message = (
            f"cut off before the arm stood at its start, and recovered; none{planned} s are there"
        )
    note_end(session, Event(last_ns, f"{kind}_aborted", {"message": message}))
    session.manifest.changed(
        status=RunStatus.ABORTED, message=message, duration_s=duration, files=file_hashes(path)
    ).write(path)
    return Session(path)


def _add_truth(session: Session) -> None:
    """Write the truth that follows from the arm's recording."""
    if not (session.path / table_file(ARM)).is_file() or session.robot is None:
        raise SessionError(
            f"{session.path}: the arm's recording is lost; what the sensors recorded is in "
            f"{table_file(imu_stream('*'))}"
        )
    write_truth(session.path, session.robot, session.analysis.sensors)


def _planned_s(session: Session) -> float:
    """How long the run was to last [s]."""
    duration = session.manifest.plan.check.duration_s
    if duration is None:
        raise SessionError(
            f"{session.path / MANIFEST} is damaged: it does not say how long the plan is"
        )
    return duration


def _last_ns(session: Session, stream: str) -> int:
    """When the last sample was taken, or arrived [ns]; 0 if there is none."""
    return int(last_value(session.path / table_file(stream), "host_time_ns") or 0)


def _write_empty(session: Session, journal: Path) -> None:
    """Write a journal anew that was cut off before its schema was whole."""
    name = journal.stem
    if name == ARM and session.robot is not None:
        columns = ArmSamples.columns(session.robot.joint_names)
    elif (sensor := session.manifest.sensors.get(sensor_of(name) or "")) is not None:
        columns = ImuSamples.columns(sensor.magnetometer, sensor.orientation, sensor.temperature)
    else:
        return
    journal.unlink()
    Journal(journal, columns).close()
