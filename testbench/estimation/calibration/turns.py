"""What a gyroscope is calibrated from: rests, and the turns between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from testbench.exceptions import InputError
from testbench.model.integrators import Stages, get_integrator


@dataclass(frozen=True)
class Rest:
    """A still interval.

    Attributes:
        gyr: Raw readings, shape (n, 3) [rad/s].
        force: Specific force felt, shape (3,) [m/s^2]; None where nobody knows.
        temperature: Of the part, shape (n,) [deg C], or None.
        time: Of the readings, shape (n,) [s], or None.
    """

    gyr: np.ndarray
    force: np.ndarray | None = None
    temperature: np.ndarray | None = None
    time: np.ndarray | None = None

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
        time: Of the readings, shape (n,) [s].
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
    time: np.ndarray | None = None

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

    def every(self, count: int) -> Turn:
        """The turn as a sensor would have read it that takes only one sample of so many.

        The last one counted ends it; what comes after is at rest.

        Raises:
            InputError: Fewer than two samples would be left.
        """

        def thinned(array: np.ndarray | None) -> np.ndarray | None:
            return None if array is None else array[::count]

        return replace(
            self,
            gyr=self.gyr[::count],
            interval=count * self.interval,
            q_world_from_sensor=thinned(self.q_world_from_sensor),
            rate=thinned(self.rate),
            force=thinned(self.force),
            temperature=thinned(self.temperature),
            time=thinned(self.time),
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
            time=cut(self.time),
        )


def _at_reference(
    gyr: np.ndarray, temperature: np.ndarray | None, drift: np.ndarray, reference: float
) -> np.ndarray:
    if temperature is None:
        return gyr
    return np.asarray(gyr - np.nan_to_num(temperature - reference)[:, None] * drift)


def _bent(part: Rest | Turn, axis: int, cubic: float) -> np.ndarray:
    """Readings without a term of the third power along one axis."""
    gyr = part.gyr.copy()
    gyr[:, axis] -= cubic * gyr[:, axis] ** 3
    return gyr


@dataclass(frozen=True)
class TurnSettings:
    """How turns are integrated where somebody says so; None leaves it to the method.

    Attributes:
        angle: Of the known turns of `ferraris_gyroscope` [rad].
        integrator: As `testbench.model.integrators` names it.
        stages: Where its rates inside a step come from.
        g_sensitivity: Whether the response to specific force is fitted too.
        every: Only one sample of so many is taken.
    """

    angle: float | None = None
    integrator: str | None = None
    stages: Stages | None = None
    g_sensitivity: bool | None = None
    every: int = 1

    def __post_init__(self) -> None:
        if self.every < 1:
            raise InputError(f"every {self.every}th sample of a turn: there is none; from 1 on")
        if self.integrator is not None:
            get_integrator(self.integrator)

    @property
    def of_integration(self) -> dict[str, object]:
        """What is said of the integration, by the names that methods take it by."""
        said = {
            "integrator": self.integrator,
            "stages": self.stages,
            "g_sensitivity": self.g_sensitivity,
        }
        return {name: value for name, value in said.items() if value is not None}


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

    def every(self, count: int) -> GyroscopeRecording:
        """All turns as of a sensor that takes only one sample of so many."""
        return self if count == 1 else replace(self, turns=[t.every(count) for t in self.turns])

    def without_cubic(self, axis: int, cubic: float) -> GyroscopeRecording:
        """All readings without a term of the third power.

        Args:
            axis: Along which.
            cubic: Its factor [1/(rad/s)^2].
        """
        return GyroscopeRecording(
            [replace(rest, gyr=_bent(rest, axis, cubic)) for rest in self.rests],
            [replace(turn, gyr=_bent(turn, axis, cubic)) for turn in self.turns],
        )
