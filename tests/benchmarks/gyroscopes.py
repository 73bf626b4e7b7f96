"""Gyroscope calibrations a second, beside the published times for the same size of task."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from testbench.estimation.calibration.gyroscope import attitude, gravity_turns
from testbench.estimation.calibration.rate_table import rate_table
from tests.benchmarks.timing import Text, duration, rate, ratio, seconds, show
from tests.estimation.calibration.gyroscopes import Gyroscope, chain, record

PUBLISHED_S = {"rk4": 105.97, "cg4": 2116.01, "trapezoid": 7105.61}
"""Botina & Vergara 2018, table 4.7: means of five runs, MATLAB, i5 of 1.7 GHz."""


def bench_gyroscopes() -> None:
    """Time each way of calibrating a gyroscope from ten turns of 200 samples."""
    rng = np.random.default_rng(0)
    gyroscope = Gyroscope.draw(rng, np.radians(0.05))
    recording = record(gyroscope, chain("wandering", 10, rng, interval=0.02), rng, up_sd=2e-4)
    rows: list[list[str | Text]] = []

    def row(name: str, call: Callable[[], object], published: float | None = None) -> None:
        ours = seconds(call)
        beside = ["-", "-"] if published is None else [duration(published), ratio(ours, published)]
        rows.append([Text(name), duration(ours), rate(1 / ours), *beside])

    for name in ("rk4", "cg4", "trapezoid", "midpoint", "euler"):
        row(
            f"gravity_turns, {name}",
            lambda name=name: gravity_turns(recording, name),
            PUBLISHED_S.get(name),
        )
    row("attitude", lambda: attitude(recording))
    row("rate_table", lambda: rate_table(recording))
    show(
        "Gyroscope calibration: 10 turns of 200 samples",
        ["method", "time", "calibrations", "published", "ours : published"],
        rows,
        "published: Botina & Vergara 2018, table 4.7, on a machine of 2012; target: below 1 s each",
    )
