"""A person who stands and walks with a sensor on pelvis, thigh, shank and foot, by kinematics of
their own: exported as a foreign laboratory would, with the segments' true orientations beside.

Nobody stands as anatomy has it, knees turn about axes of their own, and sensors lie on skin: each
segment is off by `POSTURE_DEG` while standing, the axis of the knee by as much, each sensor by
`SKIN_DEG` and `SKIN_MM` from where it was meant to be.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

RATE, FINE = 60.0, 240.0
POSTURE_DEG, SKIN_DEG, SKIN_MM = 2.0, 3.0, 10.0
LINKS = {"pelvis": "pelvis", "thigh": "thigh_r", "shank": "shank_r", "foot": "foot_r"}
"""Of the shipped robot lower_limb, whose links have x forward, y to the left, z up."""
LINK_FROM_SEGMENT = Rotation.from_euler("X", 90, degrees=True)
HIP = {"segment": [0.0, -0.1, 0.09], "link": [0.0, -0.0882, 0.0]}
"""Centre of the hip in the pelvis of this person, and in that of lower_limb [m]."""
STANDS_S = 3.0
BEGAN_S = 1.7e9
"""Unix time of the first instant [s]: the sensors are on one clock."""
SPEED = 1.2
"""Of walking across a room [m/s]."""
UP = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([5.0, 21.0, -38.0])
SEGMENTS = ("pelvis", "thigh", "shank", "foot")
LENGTHS = {"thigh": 0.42, "shank": 0.41}
SENSORS = {
    "pelvis": [-0.09, 0.05, 0.0],
    "thigh": [0.03, -0.2, 0.07],
    "shank": [0.02, -0.15, 0.05],
    "foot": [0.06, 0.01, 0.0],
}
"""Where each sensor is meant to be, from the segment's upper end, in its axes (x forward, y up, z
right) [m]."""
# flexion, adduction, rotation of hip and ankle and flexion of the knee: mean, and amplitude [deg]
# and phase [deg] of the harmonics of a stride (Perry & Burnfield 2010, Kadaba et al. 1990)
GAIT = {
    "hip": [
        (6.2, [(21, 97), (5.7, 258), (1.2, 307)]),
        (0.0, [(5, 350), (2, 40)]),
        (0.0, [(4, 20), (1.5, 200)]),
    ],
    "knee": [(-21.2, [(-20.7, 190), (-12.9, 303), (-3.7, 1)])],
    "ankle": [
        (-0.9, [(5.2, 342), (6.7, 163), (2.4, 300)]),
        (1.0, [(3, 200), (2, 100)]),
        (-2.0, [(4, 150), (1.5, 30)]),
    ],
}
PELVIS = [(0.0, [(0, 0), (1.5, 60)]), (0.0, [(4, 20), (1, 90)]), (0.0, [(4, 110)])]
NOISE = {"gyr": 0.002, "acc": 0.03, "mag": 0.3}
BIAS = {"gyr": 0.002, "acc": 0.03, "mag": 0.3}


@dataclass
class Walk:
    """What was recorded.

    Attributes:
        time: Shape (n,) [s], at `RATE`.
        truth: q_world_from_segment by segment, shape (n, 4).
        nominal: Segment from sensor, as it was meant to be, by segment.
        readings: Specific force [m/s^2], angular rate [rad/s] and field [uT], shape (n, 9).
    """

    time: np.ndarray
    truth: dict[str, np.ndarray]
    nominal: dict[str, Rotation]
    readings: dict[str, np.ndarray]


def walk(seed: int, seconds: float = 25.0, speed: float = SPEED) -> Walk:
    """Three seconds of standing, then walking, whose strides differ.

    Args:
        seed: Of the person, the sensors and the strides.
        seconds: Of the whole.
        speed: Of the pelvis [m/s]; 0: on a treadmill.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / FINE)
    going = np.clip((time - STANDS_S - 0.2) / 1.5, 0, 1)
    going = going**2 * (3 - 2 * going)
    cadence = 0.875 * (1 + 0.03 * np.cumsum(rng.standard_normal(len(time))) / np.sqrt(FINE * 20))
    phase = 2 * np.pi * np.cumsum(cadence * going) / FINE
    vary = 1 + 0.05 * np.sin(2 * np.pi * (0.11 * time + rng.random()))
    facing = Rotation.from_euler("Z", rng.uniform(-np.pi, np.pi))
    # segment axes (y up) in the world (z up)
    upright = facing * Rotation.from_euler("X", 90, degrees=True)
    world = _orientations(rng, upright, phase, going, vary)
    origins = _origins(world, facing, time, going, speed)
    truth, nominal, readings = {}, {}, {}
    rows = np.arange(round(FINE / RATE), len(time), round(FINE / RATE))
    for name in SEGMENTS:
        nominal[name] = Rotation.random(rng=rng)
        skin = Rotation.from_rotvec(np.radians(SKIN_DEG) * rng.standard_normal(3))
        place = np.array(SENSORS[name]) + 1e-3 * SKIN_MM * rng.standard_normal(3)
        position = origins[name] + world[name].apply(place)
        readings[name] = _readings(rng, world[name] * nominal[name] * skin, position, rows)
        truth[name] = world[name][rows].as_quat(scalar_first=True)
    return Walk(time[rows], truth, nominal, readings)


