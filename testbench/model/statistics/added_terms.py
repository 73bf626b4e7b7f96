"""Terms that a fit did not have: whether its residuals ask for them, and how large they are.

A fit of known scatter leaves residuals r with derivatives J by its parameters. Columns C of further
terms are fitted beside J in one step. Where the terms are not there, the sum of squares falls by
what is chi-square distributed, with as many degrees of freedom as there are terms (Rao's score
test, Proc. Cambridge Phil. Soc. 44, 1948; of a linear model it is the F test of added terms with
known variance, Draper & Smith, Applied Regression Analysis, 1998, section 6.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from testbench.records.results.evidence import Evidence

LEAST_SEEN = 1e-3
"""Share of a term's columns that the fit's own parameters cannot imitate; below it they are one."""


@dataclass(frozen=True)
class AddedTerms:
    """Terms that were fitted beside the parameters of a fit.

    Attributes:
        values: Shape (q,).
        covariance: Shape (q, q).
        chance: How often noise alone asks for terms as large.
        left: What the fit leaves with them.
    """

    values: np.ndarray
    covariance: np.ndarray
    chance: float
    left: Evidence


def chance_of(evidence: Evidence) -> float:
    """How often noise alone leaves as much as a fit does; 1 where no degree of freedom is left."""
    return float(chdtrc(evidence.dof, evidence.squares)) if evidence.dof > 0 else 1.0


def with_terms(evidence: Evidence, terms: np.ndarray, allowance: float = 0.0) -> AddedTerms | None:
    """Terms, fitted beside the parameters that there are.

    Args:
        evidence: What the fit without them leaves.
        terms: What each of q terms adds to the readings, shape (m, 3, q) [unit].
        allowance: How large each may be without being an error of the model, a standard deviation.

    Returns:
        None where the poses do not tell them from the parameters, or too few are left.
    """
    columns = evidence.columns(terms)
    size = np.linalg.norm(columns, axis=0)
    if evidence.dof < columns.shape[1] or not (size > 0).all():
        return None
    basis = np.linalg.svd(evidence.jacobian, full_matrices=False)[0]
    free = columns - basis @ (basis.T @ columns)
    if np.linalg.svd(free / size, compute_uv=False)[-1] < LEAST_SEEN:
        return None
    covariance = np.linalg.inv(free.T @ free)
    values = -covariance @ (free.T @ evidence.residuals)
    tolerated = covariance + allowance**2 * np.eye(len(values))
    squares = float(values @ np.linalg.solve(tolerated, values))
    left = Evidence(
        evidence.residuals + free @ values,
        np.hstack([evidence.jacobian, columns]),
        evidence.reach,
    )
    return AddedTerms(values, covariance, float(chdtrc(len(values), squares)), left)
