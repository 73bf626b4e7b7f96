"""The command `plan` tells what is doubtful about a plan, as `check` and `run` do."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.pipeline.prepared import make_plan
from tests.asking import run_of


@pytest.fixture
def doubtful(tmp_path) -> str:
    """A protocol on an arm of which much is assumed."""
    file = tmp_path / "doubtful.yaml"
    file.write_text(
        "name: doubtful\npurpose: For a test\nrobot: ur3\nsensors: {hand: {preset: ideal, link: "
        "wrist_3_link}}\n"
        "sections: [{name: part, steps: [dwell_s: 1]}]\n"
    )
    return str(file)


def test_the_warnings_stand_on_stderr_beside_the_table(doubtful):
    warnings = make_plan(run_of(doubtful)).check.warnings
    assert any("assumed" in warning for warning in warnings)
    result = CliRunner().invoke(app, ["plan", doubtful])
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [f"warning: {warning}" for warning in warnings]
    assert "hash: " in result.stdout and "warning" not in result.stdout


def test_with_json_they_are_a_key(doubtful):
    result = CliRunner().invoke(app, ["plan", doubtful, "--json"])
    assert json.loads(result.stdout)["warnings"] == make_plan(run_of(doubtful)).check.warnings
    assert result.stderr == ""