def _angles(parts: list, phase: np.ndarray, going: np.ndarray, vary: np.ndarray) -> np.ndarray:
    columns = []
    for mean, harmonics in parts:
        swing = sum(
            size * np.sin(k * phase + np.radians(shift))
            for k, (size, shift) in enumerate(harmonics, 1)
        )
        columns.append(going * (mean + vary * swing))
    return np.radians(np.column_stack(columns))


def _orientations(
    rng: np.random.Generator,
    upright: Rotation,
    phase: np.ndarray,
    going: np.ndarray,
    vary: np.ndarray,
) -> dict[str, Rotation]:
    """Of every segment over time: standing each is off by its own posture, walking by none."""
    off = {
        name: np.radians(POSTURE_DEG) * rng.standard_normal(3) * np.ones((len(phase), 1))
        for name in SEGMENTS
    }
    lean = Rotation.from_rotvec((1 - going)[:, None] * off["pelvis"])
    world = {
        "pelvis": upright * Rotation.from_euler("ZXY", _angles(PELVIS, phase, going, vary)) * lean
    }
    axis = np.array([0, 0, 1.0]) + np.radians(POSTURE_DEG) * np.append(rng.standard_normal(2), 0)
    axis /= np.linalg.norm(axis)
    for above, name, joint in zip(SEGMENTS, SEGMENTS[1:], GAIT, strict=False):
        angles = _angles(GAIT[joint], phase, going, vary)
        if joint == "knee":
            turned = Rotation.from_rotvec(angles * axis)
        else:
            turned = Rotation.from_euler("ZXY", angles)
        posed = Rotation.from_rotvec((1 - going)[:, None] * (off[name] - off[above]))
        world[name] = world[above] * turned * posed
    return world


def _origins(
    world: dict[str, Rotation],
    facing: Rotation,
    time: np.ndarray,
    going: np.ndarray,
    speed: float,
) -> dict[str, np.ndarray]:
    """Upper end of every segment over time, shape (n, 3) [m]: the foot that is on the ground does
    not matter, the pelvis goes forwards and up and down.
    """
    forwards = np.cumsum(speed * going) / FINE
    bob = 0.02 * going * np.sin(2 * np.pi * 1.75 * time)
    sway = 0.1 * going * np.sin(2 * np.pi * 1.75 * time + 1.0) / (2 * np.pi * 1.75)
    position = facing.apply([1.0, 0, 0]) * (forwards + sway)[:, None] + bob[:, None] * [0, 0, 1.0]
    hip = world["pelvis"].apply(HIP["segment"])
    found = {"pelvis": position, "thigh": position + hip}
    for above, name in (("thigh", "shank"), ("shank", "foot")):
        found[name] = found[above] + world[above].apply([0.0, -LENGTHS[above], 0.0])
    return found


