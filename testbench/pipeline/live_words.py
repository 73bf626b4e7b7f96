"""What is said, beside the bench, of a session that is being recorded: as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Event

if TYPE_CHECKING:
    from testbench.pipeline.live_sensor import LiveSensor


class Doing:
    """What a run does now, and how long that takes.

    Args:
        count: Of its steps; None where it has none.
        steps: As planned.

    Attributes:
        shift_ns: How much later the arm is than the plan [ns].
        batteries: Of each sensor that tells, its charge [%].
    """

    def __init__(self, count: int | None, steps: Sequence[PlannedStep]):
        self._count = count or len(steps)
        self._steps = {step.index: step for step in steps}
        self._step: PlannedStep | None = None
        self._phase = ""
        self.shift_ns = 0
        self.batteries: dict[str, float] = {}

    def note(self, event: Event) -> None:
        """Keep what an event says."""
        details = event.details
        charge = details.get("battery_percent")
        if charge is not None and "sensor" in details:
            self.batteries[str(details["sensor"])] = float(charge)
        if event.event == "step_started":
            self._step, self._phase = self._steps.get(details.get("index", -1)), "moves"
            if self._step is not None:
                self.shift_ns = event.host_time_ns - self._step.start_ns
        elif event.event == "step_settled":
            self._phase = "dwells"
        elif event.event in {"paused", "resumed"}:
            self._phase = {"paused": "paused", "resumed": "goes on"}[event.event]

    def lines(self, now_ns: int, duration_s: float | None, over: str = "") -> list[str]:
        """The clock, the step and what is left.

        Args:
            now_ns: Host time.
            duration_s: Of the whole as planned; None where it is open.
            over: How it ended; empty while it goes on.
        """
        now = now_ns / NANOSECONDS
        clock = f"# {now:.1f} s" + (f" of {duration_s:.1f} s" if duration_s is not None else "")
        if over:
            return [f"{clock}: {over}"]
        lines = [clock]
        step = self._step
        if step is not None:
            left = max(0.0, (step.end_ns + self.shift_ns - now_ns) / NANOSECONDS)
            lines.append(f"**step {step.index + 1} of {self._count}**: {step.name}")
            lines.append(f"{step.section}, {self._phase}; {left:.1f} s left of the step")
        return lines

    @staticmethod
    def errors(rms: Mapping[str, Mapping[str, float | None]], held: bool) -> list[str]:
        """The errors so far, as a table; no line without any.

        Args:
            rms: Root mean squares [rad] by filter, by what they are of.
            held: Whether headings are held.
        """
        filters = list(dict.fromkeys(key for own in rms.values() for key in own))
        if not filters:
            return []
        if not held:
            return ["Headings are still being aligned; errors count from the first evaluated step."]
        head = [
            "| RMS error so far [deg] |" + "|".join(filters) + "|",
            "|---|" + "---|" * len(filters),
        ]
        rows = [
            f"| {name} |" + "|".join(_degrees(own.get(key)) for key in filters) + "|"
            for name, own in rms.items()
        ]
        return ["\n".join([*head, *rows]), "Not calibrated, mountings as stated: to be looked at."]


def _degrees(angle: float | None) -> str:
    return "" if angle is None else f"{np.degrees(angle):.1f}"


def table_of_sensors(
    sensors: Mapping[str, LiveSensor], batteries: Mapping[str, float], now_ns: int
) -> str:
    """What came of each sensor.

    Args:
        sensors: By name.
        batteries: Charges that were told [%], by sensor.
        now_ns: Host time.
    """
    lines = [
        "| sensor | rate [Hz] | samples | lost | last [ms ago] |"
        + " battery [%] |" * bool(batteries)
    ]
    lines += ["|---|---|---|---|---|" + "---|" * bool(batteries)]
    for name, own in sensors.items():
        age = (now_ns - own.last_ns) * 1e-6
        row = f"| {name} | {own.rate_hz:.0f} | {own.count} | {own.lost} | {age:.0f} |"
        charge = f"{batteries[name]:.0f}" if name in batteries else ""
        lines.append(row + (f" {charge} |" if batteries else ""))
    return "\n".join(lines)
