"""Walks of the study `reference-4`: what devices and filters make of a walker, part by part."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import repeat
from multiprocessing import get_context
from os import cpu_count

import numpy as np

from testbench.estimation.filters import UniformSamples, get_filter
from testbench.estimation.gait import PUBLISHED, PedestrianParameters
from testbench.estimation.gait.walk import walk
from testbench.evaluation.metrics import orientation_errors
from testbench.frames import NANOSECONDS
from testbench.model.heading import heading_drift
from testbench.model.rigid_motion import RigidMotion
from testbench.pipeline.simulate import felt
from testbench.records.results.study import Print
from testbench.records.specs.sensor import load_preset
from testbench.studies.bench import StudyBench
from testbench.studies.pedestrian.walker import (
    REST_AFTER_S,
    REST_BEFORE_S,
    Walked,
    Walker,
    walk_a_path,
)

CORRIDOR, LOOP = 14, 109
"""Gait cycles of the source's straight corridor (table 10) and of its loop (tables 11 to 14)."""
LOOP_TURNS = [90.0, 90.0, 90.0, 90.0]
"""Of the loop; the source has "several"."""
REPETITIONS_A_PART, RUNS = 4, 3
"""Of the corridor, which make the source's twenty with five parts; of the loop, as the source."""
RATE_HZ = 100.0
"""Of all devices but one with a lower rate: the source's process noise is per sample."""
DEVICES = {
    "BNO055, ENU": "bno055",
    "NGIMU, frontal": "ngimu",
    "BNO080, ENU": "bno080",
    "SHIMMER3, frontal": "shimmer3",
}
"""As table 10 names them, and their presets."""
SETTINGS = {
    "bno055": {"process_rad": 1.56e-4, "roll_sd_rad": 0.0014, "pitch_sd_rad": 0.0014},
    "ngimu": {"process_rad": 3e-4, "roll_sd_rad": 0.0029, "pitch_sd_rad": 0.0031},
}
"""Of the source's filter by device (its eqs 4.1 to 4.3); the others have those of the BNO055."""
DEVICE, LISTING, TEXT, SIMPLE = (
    "device",
    "euler_ekf_listing",
    "euler_ekf_as_printed",
    "euler_ekf_simple_as_printed",
)
CORRECTED, OURS = "euler_ekf", "vqf_6d"
FILTERS = (LISTING, TEXT, SIMPLE, CORRECTED, OURS)
FORCES_RAD = 0.05
"""Standard deviation of roll and pitch by a force of gravity's size while a leg swings: half a
metre per second squared across it.
"""
TEXT_GATE, LISTING_GATE = {"acc_gate_m_s2": 1.0}, {"acc_gate_m_s2": 0.1}
VARIANTS: dict[str, tuple[str, dict[str, float], bool]] = {
    "corrected": (CORRECTED, {}, True),
    "corrected, zero not taken off": (CORRECTED, {}, False),
    "corrected, forces exact to 0.05 rad": (
        CORRECTED,
        {"roll_sd_rad": FORCES_RAD, "pitch_sd_rad": FORCES_RAD},
        True,
    ),
    "corrected, a hundredth of the process noise": (
        CORRECTED,
        {"process_rad_sqrts": 1.56e-5},
        True,
    ),
    "corrected, no force after the start": (CORRECTED, {"acc_gate_m_s2": 1e-9}, True),
    "program": (LISTING, SETTINGS["ngimu"], False),
    "program, zero taken off": (LISTING, SETTINGS["ngimu"], True),
    "program, gate of the text": (LISTING, SETTINGS["ngimu"] | TEXT_GATE, False),
    "text": (TEXT, SETTINGS["ngimu"], False),
    "text, gate of the program": (TEXT, SETTINGS["ngimu"] | LISTING_GATE, False),
    OURS: (OURS, {}, True),
}
"""The prints of the filter with one thing changed, on a shank: filter, settings, and whether the
gyroscope's zero is taken off.
"""
PRINTS: dict[str, Print] = {LISTING: "listing", TEXT: "text", SIMPLE: "text"}
PARAMETERS = {"shank": "shin", "wrist": "wrist", "chest": "chest"}
"""Names of the places in table 11."""
PROPERTIES: dict[str, list[tuple[str, Walker]]] = {
    "stride-to-stride variation": [
        ("none", Walker(swing_cv=0, length_cv=0, time_cv=0)),
        ("as measured", Walker()),
        ("twice", Walker(swing_cv=0.054, length_cv=0.068, time_cv=0.051)),
    ],
    "speed": [
        ("constant", Walker(speed=0)),
        ("± 20 %", Walker(speed=0.2)),
    ],
    "arc of a turn": [("0.7 m", Walker(turn_m=0.7)), ("2.8 m", Walker(turn_m=2.8))],
    "arm swing": [
        ("half", Walker(arm_deg=8, elbow_deg=7.4)),
        ("a quarter", Walker(arm_deg=4, elbow_deg=3.7)),
    ],
    "hand in pocket": [("10 %", Walker(pocket=0.1)), ("30 %", Walker(pocket=0.3))],
    "swing of the chest": [
        ("2.5 deg", Walker(chest_deg=2.5)),
        ("3 deg", Walker(chest_deg=3)),
        ("6 deg", Walker(chest_deg=6)),
    ],
}
"""What decides the figures, and the values that are tried beside those of `Walker`."""


