"""Samples a second of every orientation filter, beside another implementation of the same method
where there is one.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import ahrs
import imufusion
import numpy as np
from vqf import VQF, offlineVQF

from testbench.estimation.filters import FILTERS, UniformSamples
from testbench.estimation.filters.kernel_filter import KernelFilter
from testbench.model import rotation
from tests.benchmarks.timing import Text, duration, once, rate, ratio, seconds, show

SAMPLES = 100_000
PEER_SAMPLES = 5_000
"""The ahrs package takes 50 to 90 us a sample: it gets fewer, and its rate is what is compared."""
INTERVAL = 0.01


@dataclass(frozen=True)
class Peer:
    """Another implementation: what it is, how many samples it is given, and the call."""

    name: str
    samples: int
    call: Callable[[UniformSamples], object]


def bench_filters() -> None:
    """Time every filter of the bench on the same samples."""
    samples = moving_sensor(SAMPLES)
    rows: list[list[str | Text]] = []
    for name, kind in FILTERS.items():
        if kind.needs == ("device_q",):
            continue  # hands on what the device computed
        ours = seconds(lambda kind=kind: kind().run(samples)) / SAMPLES
        peer = PEERS.get(name)
        if peer is None:
            rows.append([Text(name), rate(1 / ours), Text("-"), "-", "-"])
            continue
        given = cut(samples, peer.samples)
        # A loop in Python is as fast the first time as the third; compiled calls are short enough
        # to repeat.
        slow = peer.samples < SAMPLES
        call = partial(peer.call, given)
        theirs = (once(call)[0] if slow else seconds(call)) / peer.samples
        rows.append(
            [Text(name), rate(1 / ours), Text(peer.name), rate(1 / theirs), ratio(ours, theirs)]
        )
    show(
        f"Filters: {SAMPLES:,} samples (the ahrs package: {PEER_SAMPLES:,})",
        ["filter", "samples", "peer", "samples", "ours : peer"],
        rows,
        "vqf called directly is the same compiled code: a ratio of 1 means that the bench adds "
        "nothing to it.",
    )
    first_call()


def first_call() -> None:
    """Processor time of a new process that imports, loads compiled code from disk and filters 100
    samples.
    """
    code = (
        "import time\n"
        "import numpy as np\n"
        "from testbench.estimation.filters import UniformSamples, get_filter\n"
        "x = np.ones((100, 3)); get_filter({!r}).run(UniformSamples(0.01, x, x, x + [1, 0, 0]))\n"
        "print(time.process_time())"
    )
    rows: list[list[str | Text]] = []
    for name, kind in FILTERS.items():
        if issubclass(kind, KernelFilter):
            run = [sys.executable, "-c", code.format(name)]
            times = [
                float(subprocess.run(run, check=True, capture_output=True, text=True).stdout)
                for _ in range(2)
            ]
            rows.append([Text(name), duration(min(times))])
    show(
        "Filters: first call in a new process, warm cache",
        ["filter", "processor time"],
        rows,
        "target: below 2 s",
    )


def moving_sensor(n: int) -> UniformSamples:
    """A sensor that turns smoothly about all axes in a uniform field, with white noise."""
    t = INTERVAL * np.arange(n + 1)
    angles = np.column_stack(
        [1.2 * np.sin(0.7 * t), 0.8 * np.sin(1.1 * t + 1), 1.5 * np.sin(0.4 * t + 2)]
    )
    q = rotation.from_euler("ZYX", angles)
    step = rotation.multiply(rotation.conjugate(q[:-1]), q[1:])
    q, rng = q[1:], np.random.default_rng(0)

    def seen(vector: list[float], noise: float) -> np.ndarray:
        return rotation.rotate(
            rotation.conjugate(q), np.array(vector)
        ) + noise * rng.standard_normal((n, 3))

    gyr = 2 * step[:, 1:] * np.sign(step[:, :1]) / INTERVAL + 0.002 * rng.standard_normal((n, 3))
    return UniformSamples(INTERVAL, gyr, seen([0, 0, 9.81], 0.02), seen([0, 24, -39], 0.1), q)


def cut(samples: UniformSamples, n: int) -> UniformSamples:
    """The first n samples."""
    assert samples.mag is not None
    return UniformSamples(samples.interval, samples.gyr[:n], samples.acc[:n], samples.mag[:n])


def _ahrs(kind: type, magnetometer: bool) -> Peer:
    def call(s: UniformSamples) -> object:
        return kind(
            gyr=s.gyr, acc=s.acc, mag=s.mag if magnetometer else None, frequency=1 / s.interval
        )

    return Peer(f"ahrs {kind.__name__}", PEER_SAMPLES, call)


def _ahrs_rates() -> Peer:
    return Peer(
        "ahrs AngularRate",
        PEER_SAMPLES,
        lambda s: ahrs.filters.AngularRate(gyr=s.gyr, frequency=1 / s.interval),
    )


def _ahrs_pairs(kind: type) -> Peer:
    names = ("w1", "w2") if kind is ahrs.filters.TRIAD else ("acc", "mag")
    return Peer(
        f"ahrs {kind.__name__}",
        PEER_SAMPLES,
        lambda s: kind(**dict(zip(names, (s.acc, s.mag), strict=True))),
    )


def fusion_loop(samples: UniformSamples, magnetometer: bool) -> np.ndarray:
    """What a user of the package writes."""
    ahrs_, q = imufusion.Ahrs(), np.empty((len(samples), 4))
    gyr, acc, mag = np.degrees(samples.gyr), samples.acc / 9.80665, samples.mag
    assert mag is not None
    for i in range(len(samples)):
        if magnetometer:
            ahrs_.update(gyr[i], acc[i], mag[i])
        else:
            ahrs_.update_no_magnetometer(gyr[i], acc[i])
        q[i] = ahrs_.get_quaternion()
    return q


PEERS = {
    "vqf_6d": Peer("vqf directly", SAMPLES, lambda s: VQF(s.interval).updateBatch(s.gyr, s.acc)),
    "vqf_9d": Peer(
        "vqf directly", SAMPLES, lambda s: VQF(s.interval).updateBatch(s.gyr, s.acc, s.mag)
    ),
    "vqf_offline": Peer(
        "vqf directly", SAMPLES, lambda s: offlineVQF(s.gyr, s.acc, s.mag, s.interval)
    ),
    "madgwick_imu": _ahrs(ahrs.filters.Madgwick, False),
    "madgwick_marg": _ahrs(ahrs.filters.Madgwick, True),
    "mahony_imu": _ahrs(ahrs.filters.Mahony, False),
    "mahony_marg": _ahrs(ahrs.filters.Mahony, True),
    "gyro": _ahrs_rates(),
    "complementary": _ahrs(ahrs.filters.AQUA, False),
    "complementary_marg": _ahrs(ahrs.filters.AQUA, True),
    "ekf_imu": _ahrs(ahrs.filters.EKF, False),
    "ekf": _ahrs(ahrs.filters.EKF, True),
    "triad": _ahrs_pairs(ahrs.filters.TRIAD),
    "quest": _ahrs_pairs(ahrs.filters.QUEST),
    "tilt": _ahrs_pairs(ahrs.filters.Tilt),
    "fusion": Peer("imufusion, own loop", SAMPLES, lambda s: fusion_loop(s, False)),
    "fusion_9d": Peer("imufusion, own loop", SAMPLES, lambda s: fusion_loop(s, True)),
}
