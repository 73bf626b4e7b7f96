"""The mapping of a file to a session, as a person writes it: which column is what.

docs/formats.md explains it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from testbench.exceptions import NotFoundError
from testbench.formats.axes import PRESETS, AxisNames
from testbench.formats.tables.units import (
    AccUnit,
    GyrUnit,
    MagUnit,
    TimeUnit,
    known_unit,
    unit_names,
)
from testbench.records.disk.yaml_file import YamlDocument, load_yaml
from testbench.records.specs.exclusion import Exclusion
from testbench.records.specs.protocol import BodyJoint, Estimation, Segment
from testbench.records.specs.segment_alignment import SegmentAlignment
from testbench.records.specs.shipped import shipped_names
from testbench.records.specs.strict import Name, Placement, StrictModel

Column = Annotated[
    str | Annotated[int, Field(ge=1)], Field(description="Title of a column, or its number from 1.")
]
Columns3 = Annotated[list[Column], Field(min_length=3, max_length=3)]
Columns4 = Annotated[list[Column], Field(min_length=4, max_length=4)]
Patterns = Annotated[str, Field(min_length=1)] | Annotated[list[str], Field(min_length=1)]
MAPPINGS = PRESETS / "mappings"
Encoding = Literal["auto", "utf-8", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252"]


class TextLayout(StrictModel):
    """How a text file is written; Parquet, MATLAB and HDF5 need none of it."""

    separator: Literal["auto", "comma", "semicolon", "tab", "blanks"] = Field(
        default="auto", description="Between columns."
    )
    decimal: Literal["auto", "point", "comma"] = Field(default="auto", description="In numbers.")
    encoding: Encoding = Field(
        default="auto", description="auto: UTF-8, or UTF-16 with a mark or without."
    )
    skip_lines: int = Field(default=0, ge=0, le=150, description="Lines before the header.")
    header: bool = Field(
        default=True, description="false: no line of titles; columns go by their numbers."
    )
    lines_below_header: int = Field(
        default=0, ge=0, le=20, description="Lines between titles and samples, such as units."
    )


class TimeColumn(StrictModel):
    """Where the times stand."""

    column: Column
    unit: TimeUnit = Field(
        description="s, ms, us, ns, min, h, day, or clock for a time of day or a date."
    )
    wraps_bits: Literal[8, 16, 24, 32] | None = Field(
        default=None, description="Width of a counter that starts again from 0."
    )

    @model_validator(mode="after")
    def _clock_does_not_wrap(self) -> TimeColumn:
        if self.unit == "clock" and self.wraps_bits:
            raise ValueError("a time of day has no wraps_bits; that it passes midnight is seen to")
        return self


class InAFile(StrictModel):
    """A quantity that may stand in a file of its own, with its own times."""

    file: Patterns | None = Field(
        default=None,
        description="Which of the files it is in, as a pattern, or several of which the first that "
        "fits counts; null: that of its sensor.",
    )
    time: TimeColumn | None = Field(
        default=None, description="Times of its rows; null: as in the whole mapping."
    )
    optional: bool = Field(
        default=False, description="true: left out where no file fits `file`, instead of refused."
    )

    @model_validator(mode="after")
    def _optional_file(self) -> InAFile:
        if self.optional and self.file is None:
            raise ValueError("optional goes with a `file` of its own")
        return self


def _one_of(columns: object, array: str | None) -> None:
    if (columns is None) == (array is None):
        raise ValueError("give either columns, or array: the name of an array that holds all")


class VectorColumns(InAFile):
    """Three columns; value = (number - offset) x scale, in the unit."""

    columns: Columns3 | None = Field(default=None, description="For x, y, z.")
    array: str | None = Field(
        default=None,
        description="In place of columns: an array of three columns of a MATLAB or HDF5 file, by "
        "its path, such as Sensors/7/Accelerometer.",
    )
    offset: float = Field(
        default=0.0, description="Taken off each number first, e.g. 32768 for unsigned counts."
    )
    scale: float = Field(default=1.0, description="Units for each count.")
    axes: AxisNames | None = Field(
        default=None, description="In place of the sensor's axes; may mirror."
    )

    @model_validator(mode="after")
    def _scale_is_not_zero(self) -> VectorColumns:
        _one_of(self.columns, self.array)
        if self.scale == 0:
            raise ValueError("a scale of 0 would lose every sample")
        return self


_WITH_UNIT = re.compile(r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")


def full_scale_parts(quantity: str, stated: float | str) -> tuple[float, str | None]:
    """A stated full scale as a number and its unit, None for that of the quantity.

    Args:
        quantity: "acc" or "gyr".
        stated: Such as 16, or "16 g".

    Raises:
        ValueError: It is no such thing.
    """
    unit = None
    if isinstance(stated, str):
        found = _WITH_UNIT.fullmatch(stated)
        if found is None or known_unit(quantity, found[2]) is None:
            raise ValueError(
                f"'{stated}' is no full scale; write a number in the quantity's unit, or one with "
                f"its unit ({', '.join(unit_names(quantity))})"
            )
        stated, unit = float(found[1]), found[2]
    if stated <= 0:
        raise ValueError("a full scale is more than 0")
    return float(stated), unit


FULL_SCALE = Field(
    default=None,
    description="Largest reading of an axis, in `unit`, or with its own such as '16 g'; readings "
    "there count as clipped.",
)


class SaidBeside(StrictModel):
    """What a file beside the samples says of the phone or board: a table whose first row counts."""

    file: Patterns = Field(description="Which file, as a pattern.")
    where: dict[str, list[str]] = Field(
        min_length=1,
        max_length=10,
        description="Texts by column, upper or lower case; each column must hold one of its own.",
    )


class AccColumns(VectorColumns):
    """Accelerometer: specific force, with gravity."""

    negated_where: SaidBeside | None = Field(
        default=None,
        description="Its sign is the opposite of the force's where that file says so; where it is "
        "not there, that is said.",
    )

    unit: AccUnit | None = Field(
        default=None, description="Left out: told by gravity at rest, or asked for."
    )
    full_scale: float | str | None = FULL_SCALE

    @field_validator("full_scale")
    @classmethod
    def _can_be(cls, stated: float | str | None) -> float | str | None:
        if stated is not None:
            full_scale_parts("acc", stated)
        return stated


class GyrColumns(VectorColumns):
    """Gyroscope."""

    unit: GyrUnit | None = Field(
        default=None, description="Left out: told by the accelerometer's turns, or asked for."
    )
    full_scale: float | str | None = FULL_SCALE

    @field_validator("full_scale")
    @classmethod
    def _can_be(cls, stated: float | str | None) -> float | str | None:
        if stated is not None:
            full_scale_parts("gyr", stated)
        return stated


class MagColumns(VectorColumns):
    """Magnetometer."""

    unit: MagUnit = Field(description="au is an arbitrary unit, taken for 40 uT.")


class QuaternionColumns(StrictModel):
    """Orientations."""

    columns: Columns4 | None = Field(default=None, description="In the order that `order` says.")
    array: str | None = Field(
        default=None, description="In place of columns: an array of four columns, by its path."
    )
    order: Literal["wxyz", "xyzw"] = Field(description="Where the scalar stands.")
    direction: Literal["earth_from_sensor", "sensor_from_earth"] = Field(
        default="earth_from_sensor",
        description="earth_from_sensor: turns vectors of the sensor into the earth.",
    )
    earth: Literal["ENU", "NED", "NWU"] = Field(
        default="ENU",
        description="What the earth's x, y and z point to: east, north, up; north, east, down; or "
        "north, west, up.",
    )

    @model_validator(mode="after")
    def _columns_or_array(self) -> QuaternionColumns:
        _one_of(self.columns, self.array)
        return self


class DeviceQuaternion(QuaternionColumns, InAFile):
    """Orientations by the sensor's own filter."""


