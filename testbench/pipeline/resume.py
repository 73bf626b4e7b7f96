"""A run that broke off goes on: by the same protocol, on the same arm."""

from __future__ import annotations

from pathlib import Path

from testbench.drivers.arms.catalogue import ARMS, find_arm
from testbench.exceptions import InputError
from testbench.execution.resume import (
    is_own_copy,
    missing_steps,
    open_for_resume,
    refuse_differences,
    refuse_edited_protocol,
    refuse_other_robot,
    stored_protocol,
    stored_robot,
)
from testbench.pipeline.loaded_analysis import LoadedAnalysis
from testbench.pipeline.prepared import Prepared, checked_plan
from testbench.pipeline.request import RunRequest
from testbench.records.session.session import Session


def refuse_other_arm(asked: RunRequest) -> None:
    """Refuse to go on with a session on another kind of arm than the one it was begun on.

    Raises:
        InputError: It was; says which arm to name.
    """
    arm = Session(Path(str(asked.resume))).manifest.arm.record
    if arm is None:
        return  # no run: another refusal says so
    entries = [entry for entry in ARMS.values() if entry.record.driver == arm.driver]
    driver = entries[0].name if entries else arm.driver
    if asked.arm.driver != driver:
        if find_arm(asked.arm.driver).virtual:
            raise InputError(
                f"{asked.resume} was run by --arm {driver}; say that and its options again"
            )
        own = (
            "on a simulated arm; leave --arm away"
            if arm.simulated
            else f"with --arm {driver}; say that"
        )
        raise InputError(f"{asked.resume} was run {own} to go on")


def prepare_resume(asked: RunRequest, analysis: LoadedAnalysis) -> Prepared:
    """What is missing of a session, and whether its files are still what they were.

    Nothing is connected.

    A simulated run is completed in its own folder. A real arm does what is missing in a session of
    its own, after the steps that give the sensors their references.

    Args:
        asked: Its session; its protocol as it is today, the session's own copy if None (unless the
            protocol's file was edited since); its robot likewise.
        analysis: Of what will be recorded.

    Raises:
        SessionError: It was completed, or is no run.
        InputError: Protocol, robot or software are not what they were; lists what differs.
    """
    session = open_for_resume(Path(str(asked.resume)))
    refuse_other_robot(session, asked.robot)
    protocol = asked.protocol
    named = None if protocol is None or is_own_copy(session, protocol) else protocol
    with stored_protocol(session) as stored:
        plan = checked_plan(named or stored, stored_robot(session), analysis)
    note = (
        f"resuming by {protocol}" if protocol is not None else refuse_edited_protocol(session, plan)
    )
    refuse_differences(session, plan, session.manifest.sensors)
    return Prepared(plan, analysis, session, missing_steps(session, plan), note)
