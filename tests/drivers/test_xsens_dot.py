"""Xsens DOT: payloads against bytes packed by hand, and the driver against GATT servers that stand in for bleak's client."""

from __future__ import annotations

import asyncio
import inspect
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.clock import SystemClock
from testbench.drivers.imus.bluetooth import BluetoothLoop, import_bleak
from testbench.drivers.imus.streamed import SessionTime
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_payload import (
    LONG_PAYLOAD,
    MEDIUM_PAYLOAD,
    MODES,
    SHORT_PAYLOAD,
    MalformedPayload,
    get_mode,
    parse,
    parse_device_control,
    parse_device_info,
    read,
    set_rate_command,
)
from testbench.exceptions import DriverError, InputError, NotFoundError
from testbench.execution.device_recorder import open_devices, record_devices
from testbench.pipeline import analyse

NEVER = 10**18
G = 9.80665
TICK_US = 16667  # 60 Hz, as real recordings of the DOT show


# Payloads


def test_the_bytes_of_custom_mode_5_mean_what_the_specification_says() -> None:
    # Written out by hand: 0x01020304 us; q = (1, 0, 0, 0); acc = (0, 0, 9.8125) m/s^2; rate = (180, -90, 0.5) deg/s.
    data = bytes.fromhex("04030201 0000803f 00000000 00000000 00000000 00000000 00000000 00001d41 00003443 0000b4c2 0000003f")
    assert len(data) == MODES["custom_mode_5"].size == 44
    found = parse(get_mode("custom_mode_5"), data + bytes(19))  # the characteristic is 63 bytes long
    assert found["timestamp"] == (0x01020304,)
    assert found["quaternion"] == (1, 0, 0, 0)
    assert found["acceleration"] == (0, 0, 9.8125)
    assert found["angular_velocity"] == (180, -90, 0.5)
    reading = read(get_mode("custom_mode_5"), data, 60)
    assert reading.stamp_ns == 0x01020304 * 1000
    np.testing.assert_allclose(reading.values, [np.pi, -np.pi / 2, np.radians(0.5), 0, 0, 9.8125, 1, 0, 0, 0])
    assert not reading.saturated
    assert read(get_mode("rate_quantities"), struct.pack("<I6f", 1, 0, 0, G, 0, -2000, 0), 60).saturated
    assert read(get_mode("rate_quantities"), struct.pack("<I6f", 1, 16 * G, 0, 0, 0, 0, 0), 60).saturated


def test_every_public_mode_has_the_size_and_the_characteristic_of_the_specification() -> None:
    # Tables 14 to 16 of XD0506P revision C.
    sizes = {2: 36, 3: 32, 4: 16, 5: 20, 6: 16, 7: 32, 16: 28, 18: 38, 19: 32, 20: 34, 21: 28, 22: 40, 23: 34, 24: 32, 26: 44}
    assert {mode.id: mode.size for mode in MODES.values()} == sizes
    for mode in MODES.values():
        expected = LONG_PAYLOAD if mode.size > 40 else MEDIUM_PAYLOAD if mode.size > 20 else SHORT_PAYLOAD
        assert mode.characteristic == expected
    assert MEDIUM_PAYLOAD.upper() == "15172003-4947-11E9-8646-D663BD873D93"


def test_status_and_clip_counts_stand_where_the_specification_puts_them() -> None:
    data = struct.pack("<I4f3f", 5, 1, 0, 0, 0, 0, 0, 0) + bytes.fromhex("1202 03 04")
    found = parse(get_mode("extended_quaternion"), data + bytes(4))
    assert (found["status"], found["clip_acc"], found["clip_gyr"]) == ((0x0212,), (3,), (4,))


def test_specific_force_follows_from_free_acceleration_and_orientation() -> None:
    turned = Rotation.from_euler("ZYX", [40, -20, 70], degrees=True)
    free = np.array([0.5, -1.0, 2.0])
    force = turned.inv().apply(free + [0, 0, G])
    reading = read(get_mode("custom_mode_1"), struct.pack("<I9f", 9, 70, -20, 40, *free, 10, 20, 30), 60)
    q = turned.as_quat(scalar_first=True)  # roll, pitch, yaw in the packet are the angles of Z Y X from the right
    np.testing.assert_allclose(reading.values, [*np.radians([10, 20, 30]), *force, *q], atol=1e-5)


