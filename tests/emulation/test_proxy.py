"""The stretch of bad network: what each disturbance does to bytes on real sockets, and to which."""

from __future__ import annotations

import socket
import socketserver
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from testbench.emulation.disturbances import DOWN, UP, Disturbance, Disturbances, Passage
from testbench.emulation.proxy import Proxy
from testbench.exceptions import InputError
from tests.emulated_arms import free_address

PORT, OTHER = 30002, 30004
MS = 1_000_000


def passage(*lasting: Disturbance, port: int = PORT, direction: str = DOWN) -> Passage:
    return Passage(Disturbances(list(lasting)), port, direction, np.random.default_rng(3))


def test_undisturbed_bytes_pass_at_once():
    way = passage()
    way.put(b"abc", 5)
    assert (way.due_ns, way.take(5), way.waiting) == (5, b"abc", 0)


def test_a_delay_keeps_the_order_also_when_it_ends():
    way = passage(Disturbance("delay", 0.01))
    way.put(b"first", 0)
    way._disturbances.lasting.clear()
    way.put(b"second", MS)
    assert way.take(9 * MS) == b""
    assert way.take(10 * MS) == b"firstsecond"


def test_jitter_is_within_its_size_and_keeps_the_order():
    way = passage(Disturbance("jitter", 0.01))
    sent = [bytes([k]) * 3 for k in range(100)]
    came, when = b"", []
    for k, piece in enumerate(sent):
        way.put(piece, k * MS)
    while way.due_ns is not None:
        when.append(way.due_ns)
        came += way.take(way.due_ns)
    assert came == b"".join(sent)
    assert 99 * MS < when[-1] <= 109 * MS and len(set(when)) > 10


def test_a_stall_holds_everything_until_it_is_over():
    way = passage(Disturbance("stall"))
    way.put(b"abc", 0)
    assert (way.take(10**12), way.due_ns, way.waiting) == (b"", None, 3)
    way._disturbances.lasting.clear()
    assert way.take(10**12) == b"abc"


def test_corruption_hits_its_share_of_the_bytes():
    way = passage(Disturbance("corrupt", 0.1))
    sent = bytes(100_000)
    way.put(sent, 0)
    came = way.take(0)
    assert len(came) == len(sent)
    assert np.count_nonzero(np.frombuffer(came, np.uint8)) / len(sent) == pytest.approx(
        0.1, rel=0.1
    )


def test_reordered_pieces_all_come_whole_and_some_after_the_next():
    way = passage(Disturbance("reorder", 0.5))
    for k in range(200):
        way.put(bytes([k]), k)
    came = list(way.take(1000))
    assert came != sorted(came) and len(set(came)) == len(came) >= 199
    assert max(abs(place - k) for place, k in enumerate(came)) == 1


@pytest.mark.parametrize(
    ("port", "direction", "hit"),
    [(None, None, True), (PORT, None, True), (OTHER, None, False), (PORT, UP, False)],
)
def test_a_disturbance_may_be_of_one_port_and_direction(port, direction, hit):
    way = passage(Disturbance("stall", None, port, direction))
    way.put(b"x", 0)
    assert (way.take(0) == b"") is hit


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("", "say: fault NAME"),
        ("rain", "no disturbance 'rain'"),
        ("delay x", "is no number"),
        ("stall 3", "takes no value"),
        ("corrupt 2", "share from 0 to 1"),
        ("stall port=x", "port 'x' is no number"),
        ("stall direction=left", "is no direction"),
    ],
)
def test_what_is_no_disturbance_is_refused_in_a_sentence(words, sentence):
    with pytest.raises(InputError, match=sentence):
        Disturbance.of(words.split())


def test_a_line_names_size_port_and_direction():
    words = ["delay", "0.3", "port=30004", "direction=up"]
    assert Disturbance.of(words) == Disturbance("delay", 0.3, 30004, UP)


class Echo(socketserver.ThreadingTCPServer):
    """A controller that gives back what it hears, and keeps how its connections ended."""

    daemon_threads, allow_reuse_address = True, True

    def __init__(self) -> None:
        self.address, self.ends, self.ended = free_address(), list[str](), threading.Event()
        super().__init__((self.address, PORT), Talk)


class Talk(socketserver.BaseRequestHandler):
    server: Echo

    def handle(self) -> None:
        try:
            while data := self.request.recv(4096):
                self.request.sendall(data)
            self.server.ends.append("closed")
        except ConnectionResetError:
            self.server.ends.append("reset")
        except OSError:
            self.server.ends.append("failed")
        self.server.ended.set()


@pytest.fixture
def echo() -> Iterator[Echo]:
    with Echo() as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield made
        made.shutdown()


@pytest.fixture
def proxy(echo: Echo) -> Iterator[Proxy]:
    with Proxy(free_address(), echo.address, [PORT]) as made:
        yield made


def connected(proxy: Proxy) -> socket.socket:
    client = socket.create_connection((proxy.address, PORT), 5)
    client.sendall(b"hello")
    assert client.recv(5) == b"hello"
    return client


def until(echo: Echo, end: str) -> bool:
    limit = time.monotonic() + 5
    while end not in echo.ends and time.monotonic() < limit:
        echo.ended.wait(0.05)
    return end in echo.ends


def test_a_reset_is_one_on_both_sides_and_new_connections_are_taken(proxy, echo):
    with connected(proxy) as client:
        proxy.strike("reset", port=PORT)
        with pytest.raises(ConnectionResetError):
            client.recv(1)
    assert until(echo, "reset")
    connected(proxy).close()


def test_a_half_closed_connection_ends_on_one_side_and_lives_on_the_other(proxy, echo):
    with connected(proxy) as client:
        proxy.strike("half_close", direction=DOWN)
        assert client.recv(1) == b""
        client.sendall(b"still heard")
    with connected(proxy) as client:
        proxy.strike("half_close", direction=UP)
        assert until(echo, "closed")


def test_where_connections_are_refused_none_is_left_and_none_is_taken_until_it_is_over(proxy):
    with connected(proxy) as client:
        proxy.strike("refuse")
        with pytest.raises(ConnectionResetError):
            client.recv(1)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((proxy.address, PORT), 5)
    proxy.clear()
    connected(proxy).close()


def test_a_stall_on_the_line_ends_when_it_is_cleared_by_a_line_at_the_fault_port(proxy):
    with (
        connected(proxy) as client,
        socket.create_connection((proxy.address, 29998), 5) as control,
    ):
        lines = control.makefile("rw")

        def say(line: str) -> str:
            print(line, file=lines, flush=True)
            return lines.readline().strip()

        assert say("fault stall direction=up") == "ok"
        assert say("status") == "1 connections, stall"
        client.sendall(b"x")
        client.settimeout(0.05)
        with pytest.raises(TimeoutError):
            client.recv(1)
        assert say("clear") == "ok"
        client.settimeout(5)
        assert client.recv(1) == b"x"
        assert say("fault rain").startswith("refused: no disturbance")
        assert say("hello").startswith("refused: say")


def test_a_proxy_listens_on_loopback_addresses_of_its_own_only(echo):
    for address, sentence in (
        ("192.0.2.1", "loopback"),
        ("nowhere", "no IP address"),
        (echo.address, "an address of its own"),
    ):
        with pytest.raises(InputError, match=sentence):
            Proxy(address, echo.address, [PORT])
