"""Samples of an arm and of an IMU, as columns in memory and on disk."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")


def names(prefix: str, suffix: str = "", parts: tuple[str, ...] = AXES) -> list[str]:
    """Column names such as gyr_x_rad_s."""
    return [f"{prefix}_{part}{suffix}" for part in parts]


def split(columns: list[str], array: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an array by name.

    Args:
        columns: Their names.
        array: Shape (n, k).

    Returns:
        Each of shape (n,).
    """
    return {name: np.ascontiguousarray(array[:, i]) for i, name in enumerate(columns)}


def join(table: dict[str, np.ndarray], columns: list[str]) -> np.ndarray:
    """Columns of a table side by side, shape (n, k).

    Args:
        table: Columns by name, each of shape (n,).
        columns: Those wanted, k of them.
    """
    return np.column_stack([table[name] for name in columns])


@dataclass(frozen=True)
class ArmSamples:
    """What an arm reported.

    Attributes:
        joint_names: In the robot's order.
        host_time_ns: Shape (n,), int64.
        q_sent: Angles as commanded, shape (n, n_joints) [rad].
        q_measured: Angles by the encoders, shape (n, n_joints) [rad].
        v_measured: Rates by the encoders, shape (n, n_joints) [rad/s].
        extras: What else the arm reported, column name (with its unit) to array of shape (n,); kept
            on disk, read by nothing that computes.
    """

    joint_names: list[str]
    host_time_ns: np.ndarray
    q_sent: np.ndarray
    q_measured: np.ndarray
    v_measured: np.ndarray
    extras: dict[str, np.ndarray] = field(default_factory=dict)

    @staticmethod
    def columns(joint_names: list[str]) -> dict[str, Any]:
        """Column names and types on disk."""
        own = ArmSamples._groups(joint_names)
        return {"host_time_ns": np.int64} | {name: np.float64 for group in own for name in group}

    @staticmethod
    def _groups(joint_names: list[str]) -> list[list[str]]:
        kinds = (("q_sent", "_rad"), ("q_measured", "_rad"), ("v_measured", "_rad_s"))
        return [[f"{kind}_{joint}{unit}" for joint in joint_names] for kind, unit in kinds]

    def to_columns(self) -> dict[str, np.ndarray]:
        """As columns for disk."""
        arrays = (self.q_sent, self.q_measured, self.v_measured)
        result = {"host_time_ns": self.host_time_ns}
        for group, array in zip(self._groups(self.joint_names), arrays, strict=True):
            result |= split(group, array)
        return result | self.extras

    @staticmethod
    def groups(joint_names: list[str]) -> dict[str, str | list[str]]:
        """Which columns on disk stand side by side in each attribute."""
        sent, measured, rates = ArmSamples._groups(joint_names)
        return {
            "host_time_ns": "host_time_ns",
            "q_sent": sent,
            "q_measured": measured,
            "v_measured": rates,
        }

    @staticmethod
    def from_columns(table: dict[str, np.ndarray], joint_names: list[str]) -> ArmSamples:
        """Samples of columns on disk.

        Args:
            table: Columns by name, each of shape (n,).
            joint_names: In the robot's order.
        """
        sent, measured, rates = (join(table, group) for group in ArmSamples._groups(joint_names))
        return ArmSamples(joint_names, table["host_time_ns"], sent, measured, rates)


GYR, ACC, MAG = names("gyr", "_rad_s"), names("acc", "_m_s2"), names("mag", "_uT")
DEVICE_Q = names("device_q", "", QUATERNION)
TEMPERATURE = "temperature_deg_c"


TABLE_UNITS = {"units": "the suffix of each column; times in nanoseconds"}
IMU_NOTES = {
    "content": "raw samples of an inertial sensor, in the sensor frame",
    "device_q": "q_earth_from_sensor of the vendor's filter, w x y z, Hamilton",
    **TABLE_UNITS,
}
"""What a table of `ImuSamples` says of itself."""


