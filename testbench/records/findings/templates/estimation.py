"""Findings of `estimate`: clocks, gates, calibration, alignment, filters, joints, chains."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "rest.norm": Template(
        WARNING,
        "at rest the specific force is {norm_m_s2:.2f} m/s^2, {norm_g:.3f} g",
    ),
    "rest.rate": Template(
        WARNING,
        "at rest the gyroscope reads {bias_deg_s:.1f} deg/s",
        "it was never calibrated; filters hardly find so large a bias, and their headings turn "
        "meanwhile",
        "calibrate it first: `testbench calibrate`, or a stored calibration",
    ),
    "gap.restarted": Template(
        WARNING,
        "{gaps} {gaps:gap|gaps} of more than 1 s without rates, the first before {at_s:.2f} s",
        "nobody knows how it turned in there; filters begin anew after each, level by the "
        "accelerometer and with the heading of the magnetometer, or, without one, with the heading "
        "that they had before, which is true no more",
    ),
    "gap.aligned_anew": Template(
        NOTE,
        "{apart_s:.1f} s beyond such gaps are evaluated, in {stretches} "
        "{stretches:stretch|stretches}",
        "the heading of filters without a magnetometer is aligned there by its mean, so that no "
        "error of it holds what it turned over a gap; joint angles are not judged there",
    ),
    "field.norm": Template(
        WARNING,
        "the magnetic field differs from its median of {usual_ut:.1f} uT by over 20 % in "
        "{disturbed_percent:.0f} % of the samples",
    ),
    "calibration.poses_moving": Template(
        WARNING,
        "{left_out} of {planned} calibration poses were not at rest and were left out",
    ),
    "calibration.stored": Template(
        NOTE,
        "its raw samples were first corrected by a stored calibration ({origin}, {methods}; "
        "{match})",
    ),
    "calibration.stored_undated": Template(
        WARNING,
        "its raw samples were first corrected by a stored calibration ({origin}, {methods}; "
        "{match}; when the session was recorded, and how long from that, is unknown)",
    ),
    "calibration.stored_warning": Template(
        WARNING,
        "its stored calibration says of the {triad}: {sentence}",
        "",
        "when it is calibrated again: {remedy}",
    ),
    "calibration.by_name": Template(
        WARNING,
        "its stored calibration is of a sensor of the same name: {stored}, while the recording "
        "names {own}",
        "another part of that name would be corrected by the errors of the first, and nothing that "
        "was recorded contradicts it",
        "look whether it is the same part; the key device of a mapping names it, and then only a "
        "calibration of the same device is taken",
    ),
    "calibration.none_of_this_sensor": Template(
        WARNING,
        "no stored calibration is of this sensor; its raw samples were left as they are",
    ),
    "recording.long": Template(
        NOTE,
        "a long recording: its estimates are kept, and evaluated, at one of {every} samples",
    ),
    "axes.quaternion": Template(
        WARNING, "its quaternion fits the motion only when read as {reading}"
    ),
    "axes.gain": Template(WARNING, "its {triad} reads {gain:.3g} times what the truth did"),
    "axes.gain_of_unit": Template(
        WARNING, "its {triad} reads {gain:.3g} times what the truth did", "{cause}"
    ),
    "axes.other": Template(
        WARNING,
        "its {triad} has other axes than its mounting says; the motion fits '{axes}'",
    ),
    "axes.mirrored": Template(
        WARNING,
        "its {triad} has other axes than its mounting says; the motion fits '{axes}', which "
        "mirrors the sensor: one sign is wrong",
    ),
    "axes.field_level": Template(
        WARNING,
        "its magnetometer has other axes than its mounting says; it fits '{axes}' or that with "
        "all signs reversed, '{reversed}'",
    ),
    "axes.field": Template(
        WARNING,
        "its magnetometer has other axes than its mounting says; it fits '{axes}' or that with "
        "all signs reversed, '{reversed}': '{down}' if the field points down there, as in the "
        "north, '{up}' if it points up",
    ),
    "heading.drifts": Template(
        WARNING,
        "{filter}: its heading turns by {rate_deg_s:.2g} deg/s while the sensor rests (median "
        "over {rest_s:.0f} s of rest); angles that see a heading carry that",
    ),
    "joint.axes_do_not_tell": Template(
        WARNING, "{filter}: its axes do not tell the heading, which stays as it is: {why}"
    ),
    "joint.axes_hardly_tell": Template(
        WARNING,
        "{filter}: its axes hardly tell the heading (standard deviation {sd_deg:.0f} deg, "
        "median): they are often vertical",
    ),
    "joint.by_truth": Template(
        NOTE,
        "its segments are the bodies of the truth",
        "its sensors were brought to them by the motion",
        "alignment: {{method: standing}} to place them without the truth",
    ),
    "joint.as_stated": Template(
        NOTE, "its sensors sit on their segments as stated; headings by {by}"
    ),
    "joint.standing_found": Template(
        NOTE,
        "the rest from {begin_s:.2f} to {end_s:.2f} s is taken for standing upright",
        "its angles are zero there, to {sd_deg:g} deg about each axis of each segment",
        "--standing FROM:TO at the import, or alignment: {{standing_s: [from, to]}} in its "
        "mapping, if that is another time",
    ),
    "joint.standing_stated": Template(
        NOTE,
        "its angles are zero while the person is said to stand, from {begin_s:.2f} to {end_s:.2f} "
        "s, to {sd_deg:g} deg about each axis of each segment",
    ),
    "joint.standing_moves": Template(
        WARNING,
        "its sensors turn by {sway_deg:.0f} deg RMS about their mean while the person is said to "
        "stand",
        "its angles are zero in the mean of that, which is no pose",
        "--standing FROM:TO (alignment.standing_s) of a time at which nobody moves",
    ),
    "joint.axes_unstated": Template(
        WARNING,
        "nothing states the axes of the segments of {sensors} in their sensors",
        "the sensors' own axes are taken for them, x forward, y up, z right, and angles are those "
        "between the sensors",
        "`segments: {{SENSOR: {{name: ..., rotation_deg: ...}}}}` of the mapping, or --place-by "
        "standing",
    ),
    "joint.facing": Template(
        NOTE,
        "{filter}: which way the body faces: by {by}; headings between its sensors: by {relative}",
    ),
    "joint.drifts": Template(
        WARNING,
        "{filter}: the headings of its sensors drift apart: how they differ is known to "
        "{sd_deg:.0f} deg (standard deviation) at {at_s:.1f} s",
        "angles about vertical axes are as uncertain there",
        "stand still for some seconds at the beginning and the end of each recording, or a filter "
        "with a magnetometer, or the joint's axes (constraint)",
    ),
    "joint.clocks_apart": Template(
        WARNING,
        "{filter}: its sensors see the centre of the joint move alike only where {shift_s:+.2f} s "
        "are added to the times of {sensor}: their clocks differ by so much",
        "its angles are wrong by as much as the joint turns in that time",
        "record the sensors on one clock, or correct the times in the file of {sensor}",
    ),
    "joint.centre_apart": Template(
        WARNING,
        "{filter}: its sensors do not see the centre of the joint move alike, whichever way they "
        "face: they sit on other segments than the two beside it, or are of several recordings, "
        "or their clocks run apart",
        "its angles are not to be believed",
        "look which sensors the joint names, and whether their times agree",
    ),
    "joint.sensors_exchanged": Template(
        WARNING,
        "{filter}: {proximal} is said to be nearer to the trunk, and hangs {below_cm:.0f} cm below "
        "{distal} while standing, by how the centre of the joint moves (standard uncertainty "
        "{sd_cm:.0f} cm)",
        "the two sensors were exchanged, or the pose is not upright; its angles are not to be "
        "believed: signs and axes are those of the other segment",
        "--joint NAME={distal}:{proximal}, or the proximal one first in `joints` of the mapping; "
        "--standing FROM:TO, if the person stands at another time",
    ),
    "joint.beyond_anatomy": Template(
        WARNING,
        "{filter}: its flexion goes from {low_deg:.0f} to {high_deg:.0f} deg, and "
        "that of the {kind} from {least_deg:g} to {most_deg:g} deg at most",
        "it counts the other way or from another pose, or its sensors are not on the two segments "
        "beside it, or one of them slipped",
        "look which way forwards is said to be (--forward), when the person stands (--standing), "
        "and which sensors the joint names (--joint)",
    ),
    "joint.hinge_found": Template(
        NOTE,
        "{filter}: its axis was found by the motion in both sensors, to {sd_deg:.1f} deg together",
    ),
    "joint.hinge_unknown": Template(
        WARNING,
        "{filter}: its axis was not found by the motion, so that the standing pose places its "
        "sensors: {why}",
    ),
    "joint.no_hinge": Template(
        NOTE,
        "it is no hinge: its sensors are placed by a hinge beside it where there is one, else by "
        "the standing pose",
    ),
    "joint.no_hinge_at_all": Template(
        WARNING,
        "functional motions place sensors by hinges, and none showed its axis: the standing pose "
        "places its sensors",
        "",
        "a knee or an elbow among the joints, or a definition {{hinge: [x, y, z]}}",
    ),
    "joint.not_placed": Template(
        WARNING,
        "{filter}: its angles were not computed, for the recording does not show this: {why}",
        "",
        "what tells it: {add}",
    ),
    "joint.no_filter": Template(
        WARNING,
        "none of the filters ran for both of its sensors: it has no angles",
        "each filter that was left out of a sensor is named with the reason",
        "--filters names others",
    ),
    "joint.not_computed": Template(WARNING, "{filter}: its angles were not computed: {why}"),
    "chain.no_arm": Template(
        WARNING,
        "the chain was not estimated: the recording has no arm and no plan, and states no model "
        "(estimate.chain.model: robot, and the link of each sensor)",
    ),
    "chain.start": Template(
        NOTE,
        "it starts from the rest from {from_s:.1f} to {to_s:.1f} s, taken for the start pose; "
        "estimate.chain.model.rest_s names another",
    ),
    "chain.sheet_assumed": Template(
        NOTE,
        "no data sheet is named for {sensors}: what rest does not tell of their errors is taken "
        "from that of {sheet}",
    ),
    "chain.lost": Template(
        WARNING,
        "the chain filter is lost: by the sensors' own readings they sit elsewhere than stated, "
        "which puts the angle of {joint} off by about {off_deg:.1f} deg; measure where they sit, "
        "or have it fitted by estimate.chain.placement",
    ),
    "chain.uncertain": Template(
        NOTE,
        "little tells of the angles of {joints}: their standard uncertainty is up to "
        "{sd_deg:.1f} deg",
    ),
    "chain.lost_though_fitted": Template(
        WARNING,
        "the chain filter is lost though the placement was fitted: by the sensors' own readings "
        "the angle of {joint} is off by about {off_deg:.1f} deg; a sensor may slip, or the model "
        "does not fit",
    ),
    "chain.placement_unsettled": Template(
        WARNING,
        "the chain filter is lost: the fit of the sensors' placement did not settle; state the "
        "start pose or the placement better, or record a motion that shows more",
    ),
    "chain.placement_held": Template(
        NOTE,
        "the motion hardly tells of the {held}, which the stated standard deviation holds",
    ),
    "chain.not_estimated": Template(WARNING, "{why}"),
}
