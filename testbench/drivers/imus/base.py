"""What the bench asks of an inertial sensor, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from testbench.records.samples import ImuSamples
from testbench.records.session import Event


class Imu(ABC):
    """A sensor that records by itself and hands over its samples.

    Attributes:
        rate: Nominal output rate [Hz].
        has_magnetometer: What its samples hold.
        has_orientation: What its samples hold.
        has_temperature: What its samples hold.
    """

    rate: float
    has_magnetometer: bool
    has_orientation: bool
    has_temperature: bool = False

    @abstractmethod
    def kickoff(self) -> None:
        """Begin to record."""

    @abstractmethod
    def read(self, until_ns: int) -> ImuSamples:
        """What was sampled since the last call, up to a host time; waits for it where time is
        real.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop recording, from any state; a second call does nothing."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """What the manifest should say of this sensor."""

    def columns(self) -> dict[str, Any]:
        """Columns of its samples on disk, with their types."""
        return ImuSamples.columns(self.has_magnetometer, self.has_orientation, self.has_temperature)

    def events(self) -> list[Event]:
        """What happened to the device since the last call, such as a lost connection; nothing by
        default.
        """
        return []
