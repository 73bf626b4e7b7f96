"""Live devices as a person names them: serial boards and Xsens DOTs."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from testbench.clock import SystemClock
from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.bluetooth import SCAN_S, BluetoothLoop
from testbench.drivers.imus.line_format import load_line_format
from testbench.drivers.imus.serial_line import SerialImu, list_serial_ports
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_sync import synchronise
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import BenchError, DriverError, InputError
from testbench.records.specs.strict import NAME_PATTERN


@dataclass
class Devices:
    """The devices of a session.

    Attributes:
        imus: By name.
        time: Their common time.
        bluetooth: The loop of those that need one.
        synchronise: Brings the clocks of connected devices together, which may take a quarter of a
            minute; None where each keeps its own.
        started: Whether they were.
    """

    imus: dict[str, Imu]
    time: SessionTime
    bluetooth: BluetoothLoop | None = None
    synchronise: Callable[[], None] | None = None
    started: bool = False

    def kickoff(self) -> None:
        """Connect all, then start all; a second call does nothing.

        So the first does not wait long for the last.
        """
        if self.started:
            return
        self.started = True
        for imu in self.imus.values():
            imu.connect()
        if self.synchronise is not None:
            self.synchronise()
        self.time.start()
        for imu in self.imus.values():
            imu.kickoff()

    def listen(self) -> None:
        """Make sure that devices deliver samples, where connecting alone does not show it.

        They are let go of again.

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
        """Stop all; see `stop_all`."""
        stop_all(self.imus.values())

    def close(self) -> None:
        """Stop all and release Bluetooth; a second call does nothing."""
        self.stop()
        if self.bluetooth is not None:
            self.bluetooth.close()


def stop_all(imus: Iterable[Imu]) -> None:
    """Stop sensors; a failure of one must not keep the others going."""
    for imu in imus:
        with suppress(BenchError):
            imu.stop()


def open_devices(
    serial: list[str],
    dots: list[str],
    time: SessionTime | None = None,
    payload: str = "custom_mode_5",
    dot_rate: int = 60,
    bluetooth: BluetoothLoop | None = None,
    synchronise_dots: bool = False,
) -> Devices:
    """Make devices from what a person wrote; nothing is connected yet.

    Args:
        serial: Each `[NAME=]PORT:FORMAT`, the format a YAML file or the name of one that ships.
        dots: Each `[NAME=]ADDRESS`, or an advertised name.
        time: Of the session; a new one, by the machine's clock, if None.
        payload: Mode of the DOTs.
        dot_rate: Rate of the DOTs [Hz].
        bluetooth: The loop to use; a new one if None.
        synchronise_dots: Bring the DOTs' clocks together before they start.

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
    time = time or SessionTime(SystemClock())
    imus: dict[str, Imu] = {}
    together: list[XsensDot] = []

    def add(name: str, imu: Imu) -> None:
        if name in imus:
            raise InputError(f"two devices are called '{name}'; name them apart with NAME=...")
        imus[name] = imu

    for number, text in enumerate(serial, 1):
        name, imu = _serial_imu(text, time)
        add(name or f"serial{number}", imu)
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


def _serial_imu(text: str, time: SessionTime) -> tuple[str, SerialImu]:
    """The device of `[NAME=]PORT:FORMAT`, and its name or ""."""
    name, rest = _split_name(text)
    port, _, line_format = rest.rpartition(":")
    if not port or not line_format:
        raise InputError(
            f"--serial {text}: must be PORT:FORMAT, such as /dev/ttyACM0:mpu6050 or "
            "/dev/ttyACM0:board.yaml"
        )
    return name, SerialImu(port, load_line_format(line_format), time)


def _split_name(text: str) -> tuple[str, str]:
    """`NAME=rest` in two; no name where what stands before the sign is none."""
    name, sign, rest = text.partition("=")
    return (name, rest) if sign and re.fullmatch(NAME_PATTERN, name) else ("", text)


def scan_devices(
    duration_s: float = SCAN_S, bluetooth: BluetoothLoop | None = None
) -> dict[str, list[Any]]:
    """What could be recorded: `serial` ports, `dots` in range, `notes` on what was not searched."""
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
