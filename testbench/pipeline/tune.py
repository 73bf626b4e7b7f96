"""Tuning a filter: the parameters that suit each session, one set for all, and a test of it.

Sessions that choose parameters and sessions that test them are kept apart: the search is never
given the latter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbench.clock import utc_text
from testbench.estimation.estimator import PreparedSession
from testbench.estimation.filters import FILTERS, OrientationFilter
from testbench.estimation.filters.tuned import choose_tuned, with_parameters
from testbench.evaluation.compared_objective import ComparisonJudge
from testbench.evaluation.objective import UNIT, Objective, SessionJudge, knows_angles
from testbench.exceptions import InputError
from testbench.model.noise import random_stream
from testbench.pipeline.loaded_analysis import sound_filters
from testbench.pipeline.parameter_space import FAILED, Effort, Optimum, Point, Space, find_optimum
from testbench.pipeline.request import TuneRequest
from testbench.pipeline.watcher import Watcher, nothing
from testbench.records.results.calibration_file import SensorCalibration, load_calibrations
from testbench.records.results.tuning import (
    GridPoint,
    Parameters,
    Search,
    Split,
    Tuning,
    describe,
    refuse_file,
    refuse_repeated,
)
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import Session
from testbench.records.session.session_writer import software_versions

Say = Callable[[str], None]


@dataclass(frozen=True)
class Sessions:
    """Sessions that choose the parameters, those that test them, and how they were told apart."""

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
        compare: What takes the place of the truth; the truth if None.
    """

    def __init__(
        self,
        session: Session,
        objective: Objective,
        kind: OrientationFilter,
        names: Sequence[str],
        calibrations: list[SensorCalibration] | None = None,
        compare: OrientationFilter | None = None,
    ):
        self._prepared = PreparedSession(session, calibrations, objective.joints(session))
        self._judge: SessionJudge | ComparisonJudge
        if compare is None:
            told = knows_angles(session, objective.joints(session) or [])
            first = self._prepared.run([kind] if told else [])
            self._judge = SessionJudge(session, objective, first)
        else:
            beside = self._prepared.run([compare])
            self._judge = ComparisonJudge(session, objective, beside, compare.name)
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
    return with_parameters(kind, {**kind.parameters, **dict(zip(names, point, strict=True))})


def tune(asked: TuneRequest, watcher: Watcher | None = None) -> Tuning:
    """Tune a filter by the sessions that a request names, and keep the result.

    Args:
        asked: Which filter, on which sessions, for what, and where the result is kept.
        watcher: Who looks on; told what is being done.

    Raises:
        NotFoundError: An unknown filter, parameter, objective, sensor or joint.
        InputError: The place is taken, a recording stands in the lists twice, or the filter cannot
            run on one; nothing is written then.
        SessionError: A session has no truth to judge by.
    """
    watcher, out = watcher or Watcher(), Path(asked.out)
    refuse_file(out)
    if "," in asked.filter:
        raise InputError("one filter is tuned at a time")
    kinds = choose_tuned(sound_filters([asked.filter]), [], {}, (), asked.parameters)
    search = SearchWanted(
        asked.objective,
        None if asked.tuned is None else list(asked.tuned),
        Effort(asked.values, asked.points, asked.refinement),
        asked.leave_one_out,
        _compared(asked, kinds[0]),
    )
    stored = None if asked.calibrations is None else load_calibrations(Path(asked.calibrations))
    now = utc_text(watcher.clock.utc())
    found = find_parameters(kinds[0], _divided(asked), search, now, stored, watcher.say)
    if found.filter not in FILTERS:
        found = found.model_copy(update={"filter_source": asked.filter})
    found.save(out)
    return found


def _compared(asked: TuneRequest, kind: OrientationFilter) -> OrientationFilter | None:
    """What takes the place of the truth; None where the truth judges.

    Raises:
        NotFoundError: No such filter.
        InputError: It is the filter that is tuned.
    """
    if asked.compare is None:
        return None
    compare = choose_tuned(sound_filters([asked.compare]), [], {}, ())[0]
    if compare.name == kind.name:
        raise InputError(f"{kind.name} cannot be tuned to come near itself")
    return compare


def _divided(asked: TuneRequest) -> Sessions:
    """The sessions of a request, opened and told apart."""
    sessions = [open_for_analysis(path, asked.verify) for path in asked.sessions]
    if asked.test_share is None:
        test = [open_for_analysis(path, asked.verify) for path in asked.test]
        return Sessions.given(sessions, test)
    if asked.test:
        raise InputError("--test names the sessions to test on, --test-share draws them: not both")
    return Sessions.drawn(sessions, asked.test_share, asked.seed)


@dataclass(frozen=True)
class SearchWanted:
    """Which parameters are looked for, and how hard.

    Attributes:
        objective: What is made small, as `Objective.parse` reads it.
        names: Parameters to tune; all if None.
        effort: How hard to look.
        leave_one_out: Also test each tuning session by the set that the others choose.
        compare: What takes the place of the truth; the truth if None.
    """

    objective: str | None
    names: Sequence[str] | None = None
    effort: Effort = field(default_factory=Effort)
    leave_one_out: bool = False
    compare: OrientationFilter | None = None


# One piece: each stage of the search needs the trials and the optimum of the one before.
def find_parameters(
    kind: OrientationFilter,
    sessions: Sessions,
    wanted: SearchWanted,
    tuned_utc: str,
    calibrations: list[SensorCalibration] | None = None,
    say: Say | None = None,
) -> Tuning:
    """Look for the parameters of a filter.

    Args:
        kind: The filter; the search begins with its parameters, and those not tuned keep their
            values.
        sessions: What to tune and to test on.
        wanted: What to look for, and how hard.
        tuned_utc: Now, ISO 8601.
        calibrations: To correct the raw samples with first.
        say: Called with what is being done.

    Raises:
        NotFoundError: An unknown parameter, objective, sensor or joint.
        InputError: A recording stands in the lists twice, or the filter cannot run on one.
        SessionError: A session has no truth to judge by.
    """
    tell, effort = say or nothing, wanted.effort
    compare = wanted.compare
    objective = Objective.parse(wanted.objective, compare is not None)
    space = Space.of(kind.PARAMETERS, wanted.names)
    described = [describe(s, "tuning") for s in sessions.tuning] + [
        describe(s, "test") for s in sessions.test
    ]
    if not sessions.tuning:
        raise InputError("no session is left to tune on")
    if wanted.leave_one_out and len(sessions.tuning) < 2:
        raise InputError("leaving one session out needs two sessions to tune on")
    refuse_repeated(described)
    start: Point = tuple(kind.parameters[name] for name in space.names)
    trials = []
    for session in sessions.tuning:
        tell(f"preparing {session.name}")
        trials.append(SessionTrials(session, objective, kind, space.names, calibrations, compare))

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
        if wanted.leave_one_out:
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
        test = SessionTrials(session, objective, kind, space.names, calibrations, compare)
        update = {"default_value": _finite(test(start)), "value": _finite(test(shared.point))}
        entries.append(entry.model_copy(update=update))
    combined, grid = effort.grid(space)
    return Tuning(
        schema_version=1,
        tuned_utc=tuned_utc,
        software=software_versions(),
        filter=kind.name,
        objective=str(objective),
        unit=UNIT,
        comparison=None if compare is None else compare.name,
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
        split=sessions.split.model_copy(update={"leave_one_out": wanted.leave_one_out}),
        sessions=entries,
    )


def _named(space: Space, point: Point) -> Parameters:
    return dict(zip(space.names, point, strict=True))


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) and value < FAILED else None
