"""Requests in the few words that tests need: no report is written unless a test wants one."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from testbench import execute, plan
from testbench.pipeline.request import AnalysisRequest, Request, RunRequest
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session


def analysis(*filters: str, report: bool = False, **other: Any) -> AnalysisRequest:
    """An analysis by some filters; those of the protocol if none is named."""
    return AnalysisRequest(filters=filters or None, report=report, **other)


def run_of(protocol: str | Path, report: bool = False, **run: Any) -> Request:
    """A run of a protocol, analysed as the protocol says."""
    return Request(run=RunRequest(protocol=protocol, **run), analysis=analysis(report=report))


def going_on(session: Path, **run: Any) -> Request:
    """A session's run that broke off, to go on with."""
    return Request(run=RunRequest(resume=session, **run), analysis=analysis())


@cache
def planned(protocol: str | Path) -> Plan:
    """The plan of a protocol that does not change meanwhile, made once."""
    return plan(protocol)


def recorded(protocol: str | Path, seed: int, logs: Path) -> Session:
    """A run on the simulated bench up to its recording, for tests that analyse it in their way."""
    return execute(planned(protocol), logs, seed)
