"""Tuning a filter: the parameters that suit each session best, one set for all of them, and what
that set is worth elsewhere.

Sessions that choose parameters and sessions that test them are kept apart: the search is never
given the latter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.estimator import PreparedSession
from testbench.estimation.filters import OrientationFilter
from testbench.evaluation.objective import UNIT, Objective, SessionJudge
from testbench.exceptions import InputError
from testbench.model.noise import random_stream
from testbench.pipeline.parameter_space import FAILED, Effort, Optimum, Point, Space, find_optimum
from testbench.records.calibration_file import SensorCalibration
from testbench.records.session import Session
from testbench.records.session_writer import software_versions
from testbench.records.tuning import (
    GridPoint,
    Parameters,
    Search,
    Split,
    Tuning,
    describe,
    refuse_repeated,
)

Say = Callable[[str], None]


@dataclass(frozen=True)
class Sessions:
    """Sessions that choose the parameters, sessions that test them, and how they were told
    apart.
    """

    tuning: list[Session]
    test: list[Session] = field(default_factory=list)
    split: Split = field(default_factory=lambda: Split(method="none"))

    @staticmethod
    def given(tuning: Sequence[Session], test: Sequence[Session]) -> Sessions:
        """As the user divided them."""
        return Sessions(list(tuning), list(test), Split(method="given" if test else "none"))

    @staticmethod
    def drawn(sessions: Sequence[Session], share: float, seed: int) -> Sessions:
        """Whole sessions drawn for the test, whatever order they are given in.

        Args:
            sessions: All.
            share: Part of them to test on, above 0 and below 1; at least one on either side.
            seed: Of the draw.

        Raises:
            InputError: They cannot be divided so.
        """
        if len(sessions) < 2 or not 0 < share < 1:
            raise InputError(
                f"{len(sessions)} sessions cannot be divided with a part of {share:g} for the test"
            )
        ordered = sorted(sessions, key=lambda session: session.fingerprint)
        count = min(max(round(share * len(ordered)), 1), len(ordered) - 1)
        drawn = set(random_stream(seed, "split").permutation(len(ordered))[:count].tolist())
        test = [session for i, session in enumerate(ordered) if i in drawn]
        return Sessions(
            [s for s in sessions if s not in test],
            [s for s in sessions if s in test],
            Split(method="seeded", seed=seed),
        )


class SessionTrials:
    """One session that a filter runs over again and again.

    Args:
        session: The recording.
        objective: What to compute.
        kind: The filter; its parameters are those that are not tuned.
        names: Of the tuned parameters.
        calibrations: To correct the samples with first.
    """

    def __init__(
        self,
        session: Session,
        objective: Objective,
        kind: OrientationFilter,
        names: Sequence[str],
        calibrations: list[SensorCalibration] | None = None,
    ):
        self._prepared = PreparedSession(session, calibrations, objective.joints(session))
        self._judge = SessionJudge(session, objective, self._prepared.run([]))
        self._kind, self._names = kind, list(names)
        self._seen: dict[Point, float] = {}

    def __call__(self, point: Point) -> float:
        """The objective at a point; infinite where the filter fails."""
        if point not in self._seen:
            filled = with_values(self._kind, self._names, point)
            self._seen[point] = self._judge.value(self._prepared.run([filled]), filled.name)
        return self._seen[point]


def with_values(kind: OrientationFilter, names: Sequence[str], point: Point) -> OrientationFilter:
    """The same filter with other values of some parameters.

    Raises:
        InputError: It cannot be made with parameters, as every filter must that is tuned.
    """
    try:
        return type(kind)({**kind.parameters, **dict(zip(names, point, strict=True))})
    except TypeError as error:
        raise InputError(
            f"the filter {kind.name} cannot be made with parameters: {error}"
        ) from None


def tune(
    kind: OrientationFilter,
    sessions: Sessions,
    objective: str,
    tuned_utc: str,
    names: Sequence[str] | None = None,
    effort: Effort | None = None,
    leave_one_out: bool = False,
    calibrations: list[SensorCalibration] | None = None,
    filter_source: str = "",
    say: Say | None = None,
) -> Tuning:
    """Tune a filter.

    Args:
        kind: The filter; the search begins with its parameters, and those not tuned keep their
            values.
        sessions: What to tune and to test on.
        objective: As `Objective.parse` reads it.
        tuned_utc: Now, ISO 8601.
        names: Parameters to tune; all if None.
        effort: How hard to look.
        leave_one_out: Also test each tuning session by the set that the others choose.
        calibrations: To correct the raw samples with first.
        filter_source: Where a filter that is not the bench's came from.
        say: Called with what is being done.

    Raises:
        NotFoundError: An unknown parameter, objective, sensor or joint.
        InputError: A recording stands in the lists twice, or the filter cannot run on one.
        SessionError: A session has no truth to judge by.
    """
    effort, tell = effort or Effort(), say or _nothing
    wanted, space = Objective.parse(objective), Space.of(kind.PARAMETERS, names)
    described = [describe(s, "tuning") for s in sessions.tuning] + [
        describe(s, "test") for s in sessions.test
    ]
    if not sessions.tuning:
        raise InputError("no session is left to tune on")
    if leave_one_out and len(sessions.tuning) < 2:
        raise InputError("leaving one session out needs two sessions to tune on")
    refuse_repeated(described)
    start: Point = tuple(kind.parameters[name] for name in space.names)
    trials = []
    for session in sessions.tuning:
        tell(f"preparing {session.name}")
        trials.append(SessionTrials(session, wanted, kind, space.names, calibrations))

    def optimum(rows: Sequence[int]) -> Optimum:
        return find_optimum(
            space, start, lambda point: float(np.mean([trials[i](point) for i in rows])), effort
        )

    tell("one set for all sessions")
    every = range(len(trials))
    shared = optimum(every)
    if shared.value >= FAILED:
        raise InputError(
            f"{kind.name} gives no finite {objective} with any of the parameters tried"
        )
    entries = []
    for i, entry in enumerate(described[: len(trials)]):
        tell(f"best for {entry.session}")
        own = optimum([i])
        entry = entry.model_copy(
            update={
                "default_value": _finite(trials[i](start)),
                "value": _finite(trials[i](shared.point)),
                "own_parameters": _named(space, own.point),
                "own_value": _finite(own.value),
            }
        )
        if leave_one_out:
            others = optimum([j for j in every if j != i]).point
            entry = entry.model_copy(
                update={
                    "left_out_parameters": _named(space, others),
                    "left_out_value": _finite(trials[i](others)),
                }
            )
        entries.append(entry)
    for entry, session in zip(described[len(trials) :], sessions.test, strict=True):
        tell(f"testing on {entry.session}")
        test = SessionTrials(session, wanted, kind, space.names, calibrations)
        update = {"default_value": _finite(test(start)), "value": _finite(test(shared.point))}
        entries.append(entry.model_copy(update=update))
    combined, grid = effort.grid(space)
    return Tuning(
        schema_version=1,
        tuned_utc=tuned_utc,
        software=software_versions(),
        filter=kind.name,
        filter_source=filter_source,
        objective=str(wanted),
        unit=UNIT,
        tuned=space.names,
        parameters={**kind.parameters, **_named(space, shared.point)},
        value=shared.value,
        default_value=_finite(float(np.mean([trial(start) for trial in trials]))),
        at_edge=space.at_edge(shared.point),
        search=Search(
            design="every combination" if combined else "one parameter after the other",
            grid=dict(zip(space.names, grid, strict=True)),
            points=[
                GridPoint(
                    parameters=_named(space, point),
                    values=[_finite(trial(point)) for trial in trials],
                )
                for point in shared.tried
            ],
            refinement="nelder-mead" if effort.refine else "none",
            evaluations=shared.evaluations,
            converged=shared.converged,
        ),
        split=sessions.split.model_copy(update={"leave_one_out": leave_one_out}),
        sessions=entries,
    )


def _named(space: Space, point: Point) -> Parameters:
    return dict(zip(space.names, point, strict=True))


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) and value < FAILED else None


def _nothing(text: str) -> None:
    """Say nothing."""
