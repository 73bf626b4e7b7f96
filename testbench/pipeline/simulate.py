"""Sensors that ride on a motion from a file, in place of an arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from testbench.clock import Clock, SystemClock
from testbench.drivers.imus.simulated import RidingImu
from testbench.exceptions import InputError, NotFoundError
from testbench.formats.motion_file import read_motion
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.frames import NANOSECONDS
from testbench.model.rigid_motion import RigidMotion
from testbench.pipeline.request import SimulateRequest
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Analysis, Environment, Estimation
from testbench.records.specs.sensor import PRESET_SUFFIXES, ImuParameters, load_preset

FORMAT = "motion"
MARGIN_S = 0.1
"""Samples end so long before the motion does, for their instants jitter [s]."""


def simulate(asked: SimulateRequest, clock: Clock | None = None) -> Session:
    """Make a session of sensors that ride on a motion; its truth is the motion.

    Args:
        asked: The motion, and which sensors.
        clock: For the date; the machine's if None.

    Raises:
        NotFoundError: No such preset or body; lists those that exist.
        InputError: A body is named twice.
        FileProblems: The file holds no motion.
        SessionError: The folder exists.
    """
    file = Path(asked.motion)
    bodies = read_motion(file)
    presets = _presets(asked, bodies)
    riding = {name: ride(name, presets[name], body, asked.seed) for name, body in bodies.items()}
    purpose = f"Simulated sensors on the motion of {file.name}"
    recording = Recording(file.stem, purpose, riding, _analysis(riding), simulated=True)
    return write_recording(recording, [file], FORMAT, Path(asked.out), clock or SystemClock())


def ride(name: str, preset: str, body: RigidMotion, seed: int) -> ImportedSensor:
    """A simulated sensor on a body, from the first pose to the last.

    Args:
        name: Of the body; it selects its random numbers.
        preset: Data sheet, by name or file.
        body: How it moves.
        seed: Of what is drawn.

    Raises:
        NotFoundError: No such preset; lists those that exist.
    """
    samples, imu = felt(name, sheet_of(preset), preset, body, seed)
    told: dict[str, Any] = imu.describe()
    description = f"simulated {told.pop('description')}"
    own = {key: told[key] for key in ("driver", "preset", "sampling", "rate_delay_s")}
    motion = body.at(body.time_ns)
    truth = Truth(
        body.time_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(imu.gravity),
    )
    details = {**own, "truth": "the motion that it rides on"}
    return ImportedSensor([samples], imu.rate, description, truth, details)


def felt(
    name: str, sheet: ImuParameters, preset: str | None, body: RigidMotion, seed: int
) -> tuple[ImuSamples, RidingImu]:
    """What a simulated sensor reads on a body.

    Args:
        name: Of the body; it selects its random numbers.
        sheet: Data sheet.
        preset: Its name.
        body: How it moves.
        seed: Of what is drawn.
    """
    imu = RidingImu(name, sheet, preset, body, Environment(), seed)
    imu.kickoff()
    until = int(body.time_ns[-1] - body.time_ns[0]) - round(MARGIN_S * NANOSECONDS)
    return imu.read(until), imu


def sheet_of(preset: str) -> ImuParameters:
    """A data sheet by the name of one that ships, or from a file.

    Raises:
        NotFoundError: No such preset; lists those that exist.
    """
    if preset.endswith(PRESET_SUFFIXES):
        return load_yaml(Path(preset), ImuParameters).value
    return load_preset(preset)


def _presets(asked: SimulateRequest, bodies: dict[str, RigidMotion]) -> dict[str, str]:
    """The data sheet of each body."""
    own: dict[str, str] = {}
    for text in asked.sensors:
        name, sign, preset = text.partition("=")
        if not sign or not preset:
            raise InputError(f"--sensor {text}: write BODY=PRESET")
        if name not in bodies:
            raise NotFoundError(f"body of {asked.motion}", name, list(bodies))
        if name in own:
            raise InputError(f"--sensor names the body {name} twice")
        own[name] = preset
    return {name: own.get(name, asked.preset) for name in bodies}


def _analysis(riding: dict[str, ImportedSensor]) -> Analysis:
    """Filters that all sensors have what they need for; the heading of some is their own."""
    heads = [sensor.head() for sensor in riding.values()]
    filters = ["vqf_6d", "madgwick_imu"]
    if all(head is not None and head.mag is not None for head in heads):
        filters += ["vqf_9d", "madgwick_marg"]
    if all(head is not None and head.device_q is not None for head in heads):
        filters.insert(0, "device")
    return Analysis(
        estimate=Estimation.model_validate(
            {"filters": filters, "align": "motion", "calibrate": "none"}
        )
    )
