"""Orientations of marker clusters: a known motion, and known faults."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.formats.truth.clusters import fit_cluster
from tests.formats.mocap import off_deg, placed


def test_a_rigid_cluster_gives_the_motion_of_its_body(motion):
    q = motion(600).q
    fit = fit_cluster(placed(q))
    assert off_deg(fit.q_world_from_cluster, q).max() < 1e-5
    assert fit.residual_rms_m < 1e-9 and fit.rigid
    assert (fit.few, fit.in_line, fit.deformed) == (0, 0, 0)


def test_noise_of_the_markers_is_the_residual_and_errs_as_far_as_it_must(motion):
    q = motion(600).q
    fit = fit_cluster(placed(q, noise_m=0.5e-3))
    expected = 0.5e-3 * np.sqrt((3 * 4 - 6) / 4)  # 3 k numbers less 6 of the pose, over k markers
    assert fit.residual_rms_m == pytest.approx(expected, rel=0.1)
    assert 0.1 < np.sqrt(np.mean(off_deg(fit.q_world_from_cluster, q) ** 2)) < 1.2


def test_markers_out_of_sight_cost_nothing_while_three_are_left(motion):
    q = motion(600).q
    markers = placed(q)
    rng = np.random.default_rng(5)
    for i in range(0, 600, 2):
        markers[i, rng.integers(4)] = np.nan
    markers[200:230, :2] = np.nan
    fit = fit_cluster(markers)
    lost = np.flatnonzero(np.isnan(fit.q_world_from_cluster[:, 0]))
    np.testing.assert_array_equal(lost, np.arange(200, 230))
    assert fit.few == 30
    assert np.nanmax(off_deg(fit.q_world_from_cluster, q)) < 1e-5


def test_two_markers_that_changed_their_labels_are_lost(motion):
    q = motion(600).q
    markers = placed(q, noise_m=0.2e-3)
    markers[100:140, [0, 1]] = markers[100:140, [1, 0]]
    fit = fit_cluster(markers)
    assert np.isnan(fit.q_world_from_cluster[100:140]).all() and fit.deformed == 40
    assert np.nanmax(off_deg(fit.q_world_from_cluster, q)) < 2


def test_markers_on_one_line_tell_no_orientation(motion):
    q = motion(300).q
    line = placed(q)
    line[:, 2] = (line[:, 0] + line[:, 1]) / 2
    assert fit_cluster(line[:, :3]) is None
    line[::2, 3] = np.nan  # with the fourth the cluster is a plane
    fit = fit_cluster(line)
    assert fit.in_line == 150
    assert np.nanmax(off_deg(fit.q_world_from_cluster, q)) < 1e-5


def test_markers_of_two_bodies_are_no_cluster(motion):
    q = motion(600).q
    markers = placed(q)
    markers[:, 3] = markers[0, 3]
    assert not fit_cluster(markers).rigid


def test_a_mirror_image_is_no_rotation(motion):
    q = motion(300).q
    markers = placed(q)
    markers[220:] *= [1, 1, -1]
    fit = fit_cluster(markers)
    known = np.isfinite(fit.q_world_from_cluster[:, 0])
    assert known[:220].all() and not known[220:].any()


def test_no_frame_with_three_markers_is_no_fit(motion):
    markers = placed(motion(50).q)
    markers[:, :2] = np.nan
    assert fit_cluster(markers) is None


def test_the_stated_uncertainty_is_what_noise_turns_the_cluster_by(motion):
    """About the axis about which the markers tell least, that of their longest extent."""
    q = motion(3000).q
    markers = placed(q, noise_m=0.5e-3)
    markers[::3, 2] = np.nan  # a third of the frames has three markers only
    fit = fit_cluster(markers)
    assert fit.noise_m == pytest.approx(0.5e-3, rel=0.03)
    true, found = (
        Rotation.from_quat(own, scalar_first=True) for own in (q, fit.q_world_from_cluster)
    )
    turns = true.inv() * found
    errors = (turns * turns.mean().inv()).as_rotvec()
    worst = np.sqrt(np.linalg.eigvalsh(errors.T @ errors / len(errors))[-1])
    assert worst == pytest.approx(fit.sd_rad, rel=0.05)


def test_a_longer_cluster_is_surer_and_exact_markers_are_sure(motion):
    q = motion(300).q
    near, far = (
        fit_cluster(placed(q, noise_m=0.5e-3) + (size - 1) * (placed(q) - placed(q)[:, :1]))
        for size in (1, 3)
    )
    assert far.sd_rad == pytest.approx(near.sd_rad / 3, rel=0.05)
    assert fit_cluster(placed(q)).sd_rad < 1e-9
