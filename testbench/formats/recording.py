"""What an importer hands over, and how it becomes a session."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from testbench.clock import Clock, utc_text
from testbench.consistency import Consistency, refuse_contradictions
from testbench.consistency.doubtful import Belief
from testbench.consistency.looked import Up
from testbench.consistency.refused import Refusals
from testbench.exceptions import FileProblems, Problem, StorageError
from testbench.formats.dates import Recorded
from testbench.formats.holes import Holes
from testbench.formats.lost_rows import LostRows
from testbench.frames import NANOSECONDS
from testbench.records.disk.replacing import disk_reason, replaced_folder
from testbench.records.disk.tables import to_arrow, write_parquet_batches
from testbench.records.findings.finding import Finding, told_once
from testbench.records.session.layout import angles_stream, imu_stream, table_file, truth_stream
from testbench.records.session.manifest import FullScale, JointTruthRecord
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import IMU_NOTES, ImuSamples, TrueAngles, Truth
from testbench.records.session.sensor_file import SensorFile
from testbench.records.session.session import RunStatus, Session, step_events
from testbench.records.session.session_writer import SessionWriter, make_folder
from testbench.records.specs.protocol import Analysis

IMPORTED_NOTES = IMU_NOTES | {
    "content": "imported samples of an inertial sensor, in the sensor frame; NaN: the file does "
    "not hold the quantity",
}
TRUTH_NOTES = {
    "content": "truth that came with the recording; NaN where it was lost",
    "q_world_from_sensor": "w x y z, Hamilton",
}
ANGLE_NOTES = {
    "content": "angles of a joint by another system, as the joint's own definition writes them; "
    "NaN where they are not known",
}


@dataclass
class ImportedSensor:
    """One sensor of a recording.

    Attributes:
        chunks: Its samples, in pieces that fit in memory; all pieces have the same columns; can be
            gone through more than once.
        rate: Nominal [Hz].
        description: For people.
        truth: What it went through, where the file says so.
        details: Further entries of the sensor in the manifest, such as scale factors.
        findings: What was noticed of it when it was opened.
        told: What was noticed of its samples, once they were gone through.
        unix: Whether its device times are Unix times.
    """

    chunks: Iterable[ImuSamples]
    rate: float
    description: str
    truth: Truth | None = None
    details: dict[str, Any] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    told: Callable[[], list[Finding]] = list
    unix: bool = False

    def head(self) -> ImuSamples | None:
        """The first chunk, None if there is none."""
        return next(iter(self.chunks), None)


@dataclass(frozen=True)
class ImportedAngles:
    """Angles of a joint that another system computed.

    Attributes:
        true: The angles.
        record: Where they come from, and what is known of their time.
    """

    true: TrueAngles
    record: JointTruthRecord


@dataclass
class Recording:
    """What a file, or several, hold.

    Attributes:
        name: Of the recording.
        purpose: A sentence for people.
        sensors: By name.
        analysis: Filters and alignment that suit it.
        findings: What was noticed when it was read, such as a stale first row that was dropped.
        steps: Of the arm, where its poses are known.
        recorded: When it was made, None where nobody says.
        answered: Quantities whose units a person stated, which settles every doubt of them: "acc",
            "gyr", "mag", "time"; None where nobody could be asked, so that nothing is refused.
        origin_ns: What the clock of the files said at host time zero, where a truth on the same
            clock may come from another file [ns].
        texts: Files that the session keeps verbatim, by name.
        angles: True angles of joints, by name of the joint.
        simulated: Whether its sensors are models.
    """

    name: str
    purpose: str
    sensors: dict[str, ImportedSensor]
    analysis: Analysis
    findings: list[Finding] = field(default_factory=list)
    steps: list[PlannedStep] = field(default_factory=list)
    recorded: Recorded | None = None
    answered: frozenset[str] | None = None
    origin_ns: int | None = None
    texts: dict[str, str] = field(default_factory=dict)
    angles: dict[str, ImportedAngles] = field(default_factory=dict)
    simulated: bool = False


def write_recording(
    recording: Recording, files: list[Path], format_name: str, out: Path, clock: Clock
) -> Session:
    """Write a session from a recording.

    Nothing is found under its name that is not whole: it is written beside, and whatever ends the
    import early leaves nothing, after a kill nothing but what the next import of that name clears
    away; the source still exists. Whether a sensor's quantities agree is looked at as its samples
    go by, so that they are read once.

    Args:
        recording: What was read.
        files: Where it came from.
        format_name: Of these files.
        out: Folder to make.
        clock: For the date.

    Raises:
        FileProblems: A file turns out to be malformed after its beginning.
        InputError: The quantities of a sensor cannot be right as they are; says how to settle it.
        SessionError: The folder exists, or there is no such place.
        StorageError: The disk does not take it.
    """
    descriptions: dict[str, Any] = {}
    for name, sensor in recording.sensors.items():
        head = (
            sensor.head()
        )  # fails here, before a folder is made, if the file is malformed at its beginning
        if head is None or len(head) == 0:
            raise FileProblems(files[0], [Problem(f"sensor '{name}' has no samples")])
        descriptions[name] = _describe(sensor, head)
    details = {
        "kind": "import",
        "format": format_name,
        "source": [file.name for file in files],
        "recorded_utc": utc_text(recording.recorded.at) if recording.recorded else None,
        "recorded_by": recording.recorded.source if recording.recorded else None,
        "protocol": {"name": recording.name, "purpose": recording.purpose},
        **_true_angles(recording),
        **({"simulated_sensors": True} if recording.simulated else {}),
    }
    with _kept_whole(out) as folder:
        writer = SessionWriter(
            out, recording.analysis, descriptions, clock.utc(), details, folder=folder
        )
        try:
            _write(writer, recording)
        finally:
            writer.abandon()
    return Session(out)


@contextmanager
def _kept_whole(out: Path) -> Iterator[Path]:
    """A folder to write a session to, which takes its name once it is whole.

    Raises:
        SessionError: The name is taken, or there is no such place.
        StorageError: The disk does not take it.
    """
    if not out.parent.exists():
        make_folder(out.parent)
    try:
        with replaced_folder(out, anew=True) as folder:
            yield folder
    except OSError as error:
        raise StorageError(
            f"{out} cannot be written: {disk_reason(error)}; nothing was kept"
        ) from None


def _write(writer: SessionWriter, recording: Recording) -> None:
    """Write all that a recording holds, and close the session."""
    findings = list(recording.findings)
    begin, end, counts = np.inf, -np.inf, {}
    for name, text in recording.texts.items():
        writer.add_text(name, text)
    for name, sensor in recording.sensors.items():
        consistency = Consistency()
        up = Up(sensor.details.get("hemisphere"), by_truth=sensor.truth is not None)
        refusals = Refusals(_belief(recording.analysis, sensor))
        path, holes, rows = writer.path / table_file(imu_stream(name)), Holes(), LostRows()
        counts[name], first, last = _write_samples(
            path, refusals.watch(consistency.watch(rows.watch(holes.watch(sensor.chunks))))
        )
        refused = refusals.findings(SensorFile(path))
        own = holes.findings() + rows.findings() + (refusals.in_range or consistency).findings(up)
        if recording.answered is not None:
            refuse_contradictions(name, own, recording.answered)
        own += refused
        findings += [one.at(name) for one in own]
        begin, end = min(begin, first), max(end, last)
        findings += [found.at(name) for found in (*sensor.findings, *sensor.told())]
        if sensor.truth is not None:
            writer.add_table(truth_stream(name), sensor.truth.to_columns(), TRUTH_NOTES)
    for name, joint in recording.angles.items():
        writer.add_table(angles_stream(name), joint.true.to_columns(), ANGLE_NOTES)
    for event in step_events(recording.steps):
        writer.event(event)
    writer.close(
        RunStatus.COMPLETED,
        duration_s=float(end - begin) / NANOSECONDS,
        samples=counts,
        findings=told_once(findings),
    )


def _true_angles(recording: Recording) -> dict[str, Any]:
    """The entry of the manifest on joints with true angles, where there are any."""
    own = {name: joint.record.model_dump() for name, joint in recording.angles.items()}
    return {"true_angles": own} if own else {}


def _belief(analysis: Analysis, sensor: ImportedSensor) -> Belief:
    """What a person says of samples that are imported; what is excluded is told when the rest is
    estimated.
    """
    stated = sensor.details.get("full_scale")
    scale = FullScale.model_validate(stated) if stated else FullScale()
    return Belief(keep=frozenset(analysis.estimate.keep), full_scale=scale)


def _write_samples(path: Path, chunks: Iterator[ImuSamples]) -> tuple[int, int, int]:
    """Write chunks as one Parquet file as they come.

    An import needs no journal: if it is cut off, it is made again.

    Returns:
        Number of rows, first and last host_time_ns.
    """
    head = next(chunks)
    shape = (head.mag is not None, head.device_q is not None, head.temperature is not None)
    types = ImuSamples.columns(*shape)
    metadata: Mapping[str, str] = IMPORTED_NOTES
    schema = pa.schema(
        [(name, pa.from_numpy_dtype(dtype)) for name, dtype in types.items()], metadata=metadata
    )
    last = 0

    def batches() -> Iterator[pa.RecordBatch]:
        nonlocal last
        for chunk in _chain(head, chunks):
            if (
                chunk.mag is not None,
                chunk.device_q is not None,
                chunk.temperature is not None,
            ) != shape:
                raise ValueError("an importer's chunks must all have the same columns")
            columns = chunk.to_columns()
            last = int(chunk.host_time_ns[-1])
            yield pa.record_batch(
                [to_arrow(columns[name], schema.field(name).type) for name in schema.names],
                schema=schema,
            )

    count = write_parquet_batches(path, schema, batches())
    return count, int(head.host_time_ns[0]), last


def _chain(head: ImuSamples, chunks: Iterator[ImuSamples]) -> Iterator[ImuSamples]:
    yield head
    yield from chunks


def _describe(sensor: ImportedSensor, head: ImuSamples) -> dict[str, Any]:
    return {
        "driver": "imported",
        "description": sensor.description,
        "rate_hz": sensor.rate,
        "magnetometer": head.mag is not None,
        "orientation": head.device_q is not None,
        **sensor.details,
    }
