"""What the study `reference-5` says; every figure comes from the runs, every verdict from their
spread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.model.statistics.spread import LEVEL, Change, by_verdict, in_percent

QUESTION = (
    "How well do the joints of a chain follow from the sensors on its links, what does a Fourier "
    "state gain, and what is left of both where the motion is not made of that state's harmonics "
    "and the sensors do not sit where they are taken to?"
)
RIGS = {"4.1": "Pendulum", "4.2": "Squat of two joints"}
MOST_NAMED = 4
"""Joints that a sentence names; the table has all."""

OVER_RUNS, OVER_PARTS = "standard deviation over the runs", "standard deviation over the parts"
INTERVAL = "interval of 95 % in columns of its own"
ONE_RUN = "of one run, without a spread"
SERVO_OTHER = "rigs, motions and units are not stated"
SERVO_HOW = (
    "How to read: RMS against the joints of the arm, mean over the runs, each with other sensors "
    "of one kind; ours over {runs}, the filter of the text over {parts}. Covered are the errors "
    "of the angle within 1.96 of the uncertainty that the filter states. The published figures "
    "stand beside the printed filter alone."
)
SERVO_WHY = (
    "By the text: Q = I, R = 1000 I, no sensor errors, all states 0.1 at the start. Ours has the "
    "sensors' noise, biases, clocks and scales, and process noise that the readings make most "
    "likely. Sizes are not compared with the published ones: table 4.1 gives degrees for all "
    "three columns and table 4.2 no unit, dimensions and motions of the rigs are not stated, and "
    "the formula printed for the RMS divides by the number of samples outside the root."
)

STATES_CAPTION = "Error by the Fourier state against that by the kinematic one, motion by motion"
STATES_HOW = (
    "How to read: geometric mean over the runs of the ratio of both errors, as a change, with its "
    "interval of 95 % by Student's t, each for itself. More or less is shown where the interval "
    "leaves zero out; a single run has no interval. Within: the motion is made of harmonics of "
    "one frequency, as the state is."
)
STATES_WHY = (
    "A motion within the state's own model tells of the model, not of the state: there the "
    "Fourier state has what the motion was made from. The published figures are of such motions, "
    "of one run each, without a spread; they stand beside the rows of these."
)
ORDER_CAPTION = "Error of the distal joint of the squat (q2) against that of the proximal one (q1)"
ORDER_HOW = (
    "How to read: as above, the distal joint's error over the proximal one's, of the same runs."
)
ORDER_WHY = (
    "The thesis finds the distal joint worse in everything and lays it to errors that add up "
    "along the chain. Ours has both sensors in one filter, and in each run both have errors of "
    "their own."
)
GAIT_HOW = (
    "How to read: over {parts}; the mean of each part's signed mean, the mean magnitude, the RMS, "
    "and of the errors of all parts the mean of the medians, the largest and the smallest by "
    "magnitude, and the mean relative error where the angle exceeds 1 deg. X, Y and Z are the "
    "axes of the source: adduction or inversion, rotation, flexion. Sensors as stated: exactly "
    "where the filter takes them to be. Off: 3 deg and 10 mm, segments 3 % (one standard "
    "deviation an axis)."
)
GAIT_WHY = (
    "The published row is of a person with sensors on skin against another measurement system, of "
    "the trial of five that fitted best; largest and smallest are its table 4.4. Ours is a chain "
    "of rigid bodies against its own joints: soft tissue and heel strike are not in it, wrong "
    "placement is in the rows that say so. No ratio is formed between them. The published means "
    "are signed; that of their magnitudes is {mean:.3f} deg."
)
PLACED_CAPTION = "The walk: RMS over the seven axes of the leg, by motion, placement and filter"
PLACED_HOW = (
    "How to read: RMS of the angles [deg], mean over {parts} with their range. Lost: runs of "
    "which the filter says by itself that its joints may be off by degrees. Usual way: each "
    "sensor's orientation by vqf_6d, aligned in the pose before the walk, and the angles between "
    "two segments."
)
PLACED_WHY = (
    "Gait that varies is drawn anew for each part: four strides to a period, 2.7 % of the swing "
    "from stride to stride. Fitted is what the readings tell of placement and lengths."
)
HARMONICS_CAPTION = "Number of harmonics: RMS over the seven axes of the leg"
HARMONICS_HOW = (
    "How to read: first part. By the filter: our Fourier state with so many harmonics, sensors as "
    "stated. Series alone: what a series of so many harmonics of the stride frequency leaves of "
    "the true angles, without any sensor, as the source's figures 3.2 to 3.4 have it."
)
HARMONICS_WHY = (
    "The source chose four by a signal that is made of its first and fourth harmonic, where no "
    "other answer can come out. Where each stride is like the other ours is made of four as well. "
    "Where strides vary more harmonics of the stride frequency cannot take up what lies between "
    "them."
)
WALK_HOW = (
    "How to read: over {parts}. Covered are the errors within 1.96 of the standard uncertainty "
    "that the filter states: 95 is honest, below {least:g} a joint is called too sure of itself. "
    "An error that stays the same is covered in whole or not at all, so that few parts say "
    "little."
)
WALK_WHY = (
    "The first joints carry the pelvis about, the next turn it: the legs follow from the sensors "
    "on either side of a joint, the pelvis from gravity and its own sensor alone."
)
BOXES = "Errors of the seven axes, as figure 4.37"
BOXES_HOW = (
    "How to read: quartiles, whiskers to 1.5 interquartile ranges; gait that varies, first part, "
    "by our filters. The source's figure has no numbers in its text."
)
ANGLES_HOW = "How to read: first part, by our two states, against the arm's joint."
SIGNALS_HOW = (
    "How to read: first part; what the sensor read, and what it would read without errors of its "
    "own in the motion that the filter found."
)


def counted(parts: int) -> str:
    """One part, five parts."""
    return "one part" if parts == 1 else f"{parts} parts"


def run_times(runs: int) -> str:
    """One run, five runs."""
    return "one run" if runs == 1 else f"{runs} runs"


def states_judged(motion: str, changes: Mapping[str, Change], runs: int) -> str:
    """What is shown of the two states on one motion.

    Args:
        motion: Its name.
        changes: Of the Fourier state against the kinematic one, by what is compared.
        runs: Over how many.
    """
    if runs == 1:
        return f"{motion}: one run does not show which of both states errs by how much."
    return f"{motion}: {_verdicts(changes)} (Fourier against kinematic, {run_times(runs)})."


def order_judged(changes: Mapping[str, Change], runs: int) -> str:
    """What is shown of the two joints of the squat.

    Args:
        changes: Of the distal joint's error against the proximal one's, by what is compared.
        runs: Over how many.
    """
    end = f"The thesis has more in all {len(changes)}."
    if runs == 1:
        return "One run does not show which joint of the squat errs by how much."
    told = _verdicts(changes)
    return f"Distal against proximal joint of the squat, {run_times(runs)}: {told}. {end}"


def _verdicts(changes: Mapping[str, Change]) -> str:
    found = by_verdict(changes)
    said = []
    for word in ("less", "more"):
        names = [f"{name} ({in_percent(changes[name].percent)})" for name in found.get(word, [])]
        if names:
            said.append(f"{word} error in {', '.join(names)}")
    if "not shown" in found:
        names = [f"{name} ({_interval(changes[name])})" for name in found["not shown"]]
        said.append(f"neither shown in {', '.join(names)}")
    return f"by intervals of {100 * LEVEL:g} %, " + "; ".join(said)


def _interval(change: Change) -> str:
    interval = change.interval
    assert interval is not None  # there are several runs
    return f"{in_percent(interval[0])} to {in_percent(interval[1])}"


def walked(name: str, values: Sequence[float]) -> str:
    """RMS of the seven axes of the leg, with its spread.

    Args:
        name: Of motion, placement and filter.
        values: By part [deg].
    """
    return f"{name}: {spread(values)} deg"


def spread(values: Sequence[float]) -> str:
    """Lowest and highest, or the one value."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def covered(state: str, lost: Mapping[str, tuple[float, float]], count: int, least: float) -> str:
    """Which joints a state is too sure of: RMS [deg] and errors covered [%] by name, the largest
    error first.
    """
    if not lost:
        return (
            f"By the {state} state the stated uncertainty covers at least {least:g} % of the "
            f"errors of each of {count} joints and motions."
        )
    worst = sorted(lost.items(), key=lambda item: -item[1][0])
    named = ", ".join(
        f"{name}: RMS {rms:.2f} deg, {percent:.0f} % covered"
        for name, (rms, percent) in worst[:MOST_NAMED]
    )
    more = f"; and {len(lost) - MOST_NAMED} more" if len(lost) > MOST_NAMED else ""
    return (
        f"By the {state} state {len(lost)} of {count} joints and motions are covered below "
        f"{least:g} % by the uncertainty that it states ({named}{more})."
    )
