"""What is said on the terminal of sensors and joints that nobody judges."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbench.cli.output import say_table

if TYPE_CHECKING:
    from testbench.records.results.evaluation import Evaluation
    from testbench.records.results.evaluation_rows import PlateauRow


def say_plateaus(rows: list[PlateauRow]) -> None:
    """Angles that a person typed in beside those of every filter, plateau by plateau."""
    for joint in dict.fromkeys(row.joint for row in rows):
        own = [row for row in rows if row.joint == joint]
        say_table(
            f"Plateaus of {joint}, beside the angles typed in [deg]",
            ["filter", "sequence", "plateau", "from [s]", "to [s]", "typed", "mean", "sd", "error"],
            [list(vars(row).values())[1:] for row in own],
        )


def say_description(evaluation: Evaluation) -> None:
    """Ranges of motion, cycles, changes of orientation and comparisons, where there are any."""
    if evaluation.angle_ranges:
        _say_ranges(evaluation)
    if evaluation.found_cycles:
        _say_cycles(evaluation)
    if evaluation.comparison:
        _say_comparison(evaluation)
    if evaluation.orientation_changes:
        _say_changes(evaluation)
    if evaluation.rests:
        say_table(
            "Rests of half a second and more; noise takes one of "
            f"{evaluation.rests[0].needed_s:g} s",
            ["sensor", "seen by", "rests", "in all [s]", "longest [s]"],
            [[r.sensor, r.by, r.rests, r.total_s, r.longest_s] for r in evaluation.rests],
        )


def _say_ranges(evaluation: Evaluation) -> None:
    rows = evaluation.angle_ranges
    keys = dict.fromkeys((r.kind, r.owner, r.filter, r.sequence) for r in rows)
    reached = {(r.kind, r.owner, r.filter, r.sequence, r.angle): r.range_deg for r in rows}
    for kind, title in (("joint", "joint angles"), ("sensor", "Euler angles of the sensors")):
        own = [key for key in keys if key[0] == kind]
        if own:
            say_table(
                f"Range of the {title} [deg], not evaluated",
                [kind, "filter", "sequence", "first", "second", "third"],
                [
                    [*key[1:], *(reached[(*key, angle)] for angle in ("first", "second", "third"))]
                    for key in own
                ],
            )


def _say_cycles(evaluation: Evaluation) -> None:
    say_table(
        "Cycles found in the data, from one largest value to the next",
        ["of", "signal", "filter", "cycles", "left out", "Hz", "range", "sd", "unit"],
        [
            [
                r.owner,
                r.signal,
                r.filter,
                r.cycles,
                r.left_out,
                r.frequency_hz,
                r.range,
                r.range_sd,
                r.unit,
            ]
            for r in evaluation.found_cycles
        ],
    )


def _say_comparison(evaluation: Evaluation) -> None:
    say_table(
        "Comparison, no judgement: difference of two orientations [deg], the mean heading between "
        "their worlds taken off",
        ["sensor", "orientation", "against", "mean", "RMS", "largest", "heading off", "mean |dq|"],
        [
            [
                r.sensor,
                r.first,
                r.second,
                r.mean_deg,
                r.rms_deg,
                r.max_deg,
                r.heading_offset_deg,
                r.mean_quaternion_length,
            ]
            for r in evaluation.comparison
        ],
    )


def _say_changes(evaluation: Evaluation) -> None:
    returned = evaluation.orientation_changes[0].returned
    what = (
        "Closure error of the orientation, stated to be the same in the first and last rest [deg]"
        if returned
        else "Change of orientation between the first and the last rest [deg], no error"
    )
    say_table(
        what,
        ["sensor", "filter", "from [s]", "to [s]", "total", "heading", "inclination"],
        [
            [
                r.sensor,
                r.filter,
                r.first_s,
                r.last_s,
                r.total_deg,
                r.heading_deg,
                r.inclination_deg,
            ]
            for r in evaluation.orientation_changes
        ],
    )
