"""`testbench study NAME --session` on recordings of people and of other laboratories: what it
answers, and what it refuses by name.

Noise and calibration of imu_tk are asked in test_reference_1, its turns in test_gimvebo.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import loadmat, savemat

from testbench import execute, plan
from testbench.clock import SystemClock
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session
from testbench.studies import get_study
from testbench.studies.bench import StudyBench
from testbench.studies.chain.motions import half_leg
from tests.studies.hostile import complaints, missing, published_words
from tests.system.test_gait import FEET

pytestmark = pytest.mark.slow


def asked(name: str, session: Session, logs: Path):
    """The study of a recording; nothing is written, and nothing said of what was published."""
    record = get_study(name).run(StudyBench(logs, SystemClock(), session=session.path))
    assert not logs.exists() and not record.simulated
    assert complaints(record) == [] and published_words(record) == []
    return record


# --- reference-2: Madgwick's filter


def test_a_trial_of_broad_has_a_truth_and_no_device(data, tmp_path):
    whole = loadmat(data / "broad" / "02_undisturbed_slow_rotation_B.mat")
    rows = len(whole["imu_gyr"])
    some = {  # 40 s of it, from its rest on
        key: value[:11_400] if np.shape(value)[:1] == (rows,) else value
        for key, value in whole.items()
        if not key.startswith("__")
    }
    some["movement"] = whole["movement"].ravel()[:11_400]
    savemat(tmp_path / "02.mat", some)
    trial = import_recording("broad", [tmp_path / "02.mat"], tmp_path / "broad", SystemClock())
    own = asked("reference-2", trial, tmp_path / "logs")
    keys = {table.key for table in own.tables}
    assert {"identity", "errors", "gains", "bias", "noise", "time"} <= keys
    assert "difference" not in keys and any("no orientation" in told for told in own.findings)
    (row,) = own.table("errors").rows
    columns = own.table("errors").columns
    by = dict(zip(columns, row.values, strict=True))
    # published for the trial: 1.50 deg by a beta of 0.12, while it moves
    assert 0.3 < by["beta 0.1 [deg]"] < by["beta 0.35 and zeta 0.07, upstream code [deg]"] < 3
    assert missing(own, ["Quaternions, imu", "Euler angles, imu", "Total error"]) == []


def test_orientations_without_rates_are_refused(data, tmp_path):
    files = sorted((data / "xsens_dot").glob("*.csv"))
    dots = import_recording("xsens_dot", files, tmp_path / "dots", SystemClock())
    for name, what in (
        ("reference-1", "a rest of 10 s, for the noise"),
        ("reference-2", "a sensor with angular rates and specific forces"),
        ("reference-3", "one sensor .there are 3: Pelvis, RFemur, RTibia"),
        ("reference-4", "a sensor with rates and forces that swings"),
        ("reference-5", "the joints of a model"),
    ):
        with pytest.raises(InputError, match=what):
            asked(name, dots, tmp_path / "logs")


# --- reference-4: steps of a walker


def test_the_steps_of_a_foot_are_counted_by_every_print(data, tmp_path):
    files = [data / "xio_walk" / "short_walk.csv"]
    walk = import_recording("ngimu", files, tmp_path / "walk", SystemClock())
    own = asked("reference-4", walk, tmp_path / "logs")
    counted = {row.label.partition(", ")[2]: row.values for row in own.table("walks").rows}
    assert len(counted) == 5
    for label in ("improved prediction (program)", "improved prediction, corrected", "vqf_6d"):
        assert counted[label][0] == 16, label  # as many as by its stances
        assert counted[label][2] < 8  # the loop closes but for what its lengths miss
    for label in ("simple prediction (text)", "improved prediction (text)"):
        assert 16 <= counted[label][0] <= 20 and counted[label][2] > 20
    (path,) = own.curves
    assert path.plane and len(path.curves) == 5


def test_the_steps_of_two_feet_are_counted(data, tmp_path):
    mapping = tmp_path / "feet.yaml"
    mapping.write_text(FEET)
    files = [data / "gaitmap" / "imu_sample.csv"]
    asks = Options(str(mapping))
    feet = import_recording("generic", files, tmp_path / "feet", SystemClock(), asks)
    own = asked("reference-4", feet, tmp_path / "logs")
    counted = {row.label: row.values[0] for row in own.table("walks").rows}
    assert len(counted) == 10
    for foot in ("left", "right"):  # twice 20 m
        by_program = counted[f"{foot}, improved prediction (program)"]
        assert 29 <= by_program == counted[f"{foot}, vqf_6d"] <= 32
        assert by_program <= counted[f"{foot}, simple prediction (text)"] <= 35


# --- reference-5: joints of a chain


TITLES = "Stamp;GX;GY;GZ;AX;AY;AZ"
NAMES = {"pelvis": "Sacrum", "thigh_r": "RFemur", "shank_r": "RTibia", "foot_r": "RFoot"}
TURNED = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
"""The files' axes against those of the sensor: turned by -90 deg about z."""
BEHIND_S, FAST = 1.7e9, 1.00002
"""The clock of the files: Unix time, and 20 ppm fast."""


