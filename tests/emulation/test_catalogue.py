"""Each controller that can be emulated is a command with its own options."""

from __future__ import annotations

import inspect
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.emulation import catalogue
from testbench.emulation.catalogue import EMULATED, emulated
from testbench.emulation.request import EmulationRequest
from testbench.exceptions import InputError, NotFoundError


@pytest.mark.parametrize("arm", EMULATED, ids=lambda arm: arm.name)
def test_a_command_hands_every_option_to_the_server_that_its_entry_names(arm, monkeypatch):
    given = {}

    def make_server(**wanted):
        given.update(wanted)
        raise InputError("not started")

    made = SimpleNamespace(make_server=make_server)
    monkeypatch.setattr(catalogue, "import_module", lambda module: made)
    own = [word for option in arm.options for word in words(option)]
    command = ["emulate", arm.name, "--at", "0,-90", "--seed", "3", "--token", "t", *own]
    result = CliRunner().invoke(app, command)
    assert str(result.exception) == "not started"
    assert (given["model"], given["at_deg"], given["seed"]) == (arm.model, [0.0, -90.0], 3)
    assert (given["address"], given["token"], given["scenario"]) == ("127.0.0.1", "t", None)
    for option in arm.options:
        expected = {bool: True, int: 1502, type(None): "said"}[type(option.default)]
        assert given[option.name] == expected


def words(option) -> list[str]:
    value = {bool: [], int: ["1502"], type(None): ["said"]}[type(option.default)]
    return [option.flag, *value]


@pytest.mark.parametrize("arm", EMULATED, ids=lambda arm: arm.name)
def test_the_server_of_an_entry_takes_what_the_command_gives(arm):
    module, _, function = arm.served_by.partition(":")
    made = getattr(catalogue.import_module(module), function)
    signature = inspect.signature(made)
    common = dict.fromkeys(("model", "address", "token", "at_deg", "seed", "scenario"))
    signature.bind(**common, **{option.name: option.default for option in arm.options})
    with pytest.raises(InputError, match="'panda' is not emulated; known: "):
        emulated(EmulationRequest(arm=arm.name, model="panda"))
    with pytest.raises(NotFoundError, match=r"unknown option of the emulated \w+ 'colour'"):
        emulated(EmulationRequest(arm=arm.name, own={"colour": "red"}))


def test_a_controller_that_nobody_emulates_is_refused():
    with pytest.raises(NotFoundError, match="unknown emulated controller 'panda'; known: "):
        emulated(EmulationRequest(arm="panda"))


def test_a_number_beyond_the_range_of_an_option_is_refused():
    result = CliRunner().invoke(app, ["emulate", "xarm", "--command-port", "70000"])
    assert result.exit_code == 2 and "--command-port" in result.output
