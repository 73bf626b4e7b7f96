"""Xsens DOT over Bluetooth: connect, set the rate, stream, and connect again."""

from __future__ import annotations

import asyncio
from bisect import insort
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from testbench.drivers.imus.bluetooth import SCAN_S, BluetoothLoop, describe_error, find_dots
from testbench.drivers.imus.device_clock import DeviceClock, SampleCounter
from testbench.drivers.imus.streamed import QUEUE_S, StreamedImu
from testbench.drivers.imus.xsens_dot_messages import STOP, STOP_RESULT, ask, message
from testbench.drivers.imus.xsens_dot_payload import (
    BATTERY,
    DEVICE_CONTROL,
    DEVICE_INFO,
    MEASUREMENT_CONTROL,
    OUTPUT_RATES,
    RECORDABLE,
    STAMP_WRAP_NS,
    DeviceInfo,
    DeviceSettings,
    DotReading,
    MalformedPayload,
    get_mode,
    measurement_command,
    parse_device_control,
    parse_device_info,
    read,
    set_rate_command,
)
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, InputError
from testbench.frames import NANOSECONDS

CONNECT_S = 30.0
"""Longest time to connect and set up one sensor [s]."""
BACKOFF_S = (0.5, 5.0)
"""First and longest wait between attempts to connect again [s]; each is twice the one before."""
T = TypeVar("T")
REORDER = 4
"""Samples that are held back so that late ones find their place."""


