"""Everything that follows a recording: estimate, evaluate, report; may be repeated at will."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, OrientationFilter, choose_filters
from testbench.estimation.filters.plugins import find_filter
from testbench.estimation.filters.tuned import choose_tuned
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, SessionError
from testbench.formats.exporters import Exported
from testbench.pipeline.exports import export_estimate, refuse_export
from testbench.pipeline.request import AnalysisRequest
from testbench.records.results.calibration_file import SensorCalibration, load_calibrations
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.tuning import Tuning, load_tunings
from testbench.records.session.layout import REPORT
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked
from testbench.records.specs.protocol import Estimation


@dataclass(frozen=True)
class Result:
    """What a run came to.

    Attributes:
        plan: That was run; None where a recording was analysed.
        session: The recording.
        estimate: Of it.
        evaluation: Of that.
        report: The page; None where none was asked for.
        exports: Files for other programs that were asked for.
    """

    plan: Plan | None
    session: Session
    estimate: Estimate
    evaluation: Evaluation
    report: Path | None
    exports: list[Exported] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "session": str(self.session.path),
            "outcome": self.evaluation.outcome,
            "simulated": self.session.simulated,
            "report": str(self.report) if self.report else None,
        }


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

    def refuse(self, settings: Estimation) -> None:
        """Refuse an analysis that a recording cannot have, before it is recorded.

        Args:
            settings: Of its protocol.

        Raises:
            NotFoundError: No such filter, parameter or format, or an export of a filter that does
                not run.
            InputError: As for `choose` and `refuse_export`.
        """
        names = [kind.name for kind in self.choose(settings)]
        for wanted in self.asked.exports:
            refuse_export(wanted, names)

    def estimate(self, session: Session) -> Estimate:
        """A new estimate of a recording; it is not kept."""
        return estimate(
            session, self.filters, self.calibrations, self.tunings, self.asked.parameters
        )


def load_analysis(asked: AnalysisRequest) -> LoadedAnalysis:
    """Read what a request for an analysis names, and refuse what cannot be used.

    This is done before anything moves.

    Raises:
        NotFoundError: An unknown filter.
        InputError: A filter of the user's own fails the self-test, a calibration or a tuning is
            missing or malformed.
    """
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


@session_locked
def analyse(
    session: Session,
    asked: AnalysisRequest | LoadedAnalysis | None = None,
    plan: Plan | None = None,
) -> Result:
    """Estimate, evaluate, report and export.

    Args:
        session: The recording.
        asked: How; as the protocol says if None.
        plan: That was run, for the result.
    """
    loaded = (
        asked if isinstance(asked, LoadedAnalysis) else load_analysis(asked or AnalysisRequest())
    )
    estimated = loaded.estimate(session)
    estimated.save(session.path)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    page = _report(session, estimated, evaluated) if loaded.asked.report else None
    exports = [export_estimate(session, wanted, estimated) for wanted in loaded.asked.exports]
    return Result(plan, session, estimated, evaluated, page, exports)


@session_locked
def make_estimate(session: Session, asked: AnalysisRequest | None = None) -> Estimate:
    """Estimate anew, and keep it.

    Args:
        session: The recording.
        asked: How; as the protocol says if None.
    """
    estimated = load_analysis(asked or AnalysisRequest()).estimate(session)
    estimated.save(session.path)
    return estimated


@session_locked
def load_or_estimate(session: Session, asked: AnalysisRequest | None = None) -> Estimate:
    """The estimate on disk if it fits the recording and the request; else a new one, which is kept.

    Args:
        session: The recording.
        asked: How; any estimate will do if nothing is asked.
    """
    loaded = load_analysis(asked or AnalysisRequest())
    stored = stored_estimate(session)
    if stored is not None and is_as_asked(stored, session, loaded):
        return stored
    estimated = loaded.estimate(session)
    estimated.save(session.path)
    return estimated


def stored_estimate(session: Session) -> Estimate | None:
    """The estimate on disk if it can be read and was made from this very recording."""
    if not Estimate.lies_in(session.path):
        return None
    try:
        stored = Estimate.load(session.path)
    except SessionError:
        return None
    return stored if stored.fingerprint == session.fingerprint else None


def is_as_asked(stored: Estimate, session: Session, loaded: LoadedAnalysis) -> bool:
    """Whether an estimate is what a request for an analysis would come to.

    One with calibrations or tuned parameters is never taken: their files may have changed since.
    Nor is one with a filter that is given as it is.
    """
    asked = loaded.asked
    if asked.calibrations is not None or asked.tunings:
        return False
    if asked.filters is None and not asked.parameters:
        return True
    if stored.tuned or any(sensor.stored_calibration for sensor in stored.sensors.values()):
        return False
    chosen = loaded.choose(session.analysis.estimate)
    if any(FILTERS.get(kind.name) is not type(kind) for kind in chosen):
        return False
    parameters = {kind.name: kind.parameters for kind in chosen}
    return stored.filter_parameters == parameters and all(
        set(sensor.orientation) | set(sensor.skipped) == set(parameters)
        for sensor in stored.sensors.values()
    )


@session_locked
def judge_again(session: Session, asked: AnalysisRequest | None = None) -> Evaluation:
    """Evaluate what is estimated.

    A report that exists already is written anew, so that it never contradicts the session.

    Args:
        session: The recording.
        asked: As for `load_or_estimate`.
    """
    estimated = load_or_estimate(session, asked)
    evaluated = evaluate(session, estimated)
    evaluated.save(session.path)
    if (session.path / REPORT).is_file():
        _report(session, estimated, evaluated)
    return evaluated


def _report(session: Session, estimated: Estimate, evaluated: Evaluation) -> Path:
    from testbench.reporting.report import report

    return report(session, estimated, evaluated)
