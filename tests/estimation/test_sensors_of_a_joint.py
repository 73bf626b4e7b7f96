"""Sensors of a joint that were exchanged, or that show what no such joint does."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.joints.above import proximal_above
from testbench.estimation.joints.anatomical_range import beyond_anatomy
from testbench.estimation.joints.limb import Limb
from testbench.estimation.joints.standing import find_standing
from testbench.records.specs.protocol import BodyJoint
from tests.estimation.test_joints_of_a_body import TIME_NS, leg

KNEE = BodyJoint(proximal="thigh", distal="shank", definition="knee")


def above(limb, proximal, distal):
    standing = find_standing(limb, None)
    assert standing is not None
    return proximal_above(limb, proximal, distal, standing)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_height_between_two_sensors_follows_from_the_centre_of_their_joint(heading):
    found = above(leg(heading), "thigh", "shank")
    assert found.height == pytest.approx(0.4, abs=max(3 * found.sd, 0.03)) and found.sd < 0.05
    assert not found.upside_down


def test_sensors_that_were_exchanged_hang_upside_down():
    found = above(leg(1.0), "shank", "thigh")
    assert found.upside_down and found.height == pytest.approx(-0.4, abs=0.05)


def test_who_hardly_moves_shows_no_height():
    limb = leg(0.0)
    still = {name: np.repeat(own[:1], len(own), axis=0) for name, own in limb.q.items()}
    rest = {name: np.repeat(own[:1], len(own), axis=0) for name, own in limb.acc.items()}
    for proximal, distal in (("thigh", "shank"), ("shank", "thigh")):
        found = above(Limb(TIME_NS, still, rest), proximal, distal)
        assert found is None or not found.upside_down


def flexed(low_deg, high_deg, joint=KNEE, name="knee_r"):
    angles = np.zeros((500, 3))
    angles[:, 0] = np.radians(np.linspace(low_deg, high_deg, 500))
    return [own.code for own in beyond_anatomy(name, joint, "vqf_6d", angles)]


@pytest.mark.parametrize(
    ("low", "high", "told"), [(-5, 140, False), (-65, 1, True), (0, 200, True), (-20, 150, False)]
)
def test_a_knee_that_bends_as_no_knee_does_is_named(low, high, told):
    assert flexed(low, high) == (["joint.beyond_anatomy"] if told else [])


def test_single_spikes_plain_sequences_and_unknown_joints_are_let_be():
    angles = np.zeros((500, 3))
    angles[7, 0] = 3.0
    assert not beyond_anatomy("knee_r", KNEE, "vqf_6d", angles)
    plain = BodyJoint(proximal="thigh", distal="shank", sequence="ZXY")
    assert not flexed(-65, 1, plain) and not flexed(-65, 1, plain, "neck")
