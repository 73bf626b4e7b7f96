"""Faults of emulated controllers as they are asked for: what each may be told, on the port for
faults and in a scenario.
"""

from __future__ import annotations

import pytest

from testbench.emulation.faults import load_scenario, parse_command
from testbench.emulation.ur.faults import FAULTS as UR_FAULTS
from testbench.emulation.ur.faults import UrScenario
from testbench.emulation.xarm.faults import FAULTS as XARM_FAULTS
from testbench.emulation.xarm.faults import XArmScenario
from testbench.exceptions import BenchError, InputError

REFUSED = [
    ("slider 7", "the value of slider must be a share from 0 to 1, not 7"),
    ("slider -0.1", "a share from 0 to 1, not -0.1"),
    ("slider nan", "a share from 0 to 1, not nan"),
    ("rtde_loss 1.01", "a share from 0 to 1, not 1.01"),
    ("disconnect -3", "the value of disconnect must be a number of seconds, 0 or more, not -3"),
    ("disconnect inf", "a number of seconds, 0 or more, not inf"),
    ("rtde_delay -0.001", "a number of seconds, 0 or more, not -0.001"),
    ("slow_response nan", "a number of seconds, 0 or more, not nan"),
    ("power_off 3", "the fault power_off takes no value"),
    ("slider half", "the value 'half' is no number"),
]


@pytest.mark.parametrize(("asked", "sentence"), REFUSED, ids=[asked for asked, _ in REFUSED])
def test_a_value_that_a_fault_cannot_have_is_refused_with_what_is_allowed(asked, sentence):
    with pytest.raises(InputError) as caught:
        parse_command(f"fault {asked}", UR_FAULTS)
    assert sentence in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "asked", ["report_loss 2", "report_delay -1", "disconnect -3", "servo_error 1"]
)
def test_those_of_the_other_maker_too(asked):
    with pytest.raises(InputError, match=r"must be|takes no value"):
        parse_command(f"fault {asked}", XARM_FAULTS)


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("known", [UR_FAULTS, XARM_FAULTS], ids=["ur", "xarm"])
def test_every_fault_can_be_asked_for_without_a_value_and_those_that_take_one_with_it(known, value):
    for name, kind in known.items():
        assert parse_command(f"fault {name}", known) == ("fault", name, None)
        if kind.value is not None:
            assert parse_command(f"fault {name} {value}", known) == ("fault", name, value)
    assert {name for name, kind in known.items() if kind.value is not None} >= {
        "disconnect",
        "slow_response",
    }


@pytest.mark.parametrize(
    ("scenario", "fault", "sentence"),
    [
        (UrScenario, "slider, value: 7", "must be a share from 0 to 1, not 7"),
        (XArmScenario, "disconnect, value: -3", "must be a number of seconds, 0 or more, not -3"),
    ],
    ids=["ur", "xarm"],
)
def test_a_scenario_is_refused_at_the_line_of_such_a_value(tmp_path, scenario, fault, sentence):
    path = tmp_path / "faults.yaml"
    path.write_text(f"faults:\n  - {{fault: {fault}, at_s: 1}}\n")
    with pytest.raises(BenchError, match=sentence) as caught:
        load_scenario(path, scenario)
    assert f"{path}:2:" in str(caught.value)
