"""`testbench compare`, from sessions on disk to its files and exit codes."""

from __future__ import annotations

import json
import shutil
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

import testbench
from testbench import RunOptions, execute, plan
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.pipeline.analyse import judge_again
from testbench.pipeline.compare import compare_sessions
from testbench.pipeline.request import AnalysisRequest, CompareRequest
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.session_comparison import Told
from testbench.records.session.layout import MANIFEST
from testbench.records.session.session import Session
from tests.benchmarks.comparisons import PROTOCOL
from tests.command_line import command

FAST = {"heading_unknown": True, "heading_sd_deg": 0.5, "time_constant_s": 1, "noise_sd_deg": 0.01}


def protocol(part: int, inclination_deg: float = 0.06, name: str = "compared") -> dict[str, Any]:
    """Poses alone, with the device's own orientation, whose errors are forgotten quickly."""
    spec = deepcopy(PROTOCOL) | {"name": name}
    for sensor in spec["sensors"].values():
        sensor["part"] = part
        own = FAST | {"inclination_sd_deg": inclination_deg}
        sensor["parameters"] = {"device_orientation": own}
    spec["sections"] = spec["sections"][:2]
    spec["estimate"] = {"filters": ["device", "madgwick_imu"], "align": "reference_pose"}
    return spec


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory):
    """Makes a session of a protocol under a name of its own."""
    logs = tmp_path_factory.mktemp("logs")

    def make(spec: dict[str, Any], seed: int, name: str) -> Path:
        file = tmp_path_factory.mktemp("protocol") / "compared.yaml"
        file.write_text(yaml.safe_dump(spec), encoding="utf-8")
        return execute(plan(file), logs, seed, RunOptions(session_name=name)).path

    return make


@pytest.fixture(scope="module")
def base(made) -> Path:
    return made(protocol(1), 1, "base")


@pytest.fixture(scope="module")
def again(made) -> Path:
    """The same part, another run."""
    return made(protocol(1), 2, "again")


@pytest.fixture(scope="module")
def worse(made) -> Path:
    """The same part, whose own filter errs five times as much."""
    path = made(protocol(1, 0.3), 3, "worse")
    manifest = read_json(path / MANIFEST)
    manifest["sensors"]["forearm"]["firmware"] = "2.0"
    write_json(path / MANIFEST, manifest)
    return path


@pytest.fixture(scope="module")
def other_part(made) -> Path:
    return made(protocol(2, 0.3), 4, "other_part")


def test_the_same_part_again_is_no_regression(base, again) -> None:
    found = testbench.compare(base, again, margin=0.05)
    assert found.told is Told.NOT_SHOWN
    assert {metric.filter for metric in found.metrics} == {"device", "madgwick_imu"}
    assert {metric.paired_by for metric in found.metrics} == {"step"}
    assert all(metric.ci95[0] < metric.difference < metric.ci95[1] for metric in found.metrics)
    assert "one session a side" in " ".join(found.notes).lower()


def test_values_are_those_of_the_evaluation(base, again) -> None:
    found = testbench.compare(base, again)
    for side, path in (("base", base), ("new", again)):
        judge_again(Session(path))
        own = {
            (m.name, m.filter, m.section, m.sequence): m.value
            for m in Evaluation.load(path).metrics
        }
        for metric in found.metrics:
            key = metric.name, metric.filter, metric.section, metric.sequence
            assert getattr(metric, side) == pytest.approx(own[key], rel=1e-9)
    for metric in found.metrics:
        assert metric.difference == pytest.approx(metric.new - metric.base, abs=2e-3)


def test_a_worse_firmware_of_the_same_part_is_a_regression(base, worse) -> None:
    found = testbench.compare(base, worse)
    by_filter = {metric.filter: metric for metric in found.metrics}
    assert found.regression
    assert by_filter["device"].told is Told.WORSE
    assert by_filter["madgwick_imu"].told is not Told.WORSE
    whats = {own.what: own for own in found.differing}
    assert whats["firmware of forearm"].base == ["not stated"]
    assert whats["firmware of forearm"].new == ["2.0"]
    assert "part" not in whats
    assert testbench.compare(worse, base).told is Told.BETTER


def test_two_parts_are_not_told_as_a_regression(base, other_part) -> None:
    found = testbench.compare(base, other_part)
    assert found.told is Told.NOT_KNOWN
    assert all(metric.p_holm is None for metric in found.metrics)
    assert all("how far parts of one kind scatter is not known" in m.why for m in found.metrics)
    assert {own.what for own in found.differing} >= {"part"}
    assert command("compare", base, other_part, "--no-report") == 2


def test_several_parts_a_side_are_compared_by_their_scatter(made) -> None:
    names = [
        made(protocol(part, 0.06 if part < 15 else 0.6), part, f"part_{part}")
        for part in (11, 12, 13, 15, 16, 17)
    ]
    folder = names[0].parent / "baselines"
    for path in names[:3]:
        shutil.copytree(path, folder / path.name)
    found = testbench.compare(folder, *names[3:], filters=["device"])
    (metric,) = found.metrics
    assert len(found.base) == len(found.new) == 3
    assert metric.told is Told.WORSE
    assert metric.paired_by == "nothing"
    one = testbench.compare(folder, names[3], filters=["device"])
    assert one.metrics[0].told is Told.WORSE
    assert testbench.compare(folder, names[0], filters=["device"]).metrics[0].freedom == 0
    shutil.rmtree(folder)


