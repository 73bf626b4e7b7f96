"""The part of a protocol on a real arm: its tool, its speed, and the guards of a run."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from testbench.records.specs.strict import Angles3, StrictModel

Action = Literal["off", "warn", "pause", "stop"]


class Tool(StrictModel):
    """What the arm carries: the sensors, their holder and cables."""

    mass_kg: float = Field(ge=0, le=50, description="Mass on the flange [kg].")
    centre_mm: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="Centre of mass in the flange's frame [mm]."
    )


class Guard(StrictModel):
    """A limit during a run, and what follows when it is broken."""

    limit: Annotated[float, Field(gt=0)] = Field(
        description="In the unit that the guard's name ends with."
    )
    action: Action = Field(
        default="stop",
        description="off, warn (an event), pause (after the step under way), or stop.",
    )


class Guards(StrictModel):
    """What is watched while the arm moves."""

    imu_silence_s: Guard = Field(
        default=Guard(limit=2.0, action="stop"),
        description="A sensor sends nothing for so long [s].",
    )
    sample_gap_s: Guard = Field(
        default=Guard(limit=0.5, action="warn"),
        description="Two samples of a sensor are so far apart on its own clock [s].",
    )
    stuck_time_s: Guard = Field(
        default=Guard(limit=1.0, action="warn"),
        description="A live sensor's own clock stands still for so long while its samples come "
        "[s].",
    )
    stuck_reading_s: Guard = Field(
        default=Guard(limit=1.0, action="warn"),
        description="A live sensor says the same for so long, to the last digit of each axis [s].",
    )
    arrival_gap_s: Guard = Field(
        default=Guard(limit=0.5, action="warn"),
        description="Two samples of a live sensor arrive so far apart, also where they come in a "
        "burst afterwards [s].",
    )
    temperature_degC: Guard = Field(
        default=Guard(limit=70.0, action="warn"),
        description="A joint of the arm is so warm [degC], where it reports that.",
    )
    magnetic_disturbance_percent: Guard = Field(
        default=Guard(limit=20.0, action="warn"),
        description="The magnetic norm differs by so much from that of the sensor's first second "
        "[%].",
    )
    battery_percent: Guard = Field(
        default=Guard(limit=10.0, action="warn"),
        description="A sensor's battery is down to this [%], where it reports that.",
    )


class ArmUse(StrictModel):
    """How a real arm is used; a simulated one takes no notice."""

    tool: Tool | None = Field(
        default=None, description="Weight on the flange; null: what the controller has been told."
    )
    speed_slider_percent: Annotated[float, Field(ge=10, le=100)] = Field(
        default=100.0,
        description="The speed slider must stand at least here, or the run is refused or stopped "
        "[%].",
    )
    tracking_error_deg: Annotated[float, Field(gt=0, le=45)] = Field(
        default=5.0,
        description="The arm is stopped when a joint is so far from everything it was sent lately "
        "[deg].",
    )
