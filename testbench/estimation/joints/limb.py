"""Sensors whose joints hang together, on one grid of time: what their alignment looks at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean
from testbench.records.results.estimate import FrameFit, SensorEstimate
from testbench.records.specs.protocol import BodyJoint

RATE_HZ = 50.0
"""Bodies move slower than half of it (Antonsson & Mann, J. Biomechanics 18, 1985: 15 Hz)."""
MOST = 30_000
"""Instants that an alignment looks at: ten minutes."""
SMOOTH_S = 0.1
"""Rates and accelerations are means over so long [s]: above 5 Hz skin moves more than bones."""
QUIET = np.radians(6.0)
"""A standing person sways slower than this [rad/s]: 1 to 3 deg/s, and sensors' noise."""
QUIET_WINDOW_S, LEAST_S, LONGEST_S = 0.3, 1.0, 5.0
"""Over which a rate is looked at, the shortest rest that counts, and how much of a rest is used
[s].
"""


@dataclass(frozen=True)
class Limb:
    """Sensors of joints that hang together, by one filter.

    Attributes:
        time_ns: Host time, evenly spaced, shape (n,) [ns].
        q: q_earth_from_sensor by sensor, each in the filter's own earth, shape (n, 4).
        acc: Specific force by sensor, shape (n, 3) [m/s^2]; NaN where there is none.
    """

    time_ns: np.ndarray
    q: dict[str, np.ndarray]
    acc: dict[str, np.ndarray]

    @property
    def interval(self) -> float:
        """Between instants [s]."""
        return float(self.time_ns[1] - self.time_ns[0]) / NANOSECONDS

    def rates(self, sensor: str) -> np.ndarray:
        """Angular rate in the earth, smoothed, shape (n, 3) [rad/s]."""
        q = self.q[sensor]
        turned = rotation.multiply(q[2:], rotation.conjugate(q[:-2]))
        rate = rotation.to_rotation_vector(turned) / (2 * self.interval)
        return smooth(np.vstack([rate[:1], rate, rate[-1:]]), self.interval)

    def quiet(self) -> np.ndarray:
        """Where no sensor turns, shape (n,), bool."""
        still = np.ones(len(self.time_ns), dtype=bool)
        window = max(round(QUIET_WINDOW_S / self.interval), 1)
        for sensor in self.q:
            speed = np.sum(self.rates(sensor) ** 2, axis=1)
            still &= np.sqrt(np.maximum(moving_mean(speed, window), 0)) < QUIET
        return still


def smooth(signal: np.ndarray, interval: float) -> np.ndarray:
    """Mean over `SMOOTH_S`, shape (n, 3).

    Args:
        signal: Shape (n, 3).
        interval: Between samples [s].
    """
    return np.asarray(moving_mean(signal, max(round(SMOOTH_S / interval), 1)))


def limb_of(
    sensors: Mapping[str, SensorEstimate], forces: Mapping[str, np.ndarray], key: str
) -> Limb | None:
    """The sensors of a limb by one filter; None where they were never recorded together.

    Args:
        sensors: Their estimates, in which the filter ran.
        forces: Specific force at the estimates' instants, shape (n, 3) each [m/s^2].
        key: Of the filter.
    """
    times = [own.host_time_ns for own in sensors.values()]
    begin, end = max(t[0] for t in times), min(t[-1] for t in times)
    rate = min(RATE_HZ, *(NANOSECONDS / median_interval(t) for t in times))
    step = round(NANOSECONDS / rate)
    grid = np.arange(begin, end + 1, step)[:MOST]
    if len(grid) < 2 * rate * LEAST_S:
        return None
    q = {
        name: rotation.interpolate(
            own.host_time_ns, own_earth(own.orientation[key], own.frames.get(key)), grid
        )
        for name, own in sensors.items()
    }
    known = np.all([np.isfinite(own[:, 0]) for own in q.values()], axis=0)
    if known.mean() < 0.5:
        return None
    acc = {name: _at(own.host_time_ns, forces[name], grid) for name, own in sensors.items()}
    whole = {name: _bridged(own) for name, own in q.items()}
    return Limb(grid, whole, acc)


def own_earth(q_world_from_sensor: np.ndarray, fit: FrameFit | None) -> np.ndarray:
    """q_earth_from_sensor as the filter gave it, before it was brought to the truth's frames.

    Args:
        q_world_from_sensor: Aligned, shape (n, 4).
        fit: The alignment.
    """
    if fit is None or fit.method == "none":
        return q_world_from_sensor
    tilt = rotation.from_rotation_vector(np.radians(np.array(fit.tilt_deg)))
    left = rotation.multiply(tilt, rotation.from_heading(np.radians(fit.heading_deg)))
    right = rotation.from_rotation_vector(np.radians(np.array(fit.mounting_deg)))
    return rotation.multiply(
        rotation.multiply(rotation.conjugate(left), q_world_from_sensor), right
    )


def limbs_of(joints: Mapping[str, BodyJoint]) -> list[dict[str, BodyJoint]]:
    """Joints that share sensors, directly or by others, together."""
    groups: list[tuple[set[str], dict[str, BodyJoint]]] = []
    for name, joint in joints.items():
        ends, own = {joint.proximal, joint.distal}, {name: joint}
        apart = []
        for sensors, others in groups:
            if sensors & ends:
                ends, own = sensors | ends, {**others, **own}
            else:
                apart.append((sensors, others))
        groups = [*apart, (ends, own)]
    return [own for _, own in groups]


def sensors_of(joints: Iterable[BodyJoint]) -> list[str]:
    """The sensors of joints, each once, in their order."""
    return list(dict.fromkeys(end for joint in joints for end in (joint.proximal, joint.distal)))


def _at(time_ns: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    known = np.isfinite(values).all(axis=1)
    if known.sum() < 2:
        return np.full((len(grid), 3), np.nan)
    return np.column_stack(
        [np.interp(grid, time_ns[known], values[known, i]) for i in range(values.shape[1])]
    )


def _bridged(q: np.ndarray) -> np.ndarray:
    """Orientations whose gaps hold what stood before them, shape (n, 4)."""
    known = np.isfinite(q[:, 0])
    last = np.maximum.accumulate(np.where(known, np.arange(len(q)), 0))
    last[: int(np.argmax(known))] = int(np.argmax(known))
    return q[last]
