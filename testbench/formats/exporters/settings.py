"""With which parameters the filters of an export ran, for headers and notes of files."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.formats.exporters.source import ExportSource
from testbench.frames import NANOSECONDS


def settings_of(source: ExportSource, names: Iterable[str]) -> dict[str, str]:
    """Parameters by filter, as text: `beta: 0.12 (set), zeta: 0.001 (tuned)`.

    Args:
        source: What is exported.
        names: Of filters; those without parameters, and the truth, are left out.
    """
    return {name: text for name in names if (text := _text(source, name))}


def settings_lines(source: ExportSource) -> list[str]:
    """The line of a header that names the parameters of the one filter; none where it has none."""
    return [f"parameters={text}" for text in settings_of(source, [source.filter]).values()]


def settings_notes(source: ExportSource, names: Iterable[str]) -> list[str]:
    """Sentences on what decides the numbers and does not stand in the protocol: parameters that
    were set or tuned, and stored calibrations.

    Args:
        source: What is exported.
        names: Of the filters in it.
    """
    estimate, notes = source.estimate, []
    for name in names:
        for kind, changed in (("set", _set(source, name)), ("tuned", _tuned(source, name))):
            own = estimate.filter_parameters.get(name, {})
            values = ", ".join(f"{key} = {own[key]:g}" for key in changed if key in own)
            if values:
                notes.append(f"filter '{name}' ran with parameters that were {kind}: {values}")
    corrected = [name for name in source.sensor_names if estimate.sensors[name].stored_calibration]
    if corrected:
        notes.append(
            "the estimate was made from raw samples that a stored calibration had corrected: "
            + ", ".join(corrected)
        )
    return notes


def doubtful_notes(source: ExportSource) -> list[str]:
    """A sentence for each sensor some of whose samples were refused: what filters say there is in
    the file, and no evaluation counts it.
    """
    notes = []
    for name in source.sensor_names:
        own = source.estimate.sensors[name]
        flagged = int(own.flagged.sum())
        if flagged:
            why = [reason for reason, count in own.quality.items() if count]
            first = float(own.host_time_ns[int(np.argmax(own.flagged))]) / NANOSECONDS
            reasons = ", ".join(why) or "see the report"
            notes.append(
                f"{name}: {flagged} of {len(own.flagged)} orientations, the first at "
                f"{first:.2f} s, are of samples that were refused ({reasons}); they may be far "
                "off, and no evaluation counts them"
            )
    return notes


def _text(source: ExportSource, name: str) -> str:
    was = dict.fromkeys(_tuned(source, name), " (tuned)")
    was |= dict.fromkeys(_set(source, name), " (set)")
    own = source.estimate.filter_parameters.get(name, {})
    return ", ".join(f"{key}: {value:.9g}{was.get(key, '')}" for key, value in own.items())


def _set(source: ExportSource, name: str) -> list[str]:
    return source.estimate.set_parameters.get(name, [])


def _tuned(source: ExportSource, name: str) -> list[str]:
    """Names of tuned parameters, but for those that were set afterwards."""
    used = source.estimate.tuned.get(name)
    return [] if used is None else [key for key in used.tuned if key not in _set(source, name)]
