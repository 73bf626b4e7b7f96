"""Design of a calibration: the poses and turns of an arm that leave the least uncertainty.

Candidates are drawn within the joint limits and kept where the arm is clear of itself and the
floor; those that tell most about the sensor are chosen (`optimal_design`) and put into an order of
little travel. The protocol is planned like any other, so that what comes out is checked.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from testbench.exceptions import InputError, NotFoundError
from testbench.model.calibration_information import (
    ACCELEROMETER,
    GYROSCOPE_AXIS,
    ObservationNoise,
    pose_information,
    predicted_sd,
    rest_information,
    turn_information,
)
from testbench.model.collision import CollisionModel
from testbench.model.kinematics import Kinematics, Pose
from testbench.planning.optimal_design import Criterion, choose
from testbench.records.session.plan import Plan
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot

CANDIDATES = 600
LARGEST_SWING = np.pi
"""Candidates lie within half a turn of the home pose [rad]."""
TURN_SAMPLES = 19
BLOCKED_S = 1e3
"""Added to the travel between poses whose straight path is not clear, so that the tour goes another
way [s].
"""
ARM_DIRECTION = np.radians(0.03)
"""Standard deviation of the arm's orientation at a pose [rad]: settling and repeatability of a
collaborative arm.
"""
MOST_ORDERS = 60

RESPONSE_SIZE, BIAS_SIZE = 0.03, 0.4
"""What data sheets of consumer sensors say beforehand: 3 % of response, 40 mg of bias [m/s^2]."""
GYRO_BIAS_SIZE, G_SIZE = np.radians(1.0), np.radians(0.1) / 9.80665
"""1 deg/s of bias [rad/s], 0.1 deg/s/g of g-sensitivity [rad/s/(m/s^2)]."""
ACCELEROMETER_SIZE = np.array([RESPONSE_SIZE] * 9 + [BIAS_SIZE] * 3)
GYROSCOPE_SIZE = np.array([RESPONSE_SIZE] * 3 + [GYRO_BIAS_SIZE] + [G_SIZE] * 3)


@dataclass(frozen=True)
class JointTurn:
    """A turn of one joint and back, at a pose.

    Attributes:
        pose: Index of the pose.
        joint: Index of the joint.
        amplitude: How far it turns, signed [rad].
        rate: How fast [rad/s].
    """

    pose: int
    joint: int
    amplitude: float
    rate: float


@dataclass(frozen=True)
class Design:
    """A designed calibration.

    Attributes:
        q: Joint angles of the poses in their order, shape (n, n_joints) [rad].
        turns: At those poses.
        dwell: At each pose [s].
        accelerometer: Predicted standard uncertainty by the names of `ACCELEROMETER`.
        gyroscope: Predicted standard uncertainty by the names of `GYROSCOPE_AXIS`.
    """

    q: np.ndarray
    turns: list[JointTurn]
    dwell: float
    accelerometer: dict[str, float]
    gyroscope: dict[str, float]


@dataclass(frozen=True)
class Wanted:
    """What to design.

    Attributes:
        poses: How many poses.
        turns: How many turns.
        joints: Names of those that may move; the last three that carry the sensor if None.
        criterion: "D" or "A".
        dwell: At each pose [s].
        amplitude: Of a turn [rad].
        speed: Of a turn, as a fraction of the joint's limit.
        seed: Of the candidates.
    """

    poses: int = 12
    turns: int = 9
    joints: tuple[str, ...] | None = None
    criterion: Criterion = "D"
    dwell: float = 5.0
    amplitude: float = float(np.radians(90))
    speed: float = 0.4
    seed: int = 0


class Designer:
    """Designs calibrations of one sensor on one arm.

    Args:
        robot: The arm.
        sensor: Where it sits, and its data sheet.

    Raises:
        InputError: The arm has no such link; names the one that its last joint moves.
    """

    def __init__(self, robot: Robot, sensor: Sensor):
        self.robot, self.sensor = robot, sensor
        self.kinematics = Kinematics(robot)
        try:
            self.kinematics.check_carrier(sensor.link)
        except NotFoundError as error:
            raise InputError(
                f"{error}; say which carries the sensor with --link, such as {self._last_moved()}"
            ) from None
        self.collision = CollisionModel(self.kinematics)
        self.margin = robot.spec.collision.margin_mm / 1000
        self.offset = Pose.from_placement(sensor.mounting)

    def noise(self, dwell: float) -> ObservationNoise:
        """How well observations with this sensor are known, each pose held for a dwell [s]."""
        parameters = self.sensor.imu()
        acc, gyr = parameters.accelerometer.triad(), parameters.gyroscope.triad()
        mean = float(np.max(acc.noise_density)) / np.sqrt(2 * dwell)
        return ObservationNoise(
            float(np.hypot(mean, acc.bias_instability)),
            float(ARM_DIRECTION),
            float(np.max(gyr.noise_density)),
            gyr.bias_instability,
        )

    def design(self, wanted: Wanted, without: Collection[tuple[float, ...]] = ()) -> Design:
        """The poses and turns that tell most.

        Args:
            wanted: How many, and how.
            without: Poses that are not to be chosen [rad].

        Raises:
            InputError: A joint does not carry the sensor, or too few poses are clear of collisions.
        """
        columns = self._columns(wanted.joints)
        candidates = self._candidates(columns, wanted.seed)
        candidates = candidates[[tuple(row) not in without for row in candidates]]
        if len(candidates) < max(wanted.poses, 4):
            raise InputError(
                f"of {2 * CANDIDATES} poses tried only {len(candidates)} are clear of collisions; "
                "let other joints move with --joints"
            )
        noise = self.noise(wanted.dwell)
        force = self.force(candidates)
        chosen = choose(
            pose_information(force, noise), wanted.poses, ACCELEROMETER_SIZE, wanted.criterion
        )
        q = candidates[chosen]
        turns = self._turns(q, columns, wanted, noise)
        order = self._order(q)
        place = {int(old): new for new, old in enumerate(order)}
        turns = sorted(
            (replace(turn, pose=place[turn.pose]) for turn in turns),
            key=lambda turn: (turn.pose, turn.joint),
        )
        return self.judged(q[order], turns, wanted.dwell)

    def judged(self, q: np.ndarray, turns: list[JointTurn], dwell: float) -> Design:
        """The predicted uncertainty of poses and turns.

        Args:
            q: Joint angles of the poses, shape (n, n_joints) [rad].
            turns: At those poses.
            dwell: At each pose [s].
        """
        noise, force = self.noise(dwell), self.force(q)
        acc = predicted_sd(pose_information(force, noise).sum(axis=0), ACCELEROMETER_SIZE)
        information = rest_information(force, dwell, noise).sum(axis=0)
        if turns:
            information = information + turn_information(*self._turn_arrays(q, turns), noise).sum(
                axis=0
            )
        gyr = predicted_sd(information, GYROSCOPE_SIZE)
        return Design(
            q,
            turns,
            dwell,
            dict(zip(ACCELEROMETER, acc.tolist(), strict=True)),
            dict(zip(GYROSCOPE_AXIS, gyr.tolist(), strict=True)),
        )

    def poses_of(self, plan: Plan) -> tuple[np.ndarray, float]:
        """The static calibration poses of a plan, shape (n, n_joints) [rad], and shortest dwell."""
        steps = [
            s
            for s in plan.steps
            if s.role == "calibration" and s.kind != "sweep" and s.end_ns > s.settled_ns
        ]
        if not steps:
            raise InputError(
                f"the protocol {plan.protocol.spec.name} has no static pose in a calibration "
                "section to compare with"
            )
        q, _, _ = plan.trajectory.at(np.array([step.settled_ns for step in steps]))
        return q, min(step.end_ns - step.settled_ns for step in steps) / 1e9

    def _columns(self, joints: tuple[str, ...] | None) -> list[int]:
        carrying = [i for i in range(len(self.robot.joint_names)) if self._carries(i)]
        if not carrying:
            raise InputError(f"no joint moves the link {self.sensor.link}; nothing can be designed")
        if joints is None:
            return carrying[-3:]
        for name in joints:
            if name not in self.robot.joint_names:
                raise NotFoundError(f"joint of {self.robot.name}", name, self.robot.joint_names)
            if self.robot.joint_names.index(name) not in carrying:
                raise InputError(f"the joint {name} does not move the link {self.sensor.link}")
        return [self.robot.joint_names.index(name) for name in joints]

    def _carries(self, joint: int) -> bool:
        return self._moves(joint, self.sensor.link)

    def _moves(self, joint: int, link: str) -> bool:
        v = np.zeros(len(self.robot.joint_names))
        v[joint] = 1.0
        motion = self.kinematics.frame_motion(link, self.robot.home, v)
        return bool(np.linalg.norm(motion.angular_velocity_in_frame) > 1e-9)

    def _last_moved(self) -> str:
        """The first link that the last joint of the arm moves: its flange, as a rule."""
        last = len(self.robot.joint_names) - 1
        return next(link for link in self.kinematics.link_names if self._moves(last, link))

    def _candidates(self, columns: list[int], seed: int) -> np.ndarray:
        home, limits = self.robot.home, self.robot.position_limits
        low, high = (
            np.maximum(limits[:, 0], home - LARGEST_SWING),
            np.minimum(limits[:, 1], home + LARGEST_SWING),
        )
        rng = np.random.default_rng(seed)
        q = np.tile(home, (2 * CANDIDATES, 1))
        drawn = np.degrees(rng.uniform(low[columns], high[columns], (2 * CANDIDATES, len(columns))))
        drawn[:CANDIDATES] = 45 * np.round(
            drawn[:CANDIDATES] / 45
        )  # faces and edges of a cube are among the best
        q[:, columns] = np.radians(np.round(drawn))  # whole degrees read well
        q = np.unique(q[((q >= limits[:, 0]) & (q <= limits[:, 1])).all(axis=1)], axis=0)
        return q[[self._clear(row) for row in q]]

    def _clear(self, q: np.ndarray) -> bool:
        nearest = self.collision.nearest(q)
        return nearest is None or nearest.distance > 2 * self.margin

    def force(self, q: np.ndarray) -> np.ndarray:
        """Specific force in the sensor at rest.

        Args:
            q: Joint angles of the poses, shape (n, n_joints) [rad].

        Returns:
            Shape (n, 3) [m/s^2].
        """
        return self.kinematics.frame_motion(
            self.sensor.link, q, offset=self.offset
        ).specific_force_in_frame(self.robot.gravity)

    def _turns(
        self, q: np.ndarray, columns: list[int], wanted: Wanted, noise: ObservationNoise
    ) -> list[JointTurn]:
        limits, speeds = self.robot.position_limits, self.robot.velocity_limits
        rate_range = self.sensor.imu().gyroscope.triad().range
        moving = [j for j in range(q.shape[1]) if self._carries(j)]
        candidates = []
        for pose, row in enumerate(q):
            for joint in moving:
                rate = min(wanted.speed * speeds[joint], 0.8 * rate_range)
                for amplitude in (wanted.amplitude, -wanted.amplitude):
                    end = row[joint] + amplitude
                    if limits[joint, 0] <= end <= limits[joint, 1] and self._sweep_is_clear(
                        row, joint, amplitude
                    ):
                        candidates.append(JointTurn(pose, joint, amplitude, float(rate)))
        if not wanted.turns:
            return []
        if len(candidates) < 3:
            raise InputError(
                "hardly a turn from these poses is clear of collisions; ask for a smaller "
                "amplitude with --turn-deg"
            )
        information = turn_information(*self._turn_arrays(q, candidates), noise)
        rests = rest_information(self.force(q), wanted.dwell, noise).sum(axis=0)
        chosen = choose(information, wanted.turns, GYROSCOPE_SIZE, wanted.criterion, rests)
        return [candidates[i] for i in sorted(set(chosen))] + [
            candidates[i] for i in _repeats(chosen)
        ]

    def _sweep_is_clear(self, q: np.ndarray, joint: int, amplitude: float) -> bool:
        path = np.tile(q, (TURN_SAMPLES, 1))
        path[:, joint] += np.linspace(0, amplitude, TURN_SAMPLES)
        return all(self._clear(row) for row in path)

    def _turn_arrays(
        self, q: np.ndarray, turns: list[JointTurn]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation vectors (m, 3), durations (m,) and mean forces (m, 3) of turns one way."""
        rotation_vectors, durations, forces = [], [], []
        for turn in turns:
            path = np.tile(q[turn.pose], (TURN_SAMPLES, 1))
            path[:, turn.joint] += np.linspace(0, turn.amplitude, TURN_SAMPLES)
            v = np.zeros_like(path)
            v[:, turn.joint] = 1.0
            motion = self.kinematics.frame_motion(self.sensor.link, path, v, offset=self.offset)
            rotation_vectors.append(motion.angular_velocity_in_frame[0] * turn.amplitude)
            durations.append(abs(turn.amplitude) / turn.rate)
            still = self.kinematics.frame_motion(self.sensor.link, path, offset=self.offset)
            forces.append(still.specific_force_in_frame(self.robot.gravity).mean(axis=0))
        return np.array(rotation_vectors), np.array(durations), np.array(forces)

    def _order(self, q: np.ndarray) -> list[int]:
        """A tour of little travel from home.

        By the nearest neighbour, then by exchanges of two legs (Croes 1958).
        """
        points = np.vstack([self.robot.home, q])
        time = np.max(np.abs(points[:, None] - points[None]) / self.robot.velocity_limits, axis=2)
        for i in range(len(points)):
            for k in range(i):
                path = points[i] + np.linspace(0, 1, TURN_SAMPLES)[:, None] * (
                    points[k] - points[i]
                )
                if not all(self._clear(row) for row in path):
                    time[i, k] = time[k, i] = time[i, k] + BLOCKED_S
        tour = [0]
        while len(tour) < len(points):
            rest = [i for i in range(len(points)) if i not in tour]
            tour.append(min(rest, key=lambda i: time[tour[-1], i]))
        for _ in range(MOST_ORDERS):
            better = _two_opt(tour, time)
            if better is None:
                break
            tour = better
        return [i - 1 for i in tour[1:]]


def _repeats(chosen: list[int]) -> list[int]:
    seen: set[int] = set()
    repeated = []
    for index in chosen:
        if index in seen:
            repeated.append(index)
        seen.add(index)
    return repeated


def _two_opt(tour: list[int], time: np.ndarray) -> list[int] | None:
    def length(candidate: list[int]) -> float:
        return float(time[candidate[:-1], candidate[1:]].sum())

    present = length(tour)
    for i in range(1, len(tour) - 1):
        for k in range(i + 1, len(tour)):
            turned = tour[:i] + tour[i : k + 1][::-1] + tour[k + 1 :]
            if length(turned) < present - 1e-9:
                return turned
    return None
