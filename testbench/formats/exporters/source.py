"""What an exporter draws from: a session, its estimate, and the filter and frame asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from typing import Literal

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.exporters.chain_pose import chain_orientation
from testbench.formats.opensim_names import Model
from testbench.model import rotation
from testbench.model.joint_angle import joint_angle_series
from testbench.model.told_angles import told_angles
from testbench.model.true_segment import true_segment
from testbench.model.truth import WIDEST_GAP_NS
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import Estimate
from testbench.records.results.gait import Gait
from testbench.records.session.samples import ArmSamples, ImuSamples, Truth
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle

TRUTH = "truth"
"""In place of a filter's name: the orientation by the arm's kinematics, or by the reference system
of an import.
"""


Frame = Literal["opensim", "world"]


@dataclass(frozen=True)
class ExportSource:
    """What to export.

    Attributes:
        session: The recording.
        estimate: What was computed from it.
        wanted: Filter that was asked for, or None.
        frame: Of orientations for OpenSim: its ground (y up) or the world (z up).
        model: Of OpenSim, whose coordinates joint angles are named after.
    """

    session: Session
    estimate: Estimate
    wanted: str | None = None
    frame: Frame = "opensim"
    model: Model = "rajagopal"

    @cached_property
    def imus(self) -> dict[str, ImuSamples]:
        """Raw samples by sensor; of recordings of hours, those that estimates are kept at."""
        every = {name: estimated.every for name, estimated in self.estimate.sensors.items()}
        return {
            name: self.session.imu(name, every=every.get(name, 1))
            for name in self.session.sensor_names
        }

    @cached_property
    def truths(self) -> dict[str, Truth | None]:
        """Truth by sensor."""
        return {name: self.session.truth(name) for name in self.session.sensor_names}

    @cached_property
    def told(self) -> dict[str, dict[str, np.ndarray]]:
        """True angles that another system gave of joints, at the instants of their estimates: by
        joint and label of a definition, shape (n, 3) [rad]; NaN where they judge nothing.
        """
        found = {}
        for name, joint in self.estimate.joints.items():
            told = told_angles(self.session, name, joint)
            if told is not None:
                found[name] = told[0]
        return found

    @cached_property
    def arm(self) -> ArmSamples | None:
        """What the arm reported."""
        return self.session.arm()

    @cached_property
    def gait(self) -> Gait | None:
        """The gait that the session keeps of this very recording."""
        if not Gait.lies_in(self.session.path):
            return None
        found = Gait.load(self.session.path)
        return found if found.fingerprint == self.session.fingerprint else None

    @cached_property
    def chains(self) -> dict[str, ChainEstimate]:
        """What the chain filter estimated, by the names that stand for it in place of a filter's:
        chain_<section>_<state>.
        """
        return {one.key: one for one in self.estimate.chain}

    @property
    def chain(self) -> ChainEstimate | None:
        """That which was asked for in place of a filter."""
        return self.chains.get(self.wanted or "")

    @property
    def sensor_names(self) -> list[str]:
        """Those that were estimated; of a chain that was asked for, those on it."""
        if self.chain is not None:
            return self.chain.sensors
        return [name for name in self.session.sensor_names if name in self.estimate.sensors]

    @cached_property
    def filters(self) -> list[str]:
        """Filters of an export that holds several: the wanted one, or every one that ran."""
        if self.wanted is not None:
            return [self.filter]
        return list(
            dict.fromkeys(
                key for name in self.sensor_names for key in self.estimate.sensors[name].orientation
            )
        )

    @cached_property
    def filter(self) -> str:
        """The filter of an export that holds one.

        It is the wanted one, else the first of the protocol's that ran for every sensor.

        Raises:
            InputError: It could not run for a sensor, or none ran.
        """
        if self.wanted is not None:
            of_joints = self.wanted == TRUTH and bool(self.told)
            for name in self.sensor_names if self.chain is None and not of_joints else ():
                self._check_ran(name, self.wanted)
            return self.wanted
        sensors = [self.estimate.sensors[name] for name in self.sensor_names]
        ran = [
            key
            for key in (sensors[0].orientation if sensors else [])
            if all(key in s.orientation for s in sensors)
        ]
        listed = [key for key in self.session.analysis.estimate.filters if key in ran] + ran
        if not listed:
            raise InputError(
                f"{self.session.path}: no filter ran for every sensor; name one with --filter"
            )
        return listed[0]

    def _check_ran(self, sensor: str, key: str) -> None:
        if key == TRUTH:
            truth = self.truths[sensor]
            if truth is None or not np.isfinite(truth.q_world_from_sensor).all(axis=1).any():
                raise InputError(
                    f"{self.session.path}: nobody knows the true orientation of sensor '{sensor}'"
                )
        elif key not in self.estimate.sensors[sensor].orientation:
            reason = self.estimate.sensors[sensor].skipped.get(key, "it was not asked to run")
            raise InputError(
                f"{self.session.path}: there is no orientation of sensor '{sensor}' by filter "
                f"'{key}': {reason}"
            )

    def orientation(self, sensor: str) -> tuple[np.ndarray, np.ndarray]:
        """Orientation of a sensor by the chosen filter, at strictly increasing instants.

        Returns:
            Host times, shape (n,), int64 [ns], and q_world_from_sensor, shape (n, 4).
        """
        if self.chain is not None:
            time, q = self.chain.host_time_ns, chain_orientation(self.session, self.chain, sensor)
        elif self.filter == TRUTH:
            self._check_ran(sensor, TRUTH)
            truth = self.truths[sensor]
            assert truth is not None
            time, q = truth.host_time_ns, truth.q_world_from_sensor
        else:
            estimated = self.estimate.sensors[sensor]
            time, q = estimated.host_time_ns, estimated.orientation[self.filter]
        rows = np.flatnonzero(np.isfinite(q).all(axis=1))
        rows = rows[increasing(time[rows])]
        return time[rows], q[rows]

    def orientation_at(self, sensor: str, time_ns: np.ndarray) -> np.ndarray:
        """q_world_from_sensor by the chosen filter.

        The filter's own instants give its own values; between them it is interpolated, across no
        gap of more than 0.2 s.

        Args:
            sensor: Its name.
            time_ns: Host time, shape (n,).

        Returns:
            Shape (n, 4); NaN where it is unknown.
        """
        return interpolated(*self.orientation(sensor), time_ns)

    def joint_names(self) -> list[str]:
        """Joints whose angles the chosen filter, or the truth, gives."""
        if self.filter == TRUTH and self.told:
            return list(self.told)
        if self.filter == TRUTH:
            return list(self.session.analysis.joints)
        return [
            name
            for name, joint in self.estimate.joints.items()
            if any(key == self.filter for key, _ in joint.angles)
        ]

    def angles(self, joint: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Euler angles of a joint by the chosen filter or the truth.

        Returns:
            Host times, shape (n,) [ns], and by sequence the intrinsic angles, shape (n, 3) [rad].
        """
        estimated = self.estimate.joints.get(joint)
        if self.filter != TRUTH and estimated is not None:
            return estimated.host_time_ns, {
                sequence: angles
                for (key, sequence), angles in estimated.angles.items()
                if key == self.filter
            }
        if estimated is not None and joint in self.told:
            return estimated.host_time_ns, self.told[joint]
        time = self.orientation(self.session.analysis.joints[joint].proximal)[0]
        return time, self.true_angles(joint, time)

    def true_angles(self, joint: str, time_ns: np.ndarray) -> dict[str, np.ndarray]:
        """The three angles of a joint as another system told them, else of the segments' true
        orientations, by definition of the joint.

        Args:
            joint: Of the protocol.
            time_ns: Host time, shape (n,); of angles that were told, that of the estimate.

        Returns:
            By label of the definition, shape (n, 3) [rad]; NaN where the truth is unknown.
        """
        if joint in self.told:
            return self.told[joint]
        definition = self.session.analysis.joints[joint]
        q = []
        for name in (definition.proximal, definition.distal):
            own = true_orientation(self.truths[name], time_ns)
            q.append(true_segment(self.session.analysis, name, own))
        known = np.isfinite(q[0]).all(axis=1) & np.isfinite(q[1]).all(axis=1)
        result = {}
        for item in definition.definitions():
            result[item.label] = np.full((len(time_ns), 3), np.nan)
            if known.any():
                result[item.label][known] = joint_angle_series(q[0][known], q[1][known], item)
        return result

    def definitions(self, joint: str) -> dict[str, FlexionAngle]:
        """The definitions of a joint, by label: they say which angle is the flexion."""
        return {item.label: item for item in self.session.analysis.joints[joint].definitions()}


