"""What somebody asks of an emulated controller.

The token that clients must say is no part of it: a request may be kept where others read it.
"""

from __future__ import annotations

from pydantic import Field

from testbench.records.specs.asked import Asked, Place


class EmulationRequest(Asked):
    """A controller to emulate."""

    arm: str = Field(description="Of the catalogue of emulated controllers, by its name.")
    model: str | None = Field(default=None, description="The arm; the controller's usual if null.")
    address: str = Field(default="127.0.0.1", description="To listen on.")
    port_shift: int = Field(default=0, description="Added to the number of each port.")
    scenario: Place | None = Field(default=None, description="YAML file of faults to come.")
    at_deg: tuple[float, ...] | None = Field(
        default=None, description="Joint angles at the start [deg]; home if null."
    )
    seed: int = Field(default=0, ge=0, description="Of the encoders' noise.")
    own: dict[str, str | int | bool | None] = Field(
        default={},
        description="Options that only this controller has; as its entry has them if left out.",
    )
