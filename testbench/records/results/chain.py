"""What the chain filter says of the arm's joints, in memory and on disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from testbench.records.disk.tables import read_parquet, write_parquet
from testbench.records.session.layout import chain_table, table_file
from testbench.records.session.samples import join, split

ORDERS = (("q", "_rad"), ("v", "_rad_s"), ("a", "_rad_s2"))


@dataclass(frozen=True, kw_only=True)
class ChainFacts:
    """What the filter ran over, and what it found: its entry in estimate.json.

    Attributes:
        section: Of the protocol.
        state: Of the filter.
        sensors: Those used.
        joints: Those estimated, m of them.
        facts: What was found on the way: the jerk or the walk that the motion has (unit in the
            key), base frequency with uncertainty [Hz], mean normalised innovation squared [1],
            whether it was smoothed.
    """

    section: str
    state: str
    sensors: list[str]
    joints: list[str]
    facts: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class ChainEstimate(ChainFacts):
    """Joints of one section by one state of the filter.

    Attributes:
        host_time_ns: Shape (n,), int64.
        mean: Angles, rates and accelerations, shape (n, 3, m) [rad], [rad/s], [rad/s^2].
        sd: Their standard uncertainties, likewise.
    """

    host_time_ns: np.ndarray
    mean: np.ndarray
    sd: np.ndarray

    @property
    def key(self) -> str:
        """Name of its file, without ending."""
        return chain_table(self.section, self.state)

    def to_columns(self) -> dict[str, np.ndarray]:
        """Angles, rates and accelerations with their uncertainties, by name; shape (n,) each."""
        columns: dict[str, np.ndarray] = {}
        for order, (mean, sd) in enumerate(self._columns(self.joints)):
            columns |= split(mean, self.mean[:, order]) | split(sd, self.sd[:, order])
        return columns

    def write(self, folder: Path) -> None:
        """Write its samples."""
        write_parquet(
            folder / table_file(self.key),
            {"host_time_ns": self.host_time_ns} | self.to_columns(),
            {"content": "joints by the chain filter, with uncertainties"},
        )

    @staticmethod
    def read(folder: Path, facts: ChainFacts) -> ChainEstimate:
        """Read them back."""
        table = read_parquet(folder / table_file(chain_table(facts.section, facts.state)))
        names = ChainEstimate._columns(facts.joints)
        mean, sd = (np.stack([join(table, pair[i]) for pair in names], axis=1) for i in (0, 1))
        return ChainEstimate(**vars(facts), host_time_ns=table["host_time_ns"], mean=mean, sd=sd)

    @staticmethod
    def _columns(joints: list[str]) -> list[tuple[list[str], list[str]]]:
        return [
            (
                [f"{name}_{joint}{unit}" for joint in joints],
                [f"{name}_sd_{joint}{unit}" for joint in joints],
            )
            for name, unit in ORDERS
        ]
