"""`testbench gait` on recordings of people who walked, and on a simulated one."""

from __future__ import annotations

import csv
import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from testbench import gait
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.frames import NANOSECONDS
from testbench.records.disk.json_file import json_text
from testbench.records.findings.catalogue import finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.calibration_file import SensorCalibration, save_calibration
from testbench.records.results.gait import Gait
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Analysis, Estimation
from tests.command_line import command
from tests.conftest import FakeClock
from tests.estimation.gait.walker import loop, straight, swinging, walked, with_errors

FEET = """
description: two feet
rate_hz: 204.8
text: {lines_below_header: 1}
sensors:
  left:
    acc: {columns: [2, 4, 6], unit: m/s^2}
    gyr: {columns: [8, 10, 12], unit: deg/s}
  right:
    acc: {columns: [3, 5, 7], unit: m/s^2}
    gyr: {columns: [9, 11, 13], unit: deg/s}
"""


def told(capsys, *arguments: object) -> dict:
    capsys.readouterr()
    assert command(*arguments) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def feet(data, tmp_path_factory) -> Session:
    """Two feet of a healthy walker, twice 20 m."""
    folder = tmp_path_factory.mktemp("feet")
    mapping = folder / "feet.yaml"
    mapping.write_text(FEET)
    file = data / "gaitmap" / "imu_sample.csv"
    words = ["import", "generic", file, "--mapping", mapping, "--out", folder / "session"]
    assert command(*words) == 0
    return Session(folder / "session")


@pytest.fixture(scope="module")
def found(feet) -> Gait:
    return gait(feet)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Session:
    """A loop by a sensor whose name says nothing."""
    true = walked(loop(8, rate=100.0, rests=(2.0, 2.0)))
    gyr, acc = with_errors(true)
    return session_of(tmp_path_factory.mktemp("walk"), "imu", 100.0, gyr, acc, None)


def session_of(
    folder: Path, name: str, rate: float, gyr: np.ndarray, acc: np.ndarray, q: np.ndarray | None
) -> Session:
    stamps = np.round(np.arange(len(acc)) / rate * NANOSECONDS).astype(np.int64)
    fine, count = np.zeros(len(acc), dtype=bool), np.arange(len(acc))
    samples = ImuSamples(stamps, stamps, gyr, acc, None, q, count, fine)
    sensor = ImportedSensor([samples], rate, "made up", None, {})
    analysis = Analysis(estimate=Estimation(filters=["vqf_6d"], align="none", calibrate="none"))
    recording = Recording("walk", "walk", {name: sensor}, analysis)
    return write_recording(recording, [folder / "a.csv"], "made up", folder / "s", FakeClock())


