"""Errors put into recorded quaternions do to a joint what eqs 2.18 to 2.21 say."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.cli.options import injected_errors
from testbench.estimation import estimate
from testbench.estimation.filters import get_filter
from testbench.estimation.injected import with_injected
from testbench.exceptions import InputError, NotFoundError
from testbench.model import rotation
from testbench.model.joint_angle import joint_angles, segment_from_sensor
from testbench.model.misalignment import joint_from_start_pose, with_errors
from testbench.model.reference_step import aligned_instant
from testbench.records.specs.injected_error import InjectedError
from tests.asking import recorded

pytestmark = pytest.mark.slow
FILTERS = [get_filter("ecompass"), get_filter("vqf_6d")]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return recorded("quick", 2, tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def made(session):
    return estimate(session, FILTERS)


def error(sensor: str, *off: float, of: str = "sensor") -> InjectedError:
    return InjectedError.model_validate(
        {"sensor": sensor, "of": of, "yaw_pitch_roll_deg": list(off)}
    )


def the_joint(session):
    ((name, joint),) = session.analysis.joints.items()
    return name, joint


def parts(session, made, kind):
    """q of both sensors and of both at the start, and the segments at the start, shape (n, 4)."""
    _, joint = the_joint(session)
    time = made.sensors[joint.proximal].host_time_ns
    at = np.array([aligned_instant(session.steps, session.analysis.estimate.align, time)])
    found = []
    for name in (joint.proximal, joint.distal):
        own = made.sensors[name]
        q = own.orientation[kind]
        series = rotation.interpolate(own.host_time_ns, q, time)
        start = rotation.interpolate(own.host_time_ns, q, at)[0]
        believed = rotation.conjugate(segment_from_sensor(session.analysis.sensors[name]))
        found.append((series, start, rotation.multiply(start, believed)))
    return found


@pytest.mark.parametrize("kind", ["ecompass", "vqf_6d"])
@pytest.mark.parametrize("side", [0, 1])
def test_a_wrong_start_pose_gives_the_joint_of_eq_2_18_and_2_20(session, made, kind, side):
    name, joint = the_joint(session)
    whose = (joint.proximal, joint.distal)[side]
    off = error(whose, 5.0, -4.0, 7.0, of="start")
    found = with_injected(session, made, [off], FILTERS).joints[name].angles[kind, joint.label]
    (a, a0, ga0), (f, f0, gf0) = parts(session, made, kind)
    wrong = [ga0, gf0]
    wrong[side] = with_errors(wrong[side], *np.radians([5.0, -4.0, 7.0]))
    expected = joint_from_start_pose(a, f, a0, f0, *wrong)
    level = np.tile(rotation.IDENTITY, (len(expected), 1))
    np.testing.assert_allclose(found, joint_angles(level, expected, joint), atol=2e-6)


def test_a_wrong_sensor_gives_the_joint_of_eq_2_21(session, made):
    name, joint = the_joint(session)
    off = error(joint.proximal, 2.0, 3.0, -4.0)
    changed = with_injected(session, made, [off], FILTERS)
    (a, a0, ga0), (f, f0, gf0) = parts(session, made, "ecompass")
    other = with_errors(a, *np.radians([2.0, 3.0, -4.0]))
    expected = joint_from_start_pose(other, f, a0, f0, ga0, gf0)
    level = np.tile(rotation.IDENTITY, (len(expected), 1))
    found = changed.joints[name].angles["ecompass", joint.label]
    np.testing.assert_allclose(found, joint_angles(level, expected, joint), atol=2e-6)
    assert changed.sensors[joint.distal] is made.sensors[joint.distal]


def test_a_pitch_is_an_error_of_its_size(session, made):
    _, joint = the_joint(session)
    changed = with_injected(session, made, [error(joint.distal, 0.0, 3.0, 0.0)], FILTERS)
    turned, q = (
        estimated.sensors[joint.distal].orientation["ecompass"] for estimated in (changed, made)
    )
    apart = rotation.angle(rotation.multiply(rotation.conjugate(q), turned))
    assert np.degrees(apart).max() == pytest.approx(3, abs=0.01)


def test_nothing_put_in_changes_nothing(session, made):
    name, joint = the_joint(session)
    none = with_injected(
        session,
        made,
        [error(joint.distal, 0, 0, 0, of="start"), error(joint.proximal, 0, 0, 0)],
        FILTERS,
    )
    for key, angles in made.joints[name].angles.items():
        np.testing.assert_allclose(none.joints[name].angles[key], angles, atol=2e-6)


def test_errors_that_cannot_be_put_in_are_refused(session, made):
    _, joint = the_joint(session)
    with pytest.raises(NotFoundError, match=joint.distal):
        with_injected(session, made, [error("foot", 1, 2, 3)], FILTERS)
    with pytest.raises(InputError, match="given twice"):
        with_injected(session, made, [error(joint.distal, 1, 2, 3)] * 2, FILTERS)
    for text in ("forearm", "forearm=1,2", "forearm.end=1,2,3", "=1,2,3", "forearm=a,b,c"):
        with pytest.raises(InputError, match=r"--inject .*write it as"):
            injected_errors([text])
    (one,) = injected_errors(["forearm.start=0,0,5"])
    assert one == error("forearm", 0.0, 0.0, 5.0, of="start")
