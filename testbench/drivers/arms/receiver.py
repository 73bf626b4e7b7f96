"""Takes in what a controller sends as it comes, however busy the rest of the process is."""

from __future__ import annotations

import select
import socket
import struct
import sys
import threading
from contextlib import suppress

from testbench.clock import Clock, real_time_ns

PIECE = 4096
"""Bytes that are read at once: a stamp of the kernel is that of the last byte of them."""
TIMESPEC = struct.Struct("qq")
SO_TIMESTAMPNS = 35
"""Asks for the time at which the kernel took a packet in, and is the type of the message that tells
it (Linux, include/uapi/asm-generic/socket.h; for TCP since 4.17, net/ipv4/tcp.c,
tcp_recv_timestamp).
"""
PARTED_NS = 1_000_000
"""The machine's real time was set when it and its monotonic time part by more between two readings
[ns]: then the kernel's stamps mean nothing.
"""
WAIT_MS = 100
CLOSED = "the other side closed it"


class Receiver:
    """The receiving end of a connection.

    Each piece has the time at which it arrived at this machine: the kernel's where it tells that,
    so that a process which was held up does not take its own lateness for the network's.

    Args:
        connection: Is read from nowhere else from now on.
        time: The host's clock.
        threaded: Read in a thread of its own, and ask the kernel for its times; else whoever takes
            the pieces reads.

    Attributes:
        ended: Why nothing more comes; empty while something may.
    """

    def __init__(self, connection: socket.socket, time: Clock, threaded: bool = False):
        self._connection, self._time = connection, time
        self._lock, self._closing = threading.Lock(), False
        self._pieces: list[tuple[int, bytes]] = []
        self._arrived_ns, self._offset_ns = 0, 0
        self.ended = ""
        connection.setblocking(False)
        self._stamped = False
        if threaded:
            with suppress(OSError):
                if sys.platform == "linux":
                    connection.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
                    self._stamped = True
            self._offset_ns = real_time_ns() - time.monotonic_ns()
            threading.Thread(target=self._run, name="receiver", daemon=True).start()

    def take(self) -> list[tuple[int, bytes]]:
        """What came since the last call: when each piece arrived [ns], and its bytes."""
        self._drain()
        with self._lock:
            pieces, self._pieces = self._pieces, []
        return pieces

    def close(self) -> None:
        """Close the connection."""
        self._closing = True
        with self._lock:
            self.ended = self.ended or "it was closed here"
            with suppress(OSError):
                self._connection.close()

    def _run(self) -> None:
        poll = select.poll()
        poll.register(self._connection, select.POLLIN)
        while not self._closing and not self.ended:
            if poll.poll(WAIT_MS):
                self._drain()

    def _drain(self) -> None:
        with self._lock:
            while not self.ended:
                try:
                    data, arrived_ns = self._receive()
                except BlockingIOError:
                    return
                except OSError as error:
                    self.ended = error.strerror or str(error)
                    return
                if data:
                    self._pieces.append((arrived_ns, data))
                else:
                    self.ended = CLOSED

    def _receive(self) -> tuple[bytes, int]:
        if not self._stamped:
            return self._connection.recv(PIECE), self._time.monotonic_ns()
        data, told, _, _ = self._connection.recvmsg(PIECE, socket.CMSG_SPACE(TIMESPEC.size))
        now_ns = self._time.monotonic_ns()
        offset_ns = real_time_ns() - now_ns
        was_set = abs(offset_ns - self._offset_ns) > PARTED_NS
        self._offset_ns = offset_ns
        arrived_ns = now_ns
        for level, kind, content in told:
            if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS) and not was_set:
                seconds, nanoseconds = TIMESPEC.unpack(content[: TIMESPEC.size])
                arrived_ns = seconds * 1_000_000_000 + nanoseconds - offset_ns
        # Not before the piece before it, and not in the future, whatever the stamps say.
        self._arrived_ns = min(max(arrived_ns, self._arrived_ns), now_ns)
        return data, self._arrived_ns