def listed(data: Path, foot: str) -> np.ndarray:
    """Start, end, initial and terminal contact by the markers, in samples, shape (k, 4)."""
    with (data / "gaitmap" / "stride_events_sample.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["foot"] == foot]
    return np.array([[float(row[key]) for key in ("start", "end", "ic", "tc")] for row in rows])


def test_a_loop_closes_without_being_told_that_it_is_one(data, tmp_path, capsys) -> None:
    file = data / "xio_walk" / "short_walk.csv"
    assert command("import", "ngimu", file, "--out", tmp_path / "s") == 0
    result = told(capsys, "gait", tmp_path / "s", "--json", "--no-report")
    assert result["closure_mm"] < 60  # the maker's example: 82
    (own,) = result["sensors"].values()
    assert (own["on"], own["known_by"], own["method"]) == ("foot", "motion", "strapdown")
    assert len(own["strides"]) == 16
    assert result["closure_mm"] < 2 * own["closure_sd_mm"]


@pytest.mark.parametrize("foot", ["left", "right"])
def test_each_stride_of_the_markers_is_found_once_and_none_beside(data, found, foot) -> None:
    events = listed(data, foot)
    contacts = np.array([stride.ic_s for stride in found.sensors[foot].strides]) * 204.8
    own = contacts[(contacts > events[0, 2] - 50) & (contacts < events[-1, 2] + 50)]
    assert len(own) == len(events)
    off = (own - events[:, 2]) / 204.8
    assert np.sqrt(np.mean(off**2)) < 0.012 and np.abs(off).max() < 0.025


@pytest.mark.parametrize(("foot", "columns"), [("left", [7, 8]), ("right", [10, 11])])
def test_strides_are_as_long_as_the_heels_way(data, found, foot, columns) -> None:
    events = listed(data, foot)
    file = data / "gaitmap" / "mocap_sample.csv"
    marker = np.genfromtxt(file, delimiter=",", skip_header=2)[:, columns] / 1000
    time = np.arange(len(marker)) / 100
    stands = [
        np.column_stack([np.interp(events[:, j] / 204.8, time, marker[:, i]) for i in (0, 1)])
        for j in (0, 1)
    ]
    true = np.linalg.norm(stands[1] - stands[0], axis=1)
    strides = found.sensors[foot].strides
    contacts = np.array([stride.ic_s for stride in strides]) * 204.8
    rows = np.abs(contacts[:, None] - events[:, 2]).argmin(axis=0)
    lengths, sd = np.array([[strides[i].length_m, strides[i].length_sd_m] for i in rows]).T
    error = lengths - true
    assert np.sqrt(np.mean(error**2)) < 0.03
    straight = true > 1.2
    assert np.sqrt(np.mean(error[straight] ** 2)) < 0.018
    assert np.mean(np.abs(error[straight]) < 1.96 * sd[straight]) > 0.85


def test_two_feet_are_compared(found) -> None:
    rows = {row.quantity: row for row in found.symmetry}
    assert abs(rows["stride_time_s"].difference_percent) < 1
    assert 1.3 < rows["length_m"].left < 1.45


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--on", "foot", "--on", "shank"], "says foot and shank of all sensors"),
        (["--filter", "nope"], "unknown filter 'nope'"),
        (["--filter", "vqf_9d", "--on", "shank"], "--filter vqf_9d takes mag"),
        (["--corners", "0,0 0,0"], "goes from its first corner to others"),
        (["--corners", "0,0 1e300,1"], "goes from its first corner to others"),
    ],
)
def test_what_cannot_be_said_of_a_walk_is_refused(simulated, capsys, words, said) -> None:
    assert command("gait", simulated.path, "--no-report", *words) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_what_has_no_effect_on_a_foot_is_told(simulated, capsys) -> None:
    words = ["--mounting", "level", "--filter", "vqf_6d", "--json", "--no-report"]
    result = told(capsys, "gait", simulated.path, *words)
    (own,) = result["sensors"].values()
    idle = [entry["sentence"] for entry in own["findings"] if entry["code"] == "gait.idle"]
    assert len(idle) == 2 and "--mounting" in idle[0] and "--filter" in idle[1]


def test_steps_go_from_the_contact_of_one_foot_to_that_of_the_other(data, found) -> None:
    contacts = {side: listed(data, side)[:, 2] / 204.8 for side in ("left", "right")}
    leaves = {side: listed(data, side)[:, 3] / 204.8 for side in ("left", "right")}
    for side, other in (("left", "right"), ("right", "left")):
        rows = {row.quantity: row for row in found.sensors[side].rows}
        before = np.array(
            [t - contacts[other][contacts[other] < t].max(initial=-9) for t in contacts[side]]
        )
        after = np.array(
            [leaves[other][leaves[other] > t].min(initial=99) - t for t in contacts[side]]
        )
        true = np.median(before), np.median(after)
        assert rows["step_time_s"].mean == pytest.approx(true[0], abs=0.015)
        assert rows["double_support_s"].mean == pytest.approx(true[1], abs=0.025)
        assert 20 < rows["step_time_s"].count <= len(contacts[side])
    both = {row.quantity: row for row in found.symmetry}
    assert {"step_time_s", "double_support_s"} <= both.keys()


