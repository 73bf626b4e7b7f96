"""What a gyroscope is calibrated from: rests, and the turns between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from testbench.exceptions import InputError


@dataclass(frozen=True)
class Rest:
    """A still interval.

    Attributes:
        gyr: Raw readings, shape (n, 3) [rad/s].
        force: Specific force felt, shape (3,) [m/s^2]; None where nobody knows.
        temperature: Of the part, shape (n,) [deg C], or None.
    """

    gyr: np.ndarray
    force: np.ndarray | None = None
    temperature: np.ndarray | None = None

    def without_drift(self, drift: np.ndarray, reference: float) -> Rest:
        """The readings as they would be at another temperature.

        Args:
            drift: Of the bias, shape (3,) [rad/s/K].
            reference: The temperature [deg C].
        """
        return replace(self, gyr=_at_reference(self.gyr, self.temperature, drift, reference))


@dataclass(frozen=True)
class Turn:
    """A motion from rest to rest.

    What is known of it decides which methods can use it; each is None where nobody knows.

    Attributes:
        gyr: Raw readings, shape (n, 3) [rad/s], n >= 2, the first and the last at rest.
        interval: Between them [s].
        up_before: Unit vector of the specific force in the rest before, shape (3,), in the axes
            that the calibration shall give, such as those of a calibrated accelerometer.
        up_after: The same in the rest after, shape (3,).
        q_world_from_sensor: At every sample, shape (n, 4).
        rate: True rate in those axes, shape (n, 3) [rad/s].
        force: Specific force, shape (n, 3) [m/s^2].
        up_sd: Standard uncertainty of either direction about each axis [rad].
        attitude_sd: Standard uncertainty of an attitude about each axis [rad].
        temperature: Of the part, shape (n,) [deg C].
    """

    gyr: np.ndarray
    interval: float
    up_before: np.ndarray | None = None
    up_after: np.ndarray | None = None
    q_world_from_sensor: np.ndarray | None = None
    rate: np.ndarray | None = None
    force: np.ndarray | None = None
    up_sd: float = 0.0
    attitude_sd: float = 0.0
    temperature: np.ndarray | None = None

    def without_drift(self, drift: np.ndarray, reference: float) -> Turn:
        """The readings as they would be at another temperature.

        Args:
            drift: Of the bias, shape (3,) [rad/s/K].
            reference: The temperature [deg C].
        """
        return replace(self, gyr=_at_reference(self.gyr, self.temperature, drift, reference))

    def __post_init__(self) -> None:
        if self.gyr.ndim != 2 or self.gyr.shape[1] != 3 or len(self.gyr) < 2:
            raise InputError(
                "a turn needs two samples of three axes at least, not an array of shape "
                f"{self.gyr.shape}"
            )
        for name, width in (("q_world_from_sensor", 4), ("rate", 3), ("force", 3)):
            array = getattr(self, name)
            if array is not None and array.shape != (len(self.gyr), width):
                raise InputError(
                    f"{name} of a turn of {len(self.gyr)} samples cannot have the shape "
                    f"{array.shape}"
                )

    def part(self, begin: int, end: int) -> Turn:
        """The samples from `begin` up to `end`, without the directions at its ends."""

        def cut(array: np.ndarray | None) -> np.ndarray | None:
            return None if array is None else array[begin:end]

        known = (cut(self.q_world_from_sensor), cut(self.rate), cut(self.force))
        return Turn(
            self.gyr[begin:end],
            self.interval,
            None,
            None,
            *known,
            attitude_sd=self.attitude_sd,
            temperature=cut(self.temperature),
        )


def _at_reference(
    gyr: np.ndarray, temperature: np.ndarray | None, drift: np.ndarray, reference: float
) -> np.ndarray:
    if temperature is None:
        return gyr
    return np.asarray(gyr - np.nan_to_num(temperature - reference)[:, None] * drift)


@dataclass(frozen=True)
class GyroscopeRecording:
    """All that a calibration is made from."""

    rests: Sequence[Rest] = field(default=())
    turns: Sequence[Turn] = field(default=())

    def without_drift(self, drift: np.ndarray, reference: float) -> GyroscopeRecording:
        """All readings as they would be at another temperature.

        Args:
            drift: Of the bias, shape (3,) [rad/s/K].
            reference: The temperature [deg C].
        """
        return GyroscopeRecording(
            [rest.without_drift(drift, reference) for rest in self.rests],
            [turn.without_drift(drift, reference) for turn in self.turns],
        )


def turns_between_rests(
    gyr: np.ndarray,
    interval: float,
    rests: Sequence[tuple[int, int]],
    acc: np.ndarray,
    up_sd: float = 0.0,
    margin: int = 0,
) -> GyroscopeRecording:
    """Cut a recording at its rests, with the direction of gravity by the accelerometer in each.

    Args:
        gyr: Raw, at a regular interval, shape (n, 3) [rad/s].
        interval: Between samples [s].
        rests: Begin and end (exclusive) of each rest, as rows of `gyr`, m of them.
        acc: Mean calibrated specific force in each rest, shape (m, 3) [m/s^2].
        up_sd: Standard uncertainty of the force's direction about each axis [rad].
        margin: Samples by which a turn reaches into the rests at its ends, at most half of each.

    Raises:
        InputError: A rest without samples, rests out of order, or not one force for each sample.
    """
    if acc.shape != gyr.shape:
        raise InputError(
            f"angular rates of shape {gyr.shape} and forces of shape {acc.shape} do not belong "
            "together"
        )
    borders = np.array(rests, dtype=int).reshape(-1, 2)
    if (
        (np.diff(borders, axis=1) <= 0).any()
        or (borders[1:, 0] < borders[:-1, 1]).any()
        or (borders > len(gyr)).any()
    ):
        raise InputError(
            "rests must hold samples, lie within the recording, follow one another and not overlap"
        )
    force = np.array([acc[begin:end].mean(axis=0) for begin, end in borders]).reshape(-1, 3)
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    reach = [min(margin, (end - begin) // 2) for begin, end in borders]
    turns = []
    for i in range(len(borders) - 1):
        begin, end = borders[i, 1] - 1 - reach[i], borders[i + 1, 0] + 1 + reach[i + 1]
        turns.append(
            Turn(gyr[begin:end], interval, up[i], up[i + 1], force=acc[begin:end], up_sd=up_sd)
        )
    return GyroscopeRecording(
        [Rest(gyr[b:e], f) for (b, e), f in zip(borders, force, strict=True)], turns
    )
