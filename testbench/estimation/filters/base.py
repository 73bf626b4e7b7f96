"""What every orientation filter takes and gives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from testbench.exceptions import InputError, NotFoundError
from testbench.model import rotation

FilterState = dict[str, Any]
"""All that a filter remembers after a sample, by name, as JSON can hold it.

`filter` names the filter it belongs to. A filter that estimates the gyroscope's bias has it under
`gyr_bias_rad_s`.
"""


Sampling = Literal["native", "uniform", "memoryless"]


@dataclass(frozen=True)
class Parameter:
    """One setting of a filter.

    Attributes:
        name: With its unit, as protocols spell it.
        default: Value that it has unless another is given.
        unit: Of the value, for people.
        meaning: What it sets, in words.
        source: Where the default comes from.
        low: Lower end of the plausible range, for tuning.
        high: Upper end of the plausible range, for tuning.
        scale: How to walk through the range; a "switch" is 0 or 1.
        least: Smallest value that is allowed.
        most: Largest value that is allowed.
    """

    name: str
    default: float
    unit: str
    meaning: str
    source: str
    low: float
    high: float
    scale: Literal["log", "linear", "switch"] = "log"
    least: float = 0.0
    most: float = float("inf")

    def refusal(self, value: float) -> str | None:
        """What is wrong with a value, or None."""
        if not np.isfinite(value):
            return f"{self.name} is {value}; it must be a finite number"
        if self.scale == "switch" and value not in (0, 1):
            return f"{self.name} is {value:g}; a switch is 0 (off) or 1 (on)"
        if not self.least <= value <= self.most:
            allowed = (
                f"between {self.least:g} and {self.most:g}"
                if np.isfinite(self.most)
                else f"at least {self.least:g}"
            )
            unit = "" if self.unit == "1" else f" {self.unit}"
            return f"{self.name} is {value:g}{unit}; it must be {allowed}"
        return None


def switch(name: str, default: bool, meaning: str, source: str) -> Parameter:
    """A setting that is on or off."""
    return Parameter(name, float(default), "0 or 1", meaning, source, 0.0, 1.0, "switch", 0.0, 1.0)


@dataclass(frozen=True)
class UniformSamples:
    """Samples in the sensor frame, on a grid as regular as the sensor's clock.

    Attributes:
        interval: Mean time between samples [s].
        gyr: Angular rate, shape (n, 3) [rad/s]; mean over the interval before its sample.
        acc: Specific force, shape (n, 3) [m/s^2].
        mag: Shape (n, 3) [uT], or None.
        device_q: The vendor's q_earth_from_sensor, shape (n, 4), or None.
        intervals: Time before each sample, shape (n,) [s], where they differ.
    """

    interval: float
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray | None = None
    device_q: np.ndarray | None = None
    intervals: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.gyr)

    def has(self, quantity: str) -> bool:
        """Whether a quantity was recorded; one that the file lacks is None, or NaN throughout."""
        array = getattr(self, quantity)
        return array is not None and bool(np.isfinite(array).any())

    def having(self) -> UniformSamples:
        """One row that has what these have; see `has`."""

        def row(key: str, size: int = 3) -> np.ndarray:
            return np.full((1, size), 0.0 if self.has(key) else np.nan)

        mag = None if self.mag is None else row("mag")
        device_q = None if self.device_q is None else row("device_q", 4)
        return UniformSamples(self.interval, row("gyr"), row("acc"), mag, device_q)

    def steps(self) -> np.ndarray:
        """Time before each sample, shape (n,) [s]."""
        return (
            np.full(len(self), self.interval)
            if self.intervals is None
            else np.asarray(self.intervals, float)
        )

    def piece(self, rows: slice) -> UniformSamples:
        """Some consecutive samples."""
        mag = None if self.mag is None else self.mag[rows]
        device_q = None if self.device_q is None else self.device_q[rows]
        intervals = None if self.intervals is None else self.intervals[rows]
        return UniformSamples(
            self.interval, self.gyr[rows], self.acc[rows], mag, device_q, intervals
        )

    def angular_rate(self) -> np.ndarray:
        """Angular rate by the gyroscope, else by the device's orientation, shape (n, 3) [rad/s]."""
        if self.has("gyr") or self.device_q is None:
            return self.gyr
        step = rotation.multiply(rotation.conjugate(self.device_q[:-1]), self.device_q[1:])
        return np.vstack([np.zeros((1, 3)), rotation.to_rotation_vector(step) / self.interval])