def two_feet(folder: Path, later_s: float, *noted: str) -> Gait:
    """Feet that walk half a stride apart, the left one later by so much."""
    true = walked(straight(10, rate=100.0, rests=(3.0, 4.0)))
    gyr, acc = with_errors(true)
    sensors = {}
    for name, late in (("foot_r", 0.0), ("foot_l", later_s)):
        rows = np.clip(np.arange(len(acc)) - round(100 * late), 0, len(acc) - 1)
        stamps = np.round(np.arange(len(acc)) / 100 * NANOSECONDS).astype(np.int64)
        fine, count = np.zeros(len(acc), dtype=bool), np.arange(len(acc))
        samples = ImuSamples(stamps, stamps, gyr[rows], acc[rows], None, None, count, fine)
        sensors[name] = ImportedSensor([samples], 100.0, "made up", None, {})
    analysis = Analysis(estimate=Estimation(filters=["vqf_6d"], align="none", calibrate="none"))
    recording = Recording(
        "walk", "walk", sensors, analysis, findings=[finding(own) for own in noted]
    )
    return gait(
        write_recording(recording, [folder / "a.csv"], "made up", folder / "s", FakeClock())
    )


def test_a_limp_shows_in_the_times_of_steps_alone(tmp_path) -> None:
    found = two_feet(tmp_path, 0.45)  # of 1.1
    rows = {row.quantity: row for row in found.symmetry}
    assert rows["step_time_s"].left == pytest.approx(0.45, abs=0.005)
    assert rows["step_time_s"].right == pytest.approx(0.65, abs=0.005)
    assert rows["step_time_s"].difference_percent == pytest.approx(-36.4, abs=2)
    assert abs(rows["stride_time_s"].difference_percent) < 0.5


def test_feet_on_clocks_of_their_own_have_no_steps(tmp_path) -> None:
    found = two_feet(tmp_path, 0.45, "clock.power_up")
    assert [own.code for own in found.findings] == ["gait.no_common_clock"]
    assert "step_time_s" not in {row.quantity for row in found.symmetry}


def test_a_stored_calibration_corrects_what_a_walk_is_reckoned_by(tmp_path, capsys) -> None:
    true = walked(straight(12, 1.3, rate=100.0, rests=(4.0, 4.0)))
    scale, bias = np.array([0.97, 1.02, 1.04]), np.array([0.4, -0.3, 0.2])
    session = session_of(tmp_path, "foot", 100.0, true.gyr, true.acc / scale + bias, None)
    triad = TriadCalibration("static_poses", matrix=np.diag(scale), bias=bias)
    when = datetime(2023, 2, 1, tzinfo=UTC)
    stored = SensorCalibration(
        "foot", None, when, "s", "0" * 64, "1", None, {"accelerometer": triad}
    )
    found, store = gait(session), tmp_path / "stored"
    store.mkdir()
    save_calibration(store / "foot.yaml", stored)
    plain = [stride.length_m for stride in found.sensors["foot"].strides if stride.counted]
    result = told(capsys, "gait", session.path, "--calibration", store, "--json", "--no-report")
    own = result["sensors"]["foot"]
    lengths = [stride["length_m"] for stride in own["strides"] if stride["counted"]]
    assert abs(np.mean(lengths) - 1.3) < 0.003 < abs(np.mean(plain) - 1.3)
    assert "calibration.stored_undated" in {entry["code"] for entry in own["findings"]}
    assert command("gait", session.path, "--calibration", tmp_path / "nowhere") == 2


def test_a_leg_that_swings_once_or_twice_is_no_walk(tmp_path, capsys) -> None:
    true = walked(straight(2, 1.3, rate=100.0, rests=(4.0, 4.0)))
    gyr, acc = with_errors(true)
    session = session_of(tmp_path, "foot", 100.0, gyr, acc, None)
    capsys.readouterr()
    assert command("gait", session.path, "--json") == 2
    result = json.loads(capsys.readouterr().out)
    own = result["sensors"]["foot"]
    assert own["strides"] == [] and own["method"] == "" and result["closure_mm"] is None
    said = {entry["code"]: entry["sentence"] for entry in own["findings"]}
    assert "no walk was found" in said["gait.few_strides"]
    assert "No walk was found in this session." in (session.path / "report.html").read_text()


