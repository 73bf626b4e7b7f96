"""VQF, compiled, from its authors' package."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from vqf import VQF, offlineVQF

from testbench.estimation.filters.base import (
    FilterState,
    OrientationFilter,
    Parameter,
    RecursiveFilter,
    UniformSamples,
    on_regular_grid,
    switch,
)
from testbench.exceptions import InputError

SOURCE = (
    "Laidig & Seel, VQF: Highly accurate IMU orientation estimation, Information Fusion 91, "
    "2023; package vqf"
)


def _setting(
    name: str, default: float, unit: str, meaning: str, low: float, high: float, least: float = 1e-9
) -> Parameter:
    return Parameter(name, default, unit, meaning, "package vqf", low, high, "log", least)


PARAMETERS = (
    _setting(
        "tau_acc_s", 3.0, "s", "time constant of the inclination's correction", 0.3, 30.0, 1e-3
    ),
    switch("rest_bias", True, "estimate the gyroscope's bias while at rest", "package vqf"),
    switch("motion_bias", True, "estimate it while moving", "package vqf"),
    _setting("rest_min_s", 1.5, "s", "time without motion that counts as rest", 0.5, 10.0, 0.0),
    _setting(
        "rest_gyr_deg_s", 2.0, "deg/s", "largest deviation of the rate at rest", 0.1, 10.0, 0.0
    ),
    _setting(
        "rest_acc_m_s2", 0.5, "m/s^2", "largest deviation of the force at rest", 0.05, 2.0, 0.0
    ),
    _setting(
        "bias_sd_deg_s", 0.5, "deg/s", "standard deviation of the bias at the start", 0.05, 5.0
    ),
    _setting(
        "bias_forgetting_s", 100.0, "s", "time in which that grows by 0.1 deg/s", 10.0, 1e4, 1e-3
    ),
    _setting("bias_clip_deg_s", 2.0, "deg/s", "largest bias believed", 0.5, 20.0),
    _setting(
        "bias_motion_sd_deg_s",
        0.1,
        "deg/s",
        "standard deviation of the bias it converges to in motion",
        0.01,
        1.0,
    ),
    _setting(
        "bias_rest_sd_deg_s",
        0.03,
        "deg/s",
        "standard deviation of the bias it converges to at rest",
        0.003,
        0.3,
    ),
)
MAG_PARAMETERS = (
    _setting("tau_mag_s", 9.0, "s", "time constant of the heading's correction", 0.9, 90.0, 1e-3),
    switch(
        "mag_rejection", True, "reject a field unlike that known to be undisturbed", "package vqf"
    ),
    _setting(
        "mag_norm", 0.1, "1", "fraction of its strength by which it may differ", 0.01, 0.5, 0.0
    ),
    _setting("mag_dip_deg", 10.0, "deg", "angle by which its dip may differ", 1.0, 45.0, 0.0),
    _setting("mag_rejection_s", 60.0, "s", "longest time to reject it completely", 1.0, 600.0, 0.0),
)
NAMES = {
    "tau_acc_s": "tauAcc",
    "rest_bias": "restBiasEstEnabled",
    "motion_bias": "motionBiasEstEnabled",
    "rest_min_s": "restMinT",
    "rest_gyr_deg_s": "restThGyr",
    "rest_acc_m_s2": "restThAcc",
    "bias_sd_deg_s": "biasSigmaInit",
    "bias_forgetting_s": "biasForgettingTime",
    "bias_clip_deg_s": "biasClip",
    "bias_motion_sd_deg_s": "biasSigmaMotion",
    "bias_rest_sd_deg_s": "biasSigmaRest",
    "tau_mag_s": "tauMag",
    "mag_rejection": "magDistRejectionEnabled",
    "mag_norm": "magNormTh",
    "mag_dip_deg": "magDipTh",
    "mag_rejection_s": "magMaxRejectionTime",
}
"""The package's names of the parameters, which have its units."""

REST = "A slow sweep looks like rest to it, and its rate like a bias: rest_bias 0 cures that."


def _arrays(samples: UniformSamples, mag: bool) -> tuple[np.ndarray, ...]:
    """Rates, forces and, if asked for, fields, as the package takes them: it passes over zeros."""
    vectors = [samples.acc, *([samples.mag] if mag and samples.mag is not None else [])]
    known = [np.nan_to_num(vector) for vector in vectors]
    return tuple(map(np.ascontiguousarray, (samples.gyr, *known)))


def _params(parameters: dict[str, float]) -> dict[str, float | bool]:
    switches = {
        parameter.name
        for parameter in (*PARAMETERS, *MAG_PARAMETERS)
        if parameter.scale == "switch"
    }
    return {
        NAMES[name]: bool(value) if name in switches else value
        for name, value in parameters.items()
    }


class Vqf6D(RecursiveFilter):
    """VQF without magnetometer: arbitrary heading, gyroscope bias estimated."""

    name, source = "vqf_6d", SOURCE
    needs: ClassVar[tuple[str, ...]] = ("gyr", "acc")
    PARAMETERS: ClassVar[tuple[Parameter, ...]] = PARAMETERS
    behaviour = (
        f"Filters the force in an almost inertial frame, so that accelerations average out. {REST}"
    )
    output = "quat6D"

    def advance(
        self, samples: UniformSamples, state: FilterState | None = None
    ) -> tuple[np.ndarray, FilterState]:
        """See OrientationFilter; samples must be regular, as its low-pass filters are."""
        if samples.intervals is not None:
            raise InputError(
                f"the filter {self.name} takes chunks of regular samples only; run() interpolates "
                "a whole recording"
            )
        vqf = VQF(samples.interval, **_params(self.parameters))
        if state is not None:
            self.check_state(state)
            if state["interval_s"] != samples.interval:
                raise InputError(
                    f"the filter {self.name} was run every {state['interval_s']} s, not every "
                    f"{samples.interval} s"
                )
            vqf.state = state["vqf"]
        arrays = _arrays(samples, "mag" in self.needs)
        q = np.asarray(vqf.updateBatch(*arrays)[self.output])
        after = vqf.state
        return q, {
            "filter": self.name,
            "interval_s": samples.interval,
            "gyr_bias_rad_s": after["bias"],
            "vqf": after,
        }


class Vqf9D(Vqf6D):
    """VQF with magnetometer and rejection of magnetic disturbance."""

    name, needs = "vqf_9d", ("gyr", "acc", "mag")
    PARAMETERS = (*PARAMETERS, *MAG_PARAMETERS)
    behaviour = (
        "As vqf_6d; the field corrects the heading only, and is rejected where it is "
        f"disturbed. {REST}"
    )
    output = "quat9D"


class VqfOffline(OrientationFilter):
    """VQF forwards and backwards in time: acausal; with magnetometer where there is one."""

    name, needs, source, causal = "vqf_offline", ("gyr", "acc"), SOURCE, False
    PARAMETERS = (*PARAMETERS, *MAG_PARAMETERS)
    behaviour = f"Knows the future: not for comparison with what runs live. {REST}"

    def knows_heading(self, samples: UniformSamples) -> bool:
        """See OrientationFilter."""
        return samples.has("mag")

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        if samples.intervals is not None:
            return on_regular_grid(self, samples)
        gyr, acc, *field = _arrays(samples, samples.has("mag"))
        mag = field[0] if field else None
        result = offlineVQF(gyr, acc, mag, samples.interval, _params(self.parameters))
        return np.asarray(result["quat6D" if mag is None else "quat9D"])
