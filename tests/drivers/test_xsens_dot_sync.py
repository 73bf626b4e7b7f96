"""Synchronisation of Xsens DOTs: messages against the examples of the specification, the procedure
against GATT servers.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from testbench.drivers.imus import xsens_dot_messages, xsens_dot_sync
from testbench.drivers.imus.bluetooth import BluetoothLoop
from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_messages import (
    GET_STATUS,
    MESSAGE_NOTIFICATION,
    STOP,
    message,
    parse,
    start_message,
)
from testbench.drivers.imus.xsens_dot_sync import synchronise
from testbench.exceptions import DriverError, InputError
from testbench.execution.devices import open_devices
from tests.drivers.fake_dots import Bench, FakeClient, FakeDot, FakeScanner, events_of

ROOT, OTHER, THIRD = "D4:22:CD:AA:BB:CC", "D4:22:CD:00:00:02", "D4:22:CD:00:00:03"


def test_messages_are_those_of_the_specification() -> None:
    # Section 5.3.1 of XD0506P, byte for byte.
    assert message(GET_STATUS) == bytes.fromhex("0201 08 F5")
    assert message(STOP) == bytes.fromhex("0201 02 FB")
    assert start_message(ROOT) == bytes.fromhex("0207 01 CCBBAACD22D4 02")
    assert parse(bytes.fromhex("0202 5109 A2")) == (0x51, b"\x09")
    assert parse(bytes.fromhex("0202 5104 A7") + bytes(155)) == (
        0x51,
        b"\x04",
    )  # the characteristic is longer
    assert parse(bytes.fromhex("0202 0300 F9")) == (0x03, b"\x00")
    assert parse(bytes.fromhex("0202 5000 AC")) == (0x50, b"\x00")


@pytest.mark.parametrize(
    "data", ["", "0202", "0202 5109 A3", "0102 5109 A3", "0209 5109 A2", "0200 FE 00"]
)
def test_what_is_no_message_of_synchronisation_is_none(data: str) -> None:
    assert parse(bytes.fromhex(data)) is None


class SyncDot(FakeDot):
    """A DOT that can be synchronised; `results` are what its attempts come to."""

    def __init__(self, address: str, *results: int, synced: bool = False):
        super().__init__(address)
        self.results, self.synced, self.listening, self.mute = list(results), synced, "", False
        self.acknowledge = bytes(160)

    def finish(self) -> None:
        """The host has let go: the sensors listen to each other."""
        if self.listening:
            result = self.results.pop(0) if self.results else 0
            self.synced = result == 0
            echoed = bytes((0x01,)) + bytes.fromhex(self.listening.replace(":", ""))[::-1]
            body = bytes((0x02, 2 + len(echoed), 0x03, result)) + echoed
            self.acknowledge = (body + bytes((-sum(body) & 0xFF,))).ljust(160, b"\0")
            self.listening = ""


class SyncClient(FakeClient):
    """The message service beside the others."""

    dot: SyncDot  # type: ignore[assignment]

    async def disconnect(self) -> None:
        await super().disconnect()
        self.dot.finish()

    async def read_gatt_char(self, uuid: str) -> bytearray:
        if uuid.startswith("15177002"):
            self._up()
            return bytearray(self.dot.acknowledge)
        return await super().read_gatt_char(uuid)

    async def write_gatt_char(self, uuid: str, data: bytes, response: bool) -> None:
        self._up()
        dot = self.dot
        if uuid.startswith("15171002"):
            assert not dot.synced, "the output rate cannot be changed once a sensor is synchronised"
        if not uuid.startswith("15177001"):
            return await super().write_gatt_char(uuid, data, response)
        assert response and sum(data) % 256 == 0 and data[0] == 0x02 and data[1] == len(data) - 3
        if data[2] == 0x01:
            assert not dot.synced and dot.streaming is None and len(data) == 10
            dot.listening = ":".join(f"{byte:02X}" for byte in reversed(data[3:9]))
            dot.log.append(f"sync {dot.listening[-2:]}")
            return None
        assert MESSAGE_NOTIFICATION in dot.notify, "notifications must be enabled first"
        if dot.mute:
            return None
        if data[2] == 0x08:
            answer = bytes((0x02, 0x02, 0x51, 0x04 if dot.synced else 0x09))
        else:
            assert data[2] == 0x02 and dot.synced, "only a synchronised sensor can be stopped"
            dot.synced, answer = False, bytes((0x02, 0x02, 0x50, 0x00))
            dot.log.append("unsync")
        packet = bytearray(answer + bytes((-sum(answer) & 0xFF,)))
        asyncio.get_running_loop().call_soon(dot.notify[MESSAGE_NOTIFICATION], None, packet)
        return None


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[Any]:
    made: list[Bench] = []

    def make(*dots: SyncDot) -> Bench:
        own = Bench(*dots)
        own.loop.close()
        air = {"air": {dot.address: dot for dot in dots}}
        own.loop = BluetoothLoop(
            type("Client", (SyncClient,), air), type("Scanner", (FakeScanner,), air)
        )
        made.append(own)
        return own

    yield make
    for own in made:
        own.close()


def connected(bench: Bench) -> list[XsensDot]:
    sensors = [bench.sensor(i) for i in range(len(bench.dots))]
    for sensor in sensors:
        sensor.connect()
    return sensors


def test_sensors_listen_to_the_first_while_they_are_let_go_and_then_stream(bench: Any) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER), SyncDot(THIRD))
    sensors = connected(own)
    synchronise(sensors, 0.01)
    for sensor, dot in zip(sensors, own.dots, strict=True):
        assert dot.synced and dot.connections == 2 and dot.log == ["sync CC", "disconnect"]
        assert sensor.describe()["sync_root"] == ROOT
        sensor.kickoff()
    for sensor, dot in zip(sensors, own.dots, strict=True):
        assert events_of(sensor)["synchronised"] == {"root": ROOT}
        assert dot.log[2:] == ["start 26", "stop 26", "unsync", "disconnect"] and not dot.synced


def test_a_sensor_that_is_synchronised_already_is_stopped_first(bench: Any) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER, synced=True))
    synchronise(connected(own), 0.01)
    assert own.dots[0].log == ["sync CC", "disconnect"] and own.dots[1].log == [
        "unsync",
        "sync CC",
        "disconnect",
    ]


def test_one_failure_is_tried_again_with_all_of_them(bench: Any) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER, 0x05))
    sensors = connected(own)
    synchronise(sensors, 0.01)
    assert own.dots[0].log == ["sync CC", "disconnect", "unsync", "sync CC", "disconnect"]
    assert own.dots[1].log == ["sync CC", "disconnect", "sync CC", "disconnect"]
    assert events_of(sensors[1])["synchronisation_failed"] == {
        "reason": "it heard too little of the root"
    }


def test_failing_twice_names_the_sensor_and_leaves_none_synchronised(bench: Any) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER, 0x07, 0x08))
    with pytest.raises(
        DriverError,
        match=rf"synchronised: Xsens DOT {OTHER}: it started at a wrong time; .*--dot-sync",
    ):
        synchronise(connected(own), 0.01)
    assert not any(dot.synced for dot in own.dots)


def test_a_connection_that_fails_after_listening_is_tried_again(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER))
    sensors = connected(own)
    monkeypatch.setattr(XsensDot, "wait", lambda self, seconds: None)
    own.dots[1].refuse_connections = 2
    synchronise(sensors, 0.01)
    assert own.dots[1].synced and own.dots[1].refuse_connections == 0


def test_an_old_firmware_that_does_not_answer_is_named(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER))
    own.dots[1].mute = True
    monkeypatch.setattr(xsens_dot_messages, "ANSWER_S", 0.05)
    with pytest.raises(DriverError, match=f"Xsens DOT {OTHER}: it does not answer"):
        synchronise(connected(own), 0.01)
    assert own.dots[0].log == []  # nothing was begun


def test_devices_are_synchronised_before_any_of_them_streams(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = bench(SyncDot(ROOT), SyncDot(OTHER))
    monkeypatch.setattr(xsens_dot_sync, "LISTEN_S", 0.01)
    devices = open_devices([], [ROOT, OTHER], bluetooth=own.loop, synchronise_dots=True)
    devices.kickoff()
    assert [dot.log for dot in own.dots] == [["sync CC", "disconnect", "start 26"]] * 2
    devices.close()
    assert not any(dot.synced for dot in own.dots)


def test_a_single_sensor_has_nobody_to_be_synchronised_with(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="several DOTs together; there is one"):
        open_devices([], [ROOT], synchronise_dots=True)
