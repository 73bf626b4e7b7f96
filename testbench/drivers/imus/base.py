"""What the bench asks of an inertial sensor, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Event


class Imu(ABC):
    """A sensor that records by itself and hands over its samples.

    Attributes:
        rate: Nominal output rate [Hz].
        has_magnetometer: Whether its samples hold the magnetic field.
        has_orientation: Whether its samples hold orientations of the device's own.
        has_temperature: Whether its samples hold a temperature.
    """

    rate: float
    has_magnetometer: bool
    has_orientation: bool
    has_temperature: bool = False

    def connect(self) -> None:  # noqa: B027 - nothing to do for a device on a wire
        """Make the link to the device, where that takes long; it does not record yet.

        All devices can then begin together.
        """

    def trial(self) -> Imu | None:
        """The same device once more, to hear whether it delivers before anything depends on it.

        Must be stopped before this one begins. None where connecting shows that.
        """
        return None

    def wait_for_sample(self, name: str) -> None:  # noqa: B027 - only trials wait
        """Wait until a trial has delivered a sample.

        Args:
            name: Of the sensor, for the message.

        Raises:
            DriverError: None came; says what came instead.
        """

    @abstractmethod
    def kickoff(self) -> None:
        """Begin to record."""

    @abstractmethod
    def read(self, until_ns: int) -> ImuSamples:
        """What was sampled since the last call, up to a host time.

        Waits for that time where time is real.
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
        """What happened to the device since the last call; nothing by default."""
        return []

    def statistics(self) -> dict[str, int]:
        """Numbers of samples and of events by their kinds so far; nothing by default."""
        return {}
