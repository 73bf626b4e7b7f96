"""Filters with the parameters that they were tuned to, and those that a person set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.estimation.filters import FILTERS, OrientationFilter, choose_filters
from testbench.exceptions import InputError, NotFoundError
from testbench.records.results.tuning import Tuning

Parameters = Mapping[str, Mapping[str, float]]
"""Values of parameters, by filter and name."""


def choose_tuned(
    filters: Sequence[str | OrientationFilter] | None,
    of_protocol: Sequence[str],
    parameters: Parameters,
    tunings: Sequence[Tuning],
    given: Parameters | None = None,
) -> list[OrientationFilter]:
    """Filters to run beside one another, each with its parameters.

    Of two values for one parameter the later of these holds: the filter's default, the protocol's,
    the tuned one, the one that a person set. A tuning is a whole set and takes the place of the
    protocol's; what a person set changes single parameters of what is there.

    Args:
        filters: Names, or filters as they are; those of the protocol and those tuned or set if
            None.
        of_protocol: Their names.
        parameters: Of the protocol's filters.
        tunings: At most one a filter.
        given: What a person set.

    Raises:
        NotFoundError: No such filter or parameter.
        InputError: A value is not allowed, a filter is named or tuned twice, or tuned or set but
            not among those to run.
    """
    sets: dict[str, Mapping[str, float]] = {}
    for tuning in tunings:
        if tuning.filter in sets:
            raise InputError(f"two tunings are of the filter {tuning.filter}; which one?")
        sets[tuning.filter] = tuning.parameters
    given = given or {}
    wanted = list(filters or of_protocol)
    if not filters:
        wanted += [name for name in {**sets, **given} if name in FILTERS and name not in wanted]
    values = {**parameters, **sets}
    values |= {name: {**values.get(name, {}), **own} for name, own in given.items()}
    ready = choose_filters(
        [entry if isinstance(entry, str) else _changed(entry, sets, given) for entry in wanted],
        values,
    )
    running = [kind.name for kind in ready]
    for name in sorted(sets):
        if name not in running:
            raise InputError(
                f"a tuning is of the filter {name}, which is not among those to run: name it with "
                "--filters"
            )
    for name in given:
        if name not in running:
            raise _idle(name, running)
    return ready


def _changed(
    kind: OrientationFilter, sets: Mapping[str, Mapping[str, float]], given: Parameters
) -> OrientationFilter:
    """A filter that is given as it is, with what was tuned and set of it."""
    if kind.name not in sets and kind.name not in given:
        return kind
    own = sets.get(kind.name, kind.parameters)
    return with_parameters(kind, {**own, **given.get(kind.name, {})})


def with_parameters(kind: OrientationFilter, parameters: Mapping[str, float]) -> OrientationFilter:
    """The same filter with other parameters.

    Raises:
        NotFoundError: No such parameter.
        InputError: A value is not allowed, or the filter cannot be made with parameters.
    """
    try:
        return type(kind)(parameters)
    except TypeError as error:
        raise InputError(
            f"the filter {kind.name} cannot be made with parameters: {error}"
        ) from None


def _idle(name: str, running: Sequence[str]) -> InputError:
    """What is wrong with parameters of a filter that does not run."""
    if name not in FILTERS:
        return NotFoundError("filter", name, list(dict.fromkeys([*FILTERS, *running])))
    return InputError(
        f"parameters are set of the filter {name}, which is not among those to run: name it with "
        "--filters"
    )