@dataclass(frozen=True)
class Extent:
    """How much is walked by a part.

    Attributes:
        loop: Gait cycles of the loop.
        repetitions: Of the corridor.
        runs: Of the loop, beside the one that parameters are tuned on.
    """

    loop: int = LOOP
    repetitions: int = REPETITIONS_A_PART
    runs: int = RUNS


AS_PUBLISHED = Extent()
STRAIGHT = ("corridor", "speeds", "variants")
"""Kinds of walks without turns."""


@dataclass(frozen=True, eq=False)
class Reckoned:
    """One walk by one device and filter.

    Attributes:
        kind: "corridor", "tuning", "loop", or the name of a property with its level.
        place: Where the sensor sits.
        device: Name of its preset.
        filter: Whose orientation was used.
        part: Of the sensor and the walker.
        cycles: Walked.
        distance: Walked [m].
        end: Where it ended [m], shape (2,).
        swings: Of each cycle that was found, shape (k,) [deg].
        headings: During each, shape (k,) [rad].
        drift_deg: Of the heading from the rest before to the rest after [deg].
        tilt_deg: RMS error of the inclination in between, of one of `VARIANTS` [deg].
    """

    kind: str
    place: str
    device: str
    filter: str
    part: int
    cycles: int
    distance: float
    end: np.ndarray
    swings: np.ndarray
    headings: np.ndarray
    drift_deg: float
    tilt_deg: float | None = None

    @property
    def cycle_error(self) -> int:
        """Magnitude."""
        return abs(len(self.swings) - self.cycles)

    def lengths(self, slope: float, intercept: float) -> np.ndarray:
        """Of each cycle by a regression, shape (k,) [m] (eq. 2.28)."""
        return slope * self.swings + intercept

    def distance_error(self, slope: float, intercept: float) -> float:
        """Magnitude [m]."""
        return abs(float(self.lengths(slope, intercept).sum()) - self.distance)

    def position_error(self, slope: float, intercept: float) -> float:
        """Of the end of the path [m] (eq. 2.29)."""
        moves = self.lengths(slope, intercept)[:, None] * np.column_stack(
            [np.cos(self.headings), np.sin(self.headings)]
        )
        return float(np.linalg.norm(moves.sum(axis=0) - self.end))

    def path(self, slope: float, intercept: float) -> np.ndarray:
        """After each cycle, from the origin on, shape (k + 1, 2) [m]."""
        moves = self.lengths(slope, intercept)[:, None] * np.column_stack(
            [np.cos(self.headings), np.sin(self.headings)]
        )
        return np.vstack([np.zeros((1, 2)), np.cumsum(moves, axis=0)])


