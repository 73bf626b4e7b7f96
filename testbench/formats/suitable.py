"""What is worth computing from an imported recording.

That is filters that its sensors feed, and alignment that its truth allows.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.records.session.samples import ImuSamples
from testbench.records.specs.protocol import Analysis, Estimation


def suitable_analysis(
    heads: Iterable[ImuSamples], own_clock: bool = False, truth: bool = False
) -> Analysis:
    """Filters for what at least one sensor has.

    Args:
        heads: First samples of each sensor.
        own_clock: Whether the truth was recorded with another clock than the sensors.
        truth: Whether there is one; its world and the sensors' mounting are then solved from the
            motion.
    """
    filters: list[str] = []
    for head in heads:
        gyr, acc = (bool(np.isfinite(array).any()) for array in (head.gyr, head.acc))
        filters += ["device"] if head.device_q is not None else []
        filters += ["vqf_6d"] if gyr and acc else []
        filters += ["vqf_9d"] if gyr and acc and head.mag is not None else []
        filters += ["fusion", "madgwick_imu"] if gyr and acc else []
    chosen = list(dict.fromkeys(filters)) or ["vqf_6d"]
    return Analysis(
        estimate=Estimation(
            filters=chosen,
            align="motion" if truth else "none",
            align_clock=own_clock,
            calibrate="none",
        )
    )
