"""The simulated sensor: its clock, its packets, where it is mounted, and what field it feels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbench import plan
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.execution.truth import kinematic_truth
from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.session.plan import Plan
from testbench.records.session.samples import ImuSamples
from testbench.records.specs.magnetism import MagneticDipole
from testbench.records.specs.protocol import Environment, Sensor
from testbench.records.specs.robot import Robot
from testbench.records.specs.strict import Placement
from tests.model.dipoles import dipole_field

SECOND = 1_000_000_000
FACES = Placement(rotation_deg={"XYZ": [90, 90, 0]}, position_mm=[0, 0, 10])
PERFECT_SERVO = {
    "encoder_resolution_deg": 0.0,
    "encoder_noise_deg": 0.0,
    "velocity_noise_deg_s": 0.0,
    "repeatability_deg": 0.0,
}


class Bench:
    """The arm of a plan, with one sensor on it."""

    def __init__(
        self,
        the_plan: Plan,
        seed: int = 0,
        environment: Environment | None = None,
        name: str = "hand",
        preset: str = "ideal",
        error: Placement | None = None,
        **parameters: Any,
    ):
        spec = the_plan.robot.spec
        servo = spec.servo.model_copy(update=PERFECT_SERVO)
        robot = Robot(
            spec.model_copy(update={"servo": servo}), the_plan.robot.urdf, the_plan.robot.text
        )
        self.kinematics = Kinematics(robot)
        self.sensor = Sensor(
            preset=preset,
            link="wrist_3_link",
            mounting=FACES,
            mounting_error=error or Placement(),
            parameters=parameters,
        )
        self.arm = SimulatedArm(robot, seed)
        self.arm.prepare(the_plan)
        self.arm.kickoff()
        self.imu = SimulatedImu(
            name,
            self.sensor,
            self.kinematics,
            environment or Environment(arm_magnetism=False),
            self.arm.true_state,
            seed,
        )
        self.imu.kickoff()

    def read(self, until_s: float, chunk_s: float = 1000.0) -> ImuSamples:
        parts, now = [], 0.0
        while now < until_s:
            now = min(now + chunk_s, until_s)
            until = round(now * SECOND)
            self.arm_samples = self.arm.read(until)
            parts.append(self.imu.read(until).to_columns())
        return ImuSamples.from_columns(
            {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        )


@pytest.fixture(scope="module")
def quick_plan() -> Plan:
    return plan("quick")


def test_an_ideal_sensor_reports_the_motion_of_its_mount_at_its_own_instants(quick_plan):
    bench = Bench(quick_plan)
    samples = bench.read(20)
    q, v, a = bench.arm.true_state(samples.device_time_ns)
    motion = bench.kinematics.frame_motion("wrist_3_link", q, v, a, Pose.from_placement(FACES))
    np.testing.assert_allclose(samples.gyr, motion.angular_velocity_in_frame, atol=1e-12)
    np.testing.assert_allclose(
        samples.acc, motion.specific_force_in_frame(np.array([0, 0, -9.80665])), atol=1e-9
    )
    assert np.abs(samples.gyr).max() > 0.5
    assert not samples.saturated.any()


def test_samples_come_at_the_nominal_rate_and_none_is_taken_after_the_end(quick_plan):
    samples = Bench(quick_plan).read(5)
    np.testing.assert_array_equal(np.diff(samples.device_time_ns), 10_000_000)
    assert 499 <= len(samples) <= 501
    assert samples.device_time_ns[-1] <= 5 * SECOND


@pytest.mark.parametrize(
    ("offset_ms", "drift_ppm"), [(50.0, 100.0), (-700.0, -250.0), (0.0, 5000.0)]
)
def test_the_sensors_clock_is_ahead_by_its_offset_and_runs_fast_by_its_drift(
    quick_plan, offset_ms, drift_ppm
):
    samples = Bench(quick_plan, clock={"offset_ms": offset_ms, "drift_ppm": drift_ppm}).read(20)
    slope, start = np.polyfit(
        samples.host_time_ns.astype(float), samples.device_time_ns.astype(float), 1
    )
    assert (slope - 1) * 1e6 == pytest.approx(
        drift_ppm, abs=1e-3
    )  # without latency a sample arrives when it is taken
    assert start / 1e6 == pytest.approx(offset_ms, abs=1e-3)
    np.testing.assert_allclose(
        np.diff(samples.device_time_ns), 1e7, atol=1
    )  # its own clock sees no drift


def test_offset_and_drift_are_drawn_anew_at_each_power_up_with_the_stated_spread(quick_plan):
    clocks = []
    for seed in range(150):
        samples = Bench(
            quick_plan, seed, clock={"offset_sd_ms": 30.0, "drift_sd_ppm": 2000.0}
        ).read(3)
        slope, start = np.polyfit(
            samples.host_time_ns.astype(float), samples.device_time_ns.astype(float), 1
        )
        clocks.append([start / 1e6, (slope - 1) * 1e6])
    np.testing.assert_allclose(np.std(clocks, axis=0), [30, 2000], rtol=0.2)


def test_jitter_moves_the_instants_of_sampling_and_the_clock_does_not_notice(quick_plan):
    samples = Bench(quick_plan, clock={"jitter_us": 200.0}).read(20)
    np.testing.assert_array_equal(np.diff(samples.device_time_ns), 10_000_000)
    late = samples.host_time_ns - samples.device_time_ns
    assert late.std() / 1000 == pytest.approx(200, rel=0.1)
    assert abs(late.mean()) / 1000 < 20


def test_a_jittered_sample_holds_the_motion_of_the_moment_it_was_taken(quick_plan):
    bench = Bench(quick_plan, clock={"jitter_us": 500.0})
    samples = bench.read(20)
    q, v, a = bench.arm.true_state(samples.host_time_ns)
    motion = bench.kinematics.frame_motion("wrist_3_link", q, v, a, Pose.from_placement(FACES))
    np.testing.assert_allclose(samples.gyr, motion.angular_velocity_in_frame, atol=1e-9)


@pytest.mark.parametrize("chunk_s", [0.1, 1000.0])
def test_a_sensor_that_integrates_on_board_loses_no_turn_between_its_samples(quick_plan, chunk_s):
    bench = Bench(quick_plan, sampling="integrated", rate_hz=20.0)
    samples = bench.read(20, chunk_s)
    whole = Bench(quick_plan)
    whole.read(20)
    q, v, a = whole.arm.true_state(samples.device_time_ns)
    true = whole.kinematics.frame_motion("wrist_3_link", q, v, a, Pose.from_placement(FACES))
    walked = true.q_world_from_frame[:1]
    steps = rotation.from_rotation_vector(
        samples.gyr / 20.0
    )  # each is the mean rate over the interval before
    for step in steps[1:]:
        walked = rotation.multiply(walked, step[None])
    apart = rotation.angle(
        rotation.multiply(walked, rotation.conjugate(true.q_world_from_frame[-1:]))
    )
    assert apart[0] < 1e-9
    assert np.abs(samples.gyr).max() > 0.5
    still = np.linalg.norm(v, axis=1) < 1e-9
    np.testing.assert_allclose(
        samples.acc[still],
        true.specific_force_in_frame(np.array([0, 0, -9.80665]))[still],
        atol=0.05,
    )


def test_packets_arrive_in_order_and_never_sooner_than_the_shortest_delay(quick_plan):
    samples = Bench(quick_plan, clock={"latency_ms": 8.0, "latency_jitter_ms": 4.0}).read(25)
    assert (np.diff(samples.host_time_ns) >= 0).all()
    delay = (samples.host_time_ns - samples.device_time_ns) / 1e6
    assert delay.min() >= 8.0 - 1e-6
    assert delay.min() < 8.1
    assert (
        np.median(delay) > 8 + 4 * np.log(2) - 0.5
    )  # waiting for those before it adds to the exponential's median


def test_lost_packets_are_missing_at_the_stated_rate_and_leave_holes_in_the_counter(quick_plan):
    lost, total = 0, 0
    for seed in range(10):
        samples = Bench(quick_plan, seed, lost_packets_percent=5.0).read(25)
        assert (np.diff(samples.counter) > 0).all()
        holes = np.diff(samples.counter)
        np.testing.assert_array_equal(np.diff(samples.device_time_ns), holes * 10_000_000)
        lost += int((holes - 1).sum())
        total += int(samples.counter[-1]) + 1
    assert lost / total == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / total))


def test_without_loss_the_counter_counts_every_sample_from_zero(quick_plan):
    samples = Bench(quick_plan).read(3, chunk_s=0.1)
    np.testing.assert_array_equal(samples.counter, np.arange(len(samples)))


def heading(bench: Bench) -> float:
    samples = bench.read(1)
    q, _, _ = bench.arm.true_state(samples.device_time_ns[-1:])
    true = bench.kinematics.frame_motion(
        "wrist_3_link", q, offset=Pose.from_placement(FACES)
    ).q_world_from_frame
    assert samples.device_q is not None
    return float(
        rotation.heading_angle(rotation.multiply(samples.device_q[-1:], rotation.conjugate(true)))[
            0
        ]
    )


def test_each_power_up_and_each_sensor_has_an_earth_of_its_own_heading(quick_plan):
    headings = [
        heading(Bench(quick_plan, seed, name=name)) for seed in range(4) for name in ("arm", "hand")
    ]
    assert np.unique(np.round(headings, 6)).size == 8
    assert heading(Bench(quick_plan, 1)) == headings[3]


def test_a_mounting_error_is_felt_by_the_sensor_and_unknown_to_the_truth(quick_plan):
    error = Placement(rotation_deg={"XYZ": [3, 0, 0]}, position_mm=[0, 0, 40])
    straight, crooked = Bench(quick_plan), Bench(quick_plan, error=error)
    felt, felt_crooked = straight.read(20), crooked.read(20)
    turn = rotation.to_matrix(rotation.from_euler("XYZ", np.radians([3, 0, 0])))
    np.testing.assert_allclose(
        felt_crooked.gyr, felt.gyr @ turn, atol=1e-12
    )  # x_sensor = R' x_believed
    lever = np.abs(felt_crooked.acc - felt.acc @ turn)
    assert 0.01 < lever.max() < 5  # and it sits further out
    for bench in (straight, crooked):
        bench.truth = kinematic_truth(bench.kinematics, bench.arm_samples, bench.sensor)
    np.testing.assert_array_equal(
        straight.truth.q_world_from_sensor,
        crooked.truth.q_world_from_sensor,  # type: ignore[attr-defined]
    )


def test_the_magnetometer_feels_the_earths_field_in_its_own_axes(quick_plan):
    bench = Bench(
        quick_plan,
        environment=Environment(magnetic_field_uT=[1.0, 24.0, -39.0], arm_magnetism=False),
    )
    samples = bench.read(10)
    q, _, _ = bench.arm.true_state(samples.device_time_ns)
    motion = bench.kinematics.frame_motion("wrist_3_link", q, offset=Pose.from_placement(FACES))
    expected = [R.T @ [1.0, 24.0, -39.0] for R in motion.R_world_from_frame]
    assert samples.mag is not None
    np.testing.assert_allclose(samples.mag, expected, atol=1e-9)


def test_a_magnetised_part_of_the_arm_disturbs_the_field_that_moves_with_it(quick_plan):
    dipole = MagneticDipole(
        link="wrist_2_link", position_mm=[0, 30, 0], moment_A_m2=[0.0, 0.2, 0.1]
    )
    clean, disturbed = (
        Bench(quick_plan),
        Bench(quick_plan, environment=Environment(dipoles=[dipole], arm_magnetism=False)),
    )
    samples, undisturbed = disturbed.read(10), clean.read(10)
    q, _, _ = disturbed.arm.true_state(samples.device_time_ns)
    sensor = clean.kinematics.frame_motion("wrist_3_link", q, offset=Pose.from_placement(FACES))
    source = clean.kinematics.frame_motion(
        "wrist_2_link", q, offset=Pose(np.eye(3), np.array([0, 0.03, 0]))
    )
    apart = sensor.position - source.position
    expected = []
    for row in range(0, len(q), 50):
        field = dipole_field(
            apart[row : row + 1], source.R_world_from_frame[row] @ [0.0, 0.2, 0.1]
        )[0]
        expected.append(sensor.R_world_from_frame[row].T @ field)
    assert samples.mag is not None and undisturbed.mag is not None
    np.testing.assert_allclose((samples.mag - undisturbed.mag)[::50], expected, atol=1e-9)
    assert np.linalg.norm(expected[0]) > 1


@pytest.mark.parametrize("preset", ["xsens_dot", "matrix"])
@pytest.mark.parametrize("chunk_s", [0.1, 0.33, 10.0])
def test_reading_in_pieces_gives_the_bytes_of_reading_at_once(quick_plan, preset, chunk_s):
    for seed in range(3):
        noisy = {
            "clock": {"jitter_us": 500.0, "latency_ms": 8.0, "latency_jitter_ms": 4.0},
            "lost_packets_percent": 2.0,
        }
        whole = Bench(quick_plan, seed, preset=preset, **noisy).read(13).to_columns()
        pieces = Bench(quick_plan, seed, preset=preset, **noisy).read(13, chunk_s).to_columns()
        for key, column in whole.items():
            assert pieces[key].tobytes() == column.tobytes(), f"{key}, seed {seed}"


def test_a_sensor_slower_than_the_reading_rhythm_loses_nothing(quick_plan):
    noisy = {"clock": {"jitter_us": 50.0}, "rate_hz": 3.0}
    whole = Bench(quick_plan, 2, preset="xsens_dot", **noisy).read(13).to_columns()
    pieces = Bench(quick_plan, 2, preset="xsens_dot", **noisy).read(13, 0.1).to_columns()
    for key, column in whole.items():
        assert pieces[key].tobytes() == column.tobytes(), key


def test_a_stopped_sensor_gives_no_more_samples(quick_plan):
    bench = Bench(quick_plan)
    assert len(bench.read(1)) > 90
    bench.imu.stop()
    bench.imu.stop()
    bench.arm.read(2 * SECOND)
    assert len(bench.imu.read(2 * SECOND)) == 0


def test_the_manifest_is_told_what_a_data_sheet_says_and_nothing_of_the_errors(quick_plan):
    told = Bench(quick_plan, preset="xsens_dot", clock={"offset_ms": 50.0}).imu.describe()
    assert told["rate_hz"] == 60 and told["magnetometer"] is True and told["orientation"] is True
    assert not any("offset" in key or "bias" in key for key in told)
    assert Bench(quick_plan, preset="matrix").imu.describe()["magnetometer"] is False


def _drawn(the_plan: Plan, seed: int, part: int | None) -> tuple[np.ndarray, np.ndarray]:
    """What the gyroscope was made with, shape (12,), and what it read, shape (n, 3)."""
    bench = Bench(the_plan, seed, preset="xsens_dot")
    sensor = bench.sensor.model_copy(update={"part": part})
    imu = SimulatedImu("hand", sensor, bench.kinematics, Environment(), bench.arm.true_state, seed)
    imu.kickoff()
    bench.arm.read(2 * SECOND)
    made = imu._gyroscope.errors
    return np.concatenate([made.matrix.ravel(), made.bias]), imu.read(2 * SECOND).gyr


def test_a_part_is_the_same_in_runs_of_other_seeds_and_their_noise_is_not(quick_plan):
    (one, read), (again, other_read) = (_drawn(quick_plan, seed, 7) for seed in (1, 2))
    another, _ = _drawn(quick_plan, 1, 8)
    np.testing.assert_array_equal(one, again)
    assert (one != another).all()
    assert np.abs(read[:90] - other_read[:90]).max() > 1e-5


def test_without_a_number_of_its_own_a_part_is_that_of_the_seed(quick_plan):
    for one, other in zip(_drawn(quick_plan, 3, None), _drawn(quick_plan, 3, 3), strict=True):
        np.testing.assert_array_equal(one, other)
