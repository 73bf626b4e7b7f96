"""What rankings claim when one part is measured again and again: no pair of filters may be told
apart in opposite ways, and what differs truly must be told nearly always.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from testbench import evaluate, execute, plan
from testbench.estimation import estimate
from testbench.estimation.filters.vqf_filters import Vqf6D
from testbench.estimation.signals.uniform import UniformSamples
from testbench.evaluation.ranking import SIGNIFICANCE
from testbench.records.specs.shipped import shipped_folder
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show

COUNT, FEWER = 40, 12
"""Sessions of `quick` and `elbow_dynamic`, and of `elbow_flexion` with all filters below."""
LEAST_TOLD = 0.9
TURNED = 0.98
ELEVEN = (
    *("device", "vqf_6d", "vqf_9d", "vqf_offline", "fusion", "madgwick_imu", "madgwick_marg"),
    *("mahony_imu", "mahony_marg", "mekf_imu", "imufilter"),
)
NO_SCATTER: dict[str, dict[str, float]] = {
    "accelerometer": dict.fromkeys(
        ("bias_sd_mg", "scale_sd_percent", "cross_axis_sd_percent", "bias_drift_sd_mg_k"), 0.0
    ),
    "gyroscope": dict.fromkeys(
        (
            *("bias_sd_deg_s", "scale_sd_percent", "cross_axis_sd_percent"),
            *("g_sensitivity_sd_deg_s_g", "bias_drift_sd_deg_s_k"),
        ),
        0.0,
    ),
    "magnetometer": dict.fromkeys(
        ("hard_iron_sd_uT", "scale_sd_percent", "cross_axis_sd_percent"), 0.0
    ),
}
"""Every part is as its data sheet says in the mean: one and the same for all seeds."""


class Short(Vqf6D):
    """vqf_6d whose gyroscope gives 98 % of each turn."""

    name = "vqf_6d_short"

    def run(self, samples: UniformSamples) -> np.ndarray:
        """See OrientationFilter."""
        return super().run(replace(samples, gyr=TURNED * samples.gyr))


def _of_one_part(protocol: str, folder: Path) -> Path:
    """A protocol whose seeds differ in noise, clocks and the arm's errors alone."""
    spec = yaml.safe_load((shipped_folder("protocols") / f"{protocol}.yaml").read_text("utf-8"))
    for sensor in spec["sensors"].values():
        own = sensor.setdefault("parameters", {})
        for part, values in NO_SCATTER.items():
            own[part] = own.get(part, {}) | values
    shutil.copytree(shipped_folder("protocols"), folder, dirs_exist_ok=True)  # what it includes
    path = folder / f"{protocol}.yaml"
    path.write_text(yaml.safe_dump(spec), encoding="utf-8")
    return path


def claims_of(protocol: str, filters: tuple[str, ...], numbers: range) -> Iterator[list[list[Any]]]:
    """Of each seed the pairs that are told apart: what was compared, better one, worse one."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        planned = plan(_of_one_part(protocol, folder))
        for number in numbers:
            session = execute(planned, folder / str(number), seed=number)
            chosen = [*filters, Short()] if filters else None
            judged = evaluate(session, estimate(session, chosen))
            yield [
                [
                    f"{c.owner} {c.section} {c.sequence} {c.criterion}",
                    *((c.first, c.second) if c.difference < 0 else (c.second, c.first)),
                ]
                for c in judged.comparisons
                if c.p_holm < SIGNIFICANCE
            ]


def counted(found: list[list[list[str]]]) -> tuple[int, list[tuple[str, str, str]]]:
    """How many pairs any session tells apart, and those that two sessions order otherwise.

    Args:
        found: Of each session its claims: what was compared, the better filter, the worse one.
    """
    claims = {(where, better, worse) for one in found for where, better, worse in one}
    opposite = [(where, a, b) for where, a, b in sorted(claims) if (where, b, a) in claims]
    return len(claims), [claim for claim in opposite if claim[1] < claim[2]]


def bench_same_part(count: int = COUNT) -> bool:
    """Print for each protocol how many pairs were told apart, and how many in opposite ways;
    whether none was, and the filter that falls short was told.
    """
    fewer = -(-count * FEWER // COUNT)
    rows: list[list[str | Text]] = []
    kept = True
    for protocol, filters, sessions in (
        ("quick", (), count),
        ("elbow_dynamic", (), count),
        ("elbow_flexion", ELEVEN, fewer),
    ):
        found = resumed(f"same_part_{protocol}", sessions, partial(claims_of, protocol, filters))
        pairs, opposite = counted(found)
        for where, first, second in opposite:
            print(f"{protocol}: {where}: {first} and {second} are told apart in opposite ways")
        told = [
            any(better == "vqf_6d" and worse == Short.name for _, better, worse in one)
            for one in found
        ]
        share = f"{100 * float(np.mean(told)):.0f} %" if filters else "-"
        rows.append(
            [
                Text(protocol),
                f"{sessions}",
                f"{pairs}",
                f"{len(opposite)}",
                share,
            ]
        )
        kept &= not opposite and (not filters or bool(np.mean(told) >= LEAST_TOLD))
    show(
        "One part measured again and again: pairs of filters that were told apart",
        ["protocol", "sessions", "pairs told", "in opposite ways", "98 % of each turn told"],
        rows,
        f"target: none in opposite ways; what falls short told in {100 * LEAST_TOLD:g} %",
    )
    return kept


if __name__ == "__main__":
    sys.exit(not bench_same_part(count_of(__doc__, COUNT)))
