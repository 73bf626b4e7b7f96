"""Rows of an evaluation that no truth is needed for: what a recording says by itself.

None of them is an error: filters are compared with one another, never judged by one another.
"""

from __future__ import annotations

from dataclasses import dataclass

from testbench.records.disk.json_record import Number


@dataclass(frozen=True)
class DifferenceRow:
    """Two orientations of one sensor against each other; neither is taken for the truth.

    Attributes:
        sensor: Its name.
        first: One filter.
        second: The other, which `first` is compared with: the one that was asked for where one was.
        n: Samples that both know.
        heading_offset_deg: Mean heading of the world of `first` seen from that of `second`. It is
            constant, says nothing of either filter, and is taken off before all that follows.
        tilt_offset_deg: Angle between the verticals of both worlds, on average; not taken off.
        mean_deg: Mean angle between both.
        rms_deg: Root mean square of that angle.
        max_deg: The largest angle.
        heading_rms_deg: Of the part about the vertical.
        inclination_rms_deg: Of the rest.
        mean_quaternion_length: Mean length of the difference of both unit quaternions, of the signs
            that are nearer; 2 sin(angle / 4) [1].
    """

    sensor: str
    first: str
    second: str
    n: int
    heading_offset_deg: Number
    tilt_offset_deg: Number
    mean_deg: Number
    rms_deg: Number
    max_deg: Number
    heading_rms_deg: Number
    inclination_rms_deg: Number
    mean_quaternion_length: Number


@dataclass(frozen=True)
class AngleRangeRow:
    """How far one angle of a sensor or joint went over the whole recording; degrees.

    Attributes:
        owner: Sensor or joint.
        kind: "sensor" or "joint".
        filter: That gave the orientations.
        sequence: Euler sequence of a sensor, label of a joint's definition.
        angle: "first", "second" or "third".
        name: What the definition calls it, such as "flexion"; "" where it has no name.
        flexion: Whether the joint's definition takes it for the flexion.
        n: Samples.
        lowest_deg: The smallest angle, unwrapped; None where passages of gimbal lock leave whole
            turns open.
        highest_deg: The largest angle, likewise.
        range_deg: Range of motion; None where the angle is not defined by itself: an outer one of a
            recording that is in gimbal lock for most of the time.
        locked_percent: Part of the samples in gimbal lock.
    """

    owner: str
    kind: str
    filter: str
    sequence: str
    angle: str
    name: str
    flexion: bool
    n: int
    lowest_deg: float | None
    highest_deg: float | None
    range_deg: float | None
    locked_percent: Number


@dataclass(frozen=True)
class FoundCycleRow:
    """The average of cycles that were found in a signal; its unit stands in `unit`.

    Attributes:
        owner: Sensor or joint.
        kind: "sensor" or "joint".
        signal: What was cut: "flexion", or the most active axis, such as "gyr_y".
        unit: Of the ranges.
        filter: That gave a joint's angle; None for a sensor's own signal.
        sequence: Label of the joint's definition; None for a sensor's own signal.
        frequency_hz: Of the median cycle.
        frequency_sd_hz: Standard deviation of that of a single cycle.
        cycles: How many are averaged.
        left_out: How many lie between them and are not: gaps, another length, another shape.
        begin_s: When the first of them begins.
        end_s: When the last of them ends.
        range: Largest less smallest value, mean over the cycles.
        range_sd: Standard deviation of that of a single cycle.
        scatter: Standard deviation over the cycles, RMS over the cycle.
        likeness: Median correlation of a cycle with the average one.
    """

    owner: str
    kind: str
    signal: str
    unit: str
    filter: str | None
    sequence: str | None
    frequency_hz: Number
    frequency_sd_hz: Number
    cycles: int
    left_out: int
    begin_s: Number
    end_s: Number
    range: Number
    range_sd: Number
    scatter: Number
    likeness: Number


@dataclass(frozen=True)
class RestRow:
    """How long a sensor rested.

    Attributes:
        sensor: Its name.
        by: What told rest from motion: "gyr", "device" (its orientation) or "acc".
        rests: Rests of half a second and more.
        total_s: Of them all.
        longest_s: Of the longest.
        needed_s: What noise is measured from.
    """

    sensor: str
    by: str
    rests: int
    total_s: Number
    longest_s: Number
    needed_s: Number


@dataclass(frozen=True)
class OrientationChangeRow:
    """How a sensor lies in its last rest against its first.

    It is an error of the filter only where somebody states that the sensor came back.

    Attributes:
        sensor: Its name.
        filter: That gave the orientations; "accelerometer" for gravity's direction alone.
        first_s: Middle of the first rest.
        last_s: Middle of the last rest.
        total_deg: Angle of the change; None for the accelerometer.
        heading_deg: Its part about the vertical, signed; None for the accelerometer.
        inclination_deg: The rest.
        returned: Whether it was stated that the sensor ended as it began, so that the change is the
            closure error of the loop.
    """

    sensor: str
    filter: str
    first_s: Number
    last_s: Number
    total_deg: float | None
    heading_deg: float | None
    inclination_deg: Number
    returned: bool
