"""Static poses: what a triad reads on average while it is still, and what it should have read."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY

SETTLING_M_S2 = 3e-4
"""Standard deviation of a pose's mean beside its noise [m/s^2]: in-run bias of 0.03 mg (data sheet
of the Xsens DOT).
"""
SETTLING_UT = 0.05
"""The same of a magnetometer [uT]: 0.5 mG of RMS noise (data sheet of the Xsens DOT), which need
not be white.
"""
DIRECTION_SD = np.radians(0.03)
"""Standard deviation of the expected direction about each axis across it [rad]: the arm's settling
and repeatability.
"""
FEWEST_SAMPLES = 2


@dataclass(frozen=True)
class StaticPoses:
    """Mean readings of one triad in m poses at rest.

    The unit is m/s^2 for an accelerometer, uT for a magnetometer.

    Attributes:
        mean: Shape (m, 3) [unit].
        variance: Of each mean, shape (m, 3): that of the samples over their number, plus a floor.
        magnitude: Length of the true vector, the same in all poses; NaN where nobody knows it.
        expected: The true vector in the sensor axes as believed, shape (m, 3), or None.
        direction_sd: Standard deviation of its direction [rad].
        vertical: Upward unit vector in the sensor axes, by the calibrated accelerometer, shape (m,
            3), or None; for a magnetometer.
        vertical_sd: Standard deviation of its direction [rad].
        temperature: Shape (m,) [deg C], or None.
        start: When each pose began, shape (m,) [s].
        end: When each pose ended, shape (m,) [s].
        count: Samples of each, shape (m,).
        shared: What errors that last all session change of `expected`, each off by its standard
            uncertainty, shape (m, q, 3) [unit], or None where they are not known.

    Raises:
        InputError: A variance is not above 0.
        ValueError: Shapes do not fit.
    """

    mean: np.ndarray
    variance: np.ndarray
    magnitude: float = STANDARD_GRAVITY
    expected: np.ndarray | None = None
    direction_sd: float = float(DIRECTION_SD)
    vertical: np.ndarray | None = None
    vertical_sd: float = 0.0
    temperature: np.ndarray | None = None
    start: np.ndarray | None = None
    end: np.ndarray | None = None
    count: np.ndarray | None = None
    shared: np.ndarray | None = None

    def __post_init__(self) -> None:
        m = len(self.mean)
        shapes = {"mean": (m, 3), "variance": (m, 3), "expected": (m, 3), "vertical": (m, 3)}
        for name in (
            "mean",
            "variance",
            "expected",
            "vertical",
            "temperature",
            "start",
            "end",
            "count",
        ):
            array = getattr(self, name)
            if array is not None and array.shape != shapes.get(name, (m,)):
                raise ValueError(f"{m} poses cannot have {name} of shape {array.shape}")
        if self.shared is not None and self.shared.shape[::2] != (m, 3):
            raise ValueError(f"{m} poses cannot have shared errors of shape {self.shared.shape}")
        if not (self.variance > 0).all():
            raise InputError(
                "a pose whose samples are all the same has no variance; give a floor above 0"
            )

    def __len__(self) -> int:
        return len(self.mean)

    def subset(self, index: np.ndarray) -> StaticPoses:
        """Some of the poses.

        Args:
            index: Mask of shape (m,), or indices of shape (k,).
        """
        arrays = {item.name: getattr(self, item.name) for item in fields(self)}
        return replace(
            self, **{name: a[index] for name, a in arrays.items() if isinstance(a, np.ndarray)}
        )

    def need_expected(self, method: str) -> np.ndarray:
        """The expected vectors.

        Raises:
            InputError: There are none.
        """
        if self.expected is None:
            raise InputError(
                f"the method {method} needs poses whose orientation is known; allowed without: "
                "norm_only, ellipsoid"
            )
        return self.expected

    def covariance(self) -> np.ndarray:
        """Of each mean reading about what the expected vector lets expect, shape (m, 3, 3).

        Noise is along the axes; an error of the expected direction lies across it and leaves its
        length alone.
        """
        toward = self.mean if self.expected is None else self.expected
        u = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        length = (
            self.magnitude
            if np.isfinite(self.magnitude)
            else float(np.linalg.norm(toward, axis=1).mean())
        )
        across = (length * self.direction_sd) ** 2 * (np.eye(3) - u[:, :, None] * u[:, None, :])
        return np.asarray(across + np.eye(3) * self.variance[:, None, :])

    def typical_sd(self) -> float:
        """Standard deviation of a mean reading, RMS over poses and axes.

        For methods by which all poses count alike.
        """
        return float(np.sqrt(np.trace(self.covariance(), axis1=1, axis2=2).mean() / 3))


@dataclass(frozen=True)
class TrueVector:
    """What is known of the vector that a triad measures, in k still intervals.

    Attributes:
        magnitude: Its length, the same in all [unit]; NaN where nobody knows it.
        expected: The vector in the sensor axes as believed, shape (k, 3) [unit], or None.
        shared: As in `StaticPoses`, shape (k, q, 3) [unit], or None.
        vertical: Upward unit vector in the sensor axes, shape (k, 3), or None.
        vertical_sd: Standard deviation of the direction of `vertical` [rad].
    """

    magnitude: float = STANDARD_GRAVITY
    expected: np.ndarray | None = None
    vertical: np.ndarray | None = None
    vertical_sd: float = 0.0
    shared: np.ndarray | None = None


def static_poses(
    samples: np.ndarray,
    intervals: np.ndarray,
    *,
    times: np.ndarray,
    true: TrueVector = TrueVector(),
    floor: float = SETTLING_M_S2,
    temperature: np.ndarray | None = None,
) -> StaticPoses:
    """Means over still intervals.

    Args:
        samples: Readings, shape (n, 3) [unit]; rows with NaN are left out.
        intervals: Begin and end (exclusive) of k still intervals, in samples, shape (k, 2).
        times: Of the samples, shape (n,) [s].
        true: What the triad should have read.
        floor: Standard deviation of a mean beside its noise [unit].
        temperature: Of the samples, shape (n,) [deg C]; NaN where unknown.

    Raises:
        InputError: No interval holds two samples, or samples do not vary and the floor is 0.
    """
    known = np.isfinite(samples).all(axis=1)
    rows = [first + np.flatnonzero(known[first:last]) for first, last in np.asarray(intervals, int)]
    kept = [i for i, row in enumerate(rows) if len(row) >= FEWEST_SAMPLES]
    if not kept:
        raise InputError(
            f"none of {len(rows)} intervals holds two samples at rest; there is no static pose to "
            "calibrate from"
        )
    rows = [rows[i] for i in kept]
    mean_temperature = None
    if temperature is not None:
        mean_temperature = np.array([np.mean(temperature[row]) for row in rows])
        if not np.isfinite(mean_temperature).all():
            mean_temperature = None
    return StaticPoses(
        mean=np.array([samples[row].mean(axis=0) for row in rows]),
        variance=np.array([samples[row].var(axis=0, ddof=1) / len(row) for row in rows]) + floor**2,
        magnitude=true.magnitude,
        expected=None if true.expected is None else np.asarray(true.expected)[kept],
        shared=None if true.shared is None else np.asarray(true.shared)[kept],
        vertical=None if true.vertical is None else np.asarray(true.vertical)[kept],
        vertical_sd=true.vertical_sd,
        temperature=mean_temperature,
        start=np.array([times[row[0]] for row in rows]),
        end=np.array([times[row[-1]] for row in rows]),
        count=np.array([len(row) for row in rows]),
    )
