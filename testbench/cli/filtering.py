"""The command `filters`, and the option that names filters for other commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.output import say_json, say_table

if TYPE_CHECKING:
    from testbench.estimation.filters import OrientationFilter

FiltersOption = Annotated[
    str | None,
    typer.Option("--filters", help="Orientation filters, separated by commas: names, or path/to/file.py:ClassName."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")]


def parse_filters(text: str | None) -> list[str | OrientationFilter] | None:
    """Filters of a comma-separated list, checked before anything moves; those that ship with the bench stay names."""
    if text is None:
        return None
    from testbench.estimation.filters import FILTERS, choose_filters
    from testbench.estimation.filters.plugins import find_filter
    from testbench.exceptions import InputError

    entries = [entry.strip() for entry in text.split(",") if entry.strip()]
    if not entries:
        raise InputError("--filters names no filter")
    chosen = [entry if entry in FILTERS else find_filter(entry) for entry in entries]
    choose_filters(chosen)
    return chosen


def filters(
    json: JsonOption = False,
) -> None:
    """List the orientation filters."""
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
        say_table("Installed", ["name", "from"], [[name, point.value] for name, point in installed_filters().items()])