class TruthColumns(QuaternionColumns):
    """Orientations of a reference system, of the sensor or of the body it is mounted on.

    Empty or NaN where lost.
    """

    file: str | None = Field(
        default=None,
        description="A file of its own, beside the samples; null: the samples' own rows.",
    )
    text: TextLayout = Field(default_factory=TextLayout, description="How that file is written.")
    time: TimeColumn | None = Field(default=None, description="Times in that file.")
    rate_hz: float | None = Field(default=None, gt=0, le=100_000, description="Or its rate.")
    same_clock: bool = Field(
        default=False, description="Whether its times are on the clock of the samples."
    )
    judged: Column | None = Field(
        default=None, description="Column that is not 0 where an error counts."
    )
    mounting: Placement = Field(
        default_factory=Placement, description="The sensor in the body whose orientation this is."
    )
    world: Literal["z_up", "unknown"] = Field(
        default="z_up",
        description="Whether the reference's z points up, or nobody knows where up is in it.",
    )
    sd_deg: float | None = Field(
        default=None,
        gt=0,
        le=30,
        description="Standard uncertainty of these orientations about each axis [deg]; null: not "
        "known, and so is the uncertainty of every error.",
    )

    @model_validator(mode="after")
    def _file_has_times(self) -> TruthColumns:
        if self.file is None and (self.time or self.rate_hz or self.same_clock):
            raise ValueError(
                "time, rate_hz and same_clock belong to a truth with a file of its own"
            )
        if self.file is not None and (self.time is None) == (self.rate_hz is None):
            raise ValueError("a truth with a file of its own needs either time or rate_hz")
        return self


