"""The stage `report`: one HTML file that works offline, rebuilt from a session, its estimate and
its evaluation.
"""

from __future__ import annotations

from pathlib import Path

from testbench.frames import NANOSECONDS
from testbench.records.disk.replacing import stored, write_text
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation, Outcome
from testbench.records.results.gait import Gait
from testbench.records.session.earlier_steps import earlier_steps
from testbench.records.session.layout import EVALUATION_SUMMARY, PRINTED, REPORT
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked
from testbench.records.specs.band import Band
from testbench.records.specs.published import load_published
from testbench.reporting.page.figures import Span
from testbench.reporting.page.page import Block, Figures, Page, Section, Sentence
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.page.render import render_page
from testbench.reporting.sections.answer import answer_blocks
from testbench.reporting.sections.apart import apart_blocks
from testbench.reporting.sections.axes import axes_section
from testbench.reporting.sections.bench import bench_scene
from testbench.reporting.sections.chain import chain_section
from testbench.reporting.sections.fit import fit_section
from testbench.reporting.sections.gait import gait_section, gait_tiles
from testbench.reporting.sections.joint import joint_section
from testbench.reporting.sections.joint_curves import curve_blocks
from testbench.reporting.sections.motion import (
    difference_section,
    joint_motion_section,
    motion_tiles,
    sensor_motion_section,
    signal_section,
    unjudged_joints,
)
from testbench.reporting.sections.normal import unused
from testbench.reporting.sections.orientation import orientation_section
from testbench.reporting.sections.provenance import provenance_section
from testbench.reporting.sections.recording import recording_section
from testbench.reporting.sections.repeats import repeats_section
from testbench.reporting.sections.run import facts, run_section, simulated_parts
from testbench.reporting.sections.three_angles import three_angle_blocks
from testbench.reporting.sections.uncertainty import uncertainty_section
from testbench.reporting.sections.verdict import verdict_section

VENDORS_FILTER = "device"
"""The orientation that a sensor computes itself; simulated sensors have an error model of it."""


@session_locked
def report(
    session: Session,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
    band: Band | None = None,
) -> Path:
    """Write report.html into the session's folder; what was printed of an earlier one goes.

    Args:
        session: The recording.
        estimate: Of its orientations; read from the session's folder if None, and left out of the
            report where the folder has none.
        evaluation: Of its errors; read from the session's folder if None, and left out of the
            report where the folder has none.
        band: Normal band to draw behind average cycles; none if None.

    Returns:
        The path of the report.

    Raises:
        SessionError: A file of the session is damaged.
        StorageError: The disk does not take it; an earlier report stays.
    """
    estimate = estimate or load_estimate(session)
    evaluation = evaluation or load_evaluation(session)
    path = session.path / REPORT
    page = render(session, estimate, evaluation, load_gait(session), band)
    with stored(path):
        write_text(path, page)
        (session.path / PRINTED).unlink(missing_ok=True)
    return path


def load_estimate(session: Session) -> Estimate | None:
    """The estimate in the session's folder, or None."""
    return Estimate.load(session.path) if Estimate.lies_in(session.path) else None


def load_evaluation(session: Session) -> Evaluation | None:
    """The evaluation in the session's folder, or None."""
    return Evaluation.load(session.path) if (session.path / EVALUATION_SUMMARY).is_file() else None


def load_gait(session: Session) -> Gait | None:
    """The gait in the session's folder, or None; one of another recording is none."""
    if not Gait.lies_in(session.path):
        return None
    found = Gait.load(session.path)
    return found if found.fingerprint == session.fingerprint else None


def render(
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    gait: Gait | None = None,
    band: Band | None = None,
) -> str:
    """The report as HTML."""
    return render_page(_page(session, estimate, evaluation, gait, band))


def whole_page(session: Session) -> Page:
    """What the report of a session shows, by what lies in its folder."""
    return _page(
        session, load_estimate(session), load_evaluation(session), load_gait(session), None
    )


def _page(
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    gait: Gait | None,
    band: Band | None,
) -> Page:
    walked = gait is not None and any(own.method for own in gait.sensors.values())
    sections = _sections(session, estimate, evaluation, walked, band)
    if band is not None and (lacking := unused(band, sections)) is not None:
        sections[0].blocks.insert(0, lacking)
    if gait is not None:
        sections.insert(2, gait_section(gait))
    protocol, earlier = session.manifest.protocol, earlier_steps(session)
    answer: list[Block] = []
    if evaluation is not None and evaluation.judged:
        answer = answer_blocks(
            evaluation, shown_colours(session, evaluation), section_spans(session)
        )
    elif evaluation is not None:
        answer = _first_figure(sections)
    return Page(
        title=protocol.name or session.name,
        purpose=protocol.purpose or "",
        outcome=(evaluation.outcome if evaluation else Outcome.NOT_MEASURED).value,
        verdict=evaluation.verdict if evaluation else ("gait" if walked else "not evaluated"),
        simulated=simulated_parts(session),
        modelled_filter=VENDORS_FILTER
        if VENDORS_FILTER in _filters_of(estimate, evaluation)
        else "",
        partial="" if earlier is None else f"This session {earlier.sentence}.",
        facts=facts(session),
        tiles=[
            *([] if evaluation is None else motion_tiles(evaluation)),
            *gait_tiles(gait),
        ],
        sections=sections,
        answer=answer,
        scene=bench_scene(session) if evaluation is not None and evaluation.judged else None,
    )


