"""Synchronisation of Xsens DOTs: by radio, the others take over the clock of the root.

Source: Movella DOT BLE Service Specification, document XD0506P, revision C, July 2023 (sections in
brackets below). The sensors must be let go while they listen to the root, and tell the result once
they are connected again [5.3.5].
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from testbench.drivers.imus.xsens_dot import XsensDot
from testbench.drivers.imus.xsens_dot_messages import (
    ACKNOWLEDGE,
    GET_STATUS,
    MESSAGE_ACKNOWLEDGE,
    MESSAGE_CONTROL,
    STATUS,
    STOP,
    STOP_RESULT,
    ask,
    message,
    parse,
    start_message,
)
from testbench.exceptions import DriverError

SYNCED = 0x04
"""States in a status message [5.3.4.2]."""
RESULTS = {
    0x00: "synchronised",
    0x05: "it heard too little of the root",
    0x07: "its clock runs too differently from the root's",
    0x08: "it started at a wrong time",
    0x09: "it did not start",
}
"""Results that a sensor acknowledges with [table 30]."""
LISTEN_S = 14.0
"""Time from the command to the attempt to connect again: the sensors need some 12 s [5.3.5]."""
CONNECTIONS = 3
"""Attempts to connect to a sensor again."""
ATTEMPTS = 2
"""Of the whole procedure; one that fails is often a sensor that heard too little."""


async def release(client: Any) -> None:
    """Make sure that a sensor is not synchronised: one that is must be stopped before it is started
    anew [5.3.5].

    Raises:
        DriverError: It stays synchronised.
    """
    if (
        await ask(client, message(GET_STATUS), STATUS) == SYNCED
        and await ask(client, message(STOP), STOP_RESULT) != 0
    ):
        raise DriverError("its earlier synchronisation cannot be stopped; switch it off and on")


async def result_of(client: Any) -> int:
    """What a sensor acknowledges after it was connected again; 0 is success.

    Raises:
        DriverError: It acknowledges nothing of the kind.
    """
    found = parse(bytes(await client.read_gatt_char(MESSAGE_ACKNOWLEDGE)))
    if found is None or found[0] != ACKNOWLEDGE or not found[1]:
        raise DriverError("it says nothing of the synchronisation")
    return found[1][0]


def synchronise(dots: Sequence[XsensDot], listen_s: float | None = None) -> None:
    """Bring the clocks of connected sensors to that of the first.

    They are connected again when it returns.

    Args:
        dots: Connected, their output rates set (that is impossible afterwards), and not streaming.
        listen_s: Time that the sensors are let go for [s]; `LISTEN_S` if None.

    Raises:
        DriverError: A sensor could not be synchronised; names each with the reason. None is left
            synchronised.
    """
    root = dots[0].address
    failures: dict[str, str] = {}
    for _ in range(ATTEMPTS):
        for dot in dots:
            dot.work(release)
        for dot in dots:
            dot.work(_starter(root))
        for dot in dots:
            dot.let_go()
        dots[0].wait(LISTEN_S if listen_s is None else listen_s)
        failures = {}
        for dot in dots:
            _connect_again(dot)
            code = dot.work(result_of)
            if code != 0:
                failures[str(dot)] = RESULTS.get(code, f"result {code:#04x}")
                dot.notices.add("synchronisation_failed", reason=failures[str(dot)])
        if not failures:
            for dot in dots:
                dot.note_synchronised(root)
            return
    for dot in dots:
        dot.work(release)
    listing = "; ".join(f"{name}: {why}" for name, why in failures.items())
    raise DriverError(
        f"the clocks could not be synchronised: {listing}; lay the sensors side by side, or leave "
        "out --dot-sync"
    )


def _connect_again(dot: XsensDot) -> None:
    """Connect, more than once if need be: a sensor may still be listening [5.3.5]."""
    for _ in range(CONNECTIONS - 1):
        try:
            return dot.connect()
        except DriverError:
            dot.wait(1.0)
    return dot.connect()


def _starter(root_address: str) -> Callable[[Any], Coroutine[Any, Any, None]]:
    async def start(client: Any) -> None:
        await client.write_gatt_char(MESSAGE_CONTROL, start_message(root_address), response=True)

    return start