class SensorColumns(StrictModel):
    """One inertial sensor."""

    description: str = Field(default="", description="For people.")
    device: str | None = Field(
        default=None,
        min_length=1,
        max_length=100,
        description="The part itself, such as its serial number: a stored calibration finds it.",
    )
    file: Patterns | None = Field(
        default=None,
        description="Which of the files it is in, as a pattern: *_wrist.csv; null: any.",
    )
    acc: AccColumns | None = None
    gyr: GyrColumns | None = None
    mag: MagColumns | None = None
    quaternion: DeviceQuaternion | None = Field(
        default=None, description="By the sensor's own filter."
    )
    temperature: Column | None = Field(default=None, description="Temperature of the part [deg C].")
    counter: Column | None = Field(
        default=None, description="Sample counter; wraps of 8, 16 and 32 bits are seen to."
    )
    axes: str | AxisNames | None = Field(
        default=None, description="Name of an axis map, or {x: -z, y: -y, z: -x}."
    )
    sampling: Literal["instantaneous", "integrated"] = Field(
        default="instantaneous",
        description="integrated: a value is the mean over the interval before its stamp, and so "
        "half an interval older.",
    )
    gyr_delay_ms: float | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="How much older than its stamp an angular rate is, by integration and low pass "
        "together [ms]; null: half an interval is taken, and is in the uncertainty as well.",
    )
    truth: TruthColumns | None = None

    @model_validator(mode="after")
    def _measures_something(self) -> SensorColumns:
        if self.acc is None and self.gyr is None and self.quaternion is None:
            raise ValueError("a sensor needs acc, gyr or quaternion")
        return self


class AngleColumns(StrictModel):
    """Angles of joints that another system computed, in a file of their own."""

    file: str = Field(description="Beside the samples; CSV, TSV, Parquet, MATLAB or HDF5.")
    text: TextLayout = Field(default_factory=TextLayout, description="How that file is written.")
    time: TimeColumn | None = Field(default=None, description="Times in that file.")
    rate_hz: float | None = Field(default=None, gt=0, le=100_000, description="Or its rate.")
    unit: Literal["deg", "rad"] | None = Field(
        default=None, description="Of the angles; left out: by their titles or their size."
    )
    same_clock: bool = Field(
        default=False, description="Whether its times are on the clock of the samples."
    )
    offset_s: float | None = Field(
        default=None,
        ge=-1e9,
        le=1e9,
        description="Added to its times; left out: found by the motion.",
    )
    joints: dict[Name, dict[str, str]] = Field(
        min_length=1,
        description="Column of each angle by joint and angle (flexion, adduction, first, ...), "
        "such as {knee: {flexion: knee_angle}}; -knee_angle where it counts the other way.",
    )

    @model_validator(mode="after")
    def _times(self) -> AngleColumns:
        if (self.time is None) == (self.rate_hz is None):
            raise ValueError("angles in a file of their own need either time or rate_hz")
        if self.same_clock and (self.time is None or self.offset_s is not None):
            raise ValueError("same_clock goes with `time`, and without `offset_s`")
        return self


class MappingSpec(StrictModel):
    """A whole mapping."""

    description: str = Field(min_length=1, description="What these files are, in a sentence.")
    source: str = Field(default="", description="Where that is known from.")
    text: TextLayout = Field(default_factory=TextLayout, description="How the files are written.")
    time: TimeColumn | None = Field(default=None, description="Times of the samples.")
    rate_hz: float | None = Field(
        default=None,
        gt=0,
        le=100_000,
        description="Or their rate; beside times, only for the record.",
    )
    sensors: dict[Name, SensorColumns] = Field(min_length=1, max_length=64)
    segments: dict[Name, Name | Segment] = Field(
        default={},
        max_length=64,
        description="Body segment that each sensor stands for, by sensor: a name, or {name, "
        "rotation_deg}.",
    )
    joints: dict[Name, BodyJoint] = Field(
        default={},
        max_length=64,
        description="Joint angles between sensors, as in a protocol; `alignment` of one in place "
        "of that below.",
    )
    truth_angles: AngleColumns | None = Field(
        default=None, description="True angles of these joints, in a file of their own."
    )
    alignment: SegmentAlignment = Field(
        default_factory=SegmentAlignment, description="How the sensors sit on their segments."
    )
    hemisphere: Literal["north", "south"] | None = Field(
        default=None,
        description="Of the magnetic equator, where it was recorded: north of it the field points "
        "down, south of it up, which tells the sign of the accelerometer.",
    )
    exclude: list[Exclusion] = Field(
        default=[],
        max_length=1000,
        description="Intervals whose samples count as lost, each with a reason.",
    )
    beside: list[str] = Field(
        default=[],
        max_length=100,
        description="Patterns of files that stand beside the samples: those that no sensor reads "
        "are left out, and said, instead of refused.",
    )
    estimate: Estimation | None = Field(
        default=None, description="As in a protocol; left out: what suits the sensors."
    )


def find_mapping(name: str) -> YamlDocument[MappingSpec]:
    """A mapping by its path, or by the name of one that ships with the bench.

    Raises:
        NotFoundError: No such mapping; lists those that ship.
        FileProblems: It is malformed.
    """
    path = Path(name)
    if path.suffix.lower() in {".yaml", ".yml"} or path.is_file():
        return load_yaml(path, MappingSpec)
    if name not in list_mappings():
        raise NotFoundError(
            "mapping (neither a .yaml file nor one that ships)", name, list_mappings()
        )
    return load_yaml(MAPPINGS / f"{name}.yaml", MappingSpec)


def list_mappings() -> list[str]:
    """Names of the mappings that ship with the bench."""
    return shipped_names(MAPPINGS)
