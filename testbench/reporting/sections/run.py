"""The section of the report on what was run, and the pairs at the head of the page."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import numpy as np

from testbench.clock import utc_shown
from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.manifest import EnvironmentRecord, Manifest
from testbench.records.session.session import Session
from testbench.records.specs.strict import Placement
from testbench.reporting.page.page import Block, Section, Sentence
from testbench.reporting.page.tables import (
    NOTHING,
    Cell,
    Row,
    Table,
    header,
    label,
    number,
    text,
    vector,
)
from testbench.reporting.sections.findings import finding_sentences

DATES = {"run": "Started", "import": "Imported", "recording": "Recorded"}
"""What the date of a session is, by its kind; an import is dated when it was made, for its files
need not say.
"""
NO_ROBOT = {"import": "none: an imported recording", "recording": "none: devices recorded alone"}


def facts(session: Session) -> list[tuple[str, str]]:
    """What was run, as pairs for the head of the page."""
    manifest = session.manifest
    ran = session.has_protocol
    rows: list[tuple[str, Any]] = [
        ("Protocol" if ran else "Recording", manifest.protocol.name),
        ("Files", ", ".join(manifest.source)),
        ("Robot", _robot(session)),
        ("Recorded", _recorded(manifest) if manifest.kind == "import" else None),
        (DATES.get(str(manifest.kind), "Started"), _date(manifest.started_utc)),
        ("Duration", duration(manifest.duration_s)),
        ("Steps", f"{len(session.steps)} finished" if session.steps else None),
        ("Seed", manifest.seed),
        (
            "Bench" if ran else "Status",
            session.status.value + (f": {manifest.message}" if manifest.message else ""),
        ),
        ("Session", session.name),
    ]
    return [(name, str(value)) for name, value in rows if value not in (None, "")]


def simulated_parts(session: Session) -> str:
    """What of a recording came from a model, in a few words; empty if nothing did."""
    arm = session.manifest.arm.record
    whole = session.manifest.kind == "import" and session.manifest.simulated_sensors
    sensors = [whole or sensor.simulated for sensor in session.manifest.sensors.values()]
    if arm is not None and arm.simulated:
        return (
            "models of the arm and of the sensors, not from real ones"
            if any(sensors)
            else arm.provenance
        )
    if not any(sensors):
        return ""
    which = "models of the sensors" if all(sensors) else "models of some of the sensors"
    return which if arm is None else f"{which}, which followed {arm.provenance}"


def _interruptions(session: Session) -> list[Sentence]:
    """Pauses and broken limits of a run on an arm in real time, and what its controller did not
    deliver.
    """
    sentences, since, why = [], None, ""
    for event in session.events:
        if event.event == "state" and event.details.get("state") == "paused":
            why = str(event.details.get("why", ""))
        elif event.event == "paused":
            since = event.host_time_ns
        elif event.event == "resumed" and since is not None:
            begin, length = since / NANOSECONDS, (event.host_time_ns - since) / NANOSECONDS
            sentences.append(
                Sentence(f"Paused at {begin:.1f} s for {length:.1f} s ({why or 'asked for'}).")
            )
            since = None
    trips = [event.details for event in session.events if event.event == "guard"]
    limits = dict.fromkeys(
        f"{trip.get('guard')} of {trip.get('subject')} ({trip.get('action')})" for trip in trips
    )
    if limits:
        sentences.append(
            Sentence(
                f"Limits of guards that were broken ({len(trips)} in all): {', '.join(limits)}."
            )
        )
    missed = session.manifest.arm.timing.samples_missed
    if missed > 0:
        sentences.append(Sentence(f"Of the controller's samples {missed} did not come."))
    return sentences


def _robot(session: Session) -> str:
    manifest = session.manifest
    if session.robot is None:
        return manifest.robot.name or NO_ROBOT.get(str(manifest.kind), "none")
    described = session.robot.spec.description or session.robot.name
    return described + (f" ({manifest.arm.driver})" if manifest.arm.driver else "")


def _recorded(manifest: Manifest) -> str:
    """Date of the recording that was imported, and who says so."""
    date = manifest.recorded_utc
    return f"{_date(date)}, by {manifest.recorded_by}" if date else "date unknown"


def _date(text: str | None) -> str:
    try:
        return utc_shown(datetime.fromisoformat(text or ""))
    except ValueError:
        return text or ""


def duration(seconds: Any) -> str:
    """Seconds as hours, minutes and seconds."""
    if not isinstance(seconds, int | float) or not np.isfinite(seconds):
        return ""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (f"{hours} h " if hours else "") + f"{minutes} min {rest} s"


def run_section(session: Session, evaluation: Evaluation | None = None) -> Section:
    """Sensors with their mounting, and the sections of the protocol."""
    blocks: list[Block] = [_sensors(session)]
    blocks.append(
        _sections(session)
        if session.steps
        else Sentence(
            "The session lists no steps"
            + (": it is evaluated as a whole." if evaluation is None or evaluation.judged else ".")
        )
    )
    environment = session.manifest.environment
    if environment is not None:
        blocks.append(
            _environment(environment) if environment.dipoles else _undisturbed(environment)
        )
    blocks += _interruptions(session)
    repeated = set() if evaluation is None else {str(found) for found in evaluation.findings}
    blocks += finding_sentences(
        found for found in session.manifest.findings if str(found) not in repeated
    )
    return Section("run", "What was run" if session.has_protocol else "What was recorded", blocks)


def _sensors(session: Session) -> Table:
    rows = []
    for name in session.sensor_names:
        described = session.manifest.sensors[name]
        sensor = session.analysis.sensors.get(name)
        carried = [NOTHING] * 4
        if sensor is not None:
            segment = sensor.segment.name if sensor.segment else NOTHING
            carried = [
                sensor.link,
                segment,
                _rotation(sensor.mounting),
                vector(sensor.mounting.position_mm, 1),
            ]
            if sensor.mounting_error != Placement():
                carried[2] += f", injected error {_rotation(sensor.mounting_error)}"
                if any(sensor.mounting_error.position_mm):
                    carried[3] += f", injected error {vector(sensor.mounting_error.position_mm, 1)}"
        kind = described.description or described.preset or described.driver
        rate = described.rate_hz
        rows.append(
            Row(
                [
                    label(name),
                    text(kind, kind="wide"),
                    Cell(NOTHING if rate is None else f"{rate:.4g}", kind="number"),
                    *(text(value) for value in carried),
                ]
            )
        )
    return Table(
        "Sensors and their mounting",
        [
            Cell("sensor"),
            Cell("kind"),
            Cell("rate [Hz]", kind="number"),
            Cell("link"),
            Cell("segment"),
            Cell("rotation in the link [deg]"),
            Cell("position in the link [mm]"),
        ],
        rows,
        "How to read: the mounting is what the estimators believe; an injected error is a known "
        "fault that they are not told of.",
    )


def _undisturbed(environment: EnvironmentRecord) -> Sentence:
    earth = vector(environment.magnetic_field_uT, 1)
    return Sentence(
        f"Magnetic field that was simulated: the earth's of ({earth}) µT in the world; nothing "
        "disturbs it."
    )


def _environment(environment: EnvironmentRecord) -> Table:
    """The magnetic field that the simulated sensors feel, and what disturbs it."""
    earth = environment.magnetic_field_uT
    rows = [
        Row(
            [
                label(dipole.name or NOTHING),
                text(dipole.link),
                text(vector(dipole.position_mm, 1)),
                text(vector(dipole.moment_A_m2, 3)),
                number(dipole.iron_radius_mm or None, 0),
            ]
        )
        for dipole in environment.dipoles
    ]
    why = f" {environment.why}" if environment.why else ""
    return Table(
        f"Magnetic field that was simulated: the earth's of ({vector(earth, 1)}) µT in the world, "
        "and what disturbs it",
        [
            Cell("source"),
            Cell("link"),
            Cell("position in the link [mm]"),
            Cell("permanent moment in the link [A m²]"),
            Cell("soft iron, radius [mm]", kind="number"),
        ],
        rows,
        "How to read: what is fixed to the base stays where it is while the sensors travel; what "
        "is fixed to another link moves against the sensor; what is fixed to the sensor's own link "
        "turns with it. Filters are not told of any of it." + why,
        folded=True,
    )


def _rotation(placement: Placement) -> str:
    parts = [
        f"{sequence} ({vector(angles, 1)})" for sequence, angles in placement.rotation_deg.items()
    ]
    return " ".join(parts) or "none"


def _sections(session: Session) -> Table:
    rows = []
    for name in dict.fromkeys(step.section for step in session.steps):
        steps = [step for step in session.steps if step.section == name]
        begin, end = steps[0].start_ns / NANOSECONDS, steps[-1].end_ns / NANOSECONDS
        varied = {
            key: sorted({step.variables[key] for step in steps if key in step.variables})
            for key in steps[0].variables
        }
        ranges = [
            f"{key} {v[0]:g}" + (f" to {v[-1]:g} ({len(v)} values)" if len(v) > 1 else "")
            for key, v in varied.items()
        ]
        ranges = [part.replace(" -", " −") for part in ranges]
        rows.append(
            Row(
                [
                    label(name),
                    text(steps[0].role),
                    number(len(steps), 0),
                    number(begin, 1),
                    number(end - begin, 1),
                    text("; ".join(ranges), kind="wide" if ranges else ""),
                ]
            )
        )
    return Table(
        "Sections of the protocol, as they happened",
        [
            Cell("section"),
            Cell("role"),
            *header("steps", "begin [s]", "duration [s]", numbers_from=0),
            Cell("variables"),
        ],
        rows,
        "How to read: calibration fits sensor errors, reference aligns the frames, evaluation is "
        "judged.",
    )
