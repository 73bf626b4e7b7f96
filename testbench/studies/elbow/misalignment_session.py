"""A session that varies the misalignment, beside theory and simulation: how much of a filter's
error no sensor made.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.joint_angle import flexion_of, joint_angles, segment_orientation
from testbench.model.misalignment import middle_angle_error
from testbench.model.truth import truth_at
from testbench.records.results.evaluation import Evaluation, JointRow
from testbench.records.results.study import StudyCurve, StudyCurves, StudyRow, StudyTable
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition

MEASURED = "measured"
"""What the keys of tables of a session end in."""


def session_curves(
    session: Session,
    evaluation: Evaluation,
    joint: str,
    flexions_deg: Sequence[float] | None = None,
) -> list[StudyCurves]:
    """Theory, simulation and measurement over the misalignment, one figure for each definition of a
    joint.

    Theory is the closed form for the middle angle of a sequence; simulation the joint-angle code on
    the segments' true orientations in each pose, without any sensor; measurement what each filter
    gave.

    Args:
        session: The recording.
        evaluation: Of the session.
        joint: Of the protocol.
        flexions_deg: Those to show; three of those that the session commanded, the largest among
            them, if None.

    Raises:
        InputError: The protocol commands no misalignment and flexion for this joint.
    """
    rows = _posed_rows(evaluation, joint)
    flexions = sorted({row.flexion_deg for row in rows if row.flexion_deg is not None})
    spread = {flexions[len(flexions) // 3], flexions[2 * len(flexions) // 3], flexions[-1]}
    chosen = [f for f in flexions if f in (spread if flexions_deg is None else flexions_deg)]
    figures = []
    for definition in session.analysis.joints[joint].definitions():
        curves = []
        own = [row for row in rows if row.sequence == definition.label]
        for flexion in chosen:
            here, group = [row for row in own if row.flexion_deg == flexion], f"{flexion:g} deg"
            misalignments = np.array(sorted({float(row.misalignment_deg or 0.0) for row in here}))
            theory = theoretical_error(definition, flexion, misalignments)
            if theory is not None:
                curves.append(
                    StudyCurve(f"theory, {group}", misalignments, theory, "theory", group)
                )
            for name in dict.fromkeys(row.filter for row in here):
                mine = [row for row in here if row.filter == name]
                if name == here[0].filter:  # the poses are the same for all
                    simulated = simulated_errors(session, joint, definition, mine)
                    points = _by_misalignment(mine, simulated)
                    curves.append(StudyCurve(f"simulation, {group}", *points, "simulation", group))
                measured = np.array([row.flexion_mean_abs_error_deg for row in mine])
                curves.append(
                    StudyCurve(
                        f"{name}, {group}", *_by_misalignment(mine, measured), "measurement", group
                    )
                )
        figures.append(
            StudyCurves(
                f"{joint}: |error| of the {definition.label} flexion over the misalignment",
                "misalignment [deg]",
                "|error| [deg]",
                tuple(curves),
                "How to read: theory is the closed form, simulation the true poses of the arm "
                "through the same code, the rest what the filters gave. Where these lie on the "
                "theory, the error is the definition's and no sensor's.",
            )
        )
    return figures


def session_table(session: Session, evaluation: Evaluation, joint: str) -> StudyTable:
    """How much of each filter's error the definition itself makes.

    Raises:
        InputError: The protocol commands no misalignment and flexion for this joint.
    """
    rows = _posed_rows(evaluation, joint)
    body = []
    for definition in session.analysis.joints[joint].definitions():
        for name in dict.fromkeys(row.filter for row in rows):
            own = [row for row in rows if (row.filter, row.sequence) == (name, definition.label)]
            if not own:
                continue
            simulated = simulated_errors(session, joint, definition, own)
            measured = np.array([row.flexion_mean_abs_error_deg for row in own])
            values = (len(own), *_mean_and_largest(simulated), *_mean_and_largest(measured))
            body.append(StudyRow(f"{definition.label}, {name}", values))
    return StudyTable(
        f"{joint} {MEASURED}",
        f"Session {session.name}, {joint}: error of the definition beside that of the filters",
        (
            "poses",
            "definition: mean |error| [deg]",
            "definition: largest [deg]",
            "measured: mean |error| [deg]",
            "measured: largest [deg]",
        ),
        tuple(body),
        "How to read: the definition's error is that of the true poses; what a filter adds or "
        "takes is the sensors'.",
        "A sequence that sees the heading also sees what a filter loses of it: where the sensors "
        "drift apart in heading, this adds to the misalignment on one side and takes from it on "
        "the other, most of all by a filter without magnetometer.",
        decimals=(0, 3, 3, 3, 3),
    )


def _mean_and_largest(values: np.ndarray) -> tuple[float | None, float | None]:
    known = values[np.isfinite(values)]
    return (float(known.mean()), float(known.max())) if len(known) else (None, None)


def theoretical_error(
    definition: FlexionAngle, flexion_deg: float, misalignment_deg: np.ndarray
) -> np.ndarray | None:
    """|error| by the closed form.

    The middle angle of three different axes is off by asin(sin f cos d) - f; that of a sequence
    with equal outer axes sees nothing of a turn about them.

    Args:
        definition: Of the flexion.
        flexion_deg: f [deg].
        misalignment_deg: d, shape (d,) [deg].

    Returns:
        Shape (d,) [deg]; None for definitions that it does not cover.
    """
    kind = definition.rotation
    in_world = definition.seen_from == "world"
    if isinstance(kind, str) or kind.euler is None or definition.flexion != "second" or in_world:
        return None
    if kind.euler[0] == kind.euler[2]:
        return np.zeros(len(misalignment_deg))
    return np.degrees(
        np.abs(middle_angle_error(np.radians(flexion_deg), np.radians(misalignment_deg)))
    )


def simulated_errors(
    session: Session, joint: str, definition: FlexionAngle, rows: list[JointRow]
) -> np.ndarray:
    """|error| of the flexion of the segments' true orientations in the pose of each row.

    True is the arm's joint where the protocol names one, else there is nothing to compare with.

    Returns:
        Shape (rows,) [deg]; NaN where there is nothing to compare with.
    """
    spec: JointDefinition = session.analysis.joints[joint]
    proximal, distal, arm = session.truth(spec.proximal), session.truth(spec.distal), session.arm()
    if (
        proximal is None
        or distal is None
        or arm is None
        or spec.reference_joint not in arm.joint_names
    ):
        return np.full(len(rows), np.nan)
    steps: dict[int, PlannedStep] = {step.index: step for step in session.steps}
    middle = np.array([(steps[row.step].settled_ns + steps[row.step].end_ns) // 2 for row in rows])
    sensors = session.analysis.sensors
    segments = [
        segment_orientation(truth_at(truth, middle), sensors[name])
        for truth, name in ((proximal, spec.proximal), (distal, spec.distal))
    ]
    flexion = flexion_of(definition, joint_angles(segments[0], segments[1], definition))
    reference = np.interp(
        middle, arm.host_time_ns, arm.q_measured[:, arm.joint_names.index(spec.reference_joint)]
    )
    return np.asarray(np.degrees(np.abs(rotation.wrap(flexion - reference))))


def _posed_rows(evaluation: Evaluation, joint: str) -> list[JointRow]:
    rows = [
        row
        for row in evaluation.joint_angle
        if row.joint == joint
        and row.kind != "sweep"
        and row.flexion_deg is not None
        and row.misalignment_deg is not None
    ]
    if len({row.misalignment_deg for row in rows}) < 2:
        raise InputError(
            f"session {evaluation.session} varies no misalignment of joint '{joint}' in static "
            "poses"
        )
    return rows


def _by_misalignment(rows: list[JointRow], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Misalignments, increasing, and the values in them."""
    x = np.array([float(row.misalignment_deg or 0.0) for row in rows])
    order = np.argsort(x, kind="stable")
    return x[order], np.asarray(values)[order]
