"""Options that hold one value."""

from __future__ import annotations

import json

import pytest

from tests.command_line import command


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (["import", "xsens_dot", "a.csv", "--out", "s", "--standing", "0:1", "--standing=1:2"], 0),
        (["gait", "session", "--distance", "5", "--distance", "6"], 1),
        (["evaluate", "session", "--compare", "device", "--compare", "vqf_6d"], 2),
    ],
)
def test_an_option_of_one_value_that_is_given_twice_is_refused(capsys, arguments, option):
    name = ("--standing", "--distance", "--compare")[option]
    assert command(*arguments, "--json") == 2
    said = json.loads(capsys.readouterr().err)
    assert f"{name} is given twice; say which holds" in json.dumps(said)


def test_options_that_may_be_repeated_and_flags_are_let_be(capsys, tmp_path):
    arguments = ["import", "xsens_dot", "none.csv", "--out", tmp_path / "s", "--json", "--json"]
    assert command(*arguments, "--joint", "a=x:y", "--joint", "b=y:z") == 2
    assert "given" not in capsys.readouterr().err
