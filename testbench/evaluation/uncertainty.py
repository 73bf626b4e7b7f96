"""Uncertainty of the truth: a budget behind every reported mean error.

JCGM 100:2008; docs/uncertainty.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from scipy.special import ndtri, stdtrit

from testbench.evaluation.judged import window_rows
from testbench.model.links import Twist
from testbench.records.results.uncertainty import (
    LEVEL,
    UncertaintyBudget,
    UncertaintySource,
)
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.specs.robot import Robot

LEAST_SENSITIVITY = 1e-6
"""Joints that move the truth less than this are left out of the table."""
OF_THE_ROBOT_FILE = "robot file (uncertainty), which says why"
_DIVISORS = {"normal": 1.0, "rectangular": float(np.sqrt(3.0))}
"""From half-width or standard deviation to standard uncertainty (JCGM 100:2008, 4.3.7)."""


@dataclass(frozen=True)
class Stated:
    """An uncertainty as its source states it.

    Attributes:
        name: What may be off.
        kind: "A" from the recording's own scatter, "B" from elsewhere.
        value: Standard deviation, or half of the width of a rectangular distribution.
        unit: Of the value.
        why: Where the value comes from, and why it counts or does not.
        distribution: A key of `_DIVISORS`.
        degrees_of_freedom: None for infinitely many.
        rests_on: The number that the value is, where other lines are it too.
    """

    name: str
    kind: Literal["A", "B"]
    value: float
    unit: str
    why: str
    distribution: str = "normal"
    degrees_of_freedom: float | None = None
    rests_on: str = ""

    def source(self, mean: float, size: float) -> UncertaintySource:
        """The line of a budget.

        Args:
            mean: Change of the mean error for one unit of the source [deg/unit].
            size: Change of mean magnitudes for one unit of the source [deg/unit].
        """
        divisor = _DIVISORS[self.distribution]
        standard = float(self.value) / divisor
        return UncertaintySource(
            self.name,
            self.kind,
            float(self.value),
            self.unit,
            self.distribution,
            divisor,
            standard,
            float(mean),
            abs(float(mean)) * standard,
            abs(float(size)) * standard,
            self.degrees_of_freedom,
            self.why,
            self.rests_on,
        )


@dataclass(frozen=True)
class ArmSensitivity:
    """How one reported angle answers to the arm, by judged configuration.

    Attributes:
        signed: Change of the angle with each joint's zero, and behind these with each twist of a
            link, shape (m, sources), for errors that keep their sign.
        size: The same for magnitudes (for a rotation: its length about the axes that count).
        step: Step of each configuration, shape (m,).
        weight: Of each step, shape (steps,), summing to 1.
        reference: `size` in the pose that the frames were aligned in, shape (sources,), or None
            without one.
        joints: How many of the sources are joints; only these are redrawn by each move.
    """

    signed: np.ndarray
    size: np.ndarray
    step: np.ndarray
    weight: np.ndarray
    reference: np.ndarray | None
    joints: int

    def constant(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the mean and of magnitudes, for an error that lasts all session.

        Returns:
            Shape (sources,) each.
        """
        signed, square = self._by_step(self.signed), self._by_step(self.size**2)
        return np.abs(self.weight @ signed), np.sqrt(self.weight @ square)

    def redrawn(self) -> tuple[float, float]:
        """Of the mean and of magnitudes, for an equal error of every joint drawn anew by step."""
        signed = self._by_step(self.signed[:, : self.joints])
        square = self._by_step(self.size[:, : self.joints] ** 2)
        return float(np.sqrt(np.sum((self.weight[:, None] * signed) ** 2))), float(
            np.sqrt(np.sum(self.weight @ square))
        )

    def _by_step(self, values: np.ndarray) -> np.ndarray:
        count = len(self.weight)
        sums = np.stack([np.bincount(self.step, column, count) for column in values.T], axis=1)
        return np.asarray(sums / np.maximum(np.bincount(self.step, minlength=count), 1)[:, None])


# One piece: one line of the budget after another, in the order in which they are shown.
def arm_sources(
    robot: Robot,
    twists: Sequence[Twist],
    arm: ArmSamples,
    steps: Sequence[PlannedStep],
    c: ArmSensitivity,
) -> list[UncertaintySource]:
    """What the arm itself contributes.

    Args:
        robot: The arm, which states its uncertainties.
        twists: Of its links, in the order of the sensitivities behind those of the joints.
        arm: What it reported.
        steps: That are judged.
        c: How the angle answers to it.
    """
    servo = robot.spec.servo
    result = _lasting_sources(robot, twists, c)
    mean, size = c.redrawn()
    result.append(
        Stated(
            "repeatability of the arm",
            "B",
            servo.repeatability_deg,
            "deg",
            "robot file (servo): of each joint, drawn anew by each move, so that it averages over "
            "poses",
        ).source(mean, size)
    )
    result.append(
        Stated(
            "resolution of the encoders",
            "B",
            servo.encoder_resolution_deg / 2,
            "deg",
            "robot file (servo): half a count, another part of it in each pose",
            distribution="rectangular",
        ).source(mean, size)
    )
    scatter = _scatter(arm, steps)
    if scatter is not None:
        result.append(
            Stated(
                "static averaging of the readings",
                "A",
                scatter[0],
                "deg",
                "standard deviation of a pose's mean reading, by the scatter of its readings",
                degrees_of_freedom=scatter[1],
            ).source(mean, size)
        )
    result.append(
        Stated(
            "tracking of the controller",
            "A",
            _tracking(arm, steps),
            "deg",
            "RMS of commanded less measured angles; the truth is what the encoders measured, so it "
            "does not enter",
        ).source(0.0, 0.0)
    )
    return result


