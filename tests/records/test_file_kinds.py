"""A file of another kind in the place of a protocol is called by its name, in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.exceptions import FileProblems
from testbench.formats.axes import PRESETS as FORMAT_PRESETS
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.sensor import PRESETS
from testbench.records.specs.shipped import shipped_folder

ROBOTS = sorted(shipped_folder("robots").glob("*/robot.yaml"))
OTHERS = (
    [(file, "It looks like a robot file: name it with --robot") for file in ROBOTS]
    + [
        (file, "It looks like a sensor preset: name it as the preset")
        for file in sorted(PRESETS.glob("*.yaml"))
    ]
    + [
        (file, "It looks like a mapping of the generic format: name it with --mapping")
        for file in sorted((FORMAT_PRESETS / "mappings").glob("*.yaml"))
    ]
)


def refusal(file: Path) -> str:
    with pytest.raises(FileProblems) as refused:
        load_protocol(file)
    (problem,) = refused.value.problems
    assert problem.line == 1
    return problem.message


@pytest.mark.parametrize(
    ("file", "said"),
    OTHERS,
    ids=lambda value: f"{value.parent.name}/{value.name}" if value is Path else None,
)
def test_every_shipped_file_of_another_kind_is_recognised(file, said):
    message = refusal(file)
    assert message.startswith("this is no protocol: it lacks 'sections', ")
    assert said in message


def test_a_manifest_and_a_calibration_are_recognised(quick, tmp_path):
    assert "the manifest of a session: give the folder" in refusal(
        quick.session.path / "manifest.json"
    )
    stored = tmp_path / "c.yaml"
    stored.write_text("sensor: a\ncalibrated_utc: x\nfingerprint: y\naccelerometer: null\n")
    assert "a stored calibration: name it with --calibration" in refusal(stored)


def test_a_file_like_none_known_is_no_protocol_either(tmp_path):
    file = tmp_path / "compose.yaml"
    file.write_text(
        "services: {web: {image: x}}\nvolumes: {}\nversion: 3\nnetworks: {}\nconfigs: {}\n"
    )
    assert refusal(file) == (
        "this is no protocol: it lacks 'sections', 'sensors', 'robot', 'purpose' ..., and a "
        "protocol has no 'services', "
        "'volumes', 'version', 'networks' .... `testbench protocols` lists protocols to begin from"
    )


@pytest.mark.parametrize("key", ["name", "robot", "sections"])
def test_a_protocol_that_lacks_one_key_is_told_of_it(key, altered_protocol):
    with pytest.raises(FileProblems, match=f"the key '{key}' is missing"):
        load_protocol(altered_protocol("quick", lambda protocol: protocol.pop(key)))
