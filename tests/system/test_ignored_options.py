"""Options that the chosen arm would take no notice of are refused: a run that was not meant must
not pass.
"""

from __future__ import annotations

from typing import Any

import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.exceptions import InputError
from testbench.pipeline.arm import refuse_arm
from testbench.pipeline.request import ArmRequest, RunRequest
from testbench.pipeline.watcher import Consent
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.session.session import Session


def refusal(*arguments: str) -> str:
    """Of a command that must end with exit code 2 before it makes a session."""
    result = CliRunner().invoke(app, list(arguments))
    assert isinstance(result.exception, InputError) and result.exception.exit_code == 2, (
        result.output
    )
    return str(result.exception)


@pytest.mark.parametrize(
    ("options", "needed"),
    [
        (["--serial", "arm=/dev/ttyUSB9:bno080_serial"], "--serial needs --arm ur, xarm or replay"),
        (["--dot", "arm=D4:22:CD:00:11:22"], "--dot needs --arm ur, xarm or replay"),
        (["--simulate-imus"], "--simulate-imus needs --arm ur, xarm or replay"),
        (["--host", "192.168.0.10"], "--host needs --arm ur or xarm"),
        (["--confirm-motion"], "--confirm-motion needs --arm ur or xarm"),
        (["--hazards-checked"], "--hazards-checked needs --arm ur or xarm"),
        (["--kinematics", "calibration.yaml"], "--kinematics needs --arm ur or replay"),
        (["--log", "motion.csv"], "--log needs --arm replay"),
        (
            ["--arm", "replay", "--log", "motion.csv", "--host", "192.168.0.10"],
            "--host needs --arm ur or xarm",
        ),
        (
            ["--arm", "replay", "--log", "motion.csv", "--confirm-motion"],
            "--confirm-motion needs --arm ur or xarm",
        ),
        (
            ["--arm", "ur", "--host", "192.168.0.10", "--log", "motion.csv"],
            "--log needs --arm replay",
        ),
        (
            ["--arm", "xarm", "--host", "1.2.3.4", "--kinematics", "own.yaml"],
            "--kinematics needs --arm ur or replay",
        ),
        (
            ["--arm", "ur", "--host", "192.168.0.10", "--speed", "realtime"],
            "--speed needs --arm sim",
        ),
        (
            ["--arm", "ur", "--host", "1.2.3.4", "--seed", "4"],
            "--seed needs simulated sensors: --simulate-imus",
        ),
        (
            [
                "--arm",
                "ur",
                "--host",
                "1.2.3.4",
                "--simulate-imus",
                "--serial",
                "arm=/dev/ttyUSB9:bno080_serial",
            ],
            "--serial needs a run without --simulate-imus",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_an_option_that_the_chosen_arm_ignores_is_refused_with_the_arms_that_take_it(
    tiny, tmp_path, options, needed
):
    assert refusal("run", str(tiny), "--logs", str(tmp_path / "logs"), *options) == needed
    assert not (tmp_path / "logs").exists()


def refuse(consent: Consent, **arm: Any) -> None:
    """Refuse what an arm cannot use."""
    refuse_arm(RunRequest(arm=ArmRequest(**arm)), consent)


def test_every_ignored_option_is_named_at_once():
    with pytest.raises(
        InputError, match=r"--serial needs .*; --host needs .*; --confirm-motion needs"
    ):
        refuse(Consent(motion=True), host="192.168.0.10", serial=("a=b:c",))


def test_what_an_arm_takes_is_not_refused():
    refuse_arm(RunRequest(seed=3, speed="realtime", logs="elsewhere"), Consent())
    refuse(
        Consent(motion=True),
        driver="ur",
        host="1.2.3.4",
        serial=("a=b:c",),
        kinematics="own.yaml",
    )
    xarm = ArmRequest(driver="xarm", host="1.2.3.4", simulate_imus=True)
    refuse_arm(RunRequest(arm=xarm, seed=3, resume="session"), Consent(hazards_checked=True))
    refuse(Consent(), driver="replay", log="log.csv", dots=("a=b",))


@pytest.fixture(scope="module")
def simulated(tiny, tmp_path_factory) -> tuple[str, Session]:
    """What a simulated run says on the terminal, and its session."""
    logs = tmp_path_factory.mktemp("logs")
    result = CliRunner().invoke(app, ["run", str(tiny), "--logs", str(logs), "--no-report"])
    assert result.exit_code == 0, result.output
    return result.output, Session(next(logs.iterdir()))


def test_the_result_of_a_simulated_run_says_so(simulated):
    said, session = simulated
    assert "\nsimulated: arm and sensors\n" in said
    assert session.simulated == ["arm", "sensors"]
    again = CliRunner().invoke(app, ["evaluate", str(session.path)])
    assert "\nsimulated: arm and sensors\n" in again.output


def test_a_session_says_what_of_it_was_simulated(simulated):
    session = simulated[1]
    for arm, sensors, expected in (
        ("ur", True, ["sensors"]),
        ("ur", False, []),
        ("replay", True, ["sensors"]),
    ):
        session.manifest = session.manifest.changed(arm={"driver": arm}, simulated_sensors=sensors)
        assert session.simulated == expected


def test_a_session_is_resumed_on_the_arm_that_it_was_begun_on_and_with_its_own_seed(
    simulated, tmp_path
):
    session = simulated[1]
    path = str(session.path)
    assert "leave --arm away to go on" in refusal(
        "run", "--resume", path, "--arm", "ur", "--host", "127.0.0.1"
    )
    for option, value in (("--seed", "7"), ("--speed", "realtime"), ("--logs", str(tmp_path))):
        expected = f"{option} needs a new run: a simulated session goes on as it began"
        assert refusal("run", "--resume", path, option, value) == expected
    before = read_json(session.path / "manifest.json")
    write_json(session.path / "manifest.json", before | {"arm": {"driver": "xarm"}})
    assert "with --arm xarm; say that to go on" in refusal(
        "run", "--resume", path, "--arm", "ur", "--host", "127.0.0.1"
    )
    write_json(session.path / "manifest.json", before)