@dataclass
class Walks:
    """All walks of all parts.

    Attributes:
        reckoned: In no order.
        loop: The path of the first part's first verification from above, shape (n, 2) [m].
    """

    reckoned: list[Reckoned] = field(default_factory=list)
    loop: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))

    def of(self, kind: str, place: str, device: str, filter_name: str) -> list[Reckoned]:
        """Those of one kind, in the order of their parts.

        Args:
            kind: See Reckoned.
            place: Where the sensor sits.
            device: Name of its preset.
            filter_name: Whose orientation.
        """
        return [
            one
            for one in self.reckoned
            if (one.kind, one.place, one.device, one.filter) == (kind, place, device, filter_name)
        ]


def all_walks(bench: StudyBench, extent: Extent = AS_PUBLISHED) -> Walks:
    """Walk with every part, side by side in processes.

    Args:
        bench: Whose seeds are the parts.
        extent: How much each walks.
    """
    found = Walks()
    processes = min(bench.parts, cpu_count() or 1)
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for i, own in enumerate(pool.map(walks_of_part, bench.seeds, repeat(extent))):
            bench.say(f"walks of part {i + 1} of {bench.parts}")
            found.reckoned += own.reckoned
            found.loop = own.loop if i == 0 else found.loop
    return found


def walks_of_part(part: int, extent: Extent = AS_PUBLISHED) -> Walks:
    """The corridor, the loop, and the loop with other properties of the walker.

    Args:
        part: Seed of the sensors and the walker.
        extent: How much it walks.
    """
    found, usual, loop = Walks(), Walker(), extent.loop
    for k in range(extent.repetitions):
        walked = walk_a_path(usual, CORRIDOR, [], part, "corridor", str(k))
        for device in DEVICES.values():
            found.reckoned += reckon(walked, "corridor", "shank", device, part)
        found.reckoned += reckon(walked, "corridor", "thigh", "ngimu", part)
        found.reckoned += with_one_thing_changed(walked, part)
    for k in range(extent.runs + 1):
        walked = walk_a_path(usual, loop, LOOP_TURNS, part, "loop", str(k))
        kind = "loop" if k else "tuning"
        found.loop = walked.path if k == 1 else found.loop
        for place in PARAMETERS:
            for device in ("ngimu", "bno080"):
                found.reckoned += reckon(walked, kind, place, device, part)
    for name, levels in PROPERTIES.items():
        for level, walker in levels:
            walked = walk_a_path(walker, loop, LOOP_TURNS, part, "loop", "1")
            for place in PARAMETERS:
                kind = f"{name}: {level}"
                found.reckoned += reckon(walked, kind, place, "ngimu", part, (LISTING,))
    for fast in (0.85, 1.15):
        root = float(np.sqrt(fast))
        stride_m, stride_s = usual.stride_m * root, usual.stride_s / root
        walker = replace(usual, stride_m=stride_m, stride_s=stride_s, size=root, speed=0.0)
        walked = walk_a_path(walker, loop, [], part, "speeds", str(fast))
        found.reckoned += reckon(walked, "speeds", "shank", "ngimu", part, (LISTING,))
    return found


def reckon(
    walked: Walked,
    kind: str,
    place: str,
    device: str,
    part: int,
    filters: Sequence[str] = FILTERS,
) -> list[Reckoned]:
    """One walk by every filter, and by the device where it reports angles.

    Args:
        walked: The walk.
        kind: See Reckoned.
        place: Where the sensor sits.
        device: Name of its preset.
        part: Seed of the sensor.
        filters: Names.
    """
    samples, time_ns = readings(walked.bodies[place], f"{device}_{place}", device, part)
    position = PARAMETERS.get(place, "shin")
    name = f"{'bno080' if device == 'bno080' else 'ngimu'}_{position}"
    parameters = PUBLISHED[name]
    own = {key: _orientations(key, device, samples, time_ns) for key in filters}
    if samples.device_q is not None and device == "bno055":
        own[DEVICE] = samples.device_q
    return [
        _one(walked, (kind, place, device, key, part), time_ns, q, parameters)
        for key, q in own.items()
    ]


