"""Write a session as a rerun recording."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.replacing import replaced_file, stored_where_asked
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.gait import Gait
from testbench.records.session.samples import ArmSamples, ImuSamples, Truth
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_lock
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.report import load_estimate, load_evaluation, load_gait
from testbench.reporting.viewer.layout import Content, layout, reach_of
from testbench.reporting.viewer.marks import contacts, has_judged, log_marks, unsound_sensors
from testbench.reporting.viewer.scene import (
    WORLD,
    axes_each,
    log_arm,
    log_estimated_sensor,
    log_mounted_sensor,
    log_side_by_side,
)
from testbench.reporting.viewer.shown_first import by_orientation
from testbench.reporting.viewer.signals import (
    log_chain,
    log_errors,
    log_imu,
    log_joint_angles,
    log_steps,
    signals_of,
    told,
    unjudged_joints,
)

PIECE = 1 << 20
"""Bytes that are handed on together."""


def save_recording(
    session: Session,
    path: str | Path,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
    only: str | None = None,
) -> Path:
    """Write what the viewer shows of a session.

    Args:
        session: The recording.
        path: The .rrd file to write.
        estimate: Of its orientations; read from the session's folder if None, and left out where
            the folder has none.
        evaluation: Of its errors; read from the session's folder if None, and left out where the
            folder has none.
        only: The one pane that the viewer opens with; all if None.

    Returns:
        The path.

    Raises:
        InputError: There is no such place.
        NotFoundError: There is no such pane.
        StorageError: The disk does not take it.
    """
    path = Path(path)
    with stored_where_asked(path), replaced_file(path) as partial:
        write_recording(session, partial, estimate, evaluation, only)
    return path


def write_recording(
    session: Session,
    file: Path,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
    only: str | None = None,
) -> None:
    """The same straight into a file, which somebody else gives its name once it is whole.

    Args:
        session: The recording.
        file: To write.
        estimate: Of its orientations, as for `save_recording`.
        evaluation: Of its errors, likewise.
        only: The one pane, likewise.

    Raises:
        NotFoundError: There is no such pane.
        OSError: The disk does not take it.
    """
    with session_lock(session.path):
        estimate = estimate or load_estimate(session)
        evaluation = evaluation or load_evaluation(session)
        gait = load_gait(session)
    seen = _Seen.of(session, estimate, evaluation, gait)
    blueprint = layout(seen.content(), evaluation, only)
    recording = rr.RecordingStream("testbench", recording_id=session.name, send_properties=False)
    with drained(file) as pipe, recording:
        try:
            recording.save(pipe)
            recording.send_blueprint(blueprint)
            _log(recording, seen)
        finally:
            recording.disconnect()  # who drains waits for the end


@dataclass(frozen=True)
class _Seen:
    """All that is shown of a session."""

    session: Session
    estimate: Estimate | None
    evaluation: Evaluation | None
    arm: ArmSamples | None
    truths: dict[str, Truth | None]
    samples: dict[str, ImuSamples]
    gait: Gait | None

    @staticmethod
    def of(
        session: Session,
        estimate: Estimate | None,
        evaluation: Evaluation | None,
        gait: Gait | None = None,
    ) -> _Seen:
        """As the session's folder has it."""
        kept = {name: own.every for name, own in estimate.sensors.items()} if estimate else {}
        names = session.sensor_names
        truths = {name: session.truth(name) for name in names}
        samples = {name: session.imu(name, every=kept.get(name, 1)) for name in names}
        return _Seen(session, estimate, evaluation, session.arm(), truths, samples, gait)

    def content(self) -> Content:
        """What the viewer is laid out for."""
        unsound = unsound_sensors(self.session, self.samples, self.estimate)
        lanes = 2 * bool(self.session.steps) + len(unsound) + len(contacts(self.gait))
        lanes += has_judged(self.evaluation)
        return Content(
            {name: signals_of(own) for name, own in self.samples.items()},
            self.columns,
            any(truth is not None for truth in self.truths.values()),
            _reach(self.session, self.arm),
            unjudged_joints(self.session, self.estimate, self.evaluation),
            lanes,
            len(self.session.steps),
            bool(self.session.events or told(self.session, self.evaluation)),
        )

    @property
    def columns(self) -> int:
        """Most axes of one sensor."""
        sensors = self.estimate.sensors if self.estimate is not None else {}
        axes = [
            (truth is not None) + len(sensors[name].orientation if name in sensors else ())
            for name, truth in self.truths.items()
        ]
        return axes_each(len(axes), max(axes, default=0))

    @property
    def orders(self) -> dict[str, list[str]]:
        """The filters of each sensor: the best, the worst, then the others, as far as that is
        known.
        """
        found = {}
        for name, own in self.estimate.sensors.items() if self.estimate is not None else ():
            known = by_orientation(self.evaluation, name) if self.evaluation is not None else []
            ranked = [key for key in known if key in own.orientation]
            found[name] = list(dict.fromkeys([*ranked, *own.orientation]))
        return found

    @property
    def colours(self) -> dict[str, str]:
        """Of each filter."""
        estimate, evaluation = self.estimate, self.evaluation
        filters = (
            [key for own in estimate.sensors.values() for key in own.orientation]
            if estimate
            else []
        )
        if evaluation is not None:
            filters += [row.filter for row in evaluation.orientation]
            filters += [row.filter for row in evaluation.joint_angle]
        asked = [name for name in self.session.analysis.estimate.filters if name in filters]
        return filter_colours(asked + filters)


