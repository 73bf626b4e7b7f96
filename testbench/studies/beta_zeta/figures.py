"""Figures of the study `beta_zeta`: those of the source that carry a result, of the first part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.estimation.filters import OrientationFilter, get_filter
from testbench.evaluation.metrics import orientation_errors
from testbench.model import rotation
from testbench.records.results.study import BoxNumbers, StudyBoxes, StudyCurve, StudyCurves
from testbench.studies.beta_zeta import words
from testbench.studies.beta_zeta.gains import ADAPTIVE, MARG, UPSTREAM
from testbench.studies.beta_zeta.takes import Take, same_sign

SHOWN_SAMPLES = 400
"""Of a curve over time, about."""
GAINS = {"beta": 0.35, "zeta": 0.07}
SHOWN_BETAS = (0.01, 0.1, 0.35, 1.0)
ANGLES = ("roll", "pitch", "yaw")
NUMBERS = {
    ("thigh", "walking"): ("32, 33", "41, 42"),
    ("foot", "walking"): ("34, 35", ""),
    ("thigh", "sitting"): ("36, 37", "43, 44"),
    ("thigh", "standing"): ("38, 39", ""),
}
"""The source's figures of quaternions and of Euler angles, by sensor and motion."""


def figures(takes: Sequence[Take], how: str) -> tuple[StudyCurves, ...]:
    """Quaternions, Euler angles and differences of each take; gains and jumps of the first.

    Args:
        takes: Of the first part.
        how: To read those over time.
    """
    drawn: list[StudyCurves] = []
    usable = [take for take in takes if take.samples.has("mag")]
    for take in usable:
        drawn += [quaternions(take, how), quaternion_differences(take, how)]
        drawn += [euler_angles(take, how), euler_differences(take, how)]
    if usable:
        drawn += [by_gains(usable[0]), jumps(usable[0])]
    return tuple(curves for curves in drawn if curves.curves)


def boxes(takes: Sequence[Take]) -> list[StudyBoxes]:
    """Total errors of each take of the first part; none without a truth and a magnetometer.

    Args:
        takes: With a truth.
    """
    kinds = {
        "beta 0.35 and zeta 0.07": get_filter(UPSTREAM, GAINS),
        "beta 0.041": get_filter(MARG),
        "adaptive beta": get_filter(ADAPTIVE, {"beta": 0.1}),
    }
    drawn = {}
    for take in takes:
        if take.part != 0 or not take.samples.has("mag") or take.q_true is None:
            continue
        for label, kind in kinds.items():
            q = take.run(kind)
            known = np.isfinite(take.q_true).all(axis=1) & np.isfinite(q).all(axis=1)
            errors = orientation_errors(q[known], take.q_true[known])
            own = errors.total if take.headed else errors.inclination
            drawn[f"{label}, {take.sensor}, {take.motion}"] = BoxNumbers.of(np.degrees(own))
    if not drawn:
        return []
    return [StudyBoxes(words.BOXES, "error [deg]", drawn, {}, words.BOXES_HOW)]


def _named(take: Take, what: str, kind: int) -> str:
    number = NUMBERS.get((take.sensor, take.motion), ("", ""))[kind]
    beside = f" (figures {number})" if number else ""
    return f"{what}, {take.sensor}, {take.motion}{beside}"


