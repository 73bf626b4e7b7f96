"""Mappings that several rooms are tried on."""

from __future__ import annotations

import numpy as np

PLAIN = """\
description: a table
time: {column: t, unit: s}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
"""
ARRAYS = """\
description: arrays
time: {column: imu/t, unit: s}
sensors:
  imu:
    acc: {array: imu/acc, unit: m/s^2}
    gyr: {array: imu/gyr, unit: rad/s}
"""
PHONE = """\
description: a phone
time: {column: t, unit: s}
sensors:
  phone:
    acc: {file: Acc*.csv, columns: [x, y, z], unit: m/s^2}
    gyr: {file: Gyr*.csv, columns: [x, y, z], unit: rad/s}
    mag: {file: Mag*.csv, columns: [x, y, z], unit: uT, optional: true}
"""


def check(samples, m, atol=1e-6) -> None:
    np.testing.assert_allclose(samples.acc, m.acc, atol=atol)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=atol / 10)
