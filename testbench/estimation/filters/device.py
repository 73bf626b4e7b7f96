"""The vendor's own filter, as the device reports it."""

from __future__ import annotations

import numpy as np

from testbench.estimation.filters.base import FilterState, RecursiveFilter, UniformSamples


class Device(RecursiveFilter):
    """The orientation that the sensor itself reports."""

    name, needs, source = "device", ("device_q",), "the sensor's firmware"
    sampling = "memoryless"
    behaviour = "A black box; its settings are those of the device."

    def advance(
        self, samples: UniformSamples, state: FilterState | None = None
    ) -> tuple[np.ndarray, FilterState]:
        """See OrientationFilter."""
        assert samples.device_q is not None
        return samples.device_q, {"filter": self.name}
