"""The command `tune`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import (
    CalibrationOption,
    JsonOption,
    NoVerifyOption,
    SetOption,
    complete_filter,
    entries_of,
    filter_parameters,
    optional,
)
from testbench.cli.output import say, say_json, say_table, teller

if TYPE_CHECKING:
    from testbench.records.results.tuning import Tuning


# Long by its options, one parameter each, and the request that holds them.
def tune(
    sessions: Annotated[list[Path], typer.Argument(help="Sessions to tune on, with truth.")],
    filter_name: Annotated[
        str,
        typer.Option(
            "--filter",
            help="Filter: a name, or path/to/file.py:ClassName.",
            autocompletion=complete_filter,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="File to write (.json).")],
    objective: Annotated[
        str | None,
        typer.Option(
            "--objective",
            help="Metric to make small: total_rmse_deg (if none is named), heading_rmse_deg, "
            "inclination_rmse_deg of the sensors, "
            "flexion_rmse_deg, flexion_mean_abs_error_deg of the joints; elbow.flexion_rmse_deg is "
            "that of one of them. Of a comparison: total_difference_rms_deg (if none is named) and "
            "so on.",
        ),
    ] = None,
    compare: Annotated[
        str | None,
        typer.Option(
            "--compare",
            metavar="FILTER",
            help="In place of a truth: come near this filter, such as 'device'. No judgement.",
        ),
    ] = None,
    parameters: Annotated[
        str | None,
        typer.Option("--parameters", help="Which to tune, separated by commas; all without it."),
    ] = None,
    test: Annotated[
        list[Path] | None,
        typer.Option("--test", help="Session to test on, never tuned on; may be repeated."),
    ] = None,
    test_share: Annotated[
        float | None,
        typer.Option(
            "--test-share", help="Draw this part of the sessions for the test instead, 0 to 1."
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the draw of --test-share.")
    ] = 0,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out", help="Also test each session by the set that all others choose."
        ),
    ] = False,
    values: Annotated[
        int, typer.Option("--values", min=3, help="Values of each parameter in the grid.")
    ] = 9,
    points: Annotated[
        int, typer.Option("--points", min=1, help="Most points of a grid of every combination.")
    ] = 300,
    no_refinement: Annotated[
        bool, typer.Option("--no-refinement", help="The grid alone, without Nelder-Mead.")
    ] = False,
    start: SetOption = None,
    calibration: CalibrationOption = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Find the parameters of a filter that suit sessions best, each alone and all together."""
    from testbench.pipeline.request import TuneRequest
    from testbench.pipeline.tune import tune as find_parameters
    from testbench.pipeline.watcher import Watcher

    asked = TuneRequest(
        sessions=tuple(map(str, sessions)),
        filter=filter_name,
        out=str(out),
        objective=objective,
        compare=compare,
        tuned=entries_of(parameters),
        parameters=filter_parameters(start),
        test=tuple(map(str, test or ())),
        test_share=test_share,
        seed=seed,
        leave_one_out=leave_one_out,
        values=values,
        points=points,
        refinement=not no_refinement,
        calibrations=optional(calibration),
        verify=not no_verify,
    )
    found = find_parameters(asked, Watcher(say=teller(json)))
    if json:
        say_json({"file": str(out), **found.model_dump()})
    else:
        _say_tuning(found)
        say(f"tuning: {out}")


# Long by its tables: the parameters, what they were tuned on, and the test.
def _say_tuning(found: Tuning) -> None:
    say_table(
        f"{found.filter}, tuned for {found.objective}",
        ["parameter", "tuned", "at an end of its range"],
        [
            [name, found.parameters[name], "yes" if name in found.at_edge else ""]
            for name in found.tuned
        ],
    )
    against = "" if found.comparison is None else f", compared with {found.comparison}"
    tuned_on = found.of_role("tuning")
    rows: list[list[Any]] = [
        [
            entry.session,
            entry.default_value,
            entry.value,
            entry.own_value,
            _words(entry.own_parameters or {}),
        ]
        for entry in tuned_on
    ]
    rows.append(["mean", found.default_value, found.value, None, ""])
    columns = ["session", "default", "one set for all", "own optimum", "own parameters"]
    if found.split.leave_one_out:
        columns.append("by the set of all others")
        left_out = [entry.left_out_value for entry in tuned_on]
        known = [value for value in left_out if value is not None]
        for row, value in zip(
            rows, [*left_out, sum(known) / len(known) if known else None], strict=True
        ):
            row.append(value)
    say_table(f"Tuned on: {found.objective}{against}, not a test", columns, rows)
    tests = found.of_role("test")
    if tests:
        rows = [[entry.session, entry.default_value, entry.value] for entry in tests]
        say_table(
            f"Test: {found.objective}{against}, never tuned on",
            ["session", "default", "tuned"],
            rows,
        )
    elif not found.split.leave_one_out:
        say("note: no session was held out, so it is not known what the set is worth on others")
    if found.comparison is not None:
        say(
            f"note: {found.comparison} took the place of the truth: it is a comparison, and the "
            "parameters are not shown to be better"
        )
    if not found.search.converged:
        say("note: the refinement did not come to rest")
    for name in found.at_edge:
        say(f"note: the best {name} is an end of the range that was searched")


def _words(parameters: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in parameters.items())
