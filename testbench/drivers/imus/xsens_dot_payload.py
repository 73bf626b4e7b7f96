"""Xsens DOT: its Bluetooth services, and what its payloads mean; talks to no device.

Source: Movella DOT BLE Service Specification, document XD0506P, revision C, July 2023 (sections in
brackets below). All numbers are little-endian [1.3].
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from testbench.exceptions import NotFoundError
from testbench.frames import STANDARD_GRAVITY

DEG = math.pi / 180


def uuid(short: int) -> str:
    """The full UUID of a service or characteristic of the DOT [1.1]."""
    return f"1517{short:04x}-4947-11e9-8646-d663bd873d93"


DEVICE_INFO, DEVICE_CONTROL = uuid(0x1001), uuid(0x1002)
MEASUREMENT_CONTROL = uuid(0x2001)
LONG_PAYLOAD, MEDIUM_PAYLOAD, SHORT_PAYLOAD = uuid(0x2002), uuid(0x2003), uuid(0x2004)
BATTERY = uuid(0x3001)
COMPANY_ID = 2182
"""Bluetooth company identifier of Movella Technologies B.V. [1.2]."""
ADDRESS_PREFIX = "D4:22:CD"
"""First bytes of the address of every DOT [1.2]."""
ADVERTISED_NAMES = ("xsens dot", "movella dot")
"""Names by which they advertise themselves, by firmware [1.4]."""
OUTPUT_RATES = (1, 4, 10, 12, 15, 20, 30, 60)
"""Rates of streaming [Hz] [2.2]; 120 Hz is for recording on the device only."""

TICK_NS = 1000
STAMP_WRAP_NS = TICK_NS << 32
"""The time stamp counts microseconds in 32 bits [3.5]: it wraps every 71.6 minutes [ns]."""

FIXED_POINT = 4096.0
"""Counts of one unit of the magnetic field. The specification says "fixed point" of 2 bytes and no
more; 12 fractional bits are what published readers of it use, and agree with a norm of 1 in the
Earth's field.
"""
ARBITRARY_UNIT_UT = 40.0
"""Microtesla that one arbitrary unit of the field is recorded as, as in imported files of the DOT:
about the field of the maker's laboratory, to which it is normalised (user manual XD0502P, section
4.2.2). The magnitude is nominal.
"""
RATE_RANGE, FORCE_RANGE = 0.999 * 2000 * DEG, 0.999 * 16 * STANDARD_GRAVITY
"""Readings from here on count as saturated [rad/s], [m/s^2]: +-2000 deg/s and +-16 g (user manual
XD0502P). No mode that can be recorded holds the clip counts.
"""

PARTS = {
    "timestamp": "I",
    "quaternion": "4f",
    "euler": "3f",
    "free_acceleration": "3f",
    "dq": "4f",
    "dv": "3f",
    "acceleration": "3f",
    "angular_velocity": "3f",
    "magnetic_field": "3h",
    "status": "H",
    "clip_acc": "B",
    "clip_gyr": "B",
}
"""Binary format of each quantity [table 17]."""


@dataclass(frozen=True)
class PayloadMode:
    """A payload mode [3.1 to 3.4].

    Attributes:
        name: As in the specification.
        id: Its number.
        characteristic: UUID that notifies it.
        parts: Quantities, in order.
    """

    name: str
    id: int
    characteristic: str
    parts: tuple[str, ...]

    @property
    def format(self) -> str:
        """For `struct`."""
        return "<" + "".join(PARTS[part] for part in self.parts)

    @property
    def size(self) -> int:
        """Bytes; a notification may be longer, filled with zeros."""
        return struct.calcsize(self.format)

    @property
    def has_rate(self) -> bool:
        """Whether angular rate is in it, or follows from it."""
        return "angular_velocity" in self.parts or "dq" in self.parts

    @property
    def has_force(self) -> bool:
        """Whether specific force is in it, or follows from free acceleration and orientation."""
        oriented = self.has_orientation and "free_acceleration" in self.parts
        return "acceleration" in self.parts or "dv" in self.parts or oriented

    @property
    def has_field(self) -> bool:
        return "magnetic_field" in self.parts

    @property
    def has_orientation(self) -> bool:
        return "quaternion" in self.parts or "euler" in self.parts


_T = "timestamp"
_FLAGS = ("status", "clip_acc", "clip_gyr")
MODES = {
    mode.name: mode
    for mode in (
        PayloadMode(
            "extended_quaternion",
            2,
            MEDIUM_PAYLOAD,
            (_T, "quaternion", "free_acceleration", *_FLAGS),
        ),
        PayloadMode(
            "complete_quaternion", 3, MEDIUM_PAYLOAD, (_T, "quaternion", "free_acceleration")
        ),
        PayloadMode("orientation_euler", 4, SHORT_PAYLOAD, (_T, "euler")),
        PayloadMode("orientation_quaternion", 5, SHORT_PAYLOAD, (_T, "quaternion")),
        PayloadMode("free_acceleration", 6, SHORT_PAYLOAD, (_T, "free_acceleration")),
        PayloadMode(
            "extended_euler", 7, MEDIUM_PAYLOAD, (_T, "euler", "free_acceleration", *_FLAGS)
        ),
        PayloadMode("complete_euler", 16, MEDIUM_PAYLOAD, (_T, "euler", "free_acceleration")),
        PayloadMode(
            "delta_quantities_with_mag", 18, MEDIUM_PAYLOAD, (_T, "dq", "dv", "magnetic_field")
        ),
        PayloadMode("delta_quantities", 19, MEDIUM_PAYLOAD, (_T, "dq", "dv")),
        PayloadMode(
            "rate_quantities_with_mag",
            20,
            MEDIUM_PAYLOAD,
            (_T, "acceleration", "angular_velocity", "magnetic_field"),
        ),
        PayloadMode(
            "rate_quantities", 21, MEDIUM_PAYLOAD, (_T, "acceleration", "angular_velocity")
        ),
        PayloadMode(
            "custom_mode_1",
            22,
            MEDIUM_PAYLOAD,
            (_T, "euler", "free_acceleration", "angular_velocity"),
        ),
        PayloadMode(
            "custom_mode_2",
            23,
            MEDIUM_PAYLOAD,
            (_T, "euler", "free_acceleration", "magnetic_field"),
        ),
        PayloadMode("custom_mode_3", 24, MEDIUM_PAYLOAD, (_T, "quaternion", "angular_velocity")),
        PayloadMode(
            "custom_mode_5",
            26,
            LONG_PAYLOAD,
            (_T, "quaternion", "acceleration", "angular_velocity"),
        ),
    )
}
"""Every mode whose layout is public; the high fidelity modes (1, 17, and custom mode 4, 25) only
the vendor's SDK can read.
"""
RECORDABLE = [name for name, mode in MODES.items() if mode.has_rate and mode.has_force]
"""Modes that hold what a recording needs: angular rate and specific force."""


def get_mode(name: str) -> PayloadMode:
    """A payload mode by its name.

    Raises:
        NotFoundError: No such mode; lists those that exist.
    """
    if name not in MODES:
        raise NotFoundError("payload mode", name, list(MODES))
    return MODES[name]


class MalformedPayload(ValueError):
    """A notification does not fit its payload mode; says why."""


def parse(mode: PayloadMode, data: bytes) -> dict[str, tuple[float, ...]]:
    """The quantities of a notification, in the units of the specification [table 17].

    Raises:
        MalformedPayload: Too short, or a number is not finite.
    """
    if len(data) < mode.size:
        raise MalformedPayload(f"has {len(data)} bytes, {mode.name} needs {mode.size}")
    numbers = struct.unpack_from(mode.format, data)
    if not math.isfinite(sum(numbers)):
        raise MalformedPayload("holds a number that is not finite")
    quantities, at = {}, 0
    for part in mode.parts:
        width = int(PARTS[part][:-1] or 1)
        quantities[part] = numbers[at : at + width]
        at += width
    return quantities


@dataclass(frozen=True, slots=True)
class DotReading:
    """What a notification of a recordable mode means.

    Attributes:
        stamp_ns: The sensor's clock, modulo `STAMP_WRAP_NS`.
        values: Angular rate [rad/s], specific force [m/s^2], then the field [uT] and the quaternion
            q_earth_from_sensor (w x y z, earth: ENU) where the mode has them.
        saturated: At full scale.
    """

    stamp_ns: int
    values: tuple[float, ...]
    saturated: bool


def read(mode: PayloadMode, data: bytes, rate: float) -> DotReading:
    """Read a notification.

    Args:
        mode: One of `RECORDABLE`.
        data: Its bytes.
        rate: Output rate [Hz], over whose period increments were taken.

    Raises:
        MalformedPayload: It does not fit the mode.
    """
    found = parse(mode, data)
    q = _orientation(found) if mode.has_orientation else ()
    if "dq" in found:
        gyr = tuple(rate * angle for angle in _rotation_vector(found["dq"]))
    else:
        gyr = tuple(DEG * value for value in found["angular_velocity"])
    if "acceleration" in found:
        acc = found["acceleration"]
    elif "dv" in found:
        acc = tuple(rate * value for value in found["dv"])
    else:
        x, y, z = found["free_acceleration"]
        acc = _rotate_back(q, (x, y, z + STANDARD_GRAVITY))
    mag = tuple(
        value / FIXED_POINT * ARBITRARY_UNIT_UT for value in found.get("magnetic_field", ())
    )
    saturated = max(map(abs, gyr)) >= RATE_RANGE or max(map(abs, acc)) >= FORCE_RANGE
    return DotReading(int(found["timestamp"][0]) * TICK_NS, (*gyr, *acc, *mag, *q), saturated)


def _orientation(found: dict[str, tuple[float, ...]]) -> tuple[float, ...]:
    """Unit quaternion; from Euler angles roll, pitch, yaw [deg] (about x, y, z: R = Rz Ry Rx) where
    only those were sent.
    """
    if "quaternion" in found:
        q = found["quaternion"]
    else:
        halves = [0.5 * DEG * angle for angle in found["euler"]]
        (cx, cy, cz), (sx, sy, sz) = [math.cos(h) for h in halves], [math.sin(h) for h in halves]
        q = (
            cx * cy * cz + sx * sy * sz,
            sx * cy * cz - cx * sy * sz,
            cx * sy * cz + sx * cy * sz,
            cx * cy * sz - sx * sy * cz,
        )
    norm = math.hypot(*q)
    if abs(norm - 1) > 0.05:
        raise MalformedPayload(f"holds a quaternion of norm {norm:.3f}")
    return tuple(part / norm for part in q)


def _rotation_vector(q: tuple[float, ...]) -> tuple[float, float, float]:
    """Angle times axis of a small rotation [rad]."""
    w, x, y, z = q if q[0] >= 0 else tuple(-part for part in q)
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return scale * x, scale * y, scale * z


def _rotate_back(q: tuple[float, ...], v: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector of the earth frame in the sensor frame: v + 2 u x (u x v + w v) with the conjugate
    quaternion.
    """
    w, x, y, z = q[0], -q[1], -q[2], -q[3]
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@dataclass(frozen=True)
class DeviceInfo:
    """Who a DOT is [table 6]."""

    address: str
    firmware: str
    serial_number: str
    product_code: str