def _lasting_sources(
    robot: Robot, twists: Sequence[Twist], c: ArmSensitivity
) -> list[UncertaintySource]:
    """What the arm's kinematics are off by through the whole session: theta of each joint, alpha
    (and beta) of each link; and a and d, which move links and turn none.
    """
    spec = robot.spec.uncertainty
    zeros = [
        (f"kinematic calibration, {name}", value, "joint_angle_deg")
        for name, value in zip(
            robot.joint_names, np.degrees(robot.joint_angle_uncertainty), strict=True
        )
    ]
    tilts = [
        (
            f"twist {twist.name}, {twist.link.before} to {twist.link.after}",
            spec.link_twist_deg,
            "link_twist_deg",
        )
        for twist in twists
    ]
    result = [
        Stated(
            name,
            "B",
            value,
            "deg",
            OF_THE_ROBOT_FILE,
            degrees_of_freedom=spec.degrees_of_freedom,
            rests_on=rests_on,
        ).source(mean, size)
        for (name, value, rests_on), mean, size in zip(zeros + tilts, *c.constant(), strict=True)
        if max(mean, size) > LEAST_SENSITIVITY
    ]
    for name, value in (("lengths a", spec.link_length_mm), ("offsets d", spec.link_offset_mm)):
        result.append(
            Stated(
                f"{name} of the links",
                "B",
                value,
                "mm",
                "robot file (uncertainty): it moves links and turns none, so it does not enter",
                degrees_of_freedom=spec.degrees_of_freedom,
            ).source(0.0, 0.0)
        )
    return result


def _scatter(arm: ArmSamples, steps: Sequence[PlannedStep]) -> tuple[float, float] | None:
    """Standard deviation of a joint's mean reading in a pose [deg], and its degrees of freedom.

    RMS over joints and poses.
    """
    poses = [step for step in steps if step.kind != "sweep"]
    first, last = window_rows(poses, arm.host_time_ns)
    several = last - first > 1
    if not several.any():
        return None
    variances = _variances_of_means(arm.q_measured, first[several], last[several])
    freedom = (last - first - 1)[several].sum() * arm.q_measured.shape[1]
    return float(np.degrees(np.sqrt(np.mean(variances)))), float(freedom)


