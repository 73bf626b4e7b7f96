"""Sensors that do not see the centre of their joint move alike."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation.joints.centre_apart import centre_apart
from testbench.estimation.joints.limb import Limb
from tests.estimation.test_joints_of_a_body import HZ, leg


def late(limb: Limb, rows: int) -> Limb:
    """The same, the shank's file begun so many rows later and its times counted from there."""
    n = len(limb.time_ns) - rows
    return Limb(
        limb.time_ns[:n],
        {"thigh": limb.q["thigh"][:n], "shank": limb.q["shank"][rows:]},
        {"thigh": limb.acc["thigh"][:n], "shank": limb.acc["shank"][rows:]},
    )


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_sensors_of_one_joint_on_one_clock_agree(heading):
    assert centre_apart(leg(heading), "thigh", "shank") is None


@pytest.mark.parametrize("rows", [10, 25])
def test_the_shift_between_two_clocks_is_told(rows):
    found = centre_apart(late(leg(1.0), rows), "thigh", "shank")
    assert found is not None and found.shift_s is not None
    assert found.shift_s == pytest.approx(rows / HZ, abs=1 / HZ)


def test_a_clock_that_runs_apart_is_told_without_a_shift():
    limb = leg(0.0)
    rows = (0.9 * np.arange(len(limb.time_ns))).astype(int)
    q = {"thigh": limb.q["thigh"], "shank": limb.q["shank"][rows]}
    acc = {"thigh": limb.acc["thigh"], "shank": limb.acc["shank"][rows]}
    found = centre_apart(Limb(limb.time_ns, q, acc), "thigh", "shank")
    assert found is not None and found.shift_s is None


def part(limb: Limb, first: int, last: int) -> Limb:
    """Some of its instants."""
    rows = slice(first, last)
    q, acc = ({name: own[rows] for name, own in kind.items()} for kind in (limb.q, limb.acc))
    return Limb(limb.time_ns[rows], q, acc)


def test_six_seconds_tell_sensors_of_other_segments():
    limb, other = part(leg(0.0), 100, 400), part(leg(0.0, carried=1.0), 250, 550)
    assert centre_apart(limb, "thigh", "shank") is None
    strange = Limb(
        limb.time_ns,
        {"thigh": limb.q["thigh"], "shank": other.q["thigh"]},
        {"thigh": limb.acc["thigh"], "shank": other.acc["shank"]},
    )
    assert centre_apart(strange, "thigh", "shank") is not None
    assert centre_apart(part(strange, 0, 150), "thigh", "shank") is None  # three say nothing
