"""Record devices alone, without arm, plan and truth, into a session like any other."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbench.clock import Clock, SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.none import NoArm
from testbench.drivers.imus.base import Imu
from testbench.exceptions import DriverError, InputError
from testbench.execution.devices import Devices
from testbench.execution.loop import RunLoop
from testbench.execution.options import RunOptions
from testbench.execution.recorder import Recorder
from testbench.execution.run_progress import SampleMeter
from testbench.execution.sensors import Sensors
from testbench.frames import NANOSECONDS
from testbench.records.disk.replacing import dated_folder
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import SessionWriter
from testbench.records.specs.protocol import Analysis, Estimation
from testbench.records.specs.strict import NAME_PATTERN

RATE_TOLERANCE = 0.05
"""A device whose rate differs from its nominal one by more is worth a note."""


def record_devices(
    devices: Devices,
    logs: str | Path = "logs",
    duration_s: float | None = None,
    name: str = "recording",
    options: RunOptions | None = None,
) -> Session:
    """Record devices into a session; Ctrl-C ends it.

    Args:
        devices: To record; they are released in every case.
        logs: Folder that sessions are made in.
        duration_s: Length [s]; None records until Ctrl-C, which then is the normal end.
        name: Of the recording.
        options: `clock`, `progress` (about once a second), `say` and `opened` of a run.

    Raises:
        InputError: The name cannot stand in a file name, or the duration is not positive.
        DriverError: A device cannot be opened (nothing is written then), failed, or no device gave
            a sample.
        RunInterrupted: Ctrl-C before the duration was over; the session is kept and closed as
            interrupted.
    """
    options = options or RunOptions()
    clock = options.clock or SystemClock()
    try:
        if not re.fullmatch(NAME_PATTERN, name):
            raise InputError(
                f"'{name}' is no name for a recording: a letter, then up to 63 letters, digits and "
                "_"
            )
        if duration_s is not None and not 0 < duration_s < 1e9:
            raise InputError(f"the duration must be positive, not {duration_s:g} s")
        devices.kickoff()  # before there is a folder: a device that cannot be opened leaves none
        folder = dated_folder(Path(logs), name, clock)
        recorder = DeviceRecorder(folder, name, devices.imus, clock, duration_s)
        options.opened(recorder.path)
        meter = SampleMeter(duration_s, recorder.counts, options.progress)
        arm, sensors = NoArm(devices.time, duration_s), Sensors(devices.imus, devices)
        return RunLoop(arm, sensors, recorder, meter, options).run()
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


class DeviceRecorder(Recorder):
    """Writes what devices deliver without an arm.

    Args:
        path: Of the session.
        name: Of the recording.
        imus: The devices, by name.
        clock: For the time of start and the rhythm of syncing.
        duration_s: As asked for [s]; None for an open end.
    """

    kind = "recording"

    def __init__(
        self, path: Path, name: str, imus: dict[str, Imu], clock: Clock, duration_s: float | None
    ):
        self.name, self._duration_s = name, duration_s
        self._recorded = {sensor: _Stream() for sensor in imus}
        self._end_ns = 0
        super().__init__(path, imus, clock)

    def _open(self) -> SessionWriter:
        purpose = "devices recorded without an arm"
        return SessionWriter(
            self.path,
            Analysis(estimate=_estimation(list(self.imus.values()))),
            {name: imu.describe() for name, imu in self.imus.items()},
            self.clock.utc(),
            {"kind": self.kind, "protocol": {"name": self.name, "purpose": purpose}},
            announced=False,
        )

    def began(self, arm: SteppingArm) -> None:
        self.event(0, "recording_started", devices=list(self.imus))

    def ended(self, host_time_ns: int, status: RunStatus, message: str) -> None:
        self._end_ns = host_time_ns
        super().ended(host_time_ns, status, message)

    def arm_samples(self, samples: ArmSamples) -> None:
        """There are none."""

    def sensor_samples(self, imus: dict[str, ImuSamples]) -> None:
        super().sensor_samples(imus)
        for name, samples in imus.items():
            self._recorded[name].add(samples)

    def counts(self) -> dict[str, int]:
        """How many samples of each device there are."""
        return {name: stream.count for name, stream in self._recorded.items()}

    def lacking(self) -> DriverError | None:
        if any(self.counts().values()):
            return None
        return DriverError(f"no device gave a sample; {'; '.join(map(str, self._findings()))}")

    def _closing(self, arm: dict[str, Any]) -> dict[str, Any]:
        """What each device did, and what was not expected of it."""
        duration = self._end_ns / NANOSECONDS
        described = self._writer.manifest.sensors
        return {
            "duration_s": min(duration, self._duration_s or duration),
            "sensors": {
                name: described[name].written() | {"statistics": self._statistics(name)}
                for name in self.imus
            },
            "findings": self._findings(),
        }

    def _statistics(self, name: str) -> dict[str, Any]:
        stream, counted = self._recorded[name], self._device_statistics().get(name, {})
        return {**counted, "samples": stream.count, "rate_hz": stream.rate()}

    def _findings(self) -> list[Finding]:
        """Devices that did not do what was expected of them."""
        told = []
        for name, imu in self.imus.items():
            counted = self._statistics(name)
            samples, rate = counted["samples"], counted["rate_hz"]
            refused = counted.get("malformed_lines", 0) + counted.get("malformed_packets", 0)
            if not samples:
                code = "device.unreadable" if refused else "device.silent"
                told.append(finding(code, name, refused=refused))
            elif rate is not None and abs(rate / imu.rate - 1) > RATE_TOLERANCE:
                told.append(finding("device.rate", name, rate_hz=rate, expected_hz=imu.rate))
            if samples and refused > samples // 100:
                told.append(finding("device.malformed", name, refused=refused))
            if counted.get("samples_dropped"):
                dropped = counted["samples_dropped"]
                told.append(finding("device.dropped", name, dropped=dropped))
        return told


def _estimation(imus: list[Imu]) -> Estimation:
    """Filters that fit the devices; without truth there is nothing to align with or to calibrate
    against.
    """
    filters = ["device"] if any(imu.has_orientation for imu in imus) else []
    filters += ["vqf_6d", "vqf_9d"] if any(imu.has_magnetometer for imu in imus) else ["vqf_6d"]
    return Estimation(filters=filters, align="none", calibrate="none")
