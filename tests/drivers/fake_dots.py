"""GATT servers of Xsens DOTs that stand in for those that bleak's client would reach over the
air.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from testbench.drivers.imus.bluetooth import BluetoothLoop
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_payload import LONG_PAYLOAD
from testbench.drivers.session_time import SessionTime
from tests.conftest import FakeClock

G = 9.80665
TICK_US = 16667  # 60 Hz, as real recordings of the DOT show


class FakeDot:
    """A DOT's GATT server, at the interface of `bleak.BleakClient`."""

    def __init__(self, address: str, name: str = "Xsens DOT", rate: int = 60):
        self.address, self.name = address, name
        self.control = bytearray(
            bytes.fromhex("00 00 00 0a 00 1e 00 05") + b"thigh".ljust(16, b"\0") + bytes(8)
        )
        self.control[24:26] = rate.to_bytes(2, "little")
        self.refuse_connections = 0
        self.connections = 0
        self.streaming: int | None = None
        self.notify: dict[str, Callable[[Any, bytearray], None]] = {}
        self.log: list[str] = []
        self.client: FakeClient | None = None

    def payload(self, number: int, stamp_us: int | None = None) -> bytearray:
        """Custom mode 5; the first rate tells the number of the sample [deg/s]."""
        stamp = number * TICK_US if stamp_us is None else stamp_us
        return bytearray(
            struct.pack("<I10f", stamp % 2**32, 1, 0, 0, 0, 0, 0, G, number, 0, 0).ljust(63, b"\0")
        )

    def send(self, *packets: bytearray) -> None:
        """Notify, in the loop's thread as bleak does."""
        assert self.streaming is not None and self.client is not None

        def work() -> None:
            for packet in packets:
                if LONG_PAYLOAD in self.notify:  # what is in the air when the link breaks is lost
                    self.notify[LONG_PAYLOAD](SimpleNamespace(uuid=LONG_PAYLOAD), packet)

        self.client.loop.call_soon_threadsafe(work)

    def drop_link(self) -> None:
        client = self.client
        assert client is not None
        self.client, self.streaming, self.notify = None, None, {}
        client.loop.call_soon_threadsafe(client.disconnected_callback, client)


class FakeClient:
    """What bleak's client does that the driver uses, with the checks of a real server."""

    air: dict[str, FakeDot]

    def __init__(self, device: Any, disconnected_callback: Callable[[Any], None]):
        self.dot = self.air[device if isinstance(device, str) else device.address]
        self.disconnected_callback = disconnected_callback

    @property
    def is_connected(self) -> bool:
        return self.dot.client is self

    async def connect(self) -> None:
        await asyncio.sleep(0)
        if self.dot.refuse_connections > 0:
            self.dot.refuse_connections -= 1
            raise OSError("le-connection-abort-by-local")
        self.loop = asyncio.get_running_loop()
        self.dot.client = self
        self.dot.connections += 1

    async def disconnect(self) -> None:
        self.dot.log.append("disconnect")
        self.dot.client = None

    def _up(self) -> None:
        if not self.is_connected:
            raise ConnectionError("Not connected")

    async def read_gatt_char(self, uuid: str) -> bytearray:
        self._up()
        address = bytes.fromhex(self.dot.address.replace(":", ""))[::-1]
        return {
            "15171001-4947-11e9-8646-d663bd873d93": bytearray(
                address + bytes((2, 0, 0)) + bytes(19) + b"XS-T02"
            ),
            "15171002-4947-11e9-8646-d663bd873d93": self.dot.control,
            "15173001-4947-11e9-8646-d663bd873d93": bytearray((87, 0)),
        }[uuid]

    async def write_gatt_char(self, uuid: str, data: bytes, response: bool) -> None:
        self._up()
        if uuid.startswith("15171002"):
            assert len(data) == 32 and data[0] == 0x10 and response
            self.dot.control[24:26] = data[24:26]
            self.dot.log.append(f"rate {int.from_bytes(data[24:26], 'little')}")
        elif uuid.startswith("15172001"):
            kind, action, mode = data
            assert kind == 1
            assert not action or self.dot.notify, "notifications must be enabled first"
            self.dot.streaming = mode if action else None
            self.dot.log.append(f"{'start' if action else 'stop'} {mode}")

    async def start_notify(self, uuid: str, callback: Callable[[Any, bytearray], None]) -> None:
        self._up()
        self.dot.notify[uuid] = callback

    async def stop_notify(self, uuid: str) -> None:
        self._up()
        del self.dot.notify[uuid]


class FakeScanner:
    air: dict[str, FakeDot]

    @classmethod
    async def discover(cls, timeout: float, return_adv: bool) -> dict[str, tuple[Any, Any]]:
        assert return_adv
        heard = {
            "00:11:22:33:44:55": (SimpleNamespace(address="00:11:22:33:44:55", name="Kettle"), {})
        }
        for rssi, dot in enumerate(cls.air.values(), -60):
            heard[dot.address] = (
                SimpleNamespace(address=dot.address, name=dot.name),
                {2182: b"\0"} if rssi % 2 else {},
            )
        return {
            address: (
                device,
                SimpleNamespace(local_name=device.name, manufacturer_data=data, rssi=-60 + i),
            )
            for i, (address, (device, data)) in enumerate(heard.items())
        }

    @classmethod
    async def find_device_by_address(cls, address: str, timeout: float) -> Any:
        dot = cls.air.get(address)
        return None if dot is None else SimpleNamespace(address=address, name=dot.name)


class Bench:
    """Dots in the air, a loop, and drivers that are stopped at the end."""

    def __init__(self, *dots: FakeDot):
        self.dots = dots
        air = {"air": {dot.address: dot for dot in dots}}
        self.loop = BluetoothLoop(
            type("Client", (FakeClient,), air), type("Scanner", (FakeScanner,), air)
        )
        self.clock = FakeClock()
        self.time = SessionTime(self.clock)
        self.made: list[XsensDot] = []

    def sensor(self, target: str | int = 0, **options: Any) -> XsensDot:
        address = self.dots[target].address if isinstance(target, int) else target
        self.made.append(
            XsensDot(address, self.time, self.loop, **{"backoff_s": (0.01, 0.05)} | options)
        )
        return self.made[-1]

    def until(self, done: Callable[[], bool]) -> None:
        """Let the loop work until something has happened."""
        for _ in range(30_000):
            if done():
                return
            self.loop.call(asyncio.sleep(0.001), 30)
        raise AssertionError("it did not happen")

    def tasks(self) -> int:
        """What the loop is still busy with."""

        async def count() -> int:
            return len(asyncio.all_tasks()) - 1

        return self.loop.call(count(), 30)

    def close(self) -> None:
        for sensor in self.made:
            sensor.stop()
            sensor.stop()
        self.loop.close()
        self.loop.close()


def events_of(sensor: XsensDot) -> dict[str, dict]:
    sensor.stop()
    return {event.event: event.details for event in sensor.events()}
