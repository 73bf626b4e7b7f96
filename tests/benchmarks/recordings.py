"""Recordings whose axes, units and conventions are known to be right: simulated and real ones.

The motion is made here from sums of sines, and what a sensor reads of it by finite differences of
its pose: no formula is shared with the checks that are tried on it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.consistency import Consistency
from testbench.consistency.looked import UNKNOWN_UP, Up
from testbench.formats import FORMATS
from testbench.formats.options import Options
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

GRAVITY = 9.80665


@dataclass(frozen=True)
class Known:
    """A recording without a fault.

    Attributes:
        name: Of it.
        samples: All of them.
        rate: [Hz].
    """

    name: str
    samples: ImuSamples
    rate: float


def of_arrays(
    rate: float,
    gyr: np.ndarray,
    acc: np.ndarray,
    mag: np.ndarray | None = None,
    q: np.ndarray | None = None,
    seconds: np.ndarray | None = None,
) -> ImuSamples:
    """Samples at a rate, or at given times."""
    n = len(gyr)
    time = np.arange(n) / rate if seconds is None else seconds
    ns = np.round(time * 1e9).astype(np.int64)
    return ImuSamples(ns, ns, gyr, acc, mag, q, np.arange(n), np.zeros(n, dtype=bool))


def simulated(seed: int) -> Known:
    """A sensor held in a hand: turns, carrying and rests, with the faults of ordinary parts."""
    rng = np.random.default_rng([29, seed])
    rate = float(rng.choice([25.0, 50.0, 60.0, 100.0, 204.8, 400.0]))
    length = float(rng.uniform(20, 120))
    fine = max(round(400 / rate), 1)
    n = round(length * rate) * fine
    t = np.arange(n) / (rate * fine)
    moving = _moving(t, rng)
    # pose: rotation vectors of sums of sines, one turn after the other, stopped in the rests
    clock = np.cumsum(moving) / (rate * fine)
    angles = _sines(clock, rng, rng.uniform(0.8, 2.5), rng.uniform(0.08, 0.5))
    angles = angles * _ramp(clock)[:, None]
    pose = Rotation.random(random_state=int(rng.integers(2**31))) * Rotation.from_rotvec(angles)
    place = _sines(clock, rng, rng.uniform(0.03, 0.25), rng.uniform(0.2, 1.2))
    lever = rng.normal(0, 0.15, 3)
    place = place + pose.apply(lever)
    dt = t[1] - t[0]
    step = (pose[:-1].inv() * pose[1:]).as_rotvec() / dt
    force = np.gradient(np.gradient(place, dt, axis=0), dt, axis=0) + [0, 0, GRAVITY]
    gyr = np.vstack([step, step[-1:]]).reshape(-1, fine, 3).mean(axis=1)
    acc = pose.inv().apply(force).reshape(-1, fine, 3).mean(axis=1)
    dip = np.radians(rng.uniform(35, 75)) * rng.choice([-1, 1], p=[0.2, 0.8])
    field = rng.uniform(30, 60) * np.array([0, np.cos(dip), -np.sin(dip)])
    middle = slice(fine // 2, None, fine)
    mag = pose[middle].inv().apply(field)
    heading = Rotation.from_euler("z", rng.uniform(-5, 5), degrees=True)
    shake = Rotation.from_rotvec(
        np.radians(rng.uniform(0.2, 2)) * _sines(t[::fine], rng, 1.0, 0.05)
    )
    q = (heading * pose[middle] * shake).as_quat()[:, [3, 0, 1, 2]]
    m = len(gyr)
    gyr = _read(gyr, rng, 0.015, rng.choice([0.2, 1.0, 4.0]) * np.pi / 180, 0.003)
    acc = _read(acc, rng, 0.015, 0.04 * GRAVITY, rng.choice([0.01, 0.05]))
    mag = _read(mag, rng, 0.02, rng.choice([0.5, 3.0]), 0.3)
    jitter = rng.choice([0.0, 0.0, 0.05, 0.2])
    seconds = (np.arange(m) + jitter * rng.uniform(-1, 1, m)) / rate + rng.uniform(0, 100)
    return Known(f"simulated {seed}", of_arrays(rate, gyr, acc, mag, q, seconds), rate)


def _moving(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """How fast the motion goes on, 0 at rest and 1 in motion, with soft changes."""
    pace = np.ones(len(t))
    at = 0.0
    while at < t[-1]:
        rest, move = rng.uniform(1.0, 4.0), rng.uniform(2.0, 12.0)
        pace[(t >= at) & (t < at + rest)] = 0.0
        at += rest + move
    width = max(round(0.3 / (t[1] - t[0])), 1)
    window = np.hanning(width + 2)[1:-1]
    return np.convolve(pace, window / window.sum(), mode="same")


def _sines(t: np.ndarray, rng: np.random.Generator, size: float, frequency: float) -> np.ndarray:
    """Three sums of four sines each, of a usual size and about a frequency."""
    own = frequency * rng.uniform(0.4, 1.6, (4, 3))
    phase = rng.uniform(0, 2 * np.pi, (4, 3))
    weight = size * rng.uniform(0.3, 1.0, (4, 3)) / np.sqrt(2)
    return (weight * np.sin(2 * np.pi * own * t[:, None, None] + phase)).sum(axis=1)


def _ramp(clock: np.ndarray) -> np.ndarray:
    return np.clip(clock / 1.0, 0, 1) ** 2 * (3 - 2 * np.clip(clock / 1.0, 0, 1))


def _read(
    true: np.ndarray, rng: np.random.Generator, scale: float, bias: float, noise: float
) -> np.ndarray:
    matrix = np.eye(3) + np.diag(rng.normal(0, scale, 3)) + rng.normal(0, 0.006, (3, 3))
    return true @ matrix.T + rng.normal(0, bias, 3) + rng.normal(0, noise, true.shape)


def real() -> Iterator[Known]:
    """Recordings of others, where they are to be had."""
    folder = os.environ.get("TESTBENCH_DATA")
    if folder is None:
        return
    for name, load in _loaders(Path(folder)):
        yield from load() if name else ()


def _loaders(folder: Path) -> Iterator[tuple[str, Callable[[], list[Known]]]]:
    for file in sorted((folder / "broad").glob("*.mat")):
        yield file.stem, lambda file=file: _by_format("broad", [file])
    pair = [folder / "imu_tk" / name for name in ("xsens_acc.mat", "xsens_gyro.mat")]
    yield "imu_tk", lambda: _by_format("imu_tk", pair)
    yield "xio_walk", lambda: [_xio(folder / "xio_walk" / "short_walk.csv")]
    yield "gaitmap", lambda: _gaitmap(folder / "gaitmap" / "imu_sample.csv")
    yield "imucal", lambda: [_imucal(folder / "imucal" / "example_ferraris_session.csv")]


def _by_format(name: str, files: list[Path]) -> list[Known]:
    recording = FORMATS[name].read(files, Options())
    found = []
    for key, sensor in recording.sensors.items():
        chunks = list(sensor.chunks)
        joined = {
            field: np.concatenate([getattr(chunk, field) for chunk in chunks])
            for field in ("device_time_ns", "gyr", "acc", "mag")
            if getattr(chunks[0], field) is not None
        }
        samples = of_arrays(
            sensor.rate,
            joined["gyr"],
            joined["acc"],
            joined.get("mag"),
            seconds=joined["device_time_ns"] / 1e9,
        )
        found.append(Known(f"{name} {files[0].stem} {key}", samples, sensor.rate))
    return found


def _xio(file: Path) -> Known:
    data = np.loadtxt(file, delimiter=",", skiprows=1)
    rate = (len(data) - 1) / (data[-1, 0] - data[0, 0])
    gyr, acc = np.radians(data[:, 1:4]), data[:, 4:7] * GRAVITY
    return Known("xio_walk", of_arrays(rate, gyr, acc, seconds=data[:, 0]), rate)


def _gaitmap(file: Path) -> list[Known]:
    titles = np.loadtxt(file, delimiter=",", max_rows=2, dtype=str)
    data = np.loadtxt(file, delimiter=",", skiprows=2)
    found = []
    for side in ("left_sensor", "right_sensor"):
        acc, gyr = (
            data[:, [_column(titles, side, f"{kind}_{axis}") for axis in "xyz"]]
            for kind in ("acc", "gyr")
        )
        found.append(Known(f"gaitmap {side}", of_arrays(204.8, np.radians(gyr), acc), 204.8))
    return found


def _column(titles: np.ndarray, sensor: str, axis: str) -> int:
    return int(np.flatnonzero((titles[0] == sensor) & (titles[1] == axis))[0])


def _imucal(file: Path) -> Known:
    data = np.loadtxt(file, delimiter=",", skiprows=1)
    # it reads half of what it turned; see the mapping imucal_ferraris
    return Known("imucal", of_arrays(204.8, np.radians(2 * data[:, 1:4]), data[:, 4:7]), 204.8)


def check_samples(chunks: Iterable[ImuSamples], up: Up = UNKNOWN_UP) -> list[Finding]:
    """What the quantities of a sensor say of one another, without a truth.

    Args:
        chunks: All its samples in the order of time, in the units of a session.
        up: What is known of the vertical beside them.
    """
    seen = Consistency()
    for chunk in chunks:
        seen.look(chunk)
    return seen.findings(up)
