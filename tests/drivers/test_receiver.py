"""What a controller sends is taken in with the time at which it arrived, whoever is busy; a
process that serves one client library may be kept from new connections.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.drivers.arms import receiver as receiver_module
from testbench.drivers.arms.receiver import CLOSED, Receiver
from testbench.drivers.arms.rtde import RtdeStream
from testbench.drivers.arms.standing import RestWatch, Standing
from testbench.drivers.arms.ur_client import VARIABLES
from testbench.drivers.arms.ur_outside import nonsense, program_moves
from tests.emulated_arms import ROOT
from tests.lock_step.bench import virtual_bench


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Both ends of a connection over TCP."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        ours = socket.create_connection(listener.getsockname())
        theirs, _ = listener.accept()
    with ours, theirs:
        yield ours, theirs


@pytest.mark.skipif(sys.platform != "linux", reason="other kernels do not stamp what arrives")
def test_a_piece_has_the_time_at_which_the_kernel_took_it_in_not_that_of_reading_it(ends):
    receiver = Receiver(ends[0], SystemClock(), threaded=True)
    with receiver._lock:  # a process that is held up
        sent_ns = time.monotonic_ns()
        ends[1].sendall(b"report")
        gone_ns = time.monotonic_ns()
        threading.Event().wait(0.3)
    end = time.monotonic() + 10
    while not (pieces := receiver.take()) and time.monotonic() < end:
        pass
    (arrived_ns, data) = pieces[0]
    assert data == b"report"
    assert sent_ns - 1_000_000 <= arrived_ns < gone_ns + 200_000_000
    receiver.close()


@pytest.mark.parametrize("hours", [-1, 1], ids=["back", "forward"])
def test_a_clock_of_this_machine_that_is_set_moves_no_arrival(ends, monkeypatch, hours):
    """What lies in the socket has the kernel's stamp by the clock as it was."""
    receiver = Receiver(ends[0], SystemClock(), threaded=True)
    with receiver._lock:
        sent_ns = time.monotonic_ns()
        ends[1].sendall(b"before")
        threading.Event().wait(0.05)
        monkeypatch.setattr(
            receiver_module, "real_time_ns", lambda: time.time_ns() + hours * 3600 * 10**9
        )
    end = time.monotonic() + 10
    while not (pieces := receiver.take()) and time.monotonic() < end:
        pass
    assert sent_ns - 1_000_000 <= pieces[0][0] <= time.monotonic_ns()
    receiver.close()


def test_what_ended_a_connection_is_kept_and_what_came_before_is_given(ends):
    receiver = Receiver(ends[0], SystemClock())
    ends[1].sendall(b"last words")
    ends[1].close()
    assert b"".join(piece for _, piece in receiver.take()) == b"last words"
    assert receiver.ended == CLOSED
    assert receiver.take() == []


def test_bytes_that_are_no_rtde_end_the_reports_and_say_so():
    with virtual_bench() as bench:
        stream = RtdeStream(bench.ur().address, 125, VARIABLES, bench.clock)
        bench.clock.sleep(0.1)
        reports = stream.take()
        assert len(reports) >= 10 and not stream.ended
        stamps = np.array([report["timestamp"] for _, report in reports])
        np.testing.assert_allclose(np.diff(stamps), 0.008)
        assert [len(reports[0][1][name]) for name in ("actual_q", "actual_current")] == [6, 6]
        stream._receiver._pieces.append((0, b"\xff" * 3000))
        stream.take()
        assert (stream.garbled, stream.ended) == (True, "what came is no RTDE")


FINE = {
    "timestamp": 1.0,
    "robot_mode": 7,
    "safety_mode": 1,
    "robot_status_bits": 3,
    "safety_status_bits": 1,
    "target_speed_fraction": 1.0,
}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timestamp", -1e300),
        ("robot_mode", 1 << 20),
        ("safety_mode", 99),
        ("robot_status_bits", 1 << 9),
        ("safety_status_bits", 1 << 30),
        ("target_speed_fraction", float("nan")),
    ],
)
def test_a_report_with_a_value_that_there_is_not_is_nonsense(name, value):
    assert nonsense(FINE) == ""
    assert name.split("_")[0].removesuffix("stamp") in nonsense(FINE | {name: value}) or (
        name == "target_speed_fraction" and "speed" in nonsense(FINE | {name: value})
    )


def test_a_program_moves_nothing_in_a_protective_stop():
    assert program_moves(FINE)
    assert not program_moves(FINE | {"robot_status_bits": 1})
    assert not program_moves(FINE | {"safety_status_bits": 1 << 2})


def test_an_arm_is_at_rest_only_after_a_while_and_while_nothing_may_move_it():
    watch, still = RestWatch(), np.zeros(6)
    assert watch.look(0.0, still, False) is Standing.UNKNOWN
    assert watch.look(0.06, still, True) is Standing.MOVING
    assert watch.look(0.10, still, False) is Standing.MOVING
    assert watch.look(0.14, still + 0.1, False) is Standing.MOVING
    assert watch.look(0.20, still, False) is Standing.MOVING
    assert watch.look(0.26, still, False) is Standing.AT_REST


FORBIDDEN = """\
import errno, socket
from operator import add
from testbench.drivers.arms.helper import Helper
from testbench.drivers.arms.own_process import forbid_connections
helper = Helper()
ours, theirs = socket.socketpair()
other, end = socket.socketpair()
forbid_connections()
ours.close() # the number of a connection that was lost is free again
try:
    socket.socket()
except OSError as error:
    assert error.errno == errno.EMFILE
else:
    raise SystemExit("a socket could be opened")
end.sendall(b"x")
assert other.recv(1) == b"x"
assert helper.ask(add, 2, 3) == 5
assert helper.ask(add, 2, "3") is None # what goes wrong there stays there
"""


def test_a_process_may_be_kept_from_new_connections_which_its_helper_makes_for_it():
    subprocess.run([sys.executable, "-c", FORBIDDEN], cwd=ROOT, check=True, timeout=60)
