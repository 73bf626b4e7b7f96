"""The standing pose: when a person stands upright, and how each sensor is held then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.joints.limb import LEAST_S, LONGEST_S, Limb
from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import NANOSECONDS
from testbench.model import rotation

MOST_SWAY = np.radians(1.5)
"""Who turns by more about the mean moves slowly, and does not stand (RMS) [rad]."""
AWAY_S = 0.1
"""Left out at either end of a rest that was found [s]."""


@dataclass(frozen=True)
class Standing:
    """When a person stands, and how each sensor is held.

    Attributes:
        begin_ns: First instant that counts, host time [ns].
        end_ns: The last one [ns].
        q: q_earth_from_sensor by sensor, shape (4,) each.
        sway: RMS turn of each sensor about its mean [rad].
        told: Whether a person said when; else it is the first rest.
    """

    begin_ns: int
    end_ns: int
    q: dict[str, np.ndarray]
    sway: dict[str, float]
    told: bool

    @property
    def middle_ns(self) -> int:
        return (self.begin_ns + self.end_ns) // 2

    def holds(self, time_ns: np.ndarray) -> np.ndarray:
        """Which instants lie in it, shape (n,), bool.

        Args:
            time_ns: Host time, shape (n,) [ns].
        """
        return np.asarray((time_ns >= self.begin_ns) & (time_ns <= self.end_ns))


def find_standing(limb: Limb, stated_ns: tuple[int, int] | None) -> Standing | None:
    """The standing pose; None where nobody rests, or nothing was recorded when it is said to be.

    Args:
        limb: The sensors.
        stated_ns: From and to, host time [ns]; None for the first rest of all sensors.
    """
    if stated_ns is not None:
        return _held(limb, stated_ns, True)
    away = round(AWAY_S * NANOSECONDS)
    for first, last in intervals_of(limb.quiet(), round(LEAST_S / limb.interval)):
        begin = int(limb.time_ns[first]) + away
        end = min(int(limb.time_ns[last - 1]) - away, begin + round(LONGEST_S * NANOSECONDS))
        found = _held(limb, (begin, end), False)
        if found is not None and max(found.sway.values()) < MOST_SWAY:
            return found
    return None


def _held(limb: Limb, interval_ns: tuple[int, int], told: bool) -> Standing | None:
    """How each sensor is held in an interval; None where nothing was recorded in it."""
    begin, end = interval_ns
    rows = (limb.time_ns >= begin) & (limb.time_ns <= end)
    if rows.sum() < 3:
        return None
    q, sway = {}, {}
    for name, own in limb.q.items():
        q[name] = rotation.mean(own[rows])
        turned = rotation.multiply(rotation.conjugate(q[name]), own[rows])
        sway[name] = float(np.sqrt(np.mean(rotation.angle(turned) ** 2)))
    return Standing(begin, end, q, sway, told)
