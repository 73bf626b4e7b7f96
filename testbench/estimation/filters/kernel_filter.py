"""Filters that are compiled kernels of our own: how arrays, parameters and state reach them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from testbench.estimation.filters.base import FilterState, RecursiveFilter, Sampling, UniformSamples
from testbench.exceptions import InputError


class Readings(NamedTuple):
    """The samples that a kernel goes through, as contiguous arrays of floats.

    Attributes:
        gyr: Angular rate, shape (n, 3) [rad/s]; mean over the interval before its sample.
        acc: Specific force, shape (n, 3) [m/s^2].
        mag: Magnetic field, shape (n, 3) [uT]; zeros where there is no magnetometer.
        dt: Interval before each sample, shape (n,) [s].
    """

    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray
    dt: np.ndarray


class KernelFilter(RecursiveFilter):
    """A recursive filter whose loop over the samples is one compiled function.

    Attributes:
        kernel: Called with the readings, the parameters in the order of PARAMETERS, shape (k,), the
            state as one vector, shape (s,), which it updates, and then `options`; returns
            q_earth_from_sensor, shape (n, 4).
        options: What tells one filter of a kernel from another.
        layout: Names of the parts of the state and their lengths. The first is `started`, 0 until
            the first usable sample.
    """

    sampling: ClassVar[Sampling] = "native"
    kernel: ClassVar[Callable[..., np.ndarray]]
    options: ClassVar[tuple[int, ...]] = ()
    layout: ClassVar[tuple[tuple[str, int], ...]]

    def advance(
        self, samples: UniformSamples, state: FilterState | None = None
    ) -> tuple[np.ndarray, FilterState]:
        """See OrientationFilter."""
        vector = (
            np.zeros(sum(length for _, length in self.layout))
            if state is None
            else self._pack(state)
        )
        gyr = np.ascontiguousarray(samples.gyr, float)
        acc = np.ascontiguousarray(samples.acc, float)
        mag = (
            np.ascontiguousarray(samples.mag, float)
            if samples.mag is not None
            else np.zeros_like(acc)
        )
        readings = Readings(gyr, acc, mag, samples.steps())
        values = np.array(list(self.parameters.values()))
        q = type(self).kernel(readings, values, vector, *self.options)
        return q, self._unpack(vector)

    def _pack(self, state: FilterState) -> np.ndarray:
        self.check_state(state)
        parts: list[Any] = [state.get(name) for name, _ in self.layout]
        if any(
            part is None or len(part) != length
            for part, (_, length) in zip(parts, self.layout, strict=True)
        ):
            raise InputError(
                f"the state of the filter {self.name} is not whole; it has {', '.join(state)}"
            )
        return np.concatenate([np.asarray(part, float) for part in parts])

    def _unpack(self, vector: np.ndarray) -> FilterState:
        state: FilterState = {"filter": self.name}
        values, end = vector.tolist(), 0
        for name, length in self.layout:
            state[name], end = values[end : end + length], end + length
        return state
