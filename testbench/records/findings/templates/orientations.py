"""Findings on orientations of devices: what a file's quaternions were taken for."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

_BY_MAPPING = "a mapping of the generic format states another `direction` and `earth`"

TEMPLATES = {
    "orientation.unchecked": Template(
        NOTE,
        "it has no accelerometer, by which its orientation could be checked",
        "that is taken for {direction} ({earth})",
        _BY_MAPPING,
    ),
    "orientation.level": Template(
        NOTE,
        "it never tilts, so that gravity does not tell what its orientation means",
        "that is taken for {direction} ({earth})",
        _BY_MAPPING,
    ),
    "orientation.by_gravity": Template(
        NOTE,
        "its orientation fits the measured gravity as {direction} ({earth})",
        "it is taken for that",
        _BY_MAPPING,
    ),
    "orientation.contradicted": Template(
        WARNING,
        "its orientation fits the measured gravity in neither direction",
        "it is left out",
        _BY_MAPPING,
    ),
    "orientation.absent": Template(
        WARNING, "its orientation is nowhere known where its acceleration is", "it is left out"
    ),
    "orientation.assumed": Template(
        NOTE,
        "the file does not say what its quaternions mean",
        "they are taken for q_earth_from_sensor, w first",
        "a mapping of the generic format states another `order`, `direction` and `earth`",
    ),
    "orientation.inverse": Template(
        NOTE,
        "by the maker, the file's quaternion turns earth ({earth}) into sensor",
        "kept is sensor into earth (ENU)",
        _BY_MAPPING,
    ),
    "orientation.other_earth": Template(
        NOTE,
        "by the header of the file, its orientations are into {earth}",
        "they are turned to ENU",
        _BY_MAPPING,
    ),
    "orientation.y_up": Template(
        NOTE,
        "the header says that y is up",
        "orientations are taken for sensor into world, and turned from y up to z up",
    ),
    "orientation.z_up": Template(
        NOTE,
        "the header does not say that y is up",
        "orientations are taken for sensor into world, z up",
        "`frame=y up` in the header says otherwise",
    ),
}
