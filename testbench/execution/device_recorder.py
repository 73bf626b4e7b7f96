"""Record devices alone: no arm, no plan, no truth; a session that estimate and evaluate read like
any other.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.clock import Clock, SystemClock, utc_name
from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.bluetooth import SCAN_S, BluetoothLoop
from testbench.drivers.imus.line_format import load_line_format
from testbench.drivers.imus.serial_line import SerialImu, list_serial_ports
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_sync import synchronise
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import BenchError, DriverError, InputError, RunInterrupted, SessionError
from testbench.execution.interruption import on_interrupt
from testbench.frames import NANOSECONDS
from testbench.records.protocol import Analysis, Estimation
from testbench.records.replacing import clear_partials, free_folder
from testbench.records.samples import IMU_NOTES, ImuSamples
from testbench.records.session import MANIFEST, Event, RunStatus, Session
from testbench.records.session_lock import session_locked
from testbench.records.session_writer import SessionWriter, file_hashes, note_end
from testbench.records.storage import compact, read_parquet, write_json
from testbench.records.strict import NAME_PATTERN

CHUNK_NS = NANOSECONDS // 4
"""Samples are taken from the devices this often [ns]."""
RATE_TOLERANCE = 0.05
"""A device whose rate differs from its nominal one by more is worth a note."""

Progress = Callable[[float, dict[str, int]], None]
"""Called about once a second with the time [s] and the number of samples of each device."""


@dataclass
class Devices:
    """The devices of a recording.

    Attributes:
        imus: By name.
        time: Their common time.
        bluetooth: The loop of those that need one.
        synchronise: Brings the clocks of connected devices together, which may take a quarter of a
            minute; None where each keeps its own.
    """

    imus: dict[str, Imu]
    time: SessionTime
    bluetooth: BluetoothLoop | None = None
    synchronise: Callable[[], None] | None = None

    def kickoff(self) -> None:
        """Connect all, then start all, so that the first does not wait long for the last."""
        for imu in self.imus.values():
            imu.connect()
        if self.synchronise is not None:
            self.synchronise()
        self.time.start()
        for imu in self.imus.values():
            imu.kickoff()

    def listen(self) -> None:
        """Make sure that devices deliver samples whose connection alone does not show it, and let
        go of them again.

        Raises:
            DriverError: A port cannot be opened, or a board delivers no sample that fits its
                format; says what came instead.
        """
        trials = {
            name: trial for name, imu in self.imus.items() if (trial := imu.trial()) is not None
        }
        try:
            for trial in trials.values():
                trial.kickoff()
            for name, trial in trials.items():
                trial.wait_for_sample(name)
        finally:
            for trial in trials.values():
                trial.stop()

    def stop(self) -> None:
        """Stop all; a failure of one must not keep the others going."""
        for imu in self.imus.values():
            with suppress(BenchError):
                imu.stop()

    def close(self) -> None:
        """Stop all and release Bluetooth; a second call does nothing."""
        self.stop()
        if self.bluetooth is not None:
            self.bluetooth.close()


def open_devices(
    serial: list[str],
    dots: list[str],
    clock: Clock,
    payload: str = "custom_mode_5",
    dot_rate: int = 60,
    bluetooth: BluetoothLoop | None = None,
    synchronise_dots: bool = False,
    time: SessionTime | None = None,
) -> Devices:
    """Make devices from what a person wrote; nothing is connected yet.

    Args:
        serial: Each `[NAME=]PORT:FORMAT`, the format a YAML file or the name of one that ships.
        dots: Each `[NAME=]ADDRESS`, or an advertised name.
        clock: Of the session.
        payload: Mode and rate of the DOTs [Hz].
        dot_rate: Mode and rate of the DOTs [Hz].
        bluetooth: The loop to use; a new one if None.
        synchronise_dots: Bring the DOTs' clocks together before they start.
        time: Of the session; a new one if None.

    Raises:
        InputError: Nothing to record, a malformed device, two of one name, or fewer than two DOTs
            to synchronise.
        DriverError: An extra is missing.
    """
    if not serial and not dots:
        raise InputError(
            "nothing to record: name a device with --serial PORT:FORMAT or --dot ADDRESS"
        )
    if synchronise_dots and len(dots) < 2:
        raise InputError(
            "--dot-sync brings the clocks of several DOTs together; there "
            f"{'is one' if dots else 'are none'}"
        )
    time = time or SessionTime(clock)
    imus: dict[str, Imu] = {}
    together: list[XsensDot] = []

    def add(name: str, imu: Imu) -> None:
        if name in imus:
            raise InputError(f"two devices are called '{name}'; name them apart with NAME=...")
        imus[name] = imu

    for number, text in enumerate(serial, 1):
        name, rest = _split_name(text)
        port, _, line_format = rest.rpartition(":")
        if not port or not line_format:
            raise InputError(
                f"--serial {text}: must be PORT:FORMAT, such as /dev/ttyACM0:mpu6050 or "
                "/dev/ttyACM0:board.yaml"
            )
        add(name or f"serial{number}", SerialImu(port, load_line_format(line_format), time))
    if dots:
        bluetooth = bluetooth or BluetoothLoop()
        try:
            for text in dots:
                name, target = _split_name(text)
                if not target:
                    raise InputError(f"--dot {text}: must be an address or an advertised name")
                together.append(XsensDot(target, time, bluetooth, payload, dot_rate))
                add(name or f"dot_{re.sub('[^A-Za-z0-9]', '', target)}"[:64], together[-1])
        except BaseException:
            bluetooth.close()
            raise
    common = (lambda: synchronise(together)) if synchronise_dots else None
    return Devices(imus, time, bluetooth, common)


def _split_name(text: str) -> tuple[str, str]:
    """`NAME=rest` in two; no name where what stands before the sign is none."""
    name, sign, rest = text.partition("=")
    return (name, rest) if sign and re.fullmatch(NAME_PATTERN, name) else ("", text)


def scan_devices(
    duration_s: float = SCAN_S, bluetooth: BluetoothLoop | None = None
) -> dict[str, list[Any]]:
    """What could be recorded: `serial` ports, `dots` that can be heard, and `notes` on what could
    not be searched.
    """
    found: dict[str, list[Any]] = {"serial": [], "dots": [], "notes": []}
    try:
        found["serial"] = list_serial_ports()
    except DriverError as error:
        found["notes"].append(str(error))
    try:
        loop = bluetooth or BluetoothLoop()
        try:
            found["dots"] = loop.scan(duration_s)
        finally:
            loop.close()
    except DriverError as error:
        found["notes"].append(str(error))
    return found


def record_devices(
    devices: Devices,
    logs: str | Path = "logs",
    duration_s: float | None = None,
    name: str = "recording",
    clock: Clock | None = None,
    progress: Progress | None = None,
) -> Session:
    """Record devices into a session; Ctrl-C ends it.

    Args:
        devices: To record; they are released in every case.
        logs: Folder that sessions are made in.
        duration_s: Length [s]; None records until Ctrl-C, which then is the normal end.
        name: Of the recording.
        clock: Source of the date; that of the machine if None.
        progress: Called about once a second.

    Raises:
        InputError: The name cannot stand in a file name, or the duration is not positive.
        DriverError: A device cannot be opened (nothing is written then), failed, or no device gave
            a sample.
        RunInterrupted: Ctrl-C before the duration was over; the session is kept and closed as
            interrupted.
    """
    clock = clock or SystemClock()
    try:
        if not re.fullmatch(NAME_PATTERN, name):
            raise InputError(
                f"'{name}' is no name for a recording: a letter, then up to 63 letters, digits and "
                "_"
            )
        if duration_s is not None and not 0 < duration_s < 1e9:
            raise InputError(f"the duration must be positive, not {duration_s:g} s")
        devices.kickoff()
        folder = free_folder(Path(logs), f"{utc_name(clock.utc())}_{name}")
        return _Recording(devices, folder, name, clock, duration_s, progress).run()
    finally:
        devices.close()


@dataclass
class _Stream:
    """What passed from one device so far."""

    count: int = 0
    first_ns: int | None = None
    last_ns: int = 0

    def add(self, samples: ImuSamples) -> None:
        if len(samples):
            self.count += len(samples)
            self.first_ns = (
                int(samples.device_time_ns[0]) if self.first_ns is None else self.first_ns
            )
            self.last_ns = int(samples.device_time_ns[-1])

    def rate(self) -> float | None:
        """Samples in a second of the device's clock [Hz]."""
        span = self.last_ns - self.first_ns if self.first_ns is not None else 0
        return (self.count - 1) / span * NANOSECONDS if span > 0 else None


