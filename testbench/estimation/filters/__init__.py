"""Orientation filters by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.estimation.filters.base import (
    FilterState,
    OrientationFilter,
    Parameter,
    RecursiveFilter,
    UniformSamples,
)
from testbench.estimation.filters.complementary import Complementary, ComplementaryMarg
from testbench.estimation.filters.device import Device
from testbench.estimation.filters.directions import Ecompass, Quest, Tilt, Triad
from testbench.estimation.filters.ekf import Ekf, EkfImu
from testbench.estimation.filters.error_state import AhrsFilter, ImuFilter
from testbench.estimation.filters.euler_ekf import (
    EulerEkf,
    EulerEkfAsPrinted,
    EulerEkfSimple,
    EulerEkfSimpleAsPrinted,
)
from testbench.estimation.filters.fusion import Fusion, Fusion9D
from testbench.estimation.filters.gyro import Gyro
from testbench.estimation.filters.madgwick import MadgwickImu, MadgwickMarg, MadgwickZetaAsPrinted
from testbench.estimation.filters.mahony import MahonyImu, MahonyMarg
from testbench.estimation.filters.mekf import Mekf, MekfImu
from testbench.estimation.filters.vqf_filters import Vqf6D, Vqf9D, VqfOffline
from testbench.exceptions import InputError, NotFoundError

FILTERS: dict[str, type[OrientationFilter]] = {
    kind.name: kind
    for kind in (
        Device,
        Gyro,
        Tilt,
        Ecompass,
        Triad,
        Quest,
        Complementary,
        ComplementaryMarg,
        MahonyImu,
        MahonyMarg,
        MadgwickImu,
        MadgwickMarg,
        MadgwickZetaAsPrinted,
        ImuFilter,
        AhrsFilter,
        EulerEkfSimple,
        EulerEkf,
        EulerEkfSimpleAsPrinted,
        EulerEkfAsPrinted,
        EkfImu,
        Ekf,
        MekfImu,
        Mekf,
        Vqf6D,
        Vqf9D,
        VqfOffline,
        Fusion,
        Fusion9D,
    )
}


def get_filter(name: str, parameters: Mapping[str, float] | None = None) -> OrientationFilter:
    """A filter by its name.

    Args:
        name: One of FILTERS.
        parameters: Those that differ from the filter's defaults, by name.

    Raises:
        NotFoundError: No such filter, or no such parameter; lists those that exist.
        InputError: A parameter's value is not allowed.
    """
    if name not in FILTERS:
        raise NotFoundError("filter", name, list(FILTERS))
    return FILTERS[name](parameters)


def choose_filters(
    filters: Sequence[str | OrientationFilter],
    parameters: Mapping[str, Mapping[str, float]] | None = None,
) -> list[OrientationFilter]:
    """Filters to run beside one another.

    Args:
        filters: Names, or filters as they are.
        parameters: Those of the named ones, by filter.

    Raises:
        NotFoundError: No such filter or parameter.
        InputError: A value is not allowed, or two filters have one name.
    """
    given = parameters or {}
    chosen = [
        get_filter(entry, given.get(entry)) if isinstance(entry, str) else entry
        for entry in filters
    ]
    names = [kind.name for kind in chosen]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"two of the filters are called {', '.join(twice)}")
    return chosen


__all__ = [
    "FILTERS",
    "FilterState",
    "OrientationFilter",
    "Parameter",
    "RecursiveFilter",
    "UniformSamples",
    "choose_filters",
    "get_filter",
]
