"""Heading over time: the yaw of an orientation series, and how far it drifts from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.joint_angle import unwrapped


@dataclass(frozen=True)
class HeadingDrift:
    """Drift of a heading from its first to its last part [rad].

    Attributes:
        drift: Mean error of the last part less that of the first, signed, with its turns.
        largest: Largest magnitude of the error against the first part at any instant.
        span_s: Between the middles of the two parts.
    """

    drift: float
    largest: float
    span_s: float


def yaw(q_world_from_frame: np.ndarray) -> np.ndarray:
    """Yaw of the intrinsic ZYX sequence, without jumps of a turn.

    It is the heading of the frame's x axis, and means nothing where that axis is vertical.

    Args:
        q_world_from_frame: In the order of time, shape (n, 4).

    Returns:
        Shape (n,) [rad]; NaN where q is not finite.
    """
    q = np.asarray(q_world_from_frame, float)
    w, x, y, z = np.moveaxis(q, -1, 0)
    return unwrapped(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def heading_drift(
    time_ns: np.ndarray,
    q_world_from_frame: np.ndarray,
    q_true: np.ndarray | None = None,
    part: float = 0.05,
) -> HeadingDrift:
    """How far a heading drifted over a series that should begin and end at rest.

    Args:
        time_ns: Increasing, shape (n,).
        q_world_from_frame: Of the frame whose heading is looked at, shape (n, 4).
        q_true: The same by the truth, shape (n, 4); without it the heading is taken to be constant,
            as in a straight corridor.
        part: Fraction of the series at either end over which the error is averaged.

    Raises:
        InputError: Fewer than ten samples of both are finite.
    """
    error = yaw(q_world_from_frame) if q_true is None else heading_error(q_world_from_frame, q_true)
    rows = np.flatnonzero(np.isfinite(error))
    if len(rows) < 10:
        raise InputError(
            f"the drift of a heading needs at least ten samples with a truth, not {len(rows)}"
        )
    ends = max(round(part * len(rows)), 1)
    first, last = rows[:ends], rows[-ends:]
    error = error - error[first].mean()
    span = float(time_ns[last].mean() - time_ns[first].mean()) / 1e9
    return HeadingDrift(float(error[last].mean()), float(np.abs(error[rows]).max()), span)


def heading_error(q_estimated: np.ndarray, q_true: np.ndarray) -> np.ndarray:
    """Heading of the error q_estimated conj(q_true), without jumps of a turn.

    Args:
        q_estimated: In the order of time, shape (n, 4).
        q_true: At the same instants, shape (n, 4).

    Returns:
        Shape (n,) [rad].
    """
    return unwrapped(
        rotation.heading_angle(rotation.multiply(q_estimated, rotation.conjugate(q_true)))
    )
