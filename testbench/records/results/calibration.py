"""Calibration: the dated corrections of one sensor with their uncertainty, for later sessions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.records.results.evidence import Evidence
from testbench.records.results.fit import Fit


@dataclass(frozen=True)
class TriadCalibration:
    """Corrections of three sensing axes.

    corrected = matrix (raw - bias - drift (T - reference) - g_matrix force).

    Attributes:
        method: As `testbench calibrate` spells it.
        matrix: Shape (3, 3) [1].
        bias: Shape (3,) [m/s^2, rad/s or uT].
        g_matrix: Response of a gyroscope to specific force, shape (3, 3) [rad/s/(m/s^2)]; zero for
            other triads.
        drift: Change of the bias with temperature, shape (3,) [unit/K].
        reference: Temperature the bias holds at [deg C].
        fits: The parameters as the method states them, with covariance; several where it works in
            steps.
        validation: Held-out figures by name, with the unit in the name, e.g.
            "gravity_norm_rms_mm_s2".
        remarks: What a user must know of it, as sentences.
        evidence: What the fit leaves, for tests of what its model lacks; not kept in files. None
            for methods whose scatter is not known beforehand.
    """

    method: str
    matrix: np.ndarray = field(default_factory=lambda: np.eye(3))
    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    g_matrix: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    drift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    reference: float | None = None
    fits: tuple[Fit, ...] = ()
    validation: dict[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    evidence: Evidence | None = None

    def apply(
        self,
        raw: np.ndarray,
        force: np.ndarray | None = None,
        temperature: np.ndarray | None = None,
    ) -> np.ndarray:
        """Corrected readings, shape (n, 3).

        Args:
            raw: Shape (n, 3).
            force: Specific force for the g-sensitivity, shape (n, 3) [m/s^2].
            temperature: Shape (n,) [deg C].
        """
        bias = np.broadcast_to(self.bias, raw.shape)
        if temperature is not None and self.reference is not None and self.drift.any():
            bias = bias + np.nan_to_num(temperature - self.reference)[:, None] * self.drift
        if force is not None and self.g_matrix.any():
            bias = bias + force @ self.g_matrix.T
        return (raw - bias) @ self.matrix.T


@dataclass(frozen=True)
class MountingCalibration:
    """How a sensor really sits against its mounting as believed.

    Attributes:
        method: As `testbench calibrate` spells it, or from which method of a triad.
        R_believed_from_sensor: Shape (3, 3).
        fit: Its rotation vector [rad].
        remarks: What a user must know of it, as sentences.
    """

    method: str
    R_believed_from_sensor: np.ndarray
    fit: Fit
    remarks: tuple[str, ...] = ()
