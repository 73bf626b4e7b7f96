"""Heading between the sensors of a joint over time, from the axes that the joint turns about.

Filters without a magnetometer know up but not north, and what their gyroscopes are wrong by about
the vertical turns their headings apart. A joint with one or two axes tells by how much, wherever an
axis is not vertical: seen by both sensors, a hinge's axis is one direction, and the axes of a joint
with two keep their angle. The heading d turns the world of the distal sensor into that of the
proximal one, so that rotation by d about the vertical corrects the distal orientation.

The constraints are those of Laidig, Schauer & Seel (ICORR 2017, one axis) and Laidig, Lehmann,
Begin & Seel (EMBC 2019, two). In place of their moving windows a Kalman filter and smoother follows
the heading, which walks at random. What the constraint is off by lasts for seconds (a state of the
filter), but for the part that the stated axes are off by in their segments: that one lasts for
ever, and what it may do to the heading is added to the uncertainty. To estimate it too was tried:
errors of inclination that go with the motion then pass for errors of the axes, and the heading
becomes three times worse.

How much the constraint is off by within seconds is what makes the looks likeliest (`_likeliest`): a
filter that expects 3 deg of a joint that keeps its axes to a hundredth takes a drift for a misfit,
and stays several degrees behind it. How fast the heading walks stays as stated: a walk that is free
explains every misfit.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.calibration.joint_heading import heading_1d, heading_2d
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_axes import axes_in_world, heading_slope, heading_terms
from testbench.model.windows import moving_mean
from testbench.records.results.estimate import RelativeHeading
from testbench.records.specs.joint_definition import JointConstraint

RATE_HZ = 10.0
"""The constraint is looked at so often; headings drift in minutes."""
SLOW_S, FAST_SD = 5.0, np.radians(0.5)
"""How long most of what the constraint is off by lasts [s], and the part of each look [rad]."""
MISFITS = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003)
"""What the constraint may be off by within seconds, as parts of what the axes are stated to [1]."""
EXACT = 0.03
"""A joint is believed to keep its axes better than stated only where it does so to this part of it:
else errors of inclination that go with the motion pass for a heading [1].
"""
WINDOW_S = 60.0
"""About this long a window decides on the heading in its middle [s]."""
SURE = 2.0
"""Half the likelihood ratio that two parameters reach by chance once in seven times [1]."""
START_SD, LARGEST_SD = np.radians(0.5), np.radians(30.0)
"""Of the heading in the reference pose, which the alignment has brought to zero as well as a sensor
is mounted (`uncertainty` in robots/ur3e), and the most that it is begun with [rad].
"""


def track_heading(
    time_ns: np.ndarray,
    q_world_from_proximal: np.ndarray,
    q_world_from_distal: np.ndarray,
    constraint: JointConstraint,
    start_ns: int | None,
) -> RelativeHeading:
    """Follow the heading over the whole of a recording.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        q_world_from_proximal: Of the proximal segment, shape (n, 4).
        q_world_from_distal: Of the distal segment, at the same instants, shape (n, 4).
        constraint: The joint's axes in its segments.
        start_ns: Where the heading is zero, but for `START_SD`; None where nobody knows it: then a
            constant heading that suits the whole is the first guess.

    Raises:
        PoorExcitation: The start is unknown, and the motion does not tell.
    """
    seconds = (time_ns - time_ns[0]) / NANOSECONDS
    sound = np.isfinite(q_world_from_proximal[:, 0]) & np.isfinite(q_world_from_distal[:, 0])
    count = max(int(np.ceil(seconds[-1] * RATE_HZ)) + 1, 2)
    rows = np.unique(np.searchsorted(seconds, np.linspace(0.0, seconds[-1], count)))
    rows = rows[sound[rows]]
    if len(rows) == 0:
        return RelativeHeading(np.zeros(len(time_ns)), np.full(len(time_ns), START_SD))
    q_proximal, q_distal = q_world_from_proximal[rows], q_world_from_distal[rows]
    at, terms = (
        seconds[rows],
        heading_terms(*axes_in_world(q_proximal, q_distal, constraint), constraint),
    )
    # the sd after a minute, as one of a second
    walk = np.radians(constraint.drift_deg) / np.sqrt(60.0)
    axes_sd = np.radians(constraint.axes_sd_deg)
    if start_ns is None:
        known, (first, first_sd) = -1, _guess(q_proximal, q_distal, constraint)
    else:
        known = min(int(np.searchsorted(time_ns[rows], start_ns)), len(rows) - 1)
        first, first_sd = (
            0.0,
            min(float(np.hypot(START_SD, walk * np.sqrt(at[known] - at[0]))), LARGEST_SD),
        )
    look = (at, terms, first, first_sd, known)
    misfit = _likeliest(look, walk, axes_sd)
    heading, variance, _ = _smooth(*look, walk, (misfit * axes_sd, misfit * FAST_SD))
    lasting = axes_sd**2 / 2 * _response(heading, terms, q_proximal, q_distal, constraint)
    # where the axes tell nothing
    told = first_sd**2 if known < 0 else START_SD**2 + np.abs(at - at[known]) * walk**2
    sd = np.sqrt(variance + np.minimum(lasting, told))
    return RelativeHeading(np.interp(seconds, at, heading), np.interp(seconds, at, sd))


def _likeliest(
    look: tuple[np.ndarray, np.ndarray, float, float, int], walk: float, axes_sd: float
) -> float:
    """The misfit, of `MISFITS`, that makes the looks likeliest.

    By the likelihood of the innovations (Särkkä, Bayesian Filtering and Smoothing, 2013, eq.
    12.11). What is stated is kept where nothing is clearly likelier (`SURE`), or not `EXACT`.

    Args:
        look: The first arguments of `_smooth`.
        walk: As stated [rad/sqrt(s)].
        axes_sd: As stated [rad].
    """
    found = {
        misfit: float(_smooth(*look, walk, (misfit * axes_sd, misfit * FAST_SD))[2])
        for misfit in MISFITS
    }
    best = max(found, key=lambda misfit: found[misfit])
    return best if best <= EXACT and found[best] > found[1.0] + SURE else 1.0


def _guess(
    q_proximal: np.ndarray, q_distal: np.ndarray, constraint: JointConstraint
) -> tuple[float, float]:
    """A constant heading that suits all samples, and its standard deviation."""
    proximal, distal = np.array(constraint.proximal_axis), np.array(constraint.distal_axis)
    independent = max(len(q_proximal) / (RATE_HZ * SLOW_S), 2.0)
    if constraint.angle_deg == 0:
        fit = heading_1d(q_proximal, proximal, q_distal, distal, independent)
    else:
        fit = heading_2d(
            q_proximal, proximal, q_distal, distal, np.radians(constraint.angle_deg), independent
        )
    return fit["heading"], float(
        np.hypot(np.sqrt(fit.covariance[0, 0]), np.radians(constraint.axes_sd_deg))
    )


def _response(
    heading: np.ndarray,
    terms: np.ndarray,
    q_proximal: np.ndarray,
    q_distal: np.ndarray,
    constraint: JointConstraint,
) -> np.ndarray:
    """Squared response of the heading to a lasting error of the axes, shape (m,) [rad^2/rad^2].

    It is that of a least squares over `WINDOW_S`.
    With j2' = j2 turned by the heading, two axes are off by j1 . j2' / sin(angle), whose
    differential is j2' . dj1 + j1 . dj2'; one is off by z . (j2' x j1) / length, with (z x j2') .
    dj1 + (j1 x z) . dj2'. An axis that is off by the small rotation e in its segment, dj = R (e x
    axis), adds (axis x R' w) . e, w being what stands before dj.
    """
    proximal, distal = axes_in_world(q_proximal, q_distal, constraint)
    turned = rotation.rotate(rotation.from_heading(heading), distal)
    if constraint.angle_deg == 0:
        up = np.array([0.0, 0.0, 1.0])
        lengths = np.hypot(*proximal[:, :2].T) * np.hypot(*distal[:, :2].T)
        scale = 1 / np.sqrt(np.maximum(lengths, 1e-12))[:, None]
        for_proximal, for_distal = scale * np.cross(up, turned), scale * np.cross(proximal, up)
    else:
        scale = 1 / np.sin(np.radians(constraint.angle_deg))
        for_proximal, for_distal = scale * turned, scale * proximal
    for_distal = rotation.rotate(rotation.from_heading(-heading), for_distal)
    # axis x R' w of both axes
    levers = np.hstack(
        [
            np.cross(
                np.array(constraint.proximal_axis),
                rotation.rotate(rotation.conjugate(q_proximal), for_proximal),
            ),
            np.cross(
                np.array(constraint.distal_axis),
                rotation.rotate(rotation.conjugate(q_distal), for_distal),
            ),
        ]
    )
    slope = heading_slope(terms, heading)
    width = min(max(int(WINDOW_S * RATE_HZ), 1), len(slope))
    both = moving_mean(slope[:, None] * levers, width, "held")
    known = moving_mean(slope**2, width, "held")
    return np.asarray(np.sum(both**2, axis=1) / np.maximum(known, 1e-12) ** 2)


@njit(cache=True)
def _smooth(
    seconds: np.ndarray,
    terms: np.ndarray,
    first: float,
    first_sd: float,
    known: int,
    walk: float,
    misfit_sd: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray, float]:
    """Extended Kalman filter and Rauch-Tung-Striebel smoother (Särkkä 2013, algorithms 5.4 and
    9.1).

    The state is the heading and the slow part of what the constraint is off by. At the look `known`
    the heading is zero, but for `START_SD`; -1: at none.

    Returns:
        Heading and its variance, shapes (m,), and the logarithm of the likelihood of the looks.
    """
    m = len(seconds)
    axes_sd, fast_sd = misfit_sd  # of the slow part, and of each look
    x, P = np.empty((m, 2)), np.empty((m, 2, 2))  # after each look
    ahead, P_ahead = np.zeros((m, 2)), np.zeros((m, 2, 2))  # before it
    likelihood = 0.0
    ahead[0, 0], P_ahead[0, 0, 0], P_ahead[0, 1, 1] = first, first_sd**2, axes_sd**2
    for k in range(m):
        if k > 0:  # prediction: the heading walks, the slow part fades
            dt = abs(seconds[k] - seconds[k - 1])
            kept = np.exp(-dt / SLOW_S)
            ahead[k, 0], ahead[k, 1] = x[k - 1, 0], kept * x[k - 1, 1]
            P_ahead[k, 0, 0] = P[k - 1, 0, 0] + walk**2 * dt
            P_ahead[k, 0, 1] = kept * P[k - 1, 0, 1]
            P_ahead[k, 1, 0] = P_ahead[k, 0, 1]
            P_ahead[k, 1, 1] = kept**2 * P[k - 1, 1, 1] + axes_sd**2 * (1 - kept**2)
        # update by a cos d + b sin d + c + slow part = 0
        a, b, c = terms[k]
        sine, cosine = np.sin(ahead[k, 0]), np.cos(ahead[k, 0])
        H = np.array([b * cosine - a * sine, 1.0])
        left = -(a * cosine + b * sine + c) - ahead[k, 1]
        gain = P_ahead[k] @ H
        variance = H @ gain + fast_sd**2
        likelihood -= 0.5 * (np.log(variance) + left**2 / variance)
        x[k] = ahead[k] + gain / variance * left
        P[k] = P_ahead[k] - np.outer(gain, gain) / variance
        if k == known and k > 0:  # at the first look it is what the filter begins with
            gain = P[k, :, 0] / (P[k, 0, 0] + START_SD**2)
            x[k] = x[k] - gain * x[k, 0]
            P[k] = P[k] - np.outer(gain, P[k, 0])
    for k in range(m - 2, -1, -1):  # backwards: x + C (x_later - ahead), and P alike
        F = np.array([[1.0, 0.0], [0.0, np.exp(-abs(seconds[k + 1] - seconds[k]) / SLOW_S)]])
        back = P[k] @ F @ np.linalg.inv(P_ahead[k + 1])
        x[k] = x[k] + back @ (x[k + 1] - ahead[k + 1])
        P[k] = P[k] + back @ (P[k + 1] - P_ahead[k + 1]) @ back.T
    return x[:, 0].copy(), P[:, 0, 0].copy(), likelihood
