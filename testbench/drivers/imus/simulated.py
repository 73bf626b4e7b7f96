"""A simulated inertial sensor: feels the true motion of what carries it, with its own clock and
errors.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from testbench.drivers.imus.base import Imu
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.imu import DeviceOrientationModel, TriadModel
from testbench.model.kinematics import FrameMotion, Kinematics, Pose
from testbench.model.magnetic_field import MagneticField
from testbench.model.noise import random_stream
from testbench.model.rigid_motion import RigidMotion
from testbench.records.session.samples import ImuSamples
from testbench.records.session.trajectory import TrueState
from testbench.records.specs.protocol import Environment, Sensor
from testbench.records.specs.sensor import ImuParameters, TriadParameters


class ModelledImu(Imu):
    """An IMU in virtual time, whatever carries it.

    Args:
        name: The sensor's name; it selects its random numbers.
        parameters: Its data sheet.
        preset: Name of that, where it has one.
        environment: Its temperature.
        seed: Of the run.
        drawn_as: Whose errors it has, by name; its own if None.
        part: Seed of those errors; that of the run if None.
    """

    gravity: np.ndarray
    """In the world, shape (3,) [m/s^2]."""

    def __init__(
        self,
        name: str,
        parameters: ImuParameters,
        preset: str | None,
        environment: Environment,
        seed: int,
        drawn_as: str | None = None,
        part: int | None = None,
    ):
        self.name, self.parameters, self.environment = name, parameters, environment
        self.rate = rate = parameters.rate_hz
        self.has_magnetometer = parameters.magnetometer is not None
        self.has_orientation = parameters.device_orientation is not None
        self._preset, self._seed = preset, seed

        def triad(sheet: TriadParameters, kind: str) -> TriadModel:
            return TriadModel(sheet, rate, seed, name, kind, drawn_as=drawn_as, part=part)

        self._accelerometer = triad(parameters.accelerometer.triad(), "accelerometer")
        self._gyroscope = triad(parameters.gyroscope.triad(), "gyroscope")
        self._magnetometer = (
            triad(parameters.magnetometer.triad(), "magnetometer")
            if parameters.magnetometer
            else None
        )
        self._orientation = (
            DeviceOrientationModel(parameters.device_orientation, rate, seed, name, "orientation")
            if parameters.device_orientation
            else None
        )
        self.has_temperature = parameters.thermometer is not None
        self._thermal_noise = random_stream(seed, name, "thermometer")
        self._draw_clock()
        self._count = 0
        self._last_sample: tuple[np.ndarray, np.ndarray] | None = None
        self._stopped = False

    @abstractmethod
    def motion_at(self, times_ns: np.ndarray) -> FrameMotion:
        """How the sensor truly moves at host times.

        Args:
            times_ns: Not decreasing, shape (n,), int64.
        """

    @abstractmethod
    def field_at(self, times_ns: np.ndarray, motion: FrameMotion) -> np.ndarray:
        """The magnetic field about it in the world, shape (n, 3) [uT].

        Args:
            times_ns: Not decreasing, shape (n,), int64.
            motion: Its own then.
        """

    def kickoff(self) -> None:
        """Begin at time 0."""
        self._count = 0

    def read(self, until_ns: int) -> ImuSamples:
        """Samples taken up to a host time."""
        times, device_times, counter = self._sampling(until_ns)
        motion = self.motion_at(times)
        lag = round(1e6 * self.parameters.clock.accelerometer_lag_ms)
        earlier = motion if lag == 0 else self.motion_at(np.maximum(times - lag, 0))
        rate = motion.angular_velocity_in_frame
        force = earlier.specific_force_in_frame(self.gravity)
        if self.parameters.sampling == "integrated":
            rate, force = self._integrated(motion.q_world_from_frame, rate, force)
        temperature = self._temperature(times)
        acc, acc_saturated = self._accelerometer.measure(force, temperature=temperature)
        gyr, gyr_saturated = self._gyroscope.measure(rate, force, temperature)
        saturated = acc_saturated | gyr_saturated
        mag = None
        if self._magnetometer is not None:
            field = self.field_at(times, motion)
            mag, mag_saturated = self._magnetometer.measure(
                np.einsum("nji,nj->ni", motion.R_world_from_frame, field)
            )
            saturated = saturated | mag_saturated
        device_q = (
            None
            if self._orientation is None
            else self._orientation.measure(motion.q_world_from_frame)
        )
        arrival = self._arrival(times)
        kept = self._loss.random(len(times)) >= self.parameters.lost_packets_percent / 100
        samples = (
            device_times,
            arrival,
            gyr,
            acc,
            mag,
            device_q,
            counter,
            saturated,
            self._read_thermometer(temperature),
        )
        chosen = [None if array is None else array[kept] for array in samples]
        return ImuSamples(*chosen)  # type: ignore[arg-type]

    def stop(self) -> None:
        """Stop recording."""
        self._stopped = True

    def describe(self) -> dict[str, Any]:
        """What a data sheet would say; nothing of the errors that this part was given."""
        return {
            "driver": "simulated",
            "preset": self._preset,
            "description": self.parameters.description,
            "rate_hz": self.rate,
            "magnetometer": self.has_magnetometer,
            "orientation": self.has_orientation,
            "temperature": self.has_temperature,
            "sampling": self.parameters.sampling,
            "rate_delay_s": self._rate_delay(),
        }

    def _temperature(self, times_ns: np.ndarray) -> np.ndarray:
        """Temperature of the part, shape (n,) [deg C]: it warms up after it is switched on."""
        e = self.environment
        return np.asarray(
            e.temperature_deg_c
            + e.warm_up_deg_c * -np.expm1(-times_ns / NANOSECONDS / e.warm_up_time_s)
        )

    def _read_thermometer(self, temperature: np.ndarray) -> np.ndarray | None:
        thermometer = self.parameters.thermometer
        if thermometer is None:
            return None
        read = temperature + thermometer.noise_sd_deg_c * self._thermal_noise.standard_normal(
            len(temperature)
        )
        step = thermometer.resolution_deg_c
        return np.round(read / step) * step if step else read

    def _rate_delay(self) -> float:
        """How much older than its time stamp an angular rate is by the data sheet [s]: half an
        interval of integration, and the delay of the low pass.
        """
        bandwidth = self.parameters.gyroscope.bandwidth_hz
        integration = 0.5 / self.rate if self.parameters.sampling == "integrated" else 0.0
        return integration + (1 / (2 * np.pi * bandwidth) if bandwidth else 0.0)

    def _draw_clock(self) -> None:
        clock, rng = self.parameters.clock, random_stream(self._seed, self.name, "clock")
        offset, drift, phase = rng.standard_normal(), rng.standard_normal(), rng.random()
        self._offset_ns = 1e6 * (clock.offset_ms + clock.offset_sd_ms * offset)
        self._drift = 1e-6 * (clock.drift_ppm + clock.drift_sd_ppm * drift)
        self._phase_ns = phase * NANOSECONDS / self.rate
        self._jitter = random_stream(self._seed, self.name, "jitter")
        self._latency = random_stream(self._seed, self.name, "latency")
        self._loss = random_stream(self._seed, self.name, "loss")
        self._last_arrival = 0

    def _sampling(self, until_ns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Host times of sampling, what the sensor's clock says then, and the counter.

        The clock ticks regularly by itself; jitter of the sampling instant is not seen by it.
        """
        if self._stopped:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)
        period = NANOSECONDS / self.rate
        margin = (
            10_000 * self.parameters.clock.jitter_us
        )  # ten standard deviations, so that no sample lies past `until`
        last = int(((until_ns - margin) * (1 + self._drift) - self._phase_ns) // period)
        counter = np.arange(self._count, max(last + 1, self._count))
        self._count += len(counter)
        own = (
            self._phase_ns + counter * period
        )  # the sensor's clock since the session began, without its offset
        jitter = (
            1000
            * self.parameters.clock.jitter_us
            * np.clip(self._jitter.standard_normal(len(counter)), -8, 8)
        )
        times = np.maximum(own / (1 + self._drift) + jitter, 0)
        return (
            np.round(times).astype(np.int64),
            np.round(own + self._offset_ns).astype(np.int64),
            counter,
        )

    def _integrated(
        self, q: np.ndarray, rate: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Means over the interval before each sample, seen in the sensor's axes at its end, shapes
        (n, 3).

        The mean rate is the rotation between the samples over the time between them; the mean force
        is the trapezoid's.
        """
        if len(q) == 0:
            return rate, force
        before = self._last_sample or (q[0], force[0])
        self._last_sample = (q[-1], force[-1])
        interval = 1.0 / self.rate  # what the part divides by: it does not see its own jitter
        q_now_from_before = rotation.multiply(rotation.conjugate(q), np.vstack([before[0], q[:-1]]))
        carried = rotation.rotate(q_now_from_before, np.vstack([before[1], force[:-1]]))
        return -rotation.to_rotation_vector(q_now_from_before) / interval, (force + carried) / 2

    def _arrival(self, times: np.ndarray) -> np.ndarray:
        clock = self.parameters.clock
        delay = 1e6 * (
            clock.latency_ms + clock.latency_jitter_ms * self._latency.exponential(size=len(times))
        )
        arrival = np.maximum.accumulate(
            np.append(self._last_arrival, times + np.round(delay).astype(np.int64))
        )[1:]
        if len(arrival):
            self._last_arrival = int(arrival[-1])
        return np.asarray(arrival)


class SimulatedImu(ModelledImu):
    """An IMU that feels the motion of an arm.

    Args:
        name: The sensor's name in the protocol; it selects its random numbers.
        sensor: Where it sits, and its parameters.
        kinematics: Of the arm that carries it.
        environment: The magnetic field, and its temperature.
        true_state: Gives the true joint angles, rates and accelerations at host times.
        seed: Of the run.
    """

    def __init__(
        self,
        name: str,
        sensor: Sensor,
        kinematics: Kinematics,
        environment: Environment,
        true_state: TrueState,
        seed: int,
    ):
        drawn = sensor.drawn_as, sensor.part
        super().__init__(name, sensor.imu(), sensor.preset, environment, seed, *drawn)
        self.sensor, self.kinematics = sensor, kinematics
        self.gravity = kinematics.robot.gravity
        self._true_state = true_state
        self._field = MagneticField(environment, kinematics)
        # The real mounting is the believed one followed by its error.
        self._link_from_sensor = Pose.from_placement(sensor.mounting) @ Pose.from_placement(
            sensor.mounting_error
        )

    def motion_at(self, times_ns: np.ndarray) -> FrameMotion:
        """See ModelledImu."""
        q, v, a = self._true_state(times_ns)
        return self.kinematics.frame_motion(self.sensor.link, q, v, a, self._link_from_sensor)

    def field_at(self, times_ns: np.ndarray, motion: FrameMotion) -> np.ndarray:
        """See ModelledImu."""
        return self._field.at(motion.position, self._true_state(times_ns)[0])


class RidingImu(ModelledImu):
    """An IMU that rides on a body whose motion is known.

    Args:
        name: Of the body; it selects its random numbers.
        parameters: Its data sheet.
        preset: Name of that, where it has one.
        body: How the sensor's frame moves.
        environment: The magnetic field, the same everywhere, and its temperature.
        seed: Of the run.
    """

    gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])

    def __init__(
        self,
        name: str,
        parameters: ImuParameters,
        preset: str | None,
        body: RigidMotion,
        environment: Environment,
        seed: int,
    ):
        super().__init__(name, parameters, preset, environment, seed)
        self.body = body

    def motion_at(self, times_ns: np.ndarray) -> FrameMotion:
        """See ModelledImu."""
        return self.body.at(times_ns)

    def field_at(self, times_ns: np.ndarray, motion: FrameMotion) -> np.ndarray:
        """See ModelledImu."""
        return np.tile(np.asarray(self.environment.magnetic_field_uT, float), (len(times_ns), 1))
