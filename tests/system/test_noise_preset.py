import json

import numpy as np
import pytest
import yaml

from testbench.exceptions import FileProblems
from testbench.pipeline.run import run
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.sensor import ImuParameters, load_preset
from tests.asking import run_of
from tests.command_line import command


def by_axis(evaluation, sensor, key):
    return {
        (row.quantity, row.axis): getattr(row, key)
        for row in evaluation.noise
        if row.sensor == sensor
    }


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A rest, measured; and the preset file made of it beside a protocol that names it."""
    folder = tmp_path_factory.mktemp("noise")
    first = run(run_of("static_noise", logs=folder / "logs"))
    assert (
        command(
            "noise", first.session.path, "--sensor", "matrix", "--out", folder / "my_matrix.yaml"
        )
        == 0
    )
    return folder, first


def test_a_measured_sensor_simulates_with_the_same_noise(measured, altered_protocol):
    folder, first = measured

    def rename(protocol):
        protocol["sensors"] = {
            "matrix": {**protocol["sensors"]["matrix"], "preset": "my_matrix.yaml"}
        }

    path = altered_protocol("static_noise", rename)
    (path.parent / "my_matrix.yaml").write_bytes((folder / "my_matrix.yaml").read_bytes())
    second = run(run_of(path, seed=7, logs=folder / "logs"))
    for key, tolerance in (("sd", 0.06), ("noise_density", 0.15)):
        before, after = (
            by_axis(first.evaluation, "matrix", key),
            by_axis(second.evaluation, "matrix", key),
        )
        assert before.keys() == after.keys()
        for axis in before:
            assert after[axis] == pytest.approx(before[axis], rel=tolerance), (key, axis)
    kept = yaml.safe_load(
        (second.session.path / "included_my_matrix.yaml").read_text(encoding="utf-8")
    )
    assert kept["description"].endswith(
        "all else copied from the preset matrix named by the session's protocol"
    )
    other = run(run_of("static_noise", seed=7, logs=folder / "logs"))
    ratio = [
        by_axis(other.evaluation, "dot", "sd")[a] / by_axis(second.evaluation, "matrix", "sd")[a]
        for a in [("acc", "x")]
    ]
    assert np.all(np.array(ratio) < 0.5)  # the noise is the part's, not anyone's


def test_what_was_measured_stands_in_the_file(measured):
    folder, first = measured
    sheet = load_yaml(folder / "my_matrix.yaml", ImuParameters).value
    density = by_axis(first.evaluation, "matrix", "noise_density")
    rounding = (
        1 / sheet.gyroscope.counts_per_deg_s / np.sqrt(12 * sheet.rate_hz / 2)
    )  # the simulated sensor rounds again
    white = [np.sqrt(density["gyr", a] ** 2 - rounding**2) for a in "xyz"]
    assert sheet.gyroscope.noise_density_deg_s_sqrthz == pytest.approx(white, rel=1e-3)
    assert sheet.accelerometer.range_g == 8  # from the data sheet: a rest does not show it
    assert f"Measured (simulated sensor matrix of session {first.session.name}, " in sheet.source
    assert "white noise of the gyroscope (x, y, z)" in sheet.source


def test_what_another_preset_gave_is_said(measured, tmp_path, capsys):
    """MATRIX has no magnetometer: one that comes with the preset was not measured, and neither file
    nor terminal hides it.
    """
    _, first = measured
    out = tmp_path / "mixed.yaml"
    assert (
        command(
            "noise", first.session.path, "--sensor", "matrix", "--like", "xsens_dot", "--out", out
        )
        == 0
    )
    sheet = load_yaml(out, ImuParameters).value
    copied = (
        "magnetometer: nothing was measured, the recording holds none; all of it copied from "
        "the preset xsens_dot"
    )
    assert sheet.magnetometer is not None
    assert copied in sheet.source
    assert copied in " ".join(capsys.readouterr().out.split())
    assert "DOT" not in sheet.description.replace("xsens_dot", "")
    assert (
        sheet.accelerometer.noise_density_ug_sqrthz
        != load_preset("xsens_dot").accelerometer.noise_density_ug_sqrthz
    )
    again = tmp_path / "again.yaml"
    assert (
        command("noise", first.session.path, "--sensor", "dot", "--like", out, "--out", again) == 0
    )
    assert (
        "copied from the preset file mixed.yaml"
        in load_yaml(again, ImuParameters).value.description
    )
    assert "magnetometer: nothing" not in again.read_text()


def test_refusals(measured, tmp_path, capsys):
    folder, first = measured
    assert command("noise", first.session.path, "--out", tmp_path / "x.yaml") == 2
    assert "say which with --sensor" in capsys.readouterr().err
    assert command("noise", first.session.path, "--sensor", "nobody") == 2
    assert (
        command("noise", first.session.path, "--sensor", "dot", "--out", folder / "my_matrix.yaml")
        == 2
    )
    assert "exists already" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    assert command("noise", first.session.path, "--sensor", "dot", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["noise"]) == 9


def test_a_preset_file_must_lie_beside_the_protocol(altered_protocol, tmp_path):
    for name, sentence in (
        ("missing.yaml", "no file 'missing.yaml'"),
        ("../../etc/x.yaml", "no file|lies elsewhere"),
    ):

        def rename(protocol, name=name):
            protocol["sensors"]["dot"]["preset"] = name

        with pytest.raises(FileProblems, match=sentence):
            load_protocol(altered_protocol("static_noise", rename))


def test_a_faulty_preset_file_is_named_with_its_line(altered_protocol):
    def rename(protocol):
        protocol["sensors"]["dot"]["preset"] = "mine.yaml"

    path = altered_protocol("static_noise", rename)
    (path.parent / "mine.yaml").write_text("rate_hz: 60\nspeed: 3\n", encoding="utf-8")
    with pytest.raises(FileProblems, match=r"mine\.yaml:2:1: speed"):
        load_protocol(path)
