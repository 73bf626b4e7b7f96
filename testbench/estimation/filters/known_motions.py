"""Ideal sensors in motions whose orientation is known, and how far off a filter is in them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from testbench.estimation.filters.base import UniformSamples
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation

RATE_HZ = 100.0
REST_S, TURN_S = 6.0, 2.0
"""Time to settle before a turn, and time of the turn [s]."""
TURN_RAD_S = np.radians(40.0)
FIELD_UT = np.array([0.0, 24.0, -39.0])
"""North along y, about that of northern Spain (IGRF-13) [uT]."""

Run = Callable[[UniformSamples], np.ndarray]


@dataclass(frozen=True)
class Recording:
    """What an ideal sensor gives in a known motion.

    Attributes:
        name: For people. samples: What it gives. q_true: q_earth_from_sensor, shape (n, 4). begin: First sample of the turn,
        or None at rest.
    """

    name: str
    samples: UniformSamples
    q_true: np.ndarray
    begin: int | None


@dataclass(frozen=True)
class Check:
    """One check: the worst of its recordings against its limit, both in degrees; the error is None where there is none."""

    name: str
    worst_deg: float | None
    limit_deg: float
    where: str

    @property
    def passed(self) -> bool:
        return self.worst_deg is not None and self.worst_deg <= self.limit_deg


def axis_aligned() -> list[np.ndarray]:
    """The 24 rotations that lay the sensor's axes along those of the earth, shape (3, 3)."""
    signed = [
        np.array([[sign if axis == column else 0.0 for column in range(3)] for axis, sign in zip(order, signs, strict=True)])
        for order in itertools.permutations(range(3))
        for signs in itertools.product([1.0, -1.0], repeat=3)
    ]
    return [matrix for matrix in signed if np.linalg.det(matrix) > 0]


def recording(name: str, start: np.ndarray, axis: np.ndarray | None = None) -> Recording:
    """Rest, and then a turn about an axis of the sensor if one is given; rates are means over the interval before."""
    rest = round(REST_S * RATE_HZ)
    turn = 0 if axis is None else round(TURN_S * RATE_HZ)
    angle = TURN_RAD_S * np.clip(np.arange(rest + turn) - rest + 1, 0, None) / RATE_HZ
    along = np.zeros(3) if axis is None else axis
    q = rotation.multiply(start, rotation.from_rotation_vector(angle[:, None] * along))
    gyr = np.where(angle[:, None] > 0, TURN_RAD_S * along, 0.0)
    back = rotation.conjugate(q)
    acc = rotation.rotate(back, np.array([0.0, 0.0, STANDARD_GRAVITY]))
    samples = UniformSamples(1 / RATE_HZ, gyr, acc, rotation.rotate(back, FIELD_UT))
    return Recording(name, samples, q, rest - 1 if turn else None)


def pose(*angles_deg: float) -> np.ndarray:
    """q_earth_from_sensor of intrinsic ZYX angles."""
    return rotation.from_euler("ZYX", np.radians(angles_deg))


def recordings() -> dict[str, list[Recording]]:
    """Those of each check."""
    rests = [recording(f"axes {matrix.astype(int).tolist()}", rotation.from_matrix(matrix)) for matrix in axis_aligned()]
    poses = [(70, 20, 35), (-130, -50, 160), (15, 75, -100), (200, -10, -170), (-60, 40, 95), (110, -80, 10)]
    anywhere = [recording(f"ZYX {angles} deg", pose(*angles)) for angles in poses]
    headings = [recording(f"heading {angle} deg", pose(angle, 0, 0)) for angle in (0, 30, 90, 180, 210, 315)]
    groups = {"rest in 24 poses": rests, "start in any pose": anywhere, "known heading": headings}
    for name, index in (("x", 0), ("y", 1), ("z", 2)):
        for sign in (1.0, -1.0):
            turns = [
                recording(f"from ZYX {angles} deg", pose(*angles), sign * np.eye(3)[index])
                for angles in ((0, 0, 0), (60, -35, 25), (-100, 20, -140))
            ]
            groups[f"turn about {'+' if sign > 0 else '-'}{name}"] = turns
    return groups


LIMIT_DEG = {"rest in 24 poses": 1.0, "start in any pose": 2.0, "known heading": 2.0}
TURN_LIMIT_DEG = 2.0
"""Right filters stay below half of these; the smallest of the faults that are looked for is far above."""


def error_deg(case: Recording, q: np.ndarray, needs: tuple[str, ...]) -> float:
    """Largest error of what a filter with these inputs can know: total, inclination, or the turn since the rest [deg]."""
    errors = []
    off = rotation.multiply(q[-1], rotation.conjugate(case.q_true[-1]))
    if "acc" in needs:
        errors.append(rotation.angle(off) if "mag" in needs else rotation.inclination_angle(off))
    if case.begin is not None and ("gyr" in needs or "mag" in needs):
        turned = rotation.multiply(rotation.conjugate(q[case.begin]), q[-1])
        expected = rotation.multiply(rotation.conjugate(case.q_true[case.begin]), case.q_true[-1])
        errors.append(rotation.angle(rotation.multiply(turned, rotation.conjugate(expected))))
    elif case.begin is None and "acc" not in needs:
        errors.append(rotation.angle(rotation.multiply(rotation.conjugate(q[0]), q[-1])))
    return float(np.degrees(np.max(errors))) if errors else 0.0


def judge(run: Run, needs: tuple[str, ...], groups: dict[str, list[Recording]]) -> list[Check]:
    """Every check of a filter that gives well-formed quaternions."""
    checks = []
    for name, cases in groups.items():
        if name == "known heading" and not ("mag" in needs and "acc" in needs):
            continue
        errors = [(error_deg(case, run(case.samples), needs), case.name) for case in cases]
        worst, where = max(errors, key=lambda entry: (np.isnan(entry[0]), entry[0]))
        checks.append(Check(name, worst, LIMIT_DEG.get(name, TURN_LIMIT_DEG), where))
    return checks
