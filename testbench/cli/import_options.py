"""Options of the command `import`: what the files leave open, and the file that holds the truth."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.options import complete_robot

_left_open = partial(typer.Option, rich_help_panel="What the files leave open")
_of_joints = partial(typer.Option, rich_help_panel="Joints between the sensors")
_of_truth = partial(typer.Option, rich_help_panel="Truth from a file of its own")


class PlaceBy(StrEnum):
    """How the sensors of joints are placed on their segments."""

    standing = "standing"
    functional = "functional"
    stated = "stated"


class Hemisphere(StrEnum):
    """Of the magnetic equator."""

    north = "north"
    south = "south"


class JointUnit(StrEnum):
    """Unit of joint angles."""

    deg = "deg"
    rad = "rad"


MappingOption = Annotated[
    str | None,
    _left_open(
        "--mapping",
        help="Mapping of the generic format: a YAML file, or one that ships.",
    ),
]
RateOption = Annotated[
    float | None,
    _left_open(
        "--rate",
        metavar="HZ",
        help="Sampling rate, where the files do not tell.",
    ),
]
UnitOption = Annotated[
    list[str] | None,
    _left_open(
        "--unit",
        metavar="WHAT=UNIT",
        help="acc=g, gyr=rad/s, mag=uT, time=ms: how to read it.",
    ),
]
AxesOption = Annotated[
    str | None,
    _left_open(
        "--axes",
        help="Sensor axes: a map that ships, or 'x: -z, y: -y, z: -x'.",
    ),
]
RecordedAtOption = Annotated[
    str | None,
    _left_open(
        "--recorded-at",
        metavar="ISO-DATE",
        help="When it was recorded, e.g. 2021-08-20T20:21:13+08:00, where the files do not say.",
    ),
]
EncodingOption = Annotated[
    str | None,
    _left_open(
        "--encoding",
        metavar="NAME",
        help="Of text files: utf-8, utf-16, utf-16-le, utf-16-be, latin-1, cp1252.",
    ),
]
HemisphereOption = Annotated[
    Hemisphere | None,
    _left_open(
        "--hemisphere",
        help="Where it was recorded; by the dip of a magnetometer's field it tells the sign of "
        "the accelerometer.",
    ),
]
SimulatedOption = Annotated[
    bool,
    _left_open(
        "--simulated",
        help="The samples come from a model: reports and whatever else shows them say so.",
    ),
]
TruthOption = Annotated[
    Path | None,
    _of_truth(
        "--truth",
        help="A robot's joint log or poses, orientations, markers, rigid bodies, or joint angles.",
    ),
]
RobotOption = Annotated[
    str | None,
    _of_truth(
        "--robot",
        help="The arm whose log it is.",
        autocompletion=complete_robot,
    ),
]
LinkOption = Annotated[
    list[str] | None,
    _of_truth(
        "--link",
        metavar="[SENSOR=]LINK",
        help="Link of the arm that carries a sensor.",
    ),
]
MountingOption = Annotated[
    list[str] | None,
    _of_truth(
        "--mounting",
        metavar="[SENSOR=]MAP",
        help="Sensor in the link, e.g. 'rotation_deg: {ZYX: [0, 90, 0]}, position_mm: [0, 0, 25]'.",
    ),
]
DwellOption = Annotated[
    float | None,
    _of_truth(
        "--dwell",
        metavar="S",
        help="How long each listed pose is held.",
    ),
]
CalibrationPosesOption = Annotated[
    int,
    _of_truth(
        "--calibration-poses",
        metavar="N",
        min=0,
        help="The first N listed poses calibrate the sensors and are not evaluated.",
    ),
]
MoveOption = Annotated[
    float | None,
    _of_truth(
        "--move",
        metavar="S",
        help="How long each move takes; else found in the samples.",
    ),
]
TruthOffsetOption = Annotated[
    float | None,
    _of_truth(
        "--truth-offset",
        metavar="S",
        help="Added to the truth's times; else found by the motion.",
    ),
]
TruthRateOption = Annotated[
    float | None,
    _of_truth(
        "--truth-rate",
        metavar="HZ",
        help="Rate of a log without times.",
    ),
]
TruthSdOption = Annotated[
    float | None,
    _of_truth(
        "--truth-sd",
        metavar="DEG",
        help="Standard uncertainty of its orientations about each axis; else by markers or robot.",
    ),
]
TruthTimeUnitOption = Annotated[
    str | None,
    _of_truth(
        "--truth-time-unit",
        metavar="UNIT",
        help="Unit of its times: s, ms, us, ns, min, h, day.",
    ),
]
JointUnitOption = Annotated[
    JointUnit | None,
    _of_truth("--joint-unit", help="Unit of its joint angles."),
]
TruthClusterOption = Annotated[
    list[str] | None,
    _of_truth(
        "--truth-cluster",
        metavar="SENSOR=M1,M2,M3",
        help="Markers that carry a sensor, three or more; or SENSOR=BODY, a rigid body.",
    ),
]
TruthAngleOption = Annotated[
    list[str] | None,
    _of_truth(
        "--truth-angle",
        metavar="JOINT.ANGLE=COLUMN",
        help="Column that is an angle of a joint, e.g. knee.flexion=knee_angle_r; -COLUMN turns "
        "its sign. Default: by its name.",
    ),
]
JointOption = Annotated[
    list[str] | None,
    _of_joints(
        "--joint",
        metavar="NAME=PROXIMAL:DISTAL",
        help="A joint between two sensors, e.g. knee_r=RFemur:RTibia.",
    ),
]
SequenceOption = Annotated[
    list[str] | None,
    _of_joints(
        "--sequence",
        metavar="[JOINT=]ZXY",
        help="How its angles are written: an Euler sequence, a definition such as knee, or "
        "'{hinge: [0, 0, 1]}'. Default: the ISB's for a joint whose name tells which it is, "
        "else ZXY.",
    ),
]
PlaceByOption = Annotated[
    PlaceBy | None,
    _of_joints(
        "--place-by",
        help="How each sensor is placed on its segment. Default: a standing pose.",
    ),
]
StandingOption = Annotated[
    str | None,
    _of_joints(
        "--standing",
        metavar="FROM:TO",
        help="When the person stands upright, in seconds. Default: the first rest.",
    ),
]
ForwardOption = Annotated[
    list[str] | None,
    _of_joints(
        "--forward",
        metavar="SENSOR=AXIS",
        help="Axis that points forwards while standing, e.g. Pelvis=-z. Default: by the motion.",
    ),
]
SegmentOption = Annotated[
    list[str] | None,
    _of_joints(
        "--segment",
        metavar="SENSOR=NAME",
        help="Body segment that a sensor stands for, e.g. RFemur=femur_r.",
    ),
]
