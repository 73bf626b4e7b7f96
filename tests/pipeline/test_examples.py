"""Recordings to try the bench with: what they are of is known."""

from __future__ import annotations

import shlex

import numpy as np
import pytest

from testbench.exceptions import InputError, NotFoundError
from testbench.frames import NANOSECONDS
from testbench.model import example_motions, rotation
from testbench.pipeline.examples import EXAMPLES, write_example
from testbench.records.session.session import Session
from testbench.reporting.sections.run import simulated_parts
from tests.command_line import command


def test_examples_are_the_same_every_time_and_replace_nothing(tmp_path) -> None:
    first, second = (write_example("phone", tmp_path / name) for name in ("a", "b"))
    assert [file.name for file in first] == ["Accelerometer.csv", "Gyroscope.csv", "optical.csv"]
    assert [a.read_bytes() == b.read_bytes() for a, b in zip(first, second, strict=True)] == [
        True
    ] * 3
    with pytest.raises(InputError, match="exists"):
        write_example("phone", tmp_path / "a")
    with pytest.raises(NotFoundError, match="squat, phone, walk, sides"):
        write_example("jump", tmp_path / "c")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_files_with_a_header_say_that_they_are_simulated(tmp_path) -> None:
    for file in write_example("squat", tmp_path / "squat"):
        assert "Measurement Mode:,simulated" in file.read_text(encoding="utf-8")


def test_what_reads_them_has_every_page_say_that_they_are_simulated(
    tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    write_example("phone", tmp_path / "phone")
    assert command(*shlex.split(EXAMPLES["phone"].next.format(folder="phone"))[1:]) == 0
    assert "the samples come from a model" in capsys.readouterr().out
    session = Session(tmp_path / "logs" / "phone")
    assert session.simulated == ["sensors"]
    assert simulated_parts(session) == "models of the sensors"
    assert command("report", session.path) == 0
    page = (session.path / "report.html").read_text(encoding="utf-8")
    assert "these samples come from models of the sensors" in page


def test_the_knee_bends_about_one_axis_as_far_as_it_should() -> None:
    bodies = example_motions.squats()
    time_ns = bodies["RFemur"].time_ns
    thigh, shank = (bodies[name].at(time_ns).q_world_from_frame for name in ("RFemur", "RTibia"))
    joint = rotation.multiply(rotation.conjugate(thigh), shank)
    since = rotation.multiply(joint, np.tile(rotation.conjugate(joint[0]), (len(joint), 1)))
    turns = np.degrees(rotation.to_rotation_vector(since))
    assert np.linalg.norm(turns, axis=1).max() == pytest.approx(example_motions.KNEE_DEG, rel=0.1)
    bent = turns[np.linalg.norm(turns, axis=1) > 10]
    axes = bent / np.linalg.norm(bent, axis=1, keepdims=True)
    np.testing.assert_allclose(axes @ axes[0], 1.0, atol=1e-6)


def test_the_foot_goes_as_far_as_its_strides_and_stands_in_each() -> None:
    foot = example_motions.walking_foot()
    way = foot.at(foot.time_ns).position
    far = example_motions.STRIDES * example_motions.STRIDE_M
    assert way[-1, 0] - way[0, 0] == pytest.approx(far, abs=1e-6)
    flat = example_motions.STANDS_S + (np.arange(1, example_motions.STRIDES) + 0.25) * (
        example_motions.STRIDE_S
    )
    motion = foot.at((flat * NANOSECONDS).astype(np.int64))
    np.testing.assert_allclose(motion.velocity, 0.0, atol=1e-3)
    np.testing.assert_allclose(motion.angular_velocity, 0.0, atol=1e-3)
    assert way[:, 2].min() > 0


def test_the_command_lists_them_and_names_what_reads_them(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert command("example") == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in EXAMPLES)
    assert command("example", "walk") == 0
    assert "next: testbench simulate walk/foot.csv" in capsys.readouterr().out
    assert command("example", "walk") == 2
    assert command("example", "--out", "x") == 2
