"""Recover a session whose run was cut off by a kill or a power cut: keep every whole batch, and say
what is missing.
"""

from __future__ import annotations

from pathlib import Path

from testbench.exceptions import SessionError
from testbench.execution.truth import write_truth
from testbench.frames import NANOSECONDS
from testbench.records.layout import ARM, JOURNALS, MANIFEST, sensor_of, table_file
from testbench.records.replacing import clear_partials, stored
from testbench.records.samples import ArmSamples, ImuSamples
from testbench.records.session import Event, RunStatus, Session
from testbench.records.session_lock import session_locked
from testbench.records.session_writer import file_hashes, note_end
from testbench.records.storage import Journal, compact, last_value

SMALLEST_JOURNAL = 64
"""A journal of fewer bytes was cut off before its schema was whole; it held nothing."""


@session_locked
def recover(session: Session) -> Session:
    """Make a cut-off session readable; one that was closed is returned as it is.

    Raises:
        SessionError: It is still being recorded, or the arm's journal is lost, so that there is no
            truth.
        StorageError: The disk does not take it; nothing of the recording is lost.
    """
    if session.status is not RunStatus.RUNNING:
        return session
    if session.is_being_recorded:
        raise SessionError(f"{session.path} is still being recorded; stop that run first")
    comfort = (
        f"nothing of the recording is lost; make room, then `testbench recover {session.path}`"
    )
    with stored(session.path, comfort):
        return _recovered(session)


def _recovered(session: Session) -> Session:
    """Turn what was recorded into tables, and close the session."""
    if session.manifest.kind == "recording":
        from testbench.execution.device_recorder import recover_recording

        return recover_recording(session)
    path = session.path
    for journal in sorted(path.glob(JOURNALS)):
        if (
            journal.stat().st_size < SMALLEST_JOURNAL
            and not journal.with_suffix(".parquet").is_file()
        ):
            _write_empty(session, journal)  # cut off before its first row
        compact(journal, journal.with_suffix(".parquet"))
    clear_partials(path)
    session = Session(path)
    if not (path / table_file(ARM)).is_file() or session.robot is None:
        raise SessionError(
            f"{path}: the arm's recording is lost; what the sensors recorded is in imu_*.parquet"
        )
    write_truth(path, session.robot, session.analysis.sensors)
    duration = float(last_value(path / table_file(ARM), "host_time_ns") or 0) / NANOSECONDS
    planned = session.manifest.plan.check.duration_s
    if planned is None:
        raise SessionError(f"{path / MANIFEST} is damaged: it does not say how long the plan is")
    message = f"cut off after {duration:.1f} of {planned:.1f} s and recovered"
    note_end(session, Event(round(duration * NANOSECONDS), "run_aborted", {"message": message}))
    session.manifest.changed(
        status=RunStatus.ABORTED, message=message, duration_s=duration, files=file_hashes(path)
    ).write(path)
    return Session(path)


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
