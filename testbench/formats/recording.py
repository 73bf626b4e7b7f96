"""What an importer hands over, and how it becomes a session."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.clock import Clock
from testbench.exceptions import BenchError, FileProblems, Problem
from testbench.frames import NANOSECONDS
from testbench.records.protocol import Analysis
from testbench.records.samples import ImuSamples, Truth
from testbench.records.session import RunStatus, Session
from testbench.records.session_writer import SessionWriter

IMU_NOTES = {
    "content": "imported samples of an inertial sensor, in the sensor frame",
    "device_q": "q_earth_from_sensor of the vendor's filter, w x y z, Hamilton",
    "units": "the suffix of each column; times in nanoseconds",
}
TRUTH_NOTES = {
    "content": "truth that came with the recording; NaN where it was lost",
    "q_world_from_sensor": "w x y z, Hamilton",
}


@dataclass
class ImportedSensor:
    """One sensor of a recording.

    Attributes:
        chunks: Its samples, in pieces that fit in memory; all pieces have the same columns. rate: Nominal [Hz].
        description: For people. truth: What it went through, where the file says so.
    """

    chunks: Iterable[ImuSamples]
    rate: float
    description: str
    truth: Truth | None = None


@dataclass
class Recording:
    """What a file, or several, hold.

    Attributes:
        name: Of the recording. purpose: A sentence for people. sensors: By name. analysis: Filters and alignment that suit it.
        notes: What the importer noticed, such as a stale first row it dropped.
    """

    name: str
    purpose: str
    sensors: dict[str, ImportedSensor]
    analysis: Analysis
    notes: list[str] = field(default_factory=list)


def write_recording(recording: Recording, files: list[Path], format_name: str, out: Path, clock: Clock) -> Session:
    """Write a session from a recording.

    Args:
        recording: What was read. files: Where it came from. format_name: Of these files. out: Folder to make.
        clock: For the date.

    Raises:
        FileProblems: A file turns out to be malformed after its beginning; the folder is then removed again.
    """
    first: dict[str, Iterator[ImuSamples]] = {}
    descriptions: dict[str, Any] = {}
    for name, sensor in recording.sensors.items():
        chunks = iter(sensor.chunks)
        head = next(chunks, None)  # fails here, before a folder is made, if the file is malformed at its beginning
        if head is None or len(head) == 0:
            raise FileProblems(files[0], [Problem(f"sensor '{name}' has no samples")])
        first[name] = _chain(head, chunks)
        descriptions[name] = _describe(sensor, head)
    writer = SessionWriter(out, recording.analysis, descriptions, clock.utc(), {
        "kind": "import",
        "format": format_name,
        "source": [file.name for file in files],
        "protocol": {"name": recording.name, "purpose": recording.purpose},
        "notes": recording.notes,
    })  # fmt: skip
    begin, end = np.inf, -np.inf
    try:
        for name, chunks in first.items():
            opened = False
            for chunk in chunks:
                if not opened:
                    columns = ImuSamples.columns(chunk.mag is not None, chunk.device_q is not None)
                    writer.open_journal(f"imu_{name}", columns, IMU_NOTES)
                    opened = True
                writer.append(f"imu_{name}", chunk.to_columns())
                begin, end = min(begin, chunk.host_time_ns[0]), max(end, chunk.host_time_ns[-1])
            truth = recording.sensors[name].truth
            if truth is not None:
                writer.add_table(f"truth_{name}", truth.to_columns(), TRUTH_NOTES)
        writer.close(RunStatus.COMPLETED, duration_s=float(end - begin) / NANOSECONDS)
    except BenchError:
        writer.discard()
        raise
    return Session(out)


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
    }
