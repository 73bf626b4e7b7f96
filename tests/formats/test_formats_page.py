"""docs/formats.md: its examples are valid, and it names every format, option and shipped
mapping.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from testbench.formats import FORMATS, TRUTHS, UNTRIED
from testbench.formats.axes import axis_presets
from testbench.formats.mapping import MappingSpec, list_mappings
from testbench.formats.tables.units import QUANTITIES, unit_names
from testbench.records.disk.yaml_file import load_yaml

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)

OF_PROTOCOLS = {
    "BodyJoint",
    "ChainEstimation",
    "ChainModel",
    "ChainPlacement",
    "ChainSensor",
    "Estimation",
    "FlexionAngle",
    "JointConstraint",
    "JointRotation",
}
"""Parts of a mapping whose keys docs/protocol_reference.md explains."""


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_the_examples_are_valid_mappings(number, tmp_path):
    (tmp_path / "map.yaml").write_text(EXAMPLES[number], encoding="utf-8")
    assert load_yaml(tmp_path / "map.yaml", MappingSpec).value.sensors


def test_everything_that_can_be_asked_for_is_on_the_page():
    wanted = [
        *FORMATS,
        *list_mappings(),
        *axis_presets(),
        *[unit for quantity in QUANTITIES for unit in unit_names(quantity)],
    ]
    options = [
        "--unit",
        "--rate",
        "--axes",
        "--mapping",
        "--truth",
        "--robot",
        "--link",
        "--mounting",
        "--dwell",
        "--move",
    ]
    options += ["--joint", "--sequence", "--place-by", "--standing", "--forward", "--segment"]
    options += ["--encoding", "--truth-offset", "--truth-rate", "--truth-cluster", "--joint-unit"]
    options += ["--truth-angle"]
    assert [name for name in wanted + options if name not in PAGE] == []
    parts = MappingSpec.model_json_schema()["$defs"]
    keys = {
        name
        for kind, part in parts.items()
        if kind not in OF_PROTOCOLS
        for name in part.get("properties", {})
    }
    theirs = {"from_s", "to_s", "reason", "position_mm", "rotation_deg", "x", "y", "z"}
    assert [key for key in keys - theirs if key not in PAGE] == []


def test_every_format_says_what_it_was_tried_on_or_that_it_was_not():
    for name, entry in FORMATS.items():
        assert entry.line.endswith((f"tried on {entry.tried}", UNTRIED)), name
        assert f"`{name}`" in PAGE.partition("### What was verified")[2], name
    assert all("tried on" in line for name, line in TRUTHS.items() if name != "table")
