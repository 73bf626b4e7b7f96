"""The study `reference-5`: tables 4.1 to 4.4 of Quijano & Valencia 2018 beside ours, as a
record.
"""

from __future__ import annotations

from testbench.model.statistics.spread import Change
from testbench.records.results.study import StudyRecord, StudyRow, StudyTable, Value
from testbench.records.session.session_writer import software_versions
from testbench.studies.bench import StudyBench
from testbench.studies.chain import words
from testbench.studies.chain.comparison import (
    AXES,
    FOURIER,
    QUANTITIES,
    JointErrors,
    Reference5,
    reference_5,
)

LEAST_COVERED_PERCENT = 80.0
"""A state whose standard uncertainty covers less of its errors (95 of a hundred would be honest) is
too sure of itself.
"""


def run(bench: StudyBench) -> StudyRecord:
    """Run pendulum, squat and gait with every part and put the errors beside the published ones."""
    started = bench.now()
    found = reference_5(bench)
    return StudyRecord(
        "reference-5",
        "A Kalman filter over a kinematic chain",
        words.QUESTION,
        found.published.source,
        started,
        {
            "seed": bench.seed,
            "parts": bench.parts,
            "runs of a rig": found.rigs,
            "protocols": ", ".join(found.sessions),
        },
        tuple(str(path) for paths in found.sessions.values() for path in paths),
        findings(found),
        (
            *(_servo_table(found, table) for table in ("4.1", "4.2")),
            _change_table(
                "states", words.STATES, fourier_changes(found), _published_fourier(found)
            ),
            _change_table("order", words.ORDER, distal_changes(found), _published_distal(found)),
            _gait_table(found),
            _walk_table(found),
        ),
        software=software_versions(),
    )


def fourier_changes(found: Reference5) -> dict[str, Change]:
    """Of every quantity of every joint of both rigs."""
    return {
        f"{quantity} of {row.joint}": change
        for row in found.servo
        for quantity, change in row.fourier_change().items()
    }


def distal_changes(found: Reference5) -> dict[str, Change]:
    """Of every quantity by every state."""
    states = found.servo[0].ours
    return {
        f"{q} by the {state} state": change
        for state in states
        for q, change in found.distal_change(state).items()
    }


def uncovered(found: Reference5) -> dict[tuple[str, str, str], JointErrors]:
    """Joints whose stated uncertainty covers too few of the errors of all parts, by what is moved,
    joint and state.
    """
    rigs = {
        ("pendulum" if row.table == "4.1" else "squat", row.joint, state): errors
        for row in found.servo
        for state, errors in row.ours.items()
    }
    everything = rigs | {
        ("gait", joint, state): errors for (joint, state), errors in found.walk.items()
    }
    return {
        key: errors
        for key, errors in everything.items()
        if errors.mean("covered_percent") < LEAST_COVERED_PERCENT
    }


def findings(found: Reference5) -> tuple[str, ...]:
    """The answer in sentences, each no wider than its spread."""
    sentences = [
        words.judged(words.STATES, fourier_changes(found), found.rigs),
        words.judged(words.ORDER, distal_changes(found), found.rigs),
    ]
    states = list(dict.fromkeys(state for _, state in found.walk))
    sentences += [
        words.walked(
            state,
            found.mean_magnitude_of_means(state),
            found.walking_rms(state),
            found.published.gait.mean_magnitude_deg,
        )
        for state in states
    ]
    lost = uncovered(found)
    for state in states:
        own = {
            f"{joint} ({rig})": errors for (rig, joint, key), errors in lost.items() if key == state
        }
        told = {
            name: (errors.rms("rmse_deg"), errors.mean("covered_percent"))
            for name, errors in own.items()
        }
        count = len([key for _, key in found.walk if key == state]) + len(found.servo)
        sentences.append(words.covered(state, told, count, LEAST_COVERED_PERCENT))
    return tuple(sentences)


def _servo_table(found: Reference5, table: str) -> StudyTable:
    rows = [
        StudyRow(
            f"{row.joint}, {state}",
            (*row.pooled(state), errors.mean("covered_percent")),
            (*row.published[state], None),
            _too_sure(errors),
        )
        for row in found.servo
        if row.table == table
        for state, errors in row.ours.items()
    ]
    ratios = [
        [
            a / b
            for row in found.servo
            for state in row.ours
            for a, b in [(row.pooled(state)[i], row.published[state][i])]
        ]
        for i in range(len(QUANTITIES))
    ]
    return StudyTable(
        f"table_{table.replace('.', '_')}",
        f"{words.RIGS[table]}: RMS errors",
        ("angle [deg]", "rate [deg/s]", "acceleration [deg/s²]", "covered [%]"),
        tuple(rows),
        f"How to read: RMS over {words.run_times(found.rigs)}, each with other sensors of one "
        "kind, against the joints of the arm; covered are the errors of the angle within 1.96 of "
        "the uncertainty that the filter states.",
        words.sizes(ratios) if table == "4.1" else "",
        table,
        (4, 3, 2, 0),
    )


