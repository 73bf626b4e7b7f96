"""Held-out validation: what a calibration leaves in poses that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import AXES
from testbench.frames import STANDARD_GRAVITY
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.results.calibration import TriadCalibration

FOLDS = 5
"""Of a cross-validation (Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, 2009,
section 7.10).
"""
MILLI_G = 1e3 / STANDARD_GRAVITY


def corrected_poses(calibration: TriadCalibration, poses: StaticPoses) -> np.ndarray:
    """Corrected mean readings, shape (m, 3)."""
    return calibration.apply(poses.mean, temperature=poses.temperature)


def held_out_figures(
    corrected: np.ndarray, poses: StaticPoses, *, magnetometer: bool = False
) -> dict[str, float]:
    """Figures by name, with the unit in the name.

    The norm is compared with `magnitude`; where that is NaN, with the mean norm. Bias and direction
    need expected vectors. `bias_*` is the mean error of each axis, as published tables have it;
    `error_*_rms` also counts what changes its sign with the pose.

    Args:
        corrected: Mean readings after the correction, shape (m, 3).
        poses: Those they belong to.
        magnetometer: Lengths are in uT, not in m/s^2.
    """
    length = np.linalg.norm(corrected, axis=1)
    magnitude = poses.magnitude if np.isfinite(poses.magnitude) else float(length.mean())
    norm_rms = float(np.sqrt(np.mean((length - magnitude) ** 2)))
    figures = {"held_out_poses": float(len(poses))}
    figures["field_norm_rms_ut" if magnetometer else "gravity_norm_rms_mm_s2"] = norm_rms * (
        1.0 if magnetometer else 1e3
    )
    if poses.expected is None:
        return figures
    error = corrected - poses.expected
    unit, factor = ("ut", 1.0) if magnetometer else ("mg", MILLI_G)
    for i, axis in enumerate(AXES):
        figures[f"bias_{axis}_{unit}"] = float(error[:, i].mean()) * factor
    for i, axis in enumerate(AXES):
        figures[f"error_{axis}_rms_{unit}"] = float(np.sqrt(np.mean(error[:, i] ** 2))) * factor
    crossed = np.linalg.norm(np.cross(corrected, poses.expected), axis=1)
    direction = np.degrees(np.arctan2(crossed, np.sum(corrected * poses.expected, axis=1)))
    figures["direction_rms_deg"] = float(np.sqrt(np.mean(direction**2)))
    figures["direction_max_deg"] = float(direction.max())
    return figures


def validate(
    calibration: TriadCalibration, poses: StaticPoses, *, magnetometer: bool = False
) -> dict[str, float]:
    """Figures of a calibration on poses that it has not seen; see `held_out_figures`."""
    return held_out_figures(corrected_poses(calibration, poses), poses, magnetometer=magnetometer)


def cross_validate(
    function: Callable[[StaticPoses], TriadCalibration],
    poses: StaticPoses,
    folds: int = FOLDS,
    *,
    magnetometer: bool = False,
) -> dict[str, float]:
    """The same figures where there are no other poses: each fold is corrected by a fit to the
    others.

    Fold k holds every folds-th pose from the k-th on, so that a sequence of poses is spread over
    all of them; where that takes all poses of a face away, folds are stretches of the sequence.
    Folds whose rest does not determine the parameters are left out, and `held_out_poses` says how
    many poses remain.

    Args:
        function: From poses to a calibration.
        poses: All.
        folds: At most one for each pose.
        magnetometer: Lengths are in uT.

    Returns:
        The figures; empty where no fold could be fitted.
    """
    index, count = np.arange(len(poses)), min(folds, len(poses))
    for fold in (index % count, index * count // len(poses)):
        parts, held = [], []
        for k in range(count):
            mine = fold == k
            try:
                calibration = function(poses.subset(~mine))
            except PoorExcitation:
                continue
            parts.append(corrected_poses(calibration, poses.subset(mine)))
            held.append(index[mine])
        if parts:
            return held_out_figures(
                np.vstack(parts), poses.subset(np.concatenate(held)), magnetometer=magnetometer
            )
    return {}
