"""All three angles of a joint over time, estimated and true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import INDEX, beside, joint_angle_series, nearest_turn, unwrapped
from testbench.model.true_segment import true_segment
from testbench.model.truth import truth_at
from testbench.records.disk.neighbouring_rows import Instants
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import joint_table
from testbench.records.session.session import Session
from testbench.records.specs.protocol import JointDefinition
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.palette import REFERENCE
from testbench.reporting.sections.joint_curves import angle_names
from testbench.reporting.sections.outliers import flexion_outliers, hidden_names

TRUE = "true angle"
MOST_SAMPLES = 20_000
"""Of more one in so many is drawn that fewer are left."""


def three_angle_blocks(
    session: Session,
    estimate: Estimate,
    evaluation: Evaluation,
    colours: Mapping[str, str],
    spans: Sequence[Span],
) -> dict[str, list[Block]]:
    """By joint of an arm; nothing of one whose segments' true orientation nobody knows."""
    found: dict[str, list[Block]] = {}
    for name in dict.fromkeys(row.joint for row in evaluation.joint_angle):
        own, joint = estimate.joints.get(name), session.analysis.joints[name]
        series = evaluation.series.get(joint_table(name))
        if own is None or own.sd or own.true_clock is not None or not series:
            continue
        every = slice(None, None, -(-len(own.host_time_ns) // MOST_SAMPLES))
        time = own.host_time_ns[every]
        true = _true(session, joint, time)
        if true is None:
            continue
        angles = {
            key: values[every]
            for (key, sequence), values in own.angles.items()
            if sequence == joint.label and key in colours
        }
        envelope = Envelope(time / NANOSECONDS)
        reference = np.asarray(series["reference_rad"], dtype=float)[every]
        panels = _panels(joint, true, angles, reference, envelope)
        far = sorted(flexion_outliers(evaluation, name))
        figure = time_panels(envelope.time, panels, {**colours, TRUE: REFERENCE}, spans, far)
        for drawn in figure["data"]:
            if drawn["name"] == TRUE:
                drawn["line"] |= {"width": 2.4, "dash": "dot"}
        found[name] = [
            Figures(
                f"All three angles over time: {name}",
                {f"all three angles of {name} over time": figure},
                "How to read: by the joint's own definition; the dotted line is the truth. Near "
                "gimbal lock the outer two are not told apart, and jump."
                f"{hidden_names(far)}",
                folded=True,
            )
        ]
    return found


def _true(session: Session, joint: JointDefinition, time: np.ndarray) -> np.ndarray | None:
    """True angles by the joint's own definition, shape (n, 3) [rad]; None where nobody knows."""
    sensors = (joint.proximal, joint.distal)
    near = session.near(Instants(dict.fromkeys(sensors, time), time))
    truths = [near.truth(sensor) for sensor in sensors]
    if any(truth is None for truth in truths):
        return None
    orientations = [truth_at(truth, time) for truth in truths if truth is not None]
    known = np.isfinite(orientations[0][:, 0]) & np.isfinite(orientations[1][:, 0])
    proximal, distal = (
        true_segment(session.analysis, sensor, q[known])
        for sensor, q in zip(sensors, orientations, strict=True)
    )
    angles = np.full((len(time), 3), np.nan)
    angles[known] = joint_angle_series(proximal, distal, joint)
    return angles if known.any() else None


def _panels(
    joint: JointDefinition,
    true: np.ndarray,
    angles: Mapping[str, np.ndarray],
    reference: np.ndarray,
    envelope: Envelope,
) -> dict[str, dict[str, np.ndarray]]:
    """By title of the vertical axis, the signals [deg] by name."""
    panels: dict[str, dict[str, np.ndarray]] = {}
    own = {
        name: beside(joint, values, true, reference) if joint.continuous else values
        for name, values in angles.items()
    }
    for i, title in enumerate(angle_names(joint)):
        sign = joint.sign if i == INDEX[joint.flexion] else 1
        followed = unwrapped(true[:, i])
        signals = {name: nearest_turn(values[:, i], followed) for name, values in own.items()}
        panels[f"{title} [deg]"] = {
            name: envelope(sign * np.degrees(values))
            for name, values in {TRUE: followed, **signals}.items()
        }
    return panels
