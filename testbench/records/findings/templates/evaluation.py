"""Findings of the stage `evaluate`: what was not judged, and what its results rest on."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "plan.warning": Template(WARNING, "{text}"),
    "plan.reference": Template(WARNING, "{text}"),
    "run.incomplete": Template(WARNING, "{how}: {message}"),
    "run.resumed": Template(NOTE, "this session {goes_on}"),
    "repeats.left_out": Template(
        NOTE,
        "the session {session} does not count among the repetitions: {why}",
    ),
    "repeats.one_part": Template(
        NOTE,
        "all repetitions are of one part ({part})",
        "their scatter does not hold what another part would change",
    ),
    "judged.no_step": Template(
        WARNING, "no step of the protocol was finished, so there is nothing to evaluate"
    ),
    "judged.unmeasured": Template(WARNING, "{metric} by {filter} has a limit but was not measured"),
    "judged.no_uncertainty": Template(
        WARNING,
        "{metric} by {filter}{section} is marginal and cannot pass, for its uncertainty is not "
        "known: {why}",
    ),
    "judged.delay_unstated": Template(
        NOTE,
        "nobody states how much older than its stamp a rate is; half an interval is taken",
        "its clock, fitted to the rates, may be off by {half_ms:.3g} ms; every U and the "
        "uncertainty of every delay hold that",
        "state the delay with its low pass: `gyr_delay_ms` of a sensor in a mapping",
    ),
    "judged.low_pass_unstated": Template(
        NOTE,
        "it is stated when its rates are sampled, and not the delay of a low pass before that",
        "none is taken off; its clock, fitted to the rates, may be off by {half_ms:.3g} ms; every "
        "U and the uncertainty of every delay hold that",
        "state the delay of both together: `gyr_delay_ms` of a sensor in a mapping",
    ),
    "judged.filter_left_out": Template(NOTE, "{filter} was left out: {why}"),
    "judged.samples_left_out": Template(
        WARNING, "{count} {count:sample|samples} left out: {reason}"
    ),
    "judged.after_gap": Template(
        WARNING,
        "{count} {count:sample|samples} left out: after a gap",
        "nobody knows how it turned in there: after 0.25 s without readings a filter needs a "
        "second to settle, and what follows 1 s without rates is evaluated only where 10 s of a "
        "truth tell its heading anew",
        "to have what follows a long gap in frames of its own, cut the file there and import the "
        "rest as a recording of its own",
    ),
    "judged.no_truth": Template(NOTE, "no truth, so its orientation is not evaluated"),
    "judged.nothing": Template(NOTE, "nothing was evaluated: {cause}"),
    "comparison.no_truth": Template(
        NOTE,
        "compared with {filter}, which is a comparison and no truth: what lies between both is a "
        "difference, and an error of neither",
    ),
    "comparison.none": Template(WARNING, "not compared with {filter}: {why}"),
    "cycles.none_found": Template(
        NOTE,
        "no cycles were found in {signal}: fewer than three, each from one largest value to the "
        "next, are whole and alike",
    ),
    "judged.not_aligned": Template(WARNING, "{filters} not evaluated: not aligned to the truth"),
    "judged.joint_not_aligned": Template(
        WARNING, "{filters} not evaluated: a sensor of it was not aligned to the truth"
    ),
    "judged.angles_not_aligned": Template(
        WARNING, "{filters} not evaluated: its true angles could not be aligned in time"
    ),
    "truth.angles_exchanged": Template(
        WARNING,
        "the truth of its {angle} moves as its {other} does, and the other way round",
        "two angles were exchanged, and the errors are those of the truth as it was read",
        "exchange them with --truth-angle, or in `truth_angles` of the mapping",
    ),
    "truth.angle_unit": Template(
        WARNING,
        "the truth of its {angle} moves {ratio:.3g} times as far as the estimate does",
        "degrees were taken for radians, or the other way round: times {factor:.3g} it would fit; "
        "the errors are those of the truth as it was read",
        "state the unit with --joint-unit, or with `unit` of `truth_angles` in the mapping",
    ),
    "truth.angle_reversed": Template(
        WARNING,
        "the truth of its {angle} runs against the estimate (correlation {correlation:.2f})",
        "one of the two counts the other way, and the errors are those of the truth as it was read",
        "a minus before its column turns it: --truth-angle JOINT.ANGLE=-COLUMN",
    ),
    "truth.angle_unlike": Template(
        WARNING,
        "the truth of its {angle} hardly goes with the estimate (correlation {correlation:.2f} "
        "where both are aligned)",
        "it may be the angle of another joint, side or trial, or a sensor slipped; the errors are "
        "those of the truth as it was read",
        "--truth-angle JOINT.ANGLE=COLUMN says which column it is; --truth-offset, which time",
    ),
    "truth.angle_held": Template(
        WARNING,
        "the truth of its {angle} stays at {at_deg:.1f} deg, up to {longest_s:.2f} s at once, "
        "while the estimate moves by up to {moved_deg:.1f} deg",
        "it is at the end of its range, was lost and held, or was cut off; {count} of {samples} "
        "samples are not evaluated there",
    ),
    "truth.angle_offset": Template(
        NOTE,
        "the estimate of its {angle} is {offset_deg:+.1f} deg from the truth throughout, and "
        "follows it to {spread_deg:.1f} deg RMS beside that",
        "its zero is that of another pose or definition, or the placement is off: that is part of "
        "the errors, and the table by angle gives them without it, too",
    ),
    "judged.truth_lost": Template(
        NOTE, "{count} of {samples} samples not evaluated: the truth is not known there"
    ),
    "judged.no_truth_of_joint": Template(NOTE, "no truth, so its angle is not evaluated"),
    "judged.joint_covered": Template(
        NOTE,
        "{filter}: the 95 % interval that is stated of its flexion holds {percent:.0f} % of its "
        "errors",
    ),
    "judged.truth_jumps": Template(
        WARNING, "{count} {count:orientation|orientations} of the truth left out: jumps"
    ),
    "judged.steps_left_out": Template(
        WARNING, "{lost} of {planned} {kind} not evaluated: {reasons}"
    ),
    "judged.few_samples": Template(
        WARNING, "only {judged} of {planned} samples evaluated: {reasons}"
    ),
    "judged.few_samples_of_others": Template(
        WARNING, "only {judged} of {planned} samples of the others evaluated: {reasons}"
    ),
    "filter.tuned": Template(NOTE, "{filter} ran with {parameters}, tuned for {objective} on {on}"),
    "filter.tuned_to": Template(
        NOTE,
        "{filter} was tuned to come near {comparison}, which is a comparison and no truth: its "
        "parameters are not shown to be better",
    ),
    "filter.tuned_here": Template(
        WARNING,
        "{filter} was tuned on this session: its errors here are those of a fit, not of a test",
    ),
    "filter.set": Template(NOTE, "{filter} ran with {parameters}, set for this estimate"),
    "arm_time.early": Template(
        WARNING,
        "arm time is doubtful by {lead_s:.2g} s: in {early} of {steps} steps the arm moves before "
        "it was commanded, so the truth does not belong to the sensors' samples",
    ),
    "arm_time.missed": Template(
        WARNING,
        "of the controller's samples {missed} ({share_percent:.2g} %) did not come, the longest "
        "gap is {gap_s:.2g} s; the truth is not known in gaps beyond {widest_s:g} s",
    ),
    "arm_time.step": Template(
        WARNING,
        "the clocks of controller and bench parted by {by_s:.2g} s before {at_s:.1f} s, by two "
        "witnesses: a motion's stamp before its command, or a sample from the future, and all "
        "samples of that time; arm times follow from there on, and are off by as much before, at "
        "most since the last motion began",
    ),
    "arm_time.unsure": Template(
        WARNING,
        "arm time may be off by {unsure_ms:.2g} ms: the controller's samples came late through "
        "whole seconds, or it answered slowly; up to {sure_ms:g} ms are usual, and no limit is "
        "passed beyond",
    ),
    "arm_time.doubtful": Template(
        WARNING,
        "arm time is doubtful by {lead_s:.2g} s at {at_s:.1f} s: a motion seemed to begin before "
        "it was commanded",
    ),
    "chain.no_true_angles": Template(
        WARNING, "not evaluated, for no arm reported the true angles of its joints"
    ),
    "chain.no_sample": Template(
        WARNING,
        "not evaluated, for no sample is left: settling_s leaves out as much as its steps last, or "
        "none was finished",
    ),
    "chain.overconfident": Template(
        WARNING,
        "the uncertainties that it states are too small for {low} of {joints} joints: 1.96 of "
        "them cover {covered_percent:.0f} % of the errors of {worst}, where 95 % would be honest",
    ),
    "cycles.duration": Template(
        WARNING,
        "the sweep '{step}' lasted {lasted_s:.2f} s where {planned_s:.2f} s were planned, so that "
        "nobody knows where its cycles begin: they are not averaged",
    ),
    "cycles.too_few": Template(
        NOTE,
        "no average cycle of {missing} of {sweeps} sweeps: fewer than {least} of their cycles are "
        "evaluated from end to end, or the angle hardly changes",
    ),
    "cycles.unlike": Template(
        WARNING,
        "the true angle of {joint} in step {step} differs from one cycle of {period_s:.3g} s to "
        "the next by {sd_deg:.2f} deg (standard deviation) of a range of {range_deg:.1f} deg: it "
        "is not periodic as planned, and its average cycle says little",
    ),
}
