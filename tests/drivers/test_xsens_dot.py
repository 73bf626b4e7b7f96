"""The driver of the Xsens DOT against GATT servers that stand in for bleak's client."""

from __future__ import annotations

import asyncio
import inspect
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from testbench.drivers.imus.bluetooth import import_bleak
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_payload import MEDIUM_PAYLOAD
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, InputError, NotFoundError
from testbench.execution.device_recorder import record_devices
from testbench.execution.devices import open_devices
from testbench.pipeline.analyse import analyse
from tests.asking import analysis
from tests.conftest import FakeClock
from tests.drivers.fake_dots import TICK_US, Bench, FakeClient, FakeDot, FakeScanner, G, events_of

NEVER = 10**18


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


def numbers(samples: Any) -> list[int]:
    """Which samples they are, by their first rate."""
    return [round(value) for value in np.degrees(samples.gyr[:, 0])]


def test_a_sensor_is_set_up_started_and_stopped_in_the_order_of_the_specification(
    make_bench: Benches,
) -> None:
    bench = make_bench(FakeDot("D4:22:CD:00:00:01", rate=20))
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    dot.send(*(dot.payload(k) for k in range(30)))
    bench.until(lambda: sensor.queue.received == 26)  # four are held back for late ones
    samples = samples_of(sensor)
    assert numbers(samples) == list(range(30))
    np.testing.assert_array_equal(samples.device_time_ns, np.arange(30) * TICK_US * 1000)
    np.testing.assert_array_equal(samples.counter, np.arange(30))
    np.testing.assert_allclose(samples.acc, np.tile([0, 0, G], (30, 1)), rtol=1e-6)
    np.testing.assert_array_equal(samples.device_q, np.tile([1, 0, 0, 0], (30, 1)))
    assert (np.diff(samples.host_time_ns) >= 0).all() and samples.mag is None
    assert dot.log == ["rate 60", "start 26", "stop 26", "disconnect"] and dot.notify == {}
    about = sensor.describe()
    assert (
        about["firmware"] == "2.0.0" and about["tag"] == "thigh" and about["battery_percent"] == 87
    )
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
    bench.until(lambda: all(sensor.queue.received == 46 for sensor in sensors))
    for i, sensor in enumerate(sensors):
        assert numbers(samples_of(sensor)) == list(range(100 * i, 100 * i + 50))


def test_packets_that_come_late_twice_or_never_are_put_right_and_counted(
    make_bench: Benches,
) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    order = [
        0,
        1,
        2,
        4,
        3,
        5,
        5,
        6,
        9,
        10,
        11,
        12,
        13,
        14,
        15,
        7,
        16,
    ]  # 8 is lost; 7 comes when it is too late
    dot.send(*(dot.payload(k) for k in order), bytearray(10))
    bench.until(lambda: "malformed_packets" in sensor.notices.totals)
    samples = samples_of(sensor)
    assert numbers(samples) == [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13, 14, 15, 16]
    np.testing.assert_array_equal(samples.counter, numbers(samples))
    assert (np.diff(samples.device_time_ns) > 0).all()
    counts = {key: value["count"] for key, value in events_of(sensor).items() if "count" in value}
    assert counts == {
        "reordered_packets": 1,
        "repeated_samples": 1,
        "late_packets": 1,
        "samples_lost": 2,
        "malformed_packets": 1,
    }