@pytest.fixture(scope="module")
def walked(altered_protocol, tmp_path_factory):
    """A simulated walk of the right half leg, and the same as foreign files."""
    own = {}

    def shorter(spec):
        half_leg(spec, np.random.default_rng(0))
        spec["variables"]["strides"] = 5
        own.update(spec["sensors"])

    folder = tmp_path_factory.mktemp("foreign")
    session = execute(plan(altered_protocol("gait", shorter)), folder / "logs")
    begin = session.steps[0].settled_ns
    for name, foreign in NAMES.items():
        samples = session.imu(name)
        kept = samples.host_time_ns >= begin
        stamp = 1000 * BEHIND_S + samples.host_time_ns / 1e6 * FAST
        gyr, acc = np.degrees(samples.gyr @ TURNED.T), samples.acc @ TURNED.T / 9.80665
        rows = np.column_stack([stamp, gyr, acc])[kept]
        form = ["%.3f", *["%.6f"] * 6]
        np.savetxt(folder / f"{foreign}_1.csv", rows, form, ";", header=TITLES, comments="")
    mapping = {
        "description": "loggers on a leg",
        "time": {"column": "Stamp", "unit": "ms"},
        "sensors": {
            foreign: {
                "file": f"{foreign}_*.csv",
                "acc": {"columns": ["AX", "AY", "AZ"], "unit": "g"},
                "gyr": {"columns": ["GX", "GY", "GZ"], "unit": "deg/s"},
            }
            for foreign in NAMES.values()
        },
        "estimate": {"filters": ["vqf_6d"], "chain": {"model": model_of(own), "scales": False}},
    }
    file = folder / "map.yaml"
    file.write_text(yaml.safe_dump(mapping, sort_keys=False), encoding="utf-8")
    return session, sorted(folder.glob("*.csv")), file


def model_of(sensors) -> dict:
    """Which link carries which logger, and how."""
    found = {}
    for name, foreign in NAMES.items():
        place = sensors[name]["mounting"]["position_mm"]
        mounting = {"rotation_deg": {"ZYX": [90, 0, 0]}, "position_mm": place}
        found[foreign] = {"link": sensors[name]["link"], "mounting": mounting}
    return {"robot": "lower_limb", "sensors": found}


def test_a_walk_comes_back_from_foreign_files_with_its_joints(walked, tmp_path):
    session, files, mapping = walked
    leg = import_recording("generic", files, tmp_path / "leg", SystemClock(), Options(str(mapping)))
    own = asked("reference-5", leg, tmp_path / "logs")
    assert any("There is no truth" in told for told in own.findings)
    ranges = {row.label: row.values for row in own.table("joints").rows}
    arm, walking = session.arm(), session.steps[-1].start_ns
    for joint in ("hip_r_flexion", "knee_r_flexion", "ankle_r_flexion"):
        moved = np.degrees(arm.q_measured[:, arm.joint_names.index(joint)])
        swung = np.ptp(np.percentile(moved[arm.host_time_ns > walking], [2.5, 97.5]))
        low, high, _ = ranges[f"motion, {joint}, kinematic"]
        assert high - low == pytest.approx(swung, rel=0.2), joint
    assert len(own.curves) == 8 and all(len(figure.curves) == 1 for figure in own.curves)


def test_a_recording_without_a_model_is_refused(data, tmp_path):
    files = [data / "xio_walk" / "short_walk.csv"]
    walk = import_recording("ngimu", files, tmp_path / "walk", SystemClock())
    with pytest.raises(InputError, match=r"the chain asks for estimate\.chain"):
        asked("reference-5", walk, tmp_path / "logs")
