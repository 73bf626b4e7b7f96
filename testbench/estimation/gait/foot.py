"""A walk by a sensor on the foot: zero velocities, the way between them, strides, events."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.gait.events import (
    STRAIGHT,
    Events,
    FootAxes,
    events_of,
    foot_axes,
)
from testbench.estimation.gait.readings import Readings
from testbench.estimation.gait.strapdown import Known, Track, navigate, rows_of
from testbench.estimation.gait.zero_velocity import stances, still_test
from testbench.model import rotation

STILL_SD = 0.01
"""Of the velocity of a standing foot's sensor [m/s]."""
ROLLS_OVER = 0.1
"""A standing foot that turns moves the sensor as if it lay so far from where it touches [m]."""
TOGETHER_S = 0.01
"""Zero velocities of neighbouring samples err alike for this long."""
REST_RATE_SD, REST_TOGETHER_S = np.radians(0.3), 0.05
"""Of "it does not turn" at rest [rad/s], and for how long neighbours err alike [s]."""
BIAS_SD, UNKNOWN_BIAS_SD = np.radians(0.1), np.radians(1.0)
"""Of the gyroscope's bias where there was a rest, and where there was none [rad/s]."""
LONG_S = 0.5
"""A stance longer than this is no moment of the swing."""
LEAST_STRIDE = 0.1
"""A foot that comes to stand nearer than this to where it stood has not walked [m]."""
LONGEST_SWING_S = 3.0
"""No swing lasts longer: over a longer time without a stand the way is not known."""
SET_DOWN = np.radians(45.0)
"""See `_joined`."""
HEIGHT_SD = 0.01
"""Of "all stands are equally high" [m]: floors are that even, and soles yield."""
LEVEL_MEDIAN, LEVEL_MOST, LEVEL_STRIDES = 0.03, 0.06, 4
"""A floor is level where so many strides rise or fall by no more than this part of their length:
half of them, and nine of ten. A step of stairs does so by half, a ramp for wheelchairs by .08.
"""


@dataclass(frozen=True)
class Move:
    """From one stand of the foot to the next.

    Attributes:
        begin: Row at which it stood before.
        end: Row at which it stood after.
        leaves: Last row of the stand before.
        arrives: First row of the stand after.
        events: In rows of the recording.
        covariance: Of the way, shape (2, 2), on the ground [m^2].
        set_down: Times that the foot was set down between, in a turn.
    """

    begin: int
    end: int
    leaves: int
    arrives: int
    events: Events
    covariance: np.ndarray
    set_down: int = 0


@dataclass(frozen=True)
class FootWalk:
    """What a sensor on a foot says of a walk.

    Attributes:
        first: Row at which the way begins, in the first stand.
        last: Row at which it ends, in the last one.
        track: Where it went, from `first` to the end of the recording.
        test: Statistic of the zero velocity, shape (n,).
        moves: Strides, in order.
        axes: Of the foot; None where it never went straight.
        toe_down: Rate about the foot's left axis, shape (n,) [rad/s]; NaN without axes.
        level: Whether all stands were taken for equally high.
    """

    first: int
    last: int
    track: Track
    test: np.ndarray
    moves: list[Move]
    axes: FootAxes | None
    toe_down: np.ndarray
    level: bool


def walk_on_foot(readings: Readings, level: bool | None = None) -> FootWalk | None:
    """Reckon the way of a sensor on a foot.

    Args:
        readings: Of the sensor.
        level: Whether all stands are equally high; found by their rise if None.

    Returns:
        None where the foot never stands.
    """
    test = still_test(readings.rate, readings.acc, readings.interval)
    stands = stances(test, readings.interval)
    if not len(stands):
        return None
    anchors = np.array([begin + int(np.argmin(test[begin:end])) for begin, end in stands])
    rows = _rows(readings, test, stands, anchors)
    track, kept = _track(readings, rows, stands)
    if level is None:
        level = _is_level(track.position[anchors[kept] - stands[0, 0]])
    if level:
        rows[anchors[kept], 10] = HEIGHT_SD
        track, kept = _track(readings, rows, stands)
    return _walk(readings, test, stands, anchors, (track, kept), level)


def stance_sd(rate: np.ndarray, interval: float) -> np.ndarray:
    """Standard uncertainty of a zero velocity, by how fast the foot rolls over, shape (n,) [m/s].

    Args:
        rate: Angular rate, shape (n, 3) [rad/s].
        interval: Between samples [s].
    """
    of_one = STILL_SD**2 + (ROLLS_OVER * rotation.lengths(rate)) ** 2
    return np.asarray(np.sqrt(of_one * max(TOGETHER_S / interval, 1.0)))


def _rows(
    readings: Readings, test: np.ndarray, stands: np.ndarray, anchors: np.ndarray
) -> np.ndarray:
    """All that the navigation takes, shape (n, k); see `rows_of`."""
    count, interval = len(test), readings.interval
    velocity, begins = np.zeros(count), np.zeros(count)
    turns, anchor = np.zeros(count), np.zeros(count, dtype=bool)
    sd = stance_sd(readings.rate, interval)
    for begin, end in stands:
        velocity[begin:end] = sd[begin:end]
        begins[begin] = 2 if (end - begin) * interval > LONG_S else 1
    for begin, end in readings.rests:
        turns[begin:end] = REST_RATE_SD * np.sqrt(max(REST_TOGETHER_S / interval, 1.0))
    anchor[anchors] = True
    known = Known(velocity, begins, turns, np.zeros(count), anchor)
    return rows_of(readings.uniform.gyr, readings.acc, readings.uniform.steps(), known)


