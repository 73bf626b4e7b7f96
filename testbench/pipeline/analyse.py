"""Everything that follows a recording: estimate, evaluate, report; may be repeated at will."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.estimation.injected import with_injected
from testbench.evaluation import evaluate
from testbench.evaluation.plateaus import plateau_rows
from testbench.formats.exporters import Exported
from testbench.pipeline.exports import export_estimate
from testbench.pipeline.kept_estimate import kept_or_new, load_or_estimate
from testbench.pipeline.loaded_analysis import LoadedAnalysis, load_analysis
from testbench.pipeline.repeats import judged_with_repeats
from testbench.pipeline.request import AnalysisRequest
from testbench.pipeline.summaries import write_summaries
from testbench.records.disk.free_memory import give_back
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import PlateauRow
from testbench.records.session.layout import PRINTED, REPORT
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked
from testbench.records.specs.band import load_band
from testbench.records.specs.injected_error import InjectedError


@dataclass(frozen=True)
class Result:
    """What a run came to.

    Attributes:
        session: The recording.
        estimate: Of it.
        evaluation: Of that.
        report: The page; None where none was asked for.
        printed: The same on paper; None where that was not asked for.
        exports: Files for other programs that were asked for.
    """

    session: Session
    estimate: Estimate
    evaluation: Evaluation
    report: Path | None
    exports: list[Exported] = field(default_factory=list)
    printed: Path | None = None

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "session": str(self.session.path),
            "outcome": self.evaluation.outcome,
            "simulated": self.session.simulated,
            "report": str(self.report) if self.report else None,
            **({"printed": str(self.printed)} if self.printed else {}),
        }


@session_locked
def analyse(
    session: Session,
    asked: AnalysisRequest | LoadedAnalysis | None = None,
    whatever: bool = False,
) -> Result:
    """Estimate, evaluate, report and export.

    Args:
        session: The recording.
        asked: How; as the protocol says if None.
        whatever: Also where no filter can run; see `LoadedAnalysis.estimate`.

    Raises:
        InputError: Filters were named of a recording, or one to compare with, and none can run; an
            earlier estimate stays.
    """
    loaded = (
        asked if isinstance(asked, LoadedAnalysis) else load_analysis(asked or AnalysisRequest())
    )
    give_back()
    estimated = loaded.estimate(session, whatever)
    estimated.save(session.path)
    give_back()
    evaluated = evaluate(session, estimated, loaded.settings(session))
    evaluated = judged_with_repeats(session, estimated, evaluated, loaded)
    evaluated.save(session.path)
    give_back()
    page = _report(session, estimated, evaluated, loaded.asked) if loaded.asked.report else None
    exports = [export_estimate(session, wanted, estimated) for wanted in loaded.asked.exports]
    write_summaries((session, evaluated), loaded.asked.markdown, loaded.asked.junit)
    printed = _printed(page) if page is not None and loaded.asked.printed else None
    return Result(session, estimated, evaluated, page, exports, printed)


def examine(
    session: Session,
    asked: AnalysisRequest | None = None,
    injected: Sequence[InjectedError] = (),
) -> Result:
    """Estimate and evaluate, and leave the session as it is.

    Args:
        session: The recording.
        asked: How; as the protocol says if None.
        injected: Errors that are put into the estimated orientations first.

    Raises:
        InputError: As for `analyse`, or an error cannot be put in.
    """
    loaded = load_analysis(asked or AnalysisRequest())
    estimated = _with_errors(session, loaded, injected)
    evaluated = evaluate(session, estimated, loaded.settings(session))
    write_summaries((session, evaluated), loaded.asked.markdown, loaded.asked.junit)
    return Result(session, estimated, evaluated, None)


def judge_plateaus(
    session: Session,
    asked: AnalysisRequest,
    injected: Sequence[InjectedError],
    typed: Mapping[str, Sequence[float]],
) -> list[PlateauRow]:
    """A recording's joints beside angles that a person typed in, plateau by plateau.

    Args:
        session: The recording.
        asked: How it is analysed.
        injected: Errors that are put into the estimated orientations first.
        typed: Angles by joint [deg]; nothing is estimated where there are none.

    Raises:
        NotFoundError: No such joint.
        InputError: There are not as many plateaus as angles.
    """
    if not typed:
        return []
    return plateau_rows(session, _with_errors(session, load_analysis(asked), injected), typed)


def _with_errors(
    session: Session, loaded: LoadedAnalysis, injected: Sequence[InjectedError]
) -> Estimate:
    """The estimate that a session keeps, or a new one, with errors put into it."""
    estimated = kept_or_new(session, loaded)
    if not injected:
        return estimated
    return with_injected(session, estimated, injected, loaded.choose(loaded.settings(session)))


@session_locked
def judge_again(session: Session, asked: AnalysisRequest | None = None) -> Evaluation:
    """Evaluate what is estimated.

    A report that exists already is written anew, so that it never contradicts the session.

    Args:
        session: The recording.
        asked: As for `load_or_estimate`.
    """
    reported = (session.path / REPORT).is_file()  # a new estimate takes it away
    loaded = load_analysis(asked or AnalysisRequest())
    estimated = load_or_estimate(session, loaded)
    evaluated = evaluate(session, estimated, loaded.settings(session))
    evaluated = judged_with_repeats(session, estimated, evaluated, loaded)
    evaluated.save(session.path)
    if reported:
        _report(session, estimated, evaluated, loaded.asked)
    write_summaries((session, evaluated), loaded.asked.markdown, loaded.asked.junit)
    return evaluated


def _report(
    session: Session, estimated: Estimate, evaluated: Evaluation, asked: AnalysisRequest
) -> Path:
    from testbench.reporting.report import report

    band = None if asked.band is None else load_band(asked.band)
    return report(session, estimated, evaluated, band)


def _printed(page: Path) -> Path:
    from testbench.reporting.page.printing import print_page

    return print_page(page, page.with_name(PRINTED))
