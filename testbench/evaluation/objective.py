"""One number for one filter on one session, as `evaluate` states it, again and again: what a tuning
makes small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from testbench.evaluation.flexion import JointErrors, flexion_error, joint_errors, whole_recording
from testbench.evaluation.judged import sound_truth
from testbench.evaluation.metrics import orientation_errors, rms
from testbench.evaluation.orientation import SensorErrors, sensor_errors
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.records.results.estimate import Estimate, JointEstimate
from testbench.records.session.plan import judged_steps
from testbench.records.session.session import Session

UNIT = "deg"
OF_SENSORS = {
    "total_rmse_deg": "total",
    "heading_rmse_deg": "heading",
    "inclination_rmse_deg": "inclination",
}
"""Metrics of an orientation, and the part of its error."""
OF_COMPARISONS = {
    "total_difference_rms_deg": "total",
    "heading_difference_rms_deg": "heading",
    "inclination_difference_rms_deg": "inclination",
}
"""Metrics of a comparison with an orientation that is no truth, and the part of the difference."""
OF_JOINTS: dict[str, Callable[[list[np.ndarray]], float]] = {
    "flexion_rmse_deg": lambda steps: float(
        np.sqrt(np.mean([np.mean(np.square(step)) for step in steps]))
    ),
    "flexion_mean_abs_error_deg": lambda steps: float(
        np.mean([np.abs(step).mean() for step in steps])
    ),
}
"""Metrics of a joint, from its errors in each pose or sweep, which count alike."""


@dataclass(frozen=True)
class Objective:
    """What to make small.

    Attributes:
        kind: The metric, with its unit.
        owner: Sensor or joint; the mean over all of a session if None.
    """

    kind: str
    owner: str | None = None

    @staticmethod
    def parse(text: str | None, comparison: bool = False) -> Objective:
        """From `total_rmse_deg`, `forearm.total_rmse_deg`, `elbow.flexion_rmse_deg` and the like.

        Args:
            text: As a person wrote it; the whole rotation of the sensors if None.
            comparison: Whether nobody judges, and the metric is one of a difference.

        Raises:
            NotFoundError: No such metric; lists those that exist.
        """
        known = [*OF_COMPARISONS] if comparison else [*OF_SENSORS, *OF_JOINTS]
        owner, _, kind = (text or known[0]).rpartition(".")
        if kind not in known:
            raise NotFoundError(
                "objective of a comparison" if comparison else "objective", text or "", known
            )
        return Objective(kind, owner or None)

    @property
    def of_comparison(self) -> str:
        """The part of a difference that it is of."""
        return OF_COMPARISONS[self.kind]

    def __str__(self) -> str:
        return self.kind if self.owner is None else f"{self.owner}.{self.kind}"

    def joints(self, session: Session) -> list[str] | None:
        """The joints of a session that it looks at; None where it looks at sensors.

        Raises:
            InputError: The session has no such joint or sensor.
        """
        of_joints = self.kind in OF_JOINTS
        known = list(session.analysis.joints) if of_joints else session.sensor_names
        if self.owner is not None and self.owner not in known:
            raise NotFoundError(
                f"{'joint' if of_joints else 'sensor'} of {session.name}", self.owner, known
            )
        if not known:
            raise InputError(
                f"{session.name} defines no joint, so that {self.kind} says nothing of it"
            )
        return ([self.owner] if self.owner else known) if of_joints else None


def knows_angles(session: Session, names: Iterable[str]) -> bool:
    """Whether another system told true angles of some joints.

    Args:
        session: The recording.
        names: Of the joints.
    """
    return any(name in session.manifest.true_angles for name in names)


def _of_angles(session: Session, objective: Objective) -> str:
    """What to ask for of a session whose truth is angles of joints, of whose sensors was asked."""
    if objective.kind in OF_JOINTS or not knows_angles(session, session.analysis.joints):
        return ""
    return (
        "; its truth is angles of joints, by which --objective flexion_rmse_deg (or JOINT."
        "flexion_rmse_deg) judges"
    )


class SessionJudge:
    """The objective of a session.

    What does not depend on the filter - the truth at the sensors' instants, what counts - is
    computed once.

    Args:
        session: The recording.
        objective: What to compute.
        estimate: Of the session, its instants and rests: by no filter yet, but where the truth is
            angles of joints by another system, whose clock takes one.

    Raises:
        NotFoundError: The session has no such sensor or joint.
        SessionError: Nothing is judged there, or no truth known.
    """

    def __init__(self, session: Session, objective: Objective, estimate: Estimate):
        self._objective = objective
        self._sensors: list[SensorErrors] = []
        self._joints: list[JointErrors] = []
        steps = judged_steps(session.steps) if session.has_protocol else None
        joints = objective.joints(session)
        if joints is not None:
            for name in joints:
                time = estimate.sensors[session.analysis.joints[name].proximal].host_time_ns
                # of true angles by another system a filter has found the clock
                own = estimate.joints.get(name) or JointEstimate(time, {})
                blank = Estimate(session.name, session.fingerprint, estimate.sensors, {name: own})
                judged = whole_recording(estimate) if steps is None else steps
                errors = joint_errors(session, name, blank, judged)
                if errors is not None and errors.steps:
                    self._joints.append(errors)
        else:
            for name in [objective.owner] if objective.owner else list(estimate.sensors):
                truth, _ = sound_truth(session, name)
                found = (
                    None
                    if truth is None or estimate.sensors[name].unaligned
                    else sensor_errors(name, estimate.sensors[name], truth, steps)
                )
                if found is not None and found.judged.any():
                    self._sensors.append(found)
        if not self._sensors and not self._joints:
            raise SessionError(
                f"{session.path}: no sample counts for {objective}: nothing is evaluated, or the "
                f"truth is not known{_of_angles(session, objective)}"
            )

    def value(self, estimate: Estimate, filter_name: str) -> float:
        """The objective by one filter; infinite where an angle that counts is no number, or a joint
        of a body is not computed by it.

        Args:
            estimate: Of the same session, with this filter.
            filter_name: Which one.

        Raises:
            InputError: The filter could not run.
        """
        for name in {found.name for found in self._sensors} | {
            sensor
            for found in self._joints
            for sensor in (found.joint.proximal, found.joint.distal)
        }:
            if filter_name not in estimate.sensors[name].orientation:
                why = estimate.sensors[name].skipped.get(filter_name, "it was not run")
                raise InputError(
                    f"{estimate.session}: {filter_name} gives no orientation of {name}: {why}"
                )
        values = [
            self._of_sensor(found, estimate.sensors[found.name].orientation[filter_name])
            for found in self._sensors
        ]
        for found in self._joints:
            angles = estimate.joints[found.name].angles.get((filter_name, found.joint.label))
            if angles is None:  # by such orientations nobody stands, or faces anywhere
                return float("inf")
            values += self._of_joint(found, angles)
        mean = float(np.mean(values))
        return mean if np.isfinite(mean) else float("inf")

    def _of_sensor(self, found: SensorErrors, q: np.ndarray) -> float:
        errors = orientation_errors(q[found.judged], found.q_true[found.judged])
        return rms(np.degrees(getattr(errors, OF_SENSORS[self._objective.kind])))

    def _of_joint(self, found: JointErrors, angles: np.ndarray) -> list[float]:
        """One value for each judged section."""
        label = found.joint.label
        own, true = found.definition(label), found.true_angles[label]
        _, error = flexion_error(own, angles, found.reference, true)
        degrees = np.degrees(error)
        pool = OF_JOINTS[self._objective.kind]
        return [pool([degrees[rows] for _, rows in judged]) for judged in found.sections().values()]
