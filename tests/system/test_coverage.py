"""The stated uncertainty covers what is really true, and no more than it should."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tests.system.known_truth import PLACES, Case, cases

SESSIONS = 60
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found() -> list[Case]:
    return cases(range(1000, 1000 + SESSIONS))


@pytest.mark.parametrize(("joint", "section"), PLACES)
def test_the_true_mean_error_lies_within_the_stated_uncertainty(found, joint, section):
    own = [case for case in found if (case.joint, case.section) == (joint, section)]
    assert len(own) == SESSIONS
    covered = sum(case.covered for case in own)
    low, high = binom.ppf([0.001, 0.999], SESSIONS, 0.954)
    assert low <= covered <= high
    # and half of it would not do: it is no shrug
    half = sum(abs(case.reported - case.true) <= case.expanded / 2 for case in own)
    low, high = binom.ppf([0.001, 0.999], SESSIONS, 0.683)
    assert low <= half <= high


def test_the_uncertainty_is_twice_the_scatter_of_the_differences(found):
    for place in PLACES:
        own = [case for case in found if (case.joint, case.section) == place]
        difference = np.array([case.reported - case.true for case in own])
        assert 2 * difference.std(ddof=1) == pytest.approx(np.mean([case.expanded for case in own]), rel=0.3)
        assert abs(difference.mean()) < 4 * difference.std() / np.sqrt(SESSIONS)


def test_an_arm_with_right_zeros_reports_the_true_errors_to_its_repeatability():
    for case in cases([5], joint_errors=False):
        assert abs(case.reported - case.true) < 0.006, case
