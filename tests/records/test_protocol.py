"""Protocols: what ships, what the words mean, the schema for editors, and that the reference
explains every key.
"""

import json
import re
import sys
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from pydantic import BaseModel

from testbench.cli import main
from testbench.exceptions import FileProblems, NotFoundError
from testbench.records.disk.yaml_file import parse_yaml
from testbench.records.specs.protocol import (
    FILTER_NAMES,
    JOINT_METRICS,
    SENSOR_METRICS,
    ProtocolSpec,
)
from testbench.records.specs.protocol_chain import CHAIN_METRICS
from testbench.records.specs.protocol_file import list_protocols, load_protocol
from testbench.records.specs.protocol_schema import protocol_schema, schema_text
from testbench.records.specs.protocol_steps import Range
from testbench.records.specs.sensor import ImuParameters, list_presets, load_preset
from testbench.records.specs.shipped import shipped_folder

SHIPPED = sorted(shipped_folder("protocols").glob("*.yaml"))
REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "protocol_reference.md"
MINIMAL = """\
name: least
purpose: As little as a protocol can hold
robot: ur3e
sensors: {hand: {preset: ideal, link: tool0}}
sections: [{name: rest, steps: [{dwell_s: 1}]}]
"""


def read(tmp_path, text):
    file = tmp_path / "least.yaml"
    file.write_text(text)
    return load_protocol(file)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_protocol_is_named_like_its_file_and_says_what_it_is_for(file):
    protocol = load_protocol(file.stem)
    assert protocol.spec.name == file.stem
    assert protocol.spec.purpose == list_protocols()[file.stem]
    assert protocol.document.text == file.read_text()
    assert file.read_text().startswith("# yaml-language-server: $schema=schema.json\n")


def test_the_protocols_of_the_reference_ship():
    assert {
        "calibration_2d",
        "calibration_3d",
        "elbow_disturbed",
        "elbow_dynamic",
        "elbow_flexion",
        "elbow_rates",
        "magnetic_passage",
        "orthogonality",
        "quick",
        "static_noise",
    } <= set(list_protocols())


def test_every_file_that_makes_up_a_protocol_is_kept():
    assert set(load_protocol("elbow_flexion").texts()) == {
        "elbow_flexion.yaml",
        "calibration_3d.yaml",
        "calibration_2d.yaml",
    }


def test_an_unknown_name_lists_the_protocols_that_ship():
    with pytest.raises(
        NotFoundError,
        match="unknown protocol 'elbow'; known: axis_identification, beta_zeta, calibration_2d, ",
    ):
        load_protocol("elbow")


def test_the_least_protocol_has_the_documented_defaults(tmp_path):
    spec = read(tmp_path, MINIMAL).spec
    assert (spec.motion.speed, spec.motion.acceleration, spec.motion.jerk) == (0.5, 0.5, 0.5)
    assert spec.sections[0].role == "evaluation"
    assert spec.estimate.filters == ["device", "vqf_6d", "vqf_9d", "fusion"]
    assert (spec.estimate.align, spec.estimate.align_clock, spec.estimate.calibrate) == (
        "reference_pose",
        True,
        "static_poses",
    )
    assert spec.sensors["hand"].mounting.position_mm == [0, 0, 0]
    assert spec.accept == []


def test_a_protocol_survives_being_written_and_read_again():
    for file in SHIPPED:
        spec = load_protocol(file).spec
        assert ProtocolSpec.model_validate(spec.model_dump()) == spec
        assert ProtocolSpec.model_validate_json(spec.model_dump_json()) == spec


@pytest.mark.parametrize(
    ("mounting", "said"),
    [
        (
            "{rotation_deg: [0, 0, 8]}",
            (
                r"rotation_deg: angles need the Euler sequence they belong to, such as {XYZ: \[0, "
                r"0, "
                r"8\]}"
            ),
        ),
        (
            "{position_mm: [0, 0, 10000]}",
            "a sensor 10 m from its link is not meant; positions are in millimetres",
        ),
    ],
)
def test_a_mounting_that_cannot_be_meant_is_refused_with_what_is(tmp_path, mounting, said):
    with pytest.raises(FileProblems, match=said):
        read(tmp_path, MINIMAL.replace("preset: ideal", f"preset: ideal, mounting: {mounting}"))


@pytest.mark.parametrize(
    ("start", "stop", "step", "values"),
    [
        (0, 70, 35, [0, 35, 70]),
        (-1, 1, 1, [-1, 0, 1]),
        (3, 1, -1, [3, 2, 1]),
        (5, 5, 1, [5]),
        (0, 0.3, 0.1, [0, 0.1, 0.2, 0.3]),
    ],
)
def test_a_range_holds_both_its_ends(start, stop, step, values):
    assert Range(start=start, stop=stop, step=step).values() == pytest.approx(values, abs=1e-12)