def _readings(
    rng: np.random.Generator, q: Rotation, position: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Of a sensor that integrates rates and forces, these in its axes at the end, shape (n, 9)."""
    step = round(FINE / RATE)
    gyr = (q[rows - step].inv() * q[rows]).as_rotvec() * RATE
    velocity = np.gradient(position, axis=0) * FINE
    acc = q[rows].inv().apply((velocity[rows] - velocity[rows - step]) * RATE + UP)
    mag = q[rows].inv().apply(FIELD)
    parts = []
    for name, values in (("acc", acc), ("gyr", gyr), ("mag", mag)):
        bias = BIAS[name] * rng.standard_normal(3)
        parts.append(values + bias + NOISE[name] * rng.standard_normal(values.shape))
    return np.hstack(parts)


def export(scene: Walk, folder: Path, joints: str) -> tuple[Path, list[Path]]:
    """Write a walk as CSV, a file a sensor, and the mapping that says what its columns are.

    Args:
        scene: The walk.
        folder: To be made.
        joints: The mapping's text on joints and their alignment.

    Returns:
        The mapping and the files.
    """
    folder.mkdir(parents=True)
    titles = ["t", *(f"{kind}{axis}" for kind in "agm" for axis in "xyz")]
    titles += [f"q{part}" for part in "wxyz"]
    files, sensors, segments = [], [], []
    for name in SEGMENTS:
        table = np.column_stack([BEGAN_S + scene.time, scene.readings[name], scene.truth[name]])
        files.append(folder / f"imu_{name}.csv")
        formats = ["%.6f", *["%.7g"] * (len(titles) - 1)]
        np.savetxt(files[-1], table, formats, ",", header=",".join(titles), comments="")
        mounting = scene.nominal[name].as_euler("ZYX", degrees=True).tolist()
        axes = scene.nominal[name].inv().as_euler("ZYX", degrees=True).tolist()
        sensors.append(
            f"  {name}:\n    file: imu_{name}.csv\n    sampling: integrated\n"
            "    acc: {columns: [ax, ay, az], unit: m/s^2}\n"
            "    gyr: {columns: [gx, gy, gz], unit: rad/s}\n"
            "    mag: {columns: [mx, my, mz], unit: uT}\n"
            "    truth: {columns: [qw, qx, qy, qz], order: wxyz, "
            f"mounting: {{rotation_deg: {{ZYX: {mounting}}}}}}}\n"
        )
        segments.append(f"  {name}: {{name: {name}, rotation_deg: {{ZYX: {axes}}}}}\n")
    mapping = folder / "map.yaml"
    mapping.write_text(
        "description: a person who walks\ntime: {column: t, unit: s}\nsensors:\n"
        + "".join(sensors)
        + "segments:\n"
        + "".join(segments)
        + joints
    )
    return mapping, files


def chain_text(scene: Walk) -> str:
    """The part of a mapping on the chain filter, below `estimate`: this person as a lower_limb."""
    sensors = []
    for name, link in LINKS.items():
        turn = (LINK_FROM_SEGMENT * scene.nominal[name]).as_euler("ZYX", degrees=True).tolist()
        place = np.array(SENSORS[name])
        if name == "pelvis":
            place = LINK_FROM_SEGMENT.apply(place - HIP["segment"]) + HIP["link"]
        else:
            place = LINK_FROM_SEGMENT.apply(place)
        where = f"rotation_deg: {{ZYX: {turn}}}, position_mm: {(1000 * place).round(1).tolist()}"
        sensors.append(f"        {name}: {{link: {link}, mounting: {{{where}}}}}\n")
    lengths = {"knee_r_flexion": "thigh", "ankle_r_inversion": "shank"}
    stated = ", ".join(f"{joint}: {1000 * LENGTHS[own]:.0f}" for joint, own in lengths.items())
    return (
        "  chain:\n    scales: false\n"
        f"    placement: {{rotation_sd_deg: {SKIN_DEG}, position_sd_mm: {SKIN_MM}}}\n"
        f"    model:\n      robot: lower_limb\n      lengths_mm: {{{stated}}}\n      sensors:\n"
        + "".join(sensors)
    )