def _first_figure(sections: list[Section]) -> list[Block]:
    """The first figure that begins to be seen, taken out of its section."""
    for section in sections:
        for block in section.blocks:
            if isinstance(block, Figures) and not block.folded:
                section.blocks.remove(block)
                return [block]
    return []


def _filters_of(estimate: Estimate | None, evaluation: Evaluation | None) -> set[str]:
    """Filters that the page speaks of."""
    names = (
        {name for sensor in estimate.sensors.values() for name in sensor.orientation}
        if estimate
        else set()
    )
    if evaluation is None:
        return names
    return (
        names
        | {row.filter for row in evaluation.orientation}
        | {row.filter for row in evaluation.joint_angle}
    )


def _sections(
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    walked: bool,
    band: Band | None,
) -> list[Section]:
    spans = section_spans(session)
    described = _described_sections(session, estimate, evaluation, spans, band)
    judged = evaluation is None or evaluation.judged
    sections = [verdict_section(evaluation, walked), *([] if judged else described)]
    sections.append(run_section(session, evaluation))
    chain = chain_section(estimate, evaluation, spans, band) if estimate is not None else None
    of_chain = [chain] if chain is not None else []
    if evaluation is not None and judged:
        sections += _judged_sections(session, estimate, evaluation, spans, of_chain, band)
        sections += described
    else:
        sections += of_chain
    if estimate is not None:
        sections += [fit_section(estimate), recording_section(estimate, evaluation)]
        axes = axes_section(estimate, evaluation)
        sections += [axes] if axes is not None else []
    else:
        sections.append(
            Section(
                "fits",
                "Clocks, frames and calibration",
                [Sentence("Nothing has been estimated from this session.")],
            )
        )
    return [*sections, provenance_section(session)]


def shown_colours(session: Session, evaluation: Evaluation) -> dict[str, str]:
    """Of the filters that were held against a truth."""
    names = [row.filter for row in evaluation.orientation] + [
        row.filter for row in evaluation.joint_angle
    ]
    asked = [name for name in session.analysis.estimate.filters if name in names]
    return filter_colours(asked + names)


def _judged_sections(
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation,
    spans: list[Span],
    of_chain: list[Section],
    band: Band | None,
) -> list[Section]:
    """What was held against a truth."""
    colours = shown_colours(session, evaluation)
    sections = []
    if session.analysis.joints and set(session.analysis.joints) - set(unjudged_joints(evaluation)):
        published = {
            name: load_published(joint.published) if joint.published else None
            for name, joint in session.analysis.joints.items()
        }
        joints = joint_section(evaluation, published, colours, spans, band)
        known = curve_blocks(session, estimate, colours, spans) if estimate is not None else {}
        judged = dict.fromkeys(row.joint for row in evaluation.joint_angle)
        if estimate is not None:
            known |= three_angle_blocks(session, estimate, evaluation, colours, spans)
        for name in judged:
            joints.blocks += known.get(name, [])
        sections.append(joints)
    repeats = repeats_section(evaluation, colours)
    orientation = orientation_section(evaluation, colours, spans)
    if estimate is not None:
        orientation.blocks += apart_blocks(estimate, evaluation, colours, spans)
    return [
        *([] if repeats is None else [repeats]),
        *sections,
        *of_chain,
        orientation,
        uncertainty_section(evaluation, session),
    ]


def _described_sections(
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    spans: list[Span],
    band: Band | None,
) -> list[Section]:
    """What no truth is needed for, of sensors and joints that were not judged."""
    if estimate is None or evaluation is None:
        return []
    names = [key for sensor in estimate.sensors.values() for key in sensor.orientation]
    colours = filter_colours(names)
    found = [
        joint_motion_section(
            evaluation, colours, spans, curve_blocks(session, estimate, colours, spans), band
        ),
        sensor_motion_section(estimate, evaluation, colours, spans),
        difference_section(evaluation, colours, spans),
        signal_section(session, estimate, evaluation, spans),
    ]
    return [section for section in found if section is not None]


def section_spans(session: Session) -> list[Span]:
    """When each section of the protocol began and ended [s]."""
    spans = []
    for name in dict.fromkeys(step.section for step in session.steps):
        steps = [step for step in session.steps if step.section == name]
        spans.append(Span(name, steps[0].start_ns / NANOSECONDS, steps[-1].end_ns / NANOSECONDS))
    return spans
