"""What people and programs read on the terminal."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from testbench.exceptions import BenchError
    from testbench.execution.run_progress import Progress as RunProgress
    from testbench.records.findings.finding import Finding
    from testbench.records.results.evaluation import ChainRow, Evaluation, NoiseRow
    from testbench.records.session.plan import Plan

from testbench.cli.narrow import NOTHING, fit
from testbench.records.results.numbers import decimals_by, show_number

COLOURS = {"pass": "green", "marginal": "yellow", "fail": "red", "not measured": "magenta"}


def say_error(message: str, notes: Sequence[str] = ()) -> None:
    """One message on stderr; lines of a list each stand alone, and notes follow."""
    for line in message.splitlines() or [message]:
        print(f"error: {line}", file=sys.stderr)
    for note in notes:
        print(note, file=sys.stderr)


def say_json_error(error: BenchError) -> None:
    """One line of JSON on stderr: kind of error, message, exit code, and place in a file."""
    from testbench.exceptions import FileProblems
    from testbench.records.disk.json_file import plain_values

    told: dict[str, Any] = {
        "kind": type(error).__name__,
        "message": str(error),
        "exit_code": error.exit_code,
    }
    told |= {"notes": error.__notes__} if hasattr(error, "__notes__") else {}
    if isinstance(error, FileProblems):
        told |= {"file": error.file, "problems": [vars(problem) for problem in error.problems]}
    print(json.dumps({"error": plain_values(told)}, allow_nan=False), file=sys.stderr)


def say(message: str) -> None:
    """A line for people, on stdout."""
    print(message)


def say_note(message: str) -> None:
    """A line for people on stderr, which is no error."""
    print(message, file=sys.stderr)


def say_findings(findings: Iterable[Finding]) -> None:
    """A line a finding, which says how much it weighs; what weighs more stands first, and what is
    the same of several sensors is said once.
    """
    same: dict[tuple[str, ...], list[Finding]] = {}
    for one in sorted(findings, key=lambda one: one.severity != "warning"):
        same.setdefault((one.severity, one.sentence, one.remedy), []).append(one)
    for alike in same.values():
        where = ", ".join(one.where for one in alike if one.where)
        say(f"{alike[0].severity}: {replace(alike[0], where=where)}")


def say_json(data: Any) -> None:
    """One line of JSON on stdout."""
    from testbench.records.disk.json_file import plain_values

    print(json.dumps(plain_values(data), allow_nan=False))


def in_ranges(numbers: Sequence[int], longest: int = 100) -> str:
    """Rising whole numbers in few words, such as "3, 12-40, 45".

    Of what makes more than so many characters, how many more.
    """
    spans: list[list[int]] = []
    for number in numbers:
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    said, left = "", len(numbers)
    for first, last in spans:
        words = (", " if said else "") + (f"{first}" if first == last else f"{first}-{last}")
        if said and len(said + words) > longest:
            return f"{said} and {left} more"
        said, left = said + words, left - (last - first + 1)
    return said


def say_table(title: str, columns: list[str], rows: list[list[Any]]) -> None:
    """A table on stdout."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
    numeric = [
        bool(rows) and all(row[i] is None or _is_number(row[i]) for row in rows)
        for i in range(len(columns))
    ]
    layout = fit(
        columns, [[_shown(value) for value in row] for row in rows], numeric, console.width
    )
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=layout.widths is None)
    if layout.widths is not None:
        table.padding = (0, 1, 0, 0)
    for place, i in enumerate(layout.kept):
        width = None if layout.widths is None else layout.widths[place]
        table.add_column(
            escape(columns[i]),
            justify="right" if numeric[i] else "left",
            overflow="fold",
            width=width,
        )
    for row in rows:
        table.add_row(*[_cell(row[i]) for i in layout.kept])
    same = "".join(f"; {name} {value}" for name, value in layout.same)
    console.print(
        f"[bold]{escape(title + same)}[/]", *([] if layout.widths is None else [""]), sep="\n"
    )
    console.print(
        table,
        *([] if layout.widths is None else [""]),
        sep="\n",
        width=max(console.width, layout.width),
        crop=False,
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class RunDisplay:
    """A bar with step, part done and remaining time on stderr, and lines above it.

    Where there is no terminal, the lines alone.

    The bar appears with the first progress, so that whoever is asked something before has the
    terminal alone.

    Args:
        bar: Of rich, not started.
    """

    def __init__(self, bar: Any):
        self._bar, self._task = bar, bar.add_task("starting", total=None)
        self._started = False

    def __call__(self, progress: RunProgress) -> None:
        """Show how far a run is."""
        if not self._started:
            self._bar.start()
            self._started = True
        text = progress.doing or f"step {progress.index + 1}/{progress.steps}: {progress.step}"
        self._bar.update(
            self._task, description=text[:60], total=progress.duration, completed=progress.time
        )

    def say(self, line: str) -> None:
        """Print a line that stays."""
        self._bar.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Take the bar away."""
        if self._started:
            self._bar.stop()


@contextmanager
def progress_bar(shown: bool) -> Iterator[RunDisplay | None]:
    """A display of a run, or None."""
    if not shown:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    hidden = not console.is_terminal
    display = RunDisplay(Progress(*columns, console=console, transient=True, disable=hidden))
    try:
        yield display
    finally:
        display.close()


def teller(json: bool) -> Callable[[str], None]:
    """What tells a person at a terminal, on stderr, what is being done; nobody else is told."""

    def tell(text: str) -> None:
        if not json and sys.stderr.isatty():
            print(text, file=sys.stderr)

    return tell


def say_check(plan: Plan) -> None:
    """What a plan will do, and how near it comes to every limit."""
    check, spec = plan.check, plan.protocol.spec
    say(f"{spec.name} on {plan.robot.name}: {check.steps} steps, {check.duration_s:.1f} s")
    say_table(
        "Joints",
        [
            "joint",
            "from [deg]",
            "to [deg]",
            "speed [deg/s]",
            "limit [deg/s]",
            "acceleration [deg/s^2]",
            "limit [deg/s^2]",
        ],
        [list(vars(joint).values()) for joint in check.joints],
    )
    say_table(
        "Sensors, largest on one axis",
        ["sensor", "rate [deg/s]", "range [deg/s]", "specific force [m/s^2]", "range [m/s^2]"],
        [list(vars(sensor).values()) for sensor in check.sensors],
    )
    c = check.clearance
    if c is not None:
        where = f"{c.first} and {c.second} at t = {c.time_s:.2f} s (step '{c.step}')"
        say(f"smallest clearance: {c.distance_mm:.1f} mm between {where}")
    else:
        say("clearance: this arm has no collision bodies")
    for flexion in check.flexions:
        say(flexion.sentence)
    for warning in check.warnings:
        say(f"warning: {warning}")


def say_warning(message: str) -> None:
    """One warning on stderr."""
    print(f"warning: {message}", file=sys.stderr)


def say_warnings(plan: Plan) -> None:
    """What is doubtful about a plan, on stderr, before it is run."""
    for warning in plan.check.warnings:
        say_warning(warning)


def say_evaluation(
    evaluation: Evaluation,
    session: str,
    report: str | None,
    simulated: Sequence[str] = (),
    tables: bool = True,
) -> None:
    """The summary of a session: its tables where asked for, then what it answers.

    Args:
        evaluation: Of the session.
        session: Its folder.
        report: Where its report lies; none if None.
        simulated: What of the session was not real.
        tables: Whether its numbers are shown, too.
    """
    from testbench.records.results.answer import answers

    if tables:
        _say_tables(evaluation)
    say_findings(evaluation.findings)
    for answer in answers(evaluation):
        say(answer.text)
    say(f"outcome: {evaluation.verdict}")
    if simulated:
        say(f"simulated: {' and '.join(simulated)}")
    say(f"session: {session}")
    if report:
        say(f"report:  {report}")


def _say_tables(evaluation: Evaluation) -> None:
    """The numbers of a session."""
    if evaluation.limited:
        _say_verdict(evaluation)
    _say_flexion(evaluation)
    _say_angles(evaluation)
    if evaluation.chain:
        _say_chain(evaluation)
    if evaluation.orientation:
        _say_orientation(evaluation)
    _say_repeats(evaluation)
    say_noise(evaluation.noise)


def _say_verdict(evaluation: Evaluation) -> None:
    """Metrics with limits, and whether they keep them; what equal sessions say, where some are
    named.
    """
    more = (
        ["sd of sessions", "otherwise [%]"]
        if any(metric.sessions for metric in evaluation.metrics)
        else []
    )
    say_table(
        "Verdict",
        ["metric", "filter", "section", "value", "U", "lower", "upper", "outcome", *more],
        [
            [
                m.name,
                m.filter or "",
                m.section or "",
                m.value,
                m.expanded_uncertainty,
                m.lower,
                m.upper,
                m.outcome.words,
                *((m.session_sd, m.otherwise_percent) if more else ()),
            ]
            for m in evaluation.metrics
            if m.outcome is not None
        ],
    )


def _say_repeats(evaluation: Evaluation) -> None:
    """What sessions of the same protocol scatter by, of what has a limit or is ranked."""
    from testbench.records.results.evaluation_rows import RANKED_METRICS

    sessions = evaluation.repeated_sessions
    if not sessions:
        return
    limited = {m.name for m in evaluation.metrics if m.outcome is not None}
    parts = {session.part for session in sessions}
    say_table(
        f"Over {len(sessions)} sessions of this protocol"
        + ("" if None in parts else f", {len(parts)} {'part' if len(parts) == 1 else 'parts'}"),
        ["metric", "filter", "section", "sequence", "this one", "mean", "sd", "another, 95 %"],
        [
            [
                row.name,
                row.filter or "",
                row.section or "",
                row.sequence or "",
                row.values[0],
                row.mean,
                row.sd,
                " to ".join(f"{end:.2f}" for end in row.another_95 or ()) + f" {row.unit}",
            ]
            for row in evaluation.repeats
            if row.name in limited or row.name.partition(".")[2] in RANKED_METRICS
        ],
    )


def _say_flexion(evaluation: Evaluation) -> None:
    """Errors of the joint angles, where there are any."""
    keys = sorted({(r.joint, r.section, r.filter, r.sequence) for r in evaluation.joint_angle})
    if not keys:
        return
    wanted = (
        "flexion_mean_error_deg",
        "flexion_mean_abs_error_deg",
        "flexion_rmse_deg",
        "flexion_max_abs_error_deg",
    )
    values = {(m.name, m.section, m.filter, m.sequence): m.value for m in evaluation.metrics}
    expanded = {
        (b.owner, b.section): b.expanded_deg
        for b in evaluation.uncertainty
        if b.quantity == "flexion"
    }
    groups = _groups(evaluation, keys)
    say_table(
        "Flexion error [deg]; U: of the truth (95 %); filters that share a letter were not "
        "shown to differ",
        [
            "joint",
            "section",
            "filter",
            "sequence",
            "mean",
            "U",
            "mean |e|",
            "RMSE",
            "max |e|",
            "group",
        ],
        [
            [j, s, f, e, mean, expanded.get((j, s)), *rest, groups.get((j, s, f, e), "")]
            for j, s, f, e in keys
            for mean, *rest in [[values.get((f"{j}.{kind}", s, f, e)) for kind in wanted]]
        ],
    )


def _say_angles(evaluation: Evaluation) -> None:
    """Errors of each angle of the joints of a body, where there are any."""
    if not evaluation.angle_errors:
        return
    say_table(
        "Errors by angle [deg]; RMS e - mean: without the constant part of the error",
        ["joint", "filter", "sequence", "angle", "mean", "RMSE", "RMS e - mean", "range"],
        [
            [
                row.joint,
                row.filter,
                row.sequence,
                row.name,
                row.mean_error_deg,
                row.rmse_deg,
                row.rmse_without_mean_deg,
                row.true_range_deg,
            ]
            for row in evaluation.angle_errors
        ],
    )


def _say_chain(evaluation: Evaluation) -> None:
    """Errors of the joints of the chain."""
    say_table(
        "Joints of the chain, error [deg]; U: of the truth (95 %); covered: errors within "
        "1.96 of the stated uncertainty",
        [
            "section",
            "joint",
            "state",
            "mean",
            "U",
            "mean |e|",
            "RMSE",
            "largest",
            "stated",
            "covered [%]",
        ],
        [
            [
                r.section,
                r.joint,
                r.state,
                r.mean_error_deg,
                r.expanded_uncertainty_deg,
                r.mean_abs_error_deg,
                r.rmse_deg,
                r.largest_error_deg,
                r.uncertainty_deg,
                r.covered_percent,
            ]
            for r in _joint_by_joint(evaluation.chain)
        ],
    )


def _say_orientation(evaluation: Evaluation) -> None:
    """Errors of the orientation filters."""
    say_table(
        "Orientation error, RMSE [deg]",
        ["sensor", "filter", "samples", "total", "heading", "inclination"],
        [
            [
                r.sensor,
                r.filter,
                r.n,
                r.total_rmse_deg,
                *(
                    part if math.isfinite(part) else None  # nobody knows where up is
                    for part in (r.heading_rmse_deg, r.inclination_rmse_deg)
                ),
            ]
            for r in evaluation.orientation
        ],
    )


def _groups(
    evaluation: Evaluation, keys: list[tuple[str, str, str, str]]
) -> dict[tuple[str, str, str, str], str]:
    """Letters by joint, section, filter and sequence; where a joint's own sequence could not be
    ranked, why.
    """
    result = {}
    for joint, section, name, sequence in keys:
        ranked = [
            row
            for row in evaluation.ranking
            if (row.owner, row.section) == (joint, section) and row.sequence
        ]
        alone = len({key[2] for key in keys if key[:2] == (joint, section)}) < 2
        letter = next(
            (row.group for row in ranked if (row.filter, row.sequence) == (name, sequence)), None
        )
        if (
            letter is None
            and not alone
            and sequence in ({row.sequence for row in ranked} or {sequence})
        ):
            letter = "not known"
        result[joint, section, name, sequence] = letter or ""
    return result


def _joint_by_joint(rows: list[ChainRow]) -> list[ChainRow]:
    """The states of each joint one below the other, sections and joints in their order."""
    places = list(dict.fromkeys((row.section, row.joint) for row in rows))
    return sorted(rows, key=lambda row: places.index((row.section, row.joint)))


def say_noise(rows: list[NoiseRow]) -> None:
    """Noise at rest; nothing where there is none."""
    if not rows:
        return
    columns = ["sensor", "axis", "time [s]", "mean", "sd", "unit", "noise density", "unit"]
    shown = [
        [
            n.sensor,
            f"{n.quantity} {n.axis}",
            n.span_s,
            n.mean,
            _significant(n.sd),
            n.unit,
            _by_uncertainty(n.noise_density, n.noise_density_sd),
            n.noise_density_unit,
        ]
        for n in rows
    ]
    if any(n.bias_instability is not None for n in rows):  # else the rest was too short for any
        columns += ["bias instability", "unit"]
        for row, n in zip(shown, rows, strict=True):
            row += [
                _by_uncertainty(n.bias_instability, n.bias_instability_sd),
                n.bias_instability_unit,
            ]
    if any(n.noise_bandwidth_hz is not None for n in rows):
        columns.append("low pass [Hz]")
        for row, n in zip(shown, rows, strict=True):
            bandwidth = n.noise_bandwidth_hz
            row.append(None if bandwidth is None else f"{bandwidth:#.2g}".rstrip("."))
    say_table("At rest; noise densities are one-sided", columns, shown)


def _by_uncertainty(value: float | None, sd: float | None) -> str | None:
    """A value and its standard uncertainty, to two digits of that."""
    decimals = decimals_by(sd)
    if value is None or sd is None or decimals is None:
        return _significant(value)
    return f"{value:.{decimals}f} ± {sd:.{decimals}f}"


def _significant(value: float | None) -> str | None:
    """Three digits that count, of numbers that may be small in their unit."""
    return None if value is None else f"{value:#.3g}".rstrip(".")


def _cell(value: Any) -> str:
    from rich.markup import escape

    text = escape(_shown(value))
    return f"[{COLOURS[value]}]{text}[/]" if isinstance(value, str) and value in COLOURS else text


def _shown(value: Any) -> str:
    """A value as people read it."""
    if value is None:
        return NOTHING
    return show_number(value) if isinstance(value, float) else str(value)
