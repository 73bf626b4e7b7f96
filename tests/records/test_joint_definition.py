"""Joint definitions as a person writes them: what each means, and what is refused with which
words.
"""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from testbench.exceptions import FileProblems
from testbench.model.decomposition import AxisAngle, Euler, Hinge, RotationVector, SwingTwist
from testbench.model.joint_angle import decomposition_of
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.protocol import JointDefinition
from testbench.records.specs.protocol_file import load_protocol


@pytest.mark.parametrize(
    ("written", "label", "flexion", "decomposition"),
    [
        ({"sequence": "ZXZ"}, "ZXZ", "second", Euler("ZXZ")),
        ({"definition": {"euler": "XYZ"}}, "XYZ", "second", Euler("XYZ")),
        ({"definition": {"euler": "XYZ"}, "flexion": "third"}, "XYZ", "third", Euler("XYZ")),
        (
            {"definition": "elbow"},
            "isb_elbow",
            "first",
            Euler("ZXY", (1, 1, 1), ("flexion", "carrying angle", "pronation")),
        ),
        (
            {"definition": {"isb": "knee", "side": "left"}},
            "isb_knee_left",
            "first",
            Euler("ZXY", (-1, -1, -1), ("flexion", "adduction", "internal rotation")),
        ),
        (
            {"definition": {"grood_suntay": "knee"}},
            "grood_suntay_knee",
            "first",
            Euler("XYZ", (-1, 1, -1), ("flexion", "adduction", "external rotation")),
        ),
        ({"definition": {"hinge": [0, 0, 2]}}, "hinge_z", "first", Hinge((0, 0, 1))),
        ({"definition": {"hinge": [0, -1, 0]}}, "hinge_minus_y", "first", Hinge((0, -1, 0))),
        (
            {"definition": {"swing_twist": [0.6, 0, -0.8]}},
            "swing_twist_0p600_0p000_m0p800",
            "first",
            SwingTwist((0.6, 0, -0.8)),
        ),
        ({"definition": "axis_angle"}, "axis_angle", "first", AxisAngle()),
        (
            {"definition": "rotation_vector", "flexion": "second"},
            "rotation_vector",
            "second",
            RotationVector(),
        ),
    ],
)
def test_what_is_written_says_label_flexion_and_mathematics(written, label, flexion, decomposition):
    written = {
        key: {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in value.items()}
        if isinstance(value, dict)
        else value
        for key, value in written.items()
    }
    angle = FlexionAngle.model_validate(written)
    assert (angle.label, angle.flexion) == (label, flexion)
    assert decomposition_of(angle) == decomposition
    assert FlexionAngle.model_validate(angle.model_dump()) == angle
    assert FlexionAngle.model_validate_json(angle.model_dump_json()) == angle


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({}, "needs either a sequence or a definition"),
        (
            {"sequence": "ZXZ", "definition": "knee"},
            "needs either a sequence or a definition, not both",
        ),
        (
            {"definition": {}},
            "takes exactly one of euler, isb, grood_suntay, hinge, swing_twist, not none",
        ),
        (
            {"definition": {"isb": "knee", "euler": "XYZ"}},
            "takes exactly one of .*, not euler and isb",
        ),
        ({"definition": {"hinge": [0.0, 0.0, 0.0]}}, "an axis needs a direction"),
        (
            {"definition": {"euler": "XYZ", "side": "left"}},
            "side goes with isb and grood_suntay, not with euler",
        ),
        (
            {"definition": "grood_suntay"},
            "grood_suntay needs to be told of what, such as {grood_suntay: knee}",
        ),
        ({"definition": "hinge"}, r"such as {hinge: \[0, 0, 1\]}"),
        ({"definition": "shoulder"}, "'elbow', 'wrist', 'hip', 'knee', 'ankle'"),
        ({"definition": {"isb": "thumb"}}, "'elbow', 'wrist', 'hip', 'knee' or 'ankle'"),
    ],
)
def test_what_makes_no_sense_is_refused(written, message):
    with pytest.raises(ValidationError, match=message):
        FlexionAngle.model_validate(written)


def test_one_definition_cannot_stand_twice_under_two_names():
    with pytest.raises(ValidationError, match="the definition isb_elbow stands more than once"):
        JointDefinition.model_validate(
            {
                "proximal": "a",
                "distal": "b",
                "definition": "elbow",
                "compare": [{"definition": {"isb": "elbow"}}],
            }
        )


def test_a_joint_keeps_all_its_words_in_its_own_definition():
    joint = JointDefinition.model_validate(
        {
            "proximal": "a",
            "distal": "b",
            "definition": {"hinge": [0.0, 0.0, 1.0]},
            "sign": -1,
            "continuous": True,
        }
    )
    own = joint.definitions()[0]
    assert (own.label, own.flexion, own.sign, own.continuous) == ("hinge_z", "first", -1, True)


def test_a_limit_may_name_a_definition_of_the_joint_and_no_other(tmp_path):
    text = load_protocol("quick").document.text.replace(
        "{sequence: YXZ, flexion: second, sign: -1}", "{definition: elbow}"
    )
    file = tmp_path / "quick.yaml"
    file.write_text(
        text.replace("section: static, max", "section: static, sequence: isb_elbow, max")
    )
    assert load_protocol(file).spec.accept[0].sequence == "isb_elbow"
    file.write_text(
        text.replace("section: static, max", "section: static, sequence: isb_knee, max")
    )
    with pytest.raises(
        FileProblems,
        match="unknown Euler sequence or definition of this joint 'isb_knee'; known: ZXZ, "
        "isb_elbow",
    ):
        load_protocol(file)


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("{isb: thumb}", "must be 'elbow', 'wrist', 'hip', 'knee' or 'ankle', not 'thumb'"),
        ("{eulr: ZXZ}", "unknown key 'eulr'; did you mean 'euler'"),
        ("{hinge: [0, 0]}", "must have at least 3 entries"),
        ("shoulder", "must be 'elbow'"),
    ],
)
def test_a_mistake_in_a_file_is_answered_at_its_place_with_what_is_allowed(
    tmp_path, definition, message
):
    text = load_protocol("quick").document.text.replace(
        "sequence: ZXZ", f"definition: {definition}", 1
    )
    file = tmp_path / "quick.yaml"
    file.write_text(text)
    with pytest.raises(FileProblems) as caught:
        load_protocol(file)
    (problem,) = caught.value.problems
    assert message in problem.message
    assert problem.path.startswith("joints.elbow")
