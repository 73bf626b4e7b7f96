"""The calibration that a recording brings along: static poses of its calibration sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.static_poses import fit_static_poses
from testbench.estimation.filters import UniformSamples
from testbench.estimation.signals.recording import RunFacts
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import CalibrationFit
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ImuSamples, Truth

FEWEST_AT_REST = 10
"""Samples at rest that make a pose."""


def fit_sections(
    run: RunFacts, samples: ImuSamples, time_ns: np.ndarray, static: np.ndarray, truth: Truth
) -> tuple[CalibrationFit, list[Finding]]:
    """Static poses of the calibration sections, as the gyroscope confirms them.

    Args:
        run: What is known of the recording.
        samples: Of the sensor.
        time_ns: Their instants on the host's clock, shape (n,) [ns].
        static: Sound samples at rest, shape (n,), bool.
        truth: What the sensor went through.
    """
    accs, gyrs, poses = [], [], []
    steps = _planned(run.steps)
    for step in steps:
        rest = static & (time_ns >= step.settled_ns) & (time_ns <= step.end_ns)
        if rest.sum() >= FEWEST_AT_REST:
            middle = np.array([time_ns[rest].mean()])
            accs.append(samples.acc[rest])
            gyrs.append(samples.gyr[rest])
            poses.append(
                rotation.interpolate(truth.host_time_ns, truth.q_world_from_sensor, middle)[0]
            )
    fit = fit_static_poses(accs, gyrs, poses, run.gravity)
    if fit.method != "static_poses" or fit.poses >= len(steps):
        return fit, []
    left_out = len(steps) - fit.poses
    return fit, [finding("calibration.poses_moving", left_out=left_out, planned=len(steps))]


def _planned(steps: Sequence[PlannedStep]) -> list[PlannedStep]:
    return [step for step in steps if step.role == "calibration" and step.kind != "sweep"]


def corrected(
    uniform: UniformSamples, calibration: CalibrationFit, sampling: str | None
) -> UniformSamples:
    """What the filters get: calibrated, and with rates that are means over the interval before each
    sample.

    Filters take a rate for the whole interval before its sample. A sensor known to sample instants
    would lead them by half an interval; the mean of both ends of the interval does not (trapezoidal
    rule).

    Args:
        uniform: As read.
        calibration: Of the sensor.
        sampling: "instantaneous", "integrated", or None where nobody says.
    """
    gyr, acc, mag = calibration.apply(uniform.gyr, uniform.acc, uniform.mag)
    if sampling == "instantaneous":
        gyr = np.vstack([gyr[:1], (gyr[1:] + gyr[:-1]) / 2])
    device_q = uniform.device_q
    if device_q is not None:
        device_q = rotation.multiply(
            device_q, rotation.from_matrix(calibration.R_believed_from_sensor.T)
        )
    return replace(uniform, gyr=gyr, acc=acc, mag=mag, device_q=device_q)
