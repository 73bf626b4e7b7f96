"""A filter of your own, ranked with the rest.

    testbench filters --self-test examples/03_a_filter_of_your_own.py:SteadyHand
    testbench run quick --filters examples/03_a_filter_of_your_own.py:SteadyHand,vqf_6d,device

It integrates the gyroscope, and levels itself by the accelerometer whenever the rate is small.
"""

import numpy as np

from testbench.estimation.filters import OrientationFilter, Parameter, UniformSamples, get_filter
from testbench.model import rotation


class SteadyHand(OrientationFilter):
    """The gyroscope, levelled at rest."""

    name, needs, source = "steady_hand", ("gyr", "acc"), "an example"
    PARAMETERS = (
        Parameter(
            "still_deg_s", 3.0, "deg/s", "rate below which it levels itself", "tried out", 0.1, 20.0
        ),
        Parameter(
            "share",
            0.02,
            "1",
            "part of the tilt taken out in a sample at rest",
            "tried out",
            1e-3,
            0.5,
            most=1.0,
        ),
    )

    def run(self, samples: UniformSamples) -> np.ndarray:
        """q_earth_from_sensor, w x y z, shape (n, 4): rad/s and m/s^2 come in, earth has z up."""
        steps = rotation.from_rotation_vector(samples.gyr * samples.steps()[:, None])
        still = np.degrees(np.linalg.norm(samples.gyr, axis=1)) < self.parameters["still_deg_s"]
        q = get_filter("tilt").run(samples.piece(slice(0, 1)))[0]
        out = np.empty((len(samples), 4))
        out[0] = q
        for i in range(1, len(samples)):
            q = rotation.multiply(q, steps[i])
            if still[i]:
                x, y, z = rotation.rotate(q, samples.acc[i])  # the force should point upwards
                axis, sine = np.array([y, -x, 0.0]), np.hypot(x, y)
                if sine > 0:
                    part = self.parameters["share"] * np.arctan2(sine, z) * axis / sine
                    q = rotation.multiply(rotation.from_rotation_vector(part), q)
            out[i] = q
        return out


if __name__ == "__main__":
    from testbench.estimation.filters.self_test import self_test

    result = self_test(SteadyHand())
    for check in result.checks:
        print(f"{check.name:20} {check.worst_deg:8.3f} deg of {check.limit_deg:g}")
    print("pass" if result.passed else f"fail: {result.reason}")
