"""Findings on the truth that comes with a recording: poses, orientations, dwells, gaps."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "truth.joint_poses": Template(
        NOTE,
        "the truth is {poses} joint poses of {robot}, of {file}",
    ),
    "truth.joint_degrees": Template(
        NOTE,
        "the joint angles of the truth state no unit and go up to {largest:.4g}",
        "they are taken for degrees: in radians they would be several turns",
        "--joint-unit rad says otherwise",
    ),
    "truth.whole_turns": Template(
        NOTE,
        "the joint angles of the truth step by whole turns in {count} {count:row|rows}",
        "that is no motion: they go on from turn to turn",
    ),
    "truth.impossible_rows": Template(
        WARNING,
        "{count} of {rows} rows of the joint log {count:holds|hold} angles that no joint can reach "
        "in the time, the first {first_s:.3f} s after its beginning",
        "they are left out as a gap: a logger that has lost the arm writes zeros",
        "mend or remove these rows",
    ),
    "truth.joint_lists": Template(
        NOTE,
        "{file} is lists of numbers",
        "the first {joints} numbers of each line are the joints",
        "titles (time_s,J1,J2,...) say otherwise",
    ),
    "truth.no_titles": Template(
        NOTE,
        "{file} has no titles",
        "the first {joints} numbers of each line are the joints, {further} more are left out",
        "titles (time_s,J1,J2,...) say otherwise",
    ),
    "truth.joints": Template(
        WARNING,
        "its angular rates fit those of {link} by the joint log in {own_percent:.0f} % of their "
        "variance, and in {percent:.0f} % with {how}",
        "columns of the log are in another order or of another sign than the arm's joints, or the "
        "sensor sits on another link",
        "name the columns after the joints, turn the sign in the log, or state the link with "
        "--link",
    ),
    "truth.dwells": Template(
        NOTE,
        "{dwells} {dwells:dwell|dwells} found in the samples, {length_s:.2f} s long on average",
        "the poses of the truth were held in these",
        "--move S states the time from pose to pose instead",
    ),
    "truth.orientations": Template(
        NOTE,
        "the truth is {count} orientations, of {file}",
        "they are taken for q_world_from_body, w first",
        "`truth` in a mapping of the generic format states another order or direction",
    ),
    "truth.angles": Template(
        NOTE,
        "its truth is {rows} rows of {system}: {columns}",
        "a minus before a column takes its sign the other way",
        "--truth-angle JOINT.ANGLE=COLUMN says otherwise",
    ),
    "truth.angles_guessed": Template(
        NOTE,
        "the truth is taken by the names of its columns for {columns}",
        "knees of OpenSim's models bend to positive angles, but for those of gait2392",
        "--truth-angle JOINT.ANGLE=COLUMN says otherwise, JOINT.ANGLE=-COLUMN the other sign",
    ),
    "truth.both_sides": Template(
        WARNING,
        "{left} is called of the left, and {right} of the right",
        "joint, sensors and truth must be of one side: legs walk alike, half a stride apart, and "
        "what is evaluated may be the wrong one",
        "--truth-angle JOINT.ANGLE=COLUMN and --joint NAME=PROXIMAL:DISTAL say which belong "
        "together; other names, if these mislead",
    ),
    "truth.named_otherwise": Template(
        WARNING,
        "the column {column} is called after the {called}, and is given to the {kind}",
        "joints of one gait move in one rhythm, so that the motion may not show an exchange",
        "--truth-angle JOINT.ANGLE=COLUMN says which column is whose; another name of the joint or "
        "the column, if this one misleads",
    ),
    "truth.rows_missing": Template(
        WARNING,
        "the header of {file} says {stated} rows, and it holds {rows}",
        "the file was cut off, or rows were taken out by hand",
        "copy or export it again, or correct {key}",
    ),
    "truth.rows_beyond": Template(
        WARNING,
        "the header of {file} says {stated} rows, and it holds {rows}",
        "rows of another recording may have been added; all are used",
        "copy or export it again, or correct {key}",
    ),
    "truth.angles_lost": Template(
        WARNING,
        "{lost} of {rows} rows of the truth are empty, and known rows are up to {longest_s:.2f} s "
        "apart",
        "nothing is evaluated between rows that are more than 0.2 s apart",
    ),
    "truth.tracked": Template(
        NOTE,
        "the truth is {frames} frames of {system}, the first at host time {first_s:g} s",
        "its world and the mounting are aligned by the motion",
        "--truth-offset S shifts it, --mounting states the sensor in the body",
    ),
    "truth.of_ros": Template(
        NOTE,
        "its truth is {count} orientations of {what}",
        "the mounting is aligned by the motion",
        "--mounting states the sensor in the body",
    ),
    "truth.not_unit": Template(
        WARNING,
        "{count} {count:orientation|orientations} of the truth {count:is|are} not of unit length",
        "they count as lost",
    ),
    "truth.signs": Template(
        NOTE,
        "the truth changed the sign of its quaternion {count} {count:time|times}",
        "that is undone, as it is the same orientation",
    ),
    "truth.gaps": Template(
        WARNING,
        "the truth has {gaps} {gaps:gap|gaps}, the longest of {longest_s:.2f} s",
        "nothing is evaluated there",
    ),
}
