"""The command `filters`, and the option that names filters for other commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.output import say_json, say_table

if TYPE_CHECKING:
    from testbench.estimation.filters import OrientationFilter

FiltersOption = Annotated[
    str | None,
    typer.Option(
        "--filters",
        help="Orientation filters, separated by commas: names, or path/to/file.py:ClassName.",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object instead of tables.")
]


def parse_filters(text: str | None) -> list[str | OrientationFilter] | None:
    """Filters of a comma-separated list, checked before anything moves; those that ship with the
    bench stay names.
    """
    if text is None:
        return None
    from testbench.estimation.filters import FILTERS, choose_filters
    from testbench.estimation.filters.plugins import find_filter
    from testbench.exceptions import InputError

    entries = [entry.strip() for entry in text.split(",") if entry.strip()]
    if not entries:
        raise InputError("--filters names no filter")
    chosen = [entry if entry in FILTERS else _sound(find_filter(entry)) for entry in entries]
    choose_filters(chosen)
    return chosen


def parse_filter(text: str | None) -> str | OrientationFilter | None:
    """A filter by name, or a user's own from a file or an installed package, once it has passed the
    self-test.

    A name that is neither stays a name: an estimate may hold it.
    """
    if text is None:
        return None
    from testbench.estimation.filters import FILTERS
    from testbench.estimation.filters.plugins import find_filter, installed_filters

    own = text.rpartition(":")[0].endswith(".py") or (
        text not in FILTERS and text in installed_filters()
    )
    return _sound(find_filter(text)) if own else text


def _sound(kind: OrientationFilter) -> OrientationFilter:
    """A user's own filter, once it has passed the self-test: one with a wrong unit or sign is not
    ranked beside the others.
    """
    from testbench.estimation.filters.self_test import self_test
    from testbench.exceptions import InputError

    result = self_test(kind)
    if not result.passed:
        raise InputError(f"the filter {kind.name} fails the self-test: {result.reason}")
    return kind


def filters(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Filters to test: names, or path/to/file.py:ClassName; all if none is given."
        ),
    ] = None,
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Test the filters in motions that are known.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """List the orientation filters, or test that they keep the conventions."""
    from testbench.exceptions import InputError

    if self_test:
        _self_test(names or [], json)
    elif names:
        raise InputError("names of filters go with --self-test; without it, all filters are listed")
    else:
        _list(json)


def _self_test(names: list[str], json: bool) -> None:
    """Test filters and print a table; exit with 1 if one fails that is not known to."""
    from testbench.estimation.filters import FILTERS
    from testbench.estimation.filters.plugins import find_filter, installed_filters
    from testbench.estimation.filters.self_test import self_test

    everything = [name for name, kind in FILTERS.items() if kind.needs != ("device_q",)] + list(
        installed_filters()
    )
    results = [self_test(find_filter(name)) for name in names or everything]
    failed = [
        result for result in results if not result.passed and not (result.known and not names)
    ]
    if json:
        say_json({"passed": not failed, "filters": [result.to_dict() for result in results]})
    else:
        for result in results if names else failed:
            rows = [
                [
                    check.name,
                    "-" if check.worst_deg is None else check.worst_deg,
                    check.limit_deg,
                    _outcome(check.passed),
                    check.where,
                ]
                for check in result.checks
            ]
            say_table(
                f"Self-test of {result.filter}",
                ["check", "worst [deg]", "limit [deg]", "outcome", "worst in"],
                rows,
            )
        rows = [
            [
                r.filter,
                _outcome(r.passed),
                ("known: " if r.known and not r.passed else "") + r.reason,
            ]
            for r in results
        ]
        say_table("Self-test", ["filter", "outcome", "reason"], rows)
    if failed:
        raise typer.Exit(1)


def _outcome(passed: bool) -> str:
    return "pass" if passed else "fail"


def _list(json: bool) -> None:
    from testbench.estimation.filters import FILTERS
    from testbench.estimation.filters.plugins import installed_filters

    entries: list[dict[str, Any]] = [
        {
            "name": name,
            "needs": list(kind.needs),
            "sampling": kind.sampling,
            "causal": kind.causal,
            "parameters": [
                {
                    "name": p.name,
                    "default": p.default,
                    "unit": p.unit,
                    "meaning": p.meaning,
                    "source": p.source,
                    "low": p.low,
                    "high": p.high,
                    "scale": p.scale,
                }
                for p in kind.PARAMETERS
            ],
            "source": kind.source,
            "behaviour": kind.behaviour,
        }
        for name, kind in FILTERS.items()
    ]
    if json:
        say_json({"filters": entries, "installed": sorted(installed_filters())})
        return
    rows = [
        [
            e["name"],
            ", ".join(e["needs"]),
            ", ".join(f"{p['name']} {p['default']:g}" for p in e["parameters"]) or "-",
            e["source"],
        ]
        for e in entries
    ]
    say_table("Filters", ["name", "needs", "parameters", "source"], rows)
    if installed_filters():
        say_table(
            "Installed",
            ["name", "from"],
            [[name, point.value] for name, point in installed_filters().items()],
        )
