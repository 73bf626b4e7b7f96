"""The section of the report on the recording itself: timing, quality, noise at rest."""

from __future__ import annotations

import numpy as np

from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation, NoiseRow
from testbench.records.results.recording_rows import RestRow
from testbench.reporting.page.page import Section, Sentence
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    number,
    significant,
    text,
    to_uncertainty,
    unit_words,
)
from testbench.reporting.sections.allan import allan_blocks
from testbench.reporting.sections.findings import finding_sentences


def recording_section(estimate: Estimate, evaluation: Evaluation | None) -> Section:
    """How well the sensors were recorded, and what they read at rest."""
    section = Section("recording", "Recording")
    section.blocks += [_timing(estimate), _quality(estimate)]
    if evaluation is None:  # else they stand with the verdict
        section.blocks += finding_sentences(
            found.at(name) for name, sensor in estimate.sensors.items() for found in sensor.findings
        )
    if evaluation is not None and evaluation.rests:
        section.blocks.append(_rests(evaluation.rests))
    if evaluation is not None and evaluation.noise:
        section.blocks += [*allan_blocks(evaluation), _noise(evaluation.noise)]
    else:
        section.blocks.append(Sentence(_no_noise(evaluation)))
    return section


def _no_noise(evaluation: Evaluation | None) -> str:
    """Why there is no noise, with the longest rest where it is known."""
    rests = [] if evaluation is None else evaluation.rests
    said = ", ".join(f"{row.sensor} {digits(row.longest_s, 1)} s" for row in rests)
    longest = f": it takes {rests[0].needed_s:g} s, and the longest is {said}" if rests else ""
    return f"No rest was long enough to say anything of noise{longest}."


SEEN_BY = {
    "gyr": "its gyroscope",
    "device": "its own orientation",
    "acc": "its accelerometer alone",
}


def _rests(rests: list[RestRow]) -> Table:
    rows = [
        Row(
            [
                label(row.sensor),
                text(SEEN_BY.get(row.by, row.by)),
                number(row.rests, 0),
                number(row.total_s, 1),
                number(row.longest_s, 1),
            ]
        )
        for row in rests
    ]
    return Table(
        "Rests",
        header("sensor", "seen by", "rests", "in all [s]", "longest [s]", numbers_from=2),
        rows,
        f"How to read: rests of half a second and more; noise takes one of {rests[0].needed_s:g} "
        "s. An accelerometer alone does not see turns about the vertical.",
    )


def _timing(estimate: Estimate) -> Table:
    rows = []
    for name, sensor in estimate.sensors.items():
        t = sensor.timing
        rows.append(
            Row(
                [
                    label(name),
                    number(t.samples, 0),
                    number(t.nominal_rate_hz, 2),
                    number(t.sampling_rate_hz, 3),
                    number(t.effective_rate_hz, 3),
                    number(t.jitter_ms, 3),
                    number(t.repeated_stamps + t.backward_stamps, 0),
                    number(t.gaps, 0),
                    number(t.longest_gap_ms, 1),
                    number(t.lost_percent, 2),
                    number(t.arrival_jitter_ms, 2),
                    _lag(t.acc_after_gyr_ms, 2 * t.acc_after_gyr_sd_ms),
                ]
            )
        )
    return Table(
        "Timing of each sensor, by its own clock",
        header(
            "sensor",
            "samples",
            "nominal [Hz]",
            "sampling [Hz]",
            "effective [Hz]",
            "jitter [ms]",
            "bad stamps",
            "gaps",
            "longest gap [ms]",
            "lost [%]",
            "arrival jitter [ms]",
            "acc. after gyr. [ms]",
        ),
        rows,
        "How to read: sampling counts the intervals that are no gaps, effective all that arrived; "
        "jitter is the standard deviation of those intervals, bad stamps are repeated or run "
        "backwards, a gap is over 1.5 intervals. The last column is how much later the "
        "accelerometer sees a turn, ± its expanded uncertainty (95 %) by the scatter between "
        "stretches; a dash means that the motion does not tell.",
    )


def _lag(value: float, expanded: float) -> Cell:
    """A lag with its expanded uncertainty, both [ms]; a dash where the motion does not tell."""
    if not np.isfinite(value) or not expanded > 0:
        return number(value, 2)
    return Cell(f"{to_uncertainty(value, expanded)} ± {digits(expanded, 2)}", kind="number")


def _quality(estimate: Estimate) -> Table:
    sensors = estimate.sensors.values()
    reasons = list(dict.fromkeys(reason for sensor in sensors for reason in sensor.quality))
    rows = [
        Row(
            [
                label(name),
                *(number(sensor.quality.get(reason), 0) for reason in reasons),
                number(int(sensor.left_out.sum()) * sensor.every, 0),
                number(100 * float(sensor.left_out.mean()), 3),
            ]
        )
        for name, sensor in estimate.sensors.items()
    ]
    return Table(
        "Samples that the quality gates left out",
        header("sensor", *reasons, "in all", "in all [%]"),
        rows,
        "How to read: samples by reason; one may have several. Samples left out are in no average "
        "of this report.",
    )


def _noise(rows: list[NoiseRow]) -> Table:
    def with_sd(value: float | None, sd: float | None) -> Cell:
        shown = to_uncertainty(value, sd)
        return Cell(
            shown if sd is None or value is None else f"{shown} ± {to_uncertainty(sd, sd)}",
            kind="number",
        )

    body = [
        Row(
            [
                label(row.sensor),
                text(f"{row.quantity} {row.axis}"),
                number(row.span_s, 1),
                Cell(digits(row.mean, 3), kind="number"),
                significant(row.sd),
                text(unit_words(row.unit)),
                with_sd(row.noise_density, row.noise_density_sd),
                text(unit_words(row.noise_density_unit)),
                significant(row.random_walk),
                text(unit_words(row.random_walk_unit)),
                with_sd(row.bias_instability, row.bias_instability_sd),
                text(unit_words(row.bias_instability_unit)),
            ]
        )
        for row in rows
    ]
    return Table(
        "At rest",
        [
            *header("sensor", "axis", numbers_from=9),
            *header("time [s]", "mean", "sd", numbers_from=0),
            *header("unit", numbers_from=9),
            *header("noise density", numbers_from=0),
            *header("unit", numbers_from=9),
            *header("random walk", numbers_from=0),
            *header("unit", numbers_from=9),
            *header("bias instability", numbers_from=0),
            *header("unit", numbers_from=9),
        ],
        body,
        "How to read: over the longest rest; mean and standard deviation of the raw readings, the "
        "rest from the overlapping Allan deviation with its standard uncertainty. Noise density is "
        "one-sided, as data sheets state it; a dash means that the value is lost among the others, "
        "most often because the rest is too short.",
    )
