"""The part of a protocol that moves the arm: sections, steps, sweeps and variables."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from testbench.records.specs.strict import Name, StrictModel

MOST_VALUES = 100_000

Fraction = Annotated[float, Field(ge=0.001, le=1)]
_Formula = Annotated[str, Field(min_length=1, max_length=200), Tag("<expression>")]


def _number_or_text(value: Any) -> str | None:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "<number>"
    return "<expression>" if isinstance(value, str) else None


_NUMBER_OR_TEXT = Discriminator(
    _number_or_text, "expression", 'must be a number or an expression such as "90 - flexion_deg"'
)
Expression = Annotated[Annotated[float, Tag("<number>")] | _Formula, _NUMBER_OR_TEXT]
NonNegative = Annotated[Annotated[float, Field(ge=0), Tag("<number>")] | _Formula, _NUMBER_OR_TEXT]


class Range(StrictModel):
    """An arithmetic sequence, both ends included."""

    start: float = Field(description="First value.")
    stop: float = Field(description="Last value.")
    step: float = Field(
        description="Positive or negative, never zero; stop must lie a whole number of steps from "
        "start."
    )

    @model_validator(mode="after")
    def _reaches_stop(self) -> Range:
        if self.step == 0:
            raise ValueError("step must not be zero")
        steps = (self.stop - self.start) / self.step
        if abs(steps) >= MOST_VALUES:
            raise ValueError(
                f"a range of {abs(steps):.6g} steps is more than the {MOST_VALUES} allowed"
            )
        if steps < 0 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"stop {self.stop:g} is not a whole number of steps of {self.step:g} from start "
                f"{self.start:g}" + ("; the step points the other way" if steps < 0 else "")
            )
        return self

    def values(self) -> list[float]:
        """The values, from start to stop."""
        count = round((self.stop - self.start) / self.step)
        return [self.start + i * self.step for i in range(count + 1)]


def _variable_kind(value: Any) -> str | None:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "<number>"
    return (
        "<list>"
        if isinstance(value, list)
        else "<range>"
        if isinstance(value, dict | Range)
        else None
    )


Variable = Annotated[
    Annotated[float, Tag("<number>")]
    | Annotated[list[float], Field(min_length=1), Tag("<list>")]
    | Annotated[Range, Tag("<range>")],
    Discriminator(
        _variable_kind,
        "variable",
        "must be a number, a list of numbers, or a range {start: .., stop: .., step: ..}",
    ),
]


class Motion(StrictModel):
    """How fast to move, as fractions of the robot's limits."""

    speed: Fraction = Field(
        default=0.5, description="Fraction of each joint's speed limit, 0.001 to 1."
    )
    acceleration: Fraction = Field(
        default=0.5, description="Fraction of each joint's acceleration limit, 0.001 to 1."
    )
    jerk: Fraction = Field(
        default=0.5, description="Fraction of each joint's jerk limit, 0.001 to 1."
    )


class Sine(StrictModel):
    """Joint angle = centre + amplitude * sin(2 pi frequency t + phase), faded in and out over
    `ramp_cycles`.
    """

    amplitude_deg: Expression = Field(
        description="Amplitude about the angle the sweep starts at [deg]."
    )
    frequency_hz: Expression = Field(description="Frequency, above 0, at most 20 [Hz].")
    cycles: Expression = Field(
        description="Whole number of cycles at full amplitude, without the ramps."
    )
    ramp_cycles: NonNegative = Field(
        default=1.0, description="Cycles of each fade, in and out; at least 0.5."
    )
    phase_deg: Expression = Field(
        default=0.0, description="Phase of the sine at the start of the fade [deg]."
    )


class Fourier(StrictModel):
    """Joint angle = centre + sum of amplitude_k * sin(2 pi k frequency t + phase_k), faded in and
    out over `ramp_cycles`.
    """

    amplitudes_deg: list[Expression] = Field(
        min_length=1,
        max_length=20,
        description="Amplitude of each harmonic about the angle the sweep starts at, the base "
        "first [deg].",
    )
    phases_deg: list[Expression] = Field(
        min_length=1,
        max_length=20,
        description="Phase of each harmonic at the start of the fade, as many as amplitudes [deg].",
    )
    frequency_hz: Expression = Field(
        description="Base frequency; that of the highest harmonic is above 0, at most 20 [Hz]."
    )
    cycles: Expression = Field(
        description="Whole number of cycles at full amplitude, without the ramps."
    )
    ramp_cycles: NonNegative = Field(
        default=1.0, description="Cycles of each fade, in and out; at least 0.5."
    )

    @model_validator(mode="after")
    def _equally_many(self) -> Fourier:
        if len(self.amplitudes_deg) != len(self.phases_deg):
            raise ValueError(
                f"{len(self.amplitudes_deg)} amplitudes_deg and {len(self.phases_deg)} phases_deg: "
                "each needs its own"
            )
        return self


