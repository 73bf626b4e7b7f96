"""The vendor's own filter, as the device reports it."""

from __future__ import annotations

import numpy as np

from testbench.estimation.filters.base import OrientationFilter, Run, UniformSamples


class Device(OrientationFilter):
    """The orientation that the sensor itself reports."""

    name, needs, source = "device", ("device_q",), "the sensor's firmware"

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        assert samples.device_q is not None
        return samples.device_q

    def begin(self, interval: float) -> Run:
        """See OrientationFilter."""
        return self.run
