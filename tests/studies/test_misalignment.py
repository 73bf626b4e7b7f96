"""The study of misalignment: its tables against the printed ones, and a session that lies on the
theory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.exceptions import InputError
from testbench.studies.elbow.misalignment import misalignment_study
from testbench.studies.elbow.misalignment_session import session_curves


@pytest.fixture(scope="module")
def study():
    return misalignment_study()


def test_the_fits_stand_beside_the_published_ones_and_agree_as_printed(study):
    table = study.table("fits")
    rows = {row.label: row for row in table.rows}
    assert list(rows) == [f"{f} deg" for f in range(0, 71, 5)]
    printed = ("60 deg", "70 deg")
    nought = table.columns.index("b")  # of a fit that is even: rounding alone, here and there
    for label in printed:
        ours, theirs = list(rows[label].values), list(rows[label].published)
        assert max(abs(ours.pop(nought)), abs(theirs.pop(nought))) < 1e-15
        assert [f"{value:.4g}" for value in ours] == [f"{value:.4g}" for value in theirs]
        assert rows[label].ratio(0) == pytest.approx(1, abs=3e-4)
    assert all(not row.published for label, row in rows.items() if label not in printed)
    assert study.source == "Castellanos Alonso, Universidad de Oviedo, 2023"


def test_published_fits_stand_beside_no_other_sequence_or_grid():
    assert not any(row.published for row in misalignment_study("XYZ").table("fits").rows)
    finer = misalignment_study(misalignment_deg=np.arange(-20.0, 21.0))
    assert not any(row.published for row in finer.table("fits").rows)


def test_misalignment_about_y_is_passed_on_whole_and_about_z_not_at_all(study):
    rows = {row.label: row.values for row in study.table("axes").rows}
    assert rows["Y"] == pytest.approx([20, 1, 1])
    assert rows["Z"] == pytest.approx([0, 0, 0], abs=1e-12)
    assert rows["X"][0] == pytest.approx(7.9909, abs=1e-4)


def test_the_surface_is_normed_like_the_published_one(study):
    how = study.table("surface").how
    assert "(f - 35) / 21.64" in how
    assert "(d - 0) / 12.13" in how


def test_the_surfaces_are_the_grids_that_the_tables_come_from(study):
    x, y, z = study.surfaces
    assert x.z.shape == (len(x.y), len(x.x)) == (15, 21)
    assert x.z.max() == pytest.approx(7.9909, abs=1e-4)
    np.testing.assert_allclose(y.z, np.tile(np.abs(y.x), (15, 1)), atol=1e-9)
    np.testing.assert_allclose(z.z, 0, atol=1e-9)


def test_every_sequence_with_the_flexion_as_an_angle_of_its_own_is_compared(study):
    rows = {row.label: row.values for row in study.table("sequences").rows}
    assert set(rows) == {"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "ZYZ"}
    assert rows["ZYX"][1] == pytest.approx(rows["XYZ"][3])  # mirror images of one another
    assert all(row[2] == pytest.approx(20, abs=1e-6) for name, row in rows.items())
    assert rows["ZYZ"][3] == pytest.approx(0, abs=1e-9)


def test_a_yaw_of_one_sensor_leaves_the_pitch_alone(study):
    largest = {row.label: row.values[-1] for row in study.table("sensors").rows}
    assert largest["proximal, yaw"] == pytest.approx(0, abs=1e-9)
    assert largest["distal, pitch"] == pytest.approx(20, abs=1e-9)


def test_a_flexion_that_is_no_single_angle_is_refused():
    with pytest.raises(InputError, match="no single angle of YXY"):
        misalignment_study("YXY")


# A session: `quick` commands misalignments of 0 and 20 degrees at flexions of 0, 30 and 60


def test_theory_simulation_and_measurement_of_a_session_agree_in_one_figure(quick):
    zxz, yxz = session_curves(quick.session, quick.evaluation, "elbow")
    curves = {curve.name: curve for curve in yxz.curves}
    theory, simulation = curves["theory, 60 deg"], curves["simulation, 60 deg"]
    np.testing.assert_array_equal(theory.x, [0, 20])
    expected = np.degrees(np.arcsin(np.sin(np.radians(60)) * np.cos(np.radians(20)))) - 60
    np.testing.assert_allclose(theory.y, [0, -expected], atol=1e-9)
    np.testing.assert_allclose(simulation.y, theory.y, atol=0.02)  # encoders and repeatability
    measured = curves["device, 60 deg"]
    assert measured.kind == "measurement"
    np.testing.assert_allclose(
        measured.y, theory.y, atol=1.5
    )  # three seconds are too short to settle
    assert abs(measured.y[1] - measured.y[0]) > 3
    flat = {curve.name: curve for curve in zxz.curves}
    np.testing.assert_array_equal(flat["theory, 60 deg"].y, 0)
    np.testing.assert_allclose(flat["simulation, 60 deg"].y, 0, atol=0.02)


def test_the_study_takes_a_session_in(quick):
    study = misalignment_study(session=quick.session, evaluation=quick.evaluation)
    table = study.table("elbow measured")
    rows = {row.label: row.values for row in table.rows}
    assert rows["YXZ, device"][2] == pytest.approx(5.536, abs=0.02)
    assert rows["ZXZ, device"][2] < 0.05
    assert quick.session.name in table.caption
    assert len(study.curves) == 3


def test_a_session_without_misalignment_is_refused(quick):
    one = [row for row in quick.evaluation.joint_angle if row.misalignment_deg == 0]
    with pytest.raises(InputError, match="varies no misalignment of joint 'elbow'"):
        session_curves(quick.session, replace(quick.evaluation, joint_angle=one), "elbow")
