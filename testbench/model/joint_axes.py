"""The axes that a joint turns about, in the world: what they tell of its segments' heading."""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.records.specs.joint_definition import JointConstraint


def axes_in_world(
    q_world_from_proximal: np.ndarray, q_world_from_distal: np.ndarray, constraint: JointConstraint
) -> tuple[np.ndarray, np.ndarray]:
    """Both axes of a joint as unit vectors in the world.

    Args:
        q_world_from_proximal: Of the proximal segment, shape (n, 4).
        q_world_from_distal: Of the distal segment, shape (n, 4).
        constraint: The axes in their segments.

    Returns:
        That of the proximal and that of the distal segment, each of shape (n, 3).
    """
    return (
        rotation.rotate(q_world_from_proximal, np.array(constraint.proximal_axis, float)),
        rotation.rotate(q_world_from_distal, np.array(constraint.distal_axis, float)),
    )


def heading_terms(
    proximal: np.ndarray, distal: np.ndarray, constraint: JointConstraint
) -> np.ndarray:
    """The constraint as a cos d + b sin d + c = 0 in the heading d.

    The heading turns the distal sensor's world into the proximal's. Two axes: their cosine less
    that of their angle (Laidig, Lehmann, Begin & Seel, EMBC 2019, eq. 4). One: the sine between its
    horizontal parts as both sensors see it, times the root of both lengths, for a direction near
    the vertical has an uncertain heading (Laidig, Schauer & Seel, ICORR 2017).

    Args:
        proximal: Axis of the proximal segment in its sensor's world, shape (n, 3).
        distal: Axis of the distal segment in its sensor's world, shape (n, 3).
        constraint: One axis that both segments share, or two and the angle between them.

    Returns:
        a, b, c, shape (n, 3), scaled so that an axis that is wrong by e [rad] leaves about e.
    """
    along = proximal[:, 0] * distal[:, 0] + proximal[:, 1] * distal[:, 1]
    across = proximal[:, 1] * distal[:, 0] - proximal[:, 0] * distal[:, 1]
    if constraint.angle_deg == 0:
        length = np.sqrt(np.maximum(np.hypot(along, across), 1e-12))
        return np.column_stack([across / length, -along / length, np.zeros(len(along))])
    angle = np.radians(constraint.angle_deg)
    return np.column_stack([along, across, proximal[:, 2] * distal[:, 2] - np.cos(angle)]) / np.sin(
        angle
    )


def heading_slope(terms: np.ndarray, heading: float | np.ndarray = 0.0) -> np.ndarray:
    """Slope of each instant's constraint in the heading.

    Args:
        terms: Of `heading_terms`, shape (n, 3).
        heading: One for all instants, or shape (n,) [rad].

    Returns:
        Shape (n,): about 1 where the constraint tells the heading best, and 0 where not at all.
    """
    return np.asarray(terms[:, 1] * np.cos(heading) - terms[:, 0] * np.sin(heading))
