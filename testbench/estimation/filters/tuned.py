"""Filters with the parameters that they were tuned to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.estimation.filters import FILTERS, OrientationFilter, choose_filters
from testbench.exceptions import InputError
from testbench.records.tuning import Tuning


def choose_tuned(
    filters: Sequence[str | OrientationFilter] | None,
    of_protocol: Sequence[str],
    parameters: Mapping[str, Mapping[str, float]],
    tunings: Sequence[Tuning],
) -> list[OrientationFilter]:
    """Filters to run beside one another, those that were tuned with their tuned parameters.

    Args:
        filters: Names, or filters as they are; those of the protocol and those tuned if None.
        of_protocol: Their names.
        parameters: Of the protocol's filters.
        tunings: At most one a filter; it takes the place of all other parameters.

    Raises:
        NotFoundError: No such filter or parameter.
        InputError: A value is not allowed, a filter is named or tuned twice, or tuned but not among
            those to run.
    """
    sets: dict[str, Mapping[str, float]] = {}
    for tuning in tunings:
        if tuning.filter in sets:
            raise InputError(f"two tunings are of the filter {tuning.filter}; which one?")
        sets[tuning.filter] = tuning.parameters
    wanted = list(filters or of_protocol)
    if not filters:
        wanted += [name for name in sets if name in FILTERS and name not in wanted]
    chosen: list[str | OrientationFilter] = []
    for entry in wanted:
        own = None if isinstance(entry, str) else sets.get(entry.name)
        chosen.append(entry if own is None or isinstance(entry, str) else type(entry)(own))
    ready = choose_filters(chosen, {**parameters, **sets})
    absent = sorted(set(sets) - {kind.name for kind in ready})
    if absent:
        raise InputError(
            f"a tuning is of the filter {absent[0]}, which is not among those to run: name it with "
            "--filters"
        )
    return ready
