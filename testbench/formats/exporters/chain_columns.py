"""Angles by the chain filter, as columns of an export."""

from __future__ import annotations

import numpy as np

from testbench.formats.exporters.source import ExportSource, increasing
from testbench.records.results.chain import ChainEstimate

Series = dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]


def chain_series(source: ExportSource) -> Series:
    """Angles by the chain filter, each estimate under its own name.

    The one that was asked for stands alone, by the plain names of its joints; else those of the
    first section are there, each joint called after estimate and joint.

    Args:
        source: What is exported.

    Returns:
        By name of the series, instants [ns] and angles by column [rad].
    """
    if source.chain is not None:
        return {f"the chain '{source.chain.key}'": _angles(source.chain, "")}
    own = list(source.chains.values())
    return {
        f"the chain '{one.key}'": _angles(one, f"{one.key}_")
        for one in own
        if one.section == own[0].section
    }


def _angles(one: ChainEstimate, before: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rows = increasing(one.host_time_ns)
    angles = one.mean[rows, 0]
    return one.host_time_ns[rows], {
        f"{before}{joint}": angles[:, i] for i, joint in enumerate(one.joints)
    }
