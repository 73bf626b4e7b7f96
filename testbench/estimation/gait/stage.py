"""The stage `gait`: strides, events and the path of each sensor of a walk; offline and pure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.stored_calibration import StoredCalibrations
from testbench.estimation.filters import choose_filters
from testbench.estimation.gait.foot import FootWalk, walk_on_foot
from testbench.estimation.gait.notices import notices_on_foot, notices_on_regression
from testbench.estimation.gait.parameters import PUBLISHED
from testbench.estimation.gait.placement import place_by_motion, place_by_name, side_by_name
from testbench.estimation.gait.readings import Readings, fits_in_memory, readings_of
from testbench.estimation.gait.settings import DEFAULT_FILTER, DEFAULT_PARAMETERS, GaitSettings
from testbench.estimation.gait.steps import with_steps
from testbench.estimation.gait.strides import (
    LEAST_STRIDES,
    foot_strides,
    most_in_a_row,
    symmetry,
    walk_strides,
    with_means,
)
from testbench.estimation.gait.walk import Walk, walk
from testbench.estimation.gait.wearing import FOUND, levelled, mounting_matrix
from testbench.estimation.signals.recording import SensorRecording
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.gait import Gait, SensorGait
from testbench.records.session.session import Session

KEPT_HZ = 100.0
"""Signals are kept at about this rate."""
LEAST_SAMPLES = 100
Signals = dict[str, np.ndarray]


def gait(
    session: Session,
    settings: GaitSettings | None = None,
    calibrations: list[SensorCalibration] | None = None,
) -> Gait:
    """Find the strides of everybody who walked in a recording.

    Args:
        session: The recording.
        settings: What is known beside the samples; everything is found if None.
        calibrations: Stored ones to correct the raw samples with; each sensor takes its own that is
            nearest in time.

    Raises:
        NotFoundError: The settings name what does not exist.
        InputError: A mounting that was named cannot be, a filter takes what a sensor does not give,
            or calibrations were given and not one is
            of a sensor of this session.
        SessionError: The session's samples are damaged, or being recorded.
    """
    settings = settings or GaitSettings()
    settings.check(session.sensor_names)
    given = StoredCalibrations.among(calibrations or [], session)
    given.check()
    sensors: dict[str, SensorGait] = {}
    walks: dict[str, Signals] = {}
    for name in session.sensor_names:
        recording = SensorRecording.of(session, name)
        own, signals = _of_sensor(recording, settings, given.of(name))
        told = [*given.findings(name), *own.findings, *_idle(own, settings)]
        sensors[name] = replace(own, findings=told)
        if signals:
            walks[name] = signals
    sensors, findings = with_steps(sensors, session.manifest.findings)
    return Gait(
        session=session.name,
        fingerprint=session.fingerprint,
        sensors=sensors,
        symmetry=symmetry(list(sensors.values())),
        findings=findings,
        walks=walks,
    )


def _idle(own: SensorGait, settings: GaitSettings) -> list[Finding]:
    """What was said of a sensor that its way was not reckoned by."""
    if own.method != "strapdown":
        return []
    said = [("--mounting", settings.mounting.get(own.sensor, FOUND) != FOUND)]
    said.append(("--filter", settings.filter != DEFAULT_FILTER))
    said.append(("--set", bool(settings.filter_parameters)))
    return [
        finding("gait.idle", own.sensor, option=option, place=own.on) for option, on in said if on
    ]


def _of_sensor(
    recording: SensorRecording, settings: GaitSettings, stored: SensorCalibration | None
) -> tuple[SensorGait, Signals]:
    """The gait by one sensor, and its signals; none where there is no walk to be had."""
    name = recording.name
    own = SensorGait(sensor=name, side=side_by_name(name))
    if not fits_in_memory(recording):
        count = recording.raw.count
        return replace(own, findings=[finding("gait.too_long", name, samples=count)]), {}
    if recording.raw.count < LEAST_SAMPLES:
        return replace(own, findings=[finding("gait.no_walk", name)]), {}
    readings = readings_of(recording, stored)
    if not np.isfinite(readings.acc).any() or not readings.uniform.gyr.any():
        return replace(own, findings=[finding("gait.no_triads", name)]), {}
    told = settings.on.get(name, "")
    walked = (
        walk_on_foot(readings, settings.level)
        if told in ("", "foot") and not settings.parameters
        else None
    )
    if readings.holes:
        begin_s, end_s = float(readings.time[0]), float(readings.time[-1])
        told_of = finding("gait.cut", name, holes=readings.holes, begin_s=begin_s, end_s=end_s)
        own = replace(own, findings=[told_of])
    place, by = _place(name, told, readings, walked)
    own = replace(own, on=place, known_by=by)
    if by not in ("told", ""):
        found = finding("gait.place", name, place=place, how=f"its {by}")
        own = replace(own, findings=[*own.findings, found])
    if not place:
        unknown = finding("gait.place_unknown", name)
        return replace(own, findings=[*own.findings, unknown]), {}
    if place == "foot" and not settings.parameters:
        walk_found, signals = _on_foot(own, readings, walked)
    else:
        walk_found, signals = _by_regression(own, readings, settings)
    count = most_in_a_row(walk_found.strides)
    if walk_found.method and 0 < count < LEAST_STRIDES:
        few = finding("gait.few_strides", name, count=count, least=LEAST_STRIDES)
        return replace(own, findings=[*own.findings, few]), {}
    return walk_found, signals


def _place(name: str, told: str, readings: Readings, walked: FootWalk | None) -> tuple[str, str]:
    """Where a sensor sits, and how that is known: "told", "name", "motion" or ""."""
    if told:
        return told, "told"
    place = place_by_name(name)
    if place:
        return place, "name"
    place = place_by_motion(readings, walked)
    return (place, "motion") if place else ("", "")


def _on_foot(
    own: SensorGait, readings: Readings, walked: FootWalk | None
) -> tuple[SensorGait, Signals]:
    if walked is None or not walked.moves:
        return replace(own, findings=[*own.findings, finding("gait.no_walk", own.sensor)]), {}
    strides = foot_strides(readings, walked)
    end = walked.track.position[walked.last - walked.first] - walked.track.position[0]
    factor = walked.track.innovation if np.isfinite(walked.track.innovation) else 1.0
    variance = max(factor, 0.1) * float(np.trace(walked.track.position_covariance[-1]))
    own = replace(
        own,
        method="strapdown",
        floor="level" if walked.level else "any",
        strides=strides,
        closure_mm=1e3 * float(np.linalg.norm(end)),
        closure_horizontal_mm=1e3 * float(np.hypot(end[0], end[1])),
        closure_sd_mm=1e3 * float(np.sqrt(variance)),
        innovation=walked.track.innovation,
    )
    own = replace(own, findings=[*own.findings, *notices_on_foot(own, readings, walked)])
    return with_means(own), _foot_signals(readings, walked)


def _foot_signals(readings: Readings, walked: FootWalk) -> Signals:
    """What is kept of the way, from its begin to its end, thinned out."""
    every = max(round(1 / (KEPT_HZ * readings.interval)), 1)
    rows = np.arange(walked.first, walked.last + 1, every)
    position = walked.track.position[rows - walked.first]
    return {
        "time_s": readings.time[rows],
        "x_m": position[:, 0],
        "y_m": position[:, 1],
        "z_m": position[:, 2],
        "toe_down_deg_s": np.degrees(walked.toe_down[rows]),
        "force_m_s2": rotation.lengths(readings.acc[rows]),
    }


def _by_regression(
    own: SensorGait, readings: Readings, settings: GaitSettings
) -> tuple[SensorGait, Signals]:
    """Readings into the level frame, then the filter, then cycles and lengths (Cabezuelo 2019)."""
    parameters = settings.parameters or DEFAULT_PARAMETERS[own.on]
    mounting = settings.mounting.get(own.sensor, FOUND)
    R, name = mounting_matrix(mounting, readings.rate, readings.acc, own.sensor)
    unbiased = replace(readings.uniform, gyr=readings.rate)
    level = levelled(unbiased, R)
    kind = choose_filters([settings.filter], settings.filter_parameters)[0]
    missing = kind.missing(level)
    if missing:
        raise InputError(
            f"--filter {kind.name} takes {' and '.join(missing)}, which {own.sensor} does not give"
        )
    q = kind.run(level)
    times = np.round(readings.time * NANOSECONDS).astype(np.int64)
    found = walk(times, q, PUBLISHED[parameters])
    strides = walk_strides(readings.time, found)
    if not strides:
        return replace(own, findings=[*own.findings, finding("gait.no_walk", own.sensor)]), {}
    own = replace(
        own,
        method="regression",
        parameters=parameters,
        mounting=name or "found",
        filter=kind.name,
        strides=strides,
    )
    closure = 1e3 * float(np.hypot(*found.end))
    own = replace(own, closure_mm=closure, closure_horizontal_mm=closure)
    own = replace(own, findings=[*own.findings, *notices_on_regression(own, readings, mounting)])
    return with_means(own), _regression_signals(readings, found, q)


def _regression_signals(readings: Readings, found: Walk, q: np.ndarray) -> Signals:
    """The way from cycle to cycle, and the angle they were found in, thinned out."""
    every = max(round(1 / (KEPT_HZ * readings.interval)), 1)
    rows = np.arange(0, len(readings.time), every)
    done = np.searchsorted(found.cycles.end, rows, side="right")
    place = found.positions[done]
    return {
        "time_s": readings.time[rows],
        "x_m": place[:, 0],
        "y_m": place[:, 1],
        "z_m": np.full(len(rows), np.nan),
        "pitch_deg": np.degrees(rotation.to_euler("ZYX", q[rows])[:, 1]),
        "force_m_s2": rotation.lengths(readings.acc[rows]),
    }
