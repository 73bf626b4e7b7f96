"""Fusion: Madgwick's revised AHRS algorithm, from its author's package."""

from __future__ import annotations

import imufusion
import numpy as np

from testbench.estimation.filters.base import OrientationFilter, Run, UniformSamples
from testbench.estimation.filters.madgwick import tilt
from testbench.frames import STANDARD_GRAVITY


class Fusion(OrientationFilter):
    """x-io Fusion without magnetometer: arbitrary heading, accelerometer and gyroscope only."""

    name, needs = "fusion", ("gyr", "acc")
    source = "Madgwick, PhD thesis, University of Bristol, 2014, chapter 7; package imufusion"
    parameters = {"gain": 0.5, "acceleration_rejection_deg": 10.0, "rejection_timeout_s": 5.0}  # the package's own example

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        return self.begin(samples.interval)(samples)

    def begin(self, interval: float) -> Run:
        """See OrientationFilter."""
        settings = imufusion.AhrsSettings()
        settings.convention = imufusion.CONVENTION_ENU
        settings.gain = self.parameters["gain"]
        settings.acceleration_rejection = self.parameters["acceleration_rejection_deg"]
        settings.rejection_timeout = self.parameters["rejection_timeout_s"]
        settings.sample_rate = 1.0 / interval
        ahrs = imufusion.Ahrs()
        ahrs.set_settings(settings)
        started = False

        def run(samples: UniformSamples) -> np.ndarray:
            nonlocal started
            if not started:
                ahrs.set_quaternion(tilt(samples.acc[0]))  # from its own start, the identity, it never leaves a headstand
                started = True
            q = np.empty((len(samples.gyr), 4))
            rates, forces = np.degrees(samples.gyr), samples.acc / STANDARD_GRAVITY
            for i in range(len(q)):
                ahrs.update_no_magnetometer(rates[i], forces[i])
                q[i] = ahrs.get_quaternion()
            return q

        return run
