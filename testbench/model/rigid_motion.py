"""A body's motion by its poses over time: quintic splines, and what they make of rates and forces.

Accelerations are second derivatives of what a file says, so noise of a position is felt: 0.1 mm at
100 Hz are some 2 m/s^2. Poses that were measured are smoothed before they are given.
"""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import FrameMotion

LEAST_POSES = 6
"""A quintic spline needs as many."""


class RigidMotion:
    """Pose, rate and acceleration of a body at any time; it rests before its first pose and after
    its last.

    Args:
        time_ns: Increasing, shape (n,), int64 [ns].
        position: In the world, shape (n, 3) [m].
        q_world_from_body: Unit quaternions, shape (n, 4).
    """

    def __init__(self, time_ns: np.ndarray, position: np.ndarray, q_world_from_body: np.ndarray):
        self.time_ns = np.asarray(time_ns, np.int64)
        seconds = (self.time_ns - self.time_ns[0]) / NANOSECONDS
        q = rotation.normalise(np.asarray(q_world_from_body, float))
        # neighbouring quaternions of equal sign, so that their components have no jumps
        turns = np.sign(np.sum(q[1:] * q[:-1], axis=1))
        q[1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, None]
        from scipy.interpolate import make_interp_spline  # a third of a second to load

        self._place = make_interp_spline(seconds, np.asarray(position, float), k=5)
        self._turn = make_interp_spline(seconds, q, k=5)

    @property
    def duration(self) -> float:
        """From the first pose to the last [s]."""
        return float(self.time_ns[-1] - self.time_ns[0]) / NANOSECONDS

    def at(self, time_ns: np.ndarray) -> FrameMotion:
        """Motion at times.

        Args:
            time_ns: Shape (n,), int64 [ns].
        """
        seconds = (np.asarray(time_ns, np.int64) - self.time_ns[0]) / NANOSECONDS
        t = np.clip(seconds, 0.0, self.duration)
        moving = ((seconds >= 0) & (seconds <= self.duration)).astype(float)[:, None]
        s, ds, dds = (self._turn(t, order) for order in range(3))
        r = np.linalg.norm(s, axis=1, keepdims=True)
        q, back = s / r, rotation.conjugate(s / r)
        # of s = r q with a unit q: q' = q w / 2, so that w = 2 conj(q) s' / r in the body's axes,
        # and w' = 2 (conj(q) s'' / r) - 2 (r' / r) w, with r' = s . s' / r
        w = 2 * rotation.multiply(back, ds)[:, 1:] / r
        growth = np.sum(s * ds, axis=1, keepdims=True) / r**2
        dw = 2 * rotation.multiply(back, dds)[:, 1:] / r - 2 * growth * w
        velocity, acceleration = self._place(t, 1), self._place(t, 2)
        return FrameMotion(
            self._place(t),
            rotation.to_matrix(q),
            moving * velocity,
            moving * rotation.rotate(q, w),
            moving * acceleration,
            moving * rotation.rotate(q, dw),
        )
