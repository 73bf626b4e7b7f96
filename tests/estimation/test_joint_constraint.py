"""The heading between two sensors over time, from the axes of their joint: drifts that were put in
come out again.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.joints.joint_constraint import START_SD, track_heading
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.specs.joint_definition import JointConstraint

SECONDS, HZ = 300.0, 20.0
TIME = np.arange(0, SECONDS, 1 / HZ)
TIME_NS = np.round(1e9 * TIME).astype(np.int64) + 5_000_000_000
FIRST_AXIS, SECOND_AXIS = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
TWO_AXES = JointConstraint(proximal_axis=[0, 1, 0], distal_axis=[0, 0, 1], angle_deg=90)
HINGE = JointConstraint(proximal_axis=[0, 1, 0], distal_axis=[0, 1, 0])


def quaternions(rotations):
    return np.roll(rotations.as_quat(), 1, axis=1)


def carried(draw):
    """The proximal segment, carried about all axes, slowly."""
    phase = draw.uniform(0, 2 * np.pi, 3)
    angles = 0.5 * np.sin(2 * np.pi * np.outer(TIME, [0.11, 0.07, 0.05]) + phase)
    return Rotation.from_euler("XYZ", angles + [0.6, 0.2, 0.3])


def bent(draw, twist=True):
    """The joint's rotation: about y of the proximal segment, then about z of the distal one."""
    phase = draw.uniform(0, 2 * np.pi, 2)
    first = 0.6 * np.sin(2 * np.pi * 0.21 * TIME + phase[0])
    second = 0.9 * np.sin(2 * np.pi * 0.33 * TIME + phase[1]) if twist else 0 * TIME
    return Rotation.from_euler("YZ", np.column_stack([first, second]))


def drifted(draw, degrees_a_minute=2.0, ramp=0.0):
    """A heading that walks at random [rad], zero at first."""
    steps = draw.standard_normal(len(TIME)) * np.radians(degrees_a_minute) / np.sqrt(60 * HZ)
    steps[0] = 0.0
    return np.cumsum(steps) + ramp * TIME


def seen(draw, drift, twist=True, misfit=0.0, noise=0.005):
    """Both segments as filters give them: the distal one in a world that turns away by `drift`, its
    axis off by `misfit`.
    """
    proximal = carried(draw)
    distal = proximal * bent(draw, twist) * Rotation.from_rotvec(misfit * draw.standard_normal(3))
    distal = Rotation.from_rotvec(np.outer(-drift, [0.0, 0.0, 1.0])) * distal
    errors = noise * draw.standard_normal((len(TIME), 3))
    return quaternions(proximal), quaternions(distal * Rotation.from_rotvec(errors))


@pytest.mark.parametrize(
    ("constraint", "twist", "most_deg"), [(TWO_AXES, True, 1.2), (HINGE, False, 3.5)]
)
def test_a_heading_that_walks_away_is_followed_and_its_uncertainty_is_honest(
    constraint, twist, most_deg
):
    misfit = np.radians(constraint.axes_sd_deg) / np.sqrt(
        2
    )  # stated is what both axes are off by together
    inside, normalised = [], []
    for seed in range(12):
        draw = np.random.default_rng(seed)
        drift = drifted(draw, ramp=np.radians(0.05))  # 15 deg in five minutes besides
        track = track_heading(
            TIME_NS, *seen(draw, drift, twist, misfit), constraint, int(TIME_NS[0])
        )
        error = track.heading - drift
        assert np.degrees(np.sqrt(np.mean(error**2))) < most_deg
        inside.append(np.abs(error) < 1.96 * track.sd)
        normalised.append(np.mean((error / track.sd) ** 2))
    assert np.mean(inside) > 0.9
    assert 0.1 < np.mean(normalised) < 1.5


def test_exact_axes_and_no_noise_leave_next_to_nothing():
    exact = TWO_AXES.model_copy(update={"axes_sd_deg": 0.1})
    drift = np.radians(20) * np.sin(2 * np.pi * TIME / SECONDS)
    track = track_heading(
        TIME_NS, *seen(np.random.default_rng(3), drift, noise=0.0), exact, int(TIME_NS[0])
    )
    np.testing.assert_allclose(track.heading[60:-60], drift[60:-60], atol=np.radians(0.5))


