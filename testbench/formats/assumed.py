"""What is taken for granted where files do not say it: units by the format, quantities by others.

Whatever is taken for granted is said, with the flag that says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

from testbench.formats.options import Options
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding


def assumed_units(sensor: str, taken: Mapping[str, str], options: Options) -> list[Finding]:
    """What is said of units that the format states, and neither the file nor a person.

    Args:
        sensor: Its name.
        taken: Unit by quantity.
        options: Answers of a person.
    """
    own = {q: unit for q, unit in taken.items() if not options.answered(q)}
    findings = []
    if own.get("mag") == "au":
        del own["mag"]
        findings.append(finding("unit.local_field", sensor))
    if own:
        units = [f"{quantity} in {unit}" for quantity, unit in own.items()]
        findings.append(finding("unit.by_format", sensor, quantities=list(own), units=units))
    return findings


def derived_quantities(sensor: str, has: Mapping[str, bool]) -> list[Finding]:
    """What is said of specific force and rate of an Xsens file that does not hold them as such.

    Args:
        sensor: Its name.
        has: Whether the file holds acceleration (acc), its increments (dv), acceleration without
            gravity beside an orientation (free), angular rate (gyr) and increments of orientation
            (dq).
    """
    codes = []
    if not has["acc"] and has["dv"]:
        codes.append("derived.force_of_velocity")
    elif not has["acc"] and has["free"]:
        codes.append("derived.force_of_free")
    if not has["gyr"] and has["dq"]:
        codes.append("derived.rate_of_orientation")
    findings = [finding(code, sensor) for code in codes]
    if not has["gyr"] and not has["dq"]:
        quantity, source = "angular rate", "the file"
        findings.append(finding("derived.missing", sensor, quantity=quantity, source=source))
    return findings
