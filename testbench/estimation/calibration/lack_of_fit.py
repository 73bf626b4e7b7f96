"""Lack of fit: whether the readings at rest are what a triad's model lets expect.

A model that is too small leaves residuals that are larger than the noise (chi-square test) or that
go with something: with time, as a part that warms up without a thermometer; with the temperature;
with the force to the third or second power, as a response that is no straight line (terms K3 and K2
of IEEE Std 1293-2018, section 5.2). Each is fitted beside the model and tested by what it gains
(`added_terms`); the one that chance explains least is taken first, and the others are asked again
(forward selection; Draper & Smith, Applied Regression Analysis, 1998, section 15.4).

What is found is said, and widens the uncertainty: the calibration is made again without the term,
along each axis, and the changes are added to the covariance (JCGM 100:2008, 5.1.3 and F.2.4.5: an
effect that is known and not corrected belongs to the uncertainty).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import AXES, LEAST_WARMING_K
from testbench.model.statistics.added_terms import AddedTerms, chance_of, with_terms
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence
from testbench.records.results.fit import Fit

SURPRISING = 0.002
"""Residuals, or terms, that noise gives less often than this are put to the model. A recording has
some five such tests, so that one part in a hundred is blamed for nothing."""
WARM_UPS_S = (10.0, 1000.0)
"""Time constants of warming between which the best is looked for [s], beside a straight line: parts
of a gram on a board settle within a minute, a housing within ten."""
TREND_TESTS = 4
"""So many tests the search over time constants is worth: shapes that differ by what noise shows."""
STEP_OF_CONSTANT = 0.1
"""Relative step by which what is not known of a time constant is found [1]."""
NOT_ONE_FIELD = 3.0
"""Residuals of a magnetometer so many times its noise are no field that is the same in all poses:
its calibration is refused where nobody asked for it by name."""

Calibrate = Callable[[StaticPoses], TriadCalibration]


@dataclass(frozen=True)
class Term:
    """Something that the model does not have.

    Attributes:
        kind: "trend", "temperature", "cubic" or "square".
        shape: What it adds along each axis where its size is 1, shape (m, 3) [1].
        allowance: How large it may be without being an error of the model [unit].
        time_constant: Of the warming, for a trend [s].
    """

    kind: str
    shape: np.ndarray
    allowance: float = 0.0
    time_constant: float = float("nan")

    @property
    def columns(self) -> np.ndarray:
        """What it adds to the readings, one size for each axis, shape (m, 3, 3)."""
        return np.asarray(np.eye(3) * self.shape[:, :, None])


@dataclass(frozen=True)
class FoundTerm:
    """A term that the readings ask for.

    Attributes:
        term: Which.
        size: Along each axis, shape (3,) [unit].
        sd: Standard uncertainty of that, shape (3,) [unit].
        constant_sd: Relative standard uncertainty of a trend's time constant [1]; NaN for others.
    """

    term: Term
    size: np.ndarray
    sd: np.ndarray
    constant_sd: float = float("nan")


@dataclass(frozen=True)
class LackOfFit:
    """What a triad's model does not have.

    Attributes:
        terms: Those that were found, the surest first.
        left: What a fit with them leaves.
    """

    terms: tuple[FoundTerm, ...]
    left: Evidence

    @property
    def unexplained(self) -> bool:
        """Whether the residuals are larger than the noise even so."""
        return chance_of(self.left) < SURPRISING

    @property
    def ratio(self) -> float:
        """Residuals in terms of the noise: the square root of chi-square over its degrees of
        freedom (Birge, Phys. Rev. 40, 1932); 1 where none is left.
        """
        dof = self.left.dof
        return float(np.sqrt(self.left.squares / dof)) if dof > 0 else 1.0


def lack_of_fit(
    found: TriadCalibration,
    poses: StaticPoses,
    triad: str,
    settling: float,
    sharp: Evidence | None = None,
) -> LackOfFit | None:
    """What the model of a calibration lacks; None for methods that leave no evidence.

    Args:
        found: By these poses.
        poses: The rests.
        triad: "accelerometer" or "magnetometer".
        settling: Standard deviation of a pose's mean beside its noise, which may wander [unit].
        sharp: What terms are looked for in, the evidence of `found` if None.
    """
    if found.evidence is None:
        return None
    candidates, left = _candidates(found, poses, triad, settling), sharp or found.evidence
    taken: list[FoundTerm] = []
    while candidates:
        asked = [(kind, _best(shapes, left, poses)) for kind, shapes in candidates.items()]
        told = [(kind, best) for kind, best in asked if best is not None]
        if not told:
            break
        kind, (added, term) = min(
            told, key=lambda one: (_chance(one[1][0]), one[1][0].left.squares)
        )
        if _chance(added) * (TREND_TESTS if kind == "trend" else 1) >= SURPRISING:
            break
        sd = np.sqrt(np.diag(added.covariance))
        constant_sd = _constant_sd(term, added, poses, left) if kind == "trend" else float("nan")
        taken.append(FoundTerm(term, added.values, sd, constant_sd))
        left = added.left
        del candidates[kind]
    left = found.evidence
    for own in taken:
        again = with_terms(left, own.term.columns)
        left = left if again is None else again.left
    return LackOfFit(tuple(taken), left)


def all_terms(found: TriadCalibration, poses: StaticPoses, triad: str) -> np.ndarray:
    """Every term that may lack, of a trend two shapes, shape (m, 3, q) [unit].

    Args:
        found: By these poses.
        poses: The rests.
        triad: "accelerometer" or "magnetometer".
    """
    candidates = _candidates(found, poses, triad, 0.0)
    shapes = [term for kind, terms in candidates.items() if kind != "trend" for term in terms]
    trends = candidates.get("trend", [])
    shapes += [trends[i] for i in (len(trends) // 2, -1) if trends]
    return np.concatenate([term.columns for term in shapes], axis=2)


def _chance(added: AddedTerms) -> float:
    """How often noise asks for terms as large: as known, or as what they leave says (F test)."""
    terms, spare = len(added.values), added.left.dof
    if spare < 1:
        return added.chance
    gained = float(added.values @ np.linalg.solve(added.covariance, added.values))
    scatter = max(added.left.squares / spare, 1.0)
    return max(added.chance, float(fdtrc(terms, spare, gained / terms / scatter)))


def _best(
    shapes: Sequence[Term], left: Evidence, poses: StaticPoses
) -> tuple[AddedTerms, Term] | None:
    """The one of several shapes of a term that leaves least; None where none can be fitted.

    Of a trend the shapes are of growing time constants, and the best lies between two of them: a
    parabola through the three about the least says where.
    """
    tried = [(with_terms(left, term.columns, term.allowance), term) for term in shapes]
    told = [(added, term) for added, term in tried if added is not None]
    if not told:
        return None
    squares = [added.left.squares for added, _ in told]
    least = int(np.argmin(squares))
    best = told[least]
    beside = [term.time_constant for _, term in told[max(least - 1, 0) : least + 2]]
    if len(beside) == 3 and np.isfinite(beside).all():
        before, at, after = squares[least - 1 : least + 2]
        bend = before - 2 * at + after
        shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
        constant = beside[1] * (beside[2] / beside[1]) ** shift
        term = _trend(poses, constant, best[1].allowance * float(best[1].shape[:, 0].std()))
        added = with_terms(left, term.columns, term.allowance)
        if added is not None and added.left.squares < at:
            return added, term
    return best


def _constant_sd(term: Term, best: AddedTerms, poses: StaticPoses, left: Evidence) -> float:
    """Relative standard uncertainty of a trend's time constant; NaN for a straight line."""
    if np.isinf(term.time_constant):
        return float("nan")
    beside = [
        with_terms(left, _trend(poses, term.time_constant * factor, 1.0).columns)
        for factor in (1 - STEP_OF_CONSTANT, 1 + STEP_OF_CONSTANT)
    ]
    rise = [own.left.squares - best.left.squares for own in beside if own is not None]
    mean = float(np.mean(rise)) if rise else 0.0
    # chi-square rises by the square of how many standard uncertainties one is off
    return min(STEP_OF_CONSTANT / np.sqrt(mean), 1.0) if mean > 0 else 1.0


