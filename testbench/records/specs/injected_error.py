"""An error that is put into the recorded orientation of a sensor, to see what it does."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from testbench.records.specs.strict import Angles3, StrictModel


class InjectedError(StrictModel):
    """Yaw, pitch and roll by which a sensor, or what is believed of its segment, is off."""

    sensor: str = Field(description="Its name.")
    of: Literal["sensor", "start"] = Field(
        default="sensor",
        description="sensor: its orientation, throughout (Castellanos Alonso 2023, eq. 2.21); "
        "start: the orientation that its segment is believed to begin in (eqs 2.18, 2.20).",
    )
    yaw_pitch_roll_deg: Angles3 = Field(
        description="About z, y and x, in the order of eq. 2.19 [deg]."
    )
