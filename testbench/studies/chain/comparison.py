"""Quijano & Valencia (Universidad del Cauca, 2018), tables 4.1 to 4.4, on our bench: pendulum,
squat and gait.

Each protocol is run with several sensors of the same kind (seeds), for the bias that is drawn for a
sensor decides a single run, and differences are judged by their spread over these parts; the two
small rigs, whose errors are compared joint by joint, with `RIGS_A_PART` times as many. Both states
of the filter see the same samples. What differs from the thesis: its rigs' dimensions, motions and
references are not stated (ours are, in the protocols), its subject walked and ours is a model of 20
joints that moves by published curves without skin and heel strike, it shows the trial of five that
fitted best, and its joint angles were judged by another measurement (Plug-in Gait), ours by the
joints themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbench.model.statistics.spread import Change
from testbench.pipeline.run import prepare
from testbench.records.results.evaluation import ChainRow
from testbench.records.specs.published_chain import GaitErrors, PublishedChain, load_published_chain
from testbench.studies.bench import StudyBench

SERVO_PROTOCOLS = {"4.1": "pendulum", "4.2": "squat"}
GAIT_PROTOCOL = "gait"
AXES = {
    ("hip", "X"): "hip_r_adduction",
    ("hip", "Y"): "hip_r_rotation",
    ("hip", "Z"): "hip_r_flexion",
    ("knee", "Z"): "knee_r_flexion",
    ("ankle", "X"): "ankle_r_inversion",
    ("ankle", "Y"): "ankle_r_rotation",
    ("ankle", "Z"): "ankle_r_flexion",
}
"""The joint of robots/lower_limb that stands for an axis of the tables; the thesis has the right
leg only.
"""
QUANTITIES = ("angle", "rate", "acceleration")
KINDS = ("rmse_deg", "rate_rmse_deg_s", "acceleration_rmse_deg_s2")
KINEMATIC, FOURIER = "kinematic", "fourier"
RIGS_A_PART = 20
"""Runs of pendulum and squat for each of the walk: the ratio of two angles' errors scatters by a
factor of two from run to run, so that five runs tell nothing of it and a hundred tell a fifth more.
"""


@dataclass(frozen=True)
class JointErrors:
    """Errors of one joint by one state in one protocol, a row for each part."""

    rows: list[ChainRow]

    def values(self, kind: str) -> list[float]:
        """One figure of every part."""
        return [float(getattr(row, kind)) for row in self.rows]

    def rms(self, kind: str) -> float:
        """Root of the mean square over the parts, whose sessions are equally long."""
        return float(np.sqrt(np.mean(np.square(self.values(kind)))))

    def mean(self, kind: str) -> float:
        """Over the parts."""
        return float(np.mean(self.values(kind)))


@dataclass(frozen=True)
class ServoComparison:
    """One joint of tables 4.1 and 4.2.

    Attributes:
        table: Number of the table in the thesis.
        joint: What the thesis calls the joint.
        ours: By state.
        published: RMS of angle, rate and acceleration by state, as printed.
    """

    table: str
    joint: str
    ours: dict[str, JointErrors]
    published: dict[str, list[float]]

    def pooled(self, state: str) -> list[float]:
        """RMS of angle [deg], rate [deg/s] and acceleration [deg/s^2] over all parts."""
        return [self.ours[state].rms(kind) for kind in KINDS]

    def fourier_change(self) -> dict[str, Change]:
        """Error by the Fourier state against that by the kinematic one, of each quantity."""
        return _changes(self.ours[FOURIER], self.ours[KINEMATIC])


@dataclass(frozen=True)
class GaitComparison:
    """One axis of tables 4.3 and 4.4: ours by state, and theirs."""

    published: GaitErrors
    ours: dict[str, JointErrors]


@dataclass(frozen=True)
class Reference5:
    """All tables.

    Attributes:
        published: What was printed.
        servo: Tables 4.1 and 4.2.
        gait: Tables 4.3 and 4.4.
        walk: Every joint of the gait by state, those of tables 4.3 and 4.4 among them.
        sessions: Folders, by protocol, in the order of their seeds.
    """

    published: PublishedChain
    servo: list[ServoComparison]
    gait: list[GaitComparison]
    walk: dict[tuple[str, str], JointErrors]
    sessions: dict[str, list[Path]] = field(default_factory=dict)

    @property
    def parts(self) -> int:
        """Runs of the walk."""
        return len(self.sessions[GAIT_PROTOCOL])

    @property
    def rigs(self) -> int:
        """Runs of either rig."""
        return len(self.sessions["squat"])

    def mean_magnitude_of_means(self, state: str) -> list[float]:
        """Mean over the seven axes of the magnitudes of their signed means [deg], by part."""
        return np.mean(
            [np.abs(row.ours[state].values("mean_error_deg")) for row in self.gait], axis=0
        ).tolist()

    def walking_rms(self, state: str) -> list[float]:
        """RMS over the seven axes [deg], by part."""
        return np.sqrt(
            np.mean([np.square(row.ours[state].values("rmse_deg")) for row in self.gait], axis=0)
        ).tolist()

    def distal_change(self, state: str) -> dict[str, Change]:
        """Error of the second joint of the squat against that of the first, of each quantity.

        Above zero in the thesis.
        """
        first, second = [row for row in self.servo if row.table == "4.2"]
        return _changes(second.ours[state], first.ours[state])


def reference_5(
    bench: StudyBench,
    protocols: dict[str, str | Path] | None = None,
    with_report: bool = True,
    rigs_a_part: int = RIGS_A_PART,
) -> Reference5:
    """Run pendulum, squat and gait and put our errors beside the published ones.

    Args:
        bench: Where the sessions are made; each part has a simulated arm and sensors of its own.
        protocols: Others in place of the shipped ones, by name.
        with_report: Whether the first sessions of each protocol, as many as there are parts, get
            their report.html.
        rigs_a_part: Runs of pendulum and squat for each part; part s takes the seeds from s times
            that on.
    """
    published = load_published_chain()
    found: dict[str, dict[tuple[str, str], JointErrors]] = {}
    sessions: dict[str, list[Path]] = {}
    for name in (*SERVO_PROTOCOLS.values(), GAIT_PROTOCOL):
        rows, sessions[name] = [], []
        each = 1 if name == GAIT_PROTOCOL else rigs_a_part
        protocol = (protocols or {}).get(name, name)
        prepared = prepare(bench.request(protocol, bench.seed))
        for i, seed in enumerate(each * part + k for part in bench.seeds for k in range(each)):
            if each == 1 or i % each == 0:
                last = f" to {seed + each - 1}" if each > 1 else ""
                bench.say(f"running {name}, seed {seed}{last}")
            asked = bench.request(protocol, seed, report=with_report and i < bench.parts)
            result = bench.run_part(asked, prepared)
            rows.extend(result.evaluation.chain)
            sessions[name].append(result.session.path)
        found[name] = _by_joint_and_state(rows)
    servo = []
    for table in published.servo_rms:
        errors = found[SERVO_PROTOCOLS[table.table]]
        for i, joint in enumerate(dict.fromkeys(joint for joint, _ in errors)):
            ours = {str(state): errors[joint, str(state)] for state in table.states}
            theirs = {str(state): numbers[i] for state, numbers in table.states.items()}
            servo.append(ServoComparison(table.table, table.joints[i], ours, theirs))
    walk = found[GAIT_PROTOCOL]
    states = list(dict.fromkeys(state for _, state in walk))
    gait = [
        GaitComparison(row, {state: walk[AXES[row.joint, row.axis], state] for state in states})
        for row in published.gait.rows
    ]
    return Reference5(published, servo, gait, walk, sessions)


def _by_joint_and_state(rows: list[ChainRow]) -> dict[tuple[str, str], JointErrors]:
    found: dict[tuple[str, str], list[ChainRow]] = {}
    for row in rows:
        found.setdefault((row.joint, row.state), []).append(row)
    return {key: JointErrors(rows) for key, rows in found.items()}


def _changes(first: JointErrors, second: JointErrors) -> dict[str, Change]:
    return {
        quantity: Change.of(first.values(kind), second.values(kind))
        for quantity, kind in zip(QUANTITIES, KINDS, strict=True)
    }
