"""What disturbs the earth's magnetic field: magnetised parts and iron, of the arm and about it."""

from __future__ import annotations

from pydantic import Field, model_validator

from testbench.records.specs.strict import Angles3, StrictModel


class MagneticDipole(StrictModel):
    """A magnetised or magnetisable part: a motor, the steel of a joint, the bench.

    A permanent moment turns with its link (hard iron); iron takes a moment of the earth's field,
    which keeps its direction in the world while the link turns (soft iron).
    """

    name: str = Field(
        default="", max_length=100, description="What it is, e.g. motor of the elbow."
    )
    link: str = Field(
        description="Link that carries it, by its URDF name; the base for what stands beside the "
        "arm."
    )
    position_mm: Angles3 = Field(default=[0.0, 0.0, 0.0], description="Position in the link [mm].")
    moment_A_m2: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="Permanent magnetic moment in the link [A m^2]."
    )
    iron_radius_mm: float = Field(
        default=0.0,
        ge=0,
        le=1000,
        description="Radius of a sphere of soft iron that takes as large a moment [mm]; 0: none.",
    )

    @model_validator(mode="after")
    def _disturbs(self) -> MagneticDipole:
        if not any(self.moment_A_m2) and not self.iron_radius_mm:
            raise ValueError("a magnetic dipole needs moment_A_m2 or iron_radius_mm")
        return self


class Magnetism(StrictModel):
    """What of an arm, and of what it stands on, disturbs the magnetic field."""

    dipoles: list[MagneticDipole] = Field(
        default=[], description="Magnetised parts and iron, by link."
    )
    why: str = Field(default="", description="Where these numbers come from.")
