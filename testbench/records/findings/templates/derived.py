"""Findings on quantities that a file does not hold, and what they are computed from."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, Template

TEMPLATES = {
    "derived.force_of_velocity": Template(
        NOTE,
        "the file holds increments of velocity and no acceleration",
        "specific force is the velocity increment over the output interval",
    ),
    "derived.force_of_free": Template(
        NOTE,
        "the file holds acceleration without gravity only",
        "specific force is conj(q) (free acceleration + g), g = 9.80665 m/s^2 upwards: exact, "
        "given the device's q",
    ),
    "derived.rate_of_orientation": Template(
        NOTE,
        "the file holds increments of orientation and no angular rate",
        "angular rate is the orientation increment over the output interval",
    ),
    "derived.missing": Template(
        NOTE, "{source} holds no {quantity}", "it is missing (NaN) in all samples"
    ),
    "derived.missing_file": Template(
        NOTE,
        "{file} was not given",
        "specific force and angular rate are missing (NaN) in all samples",
        "give it, too, if there is one",
    ),
}
