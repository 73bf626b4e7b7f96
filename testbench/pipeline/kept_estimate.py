"""The estimate that a session keeps: made anew, or taken where it is what is asked for."""

from __future__ import annotations

from testbench.estimation.filters import FILTERS
from testbench.exceptions import InputError, SessionError
from testbench.pipeline.loaded_analysis import LoadedAnalysis, load_analysis
from testbench.pipeline.request import AnalysisRequest
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked


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
def load_or_estimate(
    session: Session, asked: AnalysisRequest | LoadedAnalysis | None = None
) -> Estimate:
    """The estimate on disk if it fits the recording and the request; else a new one, which is kept.

    Args:
        session: The recording.
        asked: How; any estimate will do if nothing is asked.
    """
    loaded = (
        asked if isinstance(asked, LoadedAnalysis) else load_analysis(asked or AnalysisRequest())
    )
    stored = stored_estimate(session)
    if stored is not None and is_as_asked(stored, session, loaded):
        loaded.refuse_nothing(session, stored)
        return stored
    estimated = loaded.estimate(session)
    estimated.save(session.path)
    return estimated


def estimate_of(session: Session, loaded: LoadedAnalysis) -> Estimate | None:
    """The estimate that a session keeps if it is as asked for, else a new one; nothing is written.

    Args:
        session: The recording.
        loaded: How.

    Returns:
        None where nothing can be estimated of it.
    """
    try:
        return kept_or_new(session, loaded)
    except InputError:
        return None


def kept_or_new(session: Session, loaded: LoadedAnalysis) -> Estimate:
    """See `estimate_of`.

    Raises:
        InputError: Nothing can be estimated of it.
    """
    stored = stored_estimate(session)
    if stored is not None and is_as_asked(stored, session, loaded):
        return stored
    return loaded.estimate(session)


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
    compare = loaded.settings(session).compare
    if compare is not None and not any(
        compare in sensor.orientation for sensor in stored.sensors.values()
    ):
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
