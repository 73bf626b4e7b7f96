"""Several sensors on one clock: they keep their offsets, where the clock is one.

Unix times are the same on every clock that was set; counters since power-up are not. Whether a
format's own clock is shared, its importer knows.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from testbench.formats.recording import ImportedSensor
from testbench.formats.tables.samples_stream import SampleStream
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

OVERLAP_NS = 60 * NANOSECONDS
"""A pause of so much between two recordings of one clock is still one occasion."""


def common_clock(clock: str, begins_ns: list[int]) -> Finding:
    """The finding that sensors keep their offsets.

    Args:
        clock: Which one, a phrase.
        begins_ns: First time of each sensor on it [ns].
    """
    latest = (max(begins_ns) - min(begins_ns)) / NANOSECONDS
    return finding("clock.common", sensors=len(begins_ns), clock=clock, latest_s=latest)


def share_clock(
    sensors: dict[str, ImportedSensor],
    clock: str | None = None,
    own: str = "clock.own",
    leads_ns: dict[str, int] | None = None,
) -> list[Finding]:
    """Let the host time of sensors begin with the first of them, if their clock is one.

    Args:
        sensors: By name; their chunks are streams that were not yet turned.
        clock: Which one by what the format says, a phrase; None: one only if all are Unix times.
        own: Code of the finding where it is not one.
        leads_ns: First time of each sensor on that clock, where it is not that of its device time
            [ns].

    Returns:
        What is to be said of it.
    """
    if len(sensors) < 2:
        return []
    unix = all(sensor.unix for sensor in sensors.values())
    if clock is None and not unix:
        return [finding(own)]
    name = "Unix time" if unix else clock or ""
    streams = {key: s.chunks for key, s in sensors.items() if isinstance(s.chunks, SampleStream)}
    first = {key: stream.first_time_ns() for key, stream in streams.items()}
    begins = first if leads_ns is None else leads_ns
    order = sorted(streams, key=lambda key: begins[key])
    ends = order[0]
    for key in order[1:]:
        apart = _apart_ns(streams, first, begins, order[: order.index(key)], key)
        if apart is not None and apart > OVERLAP_NS:
            seconds = apart / NANOSECONDS
            return [finding("clock.apart", clock=name, sensor=key, ended=ends, apart_s=seconds)]
        ends = key
    for key, stream in streams.items():
        later = begins[key] - begins[order[0]]
        stream.origin_ns = first[key] - later
        truth = sensors[key].truth
        if truth is not None:  # it began with its sensor
            sensors[key].truth = replace(truth, host_time_ns=truth.host_time_ns + later)
    return [common_clock(name, [begins[key] for key in order])]


def share_origin(sensors: Iterable[ImportedSensor]) -> int:
    """Let host time zero be the first stamp of all sensors, whose clock is one by their format.

    Args:
        sensors: One of them a stream at least.

    Returns:
        That stamp [ns].
    """
    streams = [own.chunks for own in sensors if isinstance(own.chunks, SampleStream)]
    origin = min(stream.first_time_ns() for stream in streams)
    for stream in streams:
        stream.origin_ns = origin
    return origin


def unix_zero_ns(sensor: ImportedSensor) -> int | None:
    """Unix time at host time 0 [ns], None where the sensor's times are none."""
    stream = stream_of(sensor)
    if stream is None or not sensor.unix:
        return None
    return stream.origin_ns if stream.origin_ns is not None else stream.first_time_ns()


def stream_of(sensor: ImportedSensor) -> SampleStream | None:
    """The stream of a file behind the chunks of a sensor, None if they are no file's."""
    chunks: object = sensor.chunks
    while chunks is not None and not isinstance(chunks, SampleStream):
        chunks = getattr(chunks, "chunks", None)
    return chunks


def _apart_ns(
    streams: dict[str, SampleStream],
    own: dict[str, int],
    begins: dict[str, int],
    before: list[str],
    key: str,
) -> int | None:
    """Time from the end of all sensors before this one to its beginning; None if one goes on."""
    least: int | None = None
    for other in reversed(before):
        wanted = own[other] + begins[key] - begins[other]
        last = streams[other].goes_on_until(wanted)
        if last is None:
            return None
        least = wanted - last if least is None else min(least, wanted - last)
    return least