class Trapezoid(StrictModel):
    """There and back at a constant rate, `cycles` times."""

    amplitude_deg: Expression = Field(
        description="How far to go from the angle the sweep starts at, and back; may be negative "
        "[deg]."
    )
    rate_deg_s: Expression = Field(
        description="Constant rate between speeding up and slowing down, above 0 [deg/s]."
    )
    cycles: Expression = Field(
        default=1.0, description="How often to go there and back, a whole number."
    )
    hold_s: NonNegative = Field(default=0.0, description="Rest at either end [s].")


class Sweep(StrictModel):
    """The motion of one joint during a sweep."""

    sine: Sine | None = Field(default=None, description="A sine that is faded in and out.")
    fourier: Fourier | None = Field(
        default=None, description="A sum of harmonics that is faded in and out."
    )
    trapezoid: Trapezoid | None = Field(
        default=None, description="There and back at a constant rate."
    )

    @model_validator(mode="after")
    def _one_shape(self) -> Sweep:
        if sum(shape is not None for shape in (self.sine, self.fourier, self.trapezoid)) != 1:
            raise ValueError("a sweep needs one of: sine, fourier, trapezoid")
        return self


def _list_or_mapping(value: Any) -> str | None:
    return "<list>" if isinstance(value, list) else "<mapping>" if isinstance(value, dict) else None


Pose = Annotated[
    Annotated[list[Expression], Field(max_length=100), Tag("<list>")]
    | Annotated[dict[str, Expression], Field(min_length=1), Tag("<mapping>")],
    Discriminator(
        _list_or_mapping,
        "pose",
        "must be a list of joint angles or a mapping from joint names to angles",
    ),
]
Loop = Annotated[list[Name], Field(max_length=10)]


class Step(StrictModel):
    """One thing to do: move (and dwell), dwell where the arm is, sweep, or repeat steps over
    variables.
    """

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="For people; without it the section and the values of the loop."
    )
    move_to_deg: Pose | None = Field(
        default=None,
        description="Joint angles in the robot's order, or by joint name (the others stay) [deg].",
    )
    move_to: Literal["home"] | None = Field(
        default=None, description="home: the pose that the robot file names."
    )
    sweep: dict[str, Sweep] | None = Field(
        default=None, description="Continuous motion, by joint name."
    )
    dwell_s: NonNegative | None = Field(
        default=None, description="Time at rest after the motion [s]."
    )
    motion: Motion | None = Field(
        default=None, description="Speed of this step, or of the steps it repeats."
    )
    for_each: Loop | None = Field(
        default=None, description="Variables to loop over with steps; the last changes fastest."
    )
    steps: list[Step] | None = Field(
        default=None, description="Steps to repeat for each value of for_each."
    )

    @model_validator(mode="after")
    def _one_action(self) -> Step:
        actions = [
            key
            for key in ("move_to_deg", "move_to", "sweep", "steps")
            if getattr(self, key) is not None
        ]
        if len(actions) > 1:
            raise ValueError(f"a step does one thing; this one has {' and '.join(actions)}")
        if not actions and self.dwell_s is None:
            raise ValueError("a step needs one of: move_to_deg, move_to, sweep, dwell_s, steps")
        if self.for_each is not None and self.steps is None:
            raise ValueError("for_each in a step needs steps to repeat")
        if self.steps is not None and not self.steps:
            raise ValueError("steps must not be empty")
        if self.steps is not None and self.dwell_s is not None:
            raise ValueError("dwell_s does not go with steps; give it to the steps themselves")
        if self.sweep is not None and not self.sweep:
            raise ValueError("sweep must name at least one joint")
        if (
            self.sweep is not None
            and len(self.sweep) > 1
            and any(sweep.trapezoid for sweep in self.sweep.values())
        ):
            raise ValueError(
                "a trapezoid sweeps one joint alone; only sines and Fourier series can run together"
            )
        return self


Role = Literal["calibration", "reference", "evaluation"]


class Section(StrictModel):
    """A named part of the protocol, so that an evaluation can select it."""

    name: Name = Field(description="A name of its own, for evaluation and acceptance.")
    role: Role = Field(
        default="evaluation",
        description="calibration: fits sensor errors; reference: a known pose that aligns the "
        "frames; evaluation: is judged.",
    )
    include: Annotated[str, Field(min_length=1, max_length=200)] | None = Field(
        default=None, description="Another protocol file beside this one, whose steps are taken."
    )
    for_each: Loop = Field(
        default=[], description="Variables to loop over; the last changes fastest."
    )
    motion: Motion | None = Field(
        default=None, description="Speed of this section, in place of the protocol's."
    )
    steps: list[Step] | None = Field(default=None, description="What to do, in order.")

    @model_validator(mode="after")
    def _steps_or_include(self) -> Section:
        if (self.steps is None) == (self.include is None):
            raise ValueError("a section needs either steps or include")
        if self.steps is not None and not self.steps:
            raise ValueError("steps must not be empty")
        if self.include is not None and self.for_each:
            raise ValueError("for_each does not go with include")
        return self
