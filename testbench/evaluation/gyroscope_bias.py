"""What the calibrated gyroscope still reads at rest: the error of the bias that the calibration
estimated.
"""

from __future__ import annotations

import numpy as np

from testbench.evaluation.judged import rows_by_step
from testbench.frames import NANOSECONDS
from testbench.model.statistics.memory import FEWEST_MEMORIES, layout, means
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.evaluation_rows import GyroscopeBiasRow
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import AXES
from testbench.records.session.sensor_file import SensorFile

FEWEST_SAMPLES = 50


def bias_rows(
    name: str, estimate: SensorEstimate, raw: SensorFile, steps: list[PlannedStep]
) -> list[GyroscopeBiasRow]:
    """The mean of the calibrated rate over the dwells in which nothing was calibrated, where the
    true rate is zero.

    Args:
        name: Of the sensor.
        estimate: Its calibration.
        raw: Its samples.
        steps: Of the session.

    Returns:
        One row for each axis; none where nothing was calibrated, or too little was at rest.
    """
    fit, time = estimate.calibration, estimate.host_time_ns
    dwells = [step for step in steps if step.kind != "sweep" and step.role != "calibration"]
    rest = np.zeros(len(time), dtype=bool)
    for _, counted in rows_by_step(dwells, time, estimate.static & ~estimate.flagged):
        rest[counted] = True
    if fit.method == "none" or rest.sum() < FEWEST_SAMPLES:
        return []
    read = raw.quantities("gyr", "acc", every=estimate.every)
    rate, _, _ = fit.apply(read["gyr"][rest], read["acc"][rest], None)
    when = layout(time[rest] / NANOSECONDS, [np.arange(len(rate))], equally=False)
    if when is None:
        return []
    found = means(when, np.array([when.pieces(np.degrees(own)) for own in rate.T]))
    rows = []
    for i, axis in enumerate(AXES):
        sd = float(np.degrees(fit.gyr_bias_sd[i]))
        rows.append(
            GyroscopeBiasRow(
                name,
                axis,
                float(np.degrees(fit.gyr_bias[i])),
                sd if np.isfinite(sd) else None,
                float(found.mean[i]),
                float(found.error[i]) if found.memories[i] >= FEWEST_MEMORIES else None,
                int(rest.sum()),
            )
        )
    return rows
