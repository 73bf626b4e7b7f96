"""Every calibration method by its name, as `testbench calibrate --method` spells it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from testbench.estimation.calibration.attitude_aided import attitude_aided, known_field
from testbench.estimation.calibration.axis_model import axis_model
from testbench.estimation.calibration.ellipsoid import ellipsoid
from testbench.estimation.calibration.ferraris import ferraris, ferraris_of_recording, unused_turns
from testbench.estimation.calibration.gyroscope import attitude, gravity_turns, static_bias
from testbench.estimation.calibration.magnetometer_axes import ellipsoid_dip
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.rate_table import rate_table
from testbench.estimation.calibration.rotational import (
    rotational_2d,
    rotational_2d_bias,
    rotational_3d,
    rotational_3d_bias,
    rotational_nearest,
    rotational_nearest_bias,
)
from testbench.estimation.calibration.session_mounting import by_hinge, by_orientations, by_rates
from testbench.estimation.calibration.six_position import six_position
from testbench.estimation.calibration.turns import GyroscopeRecording, Turn
from testbench.exceptions import NotFoundError

Calibrated = Literal["accelerometer", "gyroscope", "magnetometer", "mounting"]
Axes = Literal["sensor", "accelerometer", "believed"]
"""The sensor's own; those of the calibrated accelerometer, whichever these are; those that the
mounting as believed gives the sensor.
"""
Known = Literal["arm", "vertical", "field", "turn_angle"]
"""The arm's orientation at every sample; a calibrated accelerometer beside; the earth's field in
the world; the angle of the turns.
"""


@dataclass(frozen=True)
class Method:
    """One way to calibrate.

    Attributes:
        name: As the command line spells it.
        calibrates: A triad, or the mounting of all of them.
        needs: What the recording must hold, for people.
        source: Who describes it.
        function: From `StaticPoses` (accelerometer, magnetometer) or a `GyroscopeRecording` to a
            `TriadCalibration`; for a mounting see `session_mounting`.
        asks: What must be known beside the readings.
        axes: Those that it corrects a triad into.
        tried: Its place among the methods of its triad that are tried, in that order, where none is
            named; None where it must be named.
        counts_in_run: The covariance of its bias holds already that the bias wanders between the
            rests and the turns.
        counts_shared: The covariance holds already what errors of the arm that all poses share do.
        integrates: Whether it integrates turns, by an integrator that may be named.
        spares: The turns that it does not calibrate from, and which judge it; None for a method
            that takes all of them, which is judged by leaving some out.
    """

    name: str
    calibrates: Calibrated
    needs: str
    source: str
    function: Callable[..., Any]
    asks: tuple[Known, ...] = ()
    axes: Axes = "sensor"
    tried: int | None = None
    counts_in_run: bool = False
    counts_shared: bool = False
    integrates: bool = False
    spares: Callable[[GyroscopeRecording], list[Turn]] | None = None


IEEE_1293 = "IEEE Std 1293, multi-position test"
THESIS = "Castellanos Alonso 2023"

_ALL = (
    Method(
        "attitude_aided",
        "accelerometer",
        "4 known poses, not in a plane",
        IEEE_1293,
        attitude_aided,
        asks=("arm",),
        axes="believed",
        counts_shared=True,
        tried=1,
    ),
    Method(
        "norm_only",
        "accelerometer",
        "9 poses in any orientation",
        "Tedaldi, Pretto & Menegatti 2014",
        norm_only,
        tried=2,
    ),
    Method(
        "six_position",
        "accelerometer",
        "each face up once",
        "Titterton & Weston 2004, chapter 8",
        six_position,
    ),
    Method(
        "ferraris",
        "accelerometer",
        "each face up once, exactly level",
        "Ferraris, Grimaldi & Parvis 1995",
        ferraris,
        axes="believed",
    ),
    Method(
        "axis_model",
        "accelerometer",
        "4 known poses, not in a plane",
        THESIS,
        axis_model,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "rotational_3d",
        "accelerometer",
        "3 known poses, not in a plane",
        f"{THESIS}, R = A' pinv(B')",
        rotational_3d,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "rotational_2d",
        "accelerometer",
        "2 known poses in the plane of two axes",
        f"{THESIS}, R = A' pinv(B')",
        rotational_2d,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "rotational_2d_bias",
        "accelerometer",
        "3 known poses in the plane of two axes",
        f"{THESIS}, with a bias",
        rotational_2d_bias,
        asks=("arm",),
        axes="believed",
        tried=3,
    ),
    Method(
        "rotational_3d_bias",
        "accelerometer",
        "4 known poses, not in a plane",
        f"{THESIS}, with a bias",
        rotational_3d_bias,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "rotational_nearest",
        "accelerometer",
        "2 known poses",
        "Markley 1988",
        rotational_nearest,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "rotational_nearest_bias",
        "accelerometer",
        "3 known poses",
        "Markley 1988, with a bias",
        rotational_nearest_bias,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "static_bias",
        "gyroscope",
        "rests",
        "mean at rest",
        static_bias,
        tried=3,
        counts_in_run=True,
    ),
    Method(
        "gravity_turns",
        "gyroscope",
        "rests, and the direction of gravity before and after each turn",
        "Tedaldi, Pretto & Menegatti, ICRA 2014",
        gravity_turns,
        axes="accelerometer",
        tried=2,
        counts_in_run=True,
        integrates=True,
    ),
    Method(
        "attitude",
        "gyroscope",
        "rests, and the arm's orientation and force at every sample",
        "turns of the arm, chunk by chunk; docs/methods.md",
        attitude,
        asks=("arm",),
        axes="believed",
        tried=1,
        integrates=True,
    ),
    Method(
        "rate_table",
        "gyroscope",
        "the arm's rate and force at every sample",
        "tests on a rate table, IEEE Std 952-1997",
        rate_table,
        asks=("arm",),
        axes="believed",
    ),
    Method(
        "ferraris_gyroscope",
        "gyroscope",
        "rests with each face up, a turn of a known angle about each axis (--turn-deg)",
        "Ferraris, Grimaldi & Parvis 1995",
        ferraris_of_recording,
        asks=("turn_angle",),
        axes="believed",
        spares=unused_turns,
    ),
    Method(
        "ellipsoid",
        "magnetometer",
        "9 poses in any orientation",
        "Renaudin, Afzal & Lachapelle 2010",
        ellipsoid,
        tried=2,
    ),
    Method(
        "ellipsoid_dip",
        "magnetometer",
        "9 poses and the accelerometer",
        "Kok & Schon 2016",
        ellipsoid_dip,
        asks=("vertical",),
        axes="accelerometer",
        tried=1,
    ),
    Method(
        "known_field",
        "magnetometer",
        "4 known poses in a known field",
        IEEE_1293,
        known_field,
        asks=("arm", "field"),
        axes="believed",
        counts_shared=True,
    ),
    Method(
        "mounting_rates",
        "mounting",
        "turns about two axes, or one and rests",
        "Wahba's problem by SVD, Markley 1988",
        by_rates,
        asks=("arm",),
    ),
    Method(
        "mounting_orientations",
        "mounting",
        "turns about two axes",
        "AX = ZB on orientations of vqf_6d",
        by_orientations,
        asks=("arm",),
    ),
    Method(
        "mounting_hinge",
        "mounting",
        "a sweep of one joint, and a rest",
        "hinge axis and gravity, Shuster & Oh 1981",
        by_hinge,
        asks=("arm",),
    ),
)
METHODS = {method.name: method for method in _ALL}


def get_method(name: str) -> Method:
    """A method by its name.

    Raises:
        NotFoundError: No such method; lists those that exist.
    """
    if name not in METHODS:
        raise NotFoundError("calibration method", name, list(METHODS))
    return METHODS[name]


def methods_of(calibrated: Calibrated) -> dict[str, Method]:
    """The methods of a triad, or of the mounting."""
    return {name: method for name, method in METHODS.items() if method.calibrates == calibrated}


def methods_to_try(calibrated: Calibrated, known: set[Known]) -> list[Method]:
    """The methods of a triad for a recording of which so much is known, best first."""
    fitting = [m for m in methods_of(calibrated).values() if known.issuperset(m.asks)]
    ranked = [(m.tried, m) for m in fitting if m.tried is not None]
    return [method for _, method in sorted(ranked, key=lambda entry: entry[0])]
