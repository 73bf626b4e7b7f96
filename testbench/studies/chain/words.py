"""What the study `reference-5` says; every figure comes from the runs, every verdict from their
spread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from testbench.model.statistics.spread import LEVEL, Change, by_verdict, in_percent

QUESTION = (
    "How well do the joints of a chain follow from the sensors on its links, and what does a "
    "Fourier state gain?"
)
RIGS = {"4.1": "Pendulum", "4.2": "Squat of two joints"}
MOST_NAMED = 4
"""Joints that a sentence names; the table has all."""


@dataclass(frozen=True)
class Question:
    """Something that the thesis found of all its pairs of errors.

    Attributes:
        caption: Of its table.
        short: The table's name where there is little room.
        why: The sentence below the table.
        less: The sentence's beginning for pairs of which the first has less error.
        more: The sentence's beginning for pairs of which the first has more error.
        published: Which of both the thesis has.
    """

    caption: str
    short: str
    why: str
    less: str
    more: str
    published: str


STATES = Question(
    "Error by the Fourier state against that by the kinematic one",
    "Fourier or kinematic",
    "The thesis prints one run of each rig without a spread. Both of our states see the same "
    "samples, so that what a sensor is wrong by is in both.",
    "the Fourier state has less error than the kinematic one",
    "the Fourier state has more error than the kinematic one",
    "less",
)
ORDER = Question(
    "Error of the distal joint of the squat (q2) against that of the proximal one (q1)",
    "Distal or proximal",
    "The thesis finds the distal joint worse in everything and lays it to errors that add up along "
    "the chain. Ours has both sensors in one filter, and in each part both have errors of their "
    "own.",
    "the distal joint of the squat has less error than the proximal one",
    "the distal joint of the squat has more error than the proximal one",
    "more",
)
CHANGE_HOW = (
    "How to read: geometric mean over {parts} of the ratio of both errors, as a change, with its "
    "interval of 95 % by Student's t, each for itself. More or less is shown where the interval "
    "leaves zero out; a single run has no interval."
)
GAIT_HOW = (
    "How to read: over {parts}, the mean of each part's signed mean and the lowest and highest, "
    "the mean magnitude, and the RMS. The publication gives signed means alone, in which errors of "
    "either sign cancel. X, Y and Z are its axes. Its rows stand beside the Fourier state, which "
    "it describes for the walk; its tables do not name the state."
)
GAIT_WHY = (
    "A person walked there, with sensors on skin, and the joint angles were compared with those of "
    "another measurement system; the best of five trials is shown. Ours is a chain of rigid bodies "
    "that moves by published gait curves and is compared with its own joints: what soft tissue and "
    "heel strike do is not in it."
)
WALK_HOW = (
    "How to read: over {parts}. Covered are the errors within 1.96 of the standard uncertainty "
    "that the filter states: 95 is honest, below {least:g} a joint is called too sure of itself. "
    "An error that stays the same is covered in whole or not at all, so that few parts say little."
)
WALK_WHY = (
    "The first joints carry the pelvis about, the next turn it: the legs follow from the sensors "
    "on either side of a joint, the pelvis from gravity and its own sensor alone."
)


def counted(parts: int) -> str:
    """One part, five parts."""
    return "one part" if parts == 1 else f"{parts} parts"


def run_times(runs: int) -> str:
    """One run, five runs."""
    return "one run" if runs == 1 else f"{runs} runs"


def judged(question: Question, changes: Mapping[str, Change], runs: int) -> str:
    """What is shown of a question, what is not, and what the thesis has."""
    end = f"The thesis has {question.published} in all {len(changes)}."
    if runs == 1:
        signs = {
            "less": [n for n, c in changes.items() if c.percent < 0],
            "more": [n for n, c in changes.items() if c.percent >= 0],
        }
        told = "; ".join(f"{word} in {', '.join(names)}" for word, names in signs.items() if names)
        which = question.less.replace(" has less error than ", " against ")
        return (
            f"One run shows nothing of {which}: here its error is {told}; another sensor may turn "
            f"that about. {end}"
        )
    found = by_verdict(changes)
    said = []
    for word, clause in (("less", question.less), ("more", question.more)):
        if word in found:
            names = [f"{name} ({in_percent(changes[name].percent)})" for name in found[word]]
            said.append(f"{clause} in {', '.join(names)}")
    if "not shown" in found:
        names = [f"{name} ({_interval(changes[name])})" for name in found["not shown"]]
        said.append(f"neither is shown in {', '.join(names)}")
    text = "; ".join(said)
    return f"Over {run_times(runs)} of each rig, by intervals of {100 * LEVEL:g} %: {text}. {end}"


def _interval(change: Change) -> str:
    interval = change.interval
    assert interval is not None  # there are several runs
    return f"{in_percent(interval[0])} to {in_percent(interval[1])}"


def walked(state: str, means: Sequence[float], rms: Sequence[float], published: float) -> str:
    """Errors of the seven axes of the leg by one state, with their spread."""
    return (
        f"Walking, by the {state} state: the seven axes of the leg have signed means of "
        f"{_spread(means)} deg in magnitude (published {published:.3f}, of the best of five trials "
        f"of a person) and an RMS of {_spread(rms)} deg{_of(len(means))}."
    )


def _spread(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3f}", f"{max(values):.3f}"
    return low if low == high else f"{low} to {high}"


def _of(parts: int) -> str:
    return ", of one part" if parts == 1 else f", by part ({parts})"


def covered(state: str, lost: Mapping[str, tuple[float, float]], count: int, least: float) -> str:
    """Which joints a state is too sure of: RMS [deg] and errors covered [%] by name, the largest
    error first.
    """
    if not lost:
        return (
            f"By the {state} state the stated uncertainty covers at least {least:g} % of the "
            f"errors of each of {count} joints."
        )
    worst = sorted(lost.items(), key=lambda item: -item[1][0])
    named = ", ".join(
        f"{name}: RMS {rms:.2f} deg, {percent:.1f} % covered"
        for name, (rms, percent) in worst[:MOST_NAMED]
    )
    more = f"; and {len(lost) - MOST_NAMED} more" if len(lost) > MOST_NAMED else ""
    return (
        f"By the {state} state {len(lost)} of {count} joints are covered below {least:g} % by the "
        f"uncertainty that it states ({named}{more})."
    )


def sizes(ratios: Sequence[Sequence[float]]) -> str:
    """Why the sizes of tables 4.1 and 4.2 are not compared: ours over theirs of angles, rates and
    accelerations.
    """
    apart = max(min(values) for values in ratios) > min(max(values) for values in ratios)
    spans = [f"{_short(min(values))} to {_short(max(values))}" for values in ratios]
    root = (
        " The printed formula divides by the number of samples outside the root, but that shrinks "
        "all three columns alike, so that it alone does not make the difference."
    )
    return (
        "Sizes are not compared: table 4.1 gives degrees for all three columns and table 4.2 no "
        f"unit, dimensions and motions of their rigs are not stated, and ours are {spans[0]} times "
        f"theirs in the angles, {spans[1]} in the rates and {spans[2]} in the "
        f"accelerations.{root if apart else ''} What can be compared is the order, in the tables "
        "below."
    )


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
