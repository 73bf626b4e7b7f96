"""How a sensor is worn: its readings in a level frame, before any filter sees them.

An Euler filter holds pitch between -90 and 90 deg. Worn in front of the shank, a sensor's x axis
points up: its own pitch stands at 90 deg, where roll and yaw cannot be told apart. Readings are
therefore turned into the level frame first (x along roll, y along pitch, z up), as Cabezuelo (2019)
does with his axis maps. His maps have z down and count gravity as negative; turned over, with z up
and the specific force as every sensor gives it, roll and pitch of his equations are the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.gait.parameters import MOUNTINGS
from testbench.exceptions import InputError
from testbench.model import rotation

FOUND = "found"
"""In place of a mounting's name: by gravity and by the axis that the limb swings about."""
MOST_LEAN = np.radians(45.0)
"""A limb hangs or stands nearer to the vertical than this, on the average of a walk [rad]."""
NEAR = np.radians(25.0)
"""A mounting that was found is called as the published one that it is so near to [rad]."""


def mounting_matrix(
    mounting: str, gyr: np.ndarray, acc: np.ndarray, where: str = ""
) -> tuple[np.ndarray, str]:
    """R_level_from_sensor, and what the mounting is called.

    Args:
        mounting: A key of `MOUNTINGS`, or `FOUND`.
        gyr: Angular rate without bias, shape (n, 3) [rad/s].
        acc: Specific force, shape (n, 3) [m/s^2]; rows that are not finite are passed over.
        where: The sensor, for messages.

    Raises:
        InputError: Gravity does not lie where the named mounting has it.
    """
    up = np.nanmean(acc, axis=0)
    up /= np.linalg.norm(up)
    found = _found(gyr, up)
    name = _nearest(found)
    if mounting == FOUND:
        return found, name
    stated = np.array(MOUNTINGS[mounting], dtype=float)
    lean = float(np.arccos(np.clip(stated[2] @ up, -1, 1)))
    if lean > MOST_LEAN:
        axes = ", ".join(f"{value:+.2f}" for value in up)
        fits = f"it looks like '{name}'" if name else "it looks like none that has a name"
        raise InputError(
            f"{where}: worn '{mounting}' it would lean by {np.degrees(lean):.0f} deg on the "
            f"average: up is ({axes}) in its axes; {fits}. Leave --mounting out to have it found; "
            "a recording that was imported with --axes has its axes turned already"
        )
    return stated, mounting


def levelled(samples: UniformSamples, R_level_from_sensor: np.ndarray) -> UniformSamples:
    """The readings in the level frame.

    Args:
        samples: In the sensor's frame.
        R_level_from_sensor: Shape (3, 3).
    """
    R = R_level_from_sensor
    mag = None if samples.mag is None else samples.mag @ R.T
    device_q = samples.device_q
    if device_q is not None:
        back = rotation.conjugate(rotation.from_matrix(R))
        device_q = rotation.multiply(device_q, back)
    return replace(
        samples, gyr=samples.gyr @ R.T, acc=samples.acc @ R.T, mag=mag, device_q=device_q
    )


def _found(gyr: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Rows x, y, z of the level frame: z up, y along the principal axis of the level rates."""
    across = gyr - (gyr @ up)[:, None] * up
    _, axes = np.linalg.eigh(across.T @ across)
    pitch = axes[:, 2] - up * (axes[:, 2] @ up)
    pitch /= np.linalg.norm(pitch)
    if pitch[np.argmax(np.abs(pitch))] < 0:
        pitch = -pitch  # forward and backward look alike; the published ones have it so
    return np.vstack([np.cross(pitch, up), pitch, up])


def _nearest(R_level_from_sensor: np.ndarray) -> str:
    """The named mounting that is near, be it turned by half a turn about the vertical; or ""."""
    half = np.diag([-1.0, -1.0, 1.0])
    best, name = NEAR, ""
    for key, rows in MOUNTINGS.items():
        for turn in (np.eye(3), half):
            between = R_level_from_sensor @ (turn @ np.array(rows, dtype=float)).T
            angle = float(np.arccos(np.clip((np.trace(between) - 1) / 2, -1, 1)))
            if angle < best:
                best, name = angle, key
    return name
