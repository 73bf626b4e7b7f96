"""The figures of a report as objects of plotly, for a notebook or a program of one's own.

    from testbench import plot

    plot.error("logs/20261121T223000Z_quick").show()

Each takes a session, or its folder, that was evaluated. They are the figures of report.html: what
is drawn, and how to read it, is said there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from testbench.exceptions import InputError, NotFoundError
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from testbench.reporting.page.figures import as_plotly
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.scene import turnable
from testbench.reporting.report import load_evaluation, section_spans, shown_colours, whole_page
from testbench.reporting.sections.allan import allan_blocks
from testbench.reporting.sections.answer import beside, over_time
from testbench.reporting.sections.bench import bench_scene
from testbench.reporting.sections.spread import heading_spread, joint_spread
from testbench.reporting.sections.uncertainty import budget_bars

Figure = Any
"""A `plotly.graph_objects.Figure`, which is imported where one is made."""
Of = Session | str | Path
"""A session, or its folder."""


def bench(session: Of) -> Figure:
    """The arm in its reference pose, and the sensors with their axes.

    Raises:
        InputError: The session has no arm that could be drawn.
    """
    scene = bench_scene(_session(session))
    if scene is None:
        raise InputError("there is nothing to draw: the session has no arm, or its meshes are gone")
    return as_plotly(turnable(scene))


def error(session: Of) -> Figure:
    """True and estimated flexion over the whole run with the errors below; of a session without
    joints the errors of the first sensor's orientation.

    Raises:
        InputError: Nothing was evaluated against a truth.
    """
    opened, evaluation = _evaluated(session)
    drawn = over_time(evaluation, shown_colours(opened, evaluation), section_spans(opened))
    if drawn is None:
        raise InputError("nothing of this session was evaluated against a truth")
    return next(iter(_drawn([drawn]).values()))


def ranking(session: Of) -> dict[str, Figure]:
    """The mean error of each filter with its interval, by what it is the error of."""
    opened, evaluation = _evaluated(session)
    drawn = beside(evaluation, shown_colours(opened, evaluation))
    return {} if drawn is None else _drawn([drawn])


def spread(session: Of, owner: str) -> dict[str, Figure]:
    """Histograms and box plots of the errors.

    Args:
        session: Or its folder.
        owner: A joint, whose flexion errors they are, or a sensor, whose heading errors.

    Raises:
        NotFoundError: No such joint or sensor was evaluated; lists those that were.
    """
    opened, evaluation = _evaluated(session)
    joints = dict.fromkeys(row.joint for row in evaluation.joint_angle)
    sensors = dict.fromkeys(row.sensor for row in evaluation.orientation)
    if owner not in joints and owner not in sensors:
        raise NotFoundError("evaluated joint or sensor", owner, [*joints, *sensors])
    blocks = joint_spread if owner in joints else heading_spread
    return _drawn(blocks(evaluation, owner, shown_colours(opened, evaluation)))


def allan(session: Of) -> dict[str, Figure]:
    """Allan deviations at rest, by quantity and sensor; none where no rest was long enough."""
    return _drawn(allan_blocks(_evaluated(session)[1]))


def budget(session: Of) -> dict[str, Figure]:
    """What the uncertainty of the truth is made of, by what it is the error of."""
    budgets = _evaluated(session)[1].uncertainty
    quantities = dict.fromkeys(own.quantity for own in budgets)
    return _drawn(
        [
            block
            for quantity in quantities
            for block in budget_bars(quantity, [own for own in budgets if own.quantity == quantity])
        ]
    )


def every(session: Of) -> dict[str, Figure]:
    """Every figure of the report, by the words that it is called there."""
    page = whole_page(_session(session))
    blocks = [*page.answer, *(block for section in page.sections for block in section.blocks)]
    return _drawn(blocks)


def _session(session: Of) -> Session:
    return session if isinstance(session, Session) else Session(session)


def _evaluated(session: Of) -> tuple[Session, Evaluation]:
    opened = _session(session)
    evaluation = load_evaluation(opened)
    if evaluation is None:
        raise InputError(f"{opened.path} was not evaluated: run `testbench evaluate` first")
    return opened, evaluation


def _drawn(blocks: list[Block]) -> dict[str, Figure]:
    return {
        words: as_plotly(figure)
        for block in blocks
        if isinstance(block, Figures)
        for words, figure in block.figures.items()
    }