def test_increments_over_a_period_become_rates_and_forces() -> None:
    rate, force = np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.2, 9.7])
    dq = Rotation.from_rotvec(rate / 60).as_quat(scalar_first=True)
    packed = struct.pack("<I7f3h", 7, *-dq, *(force / 60), 4096, -2048, 0)  # either sign of dq is the same rotation
    reading = read(get_mode("delta_quantities_with_mag"), packed, 60)
    np.testing.assert_allclose(reading.values, [*rate, *force, 40, -20, 0], atol=2e-5)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (bytes(43), "has 43 bytes, custom_mode_5 needs 44"),
        (struct.pack("<I10f", 1, 1, 0, 0, 0, 0, 0, float("nan"), 0, 0, 0), "not finite"),
        (struct.pack("<I10f", 1, 0, 0, 0, 0, 0, 0, G, 0, 0, 0), "quaternion of norm 0.000"),
    ],
)
def test_a_damaged_packet_says_why(data: bytes, why: str) -> None:
    with pytest.raises(MalformedPayload, match=why):
        read(get_mode("custom_mode_5"), data, 60)


def test_device_information_and_settings_are_read_and_only_the_rate_is_written() -> None:
    info = bytes.fromhex("563412CD22D4 020001 e507 05 1f 0c 1e 00 07000000 3412000000ff4201") + b"XS-T01"
    found = parse_device_info(info)
    assert (found.address, found.firmware, found.product_code) == ("D4:22:CD:12:34:56", "2.0.1", "XS-T01")
    assert found.serial_number == "142FF0000001234"
    control = bytes.fromhex("00 00 00 0a 00 1e 00 05") + b"thigh".ljust(16, b"\0") + bytes.fromhex("3c00 01 0000000000")
    settings = parse_device_control(control)
    assert (settings.tag, settings.rate, settings.profile) == ("thigh", 60, 1)
    command = set_rate_command(control, 30)
    assert command[0] == 0x10 and parse_device_control(command).rate == 30
    assert command[1:24] == control[1:24] and command[26:] == control[26:]


# The driver


class FakeDot:
    """A DOT's GATT server, at the interface of `bleak.BleakClient`."""

    def __init__(self, address: str, name: str = "Xsens DOT", rate: int = 60):
        self.address, self.name = address, name
        self.control = bytearray(bytes.fromhex("00 00 00 0a 00 1e 00 05") + b"thigh".ljust(16, b"\0") + bytes(8))
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
        return bytearray(struct.pack("<I10f", stamp % 2**32, 1, 0, 0, 0, 0, 0, G, number, 0, 0).ljust(63, b"\0"))

    def send(self, *packets: bytearray) -> None:
        """Notify, in the loop's thread as bleak does."""
        assert self.streaming is not None and self.client is not None

        def work() -> None:
            for packet in packets:
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
            "15171001-4947-11e9-8646-d663bd873d93": bytearray(address + bytes((2, 0, 0)) + bytes(19) + b"XS-T02"),
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
        heard = {"00:11:22:33:44:55": (SimpleNamespace(address="00:11:22:33:44:55", name="Kettle"), {})}
        for rssi, dot in enumerate(cls.air.values(), -60):
            heard[dot.address] = (SimpleNamespace(address=dot.address, name=dot.name), {2182: b"\0"} if rssi % 2 else {})
        return {
            address: (device, SimpleNamespace(local_name=device.name, manufacturer_data=data, rssi=-60 + i))
            for i, (address, (device, data)) in enumerate(heard.items())
        }

    @classmethod
    async def find_device_by_address(cls, address: str, timeout: float) -> Any:
        dot = cls.air.get(address)
        return None if dot is None else SimpleNamespace(address=address, name=dot.name)


def wait_for(done: Callable[[], bool], seconds: float = 5.0) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.002)


