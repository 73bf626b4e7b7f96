"""The calibration methods by name, as `testbench calibrate --method` spells them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from testbench.estimation.calibration.attitude_aided import attitude_aided
from testbench.estimation.calibration.axis_model import axis_model
from testbench.estimation.calibration.ellipsoid import ellipsoid
from testbench.estimation.calibration.ferraris import ferraris
from testbench.estimation.calibration.magnetometer_axes import ellipsoid_dip
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.rotational import (
    rotational_2d,
    rotational_2d_bias,
    rotational_3d,
    rotational_3d_bias,
    rotational_nearest,
    rotational_nearest_bias,
)
from testbench.estimation.calibration.six_position import six_position
from testbench.estimation.calibration.triad_model import MAGNETOMETER
from testbench.records.calibration import TriadCalibration


@dataclass(frozen=True)
class Method:
    """One way to calibrate a triad from static poses.

    Attributes:
        name: As the command line spells it.
        needs: For people.
        source: Who describes it.
        function: From poses to corrections.
        needs_expected: It needs the arm's orientation.
        needs_vertical: It needs a calibrated accelerometer beside it.
    """

    name: str
    needs: str
    source: str
    function: Callable[[StaticPoses], TriadCalibration]
    needs_expected: bool = False
    needs_vertical: bool = False


THESIS = "Castellanos Alonso 2023"


def _by_name(*methods: Method) -> dict[str, Method]:
    return {method.name: method for method in methods}


ACCELEROMETER_METHODS = _by_name(
    Method(
        "attitude_aided",
        "4 known poses, not in a plane",
        "IEEE Std 1293, multi-position test",
        attitude_aided,
        True,
    ),
    Method(
        "norm_only", "9 poses in any orientation", "Tedaldi, Pretto & Menegatti 2014", norm_only
    ),
    Method("six_position", "each face up once", "Titterton & Weston 2004, chapter 8", six_position),
    Method(
        "ferraris", "each face up once, exactly level", "Ferraris, Grimaldi & Parvis 1995", ferraris
    ),
    Method("axis_model", "4 known poses, not in a plane", THESIS, axis_model, True),
    Method(
        "rotational_3d",
        "3 known poses, not in a plane",
        f"{THESIS}, R = A' pinv(B')",
        rotational_3d,
        True,
    ),
    Method(
        "rotational_2d",
        "2 known poses in the plane of two axes",
        f"{THESIS}, R = A' pinv(B')",
        rotational_2d,
        True,
    ),
    Method(
        "rotational_2d_bias",
        "3 known poses in the plane of two axes",
        f"{THESIS}, with a bias",
        rotational_2d_bias,
        True,
    ),
    Method(
        "rotational_3d_bias",
        "4 known poses, not in a plane",
        f"{THESIS}, with a bias",
        rotational_3d_bias,
        True,
    ),
    Method("rotational_nearest", "2 known poses", "Markley 1988", rotational_nearest, True),
    Method(
        "rotational_nearest_bias",
        "3 known poses",
        "Markley 1988, with a bias",
        rotational_nearest_bias,
        True,
    ),
)
"""Of an accelerometer."""

MAGNETOMETER_METHODS = _by_name(
    Method(
        "ellipsoid", "9 poses in any orientation", "Renaudin, Afzal & Lachapelle 2010", ellipsoid
    ),
    Method(
        "ellipsoid_dip",
        "9 poses and the accelerometer",
        "Kok & Schon 2016",
        ellipsoid_dip,
        needs_vertical=True,
    ),
    Method(
        "known_field",
        "4 known poses in a known field",
        "IEEE Std 1293, multi-position test",
        partial(attitude_aided, tolerance=MAGNETOMETER),
        True,
    ),
)
"""Of a magnetometer."""
