"""One sensor of a session, opened for its calibration: what follows sees samples and numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.consistency.doubtful import Belief
from testbench.estimation.signals.recording import STANDARD_DOWN, belief_in
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import Session
from testbench.records.specs.sensor import ImuParameters


@dataclass(frozen=True)
class CalibrationRecording:
    """One sensor of a recording.

    Attributes:
        place: Folder of the session, for messages.
        sensor: Its name.
        raw: Its samples.
        truth: What it went through, or None where nobody knows.
        described: What is known of it.
        belief: What a person says of its samples.
        steps: That were finished.
        gravity: In the world, shape (3,) [m/s^2].
        align_clock: Whether its clock is fitted to the motion.
        sheet: Its data sheet; None where none is named.
    """

    place: Path
    sensor: str
    raw: ImuSamples
    truth: Truth | None
    described: SensorRecord
    belief: Belief
    steps: Sequence[PlannedStep]
    gravity: np.ndarray
    align_clock: bool
    sheet: ImuParameters | None

    @staticmethod
    def of(session: Session, sensor: str) -> CalibrationRecording:
        """A sensor of a session.

        Raises:
            NotFoundError: No such sensor.
            SessionError: Its samples are being recorded, were cut off, or are damaged.
        """
        placed = session.analysis.sensors.get(sensor)
        stated = placed is not None and (placed.preset or placed.parameters)
        return CalibrationRecording(
            session.path,
            sensor,
            session.imu(sensor),
            session.truth(sensor),
            session.manifest.sensors[sensor],
            belief_in(session, sensor),
            session.steps,
            session.robot.gravity if session.robot else STANDARD_DOWN,
            session.analysis.estimate.align_clock,
            placed.imu() if placed is not None and stated else None,
        )
