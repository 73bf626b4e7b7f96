"""Stop a Universal Robots arm without its client library, and see whether it stands still.

For when the library, or the process that it lives in, is of no use any more. Every connection is
new: nothing depends on those that may be broken.
"""

from __future__ import annotations

import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from testbench.clock import Clock, seconds
from testbench.drivers.arms.rtde import RtdeStream
from testbench.drivers.arms.standing import RestWatch, Standing
from testbench.drivers.arms.ur_greeting import DASHBOARD_PORT

SECONDARY_PORT = 30002
CONNECT_S = 0.5
PATIENCE_S = 2.0
"""The arm is told to stop, and looked at, for so long [s]."""
LOOK_S, LOOK_HZ = 0.8, 125.0
"""One look at it takes at most so long [s], with reports at this rate."""
PROGRAM_RUNS = 1 << 1
"""Bit of `robot_status_bits` (RTDE guide)."""
PROTECTIVE, SAFEGUARD, EMERGENCY, VIOLATION, FAULT = 1 << 2, 1 << 4, 1 << 7, 1 << 8, 1 << 9
"""Bits of `safety_status_bits` (RTDE guide)."""
SAFETY_STOPS = PROTECTIVE | SAFEGUARD | EMERGENCY | VIOLATION | FAULT
ROBOT_MODES, SAFETY_MODES = range(-1, 9), range(14)
MOST_STATUS, MOST_SAFETY = 1 << 4, 1 << 11
"""Modes and bits that there are, and some to spare (RTDE guide)."""
LATEST_S = 1e10
"""A time stamp beyond this is none [s]; a controller's clock begins at its start."""


def nonsense(report: Mapping[str, Any]) -> str:
    """Why a report cannot be true, by its modes and bits alone; empty where it can.

    Args:
        report: With those that `ur_client.VARIABLES` names.
    """
    checks = {
        "a time stamp": 0 <= report["timestamp"] < LATEST_S,
        "a robot mode": report["robot_mode"] in ROBOT_MODES,
        "a safety mode": report["safety_mode"] in SAFETY_MODES,
        "robot status bits": 0 <= report["robot_status_bits"] < MOST_STATUS,
        "safety status bits": 0 <= report["safety_status_bits"] < MOST_SAFETY,
        "a share of the speed": 0 <= report["target_speed_fraction"] <= 1,
    }
    wrong = [name for name, fine in checks.items() if not fine]
    return f"{wrong[0]} that there is not" if wrong else ""


def program_moves(report: Mapping[str, Any]) -> bool:
    """Whether a program may move the arm: it runs, and no safety function has stopped the arm.

    Args:
        report: With `robot_status_bits` and `safety_status_bits`.
    """
    runs = bool(report["robot_status_bits"] & PROGRAM_RUNS)
    return runs and not report["safety_status_bits"] & SAFETY_STOPS


def stop_from_outside(
    host: str, deceleration: float, time: Clock, patience_s: float = PATIENCE_S
) -> Standing:
    """Stop whatever program moves the arm, and say what was seen of it afterwards; never raises.

    Args:
        host: Address of the controller.
        deceleration: Of the joints [rad/s^2].
        time: The host's clock.
        patience_s: How long to try [s].
    """
    end, by_dashboard, seen = seconds(time) + patience_s, False, Standing.UNKNOWN
    while True:
        tell_stop(host, deceleration)
        if by_dashboard:
            _ask_dashboard(host, "stop")
        standing = look(host, time)
        if standing is not Standing.UNKNOWN:
            seen = standing
        if standing is Standing.AT_REST:
            return standing
        if seconds(time) > end:
            halted = seen is Standing.UNKNOWN and _ask_dashboard(host).startswith("STOPPED")
            return Standing.HALTED if halted else seen
        by_dashboard = True
        time.sleep(0.05)


def tell_stop(host: str, deceleration: float) -> None:
    """Send a program that stops the joints, which replaces the one that runs; never raises.

    Script manual: stopj; a program sent to a client interface ends the one that runs.
    """
    with (
        suppress(OSError),
        socket.create_connection((host, SECONDARY_PORT), CONNECT_S) as script,
    ):
        script.sendall(f"def stop_bench():\n  stopj({deceleration})\nend\n".encode())


def _ask_dashboard(host: str, question: str = "programState") -> str:
    """What the dashboard says (Dashboard Server e-Series), empty where it says nothing; never
    raises.
    """
    with (
        suppress(OSError),
        socket.create_connection((host, DASHBOARD_PORT), CONNECT_S) as dashboard,
    ):
        dashboard.recv(200)
        dashboard.sendall(f"{question}\n".encode())
        return dashboard.recv(200).decode("ascii", "replace")
    return ""


def look(host: str, time: Clock) -> Standing:
    """What reports of a new connection show; never raises."""
    watch, end = RestWatch(), seconds(time) + LOOK_S
    variables = ("timestamp", "actual_qd", "robot_status_bits", "safety_status_bits")
    with suppress(OSError):
        stream = RtdeStream(host, LOOK_HZ, variables, time, patience_s=CONNECT_S)
        try:
            while seconds(time) < end and not stream.ended:
                for _, report in stream.take():
                    rates, moves = np.array(report["actual_qd"]), program_moves(report)
                    watch.look(report["timestamp"], rates, moves)
                    if watch.standing is Standing.AT_REST:
                        return watch.standing
                time.sleep(0.004)
        finally:
            stream.close()
    return watch.standing
