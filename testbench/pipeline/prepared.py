"""A request for a run with all it names read, its motion planned, and nothing to be refused."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from testbench.estimation.filters import get_filter
from testbench.exceptions import InputError
from testbench.pipeline.exports import refuse_export
from testbench.pipeline.loaded_analysis import LoadedAnalysis, load_analysis
from testbench.pipeline.request import Request
from testbench.planning import plan
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.session import Session
from testbench.records.specs.robot import Robot


@dataclass(frozen=True)
class Prepared:
    """What a run will do.

    Attributes:
        plan: Of the whole protocol.
        analysis: Of what is recorded.
        resumed: Session that the run goes on with; None for a new one.
        steps: Those that a real arm does; all if None.
        note: By which protocol a session goes on, for people.
    """

    plan: Plan
    analysis: LoadedAnalysis
    resumed: Session | None = None
    steps: list[PlannedStep] | None = None
    note: str = ""


def make_plan(asked: Request) -> Plan:
    """Plan what a request would run, and refuse filters and parameters that there are not.

    Args:
        asked: What to run, and how to analyse it.

    Raises:
        NotFoundError: An unknown filter or parameter.
        FileProblems: Protocol or robot are malformed, or the protocol gives a filter parameters
            that it does not take.
        InputError: No protocol is named, or something else that the request names cannot be used.
    """
    return plan_for(asked, load_analysis(asked.analysis))


def plan_for(asked: Request, analysis: LoadedAnalysis) -> Plan:
    """As `make_plan`, with an analysis that is loaded."""
    protocol, robot = asked.run.protocol, asked.run.robot
    if protocol is None:
        raise InputError("name a protocol, or a session with --resume")
    kinematics = asked.run.arm.kinematics
    if kinematics is None:
        return checked_plan(protocol, robot, analysis)
    from testbench.pipeline.own_kinematics import calibrated_robot

    return checked_plan(protocol, calibrated_robot(protocol, robot, Path(kinematics)), analysis)


def checked_plan(
    protocol: str | Path, robot: Robot | str | Path | None, analysis: LoadedAnalysis
) -> Plan:
    """A plan whose recording can be analysed.

    Args:
        protocol: Its name or file.
        robot: The arm, its name or its file; the protocol's if None.
        analysis: Of what will be recorded.

    Raises:
        NotFoundError: An unknown filter or parameter.
        FileProblems: A malformed file, or parameters that a filter of the protocol does not take.
        InputError: Tunings that do not fit, or an export that the analysis cannot come to.
    """
    made = plan(protocol, robot)
    document = made.protocol.document
    settings = document.value.estimate
    for name, parameters in settings.filter_parameters.items():
        try:
            get_filter(name, parameters)
        except InputError as error:
            raise document.problem(str(error), "estimate", "filter_parameters", name) from None
    names = [kind.name for kind in analysis.choose(settings)]
    for wanted in analysis.asked.exports:
        refuse_export(wanted, names)
    return made