@njit(cache=True)
def _variances_of_means(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Sample variance of each column over its number of rows, in each span of rows.

    Args:
        values: Shape (n, k).
        first: First row of each span, shape (m,).
        last: Row behind each span, at least two rows on, shape (m,).

    Returns:
        Shape (m, k).
    """
    result = np.zeros((len(first), values.shape[1]))
    for i in range(len(first)):
        n = last[i] - first[i]
        for j in range(values.shape[1]):
            mean = 0.0
            for row in range(first[i], last[i]):
                mean += values[row, j] / n
            # s^2 / n: variance of a mean (JCGM 100:2008, eq. 5)
            for row in range(first[i], last[i]):
                result[i, j] += (values[row, j] - mean) ** 2 / (n - 1) / n
    return result


def _tracking(arm: ArmSamples, steps: Sequence[PlannedStep]) -> float:
    """RMS of commanded less measured angles over the judged windows and all joints [deg]."""
    first, last = window_rows(steps, arm.host_time_ns)
    seen = last > first
    if not seen.any():
        return 0.0
    squares = _mean_squares(arm.q_sent, arm.q_measured, first[seen], last[seen])
    return float(np.degrees(np.sqrt(np.mean(squares))))


@njit(cache=True)
def _mean_squares(a: np.ndarray, b: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Mean square of a - b, shapes (n, k), over all columns in each span of rows, shape (m,)."""
    result = np.zeros(len(first))
    for i in range(len(first)):
        for row in range(first[i], last[i]):
            for j in range(a.shape[1]):
                result[i] += (a[row, j] - b[row, j]) ** 2
        # over all rows and columns
        result[i] /= (last[i] - first[i]) * a.shape[1]
    return result


def mounting_source(robot: Robot, aligned: str, mean: float, size: float) -> UncertaintySource:
    """What the mounting contributes where no alignment takes it out."""
    spec = robot.spec.uncertainty
    why = OF_THE_ROBOT_FILE
    if aligned in ("reference_pose", "motion"):
        mean = size = 0.0
        why = (
            f"the alignment ({aligned}) takes it out; what that leaves is the line 'frame "
            "alignment'"
        )
    return Stated(
        "mounting of the sensors",
        "B",
        spec.mounting_deg,
        "deg",
        why,
        degrees_of_freedom=spec.degrees_of_freedom,
    ).source(mean, size)


def alignment_source(
    robot: Robot | None, aligned: str, c: ArmSensitivity | None, fitted_sd: float | None
) -> UncertaintySource | None:
    """What the alignment of the frames leaves.

    Args:
        robot: The arm; None without one.
        aligned: Method of the alignment.
        c: How the angle answers to the arm; None without one.
        fitted_sd: Stated by an alignment by motion [deg], or None.
    """
    if aligned == "none":
        return None
    if fitted_sd is not None:
        return Stated(
            "frame alignment", "A", fitted_sd, "deg", "stated by the fit of the frames"
        ).source(1.0, 1.0)
    if robot is None or c is None or c.reference is None:
        return None
    size = float(np.sqrt(np.sum(c.reference[: c.joints] ** 2)))
    return Stated(
        "frame alignment",
        "B",
        robot.spec.servo.repeatability_deg,
        "deg",
        "it rests on one pose, which the arm repeats only so well",
    ).source(size, size)


def levelling_source(robot: Robot, size: float) -> UncertaintySource:
    """What the tilt of the arm's base contributes to an orientation against the vertical."""
    spec = robot.spec.uncertainty
    return Stated(
        "levelling of the base",
        "B",
        spec.levelling_deg,
        "deg",
        OF_THE_ROBOT_FILE,
        degrees_of_freedom=spec.degrees_of_freedom,
    ).source(size, size)


def combine(
    owner: str,
    quantity: str,
    section: str | None,
    sources: Sequence[UncertaintySource | None],
    missing: Sequence[str],
    assumed: Sequence[str] = (),
) -> UncertaintyBudget:
    """The budget of independent sources (JCGM 100:2008, eq. 10).

    Args:
        owner: Joint of the protocol, joint of the arm, or sensor.
        quantity: What the error is of.
        section: Of the protocol; None for all of them.
        sources: None are passed over.
        missing: What is not known; with any of it nothing is combined.
        assumed: What was taken where nobody said.
    """
    lines = [source for source in sources if source is not None]
    if missing:
        return UncertaintyBudget(
            owner,
            quantity,
            section,
            lines,
            False,
            None,
            None,
            None,
            None,
            None,
            None,
            list(missing),
            assumed=list(assumed),
        )
    signed = [source.contribution_deg for source in lines]
    sizes = [source.magnitude_deg for source in lines]
    # JCGM 100:2008, eq. 10 with c_i u_i of each line
    combined, size = (float(np.sqrt(sum(x**2 for x in own))) for own in (signed, sizes))
    freedom = effective_freedom(lines, signed)
    k, of_size = coverage_factor(freedom), coverage_factor(effective_freedom(lines, sizes))
    return UncertaintyBudget(
        owner,
        quantity,
        section,
        lines,
        True,
        combined,
        size,
        freedom,
        k,
        k * combined,
        of_size * size,
        assumed=list(assumed),
        coverage_factor_magnitude=of_size,
    )


def effective_freedom(
    lines: Sequence[UncertaintySource], contributions: Sequence[float]
) -> float | None:
    """Effective degrees of freedom (Welch & Satterthwaite; JCGM 100:2008, eq. G.2b).

    Lines that rest on one number are one: where that is too small, they all are.

    Args:
        lines: Of a budget.
        contributions: Of each of them to the combined standard uncertainty.

    Returns:
        None for infinitely many.
    """
    squares: dict[object, float] = {}
    freedoms: dict[object, float] = {}
    for i, (line, contribution) in enumerate(zip(lines, contributions, strict=True)):
        if line.degrees_of_freedom is not None:
            key: object = line.rests_on or i
            squares[key] = squares.get(key, 0.0) + contribution**2
            freedoms[key] = min(line.degrees_of_freedom, freedoms.get(key, np.inf))
    loss = sum(squares[key] ** 2 / freedoms[key] for key in squares)
    total = sum(contribution**2 for contribution in contributions)
    return total**2 / loss if loss > 0 else None


def coverage_factor(freedom: float | None) -> float:
    """The factor k for 95 %: Student's t, between whole numbers of degrees of freedom too (JCGM
    100:2008, G.4.1).

    Args:
        freedom: Effective degrees of freedom; None for infinitely many.
    """
    quantile = (1 + LEVEL) / 2
    return float(ndtri(quantile) if freedom is None else stdtrit(freedom, quantile))