def _rows(take: Take) -> np.ndarray:
    return np.arange(0, len(take.seconds), max(len(take.seconds) // SHOWN_SAMPLES, 1))


def _ours() -> OrientationFilter:
    return get_filter(UPSTREAM, GAINS)


def quaternions(take: Take, how: str) -> StudyCurves:
    """Components of the quaternion by Madgwick's filter and by the device.

    Args:
        take: Which.
        how: To read it.
    """
    rows, curves = _rows(take), []
    q, device = take.run(_ours()), take.device
    q = same_sign(q, np.where(np.isfinite(device), device, q))
    for i, name in enumerate("wxyz"):
        curves.append(
            StudyCurve(f"q{name}, Madgwick", take.seconds[rows], q[rows, i], "line", f"q{name}")
        )
        if np.isfinite(device).any():
            curves.append(
                StudyCurve(
                    f"q{name}, device", take.seconds[rows], device[rows, i], "fit", f"q{name}"
                )
            )
    caption = _named(take, "Quaternions", 0)
    return StudyCurves(caption, "time [s]", "component [1]", tuple(curves), how)


def quaternion_differences(take: Take, how: str) -> StudyCurves:
    """Differences of these components over time; no curve without a device.

    Args:
        take: Which.
        how: To read it.
    """
    rows, device, curves = _rows(take), take.device, []
    if np.isfinite(device).any():
        apart = same_sign(take.run(_ours()), device) - device
        curves = [
            StudyCurve(f"q{name}", take.seconds[rows], apart[rows, i], "line")
            for i, name in enumerate("wxyz")
        ]
    caption = _named(take, "Difference of the quaternions", 0)
    return StudyCurves(caption, "time [s]", "difference [1]", tuple(curves), how)


def _degrees(q: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw without jumps, shape (n, 3) [deg]; NaN where q is."""
    angles = np.full((len(q), 3), np.nan)
    known = np.isfinite(q).all(axis=1)
    if known.any():
        found = rotation.to_euler("ZYX", q[known])[:, ::-1]
        angles[known] = np.degrees(np.unwrap(found, axis=0))
    return angles


def euler_angles(take: Take, how: str) -> StudyCurves:
    """Roll, pitch and yaw of the sensor, without jumps.

    Args:
        take: Which.
        how: To read it.
    """
    rows, curves = _rows(take), []
    ours, device = _degrees(take.run(_ours())), _degrees(take.device)
    for i, name in enumerate(ANGLES):
        curves.append(
            StudyCurve(f"{name}, Madgwick", take.seconds[rows], ours[rows, i], "line", name)
        )
        if np.isfinite(device).any():
            turns = 360 * np.round(np.nanmedian(ours[:, i] - device[:, i]) / 360)
            curves.append(
                StudyCurve(
                    f"{name}, device", take.seconds[rows], device[rows, i] + turns, "fit", name
                )
            )
    caption = _named(take, "Euler angles", 1)
    return StudyCurves(caption, "time [s]", "angle [deg]", tuple(curves), how)


def euler_differences(take: Take, how: str) -> StudyCurves:
    """Differences of these angles, within half a turn; no curve without a device.

    Args:
        take: Which.
        how: To read it.
    """
    rows, device, curves = _rows(take), _degrees(take.device), []
    if np.isfinite(device).any():
        apart = (_degrees(take.run(_ours())) - device + 180) % 360 - 180
        curves = [
            StudyCurve(name, take.seconds[rows], apart[rows, i], "line")
            for i, name in enumerate(ANGLES)
        ]
    caption = _named(take, "Difference of the Euler angles", 1)
    return StudyCurves(caption, "time [s]", "difference [deg]", tuple(curves), how)


def by_gains(take: Take) -> StudyCurves:
    """One component of the quaternion by several gains, as figures 30 and 31.

    Args:
        take: Which.
    """
    rows, curves = _rows(take), []
    device = take.device
    if np.isfinite(device).any():
        curves.append(StudyCurve("device", take.seconds[rows], device[rows, 0], "truth"))
    for beta in SHOWN_BETAS:
        q = take.run(get_filter(UPSTREAM, {"beta": beta, "zeta": GAINS["zeta"]}))
        q = same_sign(q, np.where(np.isfinite(device), device, q))
        curves.append(StudyCurve(f"beta {beta:g}", take.seconds[rows], q[rows, 0], "line"))
    caption = f"qw by several gains, {take.sensor}, {take.motion} (figures 30, 31)"
    return StudyCurves(caption, "time [s]", "qw [1]", tuple(curves), words.QW_HOW, ordered=False)


def jumps(take: Take) -> StudyCurves:
    """An angle with its jumps of a whole turn and without, as figures 26, 27 and 40.

    Args:
        take: Which.
    """
    rows, q = _rows(take), take.run(_ours())
    yaw = rotation.to_euler("ZYX", q)[:, 0]
    # turned to where it crosses half a turn, as the source's sensor was by chance
    around = np.pi - float(np.median(np.unwrap(yaw)))
    wrapped = np.degrees((yaw + around + np.pi) % (2 * np.pi) - np.pi)
    curves = (
        StudyCurve("as converted", take.seconds[rows], wrapped[rows], "line"),
        StudyCurve(
            "without jumps",
            take.seconds[rows],
            np.degrees(np.unwrap(np.radians(wrapped)))[rows],
            "fit",
        ),
    )
    caption = f"Jumps of the yaw, {take.sensor}, {take.motion} (figures 26, 27, 40)"
    return StudyCurves(caption, "time [s]", "angle [deg]", curves, words.JUMPS_HOW)
