"""Stretches in which a truth and a gyroscope slowly part, though both turn alike elsewhere.

A body that slips under its markers, a reference that drifts, a gyroscope that was clipped before a
low pass, or disturbed: none of them jumps, and each puts an error into all that is judged from
there on. Seen by rates alone it is nobody's fault in particular: both are named. What lasts from
beginning to end is not told from a bias.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.signals.truth_turning import Turning
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.truth import truth_at
from testbench.model.windows import moving_mean
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

OVER_S = 0.05
"""Rates are compared as means over so long [s]."""
FEWEST = 100
"""Intervals that a fit of rates to rates needs: twelve numbers in each axis' equations."""
ROUNDS, KEPT = 3, 0.8
"""The fit is made so many times, again to the part of the intervals that fitted best [1]."""
BLOCK_S = 2.0
"""The bias is told from sums over so long, in which what either is late by averages out [s]."""
SPANS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
"""Over so long it is asked whether both part [s]."""
SETTLED_S = 1.0
"""What either is late by, or rings, has gone after so long [s]."""
LEAST = np.radians(5.0)
"""Both part who are so far from one another afterwards [rad]."""
DRIFT = np.radians(0.1)
"""What a bias may wander by [rad/s]: a tenth of a degree per second is the g-sensitivity and the
warming of a consumer part (TDK ICM-20948, DS-000189: 0.1 deg/s/g typical of its kind).
"""
NONLINEAR = 0.003
"""Part of its path by which a gyroscope's turn is wrong beyond any linear map [1]: data sheets give
0.1 to 0.2 % of full scale (TDK MPU-6050, PS-MPU-6000A-00, 6.1: 0.2 %).
"""
USUAL = 3.0
"""A change counts that is so many times the median one over the same span."""


@dataclass(frozen=True)
class Parting:
    """A stretch in which both part.

    Attributes:
        angle: How far [rad].
        begin_ns: On the host's clock.
        end_ns: Likewise.
    """

    angle: float
    begin_ns: int
    end_ns: int