@dataclass(frozen=True)
class ImuSamples:
    """What an IMU reported; every vector in the sensor frame.

    Attributes:
        device_time_ns: By the sensor's own clock, shape (n,), int64.
        host_time_ns: Arrival at the host, shape (n,), int64.
        gyr: Angular rate, shape (n, 3) [rad/s].
        acc: Specific force, shape (n, 3) [m/s^2].
        mag: Magnetic field, shape (n, 3) [uT], or None.
        device_q: q_earth_from_sensor of the vendor's filter, shape (n, 4), or None.
        counter: Sample counter, shape (n,).
        saturated: Whether an axis was at full scale, shape (n,), bool.
        temperature: Of the part, shape (n,) [deg C], or None.
    """

    device_time_ns: np.ndarray
    host_time_ns: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray | None
    device_q: np.ndarray | None
    counter: np.ndarray
    saturated: np.ndarray
    temperature: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.device_time_ns)

    def rows(self, rows: np.ndarray | slice) -> ImuSamples:
        """Some of the samples.

        Args:
            rows: Their indices, a mask of shape (n,), or a slice.
        """
        columns = {key: column for key, column in vars(self).items() if column is not None}
        return ImuSamples.from_groups({key: column[rows] for key, column in columns.items()})

    @staticmethod
    def columns(mag: bool, device_q: bool, temperature: bool = False) -> dict[str, Any]:
        """Column names and types on disk."""
        result: dict[str, Any] = {
            "device_time_ns": np.int64,
            "host_time_ns": np.int64,
            "counter": np.int64,
        }
        vectors = (
            GYR
            + ACC
            + (MAG if mag else [])
            + (DEVICE_Q if device_q else [])
            + ([TEMPERATURE] if temperature else [])
        )
        return result | dict.fromkeys(vectors, np.float64) | {"saturated": np.bool_}

    def to_columns(self) -> dict[str, np.ndarray]:
        """As columns for disk."""
        result = {
            "device_time_ns": self.device_time_ns,
            "host_time_ns": self.host_time_ns,
            "counter": self.counter,
        }
        result |= split(GYR, self.gyr) | split(ACC, self.acc)
        if self.mag is not None:
            result |= split(MAG, self.mag)
        if self.device_q is not None:
            result |= split(DEVICE_Q, self.device_q)
        if self.temperature is not None:
            result[TEMPERATURE] = self.temperature
        return result | {"saturated": self.saturated}

    @staticmethod
    def groups(names: Sequence[str]) -> dict[str, str | list[str]]:
        """Columns on disk by attribute, those that a table with these columns lacks left out."""
        own: dict[str, str | list[str]] = {
            "device_time_ns": "device_time_ns",
            "host_time_ns": "host_time_ns",
        }
        own |= {
            "gyr": GYR,
            "acc": ACC,
            "mag": MAG,
            "device_q": DEVICE_Q,
            "counter": "counter",
            "saturated": "saturated",
        }
        own |= {"temperature": TEMPERATURE} if TEMPERATURE in names else {}
        return {
            key: group
            for key, group in own.items()
            if key not in {"mag", "device_q"} or group[0] in names
        }

    @staticmethod
    def from_groups(arrays: Mapping[str, np.ndarray]) -> ImuSamples:
        """Samples of arrays by attribute.

        Args:
            arrays: Of the shapes of the attributes; mag, device_q and temperature may be missing.
        """
        return ImuSamples(
            arrays["device_time_ns"],
            arrays["host_time_ns"],
            arrays["gyr"],
            arrays["acc"],
            arrays.get("mag"),
            arrays.get("device_q"),
            arrays["counter"],
            arrays["saturated"],
            arrays.get("temperature"),
        )

    @staticmethod
    def from_columns(table: dict[str, np.ndarray]) -> ImuSamples:
        """Samples of columns on disk.

        Args:
            table: Columns by name, each of shape (n,).
        """
        return ImuSamples(
            table["device_time_ns"],
            table["host_time_ns"],
            join(table, GYR),
            join(table, ACC),
            join(table, MAG) if MAG[0] in table else None,
            join(table, DEVICE_Q) if DEVICE_Q[0] in table else None,
            table["counter"],
            table["saturated"],
            table.get(TEMPERATURE),
        )


TRUTH_Q = names("q_world_from_sensor", "", QUATERNION)
TRUTH_RATE, TRUTH_FORCE = names("rate", "_rad_s"), names("force", "_m_s2")


@dataclass(frozen=True)
class Truth:
    """What a sensor went through, according to the arm's kinematics or an optical system.

    Attributes:
        host_time_ns: Shape (n,), int64.
        q_world_from_sensor: Shape (n, 4), NaN where unknown.
        rate: Angular rate in the sensor frame, shape (n, 3) [rad/s], or None.
        force: Specific force in the sensor frame, shape (n, 3) [m/s^2], or None.
        judged: Whether an error counts there, shape (n,), bool, or None for everywhere.
    """

    host_time_ns: np.ndarray
    q_world_from_sensor: np.ndarray
    rate: np.ndarray | None = None
    force: np.ndarray | None = None
    judged: np.ndarray | None = None

    def to_columns(self) -> dict[str, np.ndarray]:
        """As columns for disk."""
        result = {"host_time_ns": self.host_time_ns} | split(TRUTH_Q, self.q_world_from_sensor)
        if self.rate is not None:
            result |= split(TRUTH_RATE, self.rate)
        if self.force is not None:
            result |= split(TRUTH_FORCE, self.force)
        return result | ({} if self.judged is None else {"judged": self.judged})

    @staticmethod
    def groups(columns: Collection[str]) -> dict[str, str | list[str]]:
        """Which columns on disk stand side by side in each attribute, of those that there are."""
        own: dict[str, str | list[str]] = {
            "host_time_ns": "host_time_ns",
            "q_world_from_sensor": TRUTH_Q,
        }
        own |= {
            key: group
            for key, group in (("rate", TRUTH_RATE), ("force", TRUTH_FORCE))
            if group[0] in columns
        }
        return own | ({"judged": "judged"} if "judged" in columns else {})

    @staticmethod
    def from_columns(table: dict[str, np.ndarray]) -> Truth:
        """A truth of columns on disk.

        Args:
            table: Columns by name, each of shape (n,).
        """
        own = Truth.groups(table)
        return Truth(
            **{
                key: table[group] if isinstance(group, str) else join(table, group)
                for key, group in own.items()
            }
        )


TRUE_ANGLES = [f"{which}_rad" for which in ("first", "second", "third")]


@dataclass(frozen=True)
class TrueAngles:
    """Angles of a joint according to another system, as the joint's own definition writes them.

    Attributes:
        host_time_ns: Increasing, shape (n,), int64.
        angles: The three angles, shape (n, 3) [rad]; NaN where unknown.
    """

    host_time_ns: np.ndarray
    angles: np.ndarray

    @property
    def given(self) -> list[int]:
        """Places of the angles that are known at some time."""
        return np.flatnonzero(np.isfinite(self.angles).any(axis=0)).tolist()

    def to_columns(self) -> dict[str, np.ndarray]:
        """As columns for disk."""
        return {"host_time_ns": self.host_time_ns} | split(TRUE_ANGLES, self.angles)

    @staticmethod
    def from_columns(table: dict[str, np.ndarray]) -> TrueAngles:
        """Angles of columns on disk.

        Args:
            table: Columns by name, each of shape (n,).
        """
        return TrueAngles(table["host_time_ns"], join(table, TRUE_ANGLES))
