"""Follow a session that another process writes: what was recorded since the last look."""

from __future__ import annotations

import fcntl
from dataclasses import dataclass, field, replace
from pathlib import Path

from testbench.records.disk.journal_tail import JournalTail
from testbench.records.session.layout import ARM, EVENTS, imu_stream, journal_file, table_file
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import Event, Session, event_of


@dataclass(frozen=True)
class News:
    """What came since the last look.

    Attributes:
        arm: What the arm reported, None if nothing.
        imus: What each sensor delivered, by name; those without news are left out.
        events: What happened.
    """

    arm: ArmSamples | None = None
    imus: dict[str, ImuSamples] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    def __bool__(self) -> bool:
        return self.arm is not None or bool(self.imus or self.events)


class SessionTail:
    """What is appended to a session's streams, in turn; of one that is over, all of it.

    Args:
        session: Of any status. Its folder is read, and nothing in it is touched.
    """

    def __init__(self, session: Session):
        self.session, folder = session, session.path
        self._joints = [] if session.robot is None else session.robot.joint_names
        self._events_at = 0
        self._early: list[Event] = []

        def tail(stream: str) -> JournalTail:
            return JournalTail(folder / journal_file(stream), folder / table_file(stream))

        self._arm = tail(ARM) if self._joints else None
        self._imus = {name: tail(imu_stream(name)) for name in session.sensor_names}
        self._arm_ns, self._imu_ns = -1, dict.fromkeys(self._imus, -1)
        self._sensors_go_on = False

    @property
    def is_over(self) -> bool:
        """Whether nobody writes it any more: no living process holds its list of events."""
        try:
            with (self.session.path / EVENTS).open("rb") as events:
                fcntl.flock(events, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:  # it was removed
            return True
        return True

    def read(self) -> News:
        """What is new, at most a few megabytes of each stream.

        Of a backlog neither the arm nor a sensor is read far ahead of the others, for they are
        compared with one another.
        """
        arm = self._read_arm()
        imus = {}
        for name, stream in self._imus.items():
            if arm is not None and self._imu_ns[name] > self._arm_ns:
                continue
            columns = stream.read()
            if columns is not None and len(columns["host_time_ns"]):
                imus[name] = ImuSamples.from_columns(columns)
                self._imu_ns[name] = int(columns["host_time_ns"][-1])
        self._sensors_go_on = bool(imus)
        arm = self._read_arm() if arm is None and not imus else arm
        return News(arm, imus, self._events(arm is not None or bool(imus)))

    def _events(self, more: bool) -> list[Event]:
        """Events that are new; of a backlog those up to what was read of the streams.

        Args:
            more: Whether something was read of them.
        """
        self._early += self._read_events(self.session.path / EVENTS)
        until = max(self._arm_ns, *self._imu_ns.values()) if self._imu_ns else self._arm_ns
        told, self._early = self._early, []
        if more:
            self._early = [event for event in told if event.host_time_ns > until]
            told = [event for event in told if event.host_time_ns <= until]
        return told

    def _read_arm(self) -> ArmSamples | None:
        """What the arm reported, with what else it says; None while sensors have to catch up."""
        behind = self._sensors_go_on and self._arm_ns > min(self._imu_ns.values(), default=0)
        columns = None if self._arm is None or behind else self._arm.read()
        if columns is None or not len(columns["host_time_ns"]):
            return None
        self._arm_ns = int(columns["host_time_ns"][-1])
        own = ArmSamples.columns(self._joints)
        extras = {name: values for name, values in columns.items() if name not in own}
        return replace(ArmSamples.from_columns(columns, self._joints), extras=extras)

    def _read_events(self, file: Path) -> list[Event]:
        """Whole lines behind those that were read."""
        try:
            with file.open("rb") as source:
                source.seek(self._events_at)
                data = source.read()
        except FileNotFoundError:
            return []
        whole = data[: data.rfind(b"\n") + 1]
        self._events_at += len(whole)
        lines = whole.decode("utf-8", errors="replace").splitlines()
        return [event for line in lines if (event := event_of(line)) is not None]

    def close(self) -> None:
        """Let go of the files."""
        for stream in [self._arm, *self._imus.values()]:
            if stream is not None:
                stream.close()
