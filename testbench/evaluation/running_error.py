"""How far filters are off against the arm while it still moves: to be looked at, no evaluation.

Headings are aligned by a running mean until the first step that is evaluated begins, and held from
then on; mountings are those that the protocol states.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_angle import flexion_of, joint_angles, nearest_turn, segment_orientation
from testbench.records.specs.protocol import JointDefinition, Sensor

FORGET_NS = NANOSECONDS
"""Time in which the running mean of a heading forgets all but a third [ns]."""
TRUE = "true"
"""What stands for the arm beside filters."""


@dataclass
class _Mean:
    """A root mean square that grows."""

    square: float = 0.0
    count: int = 0

    def add(self, values: np.ndarray) -> None:
        known = values[np.isfinite(values)]
        self.square += float(known @ known)
        self.count += len(known)

    @property
    def rms(self) -> float | None:
        return float(np.sqrt(self.square / self.count)) if self.count else None


@dataclass
class RunningOrientation:
    """The orientation of one sensor by several filters, against the arm's."""

    _headings: dict[str, complex] = field(default_factory=dict)
    _means: dict[str, _Mean] = field(default_factory=dict)

    def take(
        self,
        time_ns: np.ndarray,
        true: np.ndarray,
        estimated: Mapping[str, np.ndarray],
        held_ns: int | None,
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """A chunk of orientations.

        Args:
            time_ns: Host times, increasing, shape (n,).
            true: q_world_from_sensor by the arm, shape (n, 4).
            estimated: q_earth_from_sensor by filter, shape (n, 4) each.
            held_ns: From when on headings are held, and errors count [ns]; None for not yet.

        Returns:
            By filter: q_world_from_sensor, shape (n, 4), and the angle of its error, shape (n,)
            [rad].
        """
        counts = np.zeros(len(time_ns), bool) if held_ns is None else time_ns >= held_ns
        found, errors = {}, {}
        for name, q_earth in estimated.items():
            # one that began anew after that is aligned by what comes first
            first = counts.all() and name not in self._headings
            aligning = counts if first else ~counts
            self._align(name, time_ns[aligning], true[aligning], q_earth[aligning])
            heading = float(np.angle(self._headings.get(name, 1.0)))
            found[name] = rotation.multiply(rotation.from_heading(heading), q_earth)
            errors[name] = rotation.angle(rotation.multiply(found[name], rotation.conjugate(true)))
            self._means.setdefault(name, _Mean()).add(errors[name][counts])
        return found, errors

    def _align(self, name: str, time_ns: np.ndarray, true: np.ndarray, q_earth: np.ndarray) -> None:
        """Bring the angle about the vertical from a filter's earth to the world up to date."""
        angles = rotation.heading_angle(rotation.multiply(true, rotation.conjugate(q_earth)))
        known = np.isfinite(angles)
        if not known.any():
            return
        # the latest count most: at the start filters turn until they are level
        age = (time_ns[known] - time_ns[known][-1]) / FORGET_NS
        weights = np.exp(age)
        now = complex(np.sum(weights * np.exp(1j * angles[known])) / np.sum(weights))
        share = float(np.exp(age[0]))
        self._headings[name] = now + share * (self._headings.get(name, now) - now)

    def forget(self) -> None:
        """Filters began anew: their headings are others now."""
        self._headings.clear()

    def rms(self, name: str) -> float | None:
        """Root mean square of a filter's error since headings are held [rad]; None before."""
        return self._means[name].rms if name in self._means else None


class RunningJoint:
    """The flexion of one joint by several filters, against that of the arm's segments.

    Args:
        joint: As defined.
        proximal: The sensor of its proximal segment.
        distal: The sensor of its distal segment.
    """

    def __init__(self, joint: JointDefinition, proximal: Sensor, distal: Sensor):
        self._definition = joint.definitions()[0]
        self._sensors = {joint.proximal: proximal, joint.distal: distal}
        self._names = (joint.proximal, joint.distal)
        self._times: dict[str, np.ndarray] = {}
        self._segments: dict[str, dict[str, np.ndarray]] = {}
        self._means: dict[str, _Mean] = {}

    @property
    def label(self) -> str:
        """Of the definition."""
        return self._definition.label

    def add(self, sensor: str, time_ns: np.ndarray, q: Mapping[str, np.ndarray]) -> None:
        """Orientations of one of its sensors; of another one they are passed over.

        Args:
            sensor: Its name.
            time_ns: Host times behind those of the call before, shape (n,).
            q: q_world_from_sensor by filter, and by `TRUE` the arm's, shape (n, 4) each.
        """
        if sensor not in self._names:
            return
        turned = {key: segment_orientation(own, self._sensors[sensor]) for key, own in q.items()}
        known = self._segments.get(sensor)
        if known is not None and known.keys() == turned.keys():
            turned = {key: np.concatenate([known[key], own]) for key, own in turned.items()}
            time_ns = np.concatenate([self._times[sensor], time_ns])
        self._times[sensor], self._segments[sensor] = time_ns, turned

    def take(self, held_ns: int | None) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Flexions where both sensors are known by now, at the proximal one's instants.

        Args:
            held_ns: From when on errors count [ns]; None for not yet.

        Returns:
            Host times, shape (n,) [ns], and by filter, and by `TRUE`, the flexion, shape (n,)
            [rad].
        """
        proximal, distal = self._names
        nothing = np.zeros(0, dtype=np.int64)
        if proximal not in self._times or distal not in self._times:
            return nothing, {}
        far = self._times[distal]
        rows = (self._times[proximal] >= far[0]) & (self._times[proximal] <= far[-1])
        time_ns = self._times[proximal][rows]
        if len(far) < 2 or not len(time_ns):
            return nothing, {}
        near = self._segments[proximal]
        found = {}
        for key, q in self._segments[distal].items():
            if key in near:
                at = rotation.interpolate(far, q, time_ns)
                found[key] = flexion_of(
                    self._definition, joint_angles(near[key][rows], at, self._definition)
                )
        for key in found.keys() - {TRUE}:
            found[key] = nearest_turn(found[key], found[TRUE])
            if held_ns is not None:
                off = (found[key] - found[TRUE])[time_ns >= held_ns]
                self._means.setdefault(key, _Mean()).add(off)
        self._forget(int(time_ns[-1]))
        return time_ns, found

    def _forget(self, done_ns: int) -> None:
        """Let go of what was used; of the distal sensor the last sample before stays."""
        proximal, distal = self._names
        begin = {
            proximal: int(np.searchsorted(self._times[proximal], done_ns, side="right")),
            distal: max(int(np.searchsorted(self._times[distal], done_ns)) - 1, 0),
        }
        for name, first in begin.items():
            self._times[name] = self._times[name][first:]
            self._segments[name] = {k: q[first:] for k, q in self._segments[name].items()}

    def rms(self, name: str) -> float | None:
        """Root mean square of a filter's error since headings are held [rad]; None before."""
        return self._means[name].rms if name in self._means else None
