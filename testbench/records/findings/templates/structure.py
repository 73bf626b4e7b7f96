"""Findings on how files and mappings are built: columns, files, what was read and what was not."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "structure.mapping": Template(NOTE, "mapping: {file}: {description}"),
    "structure.interpolated": Template(
        NOTE,
        "its {quantity} stands in {file} at {rate_hz:.4g} Hz, with times of its own",
        "it is interpolated to the times of {main} ({main_rate_hz:.4g} Hz)",
    ),
    "structure.lower_rate": Template(
        NOTE,
        "its {quantity} stands in {file} at {rate_hz:.4g} Hz, less than the {main_rate_hz:.4g} Hz "
        "of {main}",
        "it is kept at its own instants, and missing between them",
    ),
    "structure.no_file": Template(
        NOTE, "no file of its {quantity} was given", "the mapping says that it may be missing"
    ),
    "structure.empty_columns": Template(
        WARNING,
        "{columns} of {file} is empty in all of the first {rows} rows",
        "what needs its {quantity} finds nothing there",
        "name the columns that hold it, or leave it out of the mapping",
    ),
    "structure.shared_columns": Template(
        WARNING,
        "the sensors {first} and {second} both read {columns} of {file}",
        "they are not two sensors, or one has the columns of the other",
        "name the columns of each; as it is, nothing needs to be said",
    ),
    "structure.lines_of_text": Template(
        WARNING,
        "{file}: lines without any number: {count} (the first is line {line}, '{text}')",
        "they are left out, and what should stand there is missing",
    ),
    "structure.received": Template(
        NOTE,
        "the lines of {file} begin with the time at which a serial monitor received them",
        "it is read as the column {column}: the computer's clock, on which samples come late and "
        "in groups",
        "--rate HZ spaces the samples evenly; a sketch that prints micros() has times of its own",
    ),
    "structure.labels": Template(
        NOTE,
        "the lines of {file} say what each number is: {labels}",
        "these are taken for the titles of columns",
    ),
    "structure.cut_short": Template(
        WARNING,
        "line {line} of {file}, its last, is cut short",
        "it is left out; the device may have lost power, and what it measured then is not there",
    ),
    "structure.closed": Template(
        NOTE,
        "{file} also holds {objects}",
        "such objects only MATLAB opens; they were passed over",
        "in MATLAB, save their columns as arrays (table2struct(T, 'ToScalar', true))",
    ),
    "structure.side_assumed": Template(
        NOTE,
        "nothing says on which side of the body it is: the right one is assumed",
        "",
        "end its name in _r or _l",
    ),
    "structure.negated": Template(
        NOTE,
        "its accelerometer was negated: by {file} it is of a phone that writes the opposite of the "
        "force",
        "at rest it points up, as everywhere here",
    ),
    "structure.sign_open": Template(
        WARNING,
        "whether its accelerometer has the sign of the force is open: no {file} says of which "
        "phone it is",
        "an iPhone writes the opposite sign, unless its units and frames were standardised; every "
        "orientation is then upside down, and nothing that was recorded contradicts it",
        "put that file beside the others; or --hemisphere north (or south), by which a "
        "magnetometer tells it; acc.scale: -1 in a mapping of your own mends it",
    ),
    "structure.copies": Template(
        WARNING,
        "{first} and {second} hold the same, byte for byte",
        "one is a copy of the other under another name, and two sensors read the same",
        "look whether the right file was copied; leave one of them out",
    ),
    "structure.joint_turned": Template(
        WARNING,
        "the {kind} has {distal} nearer to the trunk by the names of its sensors, and "
        "{proximal} is named first",
        "two sensors that are exchanged turn signs and axes of the angles",
        "--joint NAME={distal}:{proximal}; other names, if these mislead",
    ),
    "structure.joint_elsewhere": Template(
        WARNING,
        "the {kind} is between {segments}, and its sensors are called {proximal} and {distal}",
        "the angles of another joint look like those of this one, and the motion may not show it",
        "--joint NAME=PROXIMAL:DISTAL names the two sensors beside it; other names, if these "
        "mislead",
    ),
    "structure.joint_of_both_sides": Template(
        WARNING,
        "joint and sensors are called after both sides of the body: {names}",
        "a joint is between two segments of one side",
        "--joint NAME=PROXIMAL:DISTAL names the two sensors beside it; other names, if these "
        "mislead",
    ),
    "structure.truth_in_rows": Template(
        NOTE,
        "its truth stands in the rows of its samples",
        "it needs no clock of its own, and none is fitted",
        "estimate: {{align_clock: true}} if it is late all the same",
    ),
    "structure.at_times_of": Template(
        NOTE,
        "its {quantity} stands in {file}, with times of its own",
        "it is interpolated to the times of {main}",
    ),
    "structure.side_by_side": Template(
        NOTE,
        "{first} and {second} have no times in common",
        "their rows are taken to be simultaneous",
        "give both with their times",
    ),
    "structure.one_of_several": Template(
        NOTE,
        "its {quantity} is there more than once",
        "{taken} is read, and not {others}",
        "a mapping of the generic format reads another one",
    ),
    "structure.columns_left": Template(
        NOTE,
        "columns that were not read: {columns}",
        "",
        "a mapping of the generic format reads them",
    ),
    "structure.files_left": Template(NOTE, "left out, as they hold no motion: {files}"),
    "structure.files_unread": Template(NOTE, "left out, as the mapping reads none of: {files}"),
    "structure.stale_rows": Template(
        NOTE,
        "{count} {count:row|rows} at the beginning {count:is|are} all zero, or left over from an "
        "earlier measurement",
        "they are left out",
    ),
    "structure.struct": Template(NOTE, "it is the struct {struct} of the file"),
    "structure.topic": Template(NOTE, "it is the topic {topic}"),
    "structure.field_topic": Template(NOTE, "its magnetic field is the topic {topic}"),
    "structure.empty_topic": Template(WARNING, "the topic {topic} is empty", "it is left out"),
    "structure.pair": Template(
        NOTE,
        "{acc} is read as the accelerometer, {gyr} as the gyroscope",
        "",
        "name the files in the other order if that is wrong",
    ),
    "structure.axes": Template(NOTE, "axes of every sensor: {axes}", "as --axes states"),
}
