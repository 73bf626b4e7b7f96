"""What the chain filter says of the arm's joints, in memory and on disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from testbench.records.samples import join, split
from testbench.records.storage import read_parquet, write_parquet

ORDERS = (("q", "_rad"), ("v", "_rad_s"), ("a", "_rad_s2"))


@dataclass(frozen=True)
class ChainEstimate:
    """Joints of one section by one state of the filter.

    Attributes:
        section: Name of the section.
        state: What the filter estimated.
        sensors: Those used.
        joints: Those estimated, m of them.
        host_time_ns: Shape (n,), int64.
        mean: Angles [rad], rates [rad/s] and accelerations [rad/s^2], shape (n, 3, m).
        sd: Their standard uncertainties, shape (n, 3, m), same units.
        facts: What was found on the way: process noise (unit in the key), base
            frequency with uncertainty [Hz], mean normalised innovation squared [1], whether it was
            smoothed.
    """

    section: str
    state: str
    sensors: list[str]
    joints: list[str]
    host_time_ns: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    facts: dict[str, Any]

    @property
    def key(self) -> str:
        """Name of its file, without ending."""
        return f"chain_{self.section}_{self.state}"

    def save(self, folder: Path) -> dict[str, Any]:
        """Write its samples; returns the rest, for estimate.json."""
        columns = {"host_time_ns": self.host_time_ns}
        for order, (mean, sd) in enumerate(self._columns(self.joints)):
            columns |= split(mean, self.mean[:, order]) | split(sd, self.sd[:, order])
        write_parquet(
            folder / f"{self.key}.parquet",
            columns,
            {"content": "joints by the chain filter, with uncertainties"},
        )
        kept = ("section", "state", "sensors", "joints", "facts")
        return {key: getattr(self, key) for key in kept}

    @staticmethod
    def load(folder: Path, data: dict[str, Any]) -> ChainEstimate:
        """Read it back; `data` is what `save` returned."""
        table = read_parquet(folder / f"chain_{data['section']}_{data['state']}.parquet")
        names = ChainEstimate._columns(data["joints"])
        mean, sd = (np.stack([join(table, pair[i]) for pair in names], axis=1) for i in (0, 1))
        return ChainEstimate(**data, host_time_ns=table["host_time_ns"], mean=mean, sd=sd)

    @staticmethod
    def _columns(joints: list[str]) -> list[tuple[list[str], list[str]]]:
        return [
            (
                [f"{name}_{joint}{unit}" for joint in joints],
                [f"{name}_sd_{joint}{unit}" for joint in joints],
            )
            for name, unit in ORDERS
        ]