def true_orientation(truth: Truth | None, time_ns: np.ndarray) -> np.ndarray:
    """True q_world_from_sensor.

    Args:
        truth: None where there is none.
        time_ns: Host time, shape (n,).

    Returns:
        Shape (n, 4); NaN before, after and in gaps of the truth.
    """
    if truth is None:
        return np.full((len(time_ns), 4), np.nan)
    rows = np.flatnonzero(np.isfinite(truth.q_world_from_sensor).all(axis=1))
    rows = rows[increasing(truth.host_time_ns[rows])]
    return interpolated(truth.host_time_ns[rows], truth.q_world_from_sensor[rows], time_ns)


def interpolated(times: np.ndarray, q: np.ndarray, time_ns: np.ndarray) -> np.ndarray:
    """Orientations at other times.

    Args:
        times: Increasing, shape (m,) [ns].
        q: At those times, shape (m, 4).
        time_ns: Wanted times, shape (n,).

    Returns:
        Shape (n, 4); NaN before the first, after the last and in gaps.
    """
    result = np.full((len(time_ns), 4), np.nan)
    if len(times) < 2:
        return result
    before = np.clip(np.searchsorted(times, time_ns, side="right") - 1, 0, len(times) - 2)
    inside = (
        (time_ns >= times[0])
        & (time_ns <= times[-1])
        & (times[before + 1] - times[before] <= WIDEST_GAP_NS)
    )
    result[inside] = rotation.interpolate(times, q, time_ns[inside])
    nearest = np.minimum(np.searchsorted(times, time_ns), len(times) - 1)
    exact = times[nearest] == time_ns
    result[exact] = q[nearest[exact]]
    return result


def increasing(time_ns: np.ndarray) -> np.ndarray:
    """Rows of instants that are later than all before them.

    Args:
        time_ns: In any order, shape (n,).

    Returns:
        Shape (m,).
    """
    if not len(time_ns):
        return np.zeros(0, dtype=np.int64)
    latest = np.maximum.accumulate(time_ns)
    return np.flatnonzero(np.concatenate([[True], time_ns[1:] > latest[:-1]]))


def software() -> str:
    """Name and version of this package, for the headers of files."""
    try:
        return f"imu-testbench {version('imu-testbench')}"
    except PackageNotFoundError:
        return "imu-testbench"
