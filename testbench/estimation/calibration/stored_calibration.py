"""Stored calibrations of a session's sensors: which is whose, what is said of it, what it does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, Severity
from testbench.records.results.calibration_file import SensorCalibration, find_calibration
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session


@dataclass(frozen=True)
class StoredCalibrations:
    """The stored calibrations that correct the raw samples of a session.

    Attributes:
        place: Folder of the session, for messages.
        sensors: What is known of each sensor, by its name.
        recorded: When the samples were taken; None where nobody knows.
        given: Each sensor takes its own that is nearest in time.
    """

    place: Path
    sensors: Mapping[str, SensorRecord]
    recorded: datetime | None
    given: list[SensorCalibration] = field(default_factory=list)

    @staticmethod
    def among(given: list[SensorCalibration], session: Session) -> StoredCalibrations:
        """Those of them that are of the sensors of a session."""
        sensors = session.manifest.sensors
        return StoredCalibrations(session.path, sensors, session.recorded_at, given)

    def check(self) -> None:
        """Refuse calibrations of which not one is of a sensor of this session.

        Raises:
            InputError: Names whose calibrations there are, and the session's sensors.
        """
        if not self.given or any(self.of(name) for name in self.sensors):
            return
        whose = ", ".join(
            sorted({f"'{c.sensor}'" + (f" ({c.device})" if c.device else "") for c in self.given})
        )
        names = ", ".join(self.sensors)
        raise InputError(
            f"{self.place}: none of its sensors ({names}) has a stored calibration; there "
            f"are those of {whose}"
        )

    def of(self, sensor: str) -> SensorCalibration | None:
        """That of a sensor, by name; None where there is none.

        Raises:
            InputError: Several fit, and without a date none is nearest.
        """
        tag = self.sensors[sensor].device_tag
        return find_calibration(self.given, sensor, tag, self.recorded)

    def findings(self, sensor: str) -> list[Finding]:
        """What a reader must know of the correction of a sensor's raw samples."""
        stored = self.of(sensor)
        if stored is None:
            return [finding("calibration.none_of_this_sensor")] if self.given else []
        tag = self.sensors[sensor].device_tag
        same = (
            f"of the same device, {tag}"
            if tag and stored.device == tag
            else "matched by the sensor's name alone"
        )
        methods = ", ".join(
            f"{triad} by {method}" for triad, method in stored.summary()["methods"].items()
        )
        origin = (
            f"{stored.file}, " if stored.file else ""
        ) + f"session {stored.session} of {stored.calibrated:%Y-%m-%d}"
        dated = self.recorded is not None
        code = "calibration.stored" if dated else "calibration.stored_undated"
        own = [
            finding(
                "calibration.stored_warning",
                triad=warned.where or str(warned.values.get("triad", "sensor")),
                sentence=warned.sentence,
                remedy=warned.remedy,
            )
            for warned in stored.findings
            if warned.severity == Severity.WARNING
        ]
        if self.sensors[sensor].driver == "imported" and not (
            tag and stored.device == tag
        ):  # a name of a mapping is no name of a part
            whose = f"device {stored.device}" if stored.device else "no device is named in it"
            mine = f"the device {tag}" if tag else "none"
            own.insert(0, finding("calibration.by_name", stored=whose, own=mine))
        return [finding(code, origin=origin, methods=methods, match=same), *own]


def corrector(stored: SensorCalibration) -> Callable[[ImuSamples], ImuSamples]:
    """What corrects raw samples by a stored calibration.

    Args:
        stored: Of the sensor.
    """

    def correct(samples: ImuSamples) -> ImuSamples:
        gyr, acc, mag = stored.apply(samples.gyr, samples.acc, samples.mag, samples.temperature)
        q = samples.device_q
        if q is not None and stored.mounting is not None:
            q = rotation.multiply(q, rotation.from_matrix(stored.mounting.R_believed_from_sensor.T))
        return replace(samples, gyr=gyr, acc=acc, mag=mag, device_q=q)

    return correct
