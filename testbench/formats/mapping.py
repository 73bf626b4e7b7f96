"""The mapping of a file to a session, as a person writes it: which column is what.

docs/formats.md explains it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from testbench.exceptions import NotFoundError
from testbench.formats.axes import PRESETS, AxisNames
from testbench.formats.units import AccUnit, GyrUnit, MagUnit, TimeUnit
from testbench.records.disk.yaml_file import YamlDocument, load_yaml
from testbench.records.specs.protocol import Estimation
from testbench.records.specs.strict import Name, Placement, StrictModel

Column = Annotated[
    str | Annotated[int, Field(ge=1)], Field(description="Title of a column, or its number from 1.")
]
Columns3 = Annotated[list[Column], Field(min_length=3, max_length=3)]
Columns4 = Annotated[list[Column], Field(min_length=4, max_length=4)]
MAPPINGS = PRESETS / "mappings"


class TextLayout(StrictModel):
    """How a text file is written; Parquet needs none of it."""

    separator: Literal["auto", "comma", "semicolon", "tab", "blanks"] = Field(
        default="auto", description="Between columns."
    )
    decimal: Literal["auto", "point", "comma"] = Field(default="auto", description="In numbers.")
    encoding: Literal["auto", "utf-8", "utf-16", "latin-1", "cp1252"] = Field(
        default="auto", description="auto: UTF-8 or UTF-16."
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


class VectorColumns(StrictModel):
    """Three columns; value = (number - offset) x scale, in the unit."""

    columns: Columns3 = Field(description="For x, y, z.")
    offset: float = Field(
        default=0.0, description="Taken off each number first, e.g. 32768 for unsigned counts."
    )
    scale: float = Field(default=1.0, description="Units for each count.")
    axes: AxisNames | None = Field(
        default=None, description="In place of the sensor's axes; may mirror."
    )

    @model_validator(mode="after")
    def _scale_is_not_zero(self) -> VectorColumns:
        if self.scale == 0:
            raise ValueError("a scale of 0 would lose every sample")
        return self


class AccColumns(VectorColumns):
    """Accelerometer: specific force, with gravity."""

    unit: AccUnit | None = Field(
        default=None, description="Left out: told by gravity at rest, or asked for."
    )


class GyrColumns(VectorColumns):
    """Gyroscope."""

    unit: GyrUnit | None = Field(
        default=None, description="Left out: told by the accelerometer's turns, or asked for."
    )


class MagColumns(VectorColumns):
    """Magnetometer."""

    unit: MagUnit = Field(description="au is an arbitrary unit, taken for 40 uT.")


class QuaternionColumns(StrictModel):
    """Orientations."""

    columns: Columns4 = Field(description="In the order that `order` says.")
    order: Literal["wxyz", "xyzw"] = Field(description="Where the scalar stands.")
    direction: Literal["earth_from_sensor", "sensor_from_earth"] = Field(
        default="earth_from_sensor",
        description="earth_from_sensor: turns vectors of the sensor into the earth.",
    )


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
    file: str | None = Field(
        default=None,
        description="Which of the files it is in, as a pattern: *_wrist.csv; null: any.",
    )
    acc: AccColumns | None = None
    gyr: GyrColumns | None = None
    mag: MagColumns | None = None
    quaternion: QuaternionColumns | None = Field(
        default=None, description="By the sensor's own filter."
    )
    temperature: Column | None = Field(default=None, description="Temperature of the part [deg C].")
    counter: Column | None = Field(
        default=None, description="Sample counter; wraps of 8, 16 and 32 bits are seen to."
    )
    axes: str | AxisNames | None = Field(
        default=None, description="Name of an axis map, or {x: -z, y: -y, z: -x}."
    )
    truth: TruthColumns | None = None

    @model_validator(mode="after")
    def _measures_something(self) -> SensorColumns:
        if self.acc is None and self.gyr is None and self.quaternion is None:
            raise ValueError("a sensor needs acc, gyr or quaternion")
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
    return sorted(path.stem for path in MAPPINGS.glob("*.yaml"))
