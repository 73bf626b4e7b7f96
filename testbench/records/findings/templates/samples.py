"""Findings on samples: readings that a sensor cannot have measured, and what was left out."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "samples.zeros": Template(
        WARNING,
        "{count} {count:sample reads|samples read} exactly 0 in every axis of {quantities}, the "
        "first at {first_s:.2f} s",
        "a dropout that was written as zeros; they count as lost",
        "`estimate: {{keep: [zeros]}}` if they are real",
    ),
    "samples.stuck": Template(
        WARNING,
        "{count} {count:sample repeats|samples repeat} the one before in every axis of "
        "{quantities}, the first at {first_s:.2f} s, for longer than its noise can",
        "the readings froze; they count as lost",
        "`estimate: {{keep: [stuck]}}` if they are real",
    ),
    "samples.stuck_axis": Template(
        WARNING,
        "{count} {count:sample repeats|samples repeat} the one before in one axis of {quantities}, "
        "the first at {first_s:.2f} s, for longer than its noise can, while others go on",
        "that axis froze; they count as lost",
        "`estimate: {{keep: [stuck]}}` if they are real",
    ),
    "samples.dead_axis": Template(
        WARNING,
        "its {quantity} reads the same throughout in {axes}, while others go on",
        "that axis was not recorded, or is dead; nothing is computed from its {quantity}",
        "map the right column, or `estimate: {{keep: [stuck]}}` if that is real",
    ),
    "samples.twin_axes": Template(
        WARNING,
        "its {quantity} reads the same in {axes} throughout",
        "one column was written or mapped twice, and the other is missing; nothing is computed "
        "from its {quantity}",
        "map the right column, or `estimate: {{keep: [stuck]}}` if that is real",
    ),
    "samples.clipped": Template(
        WARNING,
        "{count} {count:sample stands|samples stand} at the largest reading of {quantities}, "
        "several in a row, the first at {first_s:.2f} s",
        "the motion went beyond the sensor's range; they are not evaluated",
        "state its `full_scale`, or `estimate: {{keep: [clipped]}}` if they are real",
    ),
    "samples.wrapped": Template(
        WARNING,
        "{count} {count:sample|samples} of {quantities} {count:stands|stand} at the other end of "
        "the range, the first at {first_s:.2f} s, after a jump over nearly all of it, and back by "
        "another",
        "the counts ran over the end of their 16 bits and changed sign; they count as lost",
        "set a larger range of the sensor, or read its registers with more bits; "
        "`estimate: {{keep: [wrapped]}}` if they are real",
    ),
    "samples.spike": Template(
        WARNING,
        "{count} single {count:sample|samples} of {quantities} {count:stands|stand} far off "
        "{count:its|their} neighbours, the first at {first_s:.2f} s",
        "no sensor's bandwidth lets that pass; they count as lost",
        "`estimate: {{keep: [spike]}}` if they are real",
    ),
    "samples.straight": Template(
        WARNING,
        "{count} {count:sample|samples} of {quantities} {count:lies|lie} on straight lines between "
        "others in every axis, the first at {first_s:.2f} s, as noise does not",
        "lost samples that a logger or an exporter filled in; they count as lost",
        "`estimate: {{keep: [straight]}}` if they are real",
    ),
    "samples.resampled": Template(
        NOTE,
        "its {quantity} bends once in {rows:.3g} samples and runs in straight lines in between",
        "it was recorded at that lower rate, and interpolated to this one: what lies between is no "
        "measurement, and its noise is not the sensor's",
        "export it at the rate that it was recorded at",
    ),
    "samples.beyond": Template(
        WARNING,
        "{count} {count:sample|samples} of {quantities} {count:is|are} beyond what any sensor "
        "reads, the first at {first_s:.2f} s",
        "they count as lost",
        "if all of it is too large, its unit is another one: `--unit`, or `unit` in the mapping",
    ),
    "samples.excluded": Template(
        NOTE,
        "{count} {count:sample|samples} from {first_s:.2f} s on {count:is|are} excluded: {reason}",
        "they count as lost, as was asked for",
    ),
    "samples.dead": Template(
        WARNING,
        "its {quantity} reads the same throughout",
        "it was not recorded, or is dead; nothing is computed from it",
        "`estimate: {{keep: [stuck]}}`, or `keep: [zeros]`, if that is real",
    ),
    "samples.slower": Template(
        NOTE,
        "its {quantity} has a new reading in one of {rows:.3g} samples only",
        "it runs at a lower rate than the recording, and is used where it is new",
    ),
}
