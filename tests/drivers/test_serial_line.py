"""The driver of serial boards, on pseudo-terminals and, where times are looked at, in lock step."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.drivers.imus.line_format import LineFormat
from testbench.drivers.imus.serial_line import LONGEST_LINE, SerialImu, open_serial_port
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError
from testbench.records.session.samples import ImuSamples
from tests.drivers.board_lines import line, make_format
from tests.drivers.pty_board import Board
from tests.lock_step.clock import LockStep
from tests.lock_step.serial_board import VirtualBoard

pytest.importorskip("serial")
S = 1_000_000_000
NEVER = 10**18
DEG = np.pi / 180


def wait_for(done: Callable[[], bool]) -> None:
    """Wait for what the driver's thread does with a pseudo-terminal."""
    deadline = time.monotonic() + 60
    while not done():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.002)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    board = Board(tmp_path)
    board.plug_in()
    yield board
    board.unplug()


Maker = Callable[..., SerialImu]


@pytest.fixture
def make_imu(board: Board) -> Iterator[Maker]:
    made: list[SerialImu] = []
    threads = threading.active_count()

    def make(line_format: LineFormat | None = None, **options: object) -> SerialImu:
        options = {"backoff_s": (0.02, 0.1)} | options
        imu = SerialImu(
            str(board.link), line_format or make_format(), SessionTime(SystemClock()), **options
        )  # type: ignore[arg-type]
        made.append(imu)
        imu.kickoff()
        return imu

    yield make
    for imu in made:
        imu.stop()
        imu.stop()
    assert threading.active_count() == threads  # nothing is left running


def everything(imu: SerialImu) -> ImuSamples:
    return imu.queue.take(NEVER)


def events_of(imu: SerialImu) -> dict[str, dict]:
    """Details of the last event of each kind; stops the sensor so that no tally is held back."""
    imu.stop()
    return {event.event: event.details for event in imu.events()}


