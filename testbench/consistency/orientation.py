"""The orientation that a sensor reports, against what its accelerometer and gyroscope read.

Turned into the earth by it, the specific force at rest, and on the average, points up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.consistency.excerpt import Excerpt
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM, to_earth_frame

BLOCK_S = 1.0
MOST_STEPS = 20_000
NEAR = np.radians(15)
"""Turned into the earth, means of the specific force may be off the axis by so much (median)."""
LEAST_RATE = 0.3
"""Turning that tells what an orientation says of it [rad/s]."""
RATES_AGREE, RATES_DIFFER = 0.35, 0.7
"""The usual difference of rates, as a part of the rate, below and above which they do."""
LEAST_TURNING = 50
UPS = {
    "z": np.array([0, 0, 1.0]),
    "-z": np.array([0, 0, -1.0]),
    "y": np.array([0, 1.0, 0]),
    "-y": np.array([0, -1.0, 0]),
    "x": np.array([1.0, 0, 0]),
    "-x": np.array([-1.0, 0, 0]),
}
READINGS = ((0, False), (1, False), (-1, False), (0, True), (1, True), (-1, True))
"""By how much the four numbers are shifted, and whether it turns the other way."""


@dataclass(frozen=True)
class Read:
    """One reading of an orientation.

    Attributes:
        shift: The four numbers are shifted by so much: 1 reads as x y z w what was read as w x y z,
            -1 the other way about.
        inverse: Whether it turns from the earth into the sensor.
        up: Axis of its earth that points up, None if none does.
        off: Median angle of the specific force from that axis [rad].
        rates: Whether its turning is that of the gyroscope; None where that cannot be told.
    """

    shift: int
    inverse: bool
    up: str | None
    off: float
    rates: bool | None

    @property
    def is_plain(self) -> bool:
        """Whether the numbers are taken as they are."""
        return self.shift == 0 and not self.inverse


LARGEST = 10.0
"""A part of a quaternion beyond this is no part of one."""


def read_orientation(
    excerpt: Excerpt, seconds: float, earths: Sequence[str] = ("ENU",)
) -> list[Read]:
    """How each reading of the orientation fits, as it is first; none where nothing can be said.

    Args:
        excerpt: Of the recording.
        seconds: Of a step.
        earths: Those that the file's numbers were taken to be of before they were turned to ENU,
            which is undone before they are read otherwise.
    """
    assert excerpt.device_q is not None
    size = max(round(BLOCK_S / seconds), 1)
    count = min(len(excerpt.acc) // size, MOST_STEPS // size)
    if count < 3:
        return []
    blocks = np.unique(np.linspace(0, len(excerpt.acc) // size - 1, count).astype(int))
    rows = blocks[:, None] * size + np.arange(size)
    q, acc, gyr = excerpt.device_q[rows], excerpt.acc[rows], excerpt.gyr[rows]
    q = np.where(np.abs(q) < LARGEST, q, np.nan)
    norm = np.linalg.norm(q, axis=2)
    known = (np.isfinite(acc).all(axis=2) & (norm > 0.5)).all(axis=1)
    if known.sum() < 3:
        return []
    q, acc, gyr = q[known] / norm[known][..., None], acc[known], gyr[known]
    return [
        _read(_read_as(q, earth, shift, inverse), acc, gyr, seconds, shift, inverse)
        for earth in earths
        for shift, inverse in READINGS
    ]


def _read_as(q: np.ndarray, earth: str, shift: int, inverse: bool) -> np.ndarray:
    """q_enu_from_sensor if the file's numbers, of an earth, are read in another way."""
    own = np.roll(to_earth_frame(q, earth), shift, axis=-1)
    own = rotation.conjugate(own) if inverse else own
    return rotation.multiply(np.array(Q_ENU_FROM[earth]), own)


def _read(
    own: np.ndarray, acc: np.ndarray, gyr: np.ndarray, seconds: float, shift: int, inverse: bool
) -> Read:
    force = rotation.rotate(own.reshape(-1, 4), acc.reshape(-1, 3)).reshape(acc.shape)
    mean = force.mean(axis=1)
    length = np.maximum(np.linalg.norm(mean, axis=1), 1e-9)
    angles = {
        name: float(np.median(np.arccos(np.clip(mean @ axis / length, -1, 1))))
        for name, axis in UPS.items()
    }
    up = min(angles, key=lambda name: angles[name])
    return Read(
        shift,
        inverse,
        up if angles[up] < NEAR else None,
        angles[up],
        _same_rates(own, gyr, seconds),
    )


def _same_rates(q: np.ndarray, gyr: np.ndarray, seconds: float) -> bool | None:
    """Whether an orientation turns as the gyroscope says; None where it cannot be told."""
    step = rotation.multiply(
        rotation.conjugate(q[:, :-1]).reshape(-1, 4), np.ascontiguousarray(q[:, 1:]).reshape(-1, 4)
    )
    told = rotation.to_rotation_vector(step) / seconds
    rate = ((gyr[:, 1:] + gyr[:, :-1]) / 2).reshape(-1, 3)
    size = np.linalg.norm(rate, axis=1)
    turning = size > LEAST_RATE
    if turning.sum() < LEAST_TURNING:
        return None
    off = float(np.median(np.linalg.norm(told - rate, axis=1)[turning] / size[turning]))
    return True if off < RATES_AGREE else False if off > RATES_DIFFER else None


def has_orientation(excerpt: Excerpt) -> bool:
    """Whether there is any orientation of the device."""
    return excerpt.device_q is not None and bool(np.isfinite(excerpt.device_q).any())


def height_of_field(acc: np.ndarray, mag: np.ndarray) -> float | None:
    """How far the magnetic field usually points up from level, None if unknown [rad].

    Args:
        acc: Specific force, shape (n, 3).
        mag: Field in the same axes, shape (n, 3).
    """
    product = np.linalg.norm(acc, axis=1) * np.linalg.norm(mag, axis=1)
    known = np.isfinite(product) & (product > 0)
    if not known.any():
        return None
    sines = np.einsum("ij,ij->i", acc[known], mag[known]) / product[known]
    return float(np.arcsin(np.clip(np.median(sines), -1, 1)))


def heading_axis(excerpt: Excerpt) -> str | None:
    """Which axis of the earth of the orientation the magnetic field points along: "x" or "y", None
    where neither is near.
    """
    if excerpt.mag is None or excerpt.device_q is None:
        return None
    rows = np.unique(
        np.linspace(0, len(excerpt.mag) - 1, min(len(excerpt.mag), MOST_STEPS)).astype(int)
    )
    q, mag = excerpt.device_q[rows], excerpt.mag[rows]
    known = np.isfinite(mag).all(axis=1) & (np.linalg.norm(q, axis=1) > 0.5)
    if known.sum() < 10:
        return None
    field = rotation.rotate(rotation.normalise(q[known]), mag[known])
    north = np.arctan2(field[:, 1].mean(), field[:, 0].mean())
    if abs(north) < np.radians(30):
        return "x"
    return "y" if abs(north - np.pi / 2) < np.radians(30) else None
