"""The study `reference-5`: tables 4.1 to 4.4 of Quijano & Valencia 2018 beside ours, as a
record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.model.statistics.spread import Change
from testbench.records.results.study import StudyRecord, StudyRow, StudyTable, Value
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published_chain import PublishedChain, load_published_chain
from testbench.studies.bench import StudyBench
from testbench.studies.chain import words
from testbench.studies.chain.comparison import (
    AXES,
    EXACT,
    FITTED,
    FOURIER,
    HARMONICS,
    KINDS,
    KINEMATIC,
    OFF,
    PRINTED,
    QUANTITIES,
    RIGS_A_PART,
    USUAL,
    JointErrors,
    Moved,
    Reference5,
    reference_5,
)
from testbench.studies.chain.figures import boxes, figures
from testbench.studies.chain.motions import PENDULUM, SQUAT, VARIED
from testbench.studies.chain.own import own_study

LEAST_COVERED_PERCENT = 80.0
"""A state whose standard uncertainty covers less of its errors (95 of a hundred would be honest) is
too sure of itself.
"""


def run(bench: StudyBench) -> StudyRecord:
    """Run all motions with every part and put the errors beside the published ones; or ask the
    user's own protocol or recording.
    """
    if bench.own:
        return own_study(bench)
    started = bench.now()
    found, published = reference_5(bench), load_published_chain()
    return StudyRecord(
        "reference-5",
        "A Kalman filter over a kinematic chain",
        words.QUESTION,
        published.source,
        started,
        {
            "seed": bench.seed,
            "parts": bench.parts,
            "runs of a rig": bench.parts * RIGS_A_PART,
            "motions": ", ".join([*found.rigs, *found.walks]),
        },
        tuple(str(path) for path in found.sessions),
        findings(found),
        tables(found, published),
        (boxes(found),),
        software_versions(),
        figures(found),
    )


def tables(found: Reference5, published: PublishedChain) -> tuple[StudyTable, ...]:
    """All tables of the study.

    Args:
        found: What was measured.
        published: What was printed.
    """
    return (
        *(servo_table(found, published, table) for table in ("4.1", "4.2")),
        states_table(found, published),
        order_table(found, published),
        gait_table(found, published),
        placed_table(found),
        harmonics_table(found),
        walk_table(found),
    )


def fourier_changes(own: Moved) -> dict[str, Change]:
    """Error by the Fourier state against that by the kinematic one, of each joint and quantity; of
    a walk, of each axis's angle.
    """
    if own.motion.protocol == "gait":
        return {
            "the seven axes": Change.of(
                own.seven("rmse_deg", FOURIER), own.seven("rmse_deg", KINEMATIC)
            )
        }
    return {
        f"{quantity} of {joint}": own.change(joint, kind)
        for joint in own.joints
        for quantity, kind in zip(QUANTITIES, KINDS, strict=True)
    }


def distal_changes(found: Reference5) -> dict[str, Change]:
    """Error of the second joint of the squat against that of the first, of each quantity and
    state.
    """
    own = found.rigs[SQUAT.name]
    first, second = own.joints
    return {
        f"{quantity} by the {state} state": Change.of(
            own.errors[second, state].values(kind), own.errors[first, state].values(kind)
        )
        for state in (KINEMATIC, FOURIER)
        for quantity, kind in zip(QUANTITIES, KINDS, strict=True)
    }


def uncovered(found: Reference5) -> dict[tuple[str, str, str], JointErrors]:
    """Joints whose stated uncertainty covers too few of the errors of all runs, by motion, joint
    and state; sensors where they are stated to be, or fitted.
    """
    sound = [*found.rigs.items(), *found.walks.items(), (FITTED, found.placed[FITTED])]
    return {
        (name, joint, state): errors
        for name, own in sound
        for (joint, state), errors in own.errors.items()
        if state in (KINEMATIC, FOURIER) and errors.mean("covered_percent") < LEAST_COVERED_PERCENT
    }


def findings(found: Reference5) -> tuple[str, ...]:
    """The answer in sentences, each no wider than its spread."""
    sentences = []
    for name, own in (*found.rigs.items(), *found.walks.items()):
        changes = fourier_changes(own)
        runs = len(next(iter(changes.values())).ratios)
        where = "" if own.motion.within else ", which is not made of the state's harmonics"
        sentences.append(words.states_judged(f"{name}{where}", changes, runs))
    order = distal_changes(found)
    sentences.append(words.order_judged(order, len(next(iter(order.values())).ratios)))
    told = [
        words.walked(f"{label}, {state}", own.seven("rmse_deg", state))
        for label, own in _walks(found).items()
        for state in (KINEMATIC, FOURIER)
    ]
    told += [words.walked(f"{USUAL}, {label}", values) for label, values in found.usual.items()]
    sentences.append(f"Walking, RMS over the seven axes of the leg, by part: {'; '.join(told)}.")
    lost = uncovered(found)
    for state in (KINEMATIC, FOURIER):
        own_lost = {
            f"{joint} ({name})": (errors.rms("rmse_deg"), errors.mean("covered_percent"))
            for (name, joint, key), errors in lost.items()
            if key == state
        }
        count = sum(
            len(own.joints)
            for own in (*found.rigs.values(), *found.walks.values(), found.placed[FITTED])
        )
        sentences.append(words.covered(state, own_lost, count, LEAST_COVERED_PERCENT))
    return tuple(sentences)


def _walks(found: Reference5) -> dict[str, Moved]:
    """Every walk by motion and placement."""
    own = {f"{name}, sensors {EXACT}": one for name, one in found.walks.items()}
    return own | {f"{VARIED.name}, sensors {key}": one for key, one in found.placed.items()}


def _runs_of(own: Moved, filter_name: str) -> int:
    return len(own.errors[own.joints[0], filter_name].rows)


def servo_table(found: Reference5, published: PublishedChain, table: str) -> StudyTable:
    """Tables 4.1 and 4.2 of the motions that lie within the Fourier state's model.

    Args:
        found: What was measured.
        published: What was printed.
        table: Number.
    """
    own = found.rigs[PENDULUM.name if table == "4.1" else SQUAT.name]
    theirs = next(entry for entry in published.servo_rms if entry.table == table)
    rows = []
    for i, joint in enumerate(own.joints):
        for state in (KINEMATIC, FOURIER):
            for name in (state, PRINTED[state]):
                errors, is_printed = own.errors[joint, name], name == PRINTED[state]
                kinds = (*KINDS, "covered_percent")
                numbers = theirs.states[state][i]  # type: ignore[index]
                rows.append(
                    StudyRow(
                        f"{theirs.joints[i]}, {state}",
                        tuple(errors.mean(kind) for kind in kinds),
                        (*numbers, None) if is_printed else (),
                        "" if is_printed else _too_sure(errors),
                        spread=tuple(errors.sd(kind) for kind in kinds),
                        settings="published" if is_printed else "ours",
                        printed="text" if is_printed else "",
                        other=words.SERVO_OTHER if is_printed else "",
                    )
                )
    return StudyTable(
        f"table_{table.replace('.', '_')}",
        f"{words.RIGS[table]}: RMS errors, {own.motion.name}",
        ("angle [deg]", "rate [deg/s]", "acceleration [deg/s²]", "covered [%]"),
        tuple(rows),
        words.SERVO_HOW.format(
            runs=words.run_times(_runs_of(own, KINEMATIC)),
            parts=words.run_times(_runs_of(own, PRINTED[KINEMATIC])),
        ),
        words.SERVO_WHY,
        table,
        (4, 3, 2, 0),
        spread=words.OVER_RUNS,
    )


def _too_sure(errors: JointErrors) -> str:
    return "too sure of itself" if errors.mean("covered_percent") < LEAST_COVERED_PERCENT else ""


# Longer than a screen: rigs have joints and quantities, walks one figure of seven axes.
def states_table(found: Reference5, published: PublishedChain) -> StudyTable:
    """The two states side by side on every motion.

    Args:
        found: What was measured.
        published: What was printed.
    """
    printed = _published_fourier(found, published)
    rows = []
    for name, own in (*found.rigs.items(), *found.walks.items()):
        sizes = {
            f"{quantity} of {joint}": [
                own.errors[joint, state].rms(kind) for state in (KINEMATIC, FOURIER)
            ]
            for joint in own.joints
            for quantity, kind in zip(QUANTITIES, KINDS, strict=True)
        }
        if own.motion.protocol == "gait":
            sizes = {
                "the seven axes": [
                    float(np.sqrt(np.mean(np.square(own.seven("rmse_deg", state)))))
                    for state in (KINEMATIC, FOURIER)
                ]
            }
        for key, change in fourier_changes(own).items():
            theirs = printed.get((name, key))
            within = "yes" if own.motion.within else "no"
            rows.append(
                StudyRow(
                    f"{name}: {key}",
                    (within, *sizes[key], *_told(change)),
                    () if theirs is None else (None, None, None, theirs, *[None] * 4),
                    other="" if theirs is None else words.ONE_RUN,
                )
            )
    return StudyTable(
        "states",
        words.STATES_CAPTION,
        (
            "within",
            "kinematic, RMS",
            "Fourier, RMS",
            "change [%]",
            "from [%]",
            "to [%]",
            "runs with less",
            "shown",
        ),
        tuple(rows),
        words.STATES_HOW,
        words.STATES_WHY,
        decimals=(0, 3, 3, 1, 1, 1, 0, 0),
        short="Fourier or kinematic",
        spread=words.INTERVAL,
    )


def _told(change: Change) -> tuple[Value, ...]:
    low, high = change.interval or (None, None)
    return (change.percent, low, high, float((change.ratios < 1).sum()), change.verdict)


def order_table(found: Reference5, published: PublishedChain) -> StudyTable:
    """The two joints of the squat against one another.

    Args:
        found: What was measured.
        published: What was printed.
    """
    theirs = next(entry for entry in published.servo_rms if entry.table == "4.2")
    rows = []
    for i, (name, change) in enumerate(distal_changes(found).items()):
        state = (KINEMATIC, FOURIER)[i // len(QUANTITIES)]
        first, second = theirs.states[state]  # type: ignore[index]
        k = i % len(QUANTITIES)
        percent = round(100 * (second[k] / first[k] - 1), 1)
        rows.append(StudyRow(name, _told(change), (percent, *[None] * 4), other=words.ONE_RUN))
    return StudyTable(
        "order",
        words.ORDER_CAPTION,
        ("change [%]", "from [%]", "to [%]", "runs with less", "shown"),
        tuple(rows),
        words.ORDER_HOW,
        words.ORDER_WHY,
        decimals=(1, 1, 1, 0, 0),
        short="Distal or proximal",
        spread=words.INTERVAL,
    )


def _published_fourier(
    found: Reference5, published: PublishedChain
) -> dict[tuple[str, str], float]:
    """Change from the kinematic to the Fourier state [%], as the printed errors have it."""
    result = {}
    for table, motion in zip(published.servo_rms, (PENDULUM, SQUAT), strict=True):
        for i, joint in enumerate(found.rigs[motion.name].joints):
            for k, quantity in enumerate(QUANTITIES):
                first, second = (table.states[s][i][k] for s in ("fourier", "kinematic"))
                change = round(100 * (first / second - 1), 1)
                result[motion.name, f"{quantity} of {joint}"] = change
    return result


GAIT_FIGURES = (
    "mean_abs_error_deg",
    "rmse_deg",
    "median_error_deg",
    "largest_error_deg",
    "smallest_error_deg",
    "relative_percent",
)


# Longer than a screen: eight columns of two published tables.
def gait_table(found: Reference5, published: PublishedChain) -> StudyTable:
    """Tables 4.3 and 4.4 of the walk whose strides vary, by placement and filter.

    Args:
        found: What was measured.
        published: What was printed.
    """
    places = {
        (EXACT, KINEMATIC): found.walks[VARIED.name],
        (EXACT, FOURIER): found.walks[VARIED.name],
        (OFF, PRINTED[FOURIER]): found.placed[OFF],
        (OFF, FOURIER): found.placed[OFF],
        (FITTED, KINEMATIC): found.placed[FITTED],
        (FITTED, FOURIER): found.placed[FITTED],
    }
    rows = []
    for theirs in published.gait.rows:
        movement = AXES[theirs.joint, theirs.axis].rpartition("_")[2]
        axis = f"{theirs.joint} {movement} ({theirs.axis})"
        for (place, name), own in places.items():
            errors = own.errors[AXES[theirs.joint, theirs.axis], name]
            is_printed = name == PRINTED[FOURIER]
            rows.append(
                StudyRow(
                    f"{axis}, sensors {place}, {FOURIER if is_printed else name}",
                    _gait_values(errors),
                    spread=(errors.sd("mean_error_deg"), *[None] * 6),
                    settings="published" if is_printed else "ours",
                    printed="text" if is_printed else "",
                )
            )
        rows.append(
            StudyRow(
                axis,
                (None,) * 7,
                (
                    theirs.mean_error_deg,
                    None,
                    None,
                    theirs.median_error_deg,
                    theirs.largest_error_deg,
                    theirs.smallest_error_deg,
                    theirs.relative_percent,
                ),
            )
        )
    parts = len(found.walks[VARIED.name].sessions)
    return StudyTable(
        "table_4_3",
        "Walking, right leg: errors of the joint angles",
        (
            "signed mean [deg]",
            "mean |e| [deg]",
            "RMS [deg]",
            "median [deg]",
            "largest [deg]",
            "smallest [deg]",
            "relative [%]",
        ),
        tuple(rows),
        words.GAIT_HOW.format(parts=words.counted(parts)),
        words.GAIT_WHY.format(mean=published.gait.mean_magnitude_deg),
        "4.3, 4.4",
        (3, 3, 3, 3, 3, 4, 2),
        spread=words.OVER_PARTS,
    )


def _gait_values(errors: JointErrors) -> tuple[Value, ...]:
    """The columns of tables 4.3 and 4.4, over all parts."""
    largest = max(errors.values("largest_error_deg"), key=abs)
    smallest = min(errors.values("smallest_error_deg"), key=abs)
    relative = [row.relative_percent for row in errors.rows if row.relative_percent is not None]
    return (
        errors.mean("mean_error_deg"),
        errors.mean("mean_abs_error_deg"),
        errors.rms("rmse_deg"),
        errors.mean("median_error_deg"),
        largest,
        smallest,
        float(np.mean(relative)) if relative else None,
    )


def placed_table(found: Reference5) -> StudyTable:
    """The walk by motion, placement and filter."""
    rows = []
    for label, own in _walks(found).items():
        names = list(dict.fromkeys(name for _, name in own.errors))
        for name in names:
            values = own.seven("rmse_deg", name)
            ours = name in (KINEMATIC, FOURIER)
            lost = float(own.lost[name]) if ours else None
            rows.append(_placed(f"{label}, {name.removesuffix(TEXT)}", values, lost, ours))
    for label, values in found.usual.items():
        rows.append(_placed(f"{VARIED.name}, sensors {label}, {USUAL}", values, None, True))
    parts = len(next(iter(found.walks.values())).sessions)
    return StudyTable(
        "placement",
        words.PLACED_CAPTION,
        ("RMS [deg]", "lowest of a part", "highest of a part", "said to be lost"),
        tuple(rows),
        words.PLACED_HOW.format(parts=words.counted(parts)),
        words.PLACED_WHY,
        decimals=(2, 2, 2, 0),
        short="Placement",
        spread=words.OVER_PARTS,
    )


TEXT = " of the text"


def _placed(label: str, values: Sequence[float], lost: float | None, ours: bool) -> StudyRow:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return StudyRow(
        label,
        (float(np.mean(values)), min(values), max(values), lost),
        spread=(sd, None, None, None),
        settings="ours" if ours else "published",
        printed="" if ours else "text",
    )


def harmonics_table(found: Reference5) -> StudyTable:
    """Errors by the number of harmonics."""
    columns: dict[str, Mapping[int, float]] = {}
    for name in found.walks:
        columns[f"{name}, by the filter [deg]"] = found.harmonics[name]
        columns[f"{name}, series alone [deg]"] = found.series[name]
    rows = [
        StudyRow(str(number), tuple(own[number] for own in columns.values()))
        for number in HARMONICS
    ]
    return StudyTable(
        "harmonics",
        words.HARMONICS_CAPTION,
        tuple(columns),
        tuple(rows),
        words.HARMONICS_HOW,
        words.HARMONICS_WHY,
        decimals=(3,) * len(columns),
        short="Harmonics",
    )


def walk_table(found: Reference5) -> StudyTable:
    """Every joint of the walk whose strides vary, and how sure the filter is of it."""
    own = found.walks[VARIED.name]
    rows = []
    for joint in own.joints:
        for state in (KINEMATIC, FOURIER):
            errors = own.errors[joint, state]
            values = (
                errors.mean("mean_error_deg"),
                errors.rms("rmse_deg"),
                max(errors.values("rmse_deg")),
                errors.rms("uncertainty_deg"),
                errors.mean("covered_percent"),
                min(errors.values("covered_percent")),
            )
            spread = (errors.sd("mean_error_deg"), errors.sd("rmse_deg"), *[None] * 4)
            note = _too_sure(errors)
            rows.append(StudyRow(f"{joint}, {state}", values, note=note, spread=spread))
    return StudyTable(
        "walk",
        f"{VARIED.name}, sensors {EXACT}: every joint, and how sure the filter is of it",
        (
            "signed mean [deg]",
            "RMS [deg]",
            "largest RMS of a part [deg]",
            "stated uncertainty [deg]",
            "covered [%]",
            "least of a part [%]",
        ),
        tuple(rows),
        words.WALK_HOW.format(parts=words.counted(len(own.sessions)), least=LEAST_COVERED_PERCENT),
        words.WALK_WHY,
        decimals=(3, 3, 3, 3, 0, 0),
        short="Every joint",
        spread=words.OVER_PARTS,
    )