def test_every_line_at_400_hz_arrives_with_its_values_and_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = LockStep()
    board = VirtualBoard(clock, monkeypatch, 400.0, line)
    imu = SerialImu("board", make_format(), SessionTime(clock), board.open)
    imu.kickoff()
    early = imu.read(S // 2)  # waits for that time
    assert clock.now_ns == 1_500_000_000
    clock.sleep(0.5)
    late = everything(imu)
    imu.stop()
    clock.close()
    # the first line is no sample, for it may be half a line
    assert abs(len(early) - 199) <= 1 and len(early) + len(late) == pytest.approx(399, abs=1)
    assert early.host_time_ns[-1] <= S // 2 <= late.host_time_ns[0]
    device = np.concatenate([early.device_time_ns, late.device_time_ns])
    host = np.concatenate([early.host_time_ns, late.host_time_ns])
    gyr = np.vstack([early.gyr, late.gyr])
    numbers = np.arange(len(device)) + device[0] // 2_500_000
    np.testing.assert_array_equal(device, numbers * 2_500_000)
    np.testing.assert_allclose(gyr[:, 0], DEG * (numbers % 200))
    np.testing.assert_allclose(
        early.acc, np.tile(9.80665 * np.array([0.5, -0.25, 1]), (len(early), 1))
    )
    np.testing.assert_array_equal(
        np.concatenate([early.counter, late.counter]), numbers - numbers[0]
    )
    np.testing.assert_array_equal(np.diff(host), 2_500_000)  # stamped as they come, not in lumps
    assert early.mag is None and early.device_q is None and not early.saturated.any()


def test_half_a_line_at_the_start_is_no_sample_even_if_it_looks_like_one(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu()
    board.send(
        b"0.5 0 0 1 0 0 0\r\n" + b"".join(line(k) for k in range(5))
    )  # the rest of "1230.5 0 0 1 0 0 0"
    wait_for(lambda: imu.queue.received == 5)
    assert everything(imu).device_time_ns[0] == 0
    assert events_of(imu)["partial_lines"]["count"] == 1


def test_garbage_is_counted_and_costs_only_itself(board: Board, make_imu: Maker) -> None:
    imu = make_imu()
    noise = np.random.default_rng(3).integers(128, 256, 50, dtype=np.uint8).tobytes()
    broken = [noise + b"\n", b"12 0.5\n", line(2)[:-9] + line(3), b"\0" * 20 + b"\n"]
    board.send(b"\n" + line(0) + line(1) + b"".join(broken) + b"# comment\n\n" + line(4) + line(5))
    wait_for(lambda: imu.queue.received == 4)
    samples = everything(imu)
    np.testing.assert_array_equal(samples.counter, [0, 1, 4, 5])
    happened = events_of(imu)
    assert happened["malformed_lines"]["count"] == 4 and "why" in happened["malformed_lines"]
    assert happened["samples_lost"]["count"] == 2
    assert imu.statistics()["malformed_lines"] == 4


def test_a_wrong_speed_that_never_ends_a_line_does_not_fill_the_memory(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu()
    board.send(b"x" * (LONGEST_LINE + 1))
    wait_for(lambda: "malformed_lines" in imu.notices.totals)
    board.send(b"x" * 500 + b"\n" + line(0))
    wait_for(lambda: imu.queue.received == 1)
    assert "no end within" in events_of(imu)["malformed_lines"]["why"]


def test_one_wrong_digit_in_a_time_loses_one_sample_and_not_the_clock(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu()
    board.send(b"\n" + line(0) + line(1) + b"9999999 0 0 1 0 0 0\n" + line(3) + line(4))
    wait_for(lambda: imu.queue.received == 4)
    np.testing.assert_array_equal(
        everything(imu).device_time_ns, np.array([0, 1, 3, 4]) * 2_500_000
    )
    happened = events_of(imu)
    assert (
        happened["untimely_lines"]["stamp_s"] == 9999.999
        and "device_clock_restarted" not in happened
    )


def test_a_board_that_reboots_is_noticed_and_its_time_goes_on(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu()
    board.send(
        b"\n" + b"".join(line(k) for k in range(1000, 1003)) + b"".join(line(k) for k in range(3))
    )
    wait_for(lambda: imu.queue.received == 5)
    times = everything(imu).device_time_ns
    assert (np.diff(times) > 0).all() and times[-1] - times[0] < 2 * S
    assert events_of(imu)["device_clock_restarted"]["device_time_s"] == pytest.approx(0.0025)


def test_a_board_that_is_unplugged_is_found_again_and_the_gap_is_known(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu()
    board.send(b"\n" + b"".join(line(k) for k in range(10)))
    wait_for(lambda: imu.queue.received == 10)
    board.unplug()
    wait_for(lambda: "disconnected" in imu.notices.totals)
    time.sleep(0.15)  # the gap
    board.plug_in()
    wait_for(lambda: "reconnected" in imu.notices.totals)
    board.send(
        b"\n" + b"".join(line(k) for k in range(10))
    )  # it booted anew: its clock begins at 0
    wait_for(lambda: imu.queue.received >= 19)
    samples = everything(imu)
    assert (np.diff(samples.device_time_ns) > 0).all()
    gap = samples.device_time_ns[10] - samples.device_time_ns[9]
    assert gap == pytest.approx(samples.host_time_ns[10] - samples.host_time_ns[9], abs=20e6)
    assert samples.counter[10] - samples.counter[9] == round(gap / 2_500_000)
    happened = events_of(imu)
    assert 0.15 <= happened["reconnected"]["gap_s"] < 2 and happened["reconnected"]["attempts"] >= 1
    assert happened["disconnected"]["reason"]


def test_nobody_reading_never_blocks_the_board_and_every_dropped_sample_is_counted(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu(queue_s=0.25)  # 100 samples
    begin = time.monotonic()
    board.send(b"\n" + b"".join(line(k) for k in range(2000)))  # twenty times the kernel's buffer
    assert time.monotonic() - begin < 30
    wait_for(lambda: imu.notices.totals.get("samples_dropped") == 1900)
    kept = everything(imu)
    np.testing.assert_array_equal(
        kept.counter, np.arange(100)
    )  # a bounded queue, and what is in it is whole
    board.send(line(2000))
    wait_for(lambda: imu.queue.received == 101)
    assert everything(imu).counter[0] == 2000  # what was dropped shows in the counter
    assert events_of(imu)["samples_dropped"]["count"] == 1900


def test_a_board_that_falls_silent_is_an_event(
    board: Board, make_imu: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("testbench.drivers.imus.serial_line.SILENCE_S", 0.05)
    imu = make_imu()
    board.send(b"\n" + line(0))
    wait_for(lambda: "silent" in imu.notices.totals)
    board.send(line(80))
    wait_for(lambda: "heard_again" in imu.notices.totals)
    assert events_of(imu)["heard_again"]["gap_s"] > 0.05


def test_a_board_is_told_to_start_and_to_stop_and_what_it_said_while_booting_is_forgotten(
    board: Board, make_imu: Maker
) -> None:
    imu = make_imu(make_format(start_command="go\n", stop_command="halt\n", settle_s=0.1))
    board.send(b"\n" + line(0) + line(1))
    wait_for(lambda: board.listen() == b"go\n")
    board.send(b"\n" + line(50))
    wait_for(lambda: imu.queue.received == 1)
    assert everything(imu).device_time_ns[0] == 125_000_000
    imu.stop()
    assert board.listen() == b"go\nhalt\n"


def test_a_temperature_column_is_kept_as_events(board: Board, make_imu: Maker) -> None:
    columns = [
        *make_format().model_dump()["columns"],
        {"quantity": "temperature", "counts_per_unit": 340, "zero_counts": -12420.2},
    ]
    imu = make_imu(make_format(columns=columns))
    board.send(b"\n" + line(0).strip() + b" -512\n")
    wait_for(lambda: imu.queue.received == 1)
    assert events_of(imu)["temperature"]["temperature_degC"] == pytest.approx(35.024)


def test_a_port_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    imu = SerialImu(str(tmp_path / "nothing"), make_format(), SessionTime(SystemClock()))
    with pytest.raises(DriverError, match=r"nothing cannot be opened: No such file or directory$"):
        imu.kickoff()
    imu.stop()


def test_without_pyserial_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(DriverError, match=r"imu-testbench\[serial\]"):
        open_serial_port("/dev/null", 9600)


def test_a_reader_that_fails_is_not_silent(
    board: Board, make_imu: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    imu = make_imu()
    monkeypatch.setattr(imu._parser, "parse", lambda raw: 1 / 0)
    board.send(b"\n" + line(0))
    wait_for(lambda: imu._failure is not None)
    with pytest.raises(DriverError, match="ZeroDivisionError"):
        imu.read(0)


# A board that is listened to before an arm moves


def heard_of(trial: SerialImu, patience_s: float = 3.0) -> None:
    trial.kickoff()
    try:
        trial.wait_for_sample("hand", patience_s)
    finally:
        trial.stop()


def test_a_board_that_delivers_is_let_go_of_and_can_be_started(
    board: Board, make_imu: Maker
) -> None:
    imu = SerialImu(str(board.link), make_format(), SessionTime(SystemClock()))
    sender = threading.Thread(target=board.send_steadily, args=(0, 120, 100.0))
    sender.start()
    heard_of(imu.trial())
    assert imu.queue.received == 0 and imu.statistics() == {"samples": 0}
    started = make_imu()
    wait_for(lambda: started.queue.received > 5)
    sender.join()


def test_a_board_of_another_format_is_told_with_a_line_and_what_is_wrong_with_it(
    board: Board,
) -> None:
    imu = SerialImu(str(board.link), make_format(), SessionTime(SystemClock()))

    ended = threading.Event()

    def send() -> None:
        k = 0
        while not ended.wait(0.01):  # m/s^2 where the format says g
            board.send(b"%d 0.1 0.2 9.81 0 0 0\n" % k)
            k += 1

    sender = threading.Thread(target=send)
    sender.start()
    with pytest.raises(
        DriverError,
        match=r"sensor hand, .* lines arrive but none fits the format: .*'[0-9]+ 0\.1 0\.2 9\.81",
    ):
        heard_of(imu.trial(), 0.5)
    ended.set()
    sender.join()


def test_a_board_that_says_nothing_is_told_before_anything_depends_on_it(board: Board) -> None:
    imu = SerialImu(str(board.link), make_format(), SessionTime(SystemClock()))
    with pytest.raises(DriverError, match="nothing arrives"):
        heard_of(imu.trial(), 0.1)
