"""Laboratory data: asked for once, kept in the user's config folder, refused where malformed."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.exceptions import FileProblems, InputError
from testbench.records.specs.laboratory import (
    Laboratory,
    laboratory_file,
    load_laboratory,
    save_laboratory,
)


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "testbench" / "laboratory.yaml"


def test_what_is_kept_is_read_again(home: Path) -> None:
    own = Laboratory(name="Labor für Bewegung", address="Straße 1", ambient="(23 ± 2) °C")
    assert save_laboratory(own) == home == laboratory_file()
    assert load_laboratory(None) == own
    assert not list(home.parent.glob(".*"))


def test_without_one_it_is_said_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="testbench certificate laboratory"):
        load_laboratory(None)
    with pytest.raises(FileProblems, match="cannot be read"):
        load_laboratory(tmp_path / "none.yaml")


def test_a_key_that_does_nothing_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "laboratory.yaml"
    file.write_text("name: A\naddress: B\ntemperature: 23\n", encoding="utf-8")
    with pytest.raises(FileProblems, match="temperature"):
        load_laboratory(file)


def test_it_is_asked_for_and_an_empty_answer_keeps_what_stood_there(home: Path) -> None:
    answers = ["My laboratory", "Street 1", "", "B. Operator", "", "", "", ""]
    done = CliRunner().invoke(app, ["certificate", "laboratory"], input="\n".join(answers) + "\n")
    assert done.exit_code == 0, done.output
    assert f"laboratory: {home}" in done.output
    first = Laboratory(name="My laboratory", address="Street 1", operator="B. Operator")
    assert load_laboratory(None) == first
    again = ["", "", "lab@example.org", "", "", "", "", ""]
    done = CliRunner().invoke(app, ["certificate", "laboratory"], input="\n".join(again) + "\n")
    assert done.exit_code == 0, done.output
    assert load_laboratory(None) == first.model_copy(update={"contact": "lab@example.org"})
