"""A manifest is checked by its types, whoever wrote it, and keeps what it does not know."""

from __future__ import annotations

import copy
import json
import random
import shutil
from pathlib import Path
from typing import Any

import pytest

from testbench.exceptions import BenchError, SessionError
from testbench.execution.resume import open_for_resume, stored_protocol
from testbench.records.session.arm_record import MODEL, RECORDED_MOTION, REPORTED_MOTION
from testbench.records.session.earlier_steps import earlier_steps
from testbench.records.session.manifest import Manifest, RunStatus, SensorRecord
from testbench.records.session.session import Session
from testbench.reporting.sections.provenance import provenance_section
from testbench.reporting.sections.run import facts, run_section, simulated_parts
from tests.system.mutations import mutate_json

SESSIONS = Path(__file__).parents[1] / "golden" / "sessions"
FILE = Path("logs/a/manifest.json")
LEAST = {"schema_version": 1, "status": "completed", "sensors": {}}


def written(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((SESSIONS / name / "manifest.json").read_text())
    return content


def with_entry(content: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with one entry changed, by its dotted path."""
    changed = copy.deepcopy(content)
    *outer, last = path.split(".")
    inner = changed
    for key in outer:
        inner = inner[key]
    inner[last] = value
    return changed


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("status", "asleep", "damaged: its status is 'asleep'"),
        ("status", 3, "damaged: its status is 3"),
        ("status", None, "damaged: its status is None"),
        ("sensors", [], "damaged: it names no sensors"),
        ("sensors.arm", "xsens", "damaged: it names no sensors"),
        ("sensors.arm.rate_hz", "fast", "damaged: sensors.arm.rate_hz: must be a number"),
        ("sensors.arm.magnetometer", 1, "damaged: sensors.arm.magnetometer: must be"),
        ("sensors.arm.rate_hz", 0, "damaged: sensors.arm.rate_hz: must be greater than 0"),
        ("sensors.arm.rate_hz", -60.0, "damaged: sensors.arm.rate_hz: must be greater than 0"),
        ("kind", "walk", "damaged: kind: must be 'run', 'import' or 'recording', not 'walk'"),
        ("plan", None, "damaged: its plan is no mapping"),
        ("arm", [], "damaged: its arm is no mapping"),
        ("analysis", 1, "damaged: its analysis is no mapping"),
        ("plan.check.steps", 2.5, "damaged: plan.check.steps: must be"),
        ("plan.check.joints", [{"joint": "elbow"}], "damaged: plan.check.joints"),
        ("plan.check.warnings", "none", "damaged: plan.check.warnings: must be a list"),
        ("duration_s", "long", "damaged: duration_s: must be a number"),
        ("duration_s", float("nan"), "damaged: duration_s: must be a finite number"),
        ("duration_s", -1.0, "damaged: duration_s: must be"),
        ("plan.check.duration_s", -1.0, "damaged: plan.check.duration_s: must be"),
        ("seed", -5, "damaged: seed: must be"),
        ("samples", {"imu_arm": -1}, "damaged: samples.imu_arm: must be"),
        ("seed", "0", "damaged: seed: must be a whole number"),
        ("files", {"imu_arm.parquet": 7}, "damaged: files.imu_arm"),
        ("resumes", {"steps": [1]}, "damaged: resumes.session: the key 'session' is missing"),
        ("environment", {"dipoles": [{}]}, "damaged: environment.dipoles"),
        ("schema_version", 99, "session schema 99"),
        ("schema_version", "1", "session schema '1'"),
        ("schema_version", None, "session schema None"),
    ],
)
def test_what_has_the_wrong_type_is_refused_in_one_sentence(path, value, said) -> None:
    with pytest.raises(SessionError) as refused:
        Manifest.of(with_entry(written("completed"), path, value), FILE)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", [[], "text", 3, None, {}])
def test_what_is_no_manifest_is_refused(content: Any) -> None:
    with pytest.raises(SessionError):
        Manifest.of(content, FILE)


def test_a_manifest_of_the_least_says_nothing_and_is_read() -> None:
    manifest = Manifest.of(LEAST, FILE)
    assert (manifest.kind, manifest.seed, manifest.arm.record, manifest.notes) == (
        None,
        None,
        None,
        [],
    )
    assert manifest.plan.check.steps is None


def test_what_a_newer_version_added_is_kept_when_the_manifest_is_written_again(tmp_path) -> None:
    content = with_entry(written("completed"), "weather", {"rain_mm": [0.5, None]})
    content = with_entry(content, "sensors.arm.colour", "orange")
    content = with_entry(content, "plan.check.cost", 3)
    changed = Manifest.of(content, FILE).changed(
        without=("message",), status=RunStatus.ABORTED, duration_s=2.5
    )
    changed.write(tmp_path)
    after = json.loads((tmp_path / "manifest.json").read_text())
    del content["message"]
    assert after == content | {"status": "aborted", "duration_s": 2.5}
    assert list(after) == list(content)  # in their order
    assert changed.status is RunStatus.ABORTED
    assert changed.message is None


@pytest.mark.parametrize("name", ["completed", "interrupted", "imported"])
def test_a_sensor_is_read_with_what_no_field_knows_of_it(name: str) -> None:
    content = written(name)
    content["sensors"]["more"] = {"colour": "orange", "full_scale": {"acc_m_s2": 9.0, "mag_uT": 8}}
    manifest = Manifest.of(content, FILE)
    assert {own: sensor.written() for own, sensor in manifest.sensors.items()} == content["sensors"]
    assert manifest.protocol.written() == content["protocol"]


def test_a_sensor_is_the_same_whatever_it_counted_meanwhile() -> None:
    before = {"driver": "xsens_dot", "rate_hz": 60, "address": "d4", "battery_percent": 80}
    same = SensorRecord.of(before | {"battery_percent": 20, "rssi_dbm": -40, "rate_hz": 60.0})
    other = SensorRecord.of(before | {"address": "d5"})
    assert SensorRecord.of(before).identity() == same.identity() != other.identity()


def test_no_entry_of_a_manifest_is_read_by_its_key_in_the_file() -> None:
    """The one that may shows people what no field knows."""
    package = Path(__file__).parents[2] / "testbench"
    reading = {
        str(file.relative_to(package))
        for file in package.rglob("*.py")
        if "manifest.content" in file.read_text(encoding="utf-8")
    }
    assert reading == {"reporting/sections/provenance.py"}


def test_a_change_that_has_the_wrong_type_is_refused() -> None:
    with pytest.raises(SessionError, match="duration_s"):
        Manifest.of(LEAST, FILE).changed(duration_s="long")


@pytest.mark.parametrize(
    ("driver", "provenance", "commanded"),
    [
        ("simulated", MODEL, False),
        ("replay", RECORDED_MOTION, False),
        ("someone's", REPORTED_MOTION, True),
    ],
)
def test_arms_of_earlier_sessions_are_known_by_their_driver(driver, provenance, commanded) -> None:
    arm = Manifest.of(LEAST | {"arm": {"driver": driver}}, FILE).arm.record
    assert arm is not None
    assert (arm.provenance, arm.commanded) == (provenance, commanded)
    assert arm.simulated == (driver == "simulated")


def test_the_file_of_an_early_import_is_a_list_of_one() -> None:
    assert Manifest.of(LEAST | {"source": "trial.mat"}, FILE).source == ["trial.mat"]


@pytest.mark.parametrize("name", ["completed", "interrupted", "imported"])
def test_no_manifest_leads_to_anything_but_a_sentence(name: str, tmp_path: Path) -> None:
    """Whatever stands in it, what reads a manifest works or refuses it."""
    rng = random.Random(name)
    folder = Path(shutil.copytree(SESSIONS / name, tmp_path / name))
    content, refused = written(name), 0
    for _ in range(150):
        (folder / "manifest.json").write_text(json.dumps(mutate_json(content, rng)))
        for use in (shown, gone_on_with):
            try:
                use(folder)
            except BenchError:
                refused += use is shown
    assert refused > 20


def shown(folder: Path) -> None:
    session = Session(folder)
    facts(session)
    run_section(session)
    provenance_section(session)
    simulated_parts(session)
    earlier_steps(session)
    assert session.recorded_at is None or session.started


def gone_on_with(folder: Path) -> None:
    session = Session(folder)
    if session.status is RunStatus.RUNNING:
        return  # a recovery would close the copy
    open_for_resume(folder)
    with stored_protocol(session):
        pass