@contextmanager
def drained(file: Path) -> Iterator[Path]:
    """The end of a pipe to write to, whose content is written to a file.

    The recorder waits for ever for a disk that is full, or ends without saying so: it is given
    something that takes everything, and what the disk does not take is known here.

    Args:
        file: That the content goes to.

    Yields:
        Where to write, as a file that can be opened once.

    Raises:
        OSError: The disk does not take it.
    """
    out, into = os.pipe()
    with ThreadPoolExecutor(1) as thread:
        written = thread.submit(_drain, out, file)
        try:
            yield Path(f"/dev/fd/{into}")
        finally:
            os.close(into)
        written.result()


def _drain(out: int, file: Path) -> None:
    """Write what comes from a pipe to a file; what the disk does not take is taken all the same."""
    with os.fdopen(out, "rb", buffering=0) as source:
        try:
            with file.open("wb") as target:
                shutil.copyfileobj(source, target, PIECE)
        except OSError:
            while source.read(PIECE):
                pass
            raise


def _log(recording: rr.RecordingStream, seen: _Seen) -> None:
    """Everything but how it is laid out."""
    session, estimate, evaluation, colours = (
        seen.session,
        seen.estimate,
        seen.evaluation,
        seen.colours,
    )
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("/", rr.CoordinateFrame(WORLD), static=True)
    if seen.arm is not None and session.robot is not None:
        log_arm(recording, session.robot, seen.arm)
        for name, sensor in session.analysis.sensors.items():
            log_mounted_sensor(recording, name, sensor)
            if estimate is not None:
                log_estimated_sensor(recording, session, name, estimate, seen.arm, colours)
    log_side_by_side(recording, seen.truths, estimate, colours, seen.columns, seen.orders)
    for name, own in seen.samples.items():
        log_imu(recording, name, own, estimate)
    unjudged = unjudged_joints(session, estimate, evaluation)
    log_joint_angles(recording, session, estimate, unjudged, colours)
    if evaluation is not None:
        log_errors(recording, evaluation, colours)
        log_chain(recording, evaluation)
    log_steps(recording, session, evaluation)
    log_marks(recording, session, seen.samples, estimate, evaluation, seen.gait)


def _reach(session: Session, arm: ArmSamples | None) -> float | None:
    """How far the sensors come from the world's origin [m], or None without an arm."""
    if arm is None or session.robot is None:
        return None
    kinematics = Kinematics(session.robot)
    few = arm.q_measured[:: max(1, len(arm.q_measured) // 200)]
    sensors = session.analysis.sensors.values()
    return reach_of(
        [
            kinematics.frame_motion(s.link, few, offset=Pose.from_placement(s.mounting)).position
            for s in sensors
        ]
    )