def test_the_heading_is_known_where_it_was_aligned_and_followed_to_both_ends():
    draw = np.random.default_rng(4)
    drift = drifted(draw, ramp=np.radians(0.1))
    middle = len(TIME) // 2
    track = track_heading(
        TIME_NS, *seen(draw, drift - drift[middle]), TWO_AXES, int(TIME_NS[middle])
    )
    error = np.degrees(track.heading - (drift - drift[middle]))
    assert np.sqrt(np.mean(error**2)) < 1.0
    assert abs(np.mean(error[:middle])) < 0.5


def test_an_unknown_start_is_found_from_the_whole():
    draw = np.random.default_rng(5)
    drift = 2.5 + drifted(draw)
    track = track_heading(TIME_NS, *seen(draw, drift), TWO_AXES, None)
    error = np.angle(np.exp(1j * (track.heading - drift)))
    assert np.degrees(np.sqrt(np.mean(error**2))) < 1.5


def test_vertical_axes_tell_nothing_and_the_uncertainty_says_so():
    upright = np.tile([1.0, 0, 0, 0], (len(TIME), 1))
    vertical = JointConstraint(proximal_axis=[0, 0, 1], distal_axis=[0, 0, 1])
    track = track_heading(TIME_NS, upright, upright, vertical, int(TIME_NS[0]))
    np.testing.assert_allclose(track.heading, 0.0, atol=1e-6)
    minutes = TIME / 60
    np.testing.assert_allclose(
        track.sd, np.sqrt(START_SD**2 + np.radians(2) ** 2 * minutes), rtol=1e-3
    )
    with pytest.raises(PoorExcitation, match="heading"):
        track_heading(TIME_NS, upright, upright, vertical, None)


def test_a_posture_that_lasts_is_not_ever_more_knowledge():
    """At rest, with axes that are off by 3 deg, the stated uncertainty must not fall below them."""
    still, off = (
        Rotation.from_euler("XYZ", [0.3, 0.2, 0.3]),
        Rotation.from_rotvec([0.0, 0.0, np.radians(3)]),
    )
    q1, q2 = (np.tile(np.roll(q.as_quat(), 1), (len(TIME), 1)) for q in (still, still * off))
    track = track_heading(TIME_NS, q1, q2, HINGE, int(TIME_NS[0]))
    assert np.degrees(track.sd[-1]) > 2.5
    assert abs(track.heading[-1]) < 1.96 * track.sd[-1]


def test_gaps_and_samples_without_an_orientation_are_bridged():
    draw = np.random.default_rng(7)
    drift = drifted(draw)
    q1, q2 = seen(draw, drift)
    q2[2000:2600] = np.nan
    kept = np.r_[0:1000, 1400 : len(TIME)]
    track = track_heading(TIME_NS[kept], q1[kept], q2[kept], TWO_AXES, int(TIME_NS[0]))
    assert np.isfinite(track.heading).all()
    assert np.degrees(np.sqrt(np.mean((track.heading - drift[kept]) ** 2))) < 1.5


@pytest.mark.parametrize("kind", ["turning away", "to and fro", "walking"])
def test_a_hinge_without_noise_gives_the_heading_to_a_thirtieth_of_a_degree(kind):
    """However little is said of it: axes known to 3 deg, a walk of 2 deg a minute."""
    draw = np.random.default_rng(1)
    drift = {
        "turning away": np.radians(0.1) * TIME,
        "to and fro": np.radians(20) * np.sin(2 * np.pi * TIME / SECONDS),
        "walking": drifted(draw),
    }[kind]
    seen_by_both = seen(draw, drift, twist=False, noise=0.0)
    track = track_heading(TIME_NS, *seen_by_both, HINGE, int(TIME_NS[0]))
    assert np.degrees(np.sqrt(np.mean((track.heading - drift) ** 2))) < 0.04
