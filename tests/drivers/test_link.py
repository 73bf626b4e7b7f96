"""The driving process as the bench sees it: how it ended, and what it left behind."""

from __future__ import annotations

import os
import signal
import sys
import time
from multiprocessing import Pipe
from typing import Any

import numpy as np
import pytest

from testbench.clock import SystemClock
from testbench.drivers.arms.catalogue import UR
from testbench.drivers.arms.client import ArmClient, Row
from testbench.drivers.arms.link import Link
from testbench.drivers.arms.outbox import Outbox
from testbench.drivers.arms.settings import LinkSettings
from testbench.drivers.arms.standing import Standing
from testbench.exceptions import DriverError


class CrashingClient(ArmClient):
    """A client library that says something and dies."""

    def connect(self) -> dict[str, Any]:
        print("the library lost its head", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
        return {}

    def samples(self) -> list[Row]:
        return []

    def stop_from_outside(self, deceleration: float) -> Standing:
        return Standing.UNKNOWN

    def nothing(self, *arguments: Any) -> None:
        """It never gets so far."""

    check = keep_alive = move = stream = stop_stream = stop = close = nothing


def test_a_crash_is_told_with_its_signal_and_what_the_process_wrote_is_kept():
    link = Link(CrashingClient, LinkSettings("nowhere"), UR, SystemClock())
    with pytest.raises(DriverError, match=r"has ended by SIGSEGV$"):
        link.wait_for("info", 60)
    assert link.words.startswith("the library lost its head\nFatal Python error: Segmentation")
    link.close()


def test_a_client_may_be_stuck_only_where_it_says_so():
    client = CrashingClient(LinkSettings("nowhere"))
    assert client.stuck_for == 0
    assert np.array_equal(client.q, np.zeros(6))


def test_a_bench_that_does_not_read_holds_nobody_up_and_hears_all_of_it_later():
    ours, theirs = Pipe()
    outbox, began = Outbox(theirs), time.monotonic()
    for k in range(40):
        outbox.send(("samples", k, bytes(100_000)))
    assert time.monotonic() - began < 2
    outbox.flush(0.01)  # not for ever
    assert [ours.recv()[1] for _ in range(40)] == list(range(40))
    outbox.flush(10)
    ours.send("stop")
    assert (outbox.poll(5), outbox.recv()) == (True, "stop")
    ours.close()
    outbox.send("to nobody")
    outbox.flush(10)
    with pytest.raises(BrokenPipeError):
        outbox.send("to nobody")