def _candidates(
    found: TriadCalibration, poses: StaticPoses, triad: str, settling: float
) -> dict[str, list[Term]]:
    """What may lack, by kind; several shapes where only the readings can tell which."""
    terms: dict[str, list[Term]] = {}
    ones = np.ones((1, 3))
    known = poses.temperature is not None and np.ptp(poses.temperature) >= LEAST_WARMING_K
    if known and poses.temperature is not None:
        above = poses.temperature - poses.temperature.mean()
        order = 2 if found.reference is not None else 1  # a drift that was fitted may be curved
        shape = above**order
        terms["temperature"] = [Term("temperature", (shape - shape.mean())[:, None] * ones)]
    elif poses.start is not None and poses.end is not None and len(poses) > 2:
        terms["trend"] = _trends(poses, settling)
    if triad == "accelerometer":
        share = (poses.mean - found.bias) / poses.magnitude
        terms["cubic"] = [Term("cubic", share**3)]
        terms["square"] = [Term("square", share**2)]
    return terms


def _trend(poses: StaticPoses, constant: float, settling: float) -> Term:
    """Warming with a time constant [s], by what it changes from the first pose to the last."""
    shape = _warm(poses, _middle(poses), constant)
    term = Term("trend", shape[:, None] * np.ones((1, 3)), settling / float(shape.std()), constant)
    return term


