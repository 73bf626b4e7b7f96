"""Findings on units: what numbers were taken for where a file does not say."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, Template

TEMPLATES = {
    "unit.acc_by_gravity": Template(
        NOTE,
        "acc is taken for {unit}, by gravity at rest",
        "|acc| is {norm:.4g} then",
        "state it: {answer}",
    ),
    "unit.gyr_by_turns": Template(
        NOTE,
        "gyr is taken for {unit}, by its turns",
        "gravity turns as far as it says then",
        "state it: {answer}",
    ),
    "unit.by_format": Template(
        NOTE,
        "the file states no unit of its {quantities}",
        "by its format: {units}",
        "--unit acc=UNIT (gyr, mag) states another one",
    ),
    "unit.local_field": Template(
        NOTE,
        "its magnetic field is in arbitrary units, of the strength of the local field",
        "1 a.u. is taken for 40 uT; only the direction is exact",
        "--unit mag=UNIT states another one",
    ),
    "unit.field_size": Template(
        NOTE,
        "its magnetic field is in arbitrary units, about {strength:.3g} of them",
        "by their size they are taken for uT; only the direction is sure",
        "--unit mag=UNIT states another one",
    ),
    "unit.field_unstated": Template(
        NOTE,
        "the unit of its magnetic field is not stated",
        "uT is taken; only the direction is sure",
        "--unit mag=UNIT states another one",
    ),
    "unit.raw_counts": Template(
        NOTE,
        "its values are raw counts of 16 bits",
        "they are scaled nominally, as imu_tk does: {acc_counts:g} counts per m/s^2, "
        "{gyr_counts:g} per rad/s, zero at {zero}",
        "a mapping of the generic format states `unit`, `scale` and `offset` of each quantity",
    ),
    "unit.local_gravity": Template(
        NOTE,
        "the example of imu_tk was recorded where gravity is {gravity_m_s2} m/s^2",
        "if this is the example, its specific force at rest is so large",
    ),
}
