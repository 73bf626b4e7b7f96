"""Sessions that an earlier version wrote open, and every stage takes them; one that broke off then
is gone on with now. tests/golden/sessions/README.md says what they are.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from testbench import estimate, plan
from testbench.exceptions import SessionError
from testbench.execution.resume import stored_protocol
from testbench.records.results.estimate import Estimate
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import software_versions
from tests.command_line import command

SESSIONS = Path(__file__).parents[1] / "golden" / "sessions"
KINDS = {"completed": "run", "interrupted": "run", "imported": "import"}


@pytest.fixture
def older(tmp_path: Path):
    def copied(name: str) -> Path:
        return Path(shutil.copytree(SESSIONS / name, tmp_path / name))

    return copied


def key_paths(value: Any, path: str = "") -> Iterator[str]:
    """Where the values of a document stand, as in keys.json."""
    if isinstance(value, dict):
        yield from [] if value else [f"{path}.{{}}"]
        for key, inner in value.items():
            yield from key_paths(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        yield from [] if value else [f"{path}[]"]
        for inner in value:
            yield from key_paths(inner, f"{path}[]")
    else:
        yield path


def missing_keys(document: str, written: Any) -> set[str]:
    """Keys that the earlier version wrote and this one does not, but for remarks, which became
    findings.
    """
    before = set(json.loads((SESSIONS / "keys.json").read_text(encoding="utf-8"))[document])
    return {key for key in before - set(key_paths(written)) if not key.endswith("remarks[]")}


@pytest.mark.parametrize("name", sorted(KINDS))
def test_an_older_session_opens(name: str) -> None:
    session = Session(SESSIONS / name)
    assert session.manifest.kind == KINDS[name]
    assert session.status.value == ("interrupted" if name == "interrupted" else "completed")
    for sensor in session.sensor_names:
        assert len(session.imu(sensor)) == session.sample_count(sensor) > 0
        truth = session.truth(sensor)
        assert truth is not None
        assert len(truth.host_time_ns) > 0
    assert session.events
    assert (session.arm() is None) == (session.robot is None) == (name == "imported")
    assert session.analysis.estimate.filters
    assert session.started.year == 2026


@pytest.mark.parametrize("name", ["completed", "imported"])
def test_an_older_session_is_estimated_evaluated_reported_and_exported(name, older, capsys) -> None:
    folder = older(name)
    for arguments in (
        ("estimate", folder),
        ("evaluate", folder),
        ("report", folder),
        ("export", folder, "--to", "csv"),
        ("export", folder, "--to", "mat"),
    ):
        assert command(*arguments) == 0, capsys.readouterr()
    assert "<h1" in (folder / "report.html").read_text(encoding="utf-8")
    assert (folder / "export").is_dir()


def test_the_estimate_of_an_older_session_is_evaluated_as_it_is(older) -> None:
    folder = older("imported")
    before = Estimate.load(folder)
    assert before.fingerprint == Session(folder).fingerprint
    written = (folder / "estimate" / "estimate.json").read_bytes()
    assert command("evaluate", folder) == 0
    assert (folder / "estimate" / "estimate.json").read_bytes() == written


def test_documents_keep_the_keys_that_an_older_version_wrote(older, capsys) -> None:
    folder = older("completed")
    assert command("estimate", folder, "--json") == 0
    assert not missing_keys("estimate --json", json.loads(capsys.readouterr().out))
    assert command("evaluate", folder, "--json") == 0
    assert not missing_keys("evaluation.json", json.loads(capsys.readouterr().out))
    evaluation = json.loads((folder / "evaluation.json").read_text(encoding="utf-8"))
    assert not missing_keys("evaluation.json", evaluation)
    estimate = json.loads((folder / "estimate" / "estimate.json").read_text(encoding="utf-8"))
    assert not missing_keys("estimate.json", estimate)


def test_an_older_study_is_read_and_written_again_as_it_was(tmp_path) -> None:
    StudyRecord.load(SESSIONS).save(tmp_path)
    before, after = (
        json.loads((folder / "study.json").read_text(encoding="utf-8"))
        for folder in (SESSIONS, tmp_path)
    )
    assert _keeps(after, before)


def _keeps(after: object, before: object) -> bool:
    """Whether all that was is there; what has come since may stand beside it."""
    if isinstance(before, dict) and isinstance(after, dict):
        return all(key in after and _keeps(after[key], one) for key, one in before.items())
    if isinstance(before, list) and isinstance(after, list):
        pairs = zip(after, before, strict=False)
        return len(after) == len(before) and all(_keeps(own, one) for own, one in pairs)
    return after == before


def test_an_older_session_that_broke_off_is_gone_on_with(older, capsys) -> None:
    """A run is gone on with only by the software that began it. That cannot be had here, so the
    copy says that today's began it: its versions, and the plan that today's planner makes of the
    same protocol, which a newer ruckig may time otherwise. What is tested is that today's bench
    reads, checks and closes what the earlier version wrote.
    """
    folder = older("interrupted")
    file = folder / "manifest.json"
    manifest = json.loads(file.read_text(encoding="utf-8"))
    manifest["software"] = software_versions()
    broken = Session(folder)
    with stored_protocol(broken) as protocol:
        manifest["plan"]["hash"] = plan(protocol, broken.robot).hash
    file.write_text(json.dumps(manifest), encoding="utf-8")
    assert command("run", "--resume", folder, "--no-report") == 0, capsys.readouterr()
    session = Session(folder)
    assert session.status is RunStatus.COMPLETED
    assert len(session.steps) == 3
    after = json.loads(file.read_text(encoding="utf-8"))
    assert after["resumed"] == [{"at_s": manifest["duration_s"], "was": "interrupted"}]
    assert after["arm"] == after["arm"] | manifest["arm"]  # nothing is lost that was known of it
    changed = {"status", "message", "duration_s", "files", "resumed", "arm", "device_statistics"}
    changed |= {"analysis_request"}  # which earlier versions did not keep
    assert {k: v for k, v in after.items() if k not in changed} == {
        k: v for k, v in manifest.items() if k not in changed
    }


def test_an_older_session_of_other_software_is_refused_in_a_sentence(older, capsys) -> None:
    folder = older("interrupted")
    file = folder / "manifest.json"
    manifest = json.loads(file.read_text(encoding="utf-8"))
    manifest["software"] |= {"numpy": "0.1"}
    file.write_text(json.dumps(manifest), encoding="utf-8")
    assert command("run", "--resume", folder, "--no-report") == 2
    assert "software numpy: 0.1 before" in capsys.readouterr().err


@pytest.mark.parametrize("end", ["proximal", "distal"])
def test_a_joint_of_a_sensor_that_a_session_lacks_is_refused(quick, tmp_path, end) -> None:
    folder = tmp_path / "session"
    shutil.copytree(quick.session.path, folder)
    content = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    content["analysis"]["joints"]["elbow"][end] = "knee"
    (folder / "manifest.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(SessionError, match=rf"joints\.elbow\.{end} is 'knee'; the sensors are arm"):
        estimate(Session(folder))
