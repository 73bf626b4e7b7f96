"""Truths that a mapping names: in the rows of the samples, or in a file of their own."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.pipeline.analyse import analyse
from tests.asking import analysis
from tests.formats.mapped.mappings import PLAIN
from tests.told import codes


def test_a_truth_in_the_rows_of_the_samples_needs_no_clock(plain, motion, load, xyz):
    m = motion(300)
    text = PLAIN + "    truth: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    session = load(text, plain(m, more=xyz("q{}", m.q, "wxyz")))
    assert "structure.truth_in_rows" in codes(session)
    assert not session.analysis.estimate.align_clock


def test_truth_in_the_same_rows_with_gaps_and_flipped_signs(plain, motion, load, xyz):
    m = motion(600)
    q = m.q * np.where(np.arange(600) % 37 < 20, 1, -1)[:, None]
    q[200:260] = np.nan
    q[::2] = np.nan  # half the rate of the samples
    more = xyz("q{}", q, "wxyz") | {"moving": (m.t > 2).astype(int)}
    text = PLAIN + "    truth: {columns: [qw, qx, qy, qz], order: wxyz, judged: moving}\n"
    session = load(text, plain(m, more=more))
    truth = session.truth("imu")
    known = np.isfinite(truth.q_world_from_sensor[:, 0])
    assert known.sum() == 270 and (~known).sum() == 1
    q_known = truth.q_world_from_sensor[known]
    assert np.all(np.sum(q_known[1:] * q_known[:-1], axis=1) > 0)
    row = np.round(truth.host_time_ns[known] * 1e-7).astype(int)
    assert np.abs(np.sum(truth.q_world_from_sensor[known] * m.q[row], axis=1)).min() > 1 - 1e-9
    np.testing.assert_array_equal(truth.judged[known], m.t[row] > 2)
    assert session.analysis.estimate.align == "motion" and not session.analysis.estimate.align_clock
    notes = " ".join(session.manifest.notes)
    assert "changed the sign" in notes and "1 gap," in notes


def test_truth_in_a_file_of_its_own_at_a_lower_rate(plain, motion, load, table, xyz):
    m = motion(3000)
    plain(m)
    table(
        "optical.csv", {"ms": 1000 * m.t[::7] + 40.0} | xyz("Q{}", m.q[::7, [1, 2, 3, 0]], "xyzw")
    )
    text = PLAIN + (
        "    truth:\n      file: optical.csv\n      columns: [Qx, Qy, Qz, Qw]\n      order: xyzw\n"
        "      time: {column: ms, unit: ms}\n"
    )
    session = load(text, plain(m))
    truth = session.truth("imu")
    assert truth.host_time_ns[0] == 0 and session.analysis.estimate.align_clock
    result = analyse(session, analysis("vqf_6d"))
    (row,) = result.evaluation.orientation
    assert row.total_rmse_deg < 0.5


def test_truth_on_the_clock_of_the_samples_keeps_its_place(plain, motion, load, table, xyz):
    m = motion(600)
    table("optical.csv", {"t": m.t[50::7]} | xyz("q{}", m.q[50::7], "wxyz"))
    text = PLAIN + (
        "    truth:\n      file: optical.csv\n      columns: [qw, qx, qy, qz]\n      order: wxyz\n "
        "     same_clock: true\n"
        "      time: {column: t, unit: s}\n"
    )
    session = load(text, plain(m))
    assert session.truth("imu").host_time_ns[0] == 500_000_000
    assert not session.analysis.estimate.align_clock


def test_truth_of_a_body_that_carries_the_sensor(plain, motion, load, xyz):
    m = motion(600)
    body_from_sensor = Rotation.from_euler("ZYX", [0, 90, 0], degrees=True)
    q_body = (Rotation.from_quat(m.q, scalar_first=True) * body_from_sensor.inv()).as_quat(
        scalar_first=True
    )
    text = PLAIN + (
        "    truth:\n      columns: [qw, qx, qy, qz]\n      order: wxyz\n      mounting: "
        "{rotation_deg: {ZYX: [0, 90, 0]}}\n"
    )
    truth = load(text, plain(m, more=xyz("q{}", q_body, "wxyz"))).truth("imu")
    assert np.abs(np.sum(truth.q_world_from_sensor * m.q, axis=1)).min() > 1 - 1e-9
