"""Findings on walks: where sensors sit, and what their strides rest on."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "gait.place": Template(
        NOTE,
        "by {how} it sits on the {place}",
        "",
        "if it does not, say so with --on SENSOR=foot, shank, wrist or chest",
    ),
    "gait.place_unknown": Template(
        WARNING,
        "neither its name nor its motion tells where it sits",
        "its strides were not looked for: shank, thigh and wrist swing alike, and their step "
        "lengths differ",
        "say where with --on SENSOR=foot, shank, wrist or chest",
    ),
    "gait.no_walk": Template(WARNING, "no walk was found in it: no stride at all"),
    "gait.few_strides": Template(
        WARNING,
        "no walk was found in it: {count} {count:stride|strides} in a row, {least} are wanted",
        "squats, a step aside and a foot that is set anew swing a leg, too; nothing is counted",
    ),
    "gait.no_triads": Template(
        WARNING,
        "it lacks angular rates or specific forces",
        "a walk takes both; nothing of it is reckoned",
    ),
    "gait.too_long": Template(
        WARNING,
        "its {samples} samples are too many at once",
        "the smoother needs the whole walk; nothing of it is reckoned",
        "cut the recording into parts before the import",
    ),
    "gait.no_rest": Template(
        WARNING,
        "it rests nowhere for a second",
        "the gyroscope's bias is known by the stands of the foot or the slowest moments alone: the "
        "heading may drift by a degree a second at first",
        "begin each recording with a few seconds of standing still",
    ),
    "gait.level": Template(
        NOTE,
        "its stands are equally high within a few centimetres",
        "the floor was taken for level",
        "if it is not, say so with --floor any",
    ),
    "gait.late": Template(
        WARNING,
        "it is first seen to stand after {late_s:.1f} s",
        "the way begins there; what lies before is missing",
    ),
    "gait.clipped": Template(
        WARNING,
        "readings of {strides} of {of} {of:stride|strides} are at full scale",
        "their lengths are doubtful",
        "record with a larger range (16 g and 2000 deg/s on a foot)",
    ),
    "gait.set_down": Template(
        NOTE,
        "{times} {times:time|times} the foot was set down flat in a turn and taken up again",
        "{times:it|each} is counted as a part of one stride",
    ),
    "gait.rate_low": Template(
        WARNING,
        "its {rate_hz:.0f} Hz are few, {least_hz:.0f} are wanted",
        "lengths and events are less certain",
    ),
    "gait.gravity": Template(
        WARNING,
        "at rest it reads {force_m_s2:.2f} m/s^2 in place of 9.81",
        "the scale or bias of its accelerometer is off; lengths are off likewise",
        "calibrate it, or correct its unit or scale at the import",
    ),
    "gait.refused": Template(
        NOTE,
        "some still moments contradict the way",
        "they were taken for moments of the swing",
    ),
    "gait.usual": Template(
        NOTE, "{count} {count:stride is|strides are} listed and in no mean: {why}"
    ),
    "gait.left_out": Template(
        WARNING,
        "{count} {count:stride is|strides are} in no mean: {why}",
        "{count:its length|their lengths} and the path across {count:it|them} are doubtful",
    ),
    "gait.doubtful": Template(
        WARNING,
        "{count} of {of} strides {count:is|are} doubtful",
        "it is hardly a walk by a sensor on a foot",
        "if it sits elsewhere, say where with --on SENSOR=shank, wrist or chest",
    ),
    "gait.no_common_clock": Template(
        WARNING,
        "both feet carry sensors, whose clocks are not known to be one",
        "the time of a step goes from one foot to the other, and none is given",
        "record both on one clock, or import files whose times share one (Unix time)",
    ),
    "gait.not_alternating": Template(
        WARNING,
        "only {share_percent:.0f} % of the contacts come after one of the other foot",
        "the feet of a walk alternate: strides were missed, or the clocks are not one; no time of "
        "a step is given",
    ),
    "gait.idle": Template(
        WARNING,
        "{option} has no effect on it",
        "a sensor on a {place} goes by strapdown navigation, which takes neither a mounting nor a "
        "filter",
        "leave it out, or name the --parameters of the regression to go by that",
    ),
    "gait.derived": Template(
        NOTE,
        "it has no angular rates",
        "those of the device's own orientation are taken, with whatever its filter did to them",
        "record angular rates and accelerations too",
    ),
    "gait.regression": Template(
        NOTE,
        "lengths are by the published regression '{parameters}'",
        "it was fitted to one walker; a length is known to a tenth at best",
        "walk a known distance and give it with --distance: the intercept that fits is then said",
    ),
    "gait.mounting": Template(
        NOTE,
        "how it is worn was told by gravity and the axis that it swings about: {mounting}",
        "",
        "if it is worn otherwise, say so with --mounting level, frontal or lateral",
    ),
    "gait.cut": Template(
        WARNING,
        "{holes} {holes:hole|holes} without rows: the way is that of the longest stretch without "
        "one, from {begin_s:.1f} s to {end_s:.1f} s",
        "nobody knows how it moved in a hole, so that distance and path end there",
        "import the parts of the file one by one to have the others",
    ),
    "gait.intercept": Template(
        NOTE,
        "an intercept b_H larger by {more_m:+.3f} m would make its way {distance_m:g} m long",
        "that is the one number of the regression that is tuned to a walker",
    ),
}
