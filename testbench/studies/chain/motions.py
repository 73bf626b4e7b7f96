"""Motions of the study `reference-5`: those of the shipped protocols, which lie in the Fourier
state's own model, and others that do not.

A filter whose state is a series of four harmonics of one frequency is told nothing new by a motion
that is made of just these. So each rig and the walk have a second motion: a pendulum at steps of
constant rate, a squat whose joints have two frequencies, and gait that varies from stride to
stride.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from testbench.model.noise import random_stream
from testbench.records.specs.shipped import shipped_folder

Spec = dict[str, Any]
"""A protocol as YAML has it."""
Change = Callable[[Spec, np.random.Generator], None]

HALF_LEG = ("pelvis", "thigh_r", "shank_r", "foot_r")
"""Sensors of the source's walk: its right half leg."""
SIDE = 0.018
"""Amplitude of the lines beside each line of gait that varies, in parts of it [1]. Four of them
make a standard deviation of 2.7 % in the swing of a joint from stride to stride; that of the foot
of a healthy walker, by its rates over 25 straight strides of either side, is 2.6 and 2.8 % (github
mad-lab-fau/gaitmap, example data).
"""
ROTATION_SD_DEG, POSITION_SD_MM, LENGTH_SD_PERCENT = 3.0, 10.0, 3.0
"""How far a sensor on skin is from where it is taken to be, about and along each axis, and how far
a segment's length: choices, at the small end of what placing by hand and a tape measure come to.
"""


@dataclass(frozen=True)
class Motion:
    """What a chain is moved by.

    Attributes:
        name: For tables.
        protocol: Shipped one that it is made of.
        change: What is changed of it.
        within: Whether the motion lies in the Fourier state's own model.
    """

    name: str
    protocol: str
    change: Change
    within: bool


def as_shipped(spec: Spec, rng: np.random.Generator) -> None:
    """Change nothing.

    Args:
        spec: The protocol.
        rng: Not drawn from.
    """


def constant_rates(spec: Spec, rng: np.random.Generator) -> None:
    """A pendulum at steps of constant rate.

    Args:
        spec: The protocol; is changed.
        rng: Not drawn from.
    """
    sweep = spec["sections"][1]["steps"][0]["sweep"]
    wave = {"amplitude_deg": 40, "rate_deg_s": 110, "cycles": sweep["knee"]["sine"]["cycles"]}
    spec["sections"][1]["steps"][0]["sweep"] = {"knee": {"trapezoid": wave}}


def two_frequencies(spec: Spec, rng: np.random.Generator) -> None:
    """A squat whose knee is slower than its ankle.

    Args:
        spec: The protocol; is changed.
        rng: Not drawn from.
    """
    sweep = spec["sections"][1]["steps"][0]["sweep"]
    knee, slower = sweep["knee"]["sine"], 0.41
    cycles = round(knee["cycles"] * slower / knee["frequency_hz"])  # as long as the ankle's
    knee |= {"frequency_hz": slower, "cycles": cycles}


def half_leg(spec: Spec, rng: np.random.Generator) -> None:
    """Gait with the four sensors of the source's right half leg.

    Args:
        spec: The protocol; is changed.
        rng: Not drawn from.
    """
    spec["sensors"] = {name: spec["sensors"][name] for name in HALF_LEG}
    spec["estimate"]["chain"]["sensors"] = list(HALF_LEG)
    joints = spec.get("joints", {})
    spec["joints"] = {name: own for name, own in joints.items() if own["distal"] in HALF_LEG}


def varied(spec: Spec, rng: np.random.Generator, side: float = SIDE) -> None:
    """The same with four strides to a period: each line has four beside it.

    Args:
        spec: The protocol; is changed.
        rng: Of the sizes and phases of these lines.
        side: Mean amplitude of these, in parts of the line [1].
    """
    half_leg(spec, rng)
    for one in spec["sections"][-1]["steps"][0]["sweep"].values():
        wave = one["fourier"]
        lines = list(zip(wave["amplitudes_deg"], wave["phases_deg"], strict=True))
        amplitudes, phases = np.zeros(4 * len(lines) + 2), np.zeros(4 * len(lines) + 2)
        for k, (amplitude, phase) in enumerate(lines, start=1):
            for beside in (-2, -1, 1, 2) if amplitude else ():
                amplitudes[4 * k + beside - 1] = amplitude * side * rng.uniform(0.4, 1.6)
                phases[4 * k + beside - 1] = rng.uniform(0, 360)
            amplitudes[4 * k - 1], phases[4 * k - 1] = amplitude, phase
        wave |= {
            "amplitudes_deg": amplitudes.round(4).tolist(),
            "phases_deg": phases.round(1).tolist(),
            "frequency_hz": "stride_hz / 4",
            "cycles": "strides / 4",
            "ramp_cycles": 0.5,
        }


def displaced(spec: Spec, rng: np.random.Generator, times: float = 1.0) -> None:
    """Sensors that sit elsewhere than they are stated to.

    Args:
        spec: The protocol; is changed.
        rng: Of the errors.
        times: By how many times the standard deviations [1].
    """
    for sensor in spec["sensors"].values():
        turn, shift = rng.normal(0, ROTATION_SD_DEG, 3), rng.normal(0, POSITION_SD_MM, 3)
        if times:
            sensor["mounting_error"] = {
                "rotation_deg": {"XYZ": (times * turn).round(3).tolist()},
                "position_mm": (times * shift).round(2).tolist(),
            }


PENDULUM = Motion("pendulum, one sine", "pendulum", as_shipped, True)
STEPS = Motion("pendulum, steps of constant rate", "pendulum", constant_rates, False)
SQUAT = Motion("squat, one frequency", "squat", as_shipped, True)
TWO = Motion("squat, two frequencies", "squat", two_frequencies, False)
GAIT = Motion("gait, each stride alike", "gait", half_leg, True)
VARIED = Motion("gait, strides that vary", "gait", varied, False)
RIGS = (PENDULUM, STEPS, SQUAT, TWO)
WALKS = (GAIT, VARIED)


def write_protocol(
    motion: Motion,
    folder: Path,
    seed: int = 0,
    off: bool = False,
    source: str | Path | None = None,
) -> Path:
    """Write the protocol of a motion, and give its file.

    Args:
        motion: Which.
        folder: To write to.
        seed: Of what is drawn.
        off: Whether the sensors sit elsewhere than stated, by a draw of this seed.
        source: File in place of the shipped protocol.
    """
    shipped = shipped_folder("protocols") / f"{motion.protocol}.yaml"
    spec = yaml.safe_load(Path(source or shipped).read_text("utf-8"))
    motion.change(spec, random_stream(seed, "reference-5", motion.name))
    if off:
        displaced(spec, random_stream(seed, "reference-5", "placement"))
        # its joints are estimated by the study, with lengths that are wrong as well
        spec["estimate"]["chain"] |= {"states": ["kinematic"], "biases": False, "scales": False}
    number = (*RIGS, *WALKS).index(motion)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{motion.protocol}_{number}_{seed}{'_off' if off else ''}.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), encoding="utf-8")
    return path
