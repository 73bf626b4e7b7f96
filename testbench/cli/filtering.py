"""The command `filters`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say_json, say_table


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
    """Test filters and print a table; a refusal if one fails that is not known to."""
    from testbench.estimation.filters import FILTERS
    from testbench.estimation.filters.plugins import find_filter, installed_filters
    from testbench.estimation.filters.self_test import self_test
    from testbench.exceptions import InputError

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
        raise typer.Exit(InputError.exit_code)


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
