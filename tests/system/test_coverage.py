"""The stated uncertainty covers what is really true, and no more than it should."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tests.system.known_truth import PLACES, Case, cases

SESSIONS = 40
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found() -> list[Case]:
    return cases(range(1000, 1000 + SESSIONS))


def within(own: list[Case], stated: float, level: float) -> bool:
    """Whether as many differences lie within a multiple of the expanded uncertainty as so many
    draws at this level would.
    """
    low, high = binom.ppf([0.001, 0.999], len(own), level)
    return bool(
        low <= sum(abs(case.reported - case.true) <= stated * case.expanded for case in own) <= high
    )


def scatters(own: list[Case], stated: float) -> bool:
    """Whether the differences scatter about zero, and by half of what is stated to three tenths."""
    difference = np.array([case.reported - case.true for case in own])
    sd = difference.std(ddof=1)
    expanded = stated * np.mean([case.expanded for case in own])
    return bool(
        abs(2 * sd - expanded) < 0.3 * expanded
        and abs(difference.mean()) < 4 * sd / np.sqrt(len(own))
    )


@pytest.mark.parametrize(("joint", "section"), PLACES)
def test_the_true_mean_error_lies_within_the_stated_uncertainty(found, joint, section):
    own = [case for case in found if (case.joint, case.section) == (joint, section)]
    assert len(own) == SESSIONS
    assert within(own, 1, 0.954)
    assert within(own, 1 / 2, 0.683)  # half of it would not do: it is no shrug


def test_the_uncertainty_is_twice_the_scatter_of_the_differences(found):
    for place in PLACES:
        own = [case for case in found if (case.joint, case.section) == place]
        assert scatters(own, 1)
        for wrong in (1 / 2, 2 / 3, 3 / 2, 2):  # so many sessions are enough to tell
            assert not scatters(own, wrong), (place, wrong)
        for wrong in (1 / 2, 2):
            assert not (within(own, wrong, 0.954) and within(own, wrong / 2, 0.683)), (place, wrong)


def test_an_arm_with_right_zeros_reports_the_true_errors_to_its_repeatability():
    for case in cases([5], joint_errors=False):
        assert abs(case.reported - case.true) < 0.006, case