def test_parameters_change_those_of_the_preset_and_leave_the_rest(tmp_path):
    text = MINIMAL.replace(
        "preset: ideal",
        "preset: xsens_dot, parameters: {rate_hz: 120, gyroscope: {range_deg_s: 500}, "
        "magnetometer: null}",
    )
    imu = read(tmp_path, text).spec.sensors["hand"].imu()
    preset = load_preset("xsens_dot")
    assert (imu.rate_hz, imu.gyroscope.range_deg_s, imu.magnetometer) == (120, 500, None)
    assert imu.gyroscope.noise_density_deg_s_sqrthz == preset.gyroscope.noise_density_deg_s_sqrthz
    assert imu.accelerometer == preset.accelerometer


def test_a_sensor_can_be_described_without_a_preset(tmp_path):
    parameters = (
        "parameters: {rate_hz: 100, accelerometer: {range_g: 8}, gyroscope: {range_deg_s: 1000}}"
    )
    imu = read(tmp_path, MINIMAL.replace("preset: ideal", parameters)).spec.sensors["hand"].imu()
    assert (imu.rate_hz, imu.accelerometer.range_g, imu.magnetometer) == (100, 8, None)


def test_an_incomplete_sensor_is_refused_with_every_key_that_is_missing(tmp_path):
    with pytest.raises(FileProblems) as caught:
        read(tmp_path, MINIMAL.replace("preset: ideal", "parameters: {rate_hz: 100}"))
    assert [p.message for p in caught.value.problems] == [
        "the key 'accelerometer' is missing",
        "the key 'gyroscope' is missing",
    ]
    assert {(p.path, p.line) for p in caught.value.problems} == {("sensors.hand.parameters", 4)}


def test_a_sequence_that_the_joint_does_not_compute_cannot_be_limited(tmp_path):
    text = load_protocol("quick").document.text.replace(
        "section: static, max", "section: static, sequence: XYX, max"
    )
    with pytest.raises(
        FileProblems,
        match="unknown Euler sequence or definition of this joint 'XYX'; known: ZXZ, YXZ",
    ):
        read(tmp_path, text)


def test_a_variable_that_a_joint_names_must_exist(tmp_path):
    text = load_protocol("quick").document.text.replace(
        "sequence: ZXZ", "sequence: ZXZ\n    misalignment: tilt_deg", 1
    )
    with pytest.raises(
        FileProblems,
        match=r"joints\.elbow\.misalignment: unknown variable 'tilt_deg'; known: misalignment_deg",
    ):
        read(tmp_path, text)


# The schema


def test_the_committed_schema_is_current():
    file = shipped_folder("protocols") / "schema.json"
    assert file.read_text(encoding="utf-8") == schema_text(), (
        "run: testbench protocols --schema > protocols/schema.json"
    )


def test_the_command_prints_the_schema(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["testbench", "protocols", "--schema"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    assert capsys.readouterr().out == schema_text()


def entries(node, path=""):
    """Every key that the schema offers, with its entry."""
    if isinstance(node, dict):
        for key, entry in node.get("properties", {}).items():
            yield f"{path}.{key}", entry
        for key, child in node.items():
            yield from entries(child, f"{path}/{key}")


def test_every_key_of_the_schema_is_described():
    schema = protocol_schema()
    missing = []
    for path, entry in entries(schema):
        target = schema["$defs"][entry["$ref"].rsplit("/", 1)[1]] if "$ref" in entry else {}
        if not entry.get("description", target.get("description")):
            missing.append(path)
    assert missing == []


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(schema_text())
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_protocol_fits_the_schema(file, validator):
    validator.validate(parse_yaml(file.read_text(), file)[0])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("dwell_s: 1", "dwel_s: 1"),
        ("dwell_s: 1", "dwell_s: [1]"),
        ("dwell_s: 1", "dwell_s: -1"),
        ("robot: ur3e\n", ""),
        ("hand: {", "my hand: {"),
        ("preset: ideal", "preset: ideal, mounting: {rotation_deg: {ZZZ: [0, 0, 0]}}"),
        ("preset: ideal", "preset: ideal, parameters: {gyroscope: {range: 5}}"),
    ],
)
def test_the_schema_refuses_what_the_bench_refuses(old, new, validator):
    validator.validate(parse_yaml(MINIMAL, "least.yaml")[0])
    assert not validator.is_valid(parse_yaml(MINIMAL.replace(old, new), "least.yaml")[0])


# The reference


def models(model, seen=None):
    """The model and every model that its fields hold."""
    seen = set() if seen is None else seen
    if model not in seen:
        seen.add(model)
        for field in model.model_fields.values():
            for inner in inner_models(field.annotation):
                models(inner, seen)
    return seen


def inner_models(annotation):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in inner_models(part)]


def test_the_reference_explains_every_key_choice_and_name():
    text = REFERENCE.read_text(encoding="utf-8")
    words = [
        key for model in models(ProtocolSpec) | models(ImuParameters) for key in model.model_fields
    ]
    words += [*FILTER_NAMES, *JOINT_METRICS, *SENSOR_METRICS, *CHAIN_METRICS, *list_presets()]
    assert len(words) > 100
    assert sorted({word for word in words if f"`{word}`" not in text}) == []


def test_the_example_of_the_reference_is_a_protocol(tmp_path):
    (example, *_) = re.findall(
        r"```yaml\n(.*?)```", REFERENCE.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    assert read(tmp_path, example).spec.sections