def parse_device_info(data: bytes) -> DeviceInfo:
    """Read characteristic 0x1001.

    Raises:
        MalformedPayload: Too short.
    """
    if len(data) < 34:
        raise MalformedPayload(f"the device information has {len(data)} bytes, not 34")
    address = ":".join(f"{byte:02X}" for byte in reversed(data[:6]))
    serial = f"{int.from_bytes(data[20:28], 'little'):X}"
    return DeviceInfo(
        address,
        ".".join(str(b) for b in data[6:9]),
        serial,
        data[28:34].decode("ascii", "replace").strip("\0 "),
    )


@dataclass(frozen=True)
class DeviceSettings:
    """How a DOT is set up [table 7]: its tag, output rate [Hz] and filter profile."""

    tag: str
    rate: int
    profile: int


def parse_device_control(data: bytes) -> DeviceSettings:
    """Read characteristic 0x1002.

    Raises:
        MalformedPayload: Too short.
    """
    if len(data) < 27:
        raise MalformedPayload(f"the device settings have {len(data)} bytes, not 32")
    tag = bytes(data[8 : 8 + min(data[7], 16)]).decode("utf-8", "replace").strip("\0 ")
    return DeviceSettings(tag, int.from_bytes(data[24:26], "little"), data[26])


def set_rate_command(control: bytes, rate: int) -> bytes:
    """Bytes for 0x1002 that set the output rate alone: bit 4 of the visit index."""
    data = bytearray(control[:32].ljust(32, b"\0"))
    data[0] = 0x10
    data[1] = data[2] = 0  # neither blink nor power off
    data[24:26] = rate.to_bytes(2, "little")
    return bytes(data)


def measurement_command(mode: PayloadMode, start: bool) -> bytes:
    """Bytes for 0x2001: type 1 (measurement), action, payload mode [table 13]."""
    return bytes((1, int(start), mode.id))
