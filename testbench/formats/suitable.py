"""What is worth computing from an imported recording.

That is filters that its sensors feed, and alignment that its truth allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from testbench.formats.dates import Recorded
from testbench.formats.recording import ImportedSensor, Recording
from testbench.records.findings.finding import Finding
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


def suited_recording(
    name: str,
    purpose: str,
    sensors: Mapping[str, ImportedSensor],
    findings: Iterable[Finding],
    recorded: Recorded | None = None,
    origin_ns: int | None = None,
) -> Recording:
    """A recording without truth, analysed as its sensors allow.

    Args:
        name: Of the recording.
        purpose: A sentence for people.
        sensors: By name.
        findings: What was noticed when it was read.
        recorded: When it was made, None where nobody says.
        origin_ns: What the clock of the files said at host time zero, where that is known [ns].
    """
    heads = [head for head in (sensor.head() for sensor in sensors.values()) if head is not None]
    return Recording(
        name,
        purpose,
        dict(sensors),
        suitable_analysis(heads),
        list(findings),
        recorded=recorded,
        origin_ns=origin_ns,
    )
