"""Sensors that ride on a motion from a file: what they read, what their session says, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats.motion_file import read_motion
from testbench.pipeline.audit import audit_sensors
from testbench.pipeline.request import SimulateRequest
from testbench.pipeline.simulate import simulate
from tests.command_line import command


def poses(seconds: float = 30.0):
    """A body that rests, tumbles about while it swings, and rests."""
    t = np.arange(round(100 * seconds)) / 100
    size = np.clip(np.minimum(t - 4, seconds - 4 - t), 0, 1)
    size = size**3 * (10 - 15 * size + 6 * size**2)
    angles = size[:, None] * np.column_stack(
        [np.sin(2 * t), 0.7 * np.sin(1.3 * t), 0.5 * np.sin(3.1 * t)]
    )
    q = Rotation.from_euler("ZYX", angles).as_quat(scalar_first=True)
    return t, q, 0.2 * size[:, None] * np.column_stack([np.sin(2 * t), np.cos(t) - 1, 0 * t])


def write_motion(path, t, bodies):
    arrays = {f"{name}.q": q for name, (q, _) in bodies.items()}
    arrays |= {f"{name}.position_m": place for name, (_, place) in bodies.items()}
    np.savez(path, time_s=t, **arrays)


def as_csv(path, t, q, place, prefix=""):
    titles = ["time_s", *(f"{prefix}q_{c}" for c in "wxyz"), *(f"{prefix}{c}_m" for c in "xyz")]
    np.savetxt(
        path, np.column_stack([t, q, place]), delimiter=",", header=",".join(titles), comments=""
    )
    return path


def test_an_ideal_sensor_reads_the_motion_and_a_filter_finds_it_again(tmp_path):
    t, q, place = poses()
    file = as_csv(tmp_path / "tumble.csv", t, q, place)
    session = simulate(
        SimulateRequest(motion=str(file), out=str(tmp_path / "ideal"), preset="ideal")
    )
    assert session.simulated == ["sensors"]
    samples, body = session.imu("sensor"), read_motion(file)["sensor"]
    motion = body.at(samples.host_time_ns)
    np.testing.assert_allclose(samples.gyr, motion.angular_velocity_in_frame, atol=1e-6)
    force = motion.specific_force_in_frame(np.array([0, 0, -9.80665]))
    np.testing.assert_allclose(samples.acc, force, atol=1e-6)
    evaluated = evaluate(session, estimate(session, ["vqf_6d"]))
    (row,) = [row for row in evaluated.orientation if row.filter == "vqf_6d"]
    assert row.total_rmse_deg < 1.0


def test_several_bodies_have_sensors_of_their_own(tmp_path):
    t, q, place = poses(12)
    write_motion(tmp_path / "two.npz", t, {"hand": (q, place), "foot": (q, place + 1)})
    asked = SimulateRequest(
        motion=str(tmp_path / "two.npz"),
        out=str(tmp_path / "s"),
        sensors=("foot=ngimu",),
        seed=4,
    )
    session = simulate(asked)
    assert session.sensor_names == ["hand", "foot"]
    records = session.manifest.sensors
    assert (records["hand"].preset, records["foot"].preset) == ("xsens_dot", "ngimu")
    assert (records["hand"].rate_hz, records["foot"].rate_hz) == (60, 400)
    again = simulate(asked.model_copy(update={"out": str(tmp_path / "t")}))
    np.testing.assert_array_equal(session.imu("foot").acc, again.imu("foot").acc)
    other = simulate(asked.model_copy(update={"out": str(tmp_path / "u"), "seed": 5}))
    first = [one.imu("foot").acc[:1000].mean(axis=0) for one in (session, other)]
    assert np.abs(first[0] - first[1]).max() > 1e-3  # other biases


def test_a_late_accelerometer_reads_what_was(tmp_path):
    """The preset of the BNO080 has its accelerometer 5 ms behind."""
    t, q, place = poses(40)
    write_motion(tmp_path / "one.npz", t, {"leg": (q, 0.02 * place)})
    preset = tmp_path / "late.yaml"
    preset.write_text(
        "rate_hz: 100\naccelerometer: {range_g: 16, noise_density_ug_sqrthz: [10, 10, 10]}\n"
        "gyroscope: {range_deg_s: 2000, noise_density_deg_s_sqrthz: [0.001, 0.001, 0.001]}\n"
        "clock: {accelerometer_lag_ms: 40}\n"
    )
    session = simulate(
        SimulateRequest(
            motion=str(tmp_path / "one.npz"), out=str(tmp_path / "s"), preset=str(preset)
        )
    )
    samples, body = session.imu("leg"), read_motion(tmp_path / "one.npz")["leg"]
    now, before = (body.at(samples.host_time_ns - late) for late in (0, 40_000_000))
    np.testing.assert_allclose(samples.gyr, now.angular_velocity_in_frame, atol=1e-3)
    down = np.array([0, 0, -9.80665])
    later = slice(10, None)
    np.testing.assert_allclose(
        samples.acc[later], before.specific_force_in_frame(down)[later], atol=5e-3
    )
    timing = audit_sensors(session)["leg"].timing  # and found again
    assert timing.acc_after_gyr_ms == pytest.approx(40, abs=3 * timing.acc_after_gyr_sd_ms + 1)
    assert timing.acc_after_gyr_sd_ms < 8


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, q, p: (t[::-1], q, p), "time_s must increase"),
        (lambda t, q, p: (t[:3], q[:3], p[:3]), "6 times or more"),
        (lambda t, q, p: (t, 1.2 * q, p), "not of unit length"),
        (lambda t, q, p: (t, np.where(t[:, None] > 5, np.nan, q), p), "that are no numbers"),
    ],
)
def test_what_is_no_motion_is_refused_in_words(tmp_path, change, said):
    file = as_csv(tmp_path / "m.csv", *change(*poses(12)))
    with pytest.raises(FileProblems, match=said):
        simulate(SimulateRequest(motion=str(file), out=str(tmp_path / "s")))
    assert not (tmp_path / "s").exists()


def test_a_file_that_lacks_positions_or_is_none_says_so(tmp_path):
    np.savez(tmp_path / "m.npz", time_s=np.arange(10.0), **{"leg.q": np.eye(4)[np.zeros(10, int)]})
    with pytest.raises(FileProblems, match="body leg needs 10 orientations"):
        read_motion(tmp_path / "m.npz")
    (tmp_path / "n.npz").write_text("nothing")
    with pytest.raises(FileProblems, match="not a readable"):
        read_motion(tmp_path / "n.npz")


def test_presets_and_bodies_that_do_not_exist_are_named(tmp_path):
    file = as_csv(tmp_path / "m.csv", *poses(12), prefix="leg.")
    asked = SimulateRequest(motion=str(file), out=str(tmp_path / "s"))
    with pytest.raises(NotFoundError, match="leg"):
        simulate(asked.model_copy(update={"sensors": ("arm=ideal",)}))
    with pytest.raises(NotFoundError, match="ngimu"):
        simulate(asked.model_copy(update={"preset": "nonesuch"}))
    with pytest.raises(InputError, match="BODY=PRESET"):
        simulate(asked.model_copy(update={"sensors": ("leg",)}))


def test_the_command_makes_a_session_that_says_it_is_simulated(tmp_path, capsys):
    file = as_csv(tmp_path / "m.csv", *poses(12))
    assert command("simulate", file, "--out", tmp_path / "s", "--json") == 0
    assert json.loads(capsys.readouterr().out)["simulated"] == ["sensors"]
