"""Readings that are as noisy as what nobody knows of where their sensors sit makes them.

A filter that believes its sensors elsewhere than they sit explains what it reads by other joint
angles, and is soon lost. Readings that count for less keep it near the truth. Two things need it:
a fit of the placement, until that is found, and a body, which is no chain of rigid links.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.chain.run import ChainSamples
from testbench.estimation.chain.settings import SensorNoise
from testbench.model.statistics.intervals import gradient

BODY_TURN_SD, BODY_SHIFT_SD = np.radians(0.8), 0.012
"""How far a sensor on a body goes its own way against a chain of rigid links [rad], [m]. The shift
is that of a joint's centre 0.35 m along a segment whose axes are 2 deg off; the turn is a choice,
less than what skin moves by. With a quarter more, knees are less sure than they are right.
"""


def blurred(
    noise: list[SensorNoise], samples: ChainSamples, turns: np.ndarray, shifts: np.ndarray
) -> list[SensorNoise]:
    """Noise of sensors that may sit elsewhere than they are believed to.

    A turn adds that part of the rate and of the force; a shift what the turning accelerates it by,
    ω² and α.

    Args:
        noise: Of each sensor.
        samples: What they read.
        turns: By how much each may be turned about each axis, shape (s,) [rad].
        shifts: And shifted along each axis, shape (s,) [m].
    """
    found = []
    for i, (own, turn, shift) in enumerate(zip(noise, turns, shifts, strict=True)):
        mine = samples.sensor == i
        rate, force = np.split(samples.reading[mine], 2, axis=1)
        bend = gradient(rate, samples.time[mine])
        swing = np.sum(rate**2, axis=1) ** 2 + np.sum(bend**2, axis=1)
        faster, heavier = (np.sqrt(np.mean(np.sum(x**2, axis=1))) for x in (rate, force))
        gyr, acc = turn * faster, np.hypot(turn * heavier, shift * np.sqrt(swing.mean()))
        found.append(
            replace(
                own,
                gyr_sd=float(np.hypot(own.gyr_sd, gyr)),
                acc_sd=float(np.hypot(own.acc_sd, acc)),
            )
        )
    return found
