"""What every orientation filter takes and gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from testbench.model import rotation


@dataclass(frozen=True)
class UniformSamples:
    """Samples at a regular interval, in the sensor frame.

    Attributes:
        interval: [s]. gyr: Angular rate, shape (n, 3) [rad/s]. acc: Specific force, shape (n, 3) [m/s^2]. mag: Shape (n, 3)
        [uT], or None. device_q: The vendor's q_earth_from_sensor, shape (n, 4), or None.
    """

    interval: float
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray | None = None
    device_q: np.ndarray | None = None

    def has(self, quantity: str) -> bool:
        """Whether a quantity was recorded; one that the file lacks is None, or NaN throughout."""
        array = getattr(self, quantity)
        return array is not None and bool(np.isfinite(array).any())

    def turning(self) -> np.ndarray:
        """Angular rate of the gyroscope, or of the device's orientation without one, shape (n, 3) [rad/s]."""
        if self.has("gyr") or self.device_q is None:
            return self.gyr
        step = rotation.multiply(rotation.conjugate(self.device_q[:-1]), self.device_q[1:])
        return np.vstack([np.zeros((1, 3)), rotation.to_rotation_vector(step) / self.interval])


Run = Callable[[UniformSamples], np.ndarray]
"""Takes the next samples and gives q_earth_from_sensor at each of them, shape (n, 4)."""


class OrientationFilter(ABC):
    """Turns samples into orientations.

    Attributes:
        name: As protocols spell it. needs: Of "gyr", "acc", "mag", "device_q". source: Publication or package.
        parameters: Those it runs with, for the record.
    """

    name: ClassVar[str]
    needs: ClassVar[tuple[str, ...]]
    source: ClassVar[str]
    parameters: ClassVar[dict[str, float]] = {}

    @abstractmethod
    def run(self, samples: UniformSamples) -> np.ndarray:
        """Orientation at every sample.

        Returns:
            q_earth_from_sensor, w x y z, shape (n, 4). Earth has z up; its heading is ENU with a magnetometer, else arbitrary.
        """

    def begin(self, interval: float) -> Run | None:
        """A run that takes samples piece by piece and goes on from piece to piece; None where a filter needs all at once.

        Args:
            interval: Of the samples [s].
        """
        return None

    def missing(self, samples: UniformSamples) -> list[str]:
        """What this filter needs and the samples lack."""
        return [need for need in self.needs if not samples.has(need)]