class OrientationFilter(ABC):
    """Turns samples into orientations; an instance remembers its parameters and nothing else.

    Attributes:
        name: As protocols spell it.
        needs: Of "gyr", "acc", "mag", "device_q".
        source: Publication or package.
        PARAMETERS: Those it has.
        parameters: Their values in this instance.
        sampling: "native" where each sample's own interval is used, "uniform" where irregular
            samples are interpolated to a regular grid and the orientations back, "memoryless" where
            the interval does not matter.
        causal: Whether a sample's orientation depends on nothing later.
        behaviour: What is known of it, in a sentence.
        known_faults: Why it cannot pass the self-test, for those that repeat a publication with its
            errors.
    """

    name: ClassVar[str]
    needs: ClassVar[tuple[str, ...]]
    source: ClassVar[str]
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = ()
    sampling: ClassVar[Sampling] = "uniform"
    causal: ClassVar[bool] = True
    behaviour: ClassVar[str] = ""
    known_faults: ClassVar[str] = ""

    def __init__(self, parameters: Mapping[str, float] | None = None):
        """Choose parameters.

        Args:
            parameters: Those that differ from the defaults, by name.

        Raises:
            NotFoundError: An unknown name; lists those that exist.
            InputError: A value that is not allowed.
        """
        values = {parameter.name: float(parameter.default) for parameter in self.PARAMETERS}
        for key, value in (parameters or {}).items():
            if key not in values:
                raise NotFoundError(f"parameter of the filter {self.name}", str(key), list(values))
            refusal = next(p for p in self.PARAMETERS if p.name == key).refusal(value)
            if refusal is not None:
                raise InputError(f"filter {self.name}: {refusal}")
            values[key] = float(value)
        self.parameters: dict[str, float] = values

    @abstractmethod
    def run(self, samples: UniformSamples) -> np.ndarray:
        """Orientation at every sample of a recording.

        Returns:
            q_earth_from_sensor, w x y z, shape (n, 4). Earth has z up; its heading is ENU with a
            magnetometer, else arbitrary.
        """

    def advance(
        self, samples: UniformSamples, state: FilterState | None = None
    ) -> tuple[np.ndarray, FilterState]:
        """Orientation at every sample of a chunk of a recording, which may be a single sample.

        Args:
            samples: The chunk.
            state: What this returned for the chunk before; None at the beginning.

        Returns:
            q_earth_from_sensor, shape (n, 4), and the state after the last sample. Chunks give what
            the whole gives.

        Raises:
            InputError: The filter cannot work by chunks, or the state is another filter's.
        """
        raise InputError(f"the filter {self.name} needs the whole recording at once")

    def knows_heading(self, samples: UniformSamples) -> bool:
        """Whether its heading is that of the field or the vendor's, and so no other after it began
        anew.
        """
        return "mag" in self.needs or "device_q" in self.needs

    def missing(self, samples: UniformSamples) -> list[str]:
        """What this filter needs and the samples lack."""
        return [need for need in self.needs if not samples.has(need)]


class RecursiveFilter(OrientationFilter):
    """A filter that goes from sample to sample, and can be stopped and resumed."""

    @abstractmethod
    def advance(
        self, samples: UniformSamples, state: FilterState | None = None
    ) -> tuple[np.ndarray, FilterState]:
        """See OrientationFilter."""

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        if samples.intervals is not None and self.sampling == "uniform":
            return on_regular_grid(self, samples)
        return self.advance(samples)[0]

    def check_state(self, state: FilterState) -> None:
        """Refuse the state of another filter."""
        if state.get("filter") != self.name:
            raise InputError(
                f"the filter {self.name} cannot resume the state of "
                f"{state.get('filter', 'no filter')}"
            )


def on_regular_grid(kind: OrientationFilter, samples: UniformSamples) -> np.ndarray:
    """Run a filter for regular sampling on irregular samples.

    The samples are interpolated linearly, the orientations back on the sphere.
    """
    time = np.cumsum(samples.steps())
    count = len(samples)
    if count < 2:
        return kind.run(replace(samples, intervals=None))
    grid = np.linspace(time[0], time[-1], count)

    def spread(array: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(grid, time, column) for column in array.T])

    mag = None if samples.mag is None else spread(samples.mag)
    device_q = (
        None if samples.device_q is None else rotation.interpolate(time, samples.device_q, grid)
    )
    regular = UniformSamples(
        float(grid[1] - grid[0]), spread(samples.gyr), spread(samples.acc), mag, device_q
    )
    return rotation.interpolate(grid, kind.run(regular), time)