class Bench:
    """Dots in the air, a loop, and drivers that are stopped at the end."""

    def __init__(self, *dots: FakeDot):
        self.dots = dots
        air = {"air": {dot.address: dot for dot in dots}}
        self.loop = BluetoothLoop(type("Client", (FakeClient,), air), type("Scanner", (FakeScanner,), air))
        self.time = SessionTime(SystemClock())
        self.made: list[XsensDot] = []

    def sensor(self, target: str | int = 0, **options: Any) -> XsensDot:
        address = self.dots[target].address if isinstance(target, int) else target
        self.made.append(XsensDot(address, self.time, self.loop, **{"backoff_s": (0.01, 0.05)} | options))
        return self.made[-1]

    def close(self) -> None:
        for sensor in self.made:
            sensor.stop()
            sensor.stop()
        self.loop.close()
        self.loop.close()


Benches = Callable[..., Bench]


@pytest.fixture
def make_bench() -> Iterator[Benches]:
    made: list[Bench] = []
    threads = threading.active_count()

    def make(*dots: FakeDot) -> Bench:
        made.append(Bench(*(dots or (FakeDot("D4:22:CD:00:00:01"),))))
        return made[-1]

    yield make
    for bench in made:
        bench.close()
    assert threading.active_count() == threads


def samples_of(sensor: XsensDot) -> Any:
    sensor.stop()
    return sensor.queue.take(NEVER)


def events_of(sensor: XsensDot) -> dict[str, dict]:
    sensor.stop()
    return {event.event: event.details for event in sensor.events()}


def numbers(samples: Any) -> list[int]:
    """Which samples they are, by their first rate."""
    return [round(value) for value in np.degrees(samples.gyr[:, 0])]


def test_a_sensor_is_set_up_started_and_stopped_in_the_order_of_the_specification(make_bench: Benches) -> None:
    bench = make_bench(FakeDot("D4:22:CD:00:00:01", rate=20))
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    dot.send(*(dot.payload(k) for k in range(30)))
    wait_for(lambda: sensor.queue.received == 26)  # four are held back for late ones
    samples = samples_of(sensor)
    assert numbers(samples) == list(range(30))
    np.testing.assert_array_equal(samples.device_time_ns, np.arange(30) * TICK_US * 1000)
    np.testing.assert_array_equal(samples.counter, np.arange(30))
    np.testing.assert_allclose(samples.acc, np.tile([0, 0, G], (30, 1)), rtol=1e-6)
    np.testing.assert_array_equal(samples.device_q, np.tile([1, 0, 0, 0], (30, 1)))
    assert (np.diff(samples.host_time_ns) >= 0).all() and samples.mag is None
    assert dot.log == ["rate 60", "start 26", "stop 26", "disconnect"] and dot.notify == {}
    about = sensor.describe()
    assert about["firmware"] == "2.0.0" and about["tag"] == "thigh" and about["battery_percent"] == 87
    assert about["payload"] == "custom_mode_5" and about["rate_hz"] == 60 and about["orientation"]


def test_several_sensors_stream_at_once_and_keep_apart(make_bench: Benches) -> None:
    bench = make_bench(*(FakeDot(f"D4:22:CD:00:00:0{i}") for i in range(1, 5)))
    sensors = [bench.sensor(i) for i in range(4)]
    for sensor in sensors:
        sensor.connect()
    assert not any(dot.log for dot in bench.dots)  # connected, but nothing streams yet
    for sensor in sensors:
        sensor.kickoff()
    for k in range(50):
        for i, dot in enumerate(bench.dots):
            dot.send(dot.payload(100 * i + k))
    wait_for(lambda: all(sensor.queue.received == 46 for sensor in sensors))
    for i, sensor in enumerate(sensors):
        assert numbers(samples_of(sensor)) == list(range(100 * i, 100 * i + 50))


