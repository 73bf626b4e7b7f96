"""The delay of a flexion is no surer than the clocks of its sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation import evaluate
from tests.evaluation.test_evaluate import true_flexion, with_flexion


def test_the_delay_of_a_flexion_holds_the_doubt_of_its_sensors_time(quick):
    said = with_flexion(quick, np.roll(true_flexion(quick), 2))
    found = []
    for sd in (1e-4, 0.05):
        sensors = {
            name: replace(own, clock=replace(own.clock, offset_sd_s=sd))
            for name, own in said.sensors.items()
        }
        rows = evaluate(quick.session, replace(said, sensors=sensors)).joint_angle
        found.append(next(row.latency_sd_ms for row in rows if row.latency_sd_ms is not None))
    assert found[0] < 20 < 49 < found[1] < 70
