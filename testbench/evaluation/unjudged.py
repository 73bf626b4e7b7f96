"""What is said of sensors and joints that nobody can judge: what a recording shows by itself."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.angle_ranges import joint_angles, sensor_angles
from testbench.evaluation.cycles import POINTS
from testbench.evaluation.differences import difference_tables
from testbench.evaluation.found_cycles import AverageCycle, Borders, average_cycle, find_borders
from testbench.evaluation.still_intervals import Rests, change_rows, rest_row
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_angle import flexion_of, unwrapped
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import JointEstimate, SensorEstimate
from testbench.records.results.evaluation import ResultTables
from testbench.records.results.recording_rows import FoundCycleRow
from testbench.records.session.layout import FOUND_CYCLES
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Estimation, JointDefinition

FoundCycle = tuple[FoundCycleRow, AverageCycle]
LEAST_FLEXION_DEG = 2.0
"""A flexion that moves less from cycle to cycle stands still."""
LEAST_ACTIVE = {"gyr": 5.0, "rate": 5.0, "acc": 0.2}
"""RMS of an axis about its mean below which it stands still [deg/s, m/s^2]."""
UNITS = {"gyr": "deg/s", "rate": "deg/s", "acc": "m/s^2"}


def unjudged_sensor(
    session: Session, name: str, sensor: SensorEstimate, settings: Estimation
) -> tuple[ResultTables, list[FoundCycle]]:
    """Rows and signals of a sensor, and the cycles of its most active axis.

    Args:
        session: The recording.
        name: Of the sensor.
        sensor: Its estimate.
        settings: Sequence of its angles, and what is compared with what.
    """
    samples = session.imu(name, every=sensor.every)
    rests = Rests.of(sensor)
    own = ResultTables(
        rests=[rest_row(name, rests, samples)],
        orientation_changes=change_rows(name, sensor, rests, samples, settings.returned),
    )
    cycles, told = _sensor_cycles(name, sensor, samples)
    parts = [
        sensor_angles(name, sensor, settings.euler_sequence),
        difference_tables(name, sensor, settings.compare),
        own,
        told,
    ]
    return ResultTables.joined(parts), cycles


def unjudged_joint(
    name: str, joint: JointDefinition, estimate: JointEstimate
) -> tuple[ResultTables, list[FoundCycle]]:
    """Angles of a joint over time with their ranges, and the cycles of its flexion.

    The cycles are found in the flexion by the first filter; those of all others are cut alike.
    """
    defined = next(item for item in joint.definitions() if item.label == joint.label)
    time = estimate.host_time_ns / NANOSECONDS
    borders: Borders | None = None
    cycles: list[FoundCycle] = []
    for (key, label), angles in estimate.angles.items():
        if label != joint.label:
            continue
        flexion = np.degrees(unwrapped(flexion_of(defined, angles)))
        known = np.isfinite(flexion) & _later(estimate.host_time_ns)
        if borders is None:
            borders = find_borders(time[known], flexion[known])
        average = None if borders is None else average_cycle(borders, time[known], flexion[known])
        if average is not None and average.ranges.mean() >= LEAST_FLEXION_DEG:
            row = _row(name, "joint", ("flexion", "deg"), average, (key, label))
            cycles.append((row, average))
    told = joint_angles(name, joint, estimate)
    if estimate.angles and not cycles:
        none = finding("cycles.none_found", f"joint '{name}'", signal=f"flexion, {joint.label}")
        told = ResultTables.joined([told, ResultTables(findings=[none])])
    return told, cycles


def _sensor_cycles(
    name: str, sensor: SensorEstimate, samples: ImuSamples
) -> tuple[list[FoundCycle], ResultTables]:
    """Cycles of a sensor's most active axis; why there are none."""
    quantity, values = _activity(sensor, samples)
    time, sound = sensor.host_time_ns / NANOSECONDS, ~sensor.flagged
    known = np.isfinite(values).all(axis=1) & sound & _later(sensor.host_time_ns)
    if known.sum() < 2:
        return [], ResultTables()
    axis = int(np.argmax(values[known].std(axis=0)))
    signal, label = values[known][:, axis], f"{quantity}_{'xyz'[axis]}"
    average = None
    if signal.std() >= LEAST_ACTIVE[quantity]:
        borders = find_borders(time[known], signal)
        average = None if borders is None else average_cycle(borders, time[known], signal)
    if average is None:
        return [], ResultTables(findings=[finding("cycles.none_found", name, signal=label)])
    row = _row(name, "sensor", (label, UNITS[quantity]), average, (None, None))
    return [(row, average)], ResultTables()


def _activity(sensor: SensorEstimate, samples: ImuSamples) -> tuple[str, np.ndarray]:
    """What shows how a sensor moves, shape (n, 3): its rate [deg/s], by its orientation where it
    has no gyroscope, else its specific force [m/s^2].
    """
    if np.isfinite(samples.gyr).any():
        return "gyr", np.degrees(samples.gyr)
    q = samples.device_q
    if q is None or len(q) < 2:
        return "acc", samples.acc
    seconds = np.diff(sensor.host_time_ns) / NANOSECONDS
    turns = rotation.to_rotation_vector(rotation.multiply(rotation.conjugate(q[:-1]), q[1:]))
    rates = np.divide(
        turns, seconds[:, None], out=np.full_like(turns, np.nan), where=seconds[:, None] > 0
    )
    return "rate", np.degrees(np.vstack([rates[:1], rates]))


def _later(time_ns: np.ndarray) -> np.ndarray:
    """Rows that are later than the one before, shape (n,), bool."""
    return np.diff(time_ns, prepend=time_ns[0] - 1) > 0


def _row(
    owner: str,
    kind: str,
    signal: tuple[str, str],
    average: AverageCycle,
    key: tuple[str | None, str | None],
) -> FoundCycleRow:
    rates = 1 / average.periods
    return FoundCycleRow(
        owner=owner,
        kind=kind,
        signal=signal[0],
        unit=signal[1],
        filter=key[0],
        sequence=key[1],
        frequency_hz=float(1 / np.median(average.periods)),
        frequency_sd_hz=float(rates.std(ddof=1)),
        cycles=len(average.periods),
        left_out=average.left_out,
        begin_s=average.begin,
        end_s=average.end,
        range=float(average.ranges.mean()),
        range_sd=float(average.ranges.std(ddof=1)),
        scatter=float(np.sqrt(np.mean(average.sd**2))),
        likeness=average.likeness,
    )


def found_cycle_tables(found: list[FoundCycle]) -> ResultTables:
    """The rows, and their average cycles as the table "found_cycles", numbered as the rows are."""
    if not found:
        return ResultTables()
    columns = {
        "row": np.repeat(np.arange(len(found)), POINTS),
        "cycle_percent": np.tile(np.arange(POINTS), len(found)),
        "mean": np.concatenate([average.mean for _, average in found]),
        "sd": np.concatenate([average.sd for _, average in found]),
    }
    return ResultTables(found_cycles=[row for row, _ in found], series={FOUND_CYCLES: columns})
