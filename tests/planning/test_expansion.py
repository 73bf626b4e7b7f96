"""Expansion: loops, includes and expressions become commands with numbers."""

import numpy as np
import pytest

from testbench.exceptions import FileProblems
from testbench.planning.expansion import SineCommand, TrapezoidCommand, expand
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import load_robot

ROBOT = load_robot("ur3e")
HEAD = """\
name: part
purpose: For a test
robot: ur3e
sensors: {hand: {preset: ideal, link: tool0}}
"""


def commands(tmp_path, text, name="part.yaml", **others):
    for other, content in others.items():
        (tmp_path / f"{other}.yaml").write_text(HEAD + content)
    file = tmp_path / name
    file.write_text(HEAD + text)
    return expand(load_protocol(file), ROBOT)


def test_the_published_evaluation_has_its_315_poses_in_order():
    poses = [c for c in expand(load_protocol("elbow_flexion"), ROBOT) if c.section == "evaluation"]
    expected = [
        (180 + d, -90, -90, 0, 90 - d, f)
        for d in np.arange(-20, 21, 2)
        for f in np.arange(0, 71, 5)
    ]  # Castellanos Alonso 2023, table 3.7
    assert len(poses) == 315
    np.testing.assert_allclose(np.degrees([c.target for c in poses]), expected, atol=1e-12)
    assert {c.dwell for c in poses} == {2.0}
    assert poses[0].variables == {"misalignment_deg": -20.0, "flexion_deg": 0.0}
    assert poses[1].name == "evaluation, misalignment_deg -20, flexion_deg 5"


def test_the_last_variable_of_a_loop_changes_fastest_and_loops_nest(tmp_path):
    text = """
variables: {a: [1, 2], b: [10, 20], c: {start: 3, stop: 1, step: -2}, scale: 2}
sections:
  - name: s
    for_each: [a, b]
    steps:
      - {dwell_s: a * scale}
      - for_each: [c]
        steps: [{name: inner, dwell_s: a + b + c}]
"""
    found = commands(tmp_path, text)
    assert [c.dwell for c in found] == [2, 14, 12, 2, 24, 22, 4, 15, 13, 4, 25, 23]
    assert found[0].variables == {"a": 1, "b": 10}
    assert found[1].variables == {"a": 1, "b": 10, "c": 3}
    assert [c.name for c in found[:2]] == ["s, a 1, b 10", "inner"]


def test_angles_by_joint_name_leave_the_other_joints_where_they_are(tmp_path):
    (command,) = commands(
        tmp_path,
        "sections: [{name: s, steps: [{move_to_deg: {elbow_joint: -45, wrist_3_joint: 2 * "
        "15}}]}]\n",
    )
    np.testing.assert_allclose(
        np.degrees(command.target), [np.nan, np.nan, -45, np.nan, np.nan, 30]
    )


def test_home_is_the_robots(tmp_path):
    (command,) = commands(tmp_path, "sections: [{name: s, steps: [{move_to: home}]}]\n")
    np.testing.assert_array_equal(command.target, ROBOT.home)


def test_sweeps_come_out_in_radians_with_their_defaults(tmp_path):
    text = """
variables: {a_deg: 30, f_hz: 0.5}
sections:
  - name: s
    steps:
      - sweep:
          wrist_3_joint: {sine: {amplitude_deg: a_deg, frequency_hz: f_hz, cycles: 3}}
          wrist_2_joint:
            sine:
              amplitude_deg: 10
              frequency_hz: 2 * f_hz
              cycles: 2
              ramp_cycles: 0.5
              phase_deg: 90
      - sweep: {elbow_joint: {trapezoid: {amplitude_deg: -20, rate_deg_s: 10, hold_s: 0.5}}}
"""
    together, alone = commands(tmp_path, text)
    assert together.sweeps == (
        SineCommand(5, np.radians(30), 0.5, 3, 1.0, 0.0),
        SineCommand(4, np.radians(10), 1.0, 2, 0.5, np.radians(90)),
    )
    assert alone.sweeps == (TrapezoidCommand(2, np.radians(-20), np.radians(10), 1, 0.5),)


def test_motion_is_the_nearest_that_is_stated(tmp_path):
    text = """
motion: {speed: 0.1}
sections:
  - {name: a, steps: [{dwell_s: 1}, {dwell_s: 1, motion: {speed: 0.2}}]}
  - name: b
    motion: {speed: 0.3}
    steps:
      - {dwell_s: 1}
      - {motion: {speed: 0.4}, steps: [{dwell_s: 1}, {dwell_s: 1, motion: {speed: 0.5}}]}
"""
    assert [c.motion.speed for c in commands(tmp_path, text)] == [0.1, 0.2, 0.3, 0.4, 0.5]


