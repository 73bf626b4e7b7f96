"""The axes of a sensor that was laid on its faces and turned by hand, without any other truth.

A person says which axis of the part pointed up in each rest, in their order. The mean force of each
rest then tells which axis of the recording is each of the part's; and as gravity must go from one
rest to the next as the gyroscope turned, that map of the gyroscope is found under which it does
(Cabezuelo 2019, section 4.2.1, does both by eye).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.consistency.angular_rate import MAPS, names_of
from testbench.estimation.signals.segmentation import detect_static, intervals_of
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation

FACES = {
    f"{sign}{axis}": size * np.eye(3)[i]
    for sign, size in (("+", 1.0), ("-", -1.0))
    for i, axis in enumerate("xyz")
}
"""Which axis points up, and the direction of the force then."""
LEAST_REST_S = 1.0
LEAST_RANK = 0.3
"""Smallest singular value of the faces' directions over the largest: three axes were up [1]."""
CLEAR = 2.0
"""The second-best map of the gyroscope must miss gravity by so many times more [1]."""


@dataclass(frozen=True)
class FaceAxes:
    """What rests on the faces tell of a sensor.

    Attributes:
        rests_s: Begin and end of each rest [s], shape (k, 2).
        acc: Which axis of the recording is each of the part's, such as "x: +x, y: +y, z: +z"; None
            where not every axis was up.
        crooked_deg: Angle that is left between that map and the readings.
        gain: Size of the readings over gravity [1].
        gyr: The same of the gyroscope; None where the turns tell none from another.
        missed_deg: RMS angle by which gravity is missed after each turn by that map.
        next_missed_deg: The same of the next best map.
    """

    rests_s: np.ndarray
    acc: str | None
    crooked_deg: float
    gain: float
    gyr: str | None
    missed_deg: float
    next_missed_deg: float


# Longer than a screen: rests, the map of the forces, and that of the rates.
def face_axes(
    gyr: np.ndarray,
    acc: np.ndarray,
    interval: float,
    faces: list[str],
    least_s: float = LEAST_REST_S,
) -> FaceAxes:
    """Axes by rests on the faces.

    Args:
        gyr: Shape (n, 3) [rad/s].
        acc: Shape (n, 3) [m/s^2].
        interval: Between samples [s].
        faces: Which axis of the part pointed up in each rest, such as "+z", in their order.
        least_s: Shortest rest that counts [s].

    Raises:
        InputError: A face has no such name, or there are not as many rests as faces.
    """
    unknown = [name for name in faces if name not in FACES]
    if unknown:
        raise InputError(f"--faces: {unknown[0]} is no face; they are {', '.join(FACES)}")
    rests = intervals_of(detect_static(gyr, interval), round(least_s / interval))
    times = rests * interval
    if len(rests) != len(faces):
        listing = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in times) or "none"
        raise InputError(
            f"--faces names {len(faces)} rests, and {len(rests)} of {least_s:g} s or more were "
            f"found ({listing} s)"
        )
    up = np.array([FACES[name] for name in faces])
    felt = np.array([np.nanmean(acc[a:b], axis=0) for a, b in rests])
    gain = float(np.linalg.norm(felt, axis=1).mean() / STANDARD_GRAVITY)
    singular = np.linalg.svd(up, compute_uv=False)
    if len(singular) < 3 or singular[2] < LEAST_RANK * singular[0]:
        return FaceAxes(times, None, np.nan, gain, None, np.nan, np.nan)
    # up = M felt, and the signed map that is nearest to M
    M = np.linalg.lstsq(felt, up, rcond=None)[0].T
    best = MAPS[int(np.argmax(np.einsum("kij,ij->k", MAPS, M)))]
    left = np.linalg.svd(best.T @ M)
    turn = left[0] @ left[2]
    crooked = np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    bias = np.mean([gyr[a:b].mean(axis=0) for a, b in rests], axis=0)
    missed = _missed(np.einsum("kij,nj->kni", MAPS, gyr - bias), interval, rests, felt @ best.T)
    order = np.argsort(missed)
    clear = len(rests) > 2 and missed[order[1]] > CLEAR * missed[order[0]]
    gyr_map = names_of(MAPS[order[0]]) if clear else None
    first, second = np.degrees(missed[order[:2]])
    return FaceAxes(
        times, names_of(best), float(crooked), gain, gyr_map, float(first), float(second)
    )


def _missed(rates: np.ndarray, interval: float, rests: np.ndarray, up: np.ndarray) -> np.ndarray:
    """RMS angle between gravity after each turn and where each map's rates carry it, shape (k,)
    [rad].

    Args:
        rates: By every map, shape (k, n, 3) [rad/s].
        interval: Between samples [s].
        rests: Begin and end of each, shape (r, 2).
        up: Direction of the force in each, shape (r, 3).
    """
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    squares = np.zeros(len(rates))
    for i in range(len(rests) - 1):
        u = np.tile(up[i], (len(rates), 1))
        for step in range(rests[i, 1], rests[i + 1, 0]):
            # a vector that stands in the world turns by -omega dt in the sensor
            turn = rotation.from_rotation_vector(-rates[:, step] * interval)
            u = rotation.rotate(turn, u)
        squares += np.arccos(np.clip(u @ up[i + 1], -1, 1)) ** 2
    return np.sqrt(squares / max(len(rests) - 1, 1))
