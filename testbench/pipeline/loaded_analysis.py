"""A request for an analysis with all that it names: read, and found sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, OrientationFilter, choose_filters
from testbench.estimation.filters.plugins import find_filter
from testbench.estimation.filters.tuned import choose_tuned
from testbench.exceptions import InputError
from testbench.pipeline.request import AnalysisRequest
from testbench.pipeline.summaries import refuse_no_folder
from testbench.records.results.calibration_file import SensorCalibration, load_calibrations
from testbench.records.results.estimate import Estimate
from testbench.records.results.tuning import Tuning, load_tunings
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Estimation


@dataclass(frozen=True)
class LoadedAnalysis:
    """A request for an analysis with all that it names: read, and found sound.

    Attributes:
        asked: The request.
        filters: Names of those that ship, and others as they are; those of the protocol if None.
        calibrations: To correct the raw samples with; None if none was named.
        tunings: Tuned parameters.
    """

    asked: AnalysisRequest
    filters: list[str | OrientationFilter] | None
    calibrations: list[SensorCalibration] | None
    tunings: list[Tuning]

    def choose(self, settings: Estimation) -> list[OrientationFilter]:
        """The filters that would run on a recording, with their parameters.

        Args:
            settings: Of its protocol.

        Raises:
            NotFoundError: No such filter or parameter.
            InputError: As for `choose_tuned`.
        """
        return choose_tuned(
            self.filters,
            settings.filters,
            settings.filter_parameters,
            self.tunings,
            self.asked.parameters,
        )

    def settings(self, session: Session) -> Estimation:
        """How a recording's results are described: as its own settings say but for what is asked.

        Args:
            session: The recording.
        """
        own = session.analysis.estimate
        asked = {
            "compare": self.asked.compare,
            "euler_sequence": self.asked.euler_sequence,
            "returned": self.asked.returned or None,
        }
        return own.model_copy(
            update={name: value for name, value in asked.items() if value is not None}
        )

    def estimate(self, session: Session, whatever: bool = False) -> Estimate:
        """A new estimate of a recording; it is not kept.

        Args:
            session: The recording.
            whatever: Also one without any orientation: of a run, whose filters were chosen before
                there was a recording.

        Raises:
            InputError: Filters were named, or one to compare with, and no sensor has what they
                need.
        """
        settings = self.settings(session)
        filters, compare = self.filters, settings.compare
        if compare is not None:
            chosen = self.choose(settings)
            filters = [_as_named(kind) for kind in chosen]
            if compare not in {kind.name for kind in chosen}:
                filters += sound_filters([compare])
        made = estimate(session, filters, self.calibrations, self.tunings, self.asked.parameters)
        if not whatever:
            self.refuse_nothing(session, made)
        return made

    def refuse_nothing(self, session: Session, made: Estimate) -> None:
        """Refuse an estimate in which none of the filters ran that were asked for by name.

        Args:
            session: The recording.
            made: Its estimate.

        Raises:
            InputError: Each filter and what it lacks.
        """
        compare = self.settings(session).compare
        named = None if self.filters is None else [_name(kind) for kind in self.filters]
        for filters in (named, None if compare is None else [compare]):
            if filters is not None and not _any_ran(made, filters):
                raise InputError(
                    f"{session.path}: {' and '.join(filters)} cannot run, so that nothing was "
                    f"written: {_lacking(made, filters)}"
                )


def _any_ran(made: Estimate, filters: Sequence[str]) -> bool:
    return any(set(filters) & set(sensor.orientation) for sensor in made.sensors.values())


def _lacking(made: Estimate, filters: Sequence[str]) -> str:
    """Why filters did not run, and of which sensors."""
    reasons: dict[str, list[str]] = {}
    for name, sensor in made.sensors.items():
        for key in filters:
            why = f"{key}: {sensor.skipped.get(key, 'it was not run')}"
            reasons.setdefault(why, []).append(name)
    return "; ".join(f"{why} ({', '.join(names)})" for why, names in reasons.items())


def _name(kind: str | OrientationFilter) -> str:
    return kind if isinstance(kind, str) else kind.name


def _as_named(kind: OrientationFilter) -> str | OrientationFilter:
    """One that ships with the bench by its name, so that protocol and tuning set it."""
    return kind.name if FILTERS.get(kind.name) is type(kind) else kind


def load_analysis(asked: AnalysisRequest) -> LoadedAnalysis:
    """Read what a request for an analysis names, and refuse what cannot be used.

    This is done before anything moves.

    Raises:
        NotFoundError: An unknown filter.
        InputError: A filter of the user's own fails the self-test, a calibration or a tuning is
            missing or malformed.
    """
    refuse_no_folder(asked.markdown, asked.junit)
    filters = None if asked.filters is None else sound_filters(asked.filters)
    calibrations = (
        None if asked.calibrations is None else load_calibrations(Path(asked.calibrations))
    )
    return LoadedAnalysis(asked, filters, calibrations, load_tunings(map(Path, asked.tunings)))


def sound_filters(names: Sequence[str]) -> list[str | OrientationFilter]:
    """Filters by name or `path/to/file.py:ClassName`; those that ship with the bench stay names.

    Raises:
        NotFoundError: No such filter.
        InputError: Two of one name, or one of the user's own that fails the self-test.
    """
    if not names:
        raise InputError("--filters names no filter")
    chosen = [name if name in FILTERS else sound(find_filter(name)) for name in names]
    choose_filters(chosen)
    return chosen


def sound(kind: OrientationFilter) -> OrientationFilter:
    """A user's own filter, once it has passed the self-test.

    One with a wrong unit or sign is not ranked beside the others.

    Raises:
        InputError: It fails; says in what.
    """
    from testbench.estimation.filters.self_test import self_test

    result = self_test(kind)
    if not result.passed:
        raise InputError(f"the filter {kind.name} fails the self-test: {result.reason}")
    return kind
