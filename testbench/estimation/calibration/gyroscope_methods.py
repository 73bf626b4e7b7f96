"""The methods of gyroscope calibration by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from testbench.estimation.calibration.ferraris import ferraris_of_recording
from testbench.estimation.calibration.gyroscope import attitude, gravity_turns, static_bias
from testbench.estimation.calibration.rate_table import rate_table
from testbench.exceptions import NotFoundError
from testbench.records.calibration import TriadCalibration


@dataclass(frozen=True)
class GyroscopeMethod:
    """A method.

    Attributes:
        name: As `testbench calibrate` spells it.
        needs: What the recording must know: "rests", "up" (direction of gravity before and after
            each turn), "attitude" or "rate" (at every sample), "force" (for the response to it), or
            a phrase.
        gives: What it determines.
        source: Where it comes from.
        function: From a `GyroscopeRecording` and the method's options to the calibration.
    """

    name: str
    needs: tuple[str, ...]
    gives: str
    source: str
    function: Callable[..., TriadCalibration]


GYROSCOPE_METHODS = {
    entry.name: entry
    for entry in (
        GyroscopeMethod("static_bias", ("rests",), "bias", "mean at rest", static_bias),
        GyroscopeMethod(
            "gravity_turns",
            ("rests", "up"),
            "bias, scale, misalignment; g-sensitivity where the force is known",
            "Tedaldi, Pretto & Menegatti, ICRA 2014",
            gravity_turns,
        ),
        GyroscopeMethod(
            "attitude",
            ("rests", "attitude", "force"),
            "bias, scale, misalignment, g-sensitivity",
            "turns of the arm, chunk by chunk; docs/methods.md",
            attitude,
        ),
        GyroscopeMethod(
            "rate_table",
            ("rate", "force"),
            "bias, response to rate and to force",
            "tests on a rate table, IEEE Std 952-1997",
            rate_table,
        ),
        GyroscopeMethod(
            "ferraris_gyroscope",
            ("rests with each face up", "a turn of a known angle about each axis (--turn-deg)"),
            "bias, response to rate and to force",
            "Ferraris, Grimaldi & Parvis 1995",
            ferraris_of_recording,
        ),
    )
}
"""Every method by its name."""


def get_gyroscope_method(name: str) -> GyroscopeMethod:
    """A method by its name.

    Raises:
        NotFoundError: No such method; lists those that exist.
    """
    if name not in GYROSCOPE_METHODS:
        raise NotFoundError("gyroscope method", name, list(GYROSCOPE_METHODS))
    return GYROSCOPE_METHODS[name]