def test_a_report_of_a_walk_alone_does_not_say_that_there_is_nothing(simulated) -> None:
    assert command("gait", simulated.path) == 0
    page = (simulated.path / "report.html").read_text()
    assert "The walk of this session is reported below" in page
    assert "nothing to judge yet" not in page and "not evaluated" not in page


def test_what_was_typed_judges_and_stands_in_the_report(simulated, capsys) -> None:
    corners = "0,0 1,0 1,1"
    words = ["gait", simulated.path, "--cycles", 9, "--distance", 10.4, "--corners", corners]
    result = told(capsys, *words, "--json")
    errors = {row["quantity"]: row["error"] for row in result["checks"]}
    assert errors["cycles"] == -1
    assert abs(errors["distance_m"]) < 0.05
    assert errors["end_off_m"] > 1  # it is no such path
    page = Path(result["report"]).read_text()
    for words in ("The path from above", "Events in the signals", "Strides of imu"):
        assert words in page


def test_a_gait_is_read_back_as_it_was_kept_and_goes_out_as_tables(simulated, capsys) -> None:
    assert command("gait", simulated.path, "--no-report") == 0
    kept = Gait.load(simulated.path)
    anew = gait(simulated)
    assert json_text(kept.summary()) == json_text(anew.summary())
    for name, column in anew.walks["imu"].items():
        np.testing.assert_array_equal(kept.walks["imu"][name], column)
    assert command("export", simulated.path, "--to", "csv", "--force") == 0
    with (simulated.path / "export" / "csv" / "strides_imu.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["length_m"]) for row in rows] == [
        stride.length_m for stride in kept.sensors["imu"].strides
    ]


def test_where_nobody_knows_where_it_sits_nothing_is_reckoned(simulated, monkeypatch) -> None:
    monkeypatch.setattr("testbench.estimation.gait.stage.place_by_motion", lambda *_: None)
    own = gait(simulated).sensors["imu"]
    assert not own.strides and np.isnan(own.distance_m)
    (said,) = own.findings
    assert said.code == "gait.place_unknown" and "--on" in said.remedy


def test_a_sensor_goes_by_the_regression_where_its_parameters_are_named(simulated, capsys) -> None:
    words = ["--parameters", "ngimu_instep", "--no-report", "--json"]
    result = told(capsys, "gait", simulated.path, "--on", "foot", *words)
    own = result["sensors"]["imu"]
    assert (own["method"], own["parameters"]) == ("regression", "ngimu_instep")
    assert {row["code"] for row in own["findings"]} >= {"gait.regression", "gait.mounting"}


def test_a_shank_without_rates_goes_by_the_devices_orientation(tmp_path) -> None:
    _, samples = swinging()
    acc = samples.acc + 0.01 * np.random.default_rng(0).standard_normal(samples.acc.shape)
    rates = np.full_like(acc, np.nan)
    session = session_of(tmp_path, "l_shank", 100.0, rates, acc, samples.device_q)
    own = gait(session).sensors["l_shank"]
    assert (own.on, own.known_by, own.side) == ("shank", "name", "left")
    assert (own.parameters, own.filter, own.mounting) == ("universal", "euler_ekf", "level")
    assert len(own.strides) == 12
    assert own.distance_m == pytest.approx(12 * (0.0294 * 40 + 0.232), rel=0.02)
    assert "gait.derived" in {found.code for found in own.findings}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--on", "knee"], "unknown place 'knee'"),
        (["--on", "other=foot"], "unknown sensor 'other'"),
        (["--on", "shank", "--parameters", "mine"], "unknown parameters 'mine'"),
        (["--corners", "0,0 x,1"], "'x,1' is no corner"),
        (["--cycles", "0"], "--cycles 0"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(simulated, capsys, words, message) -> None:
    assert command("gait", simulated.path, "--no-report", *words) == 2
    assert message in capsys.readouterr().err
