"""Settings that several filters share."""

from __future__ import annotations

from testbench.estimation.filters.base import Parameter

OFF = "off by definition of the method"

ACC_GATE = Parameter(
    "acc_gate_m_s2",
    0.0,
    "m/s^2",
    "no correction by the accelerometer while its size differs from standard gravity by more; 0: "
    "always corrected",
    OFF,
    0.05,
    5.0,
)
MAG_GATE = Parameter(
    "mag_gate",
    0.0,
    "1",
    "no correction by the magnetometer while the field (its horizontal and vertical part) differs "
    "from that "
    "of the start by more than this fraction of it; 0: always corrected",
    OFF,
    0.02,
    0.5,
)
