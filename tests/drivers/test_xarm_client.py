"""How the xArm driver reads reports: by the client library's own layout, however they are cut, and
not if they are nonsense.
"""

from __future__ import annotations

import socket
from types import SimpleNamespace
from typing import Self

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.clock import SystemClock
from testbench.drivers.arms.client import ArmFault
from testbench.drivers.arms.receiver import Receiver
from testbench.drivers.arms.xarm_client import REPORT, XArmClient, XArmSettings

SIZE = 804  # of a whole report


def report(k: int, state: int = 2, mode: int = 0, q: float | None = None) -> bytes:
    """The k-th report, 5 ms after the one before."""
    values = np.zeros(1, REPORT)
    values["size"], values["time_us"], values["state_mode"] = (
        SIZE,
        1_000_000 + 5000 * k,
        state | mode << 4,
    )
    values["q"] = 0.01 * k if q is None else q
    values["v"], values["q_target"], values["current"] = 2.0, 0.01 * k + 0.1, 0.5
    return values.tobytes().ljust(SIZE, b"\x5a")


class Fed:
    """A client at the other end of a pair of sockets, with a library that says nothing."""

    def __init__(self) -> None:
        self.ours, theirs = socket.socketpair()
        self.client = XArmClient(XArmSettings("nowhere", record_hz=200, control_hz=200))
        self.client._report = Receiver(theirs, SystemClock())
        self.client._arm = SimpleNamespace(temperatures=[31] * 7, error_code=0, connected=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.ours.close()
        self.client._report.close()


@settings(max_examples=40, deadline=None)
@given(cuts=st.lists(st.integers(1, 10 * SIZE - 1), max_size=12, unique=True))
def test_reports_are_read_the_same_however_they_are_cut(cuts):
    data = b"".join(report(k) for k in range(10))
    with Fed() as fed:
        rows = []
        for begin, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(data)], strict=True):
            fed.ours.sendall(data[begin:end])
            rows += fed.client.samples()
    assert [row[1] for row in rows] == [1_000_000_000 + 5_000_000 * k for k in range(10)]
    for k, (_, _, q, v, current, heat, state, mode, error, target, missed) in enumerate(rows):
        np.testing.assert_allclose(target, np.full(6, 0.01 * k + 0.1), atol=1e-7)
        np.testing.assert_allclose(q, np.full(6, 0.01 * k), atol=1e-7)
        np.testing.assert_allclose(v, np.full(6, 2.0))
        np.testing.assert_allclose(current, np.full(6, 0.5))
        assert list(heat) == [31] * 6
        assert (state, mode, error, missed) == (2, 0, 0, 0)


def test_missing_reports_are_counted_and_those_without_angles_are_missing():
    with Fed() as fed:
        fed.ours.sendall(report(0) + report(1) + report(4) + report(5, q=float("nan")) + report(6))
        assert [row[-1] for row in fed.client.samples()] == [0, 0, 2, 1]
        assert np.isfinite(fed.client.q).all()


@pytest.mark.parametrize(
    "nonsense", [b"\x00\x00\x00\x00" * 100, b"\xff" * 400, b"HTTP/1.1 400 Bad Request\r\n" * 40]
)
def test_what_is_no_report_is_told_as_such(nonsense):
    with Fed() as fed:
        fed.ours.sendall(report(0) + nonsense)
        assert len(fed.client.samples()) == 1
        with pytest.raises(ArmFault, match=r"cannot be true \(a report of \d+ bytes\)") as caught:
            fed.client.check()
        assert caught.value.kind == "garbled"


def test_a_paused_arm_and_another_mode_are_faults():
    for state, mode, kind in ((3, 0, "program_stopped"), (2, 2, "mode_changed")):
        with Fed() as fed:
            fed.client._wanted_mode = 0
            fed.ours.sendall(report(0))
            fed.client.samples()
            fed.client.check()
            fed.ours.sendall(report(1, state, mode))
            fed.client.samples()
            with pytest.raises(ArmFault) as caught:
                fed.client.check()
            assert caught.value.kind == kind


def test_the_layout_is_the_client_librarys(monkeypatch, tmp_path):
    monkeypatch.setenv(
        "HOME", str(tmp_path)
    )  # the library makes a folder there when it is imported
    layouts = pytest.importorskip("xarm.x3.report", reason="xarm-python-sdk is not installed")
    theirs = type(layouts.ReportDataStructure.create(30000))
    names = {
        "size": "data_size",
        "time_us": "timestamp",
        "state_mode": "state_mode",
        "commands": "cmd_num",
        "q": "actual_joint_angle",
        "q_target": "target_joint_angle",
        "v": "actual_joint_velocity",
        "current": "actual_joint_current",
    }
    assert set(names) == set(REPORT.names)
    for ours, name in names.items():
        kind, offset = REPORT.fields[ours][:2]
        field = getattr(theirs, f"_{name}")
        assert (offset, kind.itemsize) == (field.offset, field.size)
