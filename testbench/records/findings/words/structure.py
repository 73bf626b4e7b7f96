"""Findings on how files and mappings are built: columns, files, what was read and what was not."""

from __future__ import annotations

from testbench.records.findings.words.template import NOTE, WARNING, Template

TEMPLATES = {
    "structure.mapping": Template(NOTE, "mapping: {file}: {description}"),
    "structure.unit_told": Template(
        NOTE, "{quantity} is taken for {unit}, by {evidence}", "", "state it: {answer}"
    ),
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
    "structure.closed": Template(
        NOTE,
        "{file} also holds {objects}",
        "such objects only MATLAB opens; they were passed over",
        "in MATLAB, save their columns as arrays (table2struct(T, 'ToScalar', true))",
    ),
    "structure.truth_in_rows": Template(
        NOTE,
        "its truth stands in the rows of its samples",
        "it needs no clock of its own, and none is fitted",
        "estimate: {{align_clock: true}} if it is late all the same",
    ),
    "structure.body_kept": Template(
        NOTE,
        "segments and joints of the mapping ({names}) are kept in the session",
        "angles of joints without an arm are not computed yet",
    ),
}
