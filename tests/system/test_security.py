"""The bench trusts no file: mutated and malicious protocols, robots and sessions are refused in a
sentence, quickly.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from testbench.exceptions import BenchError, ExpressionError, FileProblems, SessionError
from testbench.execution import RunOptions
from testbench.execution.recovery import recover
from testbench.planning.expressions import evaluate_expression
from testbench.records.disk.json_file import read_json
from testbench.records.session.session import Session
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.shipped import shipped_folder
from tests.system.mutations import Campaign

CALIBRATION = """\
robot: ur3e
serial: "20265000001"
corrections:
  theta_rad: [0.001, -0.002, 0.0005, 0.0, 0.0, 0.0]
  d_m: [0.0001, 0.3, -0.25, -0.05, 0.0, 0.0]
  a_m: [0.0, 0.0002, -0.0001, 0.0, 0.0, 0.0]
  alpha_rad: [0.0, 0.001, 0.0, 0.0, 0.0, 0.0]
"""


@pytest.fixture
def campaign(tmp_path, tiny, quick, monkeypatch):
    monkeypatch.chdir(tmp_path)  # put back at the end
    (tmp_path / "inside").mkdir()
    small = tmp_path / "inside" / "session"
    shutil.copytree(
        quick.session.path,
        small,
        ignore=shutil.ignore_patterns("estimate", "evaluation*", "report.html"),
    )
    return Campaign(
        tmp_path / "inside", tiny, shipped_folder("robots") / "ur3e", small, CALIBRATION
    )


@pytest.mark.parametrize("begin", [0])
def test_no_mutated_file_ends_in_a_traceback_a_hang_or_a_file_elsewhere(campaign, begin):
    for number in range(begin, begin + 100):
        campaign.one(number)
    assert campaign.found.failures == []
    assert campaign.found.refused > 40


@pytest.mark.parametrize(
    "name", ["../../evil", "/etc/x", "..", "a/b", "a\\b", "", "x\x00y", "n" * 200]
)
def test_a_session_cannot_name_a_sensor_out_of_its_folder(tmp_path, quick, name):
    copy = tmp_path / "session"
    shutil.copytree(quick.session.path, copy)
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["sensors"][name] = manifest["sensors"]["arm"]
    manifest["status"] = "running"
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(SessionError, match="no name for a sensor"):
        recover(Session(copy))
    assert {path.name for path in tmp_path.iterdir()} == {"session"}


@pytest.mark.parametrize("part", ["files", "plan", "robot", "software"])
@pytest.mark.parametrize("value", [-1, "x", None, []])
def test_a_part_of_a_manifest_that_is_no_mapping_is_called_damage(tmp_path, quick, part, value):
    manifest = json.loads((quick.session.path / "manifest.json").read_text())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest | {part: value}))
    with pytest.raises(SessionError, match=f"damaged: its {part} is no mapping"):
        Session(tmp_path)


@pytest.mark.parametrize(
    "expression",
    ["__import__('os')", "open('/etc/passwd')", "(" * 150 + ")" * 150, "9**9**9", "x.__class__"],
)
def test_arithmetic_runs_no_code_and_has_an_end(expression):
    with pytest.raises(ExpressionError):
        evaluate_expression(expression, {"x": 1.0})


def test_includes_stay_in_the_folder_of_the_protocol(tmp_path, tiny):
    secret = tmp_path / "secret.yaml"
    secret.write_text(tiny.read_text())
    inside = tmp_path / "inside"
    inside.mkdir()
    text = tiny.read_text().replace(
        "sections:\n", "sections:\n  - {name: stolen, include: ../secret.yaml}\n"
    )
    (inside / "protocol.yaml").write_text(text)
    with pytest.raises(FileProblems, match="lies elsewhere"):
        load_protocol(inside / "protocol.yaml")
    (inside / "linked.yaml").symlink_to(secret)
    (inside / "protocol.yaml").write_text(text.replace("../secret.yaml", "linked.yaml"))
    with pytest.raises(FileProblems, match="lies elsewhere"):
        load_protocol(inside / "protocol.yaml")


def test_huge_files_are_refused_before_they_are_read(tmp_path, tiny):
    huge = tmp_path / "huge.yaml"
    with huge.open("wb") as file:
        file.truncate(10_000_000_000)
    with pytest.raises(BenchError):
        load_protocol(huge)
    with pytest.raises(SessionError, match="more than"):
        read_json(huge)


def test_every_string_of_a_report_is_escaped(tmp_path, altered_protocol, clock):
    from testbench import execute, plan
    from testbench.pipeline.analyse import analyse
    from tests.asking import analysis

    def poison(content) -> None:
        content["purpose"] = "<script>alert(1)</script>"
        content["sections"][0]["steps"][0]["name"] = "<img src=x onerror=alert(2)>"

    path: Path = altered_protocol("quick", poison)
    session = execute(plan(path), tmp_path, 1, RunOptions(clock=clock))
    report = analyse(session, analysis("device", report=True)).report
    html = report.read_text()
    assert "<script>alert(1)" not in html
    assert "<img src=x" not in html
    assert "alert(1)" in html  # it is shown, as text
