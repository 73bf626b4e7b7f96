"""True angles of joints as a mapping states them: columns of a file of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.common_clock import stream_of
from testbench.formats.mapped.files import Files, Place
from testbench.formats.mapped.times import stamps_of
from testbench.formats.mapping import AngleColumns, MappingSpec
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.stamps import LOWEST_OF_TRUTH_HZ, Asking
from testbench.formats.truth.angle_names import stated_angles
from testbench.formats.truth.angle_table import AngleTable, angles_of
from testbench.formats.truth.angles import give_angles
from testbench.formats.truth.times import later_than_samples_ns
from testbench.frames import NANOSECONDS
from testbench.records.disk.yaml_file import YamlDocument
from testbench.records.session.manifest import JointTruthRecord

KEY = "truth_angles"


def give_mapped_angles(
    recording: Recording, document: YamlDocument[MappingSpec], files: Files
) -> None:
    """Give joints the true angles that a mapping states.

    Args:
        recording: With its joints; is changed.
        document: The mapping.
        files: Of the recording.

    Raises:
        InputError: A unit is open or cannot be; says how to state it.
        FileProblems: The file does not fit the mapping, or is malformed.
    """
    spec = document.value.truth_angles
    if spec is None:
        return
    place, body = Place(document, (KEY,)), recording.analysis.body
    joints = {} if body is None else body.joints
    stated = {
        f"{joint}.{angle}": column
        for joint, angles in spec.joints.items()
        for angle, column in angles.items()
    }
    table = _table(recording, place, files, spec)
    try:
        chosen = stated_angles(stated, joints, table.titles, KEY)
    except (InputError, NotFoundError) as error:
        raise place.problem(str(error), "joints") from None
    later, said = later_than_samples_ns(recording, table.unix_ns, int(table.time_ns[-1]))
    recording.findings += said
    record = JointTruthRecord(same_clock=spec.same_clock, offset_s=spec.offset_s)
    shift = later + round((spec.offset_s or 0.0) * NANOSECONDS)
    placed = replace(table, time_ns=table.time_ns + shift)
    give_angles(recording, placed, chosen, spec.unit, record)


def _table(recording: Recording, place: Place, files: Files, spec: AngleColumns) -> AngleTable:
    """The columns of the file that are numbers."""
    beside = files.given[0].parent / spec.file
    given = [own for own in files.given if own.name == beside.name]
    source = files.table(given[0] if given else beside, spec.text)
    key = f"{KEY}.time.unit: UNIT in the mapping"
    asking = Asking(f"{source.file}", flag=key, lowest_hz=LOWEST_OF_TRUTH_HZ)
    stamps = stamps_of(place, source, spec.time, spec.rate_hz, None, asking)
    origin = _zero_ns(recording.sensors) if spec.same_clock else None
    table = angles_of(source, list(source.names), stamps, origin)
    return replace(table, unix_ns=None) if spec.same_clock else table


def _zero_ns(sensors: Mapping[str, ImportedSensor]) -> int | None:
    """What the clock of the files says at host time zero [ns]."""
    streams = [stream for own in sensors.values() if (stream := stream_of(own)) is not None]
    zeros = [
        stream.first_time_ns() if stream.origin_ns is None else stream.origin_ns
        for stream in streams
    ]
    return min(zeros, default=None)
