"""Payloads of the Xsens DOT against bytes packed by hand."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.drivers.imus.xsens_dot_payload import (
    LONG_PAYLOAD,
    MEDIUM_PAYLOAD,
    MODES,
    SHORT_PAYLOAD,
    MalformedPayload,
    get_mode,
    parse,
    parse_device_control,
    parse_device_info,
    read,
    set_rate_command,
)

G = 9.80665


def test_the_bytes_of_custom_mode_5_mean_what_the_specification_says() -> None:
    # Written out by hand: 0x01020304 us; q = (1, 0, 0, 0); acc = (0, 0, 9.8125) m/s^2; rate = (180,
    # -90, 0.5) deg/s.
    data = bytes.fromhex(
        "04030201 0000803f 00000000 00000000 00000000 00000000 00000000 00001d41 00003443 0000b4c2 "
        "0000003f"
    )
    assert len(data) == MODES["custom_mode_5"].size == 44
    found = parse(
        get_mode("custom_mode_5"), data + bytes(19)
    )  # the characteristic is 63 bytes long
    assert found["timestamp"] == (0x01020304,)
    assert found["quaternion"] == (1, 0, 0, 0)
    assert found["acceleration"] == (0, 0, 9.8125)
    assert found["angular_velocity"] == (180, -90, 0.5)
    reading = read(get_mode("custom_mode_5"), data, 60)
    assert reading.stamp_ns == 0x01020304 * 1000
    np.testing.assert_allclose(
        reading.values, [np.pi, -np.pi / 2, np.radians(0.5), 0, 0, 9.8125, 1, 0, 0, 0]
    )
    assert not reading.saturated
    assert read(
        get_mode("rate_quantities"), struct.pack("<I6f", 1, 0, 0, G, 0, -2000, 0), 60
    ).saturated
    assert read(
        get_mode("rate_quantities"), struct.pack("<I6f", 1, 16 * G, 0, 0, 0, 0, 0), 60
    ).saturated


def test_every_public_mode_has_the_size_and_the_characteristic_of_the_specification() -> None:
    # Tables 14 to 16 of XD0506P revision C.
    sizes = {
        2: 36,
        3: 32,
        4: 16,
        5: 20,
        6: 16,
        7: 32,
        16: 28,
        18: 38,
        19: 32,
        20: 34,
        21: 28,
        22: 40,
        23: 34,
        24: 32,
        26: 44,
    }
    assert {mode.id: mode.size for mode in MODES.values()} == sizes
    for mode in MODES.values():
        expected = (
            LONG_PAYLOAD if mode.size > 40 else MEDIUM_PAYLOAD if mode.size > 20 else SHORT_PAYLOAD
        )
        assert mode.characteristic == expected
    assert MEDIUM_PAYLOAD.upper() == "15172003-4947-11E9-8646-D663BD873D93"


def test_status_and_clip_counts_stand_where_the_specification_puts_them() -> None:
    data = struct.pack("<I4f3f", 5, 1, 0, 0, 0, 0, 0, 0) + bytes.fromhex("1202 03 04")
    found = parse(get_mode("extended_quaternion"), data + bytes(4))
    assert (found["status"], found["clip_acc"], found["clip_gyr"]) == ((0x0212,), (3,), (4,))


def test_specific_force_follows_from_free_acceleration_and_orientation() -> None:
    turned = Rotation.from_euler("ZYX", [40, -20, 70], degrees=True)
    free = np.array([0.5, -1.0, 2.0])
    force = turned.inv().apply(free + [0, 0, G])
    reading = read(
        get_mode("custom_mode_1"), struct.pack("<I9f", 9, 70, -20, 40, *free, 10, 20, 30), 60
    )
    q = turned.as_quat(
        scalar_first=True
    )  # roll, pitch, yaw in the packet are the angles of Z Y X from the right
    np.testing.assert_allclose(reading.values, [*np.radians([10, 20, 30]), *force, *q], atol=1e-5)


def test_increments_over_a_period_become_rates_and_forces() -> None:
    rate, force = np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.2, 9.7])
    dq = Rotation.from_rotvec(rate / 60).as_quat(scalar_first=True)
    packed = struct.pack(
        "<I7f3h", 7, *-dq, *(force / 60), 4096, -2048, 0
    )  # either sign of dq is the same rotation
    reading = read(get_mode("delta_quantities_with_mag"), packed, 60)
    np.testing.assert_allclose(reading.values, [*rate, *force, 40, -20, 0], atol=2e-5)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (bytes(43), "has 43 bytes, custom_mode_5 needs 44"),
        (struct.pack("<I10f", 1, 1, 0, 0, 0, 0, 0, float("nan"), 0, 0, 0), "not finite"),
        (struct.pack("<I10f", 1, 0, 0, 0, 0, 0, 0, G, 0, 0, 0), "quaternion of norm 0.000"),
    ],
)
def test_a_damaged_packet_says_why(data: bytes, why: str) -> None:
    with pytest.raises(MalformedPayload, match=why):
        read(get_mode("custom_mode_5"), data, 60)


def test_device_information_and_settings_are_read_and_only_the_rate_is_written() -> None:
    info = (
        bytes.fromhex("563412CD22D4 020001 e507 05 1f 0c 1e 00 07000000 3412000000ff4201")
        + b"XS-T01"
    )
    found = parse_device_info(info)
    assert (found.address, found.firmware, found.product_code) == (
        "D4:22:CD:12:34:56",
        "2.0.1",
        "XS-T01",
    )
    assert found.serial_number == "142FF0000001234"
    control = (
        bytes.fromhex("00 00 00 0a 00 1e 00 05")
        + b"thigh".ljust(16, b"\0")
        + bytes.fromhex("3c00 01 0000000000")
    )
    settings = parse_device_control(control)
    assert (settings.tag, settings.rate, settings.profile) == ("thigh", 60, 1)
    command = set_rate_command(control, 30)
    assert command[0] == 0x10 and parse_device_control(command).rate == 30
    assert command[1:24] == control[1:24] and command[26:] == control[26:]
