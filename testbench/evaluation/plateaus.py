"""A joint held still at angles that a person read from a goniometer and typed in.

Castellanos Alonso 2023, annex H: a hand goniometer with a sensor on each arm is set to one angle
after another. Nothing is recorded of them but the list; each plateau is found where both sensors
rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.evaluation.noise import runs_at_rest
from testbench.exceptions import InputError, NotFoundError
from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import flexion_of, nearest_turn
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation_rows import PlateauRow
from testbench.records.session.session import Session

SHORTEST_S = 1.0
"""Rests of both sensors shorter than this are pauses of a move."""


def plateau_rows(
    session: Session, estimate: Estimate, typed: Mapping[str, Sequence[float]]
) -> list[PlateauRow]:
    """Every filter in every plateau.

    Args:
        session: The recording.
        estimate: Of it.
        typed: Angles by joint, in the order in which they were set [deg].

    Raises:
        NotFoundError: No such joint.
        InputError: There are not as many plateaus as angles; names those that were found.
    """
    rows = []
    for name, angles in typed.items():
        if name not in estimate.joints:
            raise NotFoundError("joint", name, list(estimate.joints))
        joint, found = session.analysis.joints[name], estimate.joints[name]
        time = found.host_time_ns
        still = _still(estimate, joint.proximal, joint.distal, time)
        spans = [
            run
            for run in runs_at_rest(time, still)
            if time[run.stop - 1] - time[run.start] >= SHORTEST_S * NANOSECONDS
        ]
        seconds = (time - time[0]) / NANOSECONDS
        if len(spans) != len(angles):
            told = ", ".join(
                f"{seconds[s.start]:.1f} to {seconds[s.stop - 1]:.1f} s" for s in spans
            )
            raise InputError(
                f"joint '{name}': {len(angles)} angles were typed, and both sensors rest "
                f"{len(spans)} times for {SHORTEST_S:g} s or longer ({told or 'never'}); each "
                "plateau needs its angle, and each angle its plateau"
            )
        for (kind, sequence), series in found.angles.items():
            definition = next(d for d in joint.definitions() if d.label == sequence)
            for i, (span, angle) in enumerate(zip(spans, angles, strict=True)):
                wanted = np.full(span.stop - span.start, np.radians(angle))
                seen = np.degrees(nearest_turn(flexion_of(definition, series[span]), wanted))
                rows.append(
                    PlateauRow(
                        name,
                        kind,
                        sequence,
                        i + 1,
                        float(seconds[span.start]),
                        float(seconds[span.stop - 1]),
                        float(angle),
                        float(np.mean(seen)),
                        float(np.std(seen, ddof=1)),
                        float(np.mean(seen)) - float(angle),
                    )
                )
    return rows


def _still(estimate: Estimate, proximal: str, distal: str, time: np.ndarray) -> np.ndarray:
    """Where both sensors rest, at the instants of the joint, shape (n,), bool."""
    both = np.ones(len(time), dtype=bool)
    for name in (proximal, distal):
        own = estimate.sensors[name]
        near = np.clip(np.searchsorted(own.host_time_ns, time), 0, len(own.host_time_ns) - 1)
        both &= own.static[near] & ~own.flagged[near]
    return both
