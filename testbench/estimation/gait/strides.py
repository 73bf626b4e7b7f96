"""Strides as records, and what follows from them: means, cadence, closure, symmetry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from testbench.estimation.gait.foot import LONGEST_SWING_S, FootWalk, Move, is_turning, turn_of
from testbench.estimation.gait.heel import heel_in_sensor
from testbench.estimation.gait.readings import Readings
from testbench.estimation.gait.walk import Walk
from testbench.estimation.gait.zero_velocity import THRESHOLD
from testbench.model import rotation
from testbench.records.results.gait import GaitRow, SensorGait, Stride, SymmetryRow

LONGEST_STRIDE_S = 2.5
"""Between initial contacts farther apart than this the walker stood [s]."""
FASTEST = 12.0
"""No foot goes faster on the average of a stride [m/s]."""
LEAST_STRIDES = 3
"""A walk has so many in a row: a person who squats, or sets a foot anew, makes one or two."""
QUANTITIES = (
    "stride_time_s",
    "swing_s",
    "length_m",
    "speed_m_s",
    "rise_m",
    "clearance_m",
)
STEP_TIME, DOUBLE_SUPPORT = "step_time_s", "double_support_s"
"""Of two feet, which a stride of one does not tell."""
TURNING, UNKNOWN_WAY, TOO_FAST = "it turns", "its readings have a hole", "no foot goes so fast"
NO_STAND = "the foot does not stand for too long"
STANDING = "it begins or ends in standing"
STANDING_S = 1.2
"""A stand of a walk is shorter [s]."""
USUAL = (TURNING, STANDING)
"""Why strides are in no mean though nothing is wrong with them."""


def foot_strides(readings: Readings, walked: FootWalk) -> list[Stride]:
    """The strides of a sensor on a foot.

    Args:
        readings: Of the sensor.
        walked: What was reckoned from them.
    """
    heel = _heel(readings, walked)
    place = walked.track.position + rotation.rotate(
        walked.track.q_world_from_sensor, np.tile(heel, (len(walked.track.position), 1))
    )
    # the innovations say by how much the noise was taken for larger or smaller than it is
    factor = walked.track.innovation if np.isfinite(walked.track.innovation) else 1.0
    found: list[Stride] = []
    before = float("nan")
    for i, move in enumerate(walked.moves):
        stride = _stride(readings, walked, move, place, float(np.sqrt(max(factor, 0.1))))
        if stride.counted and _from_or_to_standing(readings, walked, i):
            stride = replace(stride, counted=False, left_out=STANDING)
        time = stride.ic_s - before
        if time < LONGEST_STRIDE_S:
            stride = replace(stride, stride_time_s=time)
        before = stride.ic_s
        found.append(stride)
    return found


def _from_or_to_standing(readings: Readings, walked: FootWalk, i: int) -> bool:
    """Whether the stand before a move, or the one after it, is none of a walk.

    One that the recording begins or ends in may have lasted for any time.
    """
    moves, rows = walked.moves, len(readings.time)
    if i == 0 and walked.first == 0:
        return True
    if i + 1 == len(moves) and walked.test[-1] < THRESHOLD:
        return True
    came = moves[i - 1].arrives if i else walked.first
    goes = moves[i + 1].leaves if i + 1 < len(moves) else rows - 1
    longest = max(moves[i].leaves - came, goes - moves[i].arrives)
    return longest * readings.interval > STANDING_S


def _heel(readings: Readings, walked: FootWalk) -> np.ndarray:
    """From the sensor to below the heel, in the sensor, shape (3,) [m]."""
    if walked.axes is None:
        return np.zeros(3)
    pushes = [
        slice(move.leaves - walked.first, int(move.events.terminal) - walked.first)
        for move in walked.moves
        if move.events.pushes_off and np.isfinite(move.events.terminal)
    ]
    rate = readings.uniform.gyr[walked.first :] - walked.track.gyr_bias
    track = walked.track
    return heel_in_sensor(pushes, rate, track.velocity, track.q_world_from_sensor, walked.axes)


def _stride(
    readings: Readings, walked: FootWalk, move: Move, place: np.ndarray, factor: float
) -> Stride:
    begin, end = move.begin - walked.first, move.end - walked.first
    way = place[end] - place[begin]
    length = float(np.hypot(way[0], way[1]))
    sensor = walked.track.position[begin : end + 1]
    line = np.linspace(sensor[0, 2], sensor[-1, 2], len(sensor))
    turn = turn_of(move, walked.track.q_world_from_sensor, walked.first)
    along = way[:2] / max(length, 1e-9)
    rows = np.arange(len(readings.time))
    terminal, initial = np.interp(
        [move.events.terminal, move.events.initial], rows, readings.time
    ).tolist()
    moving = float(readings.time[move.arrives] - readings.time[move.leaves])
    why = ""
    if not np.isfinite(readings.acc[move.begin : move.end + 1]).all():
        why = UNKNOWN_WAY
    elif moving > LONGEST_SWING_S:
        why = NO_STAND
    elif length > FASTEST * moving:
        why = TOO_FAST
    return Stride(
        begin_s=float(readings.time[move.begin]),
        end_s=float(readings.time[move.end]),
        tc_s=terminal,
        ic_s=initial,
        swing_s=initial - terminal,
        length_m=length,
        length_sd_m=factor * float(np.sqrt(along @ move.covariance @ along)),
        rise_m=float(sensor[-1, 2] - sensor[0, 2]),
        clearance_m=float(np.max(sensor[:, 2] - line)),
        turn_deg=float(np.degrees(turn)),
        x_m=float(sensor[-1, 0]),
        y_m=float(sensor[-1, 1]),
        z_m=float(sensor[-1, 2]),
        turning=is_turning(turn),
        counted=not why and not is_turning(turn),
        left_out=why or (TURNING if is_turning(turn) else ""),
    )


def walk_strides(time: np.ndarray, walked: Walk) -> list[Stride]:
    """The gait cycles of the regression.

    Args:
        time: Of each sample, shape (n,) [s].
        walked: What was reckoned from them.
    """
    turns = np.degrees(np.diff(walked.headings, prepend=walked.headings[:1]))
    return [
        Stride(
            begin_s=float(time[walked.cycles.begin[i]]),
            end_s=float(time[walked.cycles.end[i]]),
            stride_time_s=float(time[walked.cycles.end[i]] - time[walked.cycles.begin[i]]),
            length_m=float(walked.lengths[i]),
            turn_deg=float(turns[i]),
            x_m=float(walked.positions[i + 1, 0]),
            y_m=float(walked.positions[i + 1, 1]),
        )
        for i in range(len(walked.cycles))
    ]


def most_in_a_row(strides: Sequence[Stride]) -> int:
    """The largest number of strides between which the walker did not stand.

    Args:
        strides: In order.
    """
    most = row = 0
    end = float("-inf")
    for stride in strides:
        row = row + 1 if stride.begin_s - end < LONGEST_STRIDE_S else 1
        most, end = max(most, row), stride.end_s
    return most


def with_means(own: SensorGait) -> SensorGait:
    """The same with its means, its distance, its cadence and its stance."""
    counted = [stride for stride in own.strides if stride.counted]
    rows = []
    for quantity in QUANTITIES:
        values = np.array([_value(stride, quantity) for stride in counted], dtype=float)
        values = values[np.isfinite(values)]
        if len(values):
            rows.append(row_of(quantity, values))
    times = np.array([stride.stride_time_s for stride in own.strides], dtype=float)
    swings = np.array([s.swing_s / s.stride_time_s for s in counted], dtype=float)
    swings = swings[np.isfinite(swings)]
    times = times[np.isfinite(times)]
    return replace(
        own,
        rows=rows,
        distance_m=float(sum(s.length_m for s in own.strides)),
        # two steps to a stride
        cadence_steps_min=120 / float(times.mean()) if len(times) else float("nan"),
        stance_percent=100 * (1 - float(swings.mean())) if len(swings) else float("nan"),
    )


def row_of(quantity: str, values: np.ndarray) -> GaitRow:
    """A quantity over what counts.

    Args:
        quantity: Its name, with the unit.
        values: One or more, shape (n,).
    """
    return GaitRow(
        quantity=quantity,
        count=len(values),
        mean=float(values.mean()),
        sd=float(values.std(ddof=1)) if len(values) > 1 else float("nan"),
        least=float(values.min()),
        most=float(values.max()),
    )


def _value(stride: Stride, quantity: str) -> Any:
    if quantity == "speed_m_s":
        return stride.length_m / stride.stride_time_s
    return getattr(stride, quantity)


def symmetry(sensors: Sequence[SensorGait]) -> list[SymmetryRow]:
    """Two feet side by side; nothing unless there is one of each side.

    Difference in percent: (left - right) / ((left + right) / 2) 100 (R. O. Robinson, W. Herzog,
    B. M. Nigg: Use of force platform variables to quantify the effects of chiropractic manipulation
    on gait symmetry, J Manipulative Physiol Ther 10(4), 1987).
    """
    sides = {side: [own for own in sensors if own.side == side] for side in ("left", "right")}
    if any(len(own) != 1 or own[0].on != "foot" for own in sides.values()):
        return []
    left, right = ({row.quantity: row.mean for row in own[0].rows} for own in sides.values())
    for own, values in ((sides["left"][0], left), (sides["right"][0], right)):
        values["stance_percent"] = own.stance_percent
    return [
        SymmetryRow(
            quantity=key,
            left=left[key],
            right=right[key],
            difference_percent=200 * (left[key] - right[key]) / (left[key] + right[key]),
        )
        for key in (
            "stride_time_s",
            STEP_TIME,
            DOUBLE_SUPPORT,
            "swing_s",
            "length_m",
            "speed_m_s",
            "clearance_m",
            "stance_percent",
        )
        if key in left and key in right and left[key] + right[key] > 0
    ]