def test_the_same_samples_with_another_filter_parameter(base, tmp_path) -> None:
    """What differs is named, and the noise of the samples cancels."""
    copy = tmp_path / "copy"
    shutil.copytree(base, copy)
    judge_again(Session(copy), AnalysisRequest(parameters={"madgwick_imu": {"beta": 0.2}}))
    judge_again(Session(base))
    found = testbench.compare(base, copy, filters=["madgwick_imu"])
    assert [own.what for own in found.differing] == ["madgwick_imu.beta"]
    assert found.differing[0].new == ["0.2"]
    assert "the same samples" in found.notes[0]


def test_parts_that_nobody_tells_are_the_same_where_a_person_says_so(
    base, again, other_part
) -> None:
    assert testbench.compare(base, other_part, same_part=True, filters=["device"]).regression
    assert testbench.compare(base, again, same_part=True, margin=0.05).told is Told.NOT_SHOWN


def test_a_metric_that_one_session_lacks_is_named(base, made) -> None:
    spec = protocol(1)
    spec["estimate"]["filters"] = ["madgwick_imu"]
    found = testbench.compare(base, made(spec, 9, "without_device"))
    assert {metric.filter for metric in found.metrics} == {"madgwick_imu"}
    (told,) = found.left_out
    assert "(device, ZXZ, static) is left out: it is not in without_device" in told


def refused(*arguments: object, **wanted: Any) -> str:
    with pytest.raises(InputError) as raised:
        testbench.compare(*arguments, **wanted)
    return str(raised.value)


def test_what_cannot_be_compared_is_refused_by_name(base, again, made, tmp_path) -> None:
    named = made(protocol(1, name="another"), 5, "named_otherwise")
    assert "its protocol is another, not compared" in refused(base, named)
    spec = protocol(1)
    spec["variables"]["flexion_deg"]["stop"] = 30
    assert "its steps are others" in refused(base, made(spec, 6, "fewer_steps"))
    real = tmp_path / "real"
    shutil.copytree(again, real)
    manifest = read_json(real / MANIFEST)
    manifest["arm"] |= {"driver": "replay", "provenance": "a recorded motion"}
    manifest["simulated_sensors"] = False
    write_json(real / MANIFEST, manifest)
    assert "what is simulated says nothing of what is real" in refused(base, real)
    assert "stands on both sides" in refused(base, base)
    assert "no margin" in refused(base, again, margin=-1)
    with pytest.raises(SessionError, match="does not exist"):
        testbench.compare(base, tmp_path / "nothing")


def test_sessions_of_a_folder_that_cannot_be_compared_are_left_out_by_name(
    base, again, made, tmp_path
) -> None:
    for path in (again, made(protocol(1, name="another"), 5, "of_another")):
        shutil.copytree(path, tmp_path / path.name)
    shutil.copytree(again, tmp_path / "again_2")
    found = testbench.compare(tmp_path, base)
    assert [own.session for own in found.base] == ["again"]
    left = " ".join(found.left_out)
    assert "of_another is left out: its protocol is another" in left
    assert "again_2 is left out: it holds the same samples" in left


def test_mistyped_metrics_and_filters_are_refused(base, again) -> None:
    for wanted in ({"metrics": ["elbow.flexion_rms_deg"]}, {"filters": ["vqf_6"]}):
        with pytest.raises(NotFoundError, match="known: "):
            testbench.compare(base, again, **wanted)
    found = testbench.compare(base, again, metrics=["flexion_rmse_deg", "arm.total_rmse_deg"])
    assert {m.name for m in found.metrics} == {"elbow.flexion_rmse_deg", "arm.total_rmse_deg"}


def test_a_metric_without_errors_over_time_is_not_known_of_one_session(base, again) -> None:
    found = testbench.compare(base, again, metrics=["flexion_max_abs_error_deg"])
    assert found.told is Told.NOT_KNOWN
    assert "one session a side does not show it" in found.metrics[0].why


def test_the_request_goes_through_json() -> None:
    asked = CompareRequest(base="a", new=("b", "c"), margin=0.1)
    assert CompareRequest.model_validate_json(asked.canonical()) == asked


def test_the_command_writes_its_files_and_ends_with_1(base, worse, tmp_path, capsys) -> None:
    files = [tmp_path / name for name in ("page.html", "summary.md", "junit.xml")]
    options = zip(("--report", "--markdown", "--junit"), files, strict=True)
    words = [str(word) for pair in options for word in pair]
    assert command("compare", base, worse, *words) == 1
    out = capsys.readouterr().out
    assert "outcome: regression" in out
    assert "firmware of forearm (not stated to 2.0)" in out
    page, markdown, junit = (file.read_text(encoding="utf-8") for file in files)
    assert "Difference of each metric" in page
    assert markdown.startswith("### worse against base: regression")
    suites = ElementTree.fromstring(junit)
    (failure,) = suites.iter("failure")
    assert "worse" in failure.get("message", "")
    assert suites.find("testsuite").get("failures") == "1"


def test_the_page_lies_beside_the_new_session_where_nothing_is_said(base, again, capsys) -> None:
    assert command("compare", base, again, "--margin", "0.1", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "not_shown"
    assert told["report"] == str(again.parent / "again_against_base.html")
    assert Path(told["report"]).is_file()
    assert "overlays" not in told


def test_a_file_that_cannot_be_written_is_refused_before_anything(base, again, tmp_path) -> None:
    asked = CompareRequest(base=str(base), new=(str(again),), junit=str(tmp_path / "no" / "x.xml"))
    with pytest.raises(InputError, match="there is no folder"):
        compare_sessions(asked)


def test_nothing_is_written_into_the_sessions(base, again) -> None:
    def state(path: Path) -> dict[str, int]:
        return {str(own): own.stat().st_mtime_ns for own in path.rglob("*")}

    before = state(base) | state(again)
    testbench.compare(base, again)
    assert state(base) | state(again) == before