def _middle(poses: StaticPoses) -> np.ndarray:
    assert poses.start is not None
    assert poses.end is not None
    return np.asarray((poses.start + poses.end) / 2)


def _warm(poses: StaticPoses, times: np.ndarray, constant: float) -> np.ndarray:
    """Warmth at some times, 0 in the mean of the poses and 1 from the first of them to the last.

    Newton's law of cooling: 1 - exp(-t / constant); a straight line where that is infinite.
    """
    inside = _middle(poses)
    at, seen = (
        t if np.isinf(constant) else -np.expm1(-np.maximum(t, 0.0) / constant)
        for t in (times - inside[0], inside - inside[0])
    )
    return np.asarray((at - seen.mean()) / np.ptp(seen))


def trend_of(lack: LackOfFit) -> FoundTerm | None:
    """The trend that was found, None where none was."""
    return next((own for own in lack.terms if own.term.kind == "trend"), None)


def trend_at(own: FoundTerm, times: np.ndarray, poses: StaticPoses) -> np.ndarray:
    """A trend at other times, shape (n, 3) [unit].

    Args:
        own: The trend.
        times: On the clock of the poses, shape (n,) [s].
        poses: That it was found in.
    """
    return np.asarray(_warm(poses, times, own.term.time_constant)[:, None] * own.size)


def sure_trend(left: Evidence, poses: StaticPoses, settling: float) -> FoundTerm | None:
    """The trend that the evidence of some poses asks for; None where it asks for none.

    Args:
        left: What a fit leaves of them.
        poses: With their times.
        settling: Standard deviation of a pose's mean beside its noise, which may wander [unit].
    """
    best = _best(_trends(poses, settling), left, poses)
    if best is None or _chance(best[0]) * TREND_TESTS >= SURPRISING:
        return None
    return FoundTerm(best[1], best[0].values, np.sqrt(np.diag(best[0].covariance)))


def _trends(poses: StaticPoses, settling: float) -> list[Term]:
    """Trends of growing time constants, a straight line the last."""
    constants = [*np.geomspace(*WARM_UPS_S, 31), np.inf]
    return [_trend(poses, constant, settling) for constant in constants]


def widened(
    found: TriadCalibration, lack: LackOfFit, poses: StaticPoses, calibrate: Calibrate
) -> TriadCalibration:
    """The calibration with what its model lacks in its covariance.

    Args:
        found: By these poses.
        lack: What was found to lack.
        poses: The rests, a trend taken out already.
        calibrate: The method.
    """
    fits = found.fits
    for own in lack.terms:
        trend = own.term.kind == "trend"
        size = own.sd if trend else np.hypot(own.size, own.sd)
        for axis in range(3):
            added = own.term.shape * size[axis] * np.eye(3)[axis]
            fits = with_shift(fits, found, poses, added, calibrate)
        if trend:  # in which of the states a later session finds the part, nobody knows
            fits = _with_constant(fits, found, own, poses, calibrate)
            spread = np.abs(own.size) * float(own.term.shape[:, 0].std())
            fits = tuple(with_bias(fit, spread) for fit in fits)
    return replace(found, fits=fits)


