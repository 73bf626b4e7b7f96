"""Frames and reports of an xArm controller, as bytes.

Commands: UFACTORY's private TCP protocol (docs.ufactory.cc/private_tcp_protocol), whose registers
the client library names in x_config.py. Reports: ports 30000 (xArm-Developer/ufactory_docs,
firmware/report) and 30002 (developer manual, automatic reporting), whose layouts the client library
repeats in x3/report.py.
"""

from __future__ import annotations

import struct
from enum import IntEnum

import numpy as np

JOINTS = 7
"""Reports and commands always have room for seven."""
PROTOCOLS = {2, 3}
"""Protocol numbers of commands; 3 promises that the client will be heard of from time to time."""
LONGEST_FRAME = 1024


class Register(IntEnum):
    """Commands that are emulated."""

    GET_VERSION = 1
    MOTION_EN = 11
    SET_STATE = 12
    GET_STATE = 13
    GET_CMDNUM = 14
    GET_ERROR = 15
    CLEAN_ERR = 16
    CLEAN_WAR = 17
    SET_MODE = 19
    MOVE_JOINT = 23
    MOVE_SERVOJ = 29
    SET_LOAD_PARAM = 36
    GET_TCP_POSE = 41
    GET_JOINT_POS = 42


INVALID, NOT_READY, WARNING, ERROR = 0x08, 0x10, 0x20, 0x40
"""Bits of the state that every answer begins with."""

_TIMELY_NAMES = ["q_target", "v_target", "a_target", "q", "v", "a", "current", "torque"]
TIMELY = np.dtype(
    {
        "names": ["size", "time_us", "state_mode", "commands", *_TIMELY_NAMES],
        "formats": [">u4", ">u8", "u1", ">u2", *["(7,)<f4"] * len(_TIMELY_NAMES)],
        "offsets": [0, 4, 12, 13, *(32 + 28 * i for i in range(len(_TIMELY_NAMES)))],
        "itemsize": 804,
    }
)
"""A report of port 30000; poses, forces and connectors are left at zero."""

_RICH_FIELDS = {
    "size": (">u4", 0),
    "state_mode": ("u1", 4),
    "commands": (">u2", 5),
    "q_target": ("(7,)<f4", 7),
    "torque": ("(7,)<f4", 59),
    "brakes": ("u1", 87),
    "motors": ("u1", 88),
    "error": ("u1", 89),
    "warning": ("u1", 90),
    "load": ("(4,)<f4", 115),
    "gravity": ("(3,)<f4", 133),
    "device_type": ("u1", 145),
    "axes": ("u1", 146),
    "temperatures": ("(7,)i1", 245),
    "v": ("(7,)<f4", 256),
    "currents": ("(7,)<f4", 355),
}
RICH = np.dtype(
    {
        "names": list(_RICH_FIELDS),
        "formats": [kind for kind, _ in _RICH_FIELDS.values()],
        "offsets": [offset for _, offset in _RICH_FIELDS.values()],
        "itemsize": 587,
    }
)
"""A report of port 30002; what is not named is left at zero."""


class FrameError(Exception):
    """Bytes that are no command."""


def take_frame(buffer: bytearray) -> tuple[int, int, int, bytes] | None:
    """Take the first command off a buffer.

    Returns:
        Transaction, protocol, register and arguments; None while the command is not whole.

    Raises:
        FrameError: These bytes are no command.
    """
    if len(buffer) < 6:
        return None
    transaction, protocol, length = struct.unpack(">3H", buffer[:6])
    if not 1 <= length <= LONGEST_FRAME:
        raise FrameError(f"a command of {length} bytes")
    if len(buffer) < 6 + length:
        return None
    body = bytes(buffer[6 : 6 + length])
    del buffer[: 6 + length]
    return transaction, protocol, body[0], body[1:]


def answer_frame(transaction: int, protocol: int, register: int, state: int, data: bytes) -> bytes:
    """The answer to a command; state: bits such as `ERROR`."""
    return struct.pack(">3H2B", transaction, protocol, len(data) + 2, register, state) + data


def floats(data: bytes, count: int) -> np.ndarray | None:
    """The first numbers of a command's arguments, shape (count,); None if there are fewer."""
    if len(data) < 4 * count:
        return None
    return np.frombuffer(data[: 4 * count], "<f4").astype(float)


def padded(values: np.ndarray) -> np.ndarray:
    """Values of the joints there are, with zeros for the rest, shape (7,).

    Args:
        values: One for each joint, shape (n,).
    """
    return np.pad(values, (0, JOINTS - len(values)))
