"""Stretches of a recording that are marked: what is evaluated, and samples that are not sound."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.gait import Gait
from testbench.records.session.layout import joint_table, orientation_table
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.reporting.viewer.signals import name_states, send_states

SOUND = "sound"
UNSOUND = {
    "gap": "#d64f5c",
    "at full scale": "#dd7a1f",
    "flagged": "#9a8712",
    "excluded": "#8a7461",
    "aligned apart": "#a866d6",
}
"""What is marked of a sensor, the first that holds, and its colour."""
CONTACT = {"stance": "#2f7ed8", "swing": "#2b333d"}
GAP_INTERVALS, GAP_S = 3.0, 0.05
"""Samples so many intervals apart, and at least so long, are a gap."""
MOST_MARKED = 8
"""Sensors with a lane of their own."""


def log_marks(
    recording: rr.RecordingStream,
    session: Session,
    samples: Mapping[str, ImuSamples],
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    gait: Gait | None,
) -> None:
    """A lane of what is evaluated, one for each sensor of which something is not sound, and one for
    each foot that walks.
    """
    judged = _judged(evaluation)
    if judged:
        name_states(recording, "state/evaluated", {"evaluated": "#1f9e77", "not": "#2b333d"})
        send_states(recording, "evaluated", judged)
    for name, states in unsound_sensors(session, samples, estimate).items():
        name_states(recording, f"state/{name}", {SOUND: "#2b333d"} | UNSOUND)
        send_states(recording, name, states)
    for name, states in contacts(gait).items():
        name_states(recording, f"state/{name}_contact", CONTACT)
        send_states(recording, f"{name}_contact", states)


def contacts(gait: Gait | None) -> dict[str, list[tuple[int, str]]]:
    """From when on each foot is on the ground, or swings, by sensor, where its events are known."""
    found: dict[str, list[tuple[int, str]]] = {}
    for name, own in gait.sensors.items() if gait is not None else ():
        events = [(stride.tc_s, "swing") for stride in own.strides]
        events += [(stride.ic_s, "stance") for stride in own.strides]
        known = sorted((at, word) for at, word in events if np.isfinite(at))
        if known and len(found) < MOST_MARKED:
            found[name] = [(round(at * NANOSECONDS), word) for at, word in known]
    return found


def has_judged(evaluation: Evaluation | None) -> bool:
    """Whether some of a recording is evaluated, and some is not."""
    return bool(_judged(evaluation))


def _judged(evaluation: Evaluation | None) -> list[tuple[int, str]]:
    """From when on what is evaluated, of the first joint or else the first sensor; nothing where
    that is everything.
    """
    if evaluation is None:
        return []
    tables = [joint_table(row.joint) for row in evaluation.joint_angle[:1]]
    tables += [orientation_table(row.sensor) for row in evaluation.orientation[:1]]
    series = next((evaluation.series[key] for key in tables if key in evaluation.series), {})
    judged = series.get("judged")
    if judged is None or judged.all() or not judged.any():
        return []
    return changes(series["host_time_ns"], np.where(judged, "evaluated", "not"))


def unsound_sensors(
    session: Session, samples: Mapping[str, ImuSamples], estimate: Estimate | None
) -> dict[str, list[tuple[int, str]]]:
    """From when on samples are sound, or what they are else, of sensors that are not throughout."""
    found: dict[str, list[tuple[int, str]]] = {}
    for name, own in samples.items():
        known = None if estimate is None else estimate.sensors.get(name)
        known = known if known is not None and len(known.host_time_ns) == len(own) else None
        time = own.host_time_ns if known is None else known.host_time_ns
        words = np.full(len(own), SOUND, dtype="<U16")
        if known is not None:
            words[known.is_apart] = "aligned apart"
            words[known.flagged] = "flagged"
        words[own.saturated] = "at full scale"
        for exclusion in session.analysis.estimate.exclude:
            if exclusion.concerns(name):
                begin, end = exclusion.from_s * NANOSECONDS, exclusion.to_s * NANOSECONDS
                words[(time >= begin) & (time <= end)] = "excluded"
        states = with_gaps(time, changes(time, words))
        if len(found) < MOST_MARKED and any(word != SOUND for _, word in states):
            found[name] = states
    return found


def changes(time_ns: np.ndarray, words: np.ndarray) -> list[tuple[int, str]]:
    """When a word changes, and to which.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        words: Shape (n,).
    """
    if not len(words):
        return []
    rows = np.flatnonzero(np.r_[True, words[1:] != words[:-1]])
    return [(int(time_ns[row]), str(words[row])) for row in rows]


def with_gaps(time_ns: np.ndarray, states: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """States of samples, and gaps between those.

    Args:
        time_ns: Of the samples, increasing, shape (n,) [ns].
        states: As `changes` gives them.
    """
    if len(time_ns) < 3:
        return states
    least = max(GAP_INTERVALS * median_interval(time_ns), GAP_S * NANOSECONDS)
    rows = np.flatnonzero(np.diff(time_ns) > least)
    times = np.array([at for at, _ in states])
    found = list(states)
    for row in rows:
        end = int(time_ns[row + 1])
        word = states[int(np.searchsorted(times, end, side="right")) - 1][1]
        found += [(int(time_ns[row]), "gap"), (end, word)]
    return sorted(dict(sorted(found)).items())
