"""Summaries for people's pull requests and for build servers, where they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from testbench.exceptions import InputError
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.session_comparison import SessionComparison
from testbench.records.session.session import Session


def refuse_no_folder(*targets: Path | str | None) -> None:
    """Refuse files whose folder is not there, before anything is done for them.

    Raises:
        InputError: Names the first of them.
    """
    for target in targets:
        if target is not None and not Path(target).parent.is_dir():
            raise InputError(
                f"{target} cannot be written: there is no folder {Path(target).parent}"
            )


def write_summaries(
    found: SessionComparison | tuple[Session, Evaluation],
    markdown: Path | str | None,
    junit: Path | str | None,
) -> list[Path]:
    """Write what is asked for, in place of an earlier file of the same name.

    Args:
        found: A comparison, or a session with its evaluation.
        markdown: File for Markdown, or None.
        junit: File for JUnit XML, or None.

    Returns:
        The files that were written.

    Raises:
        StorageError: The disk does not take one.
    """
    if markdown is None and junit is None:
        return []
    from testbench.reporting.summaries.junit import junit_text
    from testbench.reporting.summaries.markdown import markdown_text
    from testbench.reporting.summaries.of_comparison import comparison_summary
    from testbench.reporting.summaries.of_session import session_summary
    from testbench.reporting.summaries.summary import Summary

    if isinstance(found, SessionComparison):
        summary = comparison_summary(found)
    else:
        summary = session_summary(*found)
    kinds: list[tuple[Path | str | None, Callable[[Summary], str]]] = [
        (markdown, markdown_text),
        (junit, junit_text),
    ]
    written = []
    for target, text in kinds:
        if target is not None:
            with stored_where_asked(Path(target)):
                write_text(Path(target), text(summary))
            written.append(Path(target))
    return written
