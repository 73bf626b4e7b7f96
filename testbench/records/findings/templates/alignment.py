"""Findings on what was aligned: clocks, frames, and truths that do not belong to their sensor."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "clock.unfitted": Template(
        WARNING,
        "its clock could not be fitted to the motion",
        "it is late by the unknown latency of its samples",
    ),
    "clock.shifted": Template(
        NOTE,
        "its log and that of the truth did not begin together",
        "{shift_s:+.3f} s were added to the times of the truth, where the angular rates of both "
        "fit (correlation {correlation:.3f})",
    ),
    "clock.no_common_motion": Template(
        WARNING,
        "no common motion: its angular rates fit those of the truth at no one shift of their times "
        "(best correlation {correlation:.2f})",
        "the two are of different recordings, or of different bodies, or the time of one jumps; "
        "nothing of it is evaluated",
        "if both are on one clock, say so with `same_clock: true` beside the truth or "
        "`align_clock: false` in `estimate`, else state what is to be added to the truth's times "
        "with --truth-offset",
    ),
    "clock.periodic": Template(
        WARNING,
        "its motion is too periodic: it fits the truth at several shifts, {shifts_s} s",
        "which of them holds cannot be told, so nothing of it is evaluated",
        "state the right one with --truth-offset, say that both are on one clock with `same_clock: "
        "true` beside the truth, or record a motion that does not repeat itself",
    ),
    "clock.still": Template(
        WARNING,
        "it or its truth turns too slowly to tell when each log began",
        "nothing of it is evaluated",
        "if both are on one clock, say so with `same_clock: true` beside the truth or "
        "`align_clock: false` in `estimate`",
    ),
    "clock.late": Template(
        WARNING,
        "the truth is said to share the clock of the samples, but its motion comes {late_s:+.3f} s "
        "after theirs, in which it turns by {turn_deg:.1f} deg RMS",
        "one of the two is delayed, and the errors of all filters hold that delay",
        "shift the truth, or leave out `same_clock: true` or `align_clock: false`, so that the "
        "motion aligns them",
    ),
    "clock.not_common": Template(
        WARNING,
        "the truth is said to share the clock of the samples, but fits them only where "
        "{late_s:+.3f} s are between their times (correlation {correlation:.3f})",
        "they are not on one clock; nothing of it is evaluated",
        "leave out `same_clock: true` or `align_clock: false`, so that the motion aligns them",
    ),
    "clock.truth_still": Template(
        WARNING,
        "the truth stands still throughout while its gyroscope turns",
        "the body was not tracked, or it is another one; nothing of it is evaluated",
    ),
    "clock.as_stated": Template(
        WARNING,
        "its clock could not be fitted to the motion",
        "the times of the truth are taken as stated, {offset_s:+.3f} s added to them",
    ),
    "clock.joint_as_stated": Template(
        WARNING,
        "its clock could not be fitted to the motion",
        "the times of its true angles are taken as stated",
    ),
    "truth.angle_of_another": Template(
        WARNING,
        "the truth of its {angle} moves as its {other} does",
        "two angles were exchanged, or the truth is of another definition",
        "exchange them with --truth-angle, or in `truth_angles` of the mapping",
    ),
    "truth.of_another_joint": Template(
        WARNING,
        "its true flexion moves as that of joint '{other}' (correlation of the rates "
        "{correlation:.2f}, with its own {own_correlation:.2f})",
        "the columns of two joints were exchanged, or a truth is given to the wrong joint; nothing "
        "of it is evaluated",
        "--truth-angle JOINT.ANGLE=COLUMN (`truth_angles` of the mapping) says which column is "
        "whose; --joint NAME=PROXIMAL:DISTAL, which sensors are",
    ),
    "clock.truth_unit": Template(
        WARNING,
        "the truth's times fit its motion when multiplied by {factor:g}",
        "they were read in another unit than theirs, or made of frames at another rate than the "
        "cameras'; nothing of it is evaluated",
        "state their unit: `time: {{column: ..., unit: ...}}` of the truth in the mapping, or "
        "--truth-time-unit; or their rate: `rate_hz`, or --truth-rate",
    ),
    "clock.no_overlap": Template(
        WARNING,
        "its samples and its truth never overlap in time (samples from {begin_s:.3f} to "
        "{end_s:.3f} s, truth from {truth_begin_s:.3f} to {truth_end_s:.3f} s), and no clock is to "
        "be aligned",
        "they are not on one clock; nothing of it is evaluated",
        "leave out `same_clock: true` or `align_clock: false`, so that the motion aligns them",
    ),
    "frames.doubt": Template(WARNING, "{filter}: {doubt}"),
    "frames.refused": Template(
        WARNING, "{filter}: it could not be aligned: {why}", "it is not evaluated"
    ),
    "frames.undetermined": Template(
        WARNING,
        "the motion is nearly all about one axis, ({axis}) in the sensor",
        "how far the sensor is turned in its mounting about that axis, against the world about its "
        "image, is not determined and not evaluated: it was held {held}; all other angles of both "
        "were solved. Errors about the axis, and the size of the others, do not depend on it",
        "to determine it, add rotations of 30 deg or more about an axis across it",
    ),
    "frames.still": Template(
        WARNING,
        "there is no motion to align it by",
        "its mounting was held at the one that is believed; a constant error is not evaluated",
        "to determine it, add rotations of 30 deg or more about two axes",
    ),
    "frames.hardly": Template(
        WARNING,
        "{filter}: the mounting is doubtful: the motion is nearly all about one axis, ({axis}) in "
        "the sensor (it reaches {reached:.3f} beside it, {wanted:g} is wanted)",
        "",
        "add rotations of 30 deg or more about an axis across it",
    ),
    "frames.not_level": Template(
        WARNING,
        "the z axis of the truth's world leans by {tilt_deg:.0f} deg against gravity",
        "heading and inclination are those about the vertical that the sensor found in it, and a "
        "constant inclination is not evaluated",
        "confirm it with `world: unknown` beside the truth",
    ),
    "frames.up_undetermined": Template(
        WARNING,
        "the z axis of the truth's world does not point up",
        "where up is in it cannot be found, so errors are not parted into heading and inclination",
        "confirm it with `world: unknown` beside the truth",
    ),
    "frames.up_unknown": Template(
        NOTE,
        "where up is in the truth's world is unknown",
        "errors are not parted into heading and inclination",
    ),
    "truth.order": Template(
        WARNING,
        "its angular rates fit the truth as read in {as_read_percent:.0f} % of their variance, and "
        "in {percent:.0f} % with the scalar of the quaternion at the other end",
        "the truth's quaternion is written in the other order; nothing of it is evaluated",
        "say so in the mapping of the truth: `order: {remedy}`",
    ),
    "truth.direction": Template(
        WARNING,
        "its angular rates fit the truth as read in {as_read_percent:.0f} % of their variance, and "
        "in {percent:.0f} % with the quaternion conjugated",
        "the truth turns the other way round; nothing of it is evaluated",
        "say so in the mapping of the truth: `direction: sensor_from_earth`",
    ),
    "truth.order_or_direction": Template(
        WARNING,
        "its angular rates fit the truth as read in {as_read_percent:.0f} % of their variance, and "
        "in {percent:.0f} % with the quaternion conjugated or its scalar at the other end",
        "the truth's quaternion has another order or direction; without a known mounting the "
        "motion does not tell which; nothing of it is evaluated",
        "say so in the mapping of the truth: `order: xyzw` or `direction: sensor_from_earth`",
    ),
    "truth.joints_not_judged": Template(
        WARNING,
        "its angular rates fit the truth in {as_read_percent:.0f} % of their variance, and better "
        "with {how}",
        "the joint log was read otherwise than the arm moved, or the sensor sits on another link; "
        "nothing of it is evaluated",
        "import it again with the columns mended or the link named",
    ),
    "truth.not_the_links": Template(
        WARNING,
        "its angular rates fit those of {link} by the joint log in {as_read_percent:.0f} % of "
        "their variance, and those of one that turns the other way about in {percent:.0f} %",
        "angles of the log are in another order or of another sign than the arm's, or the sensor "
        "sits on another link; nothing of it is evaluated",
        "look which columns are which joints, and which link carries the sensor (--link)",
    ),
    "truth.of_another": Template(
        WARNING,
        "its angular rates fit the truth of '{other}' ({percent:.0f} % of their variance) and not "
        "its own ({own_percent:.0f} %)",
        "two bodies or links were confused; nothing of it is evaluated",
        "exchange them: --link, `link` in the protocol, or the columns of the truth in the mapping",
    ),
    "truth.foreign": Template(
        WARNING,
        "its angular rates fit the truth in {percent:.0f} % of their variance only, however both "
        "are turned",
        "its axes or its truth are wrong, or the two do not move together; nothing of it is "
        "evaluated",
    ),
    "truth.stepped": Template(
        WARNING,
        "the truth steps {steps} {steps:time|times} by up to {angle_deg:.0f} deg, first at "
        "{at_s:.2f} s, which the gyroscope does not see",
        "the reference took one body for another or filled in what it did not see, or samples were "
        "lost or repeated, or a clock jumped; {lost_s:.1f} s of it that do not fit the rest were "
        "left out",
    ),
    "truth.ambiguous": Template(
        WARNING,
        "the sensor turns by up to {turn_deg:.0f} deg between neighbouring orientations of the "
        "truth at {rate_hz:.0f} Hz, {times} {times:time|times} and first at {at_s:.2f} s",
        "from half a turn on nobody can tell which way it went: what lies between them is left out",
        "record the truth at a higher rate, or turn more slowly",
    ),
    "truth.parts": Template(
        WARNING,
        "truth and gyroscope part slowly in {stretches} {stretches:stretch|stretches}, most from "
        "{begin_s:.1f} s to {end_s:.1f} s by {angle_deg:.0f} deg, while they turn alike elsewhere",
        "a body slipped under its markers, the reference drifted, or the gyroscope was clipped or "
        "disturbed, and nobody knows which; {lost_s:.1f} s of it that do not fit the rest were "
        "left out",
    ),
    "truth.parts_throughout": Template(
        WARNING,
        "truth and gyroscope part slowly in {stretches} {stretches:stretch|stretches}, most from "
        "{begin_s:.1f} s to {end_s:.1f} s by {angle_deg:.0f} deg, and turn alike for less than 10 "
        "s anywhere",
        "the reference or the gyroscope drifts, and nobody knows which; none of {lost_s:.1f} s is "
        "evaluated",
    ),
    "truth.aligned_apart": Template(
        WARNING,
        "{apart_s:.1f} s of the truth that do not fit the rest, from {at_s:.2f} s on, last and "
        "move enough to find the frames that it has there ({kinds} beside those of the rest)",
        "the errors of these parts are those against frames of their own; joint angles are not "
        "evaluated there",
    ),
    "truth.frozen": Template(
        WARNING,
        "the truth stands still {stretches} {stretches:time|times}, for {lost_s:.1f} s in all and "
        "first at {at_s:.2f} s, while the gyroscope turns",
        "it was lost there; these parts were left out",
    ),
}
