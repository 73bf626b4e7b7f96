"""How a run was to be analysed, kept with its session for whoever goes on with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from testbench.exceptions import SessionError
from testbench.pipeline.request import AnalysisRequest, ExportRequest
from testbench.records.disk.json_record import first_problem
from testbench.records.session.layout import MANIFEST
from testbench.records.session.session import Session

CHOICES = (
    "filters",
    "parameters",
    "calibrations",
    "tunings",
    "compare",
    "euler_sequence",
    "returned",
)
"""What decides the numbers; who names any of these when going on has all of them anew."""


def kept_analysis(asked: AnalysisRequest) -> dict[str, Any]:
    """What of a request differs from the default, as JSON; files by their whole paths, for a run
    may be gone on with from another folder.
    """
    calibrations = None if asked.calibrations is None else _whole(asked.calibrations)
    whole = asked.model_copy(
        update={
            "filters": None if asked.filters is None else tuple(map(_whole_class, asked.filters)),
            "calibrations": calibrations,
            "tunings": tuple(map(_whole, asked.tunings)),
            "exports": tuple(map(_whole_export, asked.exports)),
            "repeats": None if asked.repeats is None else _whole(asked.repeats),
            "band": None if asked.band is None else _whole_file(asked.band),
            "markdown": None,  # they are of the command that asks for them
            "junit": None,
        }
    )
    return whole.model_dump(mode="json", exclude_defaults=True)


def analysis_to_go_on(session: Session, asked: AnalysisRequest) -> AnalysisRequest:
    """How a run that goes on is analysed: as it was to be when it began, unless something else is
    asked for now.

    Args:
        session: Whose run broke off.
        asked: Now. Filters, parameters, calibrations and tunings are one choice; a report that
            either of the two does without is not written.

    Raises:
        SessionError: What the manifest says of it is damaged, or would run code or write elsewhere
            unless a person says so again.
    """
    try:
        kept = AnalysisRequest.model_validate_json(json.dumps(session.manifest.analysis_request))
    except ValidationError as error:
        raise SessionError(
            f"{session.path / MANIFEST}: the analysis_request is damaged: {first_problem(error)}"
        ) from None
    default = AnalysisRequest()
    chosen = any(getattr(asked, name) != getattr(default, name) for name in CHOICES)
    choice = {name: getattr(asked if chosen else kept, name) for name in CHOICES}
    if not chosen:
        named = [*(kept.filters or ()), kept.compare or ""]
        _refuse_outside(session, [name for name in named if _is_code(name)], "filter")
    if not asked.exports:
        _refuse_outside(session, [own.out for own in kept.exports if own.out], "export to")
        named = [own.filter or "" for own in kept.exports]
        _refuse_outside(session, [name for name in named if _is_code(name)], "export by filter")
    return AnalysisRequest(
        **choice,
        repeats=asked.repeats or kept.repeats,
        report=asked.report and kept.report,
        printed=asked.printed or kept.printed,
        band=asked.band or kept.band,
        markdown=asked.markdown,
        junit=asked.junit,
        exports=asked.exports or kept.exports,
    )


def _refuse_outside(session: Session, named: list[str], what: str) -> None:
    """Refuse to run or write what only a manifest names, which may be anybody's."""
    if named:
        raise SessionError(
            f"{session.path}: its manifest names the {what} {', '.join(named)}, outside of the "
            "session; name it again, and it is taken"
        )


def _is_code(name: str) -> bool:
    """Whether a filter is a class in a file."""
    return name.rpartition(":")[0].endswith(".py")


def _whole(path: str) -> str:
    return str(Path(path).absolute())


def _whole_file(name: str) -> str:
    """A file by its whole path; the name of what ships as it is."""
    return _whole(name) if Path(name).is_file() else name


def _whole_class(name: str) -> str:
    """A filter's name; of a class in a file, `path/to/file.py:ClassName`, with the whole path."""
    file, colon, kind = name.rpartition(":")
    return f"{_whole(file)}{colon}{kind}" if _is_code(name) else name


def _whole_export(asked: ExportRequest) -> ExportRequest:
    return asked.model_copy(
        update={
            "out": None if asked.out is None else _whole(asked.out),
            "filter": None if asked.filter is None else _whole_class(asked.filter),
        }
    )
