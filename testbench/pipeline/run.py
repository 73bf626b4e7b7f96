"""Carry out a request: plan, check, move, record, estimate, evaluate, report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from testbench.drivers.arms.catalogue import find_arm, refuse_other_maker
from testbench.exceptions import BenchError, SessionError
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm, simulated_sensors
from testbench.execution.recorder import recorded_ns
from testbench.execution.resume import open_for_resume, refuse_differences
from testbench.execution.run_progress import Progress
from testbench.pipeline.analyse import Result, analyse
from testbench.pipeline.approval import approve
from testbench.pipeline.arm import make_arm, refuse_arm, refuse_other_sensors
from testbench.pipeline.kept_analysis import analysis_to_go_on, kept_analysis
from testbench.pipeline.loaded_analysis import load_analysis
from testbench.pipeline.prepared import Prepared, plan_for
from testbench.pipeline.request import AnalysisRequest, Request, RunRequest
from testbench.pipeline.resume import prepare_resume, refuse_other_arm
from testbench.pipeline.watcher import Consent, Watcher
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_lock


def run(asked: Request, watcher: Watcher | None = None, prepared: Prepared | None = None) -> Result:
    """Run a protocol from its file to its report, or go on with a run that broke off.

    Everything that a request names is read, and refused where it cannot be used, before anything
    moves. A real arm moves only if the watcher brings a person's consent.

    Args:
        asked: What to run, and how to analyse it.
        watcher: Who looks on; nobody, by the machine's clock, if None.
        prepared: As `prepare` made it of a request with the same protocol, robot and arm, where
            there is one: it spares the planning.

    Raises:
        SessionError: The session to go on with was completed, or is no run.
        InputError: The request was refused; nothing moved.
        ArmRefused: Nobody allowed the motion, or the arm must not be driven; nothing moved.
        DriverError: Arm or sensor failed; what was recorded is kept.
        RunInterrupted: The operator stopped it; what was recorded is kept.
    """
    watcher = watcher or Watcher()
    prepared = prepared or prepare(asked, watcher.consent)
    wanted = _analysis(asked)
    if prepared.analysis.asked != wanted:
        prepared = replace(prepared, analysis=load_analysis(wanted))
    watcher.prepared(prepared)
    session, analysis = _record(prepared, asked.run, watcher), prepared.analysis
    del prepared  # of hours the motion is 0.1 GB, which no analysis looks at
    if watcher.progress is not None:
        watcher.progress(_doing("the arm is done: estimating, evaluating"))
    try:
        return analyse(session, analysis, whatever=True)
    except BenchError as error:
        error.add_note(
            f"the recording is whole; evaluate it again: testbench report {session.path}"
        )
        raise


def prepare(asked: Request, consent: Consent | None = None) -> Prepared:
    """Read and plan everything that a request for a run names; nothing is connected or moves.

    Args:
        asked: What to run, and how to analyse it.
        consent: What a person allows; an arm that does not move takes none.

    Raises:
        SessionError: The session to go on with was completed, or is no run.
        InputError: Something cannot be used, or the arm is another maker's.
    """
    analysis = load_analysis(_analysis(asked))
    if asked.run.resume is not None:
        refuse_other_arm(asked.run)
    refuse_arm(asked.run, consent or Consent())
    if asked.run.resume is not None:
        return prepare_resume(asked.run, analysis)
    plan = plan_for(asked, analysis)
    refuse_other_maker(asked.run.arm.driver, plan.robot.name)
    return Prepared(plan, analysis)


def _analysis(asked: Request) -> AnalysisRequest:
    """How a run is analysed: one that goes on as it was to be when it began, if nothing else is
    asked for.
    """
    if asked.run.resume is None:
        return asked.analysis
    return analysis_to_go_on(Session(Path(asked.run.resume)), asked.analysis)


def _completed(
    session: Session, prepared: Prepared, asked: RunRequest, watcher: Watcher
) -> Session:
    """A session in virtual time that broke off, completed as it began."""
    with session_lock(session.path):
        # As it is now: another process may have gone on with it meanwhile.
        resumed = open_for_resume(session.path)
        refuse_differences(resumed, prepared.plan, simulated_sensors(prepared.plan))
        seed, speed = resumed.manifest.seed, resumed.manifest.arm.speed
        if seed is None:
            raise SessionError(f"{resumed.path} does not say by which seed it was begun")
        again = asked.model_copy(update={"seed": seed, "speed": speed})
        arm, sensors = make_arm(prepared.plan, again, watcher.clock, recorded_ns(resumed))
        options = replace(_options(prepared, again, watcher), resumed=resumed)
        return execute_on_arm(prepared.plan, arm, sensors, options)


def _record(prepared: Prepared, asked: RunRequest, watcher: Watcher) -> Session:
    """Record an arm, once a person has allowed what moves."""
    entry = find_arm(asked.arm.driver)
    if entry.virtual and prepared.resumed is not None:
        return _completed(prepared.resumed, prepared, asked, watcher)
    checklist = approve(prepared, asked, watcher) if entry.commanded else None
    if watcher.progress is not None and not entry.virtual:
        watcher.progress(_doing("connecting"))
    arm, sensors = make_arm(prepared.plan, asked, watcher.clock)
    refuse_other_sensors(prepared, sensors)
    resumes: dict[str, Any] | None = None
    if prepared.resumed is not None:
        steps = prepared.steps or []
        resumes = {"session": prepared.resumed.name, "steps": [step.index for step in steps]}
    options = replace(
        _options(prepared, asked, watcher),
        steps=prepared.steps,
        checklist=checklist,
        resumes=resumes,
    )
    return execute_on_arm(prepared.plan, arm, sensors, options)


def _options(prepared: Prepared, asked: RunRequest, watcher: Watcher) -> RunOptions:
    """What any run takes of a request, and who looks on."""
    return RunOptions(
        asked.logs,
        asked.seed,
        asked.speed,
        watcher.clock,
        analysis_request=kept_analysis(prepared.analysis.asked),
        keys=watcher.keys,
        progress=watcher.progress,
        notify=watcher.notify,
        say=watcher.say,
        opened=watcher.opened,
    )


def _doing(what: str) -> Progress:
    """What happens in place of a step."""
    return Progress("", 0, 0, 1.0, 1.0, what)
