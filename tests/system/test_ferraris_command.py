"""Ferraris on the command line: a recording by hand, rests with each face up and one full turn
about each axis.
"""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.formats.suitable import suitable_analysis
from testbench.records.results.calibration_file import load_calibration
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session

RATE_HZ, G = 100.0, 9.80665
RESPONSE = np.array([[1.02, 0.01, -0.02], [0.005, 0.97, 0.015], [-0.01, 0.02, 1.01]])
BIAS = np.radians([0.4, -0.7, 0.2])
ANGLE_DEG = 360.0


def recording(factor: float = 1.0, sense: tuple[int, int, int] = (1, 1, 1)) -> ImuSamples:
    """Rests of 5 s with a face up, a turn of 4 s about each of x, y and z by raised cosine, moves
    of 1.5 s between.
    """
    draw, rate, force = np.random.default_rng(3), [], []
    faces = [np.eye(3)[axis] * sign for axis in range(3) for sign in (1, -1)]
    for i, up in enumerate(faces):
        parts = [np.zeros((500, 3))]
        if i % 2 == 0:
            shape = 1 - np.cos(2 * np.pi * (np.arange(400) + 0.5) / 400)
            parts += [
                np.radians(ANGLE_DEG) * sense[i // 2] * shape[:, None] / shape.sum() * RATE_HZ * up,
                np.zeros((500, 3)),
            ]
        rate.append(np.concatenate(parts))
        force.append(np.tile(G * up, (len(rate[-1]), 1)))
        if i + 1 < len(
            faces
        ):  # to the next face: about an axis across both, half a turn where it is the opposite one
            across = np.cross(up, faces[i + 1])
            across = np.roll(up, 1) if not across.any() else across
            angle = np.pi if faces[i + 1] @ up < -0.5 else np.pi / 2
            turned = angle * (np.arange(150) + 0.5) / 150
            rate.append(np.tile(-across * angle / 1.5, (150, 1)))
            force.append(
                G * (np.cos(turned)[:, None] * up + np.sin(turned)[:, None] * np.cross(across, up))
            )
    omega, felt = np.concatenate(rate), np.concatenate(force)
    n = len(omega)
    gyr = factor * (omega @ RESPONSE.T + BIAS) + np.radians(0.05) * draw.standard_normal((n, 3))
    time = np.round(np.arange(n) / RATE_HZ * 1e9).astype(np.int64)
    acc = felt + 0.01 * draw.standard_normal((n, 3))
    return ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, dtype=bool))


def kept(samples: ImuSamples, folder, clock) -> Session:
    made = Recording(
        "hand",
        "by hand",
        {"imu": ImportedSensor([samples], RATE_HZ, "a part")},
        suitable_analysis([samples]),
    )
    return write_recording(made, [folder / "hand.csv"], "generic", folder / "session", clock)


def command(session: Session, folder, *options: str):
    file = folder / "made.yaml"
    arguments = [
        "calibrate",
        str(session.path),
        "--method",
        "ferraris",
        "--method",
        "ferraris_gyroscope",
        "--out",
        str(file),
    ]
    return CliRunner().invoke(app, [*arguments, "--no-report", *options]), file


def test_the_response_of_a_part_turned_by_hand_is_recovered(tmp_path, clock):
    session = kept(recording(), tmp_path, clock)
    result, file = command(session, tmp_path, "--turn-deg", f"{ANGLE_DEG:g}")
    assert result.exit_code == 0, result.output
    found = load_calibration(file).triads["gyroscope"]
    assert found.method == "ferraris_gyroscope"
    np.testing.assert_allclose(np.linalg.inv(found.matrix), RESPONSE, atol=2e-3)
    np.testing.assert_allclose(found.bias, BIAS, atol=np.radians(0.01))
    assert "ferraris_gyroscope" in result.output


@pytest.mark.parametrize(("factor", "said"), [(2.0, "x 2.04"), (0.5, "x 0.51")])
def test_a_gyroscope_at_the_wrong_range_is_refused_with_the_numbers(factor, said, tmp_path, clock):
    session = kept(recording(factor), tmp_path, clock)
    for options in (("--turn-deg", "360"), ()):
        result, file = command(session, tmp_path, *options)
        assert isinstance(result.exception, InputError)
        assert not file.exists()
        if options:
            assert f"by ferraris_gyroscope: {said}" in str(result.exception)
            assert "or the turns were not of the angle that --turn-deg states" in str(
                result.exception
            )
        else:
            assert "state it with --turn-deg, such as --turn-deg 360" in str(result.exception)


def test_turns_of_both_senses_are_refused_with_their_angles(tmp_path, clock):
    result, _ = command(
        kept(recording(sense=(1, -1, 1)), tmp_path, clock), tmp_path, "--turn-deg", "360"
    )
    assert "its largest turns are x 36" in str(result.exception)
    assert "y -3" in str(result.exception)


def test_an_angle_without_the_method_is_refused(tmp_path, clock):
    session = kept(recording(), tmp_path, clock)
    with pytest.raises(InputError, match="--turn-deg is for the method ferraris_gyroscope"):
        CliRunner().invoke(
            app,
            ["calibrate", str(session.path), "--out", str(tmp_path / "x.yaml"), "--turn-deg", "90"],
            catch_exceptions=False,
        )


@pytest.mark.data
@pytest.mark.parametrize(
    ("factor", "said"),
    [(1.0, ""), (2.0, "gravity turns 0.5 times as far"), (0.5, "gravity turns 2 times as far")],
)
def test_the_real_ferraris_session_is_asked_about_where_its_gyroscope_is_scaled(
    factor, said, data, tmp_path, clock
):
    """The example of imucal, turned clockwise, by its mapping; scaled, the import asks, and a
    person may confirm it.
    """
    lines = (data / "imucal" / "example_ferraris_session.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    scaled = [",".join([r[0], *(str(float(v) * factor) for v in r[1:4]), *r[4:]]) for r in rows]
    file = tmp_path / "hand.csv"
    file.write_text("\n".join([lines[0], *scaled]) + "\n")
    if said:
        with pytest.raises(
            InputError,
            match=rf"{said} as its gyroscope says .* its scale is that of another range setting",
        ):
            import_recording(
                "generic", [file], tmp_path / "asked", clock, Options("imucal_ferraris")
            )
    confirmed = Options("imucal_ferraris", units={"gyr": "deg/s"} if said else {})
    session = import_recording("generic", [file], tmp_path / "session", clock, confirmed)
    result, made = command(session, tmp_path, "--turn-deg", "-360")
    assert made.exists() == (not said), result.output
    if said:
        assert f"by ferraris_gyroscope: x {'2.05' if factor > 1 else '0.513'}" in str(
            result.exception
        )
    # imucal finds diag(0.5139, 0.4912, 0.4991) of the file's own numbers, from sections marked by
    # hand
    else:
        found = load_calibration(made).triads["gyroscope"]
        np.testing.assert_allclose(
            np.diag(np.linalg.inv(found.matrix)), [1.0278, 0.9825, 0.9981], atol=2e-3
        )
        assert (
            found.validation["gravity_direction_median_deg"] < 8
        )  # shaken between its faces by hand
