"""Between the knots of a trajectory, and beyond them."""

from __future__ import annotations

import numpy as np

from testbench.records.session.trajectory import Trajectory

SECOND = 1_000_000_000


def test_between_knots_a_trajectory_is_the_quintic_through_both_and_beyond_them_it_rests():
    # q = t^5 - 2 t^3 + t has these states at 0, 1 and 2 s
    t = np.array([0.0, 1.0, 2.0])[:, None]
    q, v, a = t**5 - 2 * t**3 + t, 5 * t**4 - 6 * t**2 + 1, 20 * t**3 - 12 * t
    trajectory = Trajectory((t[:, 0] * SECOND).astype(np.int64), q, v, a)
    at = np.linspace(0, 2, 37)[:-1]
    found = trajectory.at(np.round(at * SECOND).astype(np.int64))
    wanted = at**5 - 2 * at**3 + at, 5 * at**4 - 6 * at**2 + 1, 20 * at**3 - 12 * at
    for own, expected in zip(found, wanted, strict=True):
        np.testing.assert_allclose(own[:, 0], expected, atol=1e-6)
    for moment, knot in ((-SECOND, 0), (3 * SECOND, 2)):
        position, rate, acceleration = trajectory.at(np.array([moment]))
        assert (position[0, 0], rate[0, 0], acceleration[0, 0]) == (q[knot, 0], 0.0, 0.0)