def _with_constant(
    fits: tuple[Fit, ...],
    found: TriadCalibration,
    own: FoundTerm,
    poses: StaticPoses,
    calibrate: Calibrate,
) -> tuple[Fit, ...]:
    """The fits with what is not known of a trend's time constant.

    The sum of squares about the best constant is a parabola of its logarithm, whose curvature is
    the inverse variance.
    """
    if np.isinf(own.term.time_constant) or not np.isfinite(own.constant_sd):
        return fits
    other = _trend(poses, own.term.time_constant * (1 + STEP_OF_CONSTANT), 1.0)
    slope = (other.shape - own.term.shape) / STEP_OF_CONSTANT * own.size
    return with_shift(fits, found, poses, slope * own.constant_sd, calibrate)


def with_shift(
    fits: tuple[Fit, ...],
    found: TriadCalibration,
    poses: StaticPoses,
    added: np.ndarray,
    calibrate: Calibrate,
) -> tuple[Fit, ...]:
    """The fits with what readings that are off by so much do to their parameters.

    Args:
        fits: To be widened.
        found: By these poses.
        poses: The rests.
        added: To the readings, shape (m, 3) [unit].
        calibrate: The method.
    """
    try:
        again = calibrate(replace(poses, mean=poses.mean - added))
    except PoorExcitation:
        return fits
    changes = [new.values - old.values for old, new in zip(found.fits, again.fits, strict=True)]
    return tuple(
        replace(fit, covariance=fit.covariance + np.outer(change, change))
        for fit, change in zip(fits, changes, strict=True)
    )


def with_bias(fit: Fit, sd: np.ndarray) -> Fit:
    """The fit with a bias that is off by so much.

    Args:
        fit: Of any triad.
        sd: Along each axis, shape (3,) [unit].
    """
    extra = np.zeros(len(fit.names))
    for axis, own in zip(AXES, sd, strict=True):
        for i, name in enumerate(fit.names):
            if name.removeprefix("gyr_") in (f"bias_{axis}", f"offset_{axis}"):
                extra[i] = own**2
    return replace(fit, covariance=fit.covariance + np.diag(extra))


def findings_of(lack: LackOfFit, triad: str) -> list[Finding]:
    """What is said of it.

    Args:
        lack: What was found to lack.
        triad: "accelerometer" or "magnetometer"; that is where it is said.
    """
    unit, factor = ("mg", 1e3 / 9.80665) if triad == "accelerometer" else ("uT", 1.0)
    said = []
    for own in lack.terms:
        size = own.size * factor
        if own.term.kind == "trend":
            said.append(
                finding(
                    "calibration.trend",
                    triad,
                    change=told_sizes(size, own.sd * factor),
                    unit=unit,
                    how=warming_words(own.term.time_constant),
                )
            )
        elif own.term.kind == "temperature":
            said.append(finding("calibration.temperature", triad))
        else:
            order = {"cubic": "third", "square": "second"}[own.term.kind]
            told = told_sizes(size, own.sd * factor)
            said.append(finding("calibration.nonlinear", triad, order=order, size=told, unit=unit))
    if lack.unexplained and triad == "magnetometer":
        said.append(finding("calibration.field", triad, ratio=lack.ratio))
    elif lack.unexplained:
        said.append(finding("calibration.residuals", triad, ratio=lack.ratio, dof=lack.left.dof))
    return said


def warming_words(constant: float) -> str:
    """How a trend goes, by its time constant [s]."""
    if np.isinf(constant):
        return "evenly"
    return f"as a part that warms up with a time constant near {constant:.0f} s"


def told_sizes(size: np.ndarray, sd: np.ndarray) -> str:
    """Three sizes with as many digits as their uncertainties allow.

    Args:
        size: Along each axis, shape (3,).
        sd: Standard uncertainties of these, shape (3,).
    """
    decimals = max(0, int(np.ceil(-np.log10(max(float(np.max(sd)), 1e-6)))))
    return ", ".join(
        f"{axis} {value:+.{decimals}f}" for axis, value in zip(AXES, size, strict=True)
    )
