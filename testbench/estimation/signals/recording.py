"""A recording opened for its estimate: what follows sees samples and numbers, no session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from testbench.consistency.doubtful import Belief
from testbench.estimation.signals.access import Change, SampleAccess, open_samples
from testbench.frames import STANDARD_GRAVITY
from testbench.records.session.manifest import FullScale, JointTruthRecord, SensorRecord
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import TrueAngles
from testbench.records.session.sensor_file import SensorFile, TruthFile
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Body, Estimation, Sensor
from testbench.records.specs.sensor import list_presets, load_preset

STANDARD_DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])


@dataclass(frozen=True)
class SensorRecording:
    """One sensor of a recording.

    Attributes:
        name: Of the sensor.
        raw: Its samples.
        truth: What it went through, or None where nobody knows.
        described: What is known of it.
        belief: What a person says of its samples.
        together: Samples of all sensors of the recording.
    """

    name: str
    raw: SensorFile
    truth: TruthFile | None
    described: SensorRecord
    belief: Belief
    together: int

    @staticmethod
    def of(session: Session, sensor: str) -> SensorRecording:
        """A sensor of a session.

        Raises:
            NotFoundError: No such sensor.
            SessionError: Its samples are being recorded, were cut off, or are damaged.
        """
        return SensorRecording(
            sensor,
            session.sensor(sensor),
            session.truth_file(sensor),
            session.manifest.sensors[sensor],
            belief_in(session, sensor),
            sum(session.sample_count(name) for name in session.sensor_names),
        )

    def samples(self, stored: Change | None = None) -> SampleAccess:
        """Access to its samples; see `open_samples`."""
        return open_samples(self.raw, self.together, self.belief, stored)


@dataclass(frozen=True)
class JointTruth:
    """Angles of a joint that another system gave.

    Attributes:
        angles: As recorded.
        same_clock: Whether their times are on the clock of the samples.
        near: Whether a person said what is to be added to their times.
    """

    angles: TrueAngles
    same_clock: bool
    near: bool

    @staticmethod
    def of(session: Session, joint: str) -> JointTruth | None:
        """Those of a session, None where it has none."""
        angles = session.true_angles(joint)
        if angles is None:
            return None
        known = session.manifest.true_angles.get(joint, JointTruthRecord())
        return JointTruth(angles, known.same_clock, known.offset_s is not None)


@dataclass(frozen=True)
class RunFacts:
    """What is known of a run beside its samples.

    Attributes:
        settings: How to estimate.
        placed: The sensors of the protocol, by name.
        steps: That were finished.
        gravity: In the world, shape (3,) [m/s^2].
        recorded: When the samples were taken; None where nobody knows.
        body: That carries the sensors of an import.
        true: Sensors whose truth is known.
        true_angles: Of joints whose angles another system gave, by name.
        has_joints: Whether sensors are put together to joints.
    """

    settings: Estimation
    placed: Mapping[str, Sensor]
    steps: list[PlannedStep]
    gravity: np.ndarray
    recorded: datetime | None
    body: Body = field(default_factory=Body)
    true: frozenset[str] = frozenset()
    true_angles: Mapping[str, JointTruth] = field(default_factory=dict)
    has_joints: bool = False

    @staticmethod
    def of(session: Session) -> RunFacts:
        """Those of a session."""
        return RunFacts(
            session.analysis.estimate,
            session.analysis.sensors,
            session.steps,
            session.robot.gravity if session.robot else STANDARD_DOWN,
            session.recorded_at,
            session.analysis.body or Body(),
            frozenset(own for own in session.sensor_names if session.truth_file(own) is not None),
            {
                name: own
                for name in session.analysis.joints
                if (own := JointTruth.of(session, name)) is not None
            },
            bool(session.analysis.joints),
        )


def belief_in(session: Session, sensor: str) -> Belief:
    """What a session says of the samples of a sensor."""
    settings = session.analysis.estimate
    return Belief(
        _has_noise(session, sensor),
        frozenset(settings.keep),
        [exclusion for exclusion in settings.exclude if exclusion.concerns(sensor)],
        session.manifest.sensors[sensor].full_scale or FullScale(),
    )


def _has_noise(session: Session, sensor: str) -> bool:
    """Whether a sensor's readings must differ at rest: not those of a simulated one whose data
    sheet states no noise.
    """
    record = session.manifest.sensors[sensor]
    placed = session.analysis.sensors.get(sensor)
    if record.driver != "simulated" or (placed is None and record.preset not in list_presets()):
        return True
    # one that rode on a motion from a file has no place on an arm
    sheet = load_preset(record.preset or "") if placed is None else placed.imu()
    return any(
        bool(triad.triad().noise_density.any()) for triad in (sheet.accelerometer, sheet.gyroscope)
    )
