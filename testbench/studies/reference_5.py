"""Quijano & Valencia (Universidad del Cauca, 2018), tables 4.1 to 4.4, on our bench: pendulum, squat and gait.

Pendulum and squat are run with several sensors of the same kind (seeds) and their errors pooled, for the bias that a sensor was
born with decides a single run; the gait is run once. Both states of the filter see the same samples. What differs from the
thesis: its rigs' dimensions, motions and references are not stated (ours are, in the protocols), its subject walked and ours is
a model of 20 joints that moves by published curves without skin and heel strike, it shows the trial of five that fitted best,
and its joint angles were judged by another measurement (Plug-in Gait), ours by the joints themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbench.clock import Clock
from testbench.pipeline import Result, run
from testbench.records.evaluation import ChainRow
from testbench.records.protocol import Protocol
from testbench.records.published_chain import GaitErrors, PublishedChain, load_published_chain

SERVO_PROTOCOLS = {"4.1": "pendulum", "4.2": "squat"}
GAIT_PROTOCOL = "gait"
AXES = {
    ("hip", "X"): "hip_r_adduction", ("hip", "Y"): "hip_r_rotation", ("hip", "Z"): "hip_r_flexion",
    ("knee", "Z"): "knee_r_flexion",
    ("ankle", "X"): "ankle_r_inversion", ("ankle", "Y"): "ankle_r_rotation", ("ankle", "Z"): "ankle_r_flexion",
}  # fmt: skip
"""The joint of robots/lower_limb that stands for an axis of the tables; the thesis has the right leg only."""


@dataclass(frozen=True)
class ServoComparison:
    """One joint of tables 4.1 and 4.2.

    Attributes:
        table, joint: Of the thesis. sessions: Where ours come from. ours: RMS of angle [deg], rate [deg/s] and acceleration
        [deg/s^2] by state, over all sessions. published: RMS of angle, rate and
        acceleration by state, as printed. fourier_gain_percent, published_gain_percent: By how much the Fourier state has less
        error than the kinematic one, of each of the three.
    """

    table: str
    joint: str
    sessions: list[str]
    ours: dict[str, list[float]]
    published: dict[str, list[float]]

    @property
    def fourier_gain_percent(self) -> list[float]:
        return _gain(self.ours["kinematic"], self.ours["fourier"])

    @property
    def published_gain_percent(self) -> list[float]:
        return _gain(self.published["kinematic"], self.published["fourier"])

    def ratio(self, state: str) -> list[float]:
        """Ours over theirs, of angle, rate and acceleration."""
        return [a / b for a, b in zip(self.ours[state], self.published[state], strict=True)]


@dataclass(frozen=True)
class GaitComparison:
    """One axis of tables 4.3 and 4.4: ours by state, theirs, and the magnitude of our signed mean over theirs."""

    published: GaitErrors
    session: str
    ours: dict[str, ChainRow]

    def ratio(self, state: str) -> float:
        """Ours over theirs, of the magnitude of the signed mean."""
        return abs(self.ours[state].mean_error_deg) / abs(self.published.mean_error_deg)


@dataclass(frozen=True)
class GaitTotals:
    """Totals over the seven axes by one state; degrees."""

    mean_of_means: float
    mean_magnitude_of_means: float
    mean_abs_error: float
    rmse: float


@dataclass(frozen=True)
class Reference5:
    """All tables.

    Attributes:
        published: What was printed. servo: Tables 4.1 and 4.2. gait: Tables 4.3 and 4.4. both_legs: Our rows of every joint of
        the gait, by state. sessions: Folders, by protocol.
    """

    published: PublishedChain
    servo: list[ServoComparison]
    gait: list[GaitComparison]
    both_legs: list[ChainRow]
    sessions: dict[str, list[Path]] = field(default_factory=dict)

    def totals(self, state: str) -> GaitTotals:
        """Over the seven axes of the right leg."""
        rows = [row.ours[state] for row in self.gait]
        means = [row.mean_error_deg for row in rows]
        return GaitTotals(
            float(np.mean(means)),
            float(np.mean(np.abs(means))),
            float(np.mean([row.mean_abs_error_deg for row in rows])),
            float(np.sqrt(np.mean([row.rmse_deg**2 for row in rows]))),
        )

    @property
    def distal_is_worse(self) -> dict[str, bool]:
        """By state: whether the second joint of the squat has at least the angle error of the first, as the thesis found."""
        first, second = [row for row in self.servo if row.table == "4.2"]
        return {state: second.ours[state][0] >= first.ours[state][0] for state in first.ours}


def reference_5(
    logs: str | Path = "logs",
    seeds: tuple[int, ...] = tuple(range(20)),
    protocols: dict[str, Protocol | str | Path] | None = None,
    with_report: bool = True,
    clock: Clock | None = None,
) -> Reference5:
    """Run pendulum, squat and gait and put our errors beside the published ones.

    Args:
        logs: Folder of the sessions. seeds: Of the simulated arms and sensors; the gait takes the first.
        protocols: Others in place of the shipped ones, by name. with_report: Whether each session gets its report.html.
        clock: The machine's if None.
    """
    published = load_published_chain()

    def sessions_of(name: str, which: tuple[int, ...]) -> list[Result]:
        protocol = (protocols or {}).get(name, name)
        return [run(protocol, seed=seed, logs=logs, with_report=with_report, clock=clock) for seed in which]

    results = {name: sessions_of(name, seeds) for name in SERVO_PROTOCOLS.values()}
    results[GAIT_PROTOCOL] = sessions_of(GAIT_PROTOCOL, seeds[:1])
    servo = []
    for table in published.servo_rms:
        rigs = results[SERVO_PROTOCOLS[table.table]]
        names = [rig.session.name for rig in rigs]
        joints = list(dict.fromkeys(row.joint for row in rigs[0].evaluation.chain))
        for i, joint in enumerate(joints):
            rows = [_by_state(rig, joint) for rig in rigs]
            ours = {str(state): _pooled([row[state] for row in rows]) for state in table.states}
            theirs = {str(state): numbers[i] for state, numbers in table.states.items()}
            servo.append(ServoComparison(table.table, table.joints[i], names, ours, theirs))
    (walked,) = results[GAIT_PROTOCOL]
    gait = [
        GaitComparison(row, walked.session.name, _by_state(walked, AXES[row.joint, row.axis])) for row in published.gait.rows
    ]
    legs = [row for row in walked.evaluation.chain if row.joint.startswith(("hip", "knee", "ankle"))]
    sessions = {name: [result.session.path for result in group] for name, group in results.items()}
    return Reference5(published, servo, gait, legs, sessions)


def _by_state(result: Result, joint: str) -> dict[str, ChainRow]:
    return {row.state: row for row in result.evaluation.chain if row.joint == joint}


def _pooled(rows: list[ChainRow]) -> list[float]:
    """RMS of angle, rate and acceleration over several sessions of equal length."""
    kinds = ("rmse_deg", "rate_rmse_deg_s", "acceleration_rmse_deg_s2")
    return [float(np.sqrt(np.mean([getattr(row, kind) ** 2 for row in rows]))) for kind in kinds]


def _gain(before: list[float], after: list[float]) -> list[float]:
    return [100 * (1 - a / b) for a, b in zip(after, before, strict=True)]
