"""The chain filter on recordings made elsewhere: a squat in foreign files."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from testbench import execute, plan
from testbench.estimation import estimate
from testbench.exceptions import FileProblems
from testbench.formats.exporters import ExportSource, write_export
from testbench.formats.exporters.chain_columns import chain_series
from testbench.pipeline.bring_in import bring_in
from testbench.pipeline.request import ImportRequest
from testbench.records.specs.shipped import shipped_folder

BEHIND_S = 1.7e9
TURNED = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
"""The files' axes against those of the sensor: turned by -90 deg about z."""
NAMES = {"shank": "Tibia", "thigh": "Femur"}


@pytest.fixture(scope="module")
def squat(altered_protocol, tmp_path_factory):
    """A simulated squat with its pose before, of half its length."""

    def shorten(spec):
        for joint in ("ankle", "knee"):
            spec["sections"][1]["steps"][0]["sweep"][joint]["sine"]["cycles"] = 5

    return execute(plan(altered_protocol("squat", shorten)), tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def files(squat, tmp_path_factory):
    """Its readings by other names, units, axes and clock, from the rest on."""
    folder = tmp_path_factory.mktemp("foreign")
    begin = squat.steps[0].settled_ns + 500_000_000
    for own, foreign in NAMES.items():
        samples = squat.imu(own)
        time = samples.host_time_ns
        kept = time >= begin
        rows = np.column_stack(
            [
                1000 * BEHIND_S + time / 1e6 * 1.00002,
                np.degrees(samples.gyr @ TURNED.T),
                samples.acc @ TURNED.T / 9.80665,
            ]
        )
        titles = "Stamp;GX;GY;GZ;AX;AY;AZ"
        text = ["%.3f", *["%.6f"] * 6]
        file = folder / f"{foreign}_1.csv"
        np.savetxt(file, rows[kept], text, ";", header=titles, comments="")
    return folder


def mapping(files, change=None):
    """A mapping of the files that asks for the chain."""
    sensors = {
        foreign: {
            "link": own,
            "mounting": {"rotation_deg": {"ZYX": [90, 0, 0]}, "position_mm": [40, 0, 250]},
        }
        for own, foreign in NAMES.items()
    }
    model = {
        "robot": "robot/robot.yaml",
        "sensors": sensors,
        "start_deg": {"ankle": 17, "knee": 45},
    }
    columns = {
        foreign: {
            "file": f"{foreign}_*.csv",
            "acc": {"columns": ["AX", "AY", "AZ"], "unit": "g"},
            "gyr": {"columns": ["GX", "GY", "GZ"], "unit": "deg/s"},
        }
        for foreign in NAMES.values()
    }
    chain = {"model": model, "scales": False}
    content = {
        "description": "loggers on a leg",
        "time": {"column": "Stamp", "unit": "ms"},
        "sensors": columns,
        "estimate": {"filters": ["vqf_6d"], "chain": chain},
    }
    if change is not None:
        change(chain)
    if not (files / "robot").exists():
        shutil.copytree(shipped_folder("robots") / "squat_2dof", files / "robot")
    file = files / "map.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def imported(files, out, change=None):
    return bring_in(
        ImportRequest(
            format="generic",
            files=tuple(str(file) for file in sorted(files.glob("*.csv"))),
            mapping=str(mapping(files, change)),
            out=str(out),
        )
    )


@pytest.fixture(scope="module")
def session(files, tmp_path_factory):
    return imported(files, tmp_path_factory.mktemp("sessions") / "leg")


@pytest.fixture(scope="module")
def estimated(session, files):
    shutil.rmtree(files / "robot")  # the session keeps what it needs
    return estimate(session)


def test_joints_of_foreign_files_are_found_by_a_model_and_the_rest_before(squat, estimated):
    (chain,) = estimated.chain
    assert (chain.section, chain.joints) == ("motion", ["ankle", "knee"])
    arm, first = squat.arm(), squat.steps[0].settled_ns + 500_000_000
    time = chain.host_time_ns / 1.00002 + first
    for i, joint in enumerate(chain.joints):
        true = np.interp(time, arm.host_time_ns, arm.q_measured[:, arm.joint_names.index(joint)])
        error = np.degrees(chain.mean[:, 0, i] - true)
        assert np.sqrt(np.mean(error**2)) < 1.0
        assert np.ptp(np.degrees(chain.mean[:, 0, i])) == pytest.approx(
            np.ptp(np.degrees(true)), abs=1.0
        )
    codes = {found.code for found in estimated.findings}
    # a placement that is stated and not fitted leaves the angles as uncertain as that
    assert codes == {"chain.start", "chain.sheet_assumed", "chain.uncertain"}
    assert 2.5 < np.degrees(chain.sd[:, 0]).mean() < 6
    assert chain.facts["lost"] is False


def test_exports_carry_the_chain_under_its_own_name(session, estimated, tmp_path):
    (chain,) = estimated.chain
    key = "chain_motion_kinematic"
    write_export("parquet", ExportSource(session, estimated), tmp_path / "tables")
    assert (tmp_path / "tables" / f"{key}.parquet").is_file()
    columns = chain_series(ExportSource(session, estimated))[f"the chain '{key}'"][1]
    assert list(columns) == [f"{key}_ankle", f"{key}_knee"]  # beside others
    exported = write_export("mot", ExportSource(session, estimated), tmp_path / "alone.mot")
    assert exported.filters == [key]
    head, body = (tmp_path / "alone.mot").read_text().split("endheader\n")
    assert f"filter={key}\n" in head
    assert body.splitlines()[0].split("\t") == ["time", "ankle", "knee"]
    rows = np.array([line.split("\t") for line in body.splitlines()[1:]], dtype=float)
    np.testing.assert_allclose(rows[:, 1:], np.degrees(chain.mean[:, 0]), atol=1e-6)


def test_the_orientation_of_a_sensor_follows_from_the_joints(session, estimated):
    source = ExportSource(session, estimated, "chain_motion_kinematic")
    assert source.sensor_names == ["Tibia", "Femur"] or source.sensor_names == ["Femur", "Tibia"]
    filtered = ExportSource(session, estimated, "vqf_6d")
    for name in source.sensor_names:
        time, q = source.orientation(name)
        other = filtered.orientation_at(name, time)
        # inclinations agree; the heading of a filter without magnetometer is its own
        up = [2 * (q_[:, 1] * q_[:, 3] - q_[:, 0] * q_[:, 2]) for q_ in (q, other)]
        assert np.nanmax(np.abs(up[0] - up[1])) < 0.05


WRONG = {
    "link": (lambda model: model["sensors"]["Tibia"].update(link="shin"), "unknown link"),
    "joint": (lambda model: model["start_deg"].update(hip=3), "unknown joint"),
    "sensor": (
        lambda model: model["sensors"].update(Foot={"link": "shank"}),
        "unknown sensor of the mapping 'Foot'",
    ),
    "robot": (lambda model: model.update(robot="lower_lim"), "unknown robot 'lower_lim'"),
    "preset": (lambda model: model["sensors"]["Tibia"].update(preset="dot"), "unknown preset"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_model_that_speaks_of_what_is_not_there_is_refused_before_anything_is_written(
    files, tmp_path, what
):
    change, expected = WRONG[what]
    with pytest.raises(FileProblems, match=expected):
        imported(files, tmp_path / "leg", lambda chain: change(chain["model"]))
    assert not (tmp_path / "leg").exists()


def test_a_rest_that_is_none_and_lengths_that_are_not_there_are_said(session):
    session_content = session.manifest.content["analysis"]["estimate"]["chain"]
    model = session_content["model"]
    for key, value, expected in (
        ("rest_s", [8.0, 9.0], "not at rest from 8 to 9 s"),
        ("stature_mm", 1700.0, "states no stature"),
    ):
        kept = model.get(key)
        model[key] = value
        session.__dict__.pop("analysis", None)
        found = estimate(session)
        model[key] = kept
        assert not found.chain
        assert any(expected in str(own) for own in found.findings)
    session.__dict__.pop("analysis", None)