class XsensDot(StreamedImu):
    """One Xsens DOT.

    Args:
        target: Its Bluetooth address, or the name it advertises if it is the only one of that name.
        time: Of the session.
        bluetooth: The loop it lives in.
        payload: Name of the payload mode.
        rate: Output rate [Hz].
        queue_s: Length of the queue [s].
        backoff_s: First and longest wait between attempts [s].

    Raises:
        NotFoundError: No such payload mode.
        InputError: The mode lacks what a recording needs, or the sensor has no such rate.
    """

    def __init__(
        self,
        target: str,
        time: SessionTime,
        bluetooth: BluetoothLoop,
        payload: str = "custom_mode_5",
        rate: int = 60,
        queue_s: float = QUEUE_S,
        backoff_s: tuple[float, float] = BACKOFF_S,
    ):
        self.mode = get_mode(payload)
        if payload not in RECORDABLE:
            modes = ", ".join(RECORDABLE)
            raise InputError(
                f"payload mode '{payload}' lacks angular rate or specific force; modes that can be "
                f"recorded: {modes}"
            )
        if rate not in OUTPUT_RATES:
            raise InputError(
                f"an Xsens DOT streams at {', '.join(map(str, OUTPUT_RATES))} Hz, not at {rate} Hz"
            )
        super().__init__(time, float(rate), self.mode.has_field, self.mode.has_orientation, queue_s)
        self.target, self._bluetooth, self._backoff_s = target, bluetooth, backoff_s
        self._client: Any = None
        self._address = target
        self._info: DeviceInfo | None = None
        self._settings: DeviceSettings | None = None
        self._battery: int | None = None
        self._clock, self._counter = DeviceClock(STAMP_WRAP_NS), SampleCounter(rate)
        self._held: list[tuple[int, int, DotReading]] = []
        self._given_ns: int | None = None
        self._streaming = False
        self._reconnecting: asyncio.Task[None] | None = None
        self._sync_root: str | None = None

    def __str__(self) -> str:
        return f"Xsens DOT {self.target}"

    def connect(self) -> None:
        """Find the sensor, connect and set it up; it does not stream yet.

        Raises:
            DriverError: It was not found, or does not answer.
            InputError: Several have this name.
        """
        if self._client is None:
            try:
                self._bluetooth.call(self._connect(), CONNECT_S + 2 * SCAN_S)
            except DriverError as error:
                raise DriverError(f"{self}: {error}") from None

    @property
    def address(self) -> str:
        """As the sensor itself states it; that of the operating system before it is connected."""
        return self._info.address if self._info is not None else self._address

    def work(self, task: Callable[[Any], Coroutine[Any, Any, T]]) -> T:
        """Do something with the connected client, before streaming begins.

        Raises:
            DriverError: The sensor is not connected, or does not answer.
        """
        try:
            if self._client is None:
                raise DriverError("it is not connected")
            return self._bluetooth.call(task(self._client), CONNECT_S)
        except DriverError as error:
            raise DriverError(f"{self}: {error}") from None

    def let_go(self) -> None:
        """Disconnect for a while; `connect` makes the link again."""
        client, self._client = self._client, None
        if client is not None:
            self._bluetooth.call(_quietly(client.disconnect()), CONNECT_S)

    def wait(self, seconds: float) -> None:
        """Let time pass, by the clock of the session."""
        self.time.clock.sleep(seconds)

    def note_synchronised(self, root_address: str) -> None:
        """The sensor's clock now is that of the root; it is let go of when the recording ends."""
        self._sync_root = root_address
        self.notices.add("synchronised", root=root_address)

    def kickoff(self) -> None:
        """Connect if that was not done, and begin to stream.

        Raises:
            DriverError: It was not found, or does not answer.
        """
        self.connect()
        self.time.start()
        self.notices.add("connected", address=self._address, battery_percent=self._battery)
        self._streaming = True
        try:
            self._bluetooth.call(self._start(self._client), CONNECT_S)
        except DriverError as error:
            raise DriverError(f"{self}: {error}") from None

    def stop(self) -> None:
        """Stop streaming and disconnect, whatever the state; a second call does nothing."""
        self._streaming = False
        if not self._stopped:
            self._stopped = True
            try:
                self._bluetooth.call(self._end(), CONNECT_S)
            except DriverError as error:
                self.notices.add("stop_failed", reason=str(error))

    def describe(self) -> dict[str, Any]:
        """Address, firmware, payload mode and rate."""
        known: dict[str, Any] = {}
        if self._info is not None:
            known |= {"firmware": self._info.firmware, "serial_number": self._info.serial_number}
            known |= {"product_code": self._info.product_code}
        if self._settings is not None:
            known |= {"tag": self._settings.tag, "filter_profile": self._settings.profile}
        return {
            "driver": "xsens_dot",
            "description": f"Xsens DOT, {self.mode.name}, {self.rate:g} Hz",
            "address": self._address,
            "payload": self.mode.name,
            "rate_hz": self.rate,
            "magnetometer": self.has_magnetometer,
            "orientation": self.has_orientation,
            # Rates and forces are means over the interval before the stamp: strapdown integration
            # on board (user manual).
            "rate_delay_s": 0.5 / self.rate,
            "battery_percent": self._battery,
            "sync_root": self._sync_root,
            **known,
        }

    async def _connect(self) -> None:
        device = await self._find()
        client = self._bluetooth.client(device, disconnected_callback=self._lost)
        await asyncio.wait_for(client.connect(), CONNECT_S)
        try:
            await self._set_up(client)
        except BaseException:
            await _quietly(client.disconnect())
            raise
        self._client = client

    async def _find(self) -> Any:
        """The device as the scanner knows it: BlueZ connects only to devices it has heard
        lately.
        """
        scanner = self._bluetooth.scanner
        if ":" in self.target or self.target.count("-") == 4:  # macOS knows devices by UUID
            device = await scanner.find_device_by_address(self.target, timeout=2 * SCAN_S)
            if device is None:
                raise DriverError(
                    "it was not heard; is it switched on, near, and not connected to another host?"
                )
            self._address = self.target
            return device
        heard = await find_dots(scanner, SCAN_S)
        mine = [dot for dot in heard if dot["name"].lower() == self.target.lower()]
        if len(mine) > 1:
            raise InputError(
                f"{self}: {len(mine)} sensors have this name; use "
                f"{' or '.join(d['address'] for d in mine)}"
            )
        if not mine:
            names = ", ".join(f"{dot['name']} ({dot['address']})" for dot in heard) or "none"
            raise DriverError(f"it was not heard; sensors that were: {names}")
        self._address = mine[0]["address"]
        return (
            await scanner.find_device_by_address(self._address, timeout=2 * SCAN_S) or self._address
        )

    async def _set_up(self, client: Any) -> None:
        self._info = parse_device_info(bytes(await client.read_gatt_char(DEVICE_INFO)))
        control = bytes(await client.read_gatt_char(DEVICE_CONTROL))
        self._battery = int((await client.read_gatt_char(BATTERY))[0])
        if parse_device_control(control).rate != self.rate:
            await client.write_gatt_char(
                DEVICE_CONTROL, set_rate_command(control, round(self.rate)), response=True
            )
            control = bytes(await client.read_gatt_char(DEVICE_CONTROL))
        self._settings = parse_device_control(control)
        if self._settings.rate != self.rate:
            stays = f"it stays at {self._settings.rate} Hz when asked for {self.rate:g} Hz"
            raise DriverError(f"{stays}; is it streaming or synchronised already?")

    async def _start(self, client: Any) -> None:
        """Notifications first, then the command, as the specification wants [3.1]."""
        await client.start_notify(self.mode.characteristic, self._notified)
        await client.write_gatt_char(
            MEASUREMENT_CONTROL, measurement_command(self.mode, start=True), response=True
        )

    async def _end(self) -> None:
        if self._reconnecting is not None:
            self._reconnecting.cancel()
            await asyncio.gather(self._reconnecting, return_exceptions=True)
        client, self._client = self._client, None
        if client is not None and client.is_connected:
            command = measurement_command(self.mode, start=False)
            await _quietly(client.write_gatt_char(MEASUREMENT_CONTROL, command, response=True))
            await _quietly(client.stop_notify(self.mode.characteristic))
            if (
                self._sync_root is not None
            ):  # it would cost battery until it is switched off [5.3.2.2]
                await _quietly(ask(client, message(STOP), STOP_RESULT))
            await _quietly(client.disconnect())
        self._give(keep=0)

    def _lost(self, client: Any) -> None:
        """The link broke; called by bleak in the loop's thread."""
        if client is not self._client:
            return
        self._client = None
        if not self._streaming or (
            self._reconnecting is not None and not self._reconnecting.done()
        ):
            return  # the attempt under way sees that its client is gone
        now = self.time.now_ns()
        self.notices.add("disconnected", now, reason="the Bluetooth link was lost")
        self._give(keep=0)
        self._reconnecting = asyncio.get_running_loop().create_task(self._reconnect(now))

    async def _reconnect(self, lost_ns: int) -> None:
        wait, attempts = self._backoff_s[0], 0
        while self._streaming:
            await asyncio.sleep(wait)
            attempts += 1
            try:
                await self._connect()
                self._clock.reconnected()
                await self._start(self._client)
                if self._client is None:
                    raise ConnectionError("the link was lost again at once")
            except Exception as error:  # bleak and its backends raise errors of many kinds
                client, self._client = self._client, None
                if client is not None:
                    await _quietly(client.disconnect())
                self.notices.tally("reconnect_failed", reason=describe_error(error))
                wait = min(2 * wait, self._backoff_s[1])
                continue
            now = self.time.now_ns()
            self.notices.add(
                "reconnected", now, gap_s=(now - lost_ns) / NANOSECONDS, attempts=attempts
            )
            return

    def _notified(self, characteristic: Any, data: bytearray) -> None:
        """A sample arrived; called by bleak in the loop's thread."""
        host_ns = self.time.now_ns()
        try:
            reading = read(self.mode, bytes(data), self.rate)
        except MalformedPayload as fault:
            self.notices.tally("malformed_packets", why=str(fault))
            return
        time = self._clock.unwrap(reading.stamp_ns, host_ns)
        if time is None:
            self._give(keep=0)
            time = self._clock.restart(reading.stamp_ns, host_ns)
            self.notices.add(
                "device_clock_restarted", host_ns, device_time_s=reading.stamp_ns / NANOSECONDS
            )
        self._clock.accept(time, host_ns)
        if self._given_ns is not None and time <= self._given_ns:
            self.notices.tally("late_packets")
            return
        if any(time == held for held, _, _ in self._held):
            self.notices.tally("repeated_samples")
            return
        if self._held and time < self._held[-1][0]:
            self.notices.tally("reordered_packets")
        insort(self._held, (time, host_ns, reading), key=lambda held: held[0])
        self._give(keep=REORDER)

    def _give(self, keep: int) -> None:
        """Hand over the oldest samples but for the last `keep`, in order of their time."""
        while len(self._held) > keep:
            time, host_ns, reading = self._held.pop(0)
            step = self._counter.step(time)
            if step > 1:
                self.notices.tally("samples_lost", step - 1)
            self._given_ns = time
            self.queue.put(
                (time, host_ns, self._counter.advance(step), reading.saturated, reading.values)
            )


async def _quietly(work: Any) -> None:
    """Do what may fail because the link is gone, for a second or two at most."""
    try:
        await asyncio.wait_for(work, 5)
    except Exception:  # bleak and its backends raise errors of many kinds; nothing is left to save
        return
