"""The command `compare`: whether errors became larger from one side of sessions to the other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.options import (
    CalibrationOption,
    JsonOption,
    JunitOption,
    MarkdownOption,
    NoVerifyOption,
    complete_filter,
    optional,
)
from testbench.cli.output import say, say_json, say_table

if TYPE_CHECKING:
    from testbench.records.results.session_comparison import SessionComparison

NOTHING_TOLD = 2
"""Exit code where no metric shows anything: the sessions do not hold what is asked of them."""


# Long by its options, one parameter each, and the request that holds them.
def compare(
    base: Annotated[
        Path, typer.Argument(help="A session, or a folder of sessions, to compare with.")
    ],
    new: Annotated[
        list[Path],
        typer.Argument(help="Sessions, or folders of sessions: the other side together."),
    ],
    metric: Annotated[
        list[str] | None,
        typer.Option(
            "--metric",
            help="Metric as `evaluate` spells it, such as elbow.flexion_rmse_deg, or "
            "flexion_rmse_deg of every joint; may be repeated. Default: those that a report begins "
            "with.",
        ),
    ] = None,
    filter_name: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            help="Filter whose errors are compared; may be repeated.",
            autocompletion=complete_filter,
        ),
    ] = None,
    margin: Annotated[
        float,
        typer.Option("--margin", help="A larger difference counts, in the unit of the metric."),
    ] = 0.0,
    same_part: Annotated[
        bool,
        typer.Option(
            "--same-part",
            help="All sessions have the same sensors, though their manifests do not tell.",
        ),
    ] = False,
    calibration: CalibrationOption = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="HTML file to write. Default: beside the first new session."),
    ] = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write an HTML file.")
    ] = False,
    markdown: MarkdownOption = None,
    junit: JunitOption = None,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Compare sessions: which errors became larger, how sure that is, and what differs. Exit code
    1: an error became larger by more than the margin; 2: nothing could be told.
    """
    from testbench.exceptions import InputError
    from testbench.pipeline.compare import compare_sessions
    from testbench.pipeline.request import CompareRequest

    if no_report and report is not None:
        raise InputError("--report names a file that --no-report does not want")
    asked = CompareRequest(
        base=str(base),
        new=tuple(map(str, new)),
        metrics=tuple(metric or ()),
        filters=tuple(filter_name or ()),
        margin=margin,
        same_part=same_part,
        calibrations=optional(calibration),
        verify=not no_verify,
        report=optional(report),
        write_report=not no_report,
        markdown=optional(markdown),
        junit=optional(junit),
    )
    found = compare_sessions(asked)
    if json:
        say_json(found.to_dict())
    else:
        _say_comparison(found.comparison)
        if found.report:
            say(f"report:  {found.report}")
        for path in found.files:
            say(f"written: {path}")
    raise typer.Exit(_exit_code(found.comparison))


def _exit_code(comparison: SessionComparison) -> int:
    from testbench.records.results.session_comparison import Told

    if comparison.regression:
        return 1
    return NOTHING_TOLD if comparison.told is Told.NOT_KNOWN else 0


def _say_comparison(comparison: SessionComparison) -> None:
    """Both values of each metric, then the answer."""
    from testbench.records.results.comparison_words import (
        comparison_sentences,
        decimals_of,
        p_words,
    )

    rows = []
    for own in comparison.metrics:
        decimals = decimals_of(own)
        values = [
            None if value is None else f"{value:.{decimals}f}"
            for value in (own.base, own.new, own.difference)
        ]
        ends = " to ".join(f"{end:.{decimals}f}" for end in own.ci95 or ())
        place = [own.name, own.filter or "", own.section or ""]
        rows.append([*place, *values, ends or None, p_words(own.p_holm) or None, own.told.words])
    say_table(
        "New against base",
        ["metric", "filter", "section", "base", "new", "difference", "95 %", "p (Holm)", "told"],
        rows,
    )
    for sentence in [*comparison_sentences(comparison), *comparison.left_out]:
        say(sentence)
    say(f"outcome: {comparison.verdict}")
    if comparison.simulated:
        say(f"simulated: {' and '.join(comparison.simulated)}")