@dataclass
class _Recording:
    """One recording from running devices to a closed session."""

    devices: Devices
    folder: Path
    name: str
    clock: Clock
    duration_s: float | None
    progress: Progress | None
    stop_asked: bool = False
    streams: dict[str, _Stream] = field(default_factory=dict)

    def run(self) -> Session:
        imus, time = self.devices.imus, self.devices.time
        self.streams = {name: _Stream() for name in imus}
        writer = SessionWriter(
            self.folder,
            Analysis(estimate=_estimation(list(imus.values()))),
            {name: imu.describe() for name, imu in imus.items()},
            self.clock.utc(),
            {
                "kind": "recording",
                "protocol": {"name": self.name, "purpose": "devices recorded without an arm"},
            },
        )
        for name, imu in imus.items():
            writer.open_journal(f"imu_{name}", imu.columns(), IMU_NOTES)
        writer.event(Event(time.now_ns(), "recording_started", {"devices": list(imus)}))
        status, message, error = RunStatus.COMPLETED, "", None
        with on_interrupt(self._ask_to_stop):
            try:
                self._follow(writer)
                if self.stop_asked and self.duration_s is not None:
                    status, message = RunStatus.INTERRUPTED, "stopped by the operator"
            except BaseException as failure:
                said = str(failure)
                if not isinstance(failure, BenchError):
                    said = f"{type(failure).__name__}: {said}"
                status, message, error = RunStatus.ERROR, said, failure
            self.devices.stop()
            with suppress(BenchError):
                self._take(writer, time.now_ns())
            if error is None and not any(stream.count for stream in self.streams.values()):
                error = DriverError(f"no device gave a sample; {' '.join(self._notes())}")
                status, message = RunStatus.ERROR, str(error)
            session = self._close(writer, status, message)
        if error is not None:
            raise error
        if status is RunStatus.INTERRUPTED:
            raise RunInterrupted(
                f"interrupted by the operator; what was recorded is kept in {session.path}", session
            )
        return session

    def _follow(self, writer: SessionWriter) -> None:
        """Take samples at a steady rhythm until the end."""
        end = None if self.duration_s is None else round(self.duration_s * NANOSECONDS)
        until = synced = 0
        while not self.stop_asked and (end is None or until < end):
            until = max(
                until + CHUNK_NS, self.devices.time.now_ns()
            )  # behind a slow disk: catch up in one piece
            until = until if end is None else min(until, end)
            self.devices.time.wait_until(until)
            self._take(writer, until)
            if until - synced >= NANOSECONDS:
                synced = until
                writer.sync()
                if self.progress is not None:
                    self.progress(
                        until / NANOSECONDS,
                        {name: stream.count for name, stream in self.streams.items()},
                    )

    def _take(self, writer: SessionWriter, until_ns: int) -> None:
        events: list[Event] = []
        for name, imu in self.devices.imus.items():
            samples = imu.read(until_ns)
            self.streams[name].add(samples)
            writer.append(f"imu_{name}", samples.to_columns())
            events += [
                Event(event.host_time_ns, event.event, {"sensor": name, **event.details})
                for event in imu.events()
            ]
        for event in sorted(events, key=lambda event: event.host_time_ns):
            writer.event(event)
        writer.flush()

    def _close(self, writer: SessionWriter, status: RunStatus, message: str) -> Session:
        now = self.devices.time.now_ns()
        writer.event(Event(now, f"recording_{status}", {"message": message}))
        sensors = {
            name: writer.manifest["sensors"][name] | {"statistics": self._statistics(name)}
            for name in self.devices.imus
        }
        duration = (
            now / NANOSECONDS
            if self.duration_s is None
            else min(now / NANOSECONDS, self.duration_s)
        )
        writer.close(
            status, message=message, duration_s=duration, sensors=sensors, notes=self._notes()
        )
        return Session(self.folder)

    def _statistics(self, name: str) -> dict[str, Any]:
        imu, stream = self.devices.imus[name], self.streams[name]
        return {**imu.statistics(), "samples": stream.count, "rate_hz": stream.rate()}

    def _notes(self) -> list[str]:
        """Sentences on devices that did not do what was expected of them."""
        notes = []
        for name, imu in self.devices.imus.items():
            found = self._statistics(name)
            refused = found.get("malformed_lines", 0) + found.get("malformed_packets", 0)
            if not found["samples"]:
                heard = (
                    f"{refused} lines or packets came that do not fit its format"
                    if refused
                    else "it sent nothing"
                )
                notes.append(f"{name}: no samples; {heard}.")
            elif (
                found["rate_hz"] is not None
                and abs(found["rate_hz"] / imu.rate - 1) > RATE_TOLERANCE
            ):
                notes.append(
                    f"{name}: {found['rate_hz']:.1f} samples in a second arrived, {imu.rate:g} "
                    "were expected."
                )
            if found["samples"] and refused > found["samples"] // 100:
                notes.append(f"{name}: {refused} lines or packets did not fit its format.")
            if found.get("samples_dropped"):
                notes.append(
                    f"{name}: {found['samples_dropped']} samples were dropped because this machine "
                    "was too slow."
                )
        return notes

    def _ask_to_stop(self) -> None:
        self.stop_asked = True