def _track(readings: Readings, rows: np.ndarray, stands: np.ndarray) -> tuple[Track, np.ndarray]:
    """The way from the first stand on, and which stands were not refused, shape (k,), bool."""
    begin, end = stands[0]
    force = np.nanmean(readings.acc[begin:end], axis=0)
    bias_sd = BIAS_SD if len(readings.rests) else UNKNOWN_BIAS_SD
    track = navigate(rows[begin:], force, readings.bias, bias_sd)
    return track, ~track.refused[stands[:, 0] - begin]


def _is_level(places: np.ndarray) -> bool:
    """Whether a floor is level, by where the foot stood, shape (k, 3) [m]."""
    moves = np.diff(places, axis=0)
    length = rotation.lengths(moves * [1.0, 1.0, 0.0])
    strides = length > LEAST_STRIDE
    if strides.sum() < LEVEL_STRIDES:
        return False
    slope = np.abs(moves[strides, 2]) / length[strides]
    return bool(np.median(slope) < LEVEL_MEDIAN and np.quantile(slope, 0.9) < LEVEL_MOST)


# One piece: stands become moves, and these get their events by axes that all of them give.
def _walk(
    readings: Readings,
    test: np.ndarray,
    stands: np.ndarray,
    anchors: np.ndarray,
    found: tuple[Track, np.ndarray],
    level: bool,
) -> FootWalk:
    track, kept = found
    first = int(stands[0, 0])
    covariances = track.stride_covariance
    stands, anchors = stands[kept], anchors[kept]
    of_kept = np.cumsum(kept) - 1
    sums = np.zeros((len(stands), 2, 2))
    for i, covariance in enumerate(covariances):
        sums[min(of_kept[i] + int(not kept[i]), len(stands) - 1)] += covariance[:2, :2]
    place = track.position[anchors - first]
    pairs, at, extra = [], 0, np.zeros((2, 2))
    for i in range(1, len(anchors)):
        extra = extra + sums[i]
        if np.hypot(*(place[i] - place[at])[:2]) < LEAST_STRIDE:
            at, extra = i, np.zeros((2, 2))  # it stands on; what it fidgeted is no stride
            continue
        pairs.append((at, i, extra))
        at, extra = i, np.zeros((2, 2))
    q = track.q_world_from_sensor
    rate = readings.uniform.gyr[first:] - track.gyr_bias
    begin, end = (np.array([anchors[pair[j]] - first for pair in pairs], int) for j in (0, 1))
    axes = (
        foot_axes(track.position[end] - track.position[begin], q[begin], q[end]) if pairs else None
    )
    toe_down = np.full(len(test), np.nan)
    if axes is None:
        return FootWalk(first, int(anchors[-1]), track, test, [], None, toe_down, level)
    toe_down[first:] = rate @ axes.left
    moves = []
    for before, after, covariance in pairs:
        leaves, arrives = int(stands[before, 1]) - 1, int(stands[after, 0])
        events = _events(track, toe_down[first:], axes, (leaves - first, arrives - first))
        events = Events(
            events.terminal + leaves,
            events.initial + leaves,
            events.heel_strikes,
            events.pushes_off,
        )
        place_of = int(anchors[before]), int(anchors[after]), leaves, arrives
        moves.append(Move(*place_of, events, covariance))
    moves = _joined(moves, q, first)
    return FootWalk(first, int(anchors[-1]), track, test, moves, axes, toe_down, level)


def _events(track: Track, toe_down: np.ndarray, axes: FootAxes, rows: tuple[int, int]) -> Events:
    """Events between the last row of a stand and the first of the next, counted from the former."""
    part = slice(rows[0], max(rows[1], rows[0] + 2) + 1)
    q = track.q_world_from_sensor[part]
    ahead = rotation.rotate(q, np.tile(axes.forward, (len(q), 1)))
    elevation = np.arcsin(np.clip(ahead[:, 2], -1, 1))
    way = track.position[rows[1]] - track.position[rows[0]]
    length = float(np.hypot(way[0], way[1]))
    speed = track.velocity[part][:, :2] @ (way[:2] / max(length, 1e-9))
    return events_of(toe_down[part], elevation - elevation[0], speed)


def _joined(moves: list[Move], q_world_from_sensor: np.ndarray, first: int) -> list[Move]:
    """In a turn on the spot a foot is set down flat and taken up flat, between the push-off before
    and the heel strike after: that is one stride, not two.

    Args:
        moves: In order.
        q_world_from_sensor: From `first` on, shape (n, 4).
        first: Row of its first.
    """
    found: list[Move] = []
    for move in moves:
        before = found[-1] if found else None
        if (
            before is not None
            and before.end == move.begin
            and not before.events.heel_strikes
            and not move.events.pushes_off
            and all(
                abs(turn_of(own, q_world_from_sensor, first)) > SET_DOWN for own in (before, move)
            )
        ):
            events = Events(
                before.events.terminal,
                move.events.initial,
                move.events.heel_strikes,
                before.events.pushes_off,
            )
            covariance = before.covariance + move.covariance
            found[-1] = replace(
                before,
                end=move.end,
                arrives=move.arrives,
                events=events,
                covariance=covariance,
                set_down=before.set_down + 1,
            )
        else:
            found.append(move)
    return found


def turn_of(move: Move, q_world_from_sensor: np.ndarray, first: int) -> float:
    """By how much the foot turns about the vertical, anticlockwise [rad].

    Args:
        move: From stand to stand.
        q_world_from_sensor: From `first` on, shape (n, 4).
        first: Row of its first.
    """
    q = q_world_from_sensor[[move.begin - first, move.end - first]]
    turned = rotation.multiply(q[1:], rotation.conjugate(q[:1]))
    return float(rotation.heading_angle(turned)[0])


def is_turning(turn: float) -> bool:
    """Whether a stride is no straight one.

    Args:
        turn: Of the foot [rad].
    """
    return abs(turn) > STRAIGHT