def _too_sure(errors: JointErrors) -> str:
    return "too sure of itself" if errors.mean("covered_percent") < LEAST_COVERED_PERCENT else ""


def _change_table(
    key: str, question: words.Question, changes: dict[str, Change], published: dict[str, float]
) -> StudyTable:
    rows = []
    for name, change in changes.items():
        low, high = change.interval or (None, None)
        values: tuple[Value, ...] = (
            change.percent,
            low,
            high,
            float((change.ratios < 1).sum()),
            change.verdict,
        )
        rows.append(StudyRow(name, values, (round(published[name], 1), None, None, None, None)))
    runs = len(next(iter(changes.values())).ratios)
    return StudyTable(
        key,
        question.caption,
        ("change [%]", "from [%]", "to [%]", "runs with less", "shown"),
        tuple(rows),
        words.CHANGE_HOW.format(parts=words.run_times(runs)),
        question.why,
        decimals=(1, 1, 1, 0, 0),
        short=question.short,
    )


def _published_fourier(found: Reference5) -> dict[str, float]:
    """Change from the kinematic to the Fourier state [%], as the printed errors have it."""
    return {
        f"{quantity} of {row.joint}": 100
        * (row.published["fourier"][i] / row.published["kinematic"][i] - 1)
        for row in found.servo
        for i, quantity in enumerate(QUANTITIES)
    }


def _published_distal(found: Reference5) -> dict[str, float]:
    """Change from the first joint of the squat to the second [%], as the printed errors have it."""
    first, second = [row for row in found.servo if row.table == "4.2"]
    return {
        f"{quantity} by the {state} state": 100
        * (second.published[state][i] / first.published[state][i] - 1)
        for state in first.published
        for i, quantity in enumerate(QUANTITIES)
    }


def _gait_table(found: Reference5) -> StudyTable:
    rows = []
    for row in found.gait:
        movement = AXES[row.published.joint, row.published.axis].rpartition("_")[2]
        for state, ours in row.ours.items():
            means = ours.values("mean_error_deg")
            values = (
                ours.mean("mean_error_deg"),
                min(means),
                max(means),
                ours.mean("mean_abs_error_deg"),
                ours.rms("rmse_deg"),
            )
            theirs = (
                (row.published.mean_error_deg, None, None, None, None) if state == FOURIER else ()
            )
            rows.append(
                StudyRow(
                    f"{row.published.joint} {movement} ({row.published.axis}), {state}",
                    values,
                    theirs,
                )
            )
    return StudyTable(
        "table_4_3",
        "Walking, right leg: errors of the joint angles",
        (
            "signed mean [deg]",
            "lowest of a part",
            "highest of a part",
            "mean |e| [deg]",
            "RMS [deg]",
        ),
        tuple(rows),
        words.GAIT_HOW.format(parts=words.counted(found.parts)),
        words.GAIT_WHY,
        "4.3, 4.4",
        (3,) * 5,
    )


def _walk_table(found: Reference5) -> StudyTable:
    rows = []
    for (joint, state), errors in found.walk.items():
        values = (
            errors.mean("mean_error_deg"),
            errors.rms("rmse_deg"),
            max(errors.values("rmse_deg")),
            errors.rms("uncertainty_deg"),
            errors.mean("covered_percent"),
            min(errors.values("covered_percent")),
        )
        rows.append(StudyRow(f"{joint}, {state}", values, note=_too_sure(errors)))
    return StudyTable(
        "walk",
        "Walking: every joint of the chain, and how sure the filter is of it",
        (
            "signed mean [deg]",
            "RMS [deg]",
            "largest RMS of a part [deg]",
            "stated uncertainty [deg]",
            "covered [%]",
            "least of a part [%]",
        ),
        tuple(rows),
        words.WALK_HOW.format(parts=words.counted(found.parts), least=LEAST_COVERED_PERCENT),
        words.WALK_WHY,
        decimals=(3, 3, 3, 3, 0, 0),
        short="Every joint",
    )
