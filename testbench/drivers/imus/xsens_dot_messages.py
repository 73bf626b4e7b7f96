"""Messages of the synchronisation of Xsens DOTs: how they are written, and how they are answered.

Source: Movella DOT BLE Service Specification, document XD0506P, revision C, July 2023 (sections in
brackets below).
"""

from __future__ import annotations

import asyncio
from typing import Any

from testbench.drivers.imus.xsens_dot_payload import uuid
from testbench.exceptions import DriverError

MESSAGE_CONTROL, MESSAGE_ACKNOWLEDGE, MESSAGE_NOTIFICATION = (
    uuid(0x7001),
    uuid(0x7002),
    uuid(0x7003),
)
SYNCHRONISATION = 0x02
"""Message identifier [table 24]."""
START, STOP, ACKNOWLEDGE, GET_STATUS, STOP_RESULT, STATUS = 0x01, 0x02, 0x03, 0x08, 0x50, 0x51
"""Identifiers of synchronisation messages [5.5.2]."""
ANSWER_S = 3.0
"""Longest wait for the answer to a message [s]."""


def message(identifier: int, data: bytes = b"") -> bytes:
    """Bytes of a synchronisation message [5.1].

    They are identifier, length, data, and a checksum that makes the sum of all zero.
    """
    body = bytes((SYNCHRONISATION, 1 + len(data), identifier)) + data
    return body + bytes((-sum(body) & 0xFF,))


def start_message(root_address: str) -> bytes:
    """StartSync: the root's address, last byte first [5.3.2.1]."""
    return message(START, bytes.fromhex(root_address.replace(":", ""))[::-1])


def parse(data: bytes) -> tuple[int, bytes] | None:
    """Identifier and data of a synchronisation message; None for anything else.

    Args:
        data: As read; characteristics are longer than the messages in them.
    """
    if len(data) < 4 or data[0] != SYNCHRONISATION or not 1 <= data[1] <= len(data) - 3:
        return None
    whole = data[: data[1] + 3]
    return (whole[2], bytes(whole[3:-1])) if sum(whole) & 0xFF == 0 else None


async def ask(client: Any, command: bytes, answer: int) -> int:
    """Write a control message and wait for the notification that answers it.

    Returns:
        The first byte of its data.

    Raises:
        DriverError: No answer came.
    """
    loop = asyncio.get_running_loop()
    answered: asyncio.Future[int] = loop.create_future()

    def told(characteristic: Any, data: bytearray) -> None:
        found = parse(bytes(data))
        if found is not None and found[0] == answer and found[1] and not answered.done():
            answered.set_result(found[1][0])

    await client.start_notify(MESSAGE_NOTIFICATION, told)
    try:
        await client.write_gatt_char(MESSAGE_CONTROL, command, response=True)
        return await asyncio.wait_for(answered, ANSWER_S)
    except TimeoutError:
        raise DriverError(
            "it does not answer to messages of synchronisation; update its firmware"
        ) from None
    finally:
        await client.stop_notify(MESSAGE_NOTIFICATION)