def test_the_32_bit_stamp_wraps_and_time_goes_on(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    first = 2**32 - 10 * TICK_US
    order = [*range(9), 10, 9, *range(11, 30)]  # the packets at the wrap itself change places
    dot.send(*(dot.payload(k, first + k * TICK_US) for k in order))
    bench.until(lambda: sensor.queue.received == 26)
    samples = samples_of(sensor)
    np.testing.assert_array_equal(samples.device_time_ns, (first + np.arange(30) * TICK_US) * 1000)
    assert numbers(samples) == list(range(30)) and "samples_lost" not in events_of(sensor)


@pytest.mark.parametrize("restarts", [False, True])
def test_a_lost_link_is_made_again_and_the_gap_is_known(
    make_bench: Benches, restarts: bool
) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(), bench.dots[0]
    sensor.kickoff()
    dot.send(*(dot.payload(k, 5_000_000 + k * TICK_US) for k in range(20)))
    bench.until(lambda: sensor.queue.received == 16)
    dot.refuse_connections = 2
    lost = bench.time.now_ns()
    dot.drop_link()
    bench.until(lambda: "disconnected" in sensor.notices.totals)
    bench.clock.sleep(0.3)
    bench.until(lambda: "reconnected" in sensor.notices.totals)
    passed = (bench.time.now_ns() - lost) // 1000
    begin = 0 if restarts else 5_000_000 + 19 * TICK_US + passed
    dot.send(*(dot.payload(100 + k, begin + k * TICK_US) for k in range(10)))
    bench.until(lambda: sensor.queue.received >= 26)
    samples = samples_of(sensor)
    assert numbers(samples) == [
        *range(20),
        *range(100, 110),
    ]  # what was held back when the link broke is there
    assert (np.diff(samples.device_time_ns) > 0).all()
    gap = samples.device_time_ns[20] - samples.device_time_ns[19]
    assert gap == pytest.approx(samples.host_time_ns[20] - samples.host_time_ns[19], abs=20e6)
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
    bench.until(lambda: sensor.notices.totals.get("reconnect_failed", 0) >= 2)
    sensor.stop()
    assert bench.tasks() == 0


def test_nobody_reading_drops_samples_and_counts_them(make_bench: Benches) -> None:
    bench = make_bench()
    sensor, dot = bench.sensor(queue_s=0.5), bench.dots[0]  # 30 samples
    sensor.kickoff()
    dot.send(*(dot.payload(k) for k in range(100)))
    bench.until(lambda: sensor.notices.totals.get("samples_dropped") == 66)
    assert numbers(samples_of(sensor)) == list(range(30))


def test_scanning_finds_dots_and_nothing_else_and_a_name_is_enough_if_it_is_unique(
    make_bench: Benches,
) -> None:
    bench = make_bench(
        FakeDot("D4:22:CD:00:00:01", "Movella DOT"),
        FakeDot("D4:22:CD:00:00:02"),
        FakeDot("D4:22:CD:00:00:03"),
    )
    found = bench.loop.scan(0)
    assert [dot["address"][-1] for dot in found] == ["3", "2", "1"]  # strongest first
    sensor = bench.sensor("movella dot")
    sensor.kickoff()
    assert sensor.describe()["address"] == "D4:22:CD:00:00:01"
    with pytest.raises(
        InputError, match="2 sensors have this name; use D4:22:CD:00:00:03 or D4:22:CD:00:00:02"
    ):
        bench.sensor("Xsens DOT").kickoff()
    with pytest.raises(DriverError, match="not heard; sensors that were: Xsens DOT"):
        bench.sensor("Polar").kickoff()
    with pytest.raises(DriverError, match="Xsens DOT D4:22:CD:00:00:09: it was not heard"):
        bench.sensor("D4:22:CD:00:00:09").kickoff()


def test_what_cannot_be_recorded_is_refused_before_anything_is_connected(
    make_bench: Benches,
) -> None:
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
    with pytest.raises(
        DriverError, match="D4:22:CD:00:00:01: Bluetooth failed: le-connection-abort-by-local"
    ):
        bench.sensor().kickoff()


class Streaming(FakeClock):
    """Time in which the sensors send at 60 Hz; the first loses its link after 40 packets, and
    nothing goes on until it is back.
    """

    def __init__(self, bench: Bench):
        super().__init__()
        self.bench, self.sent = bench, 0

    def sleep(self, seconds: float) -> None:
        super().sleep(seconds)
        due = round((self.now_ns - 1_000_000_000) * 60e-9)
        for number in range(self.sent, due):
            for dot in self.bench.dots:
                if dot.streaming is not None:
                    dot.send(dot.payload(number))
            if number == 40:
                self.bench.dots[0].drop_link()
                self.bench.until(lambda: self.bench.dots[0].connections == 2)
                self.bench.until(lambda: self.bench.dots[0].streaming is not None)
        self.sent = max(due, self.sent)
        self.bench.loop.call(asyncio.sleep(0), 30)  # what was sent is heard


def test_a_recording_of_two_sensors_through_a_lost_link_is_one_session(
    make_bench: Benches, tmp_path: Path
) -> None:
    bench = make_bench(FakeDot("D4:22:CD:00:00:01"), FakeDot("D4:22:CD:00:00:02"))
    dots = [f"shank={bench.dots[0].address}", bench.dots[1].address]
    clock = Streaming(bench)
    devices = open_devices([], dots, SessionTime(clock), bluetooth=bench.loop)
    for imu in devices.imus.values():
        imu._backoff_s = (0.01, 0.05)  # type: ignore[attr-defined]
    session = record_devices(devices, tmp_path, duration_s=1.5, name="gait")
    assert session.sensor_names == ["shank", "dot_D422CD000002"]
    assert session.analysis.estimate.filters == ["device", "vqf_6d"]
    lost = [
        event.details["sensor"]
        for event in session.events
        if event.event in {"disconnected", "reconnected"}
    ]
    assert lost == ["shank", "shank"]
    for name in session.sensor_names:
        samples = session.imu(name)
        assert len(samples) > 60 and (np.diff(samples.device_time_ns) > 0).all()
        assert samples.device_q is not None
    result = analyse(session, analysis())
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
