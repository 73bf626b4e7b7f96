"""Models of published flexion errors: what could have made tables 5.6 and 5.7 of Castellanos Alonso
2023, fitted to their values.

A model that fits is a candidate. Two that fit alike are not told apart by what was published.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from testbench.model import rotation
from testbench.model.joint_angle import joint_angles
from testbench.records.results.study import StudyReason, StudyRow, StudyTable
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.published import FlexionErrors, PublishedResults
from testbench.reporting.page.tables import mean_of_known

GROWING, SLOW = "5.7", "5.6"
"""The published tables whose error grows with the flexion: by YXZ, and by ZXZ."""
HEADING, TILT = "heading", "tilt"


@dataclass(frozen=True)
class Fitted:
    """Two parameters fitted to a published table.

    Attributes:
        values: Of the parameters [deg].
        model: Magnitudes of the error, shape (n,) [deg].
        residual: Model less published, shape (n,) [deg].
        largest_at_deg: Flexion of the largest residual.
    """

    values: tuple[float, float]
    model: np.ndarray
    residual: np.ndarray
    largest_at_deg: float

    @property
    def rms_deg(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def largest_deg(self) -> float:
        """Magnitude of the largest residual."""
        return float(np.abs(self.residual).max())


def table_of(published: PublishedResults, number: str) -> FlexionErrors:
    """One of the published tables of flexion errors."""
    return next(row for row in published.flexion_mean_abs_error if row.table == number)


def fit_model(
    published: PublishedResults,
    number: str,
    model: Callable[[np.ndarray, float, float], np.ndarray],
    start: tuple[float, float],
) -> Fitted:
    """The two parameters that come nearest to a published table, by least squares.

    Args:
        published: All tables.
        number: Of the one that is fitted.
        model: Magnitudes of the error [deg] by flexion [deg] and the two parameters [deg].
        start: Of the search.
    """
    theirs = np.array(table_of(published, number).mean_abs_error_deg, dtype=float)
    flexion = np.array(published.flexion_deg)
    found = least_squares(lambda x: model(flexion, x[0], x[1]) - theirs, start)
    first, second = (float(value) for value in found.x)
    return Fitted(
        (first, abs(second)),
        model(flexion, first, second),
        found.fun,
        float(flexion[np.abs(found.fun).argmax()]),
    )


def apart(flexion_deg: np.ndarray, offset_deg: float, heading_deg: float) -> np.ndarray:
    """|error| by YXZ of conj(q_A) q_F, two sensors apart in heading, shape (n,) [deg].

    Args:
        flexion_deg: True flexion, shape (n,).
        offset_deg: Of the elbow where the flexion is said to be zero.
        heading_deg: Between the earths of both sensors.
    """
    bent = _bent(flexion_deg + offset_deg)
    arm = np.tile(rotation.IDENTITY, (len(bent), 1))
    return _yxz_error("proximal", arm, rotation.multiply(_turned(heading_deg), bent), flexion_deg)


def common(flexion_deg: np.ndarray, offset_deg: float, heading_deg: float) -> np.ndarray:
    """|error| by YXZ of q_F conj(q_A), two sensors that agree in an earth turned from the axis of
    the flexion, shape (n,) [deg].

    Args:
        flexion_deg: True flexion, shape (n,).
        offset_deg: Of the elbow where the flexion is said to be zero.
        heading_deg: Of the axis of the flexion in the earth that both share.
    """
    earth = _turned(heading_deg)
    forearm = rotation.multiply(earth, _bent(flexion_deg + offset_deg))
    arm = np.broadcast_to(earth, forearm.shape)
    return _yxz_error("world", arm, forearm, flexion_deg)


def tilted(flexion_deg: np.ndarray, offset_deg: float, tilt_deg: float) -> np.ndarray:
    """|error| of the angle between two segments about an axis that is tilted against them, shape
    (n,) [deg]: 2 asin(cos e sin(f / 2)) - f.

    Args:
        flexion_deg: f, true, shape (n,).
        offset_deg: Of the elbow where the flexion is said to be zero.
        tilt_deg: e, of the axis of the flexion out of the plane across the segments.
    """
    half = np.radians(flexion_deg + offset_deg) / 2
    seen = 2 * np.degrees(np.arcsin(np.cos(np.radians(tilt_deg)) * np.sin(half)))
    return np.asarray(np.abs(seen - flexion_deg))


def _bent(flexion_deg: np.ndarray) -> np.ndarray:
    """A flexion about x, shape (n, 4)."""
    return rotation.from_rotation_vector(np.radians(flexion_deg)[:, None] * [1.0, 0.0, 0.0])


def _turned(heading_deg: float) -> np.ndarray:
    """A turn about the vertical, shape (4,)."""
    return rotation.from_rotation_vector(np.array([0.0, 0.0, np.radians(heading_deg)]))


def _yxz_error(
    seen_from: str, arm: np.ndarray, forearm: np.ndarray, flexion_deg: np.ndarray
) -> np.ndarray:
    definition = FlexionAngle.model_validate({"sequence": "YXZ", "seen_from": seen_from})
    angle = np.degrees(joint_angles(arm, forearm, definition)[:, 1])
    return np.asarray(np.abs(angle - flexion_deg))


def heading_fits(published: PublishedResults) -> tuple[Fitted, Fitted]:
    """Both hypotheses of table 5.7, each with an offset and a heading of its own."""
    return (
        fit_model(published, GROWING, apart, (3.7, 20.0)),
        fit_model(published, GROWING, common, (3.7, 20.0)),
    )


# One piece: two models, their rows and what is said of them.
def heading_table(published: PublishedResults) -> StudyTable:
    """Two models of the table that grows, which the published values do not tell apart."""
    theirs = table_of(published, GROWING)
    fits = heading_fits(published)
    names = (
        "conj(q_A) q_F, two sensors apart in heading",
        "q_F conj(q_A) of the annexed program, sensors that agree, their earth turned",
    )
    printed = (None, None, None, *theirs.mean_abs_error_deg)
    rows = [StudyRow("table 5.7", (None,) * len(printed), printed)]
    rows += [
        StudyRow(name, (*fit.values, fit.rms_deg, *fit.model.tolist()))
        for name, fit in zip(names, fits, strict=True)
    ]
    difference = np.abs(fits[0].model - fits[1].model)
    rows.append(
        StudyRow("difference of both, at most", (None, None, float(difference.max()), *difference))
    )
    claim = (
        "Two sensors apart by {0:.1f} deg in heading on an elbow that starts at {1:.1f} deg, with "
        "the order of eq. 2.5, leave {2:.2f} deg RMS and {3:.2f} deg at most, at {4:g} deg, of the "
        "fifteen values."
    )
    other = (
        "Two sensors that agree, in an earth turned by {0:.1f} deg from the axis of the flexion, "
        "with the order of the annexed program, leave the same to {1:.0e} deg. Which of both it "
        "was, the published values do not tell."
    )
    first, second = fits
    return StudyTable(
        HEADING,
        "Two models of table 5.7, each of two parameters fitted to its fifteen values",
        (
            "offset [deg]",
            "heading [deg]",
            "RMS left [deg]",
            *(f"{f:g}°" for f in published.flexion_deg),
        ),
        tuple(rows),
        "How to read: |error| of the flexion by YXZ that each model makes at each flexion, in "
        "degrees, from the joint-angle code on quaternions.",
        "The heading is not identified by the table: one model puts it between the sensors, the "
        "other between the earth and the arm.",
        GROWING,
        (1, 1, 3, *(2,) * len(published.flexion_deg)),
        reasons=(
            StudyReason(
                claim.format(
                    first.values[1],
                    first.values[0],
                    first.rms_deg,
                    first.largest_deg,
                    first.largest_at_deg,
                ),
                "candidate",
                HEADING,
            ),
            StudyReason(
                other.format(second.values[1], max(float(difference.max()), 1e-16)),
                "candidate",
                HEADING,
            ),
        ),
        short="Models of table 5.7",
    )


def tilt_table(published: PublishedResults) -> StudyTable:
    """A tilted axis as a model of table 5.6, beside a straight line with as many parameters."""
    theirs = table_of(published, SLOW)
    flexion = np.array(published.flexion_deg)
    values = np.array(theirs.mean_abs_error_deg, dtype=float)
    fit = fit_model(published, SLOW, tilted, (-0.05, 6.0))
    line = np.polynomial.Polynomial.fit(flexion, values, 1)(flexion)
    line_rms = float(np.sqrt(np.mean((line - values) ** 2)))
    rows = (
        StudyRow(
            f"axis tilted by {fit.values[1]:.1f} deg, offset {fit.values[0]:.2f} deg",
            (*fit.model.tolist(), mean_of_known(fit.model.tolist()), fit.rms_deg),
            (*theirs.mean_abs_error_deg, mean_of_known(theirs.mean_abs_error_deg), None),
        ),
        StudyRow("straight line", (*line.tolist(), mean_of_known(line.tolist()), line_rms)),
    )
    return StudyTable(
        TILT,
        "A model of table 5.6: a flexion about an axis tilted against the segments",
        (*(f"{f:g}°" for f in flexion), "mean", "RMS left"),
        rows,
        "How to read: |error| in degrees; 2 asin(cos e sin((f + o) / 2)) - f, with the tilt e and "
        "the offset o fitted to the fifteen values.",
        "",
        SLOW,
        (2,) * (len(flexion) + 1) + (3,),
        reasons=(
            StudyReason(
                f"A flexion axis tilted by {fit.values[1]:.1f} deg makes the growth of table 5.6 "
                f"but for {fit.rms_deg:.3f} deg RMS; a straight line of as many parameters leaves "
                f"{line_rms:.3f} deg.",
                "candidate",
                TILT,
            ),
        ),
        short="A model of table 5.6",
    )
