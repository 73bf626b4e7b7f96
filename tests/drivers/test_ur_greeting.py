"""What answers at an address is told apart before the client library is let loose on it."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from testbench.drivers.arms.ur_greeting import greet_dashboard


@contextmanager
def server(greeting: bytes, reply: bytes) -> Iterator[int]:
    """Says a greeting to the first who comes, and a reply to what he says."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = listener.accept()
        with connection:
            connection.sendall(greeting)
            if reply:
                connection.recv(200)
                connection.sendall(reply)
            else:
                connection.recv(200)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        thread.join(5)
        listener.close()


def test_a_dashboard_is_known_by_its_first_words():
    with server(b"Connected: Universal Robots Dashboard Server\n", b"") as port:
        assert greet_dashboard("127.0.0.1", port) is None


@pytest.mark.parametrize(
    ("greeting", "reply", "heard"),
    [
        (b"", b"HTTP/1.0 400 Bad request\r\n\r\n", "HTTP/1.0 400 Bad request"),
        (b"SSH-2.0-x\x1b[2J\n", b"", "SSH-2.0-x?[2J"),
    ],
)
def test_another_server_is_named_by_what_it_says(greeting, reply, heard):
    with server(greeting, reply) as port:
        told = greet_dashboard("127.0.0.1", port, 0.2)
    assert told == f"127.0.0.1, port {port}, answers, but not like a UR dashboard ('{heard}')"


def test_nobody_and_somebody_who_never_answers_are_told_apart():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        assert (
            greet_dashboard("127.0.0.1", port, 0.2)
            == f"no controller answers at 127.0.0.1, port {port}: timed out"
        )
    assert (
        greet_dashboard("127.0.0.1", port, 0.2)
        == f"no controller answers at 127.0.0.1, port {port}: Connection refused"
    )
