"""Fusion: Madgwick's revised AHRS algorithm, from its author's package."""

from __future__ import annotations

from typing import Any, ClassVar

import imufusion
import numpy as np

from testbench.estimation.filters.base import FilterState, Parameter, RecursiveFilter, UniformSamples
from testbench.estimation.filters.maths import tilt, with_north
from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY

EXAMPLE = "the package's own example"
SOURCE = "Madgwick, PhD thesis, University of Bristol, 2014, chapter 7; package imufusion"
GAIN = Parameter("gain", 0.5, "1", "of the feedback", EXAMPLE, 0.05, 5.0)
ACC = Parameter(
    "acceleration_rejection_deg",
    10.0,
    "deg",
    "force that far from the expected vertical is ignored; 0: never",
    EXAMPLE,
    1.0,
    90.0,
    "linear",
    0.0,
    90.0,
)
MAG = Parameter(
    "magnetic_rejection_deg",
    10.0,
    "deg",
    "heading that far from the expected one is ignored; 0: never",
    EXAMPLE,
    1.0,
    90.0,
    "linear",
    0.0,
    90.0,
)
TIMEOUT = Parameter("rejection_timeout_s", 5.0, "s", "longest time to ignore", EXAMPLE, 0.5, 60.0)
RANGE = Parameter(
    "gyroscope_range_deg_s", 0.0, "deg/s", "rates at 98 % of it restart the filter; 0: never", "off", 125.0, 2000.0, "linear"
)


class Fusion(RecursiveFilter):
    """x-io Fusion without magnetometer: arbitrary heading, accelerometer and gyroscope only.

    The package keeps its state to itself: it can be resumed while the program runs, once, and is not written to JSON.
    """

    name, source, sampling = "fusion", SOURCE, "native"
    needs: ClassVar[tuple[str, ...]] = ("gyr", "acc")
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = (GAIN, ACC, TIMEOUT, RANGE)
    behaviour = "Its gain is ramped down over the first 3 s. Single precision: steps of 1e-7."

    def advance(self, samples: UniformSamples, state: FilterState | None = None) -> tuple[np.ndarray, FilterState]:
        """See OrientationFilter; a state can be resumed once, because the package changes it in place."""
        if state is None:
            ahrs, seen = self._begin(samples), 0
        else:
            self.check_state(state)
            ahrs, seen = state["ahrs"], state["seen"][0]
            if seen != state["at"]:
                raise InputError(f"the filter {self.name} has gone on from this state already; it can be resumed once")
        columns = [np.degrees(samples.gyr), samples.acc / STANDARD_GRAVITY]
        update: Any = ahrs.update_no_magnetometer
        if "mag" in self.needs:
            assert samples.mag is not None
            columns.append(samples.mag)
            update = ahrs.update
        q = np.empty((len(samples), 4))
        get, steps = ahrs.get_quaternion, samples.intervals
        for i, readings in enumerate(zip(*columns, strict=True)):
            if steps is not None:
                ahrs.set_sample_period(steps[i])
            update(*readings)
            q[i] = get()
        counter = [seen + len(q)] if state is None else state["seen"]
        counter[0] = seen + len(q)
        return q, {"filter": self.name, "ahrs": ahrs, "at": seen + len(q), "seen": counter}

    def _begin(self, samples: UniformSamples) -> imufusion.Ahrs:
        settings = imufusion.AhrsSettings()
        settings.convention = imufusion.CONVENTION_ENU
        settings.gain = self.parameters["gain"]
        settings.acceleration_rejection = self.parameters["acceleration_rejection_deg"]
        settings.magnetic_rejection = self.parameters.get("magnetic_rejection_deg", 0.0)
        settings.rejection_timeout = self.parameters["rejection_timeout_s"]
        settings.gyroscope_range = self.parameters["gyroscope_range_deg_s"]
        settings.sample_rate = 1.0 / samples.interval
        ahrs = imufusion.Ahrs()
        ahrs.set_settings(settings)
        ahrs.set_quaternion(self._start(samples))  # from its own start, the identity, it never leaves an exact headstand
        return ahrs

    def _start(self, samples: UniformSamples) -> np.ndarray:
        return tilt(samples.acc[0])


class Fusion9D(Fusion):
    """x-io Fusion with magnetometer."""

    name, needs = "fusion_9d", ("gyr", "acc", "mag")
    PARAMETERS = (GAIN, ACC, MAG, TIMEOUT, RANGE)

    def _start(self, samples: UniformSamples) -> np.ndarray:
        assert samples.mag is not None
        up, field = samples.acc[0] / np.linalg.norm(samples.acc[0]), samples.mag[0]
        *q, known = with_north(*up, *field)
        return np.array(q) if known else tilt(samples.acc[0])
