"""A board that writes its samples as lines of text on a serial port."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import Any, Protocol

from testbench.drivers.imus.device_clock import DeviceClock, SampleCounter
from testbench.drivers.imus.line_format import TIME_UNITS, CounterColumn, LineFormat, TimeColumn
from testbench.drivers.imus.line_parser import Line, LineParser, MalformedLine
from testbench.drivers.imus.streamed import QUEUE_S, StreamedImu
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError
from testbench.extras import missing_extra
from testbench.frames import NANOSECONDS

READ_TIMEOUT_S = 0.1
"""How long the reader waits for a byte before it looks whether it should stop [s]."""
LONGEST_LINE = 1024
"""Bytes; more without an end of line are no line: the speed or the format is wrong."""
SILENCE_S = 1.0
"""A device that sends nothing for this long is reported silent [s]."""
BACKOFF_S = (0.1, 2.0)
"""First and longest wait between attempts to open a lost port [s]; each is twice the one before."""
TEMPERATURE_EVERY_S = 10.0
"""Interval of temperature events [s]."""
FIRST_SAMPLE_S = 3.0
"""A board that is asked whether it works has this long for its first sample [s]."""
JOIN_S = 5.0


class Port(Protocol):
    """What the driver needs of a port; `serial.Serial` has it."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        ...

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes; fewer when the timeout ends."""
        ...

    def write(self, data: bytes) -> Any:
        """Send bytes."""
        ...

    def close(self) -> None:
        """Release the port."""
        ...


def import_pyserial() -> ModuleType:
    """The package pyserial.

    Raises:
        DriverError: It is not installed; names the extra.
    """
    try:
        import serial
    except ImportError:
        raise DriverError(missing_extra("serial devices need", "serial")) from None
    return serial


def open_serial_port(name: str, baud_rate: int) -> Port:
    """Open a serial port for this process alone.

    Raises:
        DriverError: pyserial is missing.
        OSError: The port cannot be opened.
    """
    serial = import_pyserial()
    port: Port = serial.Serial(
        name, baud_rate, timeout=READ_TIMEOUT_S, write_timeout=1.0, exclusive=True
    )
    return port


def list_serial_ports() -> list[dict[str, str]]:
    """Serial ports of this machine: `port`, and what is plugged into it.

    Raises:
        DriverError: pyserial is missing.
    """
    import_pyserial()
    from serial.tools.list_ports import comports

    return [
        {"port": port.device, "description": port.description or "", "hardware": port.hwid or ""}
        for port in comports()
    ]


class SerialImu(StreamedImu):
    """An IMU behind a serial port.

    A thread of its own reads the port, stamps each piece with the time it arrived, and parses it at
    once. A lost port is opened again with growing waits; the gap is an event.

    Args:
        port: Name of the port, e.g. /dev/ttyACM0.
        line_format: How the board writes.
        time: Of the session.
        open_port: Opens a port by name and speed.
        queue_s: Length of the queue [s].
        backoff_s: First and longest wait between attempts [s].
    """

    def __init__(
        self,
        port: str,
        line_format: LineFormat,
        time: SessionTime,
        open_port: Callable[[str, int], Port] = open_serial_port,
        queue_s: float = QUEUE_S,
        backoff_s: tuple[float, float] = BACKOFF_S,
    ):
        magnetometer, orientation = line_format.has("magnetic_field"), line_format.has("quaternion")
        super().__init__(time, line_format.rate_hz, magnetometer, orientation, queue_s)
        self.port_name, self.line_format = port, line_format
        self._open_port, self._backoff_s = open_port, backoff_s
        self._parser = LineParser(line_format)
        self._clock, self._counter = _clock_and_counter(line_format)
        self._has_counter = line_format.has("counter")
        self._suspect: tuple[int, int] | None = None
        self._temperatures: list[float] = []
        self._temperature_ns = 0
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def __str__(self) -> str:
        return f"serial device {self.port_name}"

    def kickoff(self) -> None:
        """Open the port and begin to read.

        Raises:
            DriverError: The port cannot be opened.
        """
        try:
            port = self._open_port(self.port_name, self.line_format.baud_rate)
        except OSError as error:
            raise DriverError(
                f"the serial port {self.port_name} cannot be opened: {_reason(error)}"
            ) from None
        self.time.start()
        self.notices.add("connected", port=self.port_name)
        self._thread = threading.Thread(
            target=self._run, args=(port,), name=f"serial {self.port_name}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End the reader and release the port; a second call does nothing."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            self._thread = None
        self._stopped = True

    def trial(self) -> SerialImu:
        """The same device once more, to listen to before anything depends on it.

        Must be stopped before this one starts.
        """
        time = SessionTime(self.time.clock)
        return SerialImu(
            self.port_name, self.line_format, time, self._open_port, backoff_s=self._backoff_s
        )

    def wait_for_sample(self, name: str, patience_s: float = FIRST_SAMPLE_S) -> None:
        """Wait until a sample has come.

        Args:
            name: Of the sensor, for the message.
            patience_s: After the board has settled [s]; ten periods are granted anyway.

        Raises:
            DriverError: None came; says what came instead.
        """
        wanted = self.line_format.settle_s + max(patience_s, 10 / self.rate)
        end = self.time.clock.monotonic_ns() + round(wanted * NANOSECONDS)
        while not self.queue.received and self.time.clock.monotonic_ns() < end:
            self.time.clock.sleep(0.02)
        if self.queue.received:
            return
        events = {event.event: event.details for event in self.notices.take(everything=True)}
        if "malformed_lines" in events:
            example = events["malformed_lines"]
            heard = (
                f"lines arrive but none fits the format: {example['why']}, such as "
                f"'{example['line'].strip()}'"
            )
        elif "disconnected" in events:
            heard = f"its port was lost: {events['disconnected']['reason']}"
        else:
            heard = "nothing arrives; is the board powered, and does it begin to send by itself?"
        raise DriverError(f"sensor {name}, {self}, delivers no sample within {wanted:g} s: {heard}")

    def describe(self) -> dict[str, Any]:
        """Port, format and rate."""
        return {
            "driver": "serial",
            "description": self.line_format.description,
            "port": self.port_name,
            "rate_hz": self.rate,
            "magnetometer": self.has_magnetometer,
            "orientation": self.has_orientation,
            "line_format": self.line_format.model_dump(mode="json"),
        }

    def _run(self, first: Port) -> None:
        port: Port | None = first
        try:
            while port is not None and not self._stopping.is_set():
                try:
                    self._begin(port)
                    self._stream(port)
                    self._say(port, self.line_format.stop_command)
                except OSError as error:  # serial.SerialException is one
                    port = self._reopen(port, error)
        except BaseException as failure:  # handed to the thread that reads the samples
            self._failure = failure
        finally:
            if port is not None:
                _close(port)

    def _begin(self, port: Port) -> None:
        """Wait for the board to be up, forget what it said meanwhile (it would be stamped late),
        then make it start.
        """
        if self.line_format.settle_s > 0:
            self._stopping.wait(self.line_format.settle_s)
            port.read(port.in_waiting)
        self._say(port, self.line_format.start_command)

    def _say(self, port: Port, command: str) -> None:
        if command:
            port.write(command.encode("ascii"))

    def _stream(self, port: Port) -> None:
        """Read until asked to stop.

        Raises:
            OSError: The port is gone.
        """
        pending, in_step = (
            b"",
            False,
        )  # what comes before the first end of line is the rest of a line
        heard_ns, silent = self.time.now_ns(), False
        while not self._stopping.is_set():
            chunk = port.read(port.in_waiting or 1)
            now = self.time.now_ns()
            if not chunk:
                if not silent and now - heard_ns > SILENCE_S * NANOSECONDS:
                    silent = True
                    self.notices.add("silent", heard_ns)
                continue
            if silent:
                silent = False
                self.notices.add("heard_again", now, gap_s=(now - heard_ns) / NANOSECONDS)
            heard_ns = now
            *lines, pending = (pending + chunk).split(b"\n")
            if lines and not in_step:
                in_step = True
                if lines[0].strip():
                    self.notices.tally("partial_lines")
                del lines[0]
            for line in lines:
                self._take(line, now)
            if len(pending) > LONGEST_LINE:
                self._malformed(pending, f"has no end within {LONGEST_LINE} bytes")
                pending, in_step = b"", False

    def _take(self, raw: bytes, host_ns: int) -> None:
        try:
            line = self._parser.parse(raw)
        except MalformedLine as fault:
            self._malformed(raw, str(fault))
            return
        if line is None:
            return
        time, restarted = self._device_time(line, host_ns)
        if time is None:
            return
        known = time if line.time_ns is not None or self._has_counter else None
        step = self._counter.step(known, line.counter, restarted)
        if step == 0:
            self.notices.tally("repeated_samples")
            return
        if step > 1:
            self.notices.tally("samples_lost", step - 1)
        self.queue.put((time, host_ns, self._counter.advance(step), line.saturated, line.values))
        if line.temperature is not None:
            self._note_temperature(line.temperature, host_ns)

    def _device_time(self, line: Line, host_ns: int) -> tuple[int | None, bool]:
        """Time of a line on the device's clock [ns], None if it is not believed; and whether the
        device restarted.

        A time that contradicts the host's clock is a lost digit or a restart: the next line tells.
        """
        if line.time_ns is None:
            return host_ns, False
        time, last = self._clock.unwrap(line.time_ns, host_ns), self._clock.last_ns
        if time is not None and (last is None or time >= last):
            self._clock.accept(time, host_ns)
            self._suspect = None
            return time, False
        before, self._suspect = self._suspect, (line.time_ns, host_ns)
        if (
            before is not None
            and 0 <= line.time_ns - before[0] <= host_ns - before[1] + NANOSECONDS
        ):
            self._suspect = None
            time = self._clock.restart(line.time_ns, host_ns)
            self.notices.add(
                "device_clock_restarted", host_ns, device_time_s=line.time_ns / NANOSECONDS
            )
            return time, True
        self.notices.tally("untimely_lines", stamp_s=line.time_ns / NANOSECONDS)
        return None, False

    def _malformed(self, raw: bytes, why: str) -> None:
        self.notices.tally(
            "malformed_lines", why=why, line=raw[:80].decode("ascii", "backslashreplace")
        )

    def _note_temperature(self, temperature: float, host_ns: int) -> None:
        self._temperatures.append(temperature)
        if (
            host_ns - self._temperature_ns >= TEMPERATURE_EVERY_S * NANOSECONDS
            or self._temperature_ns == 0
        ):
            mean = sum(self._temperatures) / len(self._temperatures)
            self.notices.add("temperature", host_ns, temperature_degC=round(mean, 3))
            self._temperatures, self._temperature_ns = [], host_ns

    def _reopen(self, port: Port, error: OSError) -> Port | None:
        """Try to open a lost port until it succeeds; None when asked to stop."""
        lost_ns = self.time.now_ns()
        self.notices.add("disconnected", lost_ns, reason=str(error))
        _close(port)
        wait, attempts = self._backoff_s[0], 0
        while not self._stopping.wait(wait):
            attempts += 1
            try:
                port = self._open_port(self.port_name, self.line_format.baud_rate)
            except OSError:
                wait = min(2 * wait, self._backoff_s[1])
                continue
            now = self.time.now_ns()
            self.notices.add(
                "reconnected", now, gap_s=(now - lost_ns) / NANOSECONDS, attempts=attempts
            )
            self._clock.reconnected()
            return port
        return None


def _clock_and_counter(line_format: LineFormat) -> tuple[DeviceClock, SampleCounter]:
    wrap_ns, wrap = None, None
    for column in line_format.columns:
        if isinstance(column, TimeColumn) and column.wrap_bits is not None:
            wrap_ns = TIME_UNITS[column.unit] << column.wrap_bits
        if isinstance(column, CounterColumn) and column.wrap_bits is not None:
            wrap = 1 << column.wrap_bits
    return DeviceClock(wrap_ns), SampleCounter(line_format.rate_hz, wrap)


def _close(port: Port) -> None:
    with suppress(OSError):  # it is gone already
        port.close()


def _reason(error: OSError) -> str:
    """Why a port cannot be opened, in the words of the system, with the most common remedy."""
    said = os.strerror(error.errno) if error.errno else str(error)
    return (
        f"{said}; is this user in the group that may use it (dialout)?"
        if error.errno == errno.EACCES
        else said
    )
