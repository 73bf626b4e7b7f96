"""A pendulum of two segments, and a stick held in the hand, by kinematics of their own.

Each segment carries a sensor; everything is exported as a foreign laboratory would: the samples in
a file a sensor, the orientations of all bodies in another, in a world, on a clock and with
mountings that nobody knows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

RATE, TRUTH_RATE, FINE = 50.0, 25.0, 500.0
DRIFT_PPM = 100.0
GRAVITY_UP = np.array([0.0, 0.0, 9.80665])


@dataclass
class Segment:
    """One body and its sensor.

    Attributes:
        level_from_body: Orientations at `FINE` Hz in a world whose z points up.
        position: Of the sensor in that world, shape (n, 3) [m].
        body_from_sensor: The mounting.
    """

    level_from_body: Rotation
    position: np.ndarray
    body_from_sensor: Rotation


@dataclass
class Scene:
    """What was recorded.

    Attributes:
        time: Shape (n,) [s].
        segments: By name.
        world_from_level: Of the reference system.
        apart: How much later the reference began than the sensors [s].
    """

    time: np.ndarray
    segments: dict[str, Segment]
    world_from_level: Rotation
    apart: float
    gyr_noise: float = 0.003
    columns: dict[str, np.ndarray] = field(default_factory=dict)


def waves(rng: np.random.Generator, time: np.ndarray, size: float, most_hz: float) -> np.ndarray:
    """A smooth irregular motion with rests, shape (n,)."""
    total = sum(
        rng.uniform(0.3, 1.0) * np.sin(2 * np.pi * (f * time + rng.random()))
        for f in rng.uniform(0.1, most_hz, 6)
    )
    knots = np.arange(time[0] - 5, time[-1] + 10, 5.0)
    allowed = np.clip(rng.uniform(-0.5, 1.6, len(knots)), 0, 1)
    allowed[knots < time[0] + 4] = 0
    envelope = np.interp(time, knots, allowed)
    width = int(FINE)
    envelope = np.convolve(np.pad(envelope, width, mode="edge"), np.ones(width) / width, "same")
    return size * total * envelope[width:-width] / 2


def pendulum(seed: int, seconds: float = 130.0) -> Scene:
    """Two segments that swing about level, parallel hinges: all motion is about one axis."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / FINE)
    hinge = Rotation.from_euler("Z", rng.uniform(-3, 3)).apply([1.0, 0.0, 0.0])
    first, second = waves(rng, time, 0.8, 0.4), waves(rng, time, 0.8, 0.4)
    upper = Rotation.from_rotvec(np.outer(first, hinge))
    lower = Rotation.from_rotvec(np.outer(first + second, hinge))
    elbow = upper.apply([0.0, 0.0, -0.4])
    segments = {
        "upper": Segment(upper, upper.apply([0.02, 0.0, -0.2]), Rotation.random(rng=rng)),
        "lower": Segment(lower, elbow + lower.apply([0.02, 0.0, -0.25]), Rotation.random(rng=rng)),
    }
    return Scene(time, segments, Rotation.random(rng=rng), 60.0)


def stick(seed: int, seconds: float = 130.0) -> Scene:
    """Two sticks with a ball joint between them, turned by hand about every axis."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / FINE)

    def turned() -> Rotation:
        angles = np.column_stack([waves(rng, time, size, 0.6) for size in (0.8, 0.6, 0.7)])
        return Rotation.from_euler("ZYX", angles)

    upper = turned()
    lower = upper * turned()
    joint = upper.apply([0.0, 0.0, -0.3])
    segments = {
        "upper": Segment(upper, upper.apply([0.0, 0.01, -0.1]), Rotation.random(rng=rng)),
        "lower": Segment(lower, joint + lower.apply([0.0, 0.01, -0.2]), Rotation.random(rng=rng)),
    }
    return Scene(time, segments, Rotation.random(rng=rng), 60.0)


def readings(scene: Scene, name: str, seed: int) -> dict[str, np.ndarray]:
    """What a sensor that integrates reads, on its own clock; `t` begins with its log."""
    rng = np.random.default_rng(seed)
    segment, step = scene.segments[name], round(FINE / RATE)
    rows = np.arange(0, len(scene.time), step)
    q = segment.level_from_body[rows] * segment.body_from_sensor
    turned, rows = q[:-1].inv() * q[1:], rows[1:]
    gyr = turned.as_rotvec() * RATE
    acceleration = np.gradient(np.gradient(segment.position, axis=0), axis=0) * FINE**2
    acc = q[1:].inv().apply(acceleration[rows] + GRAVITY_UP)
    gyr += scene.gyr_noise * rng.standard_normal(gyr.shape) + 0.001 * rng.standard_normal(3)
    acc += 0.03 * rng.standard_normal(acc.shape) + 0.02 * rng.standard_normal(3)
    return {"t": scene.time[rows] * (1 + 1e-6 * DRIFT_PPM), "gyr": gyr, "acc": acc}


def reference(scene: Scene, seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times of the reference system, from its own beginning, and q_world_from_body by name."""
    rng = np.random.default_rng(seed)
    step = round(FINE / TRUTH_RATE)
    rows = np.arange(round(scene.apart * FINE), len(scene.time), step)
    result = {}
    for name, segment in scene.segments.items():
        noise = Rotation.from_rotvec(np.radians(0.05) * rng.standard_normal((len(rows), 3)))
        q = scene.world_from_level * segment.level_from_body[rows] * noise
        result[name] = q.as_quat(scalar_first=True)
    return scene.time[rows] - scene.time[rows[0]], result


def export(scene: Scene, folder: Path, seed: int = 0, more: str = "") -> tuple[Path, list[Path]]:
    """Write a scene as CSV, and the mapping that says what its columns are."""
    folder.mkdir(parents=True, exist_ok=True)
    time, orientations = reference(scene, seed)
    write_orientations(folder / "optical.csv", time, orientations)
    files, sensors = [], []
    for i, name in enumerate(scene.segments):
        read = readings(scene, name, 10 * seed + i)
        table = np.column_stack([read["t"], read["acc"], read["gyr"]])
        files.append(folder / f"imu_{name}.csv")
        write_csv(files[-1], "t,ax,ay,az,gx,gy,gz", table)
        columns = ", ".join(f"{name}_q{part}" for part in "wxyz")
        sensors.append(
            f"  {name}:\n    file: 'imu_{name}.csv'\n"
            "    acc: {columns: [ax, ay, az], unit: m/s^2}\n"
            "    gyr: {columns: [gx, gy, gz], unit: rad/s}\n"
            f"    truth: {{file: optical.csv, columns: [{columns}], order: wxyz, "
            f"time: {{column: time_s, unit: s}}{more}}}\n"
        )
    mapping = folder / "map.yaml"
    mapping.write_text(
        "description: two segments\ntime: {column: t, unit: s}\nsensors:\n" + "".join(sensors)
    )
    return mapping, files


def write_orientations(file: Path, time: np.ndarray, orientations: dict[str, np.ndarray]) -> None:
    """A table of the reference system's orientations."""
    titles = ["time_s", *(f"{name}_q{part}" for name in orientations for part in "wxyz")]
    write_csv(file, ",".join(titles), np.column_stack([time, *orientations.values()]))


def write_csv(file: Path, titles: str, table: np.ndarray) -> None:
    """A comma-separated table with titles; NaN stays empty."""
    lines = [titles] + [
        ",".join("" if np.isnan(value) else f"{value:.7g}" for value in row) for row in table
    ]
    file.write_text("\n".join(lines) + "\n")