def parting_finding(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> list[Finding]:
    """The finding on where truth and gyroscope part most; empty where they do not.

    Args:
        samples: Of the sensor, with mean rates.
        time_ns: Instants that its rates are of, increasing, shape (n,) [ns].
        truth: Without its steps.
    """
    found = find_parting(samples, time_ns, truth)
    if found is None:
        return []
    # told on the times of the samples as they were read, by which a person finds the stretch
    ends = np.interp([found.begin_ns, found.end_ns], time_ns, samples.host_time_ns) / NANOSECONDS
    angle_deg = float(np.degrees(found.angle))
    return [
        finding("truth.parts", angle_deg=angle_deg, begin_s=float(ends[0]), end_s=float(ends[1]))
    ]


def find_parting(samples: ImuSamples, time_ns: np.ndarray, truth: Truth) -> Parting | None:
    """Where truth and gyroscope part most, or None.

    The truth's rate in the body is fitted by a linear map of what the gyroscope reads, which takes
    mounting, scale, cross-axis errors and bias; what that turns is held against the truth. Over
    each span both must turn alike.

    Args:
        samples: Of the sensor, with mean rates.
        time_ns: Instants that its rates are of, increasing, shape (n,) [ns].
        truth: Without its steps.
    """
    known = np.isfinite(samples.gyr).all(axis=1)
    if known.sum() < FEWEST:
        return None
    step = median_interval(time_ns) / NANOSECONDS
    count = max(round(OVER_S / max(step, 1e-6)) // 2 * 2 + 1, 1)
    gyr = np.where(known[:, None], samples.gyr, 0.0)
    mean, whole = moving_mean(gyr, count), moving_mean(known, count) > 0.999
    rows = np.arange(count // 2, len(gyr), count)
    rate, sound = true_rates(replace(truth, rate=None), time_ns[rows], count * step)
    sound &= whole[rows]
    if sound.sum() < FEWEST:
        return None
    fitted = _map(rate[sound], mean[rows[sound]])
    turned = Turning.of(np.column_stack([gyr, np.ones(len(gyr))]) @ fitted, time_ns)
    q = truth_at(truth, time_ns[rows])
    both = sound & np.isfinite(q[:, 0])
    rows, q = rows[both], q[both]
    # what turns the gyroscope's world to the truth's, and how that turns from one to the next
    apart = rotation.multiply(q, rotation.conjugate(turned.q[rows]))
    changes = rotation.multiply(apart[1:], rotation.conjugate(apart[:-1]))
    changes = rotation.to_rotation_vector(changes)
    changes[np.diff(rows) > count] = 0.0
    changes -= _by_bias(changes, rotation.to_matrix(q[1:]), count * step)
    path = turned.slow_path[rows[1:]]
    return _widest(np.cumsum(changes, axis=0), path, time_ns[rows[1:]], count * step)


def _by_bias(changes: np.ndarray, body: np.ndarray, width: float) -> np.ndarray:
    """What of some changes a bias makes that the fit of rates left, shape (n, 3) [rad].

    Args:
        changes: Of both worlds against one another, shape (n, 3) [rad].
        body: How the sensor's body lies in the world, shape (n, 3, 3).
        width: Of an interval [s].
    """
    block = max(round(BLOCK_S / width), 1)
    starts = np.arange(0, len(changes) - block + 1, block)
    summed = np.add.reduceat(changes, starts, axis=0)
    turned = np.add.reduceat(body, starts, axis=0) * width
    kept = np.ones(len(starts), dtype=bool)
    bias: np.ndarray = np.zeros(3)
    for _ in range(ROUNDS):
        bias = np.linalg.lstsq(turned[kept].reshape(-1, 3), summed[kept].ravel(), rcond=1e-3)[0]
        size = rotation.lengths(summed - turned @ bias)
        kept = size <= np.quantile(size, KEPT)
    return np.asarray(body @ bias * width)


def _map(rate: np.ndarray, read: np.ndarray) -> np.ndarray:
    """The linear map that makes true rates of readings and 1, shape (4, 3).

    Args:
        rate: In the body, shape (n, 3) [rad/s].
        read: By the gyroscope, shape (n, 3) [rad/s].
    """
    design = np.column_stack([read, np.ones(len(read))])
    kept = np.ones(len(read), dtype=bool)
    fitted: np.ndarray = np.zeros((4, 3))
    for _ in range(ROUNDS):
        fitted = np.linalg.lstsq(design[kept], rate[kept], rcond=1e-3)[0]
        size = rotation.lengths(rate - design @ fitted)
        kept = size <= np.quantile(size, KEPT)
    return np.asarray(fitted)


def _widest(
    apart: np.ndarray, path: np.ndarray, time_ns: np.ndarray, width: float
) -> Parting | None:
    """The change that stands out most, over the shortest span that holds most of it.

    Args:
        apart: How far both are from one another, shape (n, 3) [rad].
        path: That the gyroscope has turned since the beginning, shape (n,) [rad].
        time_ns: Increasing, shape (n,) [ns].
        width: Of an interval [s].
    """
    settled = max(round(SETTLED_S / width) // 2 * 2 + 1, 1)
    smooth = moving_mean(apart, settled, "held")
    best: Parting | None = None
    for seconds in SPANS_S:
        span = round(seconds / width) + settled
        if span >= len(smooth) // 2:
            break
        change = rotation.lengths(smooth[span:] - smooth[:-span])
        lasted = (time_ns[span:] - time_ns[:-span]) / NANOSECONDS
        change[lasted > 1.2 * span * width + 1.0] = 0.0  # a gap lies in between
        allowed = LEAST + DRIFT * seconds + NONLINEAR * (path[span:] - path[:-span])
        allowed = np.maximum(allowed, USUAL * float(np.median(change)))
        change[change < allowed] = 0.0
        at = int(np.argmax(change))
        if not change[at] > 0:
            continue
        if best is None or change[at] > 1.25 * best.angle:
            inner = settled // 2
            begin, end = time_ns[at + inner], time_ns[at + span - inner]
            best = Parting(float(change[at]), int(begin), int(end))
    return best
