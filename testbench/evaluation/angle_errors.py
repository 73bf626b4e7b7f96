"""How each angle of a joint errs, and what in its truth is counted otherwise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbench.evaluation.flexion import LEAST_GIMBAL_MARGIN, JointErrors
from testbench.model import rotation
from testbench.model.joint_angle import INDEX, decomposition_of
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.evaluation_rows import AngleErrorRow
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition

LEAST_ROWS = 10
"""Rows of an angle below which nothing is said of its sign or order."""
MOVES = np.radians(2.0)
"""An angle whose standard deviation is less tells nothing of sign and unit [rad]."""
REVERSED = -0.8
"""Correlation of an angle with its truth from which on one of them counts the other way."""
UNLIKE = 0.8
"""A flexion that correlates less with its truth, either way, is said to be hardly alike: joints of
one walk reach 0.7 where their rates fit best.
"""
ALIKE, BETTER = 0.9, 0.5
"""Correlation of angles that are one, and by how much an exchange must make the sum of two better.
"""
DEGREES, UNIT_WITHIN = 180 / np.pi, 0.25
"""Ratio of the two units, and the part that a ratio may differ from it by."""
OFFSET, OFFSET_FACTOR = np.radians(3.0), 2.0
"""A constant error is named from this size on [rad], and if it is so many times what is left."""


def angle_error_rows(errors: JointErrors) -> list[AngleErrorRow]:
    """How each angle of a joint errs by each filter, over all that is judged.

    Args:
        errors: Of the joint.
    """
    if not errors.steps:
        return []
    rows = np.concatenate([own for _, own in errors.steps])
    found = []
    for key in errors.error:
        definition = errors.definition(key[1])
        decomposition = decomposition_of(definition)
        estimated, true = errors.angles[key][rows], errors.true_angles[key[1]][rows]
        defined = _defined(definition, true)
        for i, which in enumerate(INDEX):
            flexion = which == definition.flexion
            sign = float(definition.sign) if flexion else 1.0
            known = defined[:, i] & np.isfinite(estimated[:, i])
            if known.any():
                pair = sign * estimated[known, i], sign * true[known, i]
                name = decomposition.names[i]
                found.append(_row((errors.name, *key), which, name, flexion, pair))
    return found


def _defined(definition: FlexionAngle, true: np.ndarray) -> np.ndarray:
    """Where each angle is known, and the flexion or far enough from gimbal lock, shape (n, 3)."""
    with np.errstate(invalid="ignore"):
        far = decomposition_of(definition).margins(true) >= LEAST_GIMBAL_MARGIN
    far[:, INDEX[definition.flexion]] = True
    if np.isnan(true).all(axis=0).any():  # where not all are known, nobody can say
        far[:] = True
    return np.asarray(far & np.isfinite(true))


def _row(
    of: tuple[str, str, str],
    which: str,
    name: str,
    flexion: bool,
    angles: tuple[np.ndarray, np.ndarray],
) -> AngleErrorRow:
    """What the errors of one angle come to.

    Args:
        of: Joint, filter and label of the definition.
        which: Of the three angles.
        name: What the definition calls it.
        flexion: Whether it is the flexion.
        angles: Estimated and true ones, shape (n,) each [rad].
    """
    estimated, true = angles
    error = rotation.wrap(estimated - true)
    offset = _offset(error)
    spread = rotation.wrap(error - offset)
    r = _correlation(estimated, true)
    return AngleErrorRow(
        *of,
        which,
        name,
        flexion,
        n=len(error),
        mean_error_deg=float(np.degrees(offset)),
        rmse_deg=float(np.degrees(np.sqrt(np.mean(error**2)))),
        rmse_without_mean_deg=float(np.degrees(np.sqrt(np.mean(spread**2)))),
        max_abs_error_deg=float(np.degrees(np.abs(error).max())),
        correlation=r if np.isfinite(r) else None,
        true_range_deg=float(np.degrees(np.ptp(np.unwrap(true)))),
    )


def _offset(error: np.ndarray) -> float:
    """Mean of wrapped errors, wherever on the circle they lie [rad]."""
    middle = float(np.angle(np.mean(np.exp(1j * error))))
    return float(rotation.wrap(np.array(middle + np.mean(rotation.wrap(error - middle)))))


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Of two angles; NaN where one hardly moves."""
    a, b = np.unwrap(a), np.unwrap(b)
    if len(a) < LEAST_ROWS or a.std() == 0 or b.std() == 0:
        return float("nan")
    return float(np.corrcoef(a, b)[0, 1])


