"""Boards on pseudo-terminals that go wrong while they are recorded: each is said on the terminal
within two seconds, and kept as an event, and what is sound is not spoken of.
"""

from __future__ import annotations

import math
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.drivers.imus.line_format import LineFormat
from testbench.drivers.imus.serial_line import SerialImu
from testbench.drivers.session_time import SessionTime
from testbench.execution import RunOptions
from testbench.execution.device_recorder import DeviceRecorder, record_devices
from testbench.execution.devices import Devices
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import RunStatus, Session
from tests.drivers.board_lines import make_format
from tests.drivers.pty_board import Board

pytest.importorskip("serial")
RATE = 100.0
BEGINS = 100
"""The number of the line at which a board goes wrong."""
AGAIN = 40
"""An unplugged board is plugged in again so many lines later."""
BURST = 80
NOTICED_S = 2.0
COUNTED = make_format(
    rate_hz=RATE,
    columns=[
        {"quantity": "counter", "wrap_bits": 8},
        {"quantity": "time", "unit": "ms", "wrap_bits": 16},
        {"quantity": "acceleration", "unit": "g", "full_scale": 2.0},
        {"quantity": "angular_rate", "unit": "deg/s", "full_scale": 250.0},
    ],
)
PLAIN = make_format(rate_hz=RATE)
NOISE = np.random.default_rng(7).integers(0, 256, (1000, 40), dtype=np.uint8)


def reading(k: int) -> str:
    wobble, other = 0.01 * math.sin(3 * k), 0.01 * math.cos(3 * k)
    return f"{wobble:.4f} {other:.4f} {1 - wobble:.4f} {wobble:.4f} {20 + other:.4f} {wobble:.4f}\n"


def sound(k: int) -> bytes:
    return f"{k * 1000 / RATE:.0f} {reading(k)}".encode()


def frozen(k: int) -> bytes:
    """Readings go on, the time does not."""
    return f"{min(k, BEGINS) * 1000 / RATE:.0f} {reading(k)}".encode()


def same(k: int) -> bytes:
    return sound(min(k, BEGINS))


def mute(k: int) -> bytes:
    return sound(k) if k < BEGINS else b""


def fast(k: int) -> bytes:
    """Another speed of the line: what arrives are other bytes, an end of line now and then."""
    return sound(k) if k < BEGINS else NOISE[k % len(NOISE)].tobytes()


def bursts(k: int) -> bytes:
    if k < BEGINS:
        return sound(k)
    through = (k - BEGINS) % BURST == BURST - 1
    return b"".join(sound(own) for own in range(k - BURST + 1, k + 1)) if through else b""


def wraps(k: int) -> bytes:
    """Counter and time come to their ends."""
    at = BEGINS + 256
    time_ms = (round((k - BEGINS) * 1000 / RATE)) % 2**16
    return f"{(at + k) % 256} {time_ms} {reading(k)}".encode()


LINES: dict[str, Callable[[int], bytes]] = {
    own.__name__: own for own in (sound, frozen, same, mute, fast, bursts, wraps)
} | {"unplugged": sound}
SAID = {
    "frozen": r"stuck time of frozen: [\d.]+ s",
    "same": r"stuck reading of same: [\d.]+ s",
    "mute": r"mute: it sends nothing",
    "fast": r"fast: \d+ lines within a second do not fit its format.* is the speed of the line",
    "bursts": r"arrival gap of bursts: [\d.]+ s",
    "unplugged": r"unplugged: its connection was lost",
}
EVENTS = {
    "frozen": "guard",
    "same": "guard",
    "mute": "silent",
    "fast": "malformed_lines",
    "bursts": "guard",
    "unplugged": "disconnected",
}


class Bench:
    """Boards, fed by one thread; what was said of them, and when.

    Args:
        folder: For the links to their ports.
        names: Of the boards.

    Attributes:
        struck: When each began to go wrong, by the machine's monotonic time [s].
        latest: By how much a line came later than it was due, at most [s]: this machine is busy.
    """

    def __init__(self, folder: Path, names: Iterable[str]):
        self.boards = {name: Board(folder, name) for name in names}
        self.said: list[tuple[float, str]] = []
        self.struck = self.latest = 0.0
        self.ended = threading.Event()
        for name in names:
            self._plug_in(name)
        self.thread = threading.Thread(target=self._feed)

    def _plug_in(self, name: str) -> None:
        self.boards[name].plug_in()
        os.set_blocking(self.boards[name].master, False)  # a board waits for nobody

    def hear(self, line: str) -> None:
        self.said.append((time.monotonic(), line))

    def _feed(self) -> None:
        begin = time.monotonic()
        self.struck = begin + BEGINS / RATE
        k = 0
        while not self.ended.wait(max(begin + k / RATE - time.monotonic(), 0)):
            self.latest = max(self.latest, time.monotonic() - begin - k / RATE)
            if k == BEGINS and "unplugged" in self.boards:
                self.boards["unplugged"].unplug()
            elif k == BEGINS + AGAIN and "unplugged" in self.boards:
                self._plug_in("unplugged")
            for name, board in self.boards.items():
                with suppress(BlockingIOError):
                    if board.master >= 0:
                        os.write(board.master, LINES[name](k))
            k += 1

    def close(self) -> None:
        self.ended.set()
        self.thread.join()
        for board in self.boards.values():
            board.unplug()


