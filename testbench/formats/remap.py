"""Another sensor frame for a recording that was read.

Its samples, the vendor's orientation and the truth turn with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from testbench.formats.axes import AxisMap
from testbench.formats.recording import Recording
from testbench.records.findings.catalogue import finding
from testbench.records.session.samples import ImuSamples


@dataclass(frozen=True)
class Remapped:
    """Chunks with other axes, made as they are asked for."""

    chunks: Iterable[ImuSamples]
    axes: AxisMap

    def __iter__(self) -> Iterator[ImuSamples]:
        for chunk in self.chunks:
            yield replace(
                chunk,
                gyr=self.axes.vectors(chunk.gyr),
                acc=self.axes.vectors(chunk.acc),
                mag=None if chunk.mag is None else self.axes.vectors(chunk.mag),
                device_q=None if chunk.device_q is None else self.axes.orientations(chunk.device_q),
            )


def remap_axes(recording: Recording, axes: AxisMap, name: str) -> None:
    """Turn every sensor of a recording.

    Args:
        recording: Is changed.
        axes: The map; a rotation.
        name: Of the map, for people.
    """
    for sensor in recording.sensors.values():
        sensor.chunks = Remapped(sensor.chunks, axes)
        if sensor.truth is not None:
            truth = sensor.truth
            sensor.truth = replace(
                truth,
                q_world_from_sensor=axes.orientations(truth.q_world_from_sensor),
                rate=None if truth.rate is None else axes.vectors(truth.rate),
                force=None if truth.force is None else axes.vectors(truth.force),
            )
    recording.findings.append(finding("structure.axes", axes=name))
