"""Of all that came since the last look a guard takes the worst."""

from __future__ import annotations

import numpy as np

from testbench.execution.guards import GuardWatch
from testbench.records.session.samples import ArmSamples
from testbench.records.specs.protocol_arm import Guard, Guards


def test_the_hottest_reading_since_the_last_look_is_the_one_that_counts():
    zero = np.zeros((3, 1))
    heat = {"temperature_elbow_degC": np.array([30.0, 71.0, 40.0])}
    arm = ArmSamples(["elbow"], np.arange(3), zero, zero, zero, heat)
    watch = GuardWatch(Guards(temperature_degC=Guard(limit=60, action="stop")), [])
    (trip,) = watch.look(10**9, arm, {})
    assert (trip.subject, trip.value) == ("elbow", 71.0)