def _estimation(imus: list[Imu]) -> Estimation:
    """Filters that fit the devices; without truth there is nothing to align with or to calibrate
    against.
    """
    filters = ["device"] if any(imu.has_orientation for imu in imus) else []
    filters += ["vqf_6d", "vqf_9d"] if any(imu.has_magnetometer for imu in imus) else ["vqf_6d"]
    return Estimation(filters=filters, align="none", calibrate="none")


@session_locked
def recover_recording(session: Session) -> Session:
    """Make a recording readable that was cut off by a kill or a power cut; one that was closed is
    returned as it is.

    Raises:
        SessionError: It is still being recorded, or a journal cannot be read.
    """
    if session.status is not RunStatus.RUNNING:
        return session
    if session.is_being_recorded:
        raise SessionError(f"{session.path} is still being recorded; stop that first")
    path, last = session.path, 0
    for journal in sorted(path.glob("*.arrows")):
        compact(journal, journal.with_suffix(".parquet"))
    clear_partials(path)
    for name in session.sensor_names:
        times = read_parquet(path / f"imu_{name}.parquet", ["host_time_ns"])["host_time_ns"]
        last = max(last, int(times.max())) if len(times) else last
    message = f"cut off after {last / NANOSECONDS:.1f} s and recovered"
    note_end(session, Event(last, "recording_aborted", {"message": message}))
    closing = {"status": RunStatus.ABORTED, "message": message, "duration_s": last / NANOSECONDS}
    write_json(path / MANIFEST, session.manifest | closing | {"files": file_hashes(path)})
    return Session(path)
