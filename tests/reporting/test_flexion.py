"""Rows of an evaluation taken together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.records.results.evaluation import JointRow
from testbench.reporting.sections.flexion import PoseErrors, pool

RNG = np.random.default_rng(3)


def pose(error: np.ndarray, flexion: float, speed: float) -> JointRow:
    """A row of samples of the error [deg] in one pose."""
    summary = {
        "flexion_mean_error_deg": error.mean(),
        "flexion_mean_abs_error_deg": np.abs(error).mean(),
        "flexion_sd_deg": error.std(ddof=1),
        "flexion_rmse_deg": np.sqrt(np.mean(error**2)),
        "flexion_max_abs_error_deg": np.abs(error).max(),
    }
    variables = {"flexion_deg": flexion, "speed_deg_s": speed}
    common = {
        "joint": "elbow",
        "filter": "vqf_6d",
        "sequence": "ZXZ",
        "section": "static",
        "step": 0,
        "kind": "move",
    }
    return JointRow(
        **common,
        misalignment_deg=None,
        flexion_deg=flexion,
        variables=variables,
        n=len(error),
        other_mean_abs_error_deg=[None, None],
        **{key: float(value) for key, value in summary.items()},
    )


def test_the_spread_of_poses_taken_together_is_that_within_them():
    quiet = [
        pose(level + 0.03 * RNG.standard_normal(400), 30, speed)
        for level, speed in ((-1.2, 10), (1.2, 20))
    ]
    together = pool(quiet)
    assert together.sd == pytest.approx(0.03, rel=0.1)  # not the 1.2 deg that part the poses
    assert together.rmse == pytest.approx(1.2, rel=0.01)
    assert together.mean_abs == pytest.approx(1.2, rel=0.01)
    assert pool(quiet[:1]).sd == quiet[0].flexion_sd_deg


def test_poses_taken_together_are_named_above_the_figure():
    rows = [
        pose(0.1 * RNG.standard_normal(50), flexion, speed)
        for flexion in (0, 30)
        for speed in (10, 20)
    ]
    errors = PoseErrors(rows)
    assert errors.pooled == ["speed_deg_s"]
    assert (
        PoseErrors(
            [replace(row, variables={"flexion_deg": row.flexion_deg}) for row in rows]
        ).pooled
        == []
    )
