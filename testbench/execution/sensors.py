"""The sensors of a run: live ones, or simulated ones that feel the motion of the arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.following import ReportedMotion
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.exceptions import InputError
from testbench.execution.devices import Devices, stop_all
from testbench.model.kinematics import Kinematics
from testbench.model.links import draw_link_errors
from testbench.model.magnetic_field import describe_environment
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.plan import Plan
from testbench.records.session.samples import ArmSamples, ImuSamples
from testbench.records.session.trajectory import TrueState


@dataclass
class Sensors:
    """The sensors of a run.

    Attributes:
        imus: By the names of the protocol.
        devices: What must be connected and released, for live ones.
        motion: What simulated ones feel that follow what an arm reports.
        environment: What simulated ones feel beside the motion, as the manifest has it.
    """

    imus: dict[str, Imu]
    devices: Devices | None = None
    motion: ReportedMotion | None = None
    environment: dict[str, Any] | None = None

    @staticmethod
    def simulated(plan: Plan, seed: int, true_state: TrueState | None = None) -> Sensors:
        """Simulated sensors.

        Args:
            plan: Whose sensors they are.
            seed: Of their random numbers.
            true_state: Of a simulated arm; None of another, whose reported motion they follow.
        """
        motion = None
        if true_state is None:
            motion = ReportedMotion(plan.robot.spec.rates.record_hz)
            true_state = motion.state
        kinematics, spec = actual_kinematics(plan, seed), plan.protocol.spec
        imus: dict[str, Imu] = {
            name: SimulatedImu(name, sensor, kinematics, spec.environment, true_state, seed)
            for name, sensor in spec.sensors.items()
        }
        environment = describe_environment(spec.environment, kinematics)
        return Sensors(imus, motion=motion, environment=environment)

    @staticmethod
    def live(plan: Plan, devices: Devices) -> Sensors:
        """Live devices, which must be called like the protocol's sensors.

        Raises:
            InputError: A sensor has no device, or a device no sensor.
        """
        wanted, given = set(plan.protocol.spec.sensors), set(devices.imus)
        if wanted != given:
            raise InputError(
                f"the protocol's sensors are {', '.join(sorted(wanted))}; the devices are called "
                f"{', '.join(sorted(given))}: "
                "name each with --serial NAME=PORT:FORMAT or --dot NAME=ADDRESS"
            )
        return Sensors(dict(devices.imus), devices)

    def described(self) -> dict[str, SensorRecord]:
        """What each says of itself."""
        return {name: SensorRecord.of(imu.describe()) for name, imu in self.imus.items()}

    @property
    def are_simulated(self) -> bool:
        """Whether none of them is there."""
        return self.devices is None

    def listen(self) -> None:
        """Make sure that live ones deliver, before anything moves.

        Raises:
            DriverError: One does not.
        """
        if self.devices is not None:
            self.devices.listen()

    def start(self) -> None:
        """Begin to record."""
        if self.devices is not None:
            self.devices.kickoff()
        else:
            for imu in self.imus.values():
                imu.kickoff()

    def known_until_ns(self, now_ns: int) -> int:
        """Up to when they can have delivered, at a host time [ns]: those that follow what an arm
        reports lag behind it by a moment.
        """
        return now_ns if self.motion is None else self.motion.known_until_ns

    def read(self, until_ns: int, arm: ArmSamples) -> dict[str, ImuSamples]:
        """What came in up to a host time.

        Args:
            until_ns: The host time.
            arm: What the arm reported up to it.
        """
        if self.motion is not None:
            self.motion.add(arm)
            until_ns = self.motion.known_until_ns
            if until_ns <= 0:
                return {}
        return {name: imu.read(until_ns) for name, imu in self.imus.items()}

    def stop(self) -> None:
        """Stop all; see `stop_all`."""
        stop_all(self.imus.values())

    def close(self) -> None:
        """Release all."""
        if self.devices is not None:
            self.devices.close()


def actual_kinematics(plan: Plan, seed: int) -> Kinematics:
    """Of the arm that simulated sensors ride on: with wrong links, where the protocol wants them.

    Args:
        plan: Whose robot, and whose environment.
        seed: Of what is drawn.
    """
    believed = Kinematics(plan.robot)
    if not plan.protocol.spec.environment.link_errors:
        return believed
    return Kinematics(plan.robot, draw_link_errors(plan.robot, believed.links, seed))
