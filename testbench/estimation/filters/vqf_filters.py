"""VQF, compiled, from its authors' package, with its default parameters."""

from __future__ import annotations

import numpy as np
from vqf import VQF, offlineVQF

from testbench.estimation.filters.base import OrientationFilter, Run, UniformSamples

SOURCE = "Laidig & Seel, VQF: Highly accurate IMU orientation estimation, Information Fusion 91, 2023; package vqf"


def _arrays(samples: UniformSamples) -> tuple[np.ndarray, np.ndarray]:
    return np.ascontiguousarray(samples.gyr), np.ascontiguousarray(samples.acc)


class Vqf6D(OrientationFilter):
    """VQF without magnetometer: arbitrary heading, gyroscope bias estimated."""

    name, needs, source = "vqf_6d", ("gyr", "acc"), SOURCE

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        return self.begin(samples.interval)(samples)

    def begin(self, interval: float) -> Run:
        """See OrientationFilter."""
        state = VQF(interval)
        return lambda samples: np.asarray(state.updateBatch(*_arrays(samples))["quat6D"])


class Vqf9D(OrientationFilter):
    """VQF with magnetometer and rejection of magnetic disturbance."""

    name, needs, source = "vqf_9d", ("gyr", "acc", "mag"), SOURCE

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        return self.begin(samples.interval)(samples)

    def begin(self, interval: float) -> Run:
        """See OrientationFilter."""
        state = VQF(interval)

        def run(samples: UniformSamples) -> np.ndarray:
            assert samples.mag is not None
            return np.asarray(state.updateBatch(*_arrays(samples), np.ascontiguousarray(samples.mag))["quat9D"])

        return run


class VqfOffline(OrientationFilter):
    """VQF forwards and backwards in time: acausal; with magnetometer where there is one."""

    name, needs, source = "vqf_offline", ("gyr", "acc"), SOURCE

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        mag = None if samples.mag is None else np.ascontiguousarray(samples.mag)
        result = offlineVQF(*_arrays(samples), mag, samples.interval)
        return np.asarray(result["quat6D" if mag is None else "quat9D"])