def convention_findings(errors: JointErrors) -> list[Finding]:
    """What in a truth of joint angles is counted otherwise than the estimate does.

    A sign, an order, a unit or a zero; none is mended, and the errors hold all of them.

    Args:
        errors: Of a joint whose truth is angles.
    """
    if not errors.steps:
        return []
    rows = np.concatenate([own for _, own in errors.steps])
    label, place = errors.joint.label, INDEX[errors.joint.flexion]
    true = errors.true_angles[label][rows]
    pairs = []
    for key in (own for own in errors.error if own[1] == label):
        estimated = errors.angles[key][rows]
        known = np.isfinite(estimated).all(axis=1)
        if known.sum() >= LEAST_ROWS:
            r = _correlation(estimated[known, place], true[known, place])
            pairs.append((float(np.nan_to_num(abs(r))), estimated[known], true[known]))
    if not pairs:
        return []
    _, estimated, true = max(pairs, key=lambda pair: pair[0])  # by the filter that is nearest
    return list(_conventions(errors.joint, estimated, true))


def _conventions(
    joint: JointDefinition, estimated: np.ndarray, true: np.ndarray
) -> Iterator[Finding]:
    """See `convention_findings`; angles of shape (n, 3) [rad], of one filter and of the truth."""
    names = decomposition_of(joint).names
    given = [i for i in range(3) if np.isfinite(true[:, i]).all()]
    r = np.array([[_correlation(estimated[:, i], true[:, j]) for j in range(3)] for i in range(3)])
    size = np.nan_to_num(np.abs(r))
    exchanged = set()
    for i in given:
        for j in (own for own in given if own > i):
            gain = size[i, j] + size[j, i] - size[i, i] - size[j, j]
            if gain > BETTER and max(size[i, j], size[j, i]) > ALIKE:
                exchanged |= {i, j}
                yield finding("truth.angles_exchanged", angle=names[i], other=names[j])
    for i in (own for own in given if own not in exchanged):
        moved = float(np.std(np.unwrap(estimated[:, i])))
        moves = moved > MOVES
        ratio = float(np.std(np.unwrap(true[:, i]))) / max(moved, 1e-12)
        if moves and size[i, i] > ALIKE and _other_unit(ratio):
            factor = DEGREES if ratio < 1 else 1 / DEGREES
            yield finding("truth.angle_unit", angle=names[i], ratio=ratio, factor=factor)
        elif moves and r[i, i] < REVERSED:
            yield finding("truth.angle_reversed", angle=names[i], correlation=float(r[i, i]))
        elif moves and i == INDEX[joint.flexion] and size[i, i] < UNLIKE:
            yield finding("truth.angle_unlike", angle=names[i], correlation=float(size[i, i]))
        else:
            yield from _told_offset(names[i], rotation.wrap(estimated[:, i] - true[:, i]))


def _other_unit(ratio: float) -> bool:
    """Whether a truth is so many times as large as the estimate as one unit is of the other."""
    return abs(max(ratio, 1 / max(ratio, 1e-12)) / DEGREES - 1) < UNIT_WITHIN


def _told_offset(name: str, error: np.ndarray) -> Iterator[Finding]:
    """A constant error that is larger than all else, of shape (n,) [rad]."""
    offset = _offset(error)
    spread = float(np.sqrt(np.mean(rotation.wrap(error - offset) ** 2)))
    if abs(offset) > max(OFFSET, OFFSET_FACTOR * spread):
        offset_deg, spread_deg = float(np.degrees(offset)), float(np.degrees(spread))
        yield finding(
            "truth.angle_offset", angle=name, offset_deg=offset_deg, spread_deg=spread_deg
        )
