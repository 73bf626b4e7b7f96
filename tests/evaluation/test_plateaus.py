"""Angles typed in for each plateau of a joint that was held still."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.cli.options import typed_plateaus
from testbench.evaluation.plateaus import plateau_rows
from testbench.exceptions import InputError, NotFoundError
from testbench.frames import NANOSECONDS
from testbench.pipeline.analyse import examine, judge_plateaus
from tests.asking import analysis, recorded

pytestmark = pytest.mark.slow
ASKED = analysis("ecompass", "vqf_6d")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return recorded("quick", 2, tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def estimate(session):
    return examine(session, ASKED).estimate


def plateaus_of(session, estimate) -> tuple[str, int]:
    """The joint, and how many plateaus there are, by what the refusal says."""
    (name,) = session.analysis.joints
    with pytest.raises(InputError, match="both sensors rest") as refused:
        plateau_rows(session, estimate, {name: [0.0]})
    return name, int(str(refused.value).partition("both sensors rest ")[2].split()[0])


def test_each_plateau_is_judged_by_what_was_typed(session, estimate):
    name, count = plateaus_of(session, estimate)
    assert count > 1
    rows = judge_plateaus(session, ASKED, [], {name: [10.0] * count})
    assert {row.filter for row in rows} == {"ecompass", "vqf_6d"}
    own = [row for row in rows if row.filter == "ecompass" and row.sequence == rows[0].sequence]
    assert [row.plateau for row in own] == list(range(1, count + 1))
    assert all(row.end_s - row.begin_s >= 1 for row in own)
    assert all(row.error_deg == pytest.approx(row.mean_deg - 10.0) for row in own)
    # typed as the arm's joint was: what is left are the sensors' errors
    joint, arm = session.analysis.joints[name], session.arm()
    start = estimate.joints[name].host_time_ns[0]
    middle = [start + (row.begin_s + row.end_s) / 2 * NANOSECONDS for row in own]
    column = arm.q_measured[:, arm.joint_names.index(joint.reference_joint)]
    typed = np.degrees(np.interp(middle, arm.host_time_ns, column)).tolist()
    again = plateau_rows(session, estimate, {name: typed})
    judged = [
        row
        for row in again
        if (row.filter, row.sequence) == ("ecompass", rows[0].sequence)
        and any(
            step.role != "calibration"
            and step.settled_ns <= start + (row.begin_s + row.end_s) / 2 * NANOSECONDS < step.end_ns
            for step in session.steps
        )
    ]
    assert judged and max(abs(row.error_deg) for row in judged) < 1
    assert all(0 < row.sd_deg < 1 for row in judged)


def test_nothing_is_estimated_where_nothing_was_typed(session):
    assert judge_plateaus(session, ASKED, [], {}) == []


def test_what_cannot_be_is_refused(session, estimate):
    with pytest.raises(NotFoundError, match="joint 'knee'"):
        plateau_rows(session, estimate, {"knee": [1.0]})
    for given in (["elbow"], ["elbow=a,b"], ["=1,2"], ["elbow=1", "elbow=2"]):
        with pytest.raises(InputError, match="--plateaus"):
            typed_plateaus(given)
    assert typed_plateaus(["elbow=30.1, 17"]) == {"elbow": [30.1, 17.0]}
