"""What links may be off by: against forward kinematics of our own, from DH parameters."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.model.kinematics import Kinematics
from testbench.model.links import Link, LinkErrors, draw_link_errors
from testbench.records.specs.robot import load_robot
from tests.evaluation.drawn_arms import NOMINAL, Arms, poses

NAMES = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
Q = np.random.default_rng(3).uniform(-2, 2, (5, 6))


@pytest.fixture(scope="module")
def arm() -> Kinematics:
    return Kinematics(load_robot("ur3e"))


def relative(links, base=0):
    """Orientations against that of the first link, which no convention of bases enters."""
    return [(links[base].inv() * link).as_matrix() for link in links]


def of(kinematics: Kinematics, q: np.ndarray) -> list[np.ndarray]:
    links = ["shoulder_link", "upper_arm_link", "forearm_link"]
    links += ["wrist_1_link", "wrist_2_link", "wrist_3_link"]
    R = [kinematics.frame_motion(link, q).R_world_from_frame for link in links]
    return [np.swapaxes(R[0], 1, 2) @ own for own in R]


def test_every_pair_of_neighbours_has_a_twist_and_parallel_ones_a_second(arm):
    assert [link.after.removesuffix("_joint") for link in arm.links] == NAMES[1:]
    assert [twist.name for twist in arm.twists] == ["alpha", *["alpha", "beta"] * 2, *["alpha"] * 2]


def test_an_arm_without_errors_is_the_makers(arm):
    for own, theirs in zip(of(arm, Q), relative(poses(Q[None], NOMINAL)[0]), strict=True):
        np.testing.assert_allclose(own, theirs, atol=1e-6)


def test_wrong_links_turn_as_wrong_parameters_of_denavit_and_hartenberg_do(arm):
    rng = np.random.default_rng(8)
    alpha, beta = rng.normal(0, 0.02, (2, 1, 6))
    beta[:, [0, 3, 4, 5]] = 0
    turns = {}
    for i, link in enumerate(arm.links):  # x and y of the maker's frames, in which they are stated
        x = np.cross([0, 0, 1], link.tilts[-1]) if len(link.tilts) == 2 else link.tilts[0]
        own = [alpha[0, i], beta[0, i]]
        turns[link.after] = own[0] * np.array([1.0, 0, 0]) + own[1] * np.array([0, 1.0, 0])
        assert abs(abs(x[0]) - 1) < 1e-9
    wrong = Kinematics(arm.robot, LinkErrors(turns, {name: np.zeros(3) for name in turns}))
    none = np.zeros((1, 6))
    theirs = relative(poses(Q[None], Arms(none, alpha, beta, none, none))[0])
    for own, other in zip(of(wrong, Q), theirs, strict=True):
        np.testing.assert_allclose(own, other, atol=1e-6)


def test_lengths_and_offsets_turn_nothing_and_move_the_flange(arm):
    rng = np.random.default_rng(5)
    shift = {link.after: rng.normal(0, 1e-3, 3) for link in arm.links}
    wrong = Kinematics(arm.robot, LinkErrors({name: np.zeros(3) for name in shift}, shift))
    before, after = (own.frame_motion("tool0", Q) for own in (arm, wrong))
    np.testing.assert_allclose(after.R_world_from_frame, before.R_world_from_frame, atol=1e-15)
    assert np.linalg.norm(after.position - before.position, axis=1).min() > 1e-4


@pytest.mark.parametrize("source", range(13))
def test_errors_turn_a_link_about_the_axes_that_are_said(arm, source):
    """By differences of the kinematics with that one error in them."""
    h, q = 1e-6, Q.copy()
    wrong = arm
    if source < 6:
        q[:, source] += h
    else:
        twist = arm.twists[source - 6]
        names = [link.after for link in arm.links]
        none = {name: np.zeros(3) for name in names}
        wrong = Kinematics(arm.robot, LinkErrors(none | {twist.link.after: h * twist.axis}, none))
    before = arm.frame_motion("wrist_3_link", Q).R_world_from_frame
    skew = (
        wrong.frame_motion("wrist_3_link", q).R_world_from_frame @ np.swapaxes(before, 1, 2)
    ) / h
    turned = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    np.testing.assert_allclose(arm.error_axes("wrist_3_link", Q)[:, source], turned, atol=1e-5)


def test_what_is_drawn_is_what_the_file_states(arm):
    found = [draw_link_errors(arm.robot, arm.links, seed) for seed in range(400)]
    turns = np.degrees([own.tilt["wrist_2_joint"] for own in found])
    assert np.linalg.norm(turns, axis=1).std() > 0
    assert np.sqrt(np.mean(np.sum(turns**2, axis=1))) == pytest.approx(0.12, rel=0.1)
    both = np.degrees([own.tilt["elbow_joint"] for own in found])  # parallel: two tilts
    assert np.sqrt(np.mean(np.sum(both**2, axis=1))) == pytest.approx(0.12 * 2**0.5, rel=0.1)
    moved = 1e3 * np.array([own.shift["elbow_joint"] for own in found])
    assert np.sqrt(np.mean(np.sum(moved**2, axis=1))) == pytest.approx(0.2 * 2**0.5, rel=0.1)


def test_axes_on_one_line_have_two_tilts_across_it():
    z = np.array([0.0, 0, 1])
    link = Link.between("a", "b", np.eye(3), np.array([0, 0, 0.3]), (z, z))
    assert link.tilts.shape == (2, 3)
    np.testing.assert_allclose(link.tilts @ z, 0, atol=1e-12)