def test_an_included_protocol_gives_its_steps_to_the_section_that_includes_it(tmp_path):
    other = """
variables: {rest_s: 3}
motion: {speed: 0.2}
sections:
  - {name: x, role: calibration, steps: [{dwell_s: rest_s}]}
  - {name: y, steps: [{dwell_s: 2 * rest_s, motion: {speed: 0.9}}]}
"""
    text = """
variables: {rest_s: 1}
motion: {speed: 0.1}
sections:
  - {name: before, steps: [{dwell_s: rest_s}]}
  - {name: taken, role: reference, include: other.yaml}
  - {name: faster, include: other.yaml, motion: {speed: 0.7}}
"""
    found = commands(tmp_path, text, other=other)
    assert [(c.section, c.role, c.dwell, c.motion.speed) for c in found] == [
        ("before", "evaluation", 1, 0.1),
        ("taken", "reference", 3, 0.2),
        ("taken", "reference", 6, 0.9),
        ("faster", "evaluation", 3, 0.7),
        ("faster", "evaluation", 6, 0.9),
    ]
    assert found[1].place == f"{tmp_path / 'other.yaml'}:9"


def test_includes_of_includes_are_followed(tmp_path):
    inner = "sections: [{name: z, steps: [{dwell_s: 7}]}]\n"
    middle = (
        "sections: [{name: y, role: calibration, include: inner.yaml}, {name: w, steps: "
        "[{dwell_s: 8}]}]\n"
    )
    found = commands(
        tmp_path, "sections: [{name: x, include: middle.yaml}]\n", inner=inner, middle=middle
    )
    assert [(c.section, c.role, c.dwell) for c in found] == [
        ("x", "evaluation", 7),
        ("x", "evaluation", 8),
    ]


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (
            "move_to_deg: [1, 2]",
            (
                r"part\.yaml:9:9: .*: 2 joint angles given; ur3e has 6: shoulder_pan_joint, "
                r".*wrist_3_joint"
            ),
        ),
        ("move_to_deg: {hand: 1}", "unknown joint of ur3e 'hand'; known: shoulder_pan_joint"),
        (
            "move_to_deg: {elbow_joint: turn}",
            "unknown variable 'turn' in 'turn'; known: rest_s, pi",
        ),
        (
            "move_to_deg: {elbow_joint: many}",
            "the variable 'many' has 2 values; name it in a for_each around this step",
        ),
        ("move_to_deg: {elbow_joint: 1e9}", r"1e\+09 must be at most 36000"),
        (
            "sweep: {hand: {sine: {amplitude_deg: 1, frequency_hz: 1, cycles: 1}}}",
            "unknown joint of ur3e 'hand'",
        ),
        (
            "sweep: {elbow_joint: {sine: {amplitude_deg: 1, frequency_hz: -1, cycles: 1}}}",
            "-1 must be greater than 0",
        ),
        (
            "sweep: {elbow_joint: {sine: {amplitude_deg: 1, frequency_hz: 1, cycles: 2.5}}}",
            "2.5 must be a whole number",
        ),
        (
            "sweep: {elbow_joint: {sine: {amplitude_deg: 1, frequency_hz: 1, cycles: rest_s / 2}}}",
            "'rest_s / 2' is 0.5; it must",
        ),
        (
            (
                "sweep: {elbow_joint: {sine: {amplitude_deg: 1, frequency_hz: 1, cycles: 1, "
                "ramp_cycles: 0.1}}}"
            ),
            "at least 0.5",
        ),
        (
            "sweep: {elbow_joint: {trapezoid: {amplitude_deg: 1, rate_deg_s: 0}}}",
            "0 must be greater than 0",
        ),
        (
            "sweep: {elbow_joint: {trapezoid: {amplitude_deg: 1, rate_deg_s: 1e-5}}}",
            "would last 200000 s, more than the 86400 s",
        ),
        (
            "sweep: {elbow_joint: {trapezoid: {amplitude_deg: 1, rate_deg_s: 1e9}}}",
            "must be at most 36000",
        ),
        ("dwell_s: 1 / (rest_s - 1)", "has no value: division by zero"),
        ("dwell_s: -rest_s", "'-rest_s' is -1; it must be at least 0"),
    ],
)
def test_a_number_that_makes_no_sense_is_refused_at_its_place(tmp_path, step, message):
    text = (
        f"variables: {{rest_s: 1, many: [1, 2]}}\nsections:\n  - name: s\n    steps:\n      - "
        f"{step}\n"
    )
    with pytest.raises(FileProblems, match=message):
        commands(tmp_path, text)


def test_too_many_steps_are_refused_before_they_are_made(tmp_path):
    text = """
variables: {a: {start: 1, stop: 1000, step: 1}, b: {start: 1, stop: 1000, step: 1}}
sections: [{name: s, for_each: [a, b], steps: [{dwell_s: 0.1}]}]
"""
    with pytest.raises(
        FileProblems, match="the loop over a, b repeats its steps more than 100000 times"
    ):
        commands(tmp_path, text)
    nested = """
variables: {a: {start: 1, stop: 1000, step: 1}, b: {start: 1, stop: 1000, step: 1}}
sections: [{name: s, for_each: [a], steps: [{for_each: [b], steps: [{dwell_s: 0.1}]}]}]
"""
    with pytest.raises(FileProblems, match="the protocol has more than 100000 steps"):
        commands(tmp_path, nested)