def with_one_thing_changed(walked: Walked, part: int) -> list[Reckoned]:
    """One walk by every one of `VARIANTS`, of an NGIMU on the shank.

    Args:
        walked: The walk.
        part: Seed of the sensor.
    """
    body, found = walked.bodies["shank"], []
    samples, time_ns = readings(body, "ngimu_shank", "ngimu", part)
    walking = (time_ns > REST_BEFORE_S * NANOSECONDS) & (
        time_ns < (body.duration - REST_AFTER_S) * NANOSECONDS
    )
    true = body.at(time_ns[walking]).q_world_from_frame
    for label, (name, settings, rested) in VARIANTS.items():
        own = without_zero(samples, time_ns) if rested else samples
        q = get_filter(name, settings).run(own)
        key = ("variants", "shank", "ngimu", label, part)
        tilt = orientation_errors(q[walking], true).inclination
        one = _one(walked, key, time_ns, q, PUBLISHED["ngimu_shin"])
        found.append(replace(one, tilt_deg=float(np.degrees(np.sqrt(np.mean(tilt**2))))))
    return found


def _one(
    walked: Walked,
    key: tuple[str, str, str, str, int],
    time_ns: np.ndarray,
    q: np.ndarray,
    parameters: PedestrianParameters,
) -> Reckoned:
    found = walk(time_ns, q, parameters)
    # the walker's heading in the rests, which turns by the path
    turned = float(np.degrees(heading_drift(time_ns, q, None, 0.02).drift))
    true = LOOP_TURNS if key[0] not in STRAIGHT else []
    drift = (turned - sum(true) + 180) % 360 - 180 if true else turned
    return Reckoned(
        *key,
        walked.cycles,
        walked.distance,
        walked.end,
        np.degrees(found.cycles.swing),
        found.headings,
        drift,
    )


def readings(
    body: RigidMotion, name: str, device: str, part: int
) -> tuple[UniformSamples, np.ndarray]:
    """What a device reads, and when by its own clock [ns].

    Args:
        body: That it rides on.
        name: Selects its random numbers.
        device: Name of its preset.
        part: Seed.
    """
    sheet = load_preset(device)
    slower = sheet.model_copy(update={"rate_hz": min(sheet.rate_hz, RATE_HZ)})
    samples, imu = felt(name, slower, device, body, part)
    time_ns = samples.device_time_ns - samples.device_time_ns[0]
    return (
        UniformSamples(1 / imu.rate, samples.gyr, samples.acc, None, samples.device_q),
        time_ns,
    )


def _orientations(
    name: str, device: str, samples: UniformSamples, time_ns: np.ndarray
) -> np.ndarray:
    """By a filter of the source with its settings, or by ours, shape (n, 4).

    Ours take the gyroscope's zero from the rest before the walk; the source's has no bias.
    """
    if name in (CORRECTED, OURS):
        return get_filter(name).run(without_zero(samples, time_ns))
    settings = SETTINGS.get(device, SETTINGS["bno055"])
    return get_filter(name, settings).run(samples)


def without_zero(samples: UniformSamples, time_ns: np.ndarray) -> UniformSamples:
    """Readings without the gyroscope's zero, by the rest before a walk.

    Args:
        samples: As read.
        time_ns: When, shape (n,) [ns].
    """
    rest = time_ns < (REST_BEFORE_S - 1) * NANOSECONDS
    return replace(samples, gyr=samples.gyr - samples.gyr[rest].mean(axis=0))