def imu_of(board: Board, line_format: LineFormat, clock: SessionTime, **more: float) -> SerialImu:
    return SerialImu(str(board.link), line_format, clock, **more)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Bench, Session]]:
    """All boards in one recording of four seconds."""
    bench = Bench(tmp_path_factory.mktemp("boards"), LINES)
    clock = SessionTime(SystemClock())
    imus = {
        name: imu_of(board, COUNTED if name == "wraps" else PLAIN, clock)
        for name, board in bench.boards.items()
    }
    bench.thread.start()
    try:
        options = RunOptions(say=bench.hear)
        logs = tmp_path_factory.mktemp("logs")
        session = record_devices(Devices(dict(imus), clock), logs, 4.0, options=options)
        yield bench, session
    finally:
        bench.close()


@pytest.mark.parametrize("name", SAID)
def test_a_board_that_goes_wrong_is_told_within_two_seconds_and_kept_as_an_event(recorded, name):
    bench, session = recorded
    told = [when for when, line in bench.said if re.search(SAID[name], line)]
    assert told, bench.said
    late = told[0] - bench.struck
    assert 0 < late <= NOTICED_S + 5 * bench.latest
    kept = [
        event
        for event in session.events
        if event.event == EVENTS[name]
        and name in {event.details.get("sensor"), event.details.get("subject")}
    ]
    assert kept
    assert session.status is RunStatus.COMPLETED and len(session.imu(name)) > 50


def test_a_board_that_is_plugged_in_again_is_recorded_on(recorded):
    bench, session = recorded
    (again,) = [line for _, line in bench.said if "unplugged: it is connected again" in line]
    (event,) = [event for event in session.events if event.event == "reconnected"]
    assert event.details["sensor"] == "unplugged" and f"{event.details['gap_s']:.3g} s" in again
    samples = session.imu("unplugged")
    assert (np.diff(samples.device_time_ns) > 0).all()
    assert samples.host_time_ns[-1] > event.host_time_ns


@pytest.mark.parametrize("name", ["sound", "wraps"])
def test_of_a_board_that_works_nothing_is_said_also_where_its_counters_come_to_their_ends(
    recorded, name
):
    bench, session = recorded
    samples = session.imu(name)
    np.testing.assert_array_equal(np.diff(samples.device_time_ns), 10_000_000)
    np.testing.assert_array_equal(np.diff(samples.counter), 1)
    lost = {"samples_lost", "device_clock_restarted", "untimely_lines", "repeated_samples"}
    told = {event.event for event in session.events if event.details.get("sensor") == name}
    assert not told & lost
    spoken = [line for _, line in bench.said if re.search(rf"\b{name}\b", line)]
    assert spoken == [] or bench.latest > 0.3


def test_a_recorder_that_is_slower_than_a_board_says_what_it_dropped(tmp_path, monkeypatch):
    bench = Bench(tmp_path, ["sound"])
    clock = SessionTime(SystemClock())
    board = imu_of(bench.boards["sound"], PLAIN, clock, queue_s=0.3)
    plain, held = DeviceRecorder.sensor_samples, []

    def slow(recorder: DeviceRecorder, imus: dict[str, ImuSamples]) -> None:
        if not held and recorder.counts()["sound"] > 30:
            held.append(time.monotonic())
            threading.Event().wait(1.0)  # a disk that takes so long
        plain(recorder, imus)

    monkeypatch.setattr(DeviceRecorder, "sensor_samples", slow)
    bench.thread.start()
    try:
        options = RunOptions(say=bench.hear)
        devices = Devices({"sound": board}, clock)
        session = record_devices(devices, tmp_path / "logs", 3.0, options=options)
    finally:
        bench.close()
    (told,) = [when for when, line in bench.said if "samples were dropped" in line]
    assert told - held[0] <= NOTICED_S + 5 * bench.latest
    (event,) = [event for event in session.events if event.event == "samples_dropped"]
    dropped = event.details["count"]
    assert (
        30 < dropped == session.manifest.sensors["sound"].written()["statistics"]["samples_dropped"]
    )
    assert any(own.code == "device.dropped" for own in session.manifest.findings)
    assert np.diff(session.imu("sound").counter).max() == dropped + 1
