"""Short sessions of a simulated arm with wrong joint zeros and links, and what their mean flexion
errors would be if those were known.

The estimators and the evaluation see the encoders. What the links really did is rebuilt here from
the seed, at the instants at which the samples were really taken, and nothing of it is written into
the session.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.evaluation.judged import window
from testbench.execution import RunOptions, execute
from testbench.execution.sensors import actual_kinematics
from testbench.model import rotation
from testbench.model.joint_angle import joint_angles, segment_orientation
from testbench.model.kinematics import Pose
from testbench.planning import plan
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.plan import Plan, judged_steps
from testbench.records.session.session import Session

FILTER = "vqf_6d"
PROTOCOL = """\
name: known_truth
purpose: Poses and a sweep of an arm whose joint zeros are off as its file says they may be
robot: ur3e
sensors:
  arm:
    preset: xsens_dot
    link: wrist_1_link
    segment: {name: upper_arm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 0, 0]}, position_mm: [0, 45, 0]}
  forearm:
    preset: xsens_dot
    link: wrist_3_link
    segment: {name: forearm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
joints:
  by_joint:
    proximal: arm
    distal: forearm
    sequence: ZXZ
    flexion: second
    reference_joint: wrist_3_joint
  by_frames: # several joints of the arm enter
    {proximal: arm, distal: forearm, sequence: YXZ, flexion: second, sign: -1}
  by_symmetric_frames:
    {proximal: arm, distal: forearm, sequence: ZXZ, flexion: second}
variables: {flexion_deg: [15, 30, 45, 60]}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
environment: {joint_errors: true, link_errors: true}
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: [180, -90, -90, 0, 90, 0], dwell_s: 2}]
  - name: static
    for_each: [flexion_deg]
    steps: [{move_to_deg: [195, -90, -90, 0, 75, flexion_deg], dwell_s: 0.6}]
  - name: sweep
    steps:
      - sweep: {wrist_3_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 2}}}
        dwell_s: 0.4
estimate: {filters: [vqf_6d], align: reference_pose, calibrate: none}
"""
PLACES = [
    (joint, section)
    for joint in ("by_joint", "by_frames", "by_symmetric_frames")
    for section in ("static", "sweep")
]


@dataclass(frozen=True)
class Case:
    """One reported mean flexion error, its combined and expanded uncertainty, and what it really is
    [deg].
    """

    seed: int
    joint: str
    section: str
    reported: float
    combined: float
    expanded: float
    true: float

    @property
    def covered(self) -> bool:
        return abs(self.reported - self.true) <= self.expanded


def cases(seeds: Iterable[int], wrong: bool = True) -> list[Case]:
    """Run a session for each seed, of an arm with wrong zeros and links or with right ones."""
    result = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "known_truth.yaml"
        text = PROTOCOL if wrong else PROTOCOL.replace("_errors: true", "_errors: false")
        file.write_text(text, encoding="utf-8")
        the_plan = plan(file)
        for seed in seeds:
            session = execute(the_plan, folder, seed, RunOptions(session_name=f"seed_{seed}"))
            result += judged_cases(the_plan, session, evaluate(session, estimate(session)), seed)
    return result


def judged_cases(the_plan: Plan, session: Session, evaluation: Evaluation, seed: int) -> list[Case]:
    """What was reported of each joint and section beside what is true."""
    result = []
    arm = as_it_moved(the_plan, seed)
    actual = {
        joint: actual_flexion(the_plan, session, joint, arm, seed)
        for joint in session.analysis.joints
    }
    for joint, section in PLACES:
        summary = next(
            s for s in evaluation.joint_summary if (s.joint, s.section) == (joint, section)
        )
        definition = session.analysis.joints[joint]
        series = evaluation.series[f"joint_{joint}"]
        time, estimated = (
            series["host_time_ns"],
            series[f"{FILTER}_{definition.sequence}_flexion_rad"],
        )
        means, again = [], []
        for step in judged_steps(session.steps):
            begin, end = window(step)
            rows = series["judged"] & (time >= begin) & (time <= end)
            if step.section == section:
                means.append(
                    np.degrees(rotation.wrap(estimated[rows] - actual[joint][rows])).mean()
                )
                again.append(
                    np.degrees(
                        rotation.wrap(estimated[rows] - series["reference_rad"][rows])
                    ).mean()
                )
        reported = summary.errors.mean_error_deg
        assert abs(np.mean(again) - reported) < 1e-9  # the same samples count here and there
        budget = next(b for b in evaluation.uncertainty if (b.owner, b.section) == (joint, section))
        assert budget.combined_deg is not None and budget.expanded_deg is not None
        result.append(
            Case(
                seed,
                joint,
                section,
                reported,
                budget.combined_deg,
                budget.expanded_deg,
                float(np.mean(means)),
            )
        )
    return result


def as_it_moved(the_plan: Plan, seed: int) -> SimulatedArm:
    """The arm of a session after its whole motion, made again from the seed."""
    arm = SimulatedArm(the_plan.robot, seed, the_plan.protocol.spec.environment.joint_errors)
    arm.prepare(the_plan)
    arm.kickoff()
    arm.read(end_ns(the_plan))
    return arm


def end_ns(the_plan: Plan) -> int:
    return int(the_plan.trajectory.time_ns[-1]) + SimulatedArm.tail_ns


def actual_flexion(
    the_plan: Plan, session: Session, joint: str, arm: SimulatedArm, seed: int
) -> np.ndarray:
    """What the links really did at the samples of the proximal sensor [rad], shape (n,)."""
    spec, definition = the_plan.protocol.spec, session.analysis.joints[joint]
    kinematics = actual_kinematics(the_plan, seed)
    imu = SimulatedImu(
        definition.proximal,
        spec.sensors[definition.proximal],
        kinematics,
        spec.environment,
        arm.true_state,
        seed,
    )
    taken, _, counter = imu._sampling(end_ns(the_plan))
    q, _, _ = arm.true_state(
        taken[np.searchsorted(counter, session.imu(definition.proximal).counter)]
    )
    if definition.reference_joint is not None:
        return q[:, the_plan.robot.joint_names.index(definition.reference_joint)]
    segments = []
    for name in (definition.proximal, definition.distal):
        sensor = spec.sensors[name]
        motion = kinematics.frame_motion(
            sensor.link, q, offset=Pose.from_placement(sensor.mounting)
        )
        segments.append(segment_orientation(motion.q_world_from_frame, sensor))
    return definition.sign * joint_angles(segments[0], segments[1], definition.sequence)[:, 1]


def of_one_session(folder: str | Path, stated: bool = True) -> tuple[Session, Evaluation]:
    """One session of the protocol, and its evaluation.

    Args:
        folder: To write it into.
        stated: Whether the manifest states the delays of the gyroscopes.
    """
    file = Path(folder) / "known_truth.yaml"
    file.write_text(PROTOCOL, encoding="utf-8")
    session = execute(plan(file), folder, 0, RunOptions(session_name=f"stated_{stated}"))
    if not stated:
        sensors = {
            name: own.model_copy(update={"rate_delay_s": None, "sampling": None})
            for name, own in session.manifest.sensors.items()
        }
        session = Session(session.path)
        unstated = session.manifest.model_copy(update={"sensors": sensors})
        session.__dict__["manifest"] = unstated
    return session, evaluate(session, estimate(session))