def test_packets_that_come_late_twice_or_never_are_put_right_and_counted(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    order = [0, 1, 2, 4, 3, 5, 5, 6, 9, 10, 11, 12, 13, 14, 15, 7, 16]  # 8 is lost; 7 comes when it is too late
    dot.send(*(dot.payload(k) for k in order), bytearray(10))
    wait_for(lambda: "malformed_packets" in sensor.notices.totals)
    samples = samples_of(sensor)
    assert numbers(samples) == [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13, 14, 15, 16]
    np.testing.assert_array_equal(samples.counter, numbers(samples))
    assert (np.diff(samples.device_time_ns) > 0).all()
    counts = {key: value["count"] for key, value in events_of(sensor).items() if "count" in value}
    assert counts == {
        "reordered_packets": 1, "repeated_samples": 1, "late_packets": 1, "samples_lost": 2, "malformed_packets": 1
    }  # fmt: skip


def test_the_32_bit_stamp_wraps_and_time_goes_on(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    first = 2**32 - 10 * TICK_US
    order = [*range(9), 10, 9, *range(11, 30)]  # the packets at the wrap itself change places
    dot.send(*(dot.payload(k, first + k * TICK_US) for k in order))
    wait_for(lambda: sensor.queue.received == 26)
    samples = samples_of(sensor)
    np.testing.assert_array_equal(samples.device_time_ns, (first + np.arange(30) * TICK_US) * 1000)
    assert numbers(samples) == list(range(30)) and "samples_lost" not in events_of(sensor)


@pytest.mark.parametrize("restarts", [False, True])
def test_a_lost_link_is_made_again_and_the_gap_is_known(make_bench: Benches, restarts: bool) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    dot.send(*(dot.payload(k, 5_000_000 + k * TICK_US) for k in range(20)))
    wait_for(lambda: sensor.queue.received == 16)
    dot.refuse_connections = 2
    lost = bench.time.now_ns()
    dot.drop_link()
    wait_for(lambda: "reconnected" in sensor.notices.totals)
    passed = (bench.time.now_ns() - lost) // 1000
    begin = 0 if restarts else 5_000_000 + 19 * TICK_US + passed
    dot.send(*(dot.payload(100 + k, begin + k * TICK_US) for k in range(10)))
    wait_for(lambda: sensor.queue.received >= 26)
    samples = samples_of(sensor)
    assert numbers(samples) == [*range(20), *range(100, 110)]  # what was held back when the link broke is there
    assert (np.diff(samples.device_time_ns) > 0).all()
    gap = samples.device_time_ns[20] - samples.device_time_ns[19]
    assert gap == pytest.approx(samples.host_time_ns[20] - samples.host_time_ns[19], abs=60e6)
    happened = events_of(sensor)
    assert happened["reconnected"]["attempts"] == 3 and happened["reconnect_failed"]["count"] == 2
    assert ("device_clock_restarted" in happened) == restarts
    assert dot.log.count("start 26") == 2 and dot.connections == 2


def test_stopping_while_the_link_is_down_ends_the_attempts(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    dot.refuse_connections = 10**6
    dot.drop_link()
    wait_for(lambda: sensor.notices.totals.get("reconnect_failed", 0) >= 2)
    sensor.stop()
    refused = dot.refuse_connections
    time.sleep(0.1)
    assert dot.refuse_connections == refused


def test_nobody_reading_drops_samples_and_counts_them(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(queue_s=0.5), bench.dots[0]  # 30 samples
    sensor.kickoff()
    dot.send(*(dot.payload(k) for k in range(100)))
    wait_for(lambda: sensor.notices.totals.get("samples_dropped") == 66)
    assert numbers(samples_of(sensor)) == list(range(30))


def test_scanning_finds_dots_and_nothing_else_and_a_name_is_enough_if_it_is_unique(make_bench: Benches) -> None:
    bench = make_bench(FakeDot("D4:22:CD:00:00:01", "Movella DOT"), FakeDot("D4:22:CD:00:00:02"), FakeDot("D4:22:CD:00:00:03"))
    found = bench.loop.scan(0)
    assert [dot["address"][-1] for dot in found] == ["3", "2", "1"]  # strongest first
    sensor = bench.sensor("movella dot")
    sensor.kickoff()
    assert sensor.describe()["address"] == "D4:22:CD:00:00:01"
    with pytest.raises(InputError, match="2 sensors have this name; use D4:22:CD:00:00:03 or D4:22:CD:00:00:02"):
        bench.sensor("Xsens DOT").kickoff()
    with pytest.raises(DriverError, match="not heard; sensors that were: Xsens DOT"):
        bench.sensor("Polar").kickoff()
    with pytest.raises(DriverError, match="Xsens DOT D4:22:CD:00:00:09: it was not heard"):
        bench.sensor("D4:22:CD:00:00:09").kickoff()


def test_what_cannot_be_recorded_is_refused_before_anything_is_connected(make_bench: Benches) -> None:
    bench = make_bench()
    with pytest.raises(InputError, match=r"lacks angular rate or specific force; .*custom_mode_5"):
        bench.sensor(payload="complete_quaternion")
    with pytest.raises(NotFoundError, match="custom_mode_5"):
        bench.sensor(payload="high_fidelity")
    with pytest.raises(InputError, match="not at 100 Hz"):
        bench.sensor(rate=100)


def test_a_sensor_that_refuses_to_connect_is_one_sentence(make_bench: Benches) -> None:
    bench = make_bench()
    bench.dots[0].refuse_connections = 1
    with pytest.raises(DriverError, match="D4:22:CD:00:00:01: Bluetooth failed: le-connection-abort-by-local"):
        bench.sensor().kickoff()


def test_a_recording_of_two_sensors_through_a_lost_link_is_one_session(make_bench: Benches, tmp_path: Path) -> None:
    bench = make_bench(FakeDot("D4:22:CD:00:00:01"), FakeDot("D4:22:CD:00:00:02"))
    dots = [f"shank={bench.dots[0].address}", bench.dots[1].address]
    devices = open_devices([], dots, SystemClock(), bluetooth=bench.loop)
    for imu in devices.imus.values():
        imu._backoff_s = (0.01, 0.05)  # type: ignore[attr-defined]
    ended = threading.Event()

    def live() -> None:
        begin, sent = time.monotonic(), 0
        while not ended.wait(0.01):
            passed = time.monotonic() - begin
            for number in range(sent, int(passed * 60)):
                for dot in bench.dots:
                    if dot.streaming is not None:
                        dot.send(dot.payload(number))
                if number == 40:
                    bench.dots[0].drop_link()
            sent = int(passed * 60)

    life = threading.Thread(target=live)
    life.start()
    try:
        session = record_devices(devices, tmp_path, duration_s=1.5, name="gait")
    finally:
        ended.set()
        life.join()
    assert session.sensor_names == ["shank", "dot_D422CD000002"]
    assert session.analysis.estimate.filters == ["device", "vqf_6d"]
    lost = [event.details["sensor"] for event in session.events if event.event in {"disconnected", "reconnected"}]
    assert lost == ["shank", "shank"]
    for name in session.sensor_names:
        samples = session.imu(name)
        assert len(samples) > 60 and (np.diff(samples.device_time_ns) > 0).all()
        assert samples.device_q is not None
    result = analyse(session, with_report=False)
    assert set(result.estimate.sensors["shank"].orientation) == {"device", "vqf_6d"}


def test_without_bleak_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bleak", None)
    with pytest.raises(DriverError, match=r"imu-testbench\[ble\]"):
        import_bleak()


def test_the_stand_in_has_the_interface_of_bleak() -> None:
    bleak = pytest.importorskip("bleak")
    client, scanner = bleak.BleakClient, bleak.BleakScanner
    for stand_in, real in ((FakeClient, client), (FakeScanner, scanner)):
        for name in vars(stand_in):
            if not name.startswith("_") and name not in {"air", "dot", "loop"}:
                assert hasattr(real, name), name
    me, uuid = object(), MEDIUM_PAYLOAD  # every call of the driver, as it makes it
    inspect.signature(client.__init__).bind(me, object(), disconnected_callback=print)
    inspect.signature(client.connect).bind(me)
    inspect.signature(client.read_gatt_char).bind(me, uuid)
    inspect.signature(client.write_gatt_char).bind(me, uuid, b"", response=True)
    inspect.signature(client.start_notify).bind(me, uuid, print)
    inspect.signature(client.stop_notify).bind(me, uuid)
    inspect.signature(scanner.discover).bind(timeout=1.0, return_adv=True)
    inspect.signature(scanner.find_device_by_address).bind("", timeout=1.0)
