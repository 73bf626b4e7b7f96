"""What a recording says of its sensors by themselves: sampling, axes, and inclination at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.alignment.face_axes import FaceAxes, face_axes
from testbench.evaluation.noise import longest_rest
from testbench.exceptions import InputError, NotFoundError
from testbench.pipeline.kept_estimate import load_or_estimate
from testbench.pipeline.request import AuditRequest
from testbench.records.results.estimate import AxisFinding, TimingAudit
from testbench.records.session.session import Session


@dataclass(frozen=True)
class Inclination:
    """Scatter of roll and pitch by the accelerometer alone in the longest rest.

    It is what an Euler-angle filter takes for R (Cabezuelo 2019, section 4.1.2).

    Attributes:
        roll_sd_rad: Of roll [rad].
        pitch_sd_rad: Of pitch [rad].
        rest_s: How long it rested [s].
    """

    roll_sd_rad: float
    pitch_sd_rad: float
    rest_s: float


@dataclass(frozen=True)
class SensorAudit:
    """One sensor.

    Attributes:
        timing: Of its sampling.
        axes: Of its triads against the truth; none without one.
        inclination: At rest; None where it does not rest for ten seconds.
        faces: Its axes by rests on the faces; None where none were named.
    """

    timing: TimingAudit
    axes: dict[str, AxisFinding]
    inclination: Inclination | None
    faces: FaceAxes | None


def audit_sensors(session: Session, asked: AuditRequest | None = None) -> dict[str, SensorAudit]:
    """Audit the sensors of a recording, by name.

    Args:
        session: The recording.
        asked: Of which sensor, and how it was laid down; all, and not told, if None.

    Raises:
        NotFoundError: No such sensor.
        InputError: Faces are of one sensor, or do not fit its rests.
    """
    asked = asked or AuditRequest()
    names = session.sensor_names
    if asked.sensor is not None and asked.sensor not in names:
        raise NotFoundError("sensor", asked.sensor, names)
    chosen = [name for name in names if asked.sensor in (None, name)]
    if asked.faces and len(chosen) > 1:
        raise InputError(f"--faces are of one sensor: name it with --sensor ({', '.join(names)})")
    estimated, found = load_or_estimate(session), {}
    for name in chosen:
        own = estimated.sensors[name]
        rest = longest_rest(own.host_time_ns, own.static)
        found[name] = SensorAudit(
            own.timing,
            own.axes,
            None if rest is None else _inclination(session, name, own.host_time_ns, rest),
            _faces(session, name, asked) if asked.faces else None,
        )
    return found


def _inclination(
    session: Session, name: str, time_ns: np.ndarray, rest: slice
) -> Inclination | None:
    """Roll and pitch of each sample of a rest, eqs 2.17 and 2.18; None without an accelerometer."""
    samples = session.imu(name)
    acc = samples.acc[rest] if len(samples) == len(time_ns) else np.zeros((0, 3))
    acc = acc[np.isfinite(acc).all(axis=1)]
    if len(acc) < 2:
        return None
    # turned to where the mean force is along z, so that neither angle is near its end
    mean = acc.mean(axis=0)
    z = mean / np.linalg.norm(mean)
    x = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = x - z * (z @ x)
    x /= np.linalg.norm(x)
    level = acc @ np.column_stack([x, np.cross(z, x), z])
    roll = np.arctan2(level[:, 1], level[:, 2])
    pitch = np.arctan2(-level[:, 0], np.hypot(level[:, 1], level[:, 2]))
    seconds = float(time_ns[rest][-1] - time_ns[rest][0]) / 1e9
    return Inclination(float(roll.std(ddof=1)), float(pitch.std(ddof=1)), seconds)


def _faces(session: Session, name: str, asked: AuditRequest) -> FaceAxes:
    samples = session.imu(name)
    if not np.isfinite(samples.gyr).all() or not np.isfinite(samples.acc).all():
        raise InputError(f"{name}: rests on faces take angular rates and forces without gaps")
    interval = float(np.median(np.diff(samples.device_time_ns))) / 1e9
    return face_axes(samples.gyr, samples.acc, interval, list(asked.faces), asked.least_rest_s)
