"""The study `reference-5`: tables 4.1 to 4.4 of Quijano & Valencia 2018 beside ours, as a record."""

from __future__ import annotations

from testbench.records.session_writer import software_versions
from testbench.records.study import StudyRecord, StudyRow, StudyTable
from testbench.studies.bench import StudyBench
from testbench.studies.reference_5 import Reference5, reference_5

SERVO_WHY = (
    "Only the order can be compared: the printed formula divides by the number of samples outside the root, table 4.1 gives "
    "degrees for all three columns and table 4.2 no unit. Dimensions and motions of their rigs are not stated; ours are in the "
    "protocols, and the arm's joints are known."
)
GAIT_WHY = (
    "A person walked there, with sensors on skin, and the joint angles were compared with those of another measurement system; "
    "the best of five trials is shown. Ours is a chain of rigid bodies that moves by published gait curves and is compared "
    "with its own joints: what soft tissue and heel strike do is not in it."
)


def run(bench: StudyBench) -> StudyRecord:
    """Run pendulum, squat and gait and put the errors beside the published ones."""
    started = f"{bench.clock.utc():%Y-%m-%dT%H:%M:%SZ}"
    seeds = tuple(range(bench.seed, bench.seed + bench.parts))
    bench.say(f"pendulum and squat with {len(seeds)} parts, and a walk")
    found = reference_5(bench.logs, seeds, with_report=False, clock=bench.clock)
    return StudyRecord(
        "reference-5",
        "A Kalman filter over a kinematic chain",
        "How well do the joints of a chain follow from the sensors on its links, and what does a Fourier state gain?",
        f"{found.published.authors}, {found.published.institution}, {found.published.year}",
        started,
        {"seed": bench.seed, "parts": bench.parts, "protocols": ", ".join(found.sessions)},
        tuple(str(path) for paths in found.sessions.values() for path in paths),
        _findings(found, bench.parts),
        (*(_servo_table(found, table) for table in ("4.1", "4.2")), _gait_table(found)),
        software=software_versions(),
    )


def _servo_table(found: Reference5, table: str) -> StudyTable:
    rows = [
        StudyRow(f"{row.joint}, {state}", tuple(row.ours[state]), tuple(row.published[state]))
        for row in found.servo
        if row.table == table
        for state in row.ours
    ]
    what = {"4.1": "Pendulum", "4.2": "Squat of two joints"}[table]
    return StudyTable(
        f"table_{table.replace('.', '_')}",
        f"{what}: RMS errors",
        ("angle [deg]", "rate [deg/s]", "acceleration [deg/s²]"),
        tuple(rows),
        "How to read: RMS over all parts of the same kind, against the joints of the arm; rows in italics as printed.",
        SERVO_WHY,
        table,
        (4, 3, 2),
    )


def _gait_table(found: Reference5) -> StudyTable:
    rows = []
    for row in found.gait:
        for state, ours in row.ours.items():
            values = (ours.mean_error_deg, ours.mean_abs_error_deg, ours.rmse_deg)
            rows.append(
                StudyRow(
                    f"{row.published.joint} {row.published.axis}, {state}", values, (row.published.mean_error_deg, None, None)
                )
            )
    return StudyTable(
        "table_4_3",
        "Walking, right leg: errors of the joint angles",
        ("signed mean [deg]", "mean |e| [deg]", "RMS [deg]"),
        tuple(rows),
        "How to read: the publication gives signed means, in which errors of either sign cancel; the mean magnitude and the "
        "RMS beside them are ours alone.",
        GAIT_WHY,
        "4.3, 4.4",
        (3, 3, 3),
        0,
    )


def _findings(found: Reference5, parts: int) -> tuple[str, ...]:
    sentences = []
    for row in found.servo:
        gains = ", ".join(f"{gain:.0f} %" for gain in row.fourier_gain_percent)
        sentences.append(
            f"{row.joint} (table {row.table}): the Fourier state has {gains} less error of angle, rate and acceleration than "
            f"the kinematic one, over {parts} parts."
        )
    worse = [state for state, is_worse in found.distal_is_worse.items() if is_worse]
    sentences.append(
        f"The distal joint of the squat has at least the error of the proximal one by {' and '.join(worse) or 'neither state'}."
    )
    totals = found.totals("fourier") if "fourier" in found.gait[0].ours else None
    if totals is not None:
        sentences.append(
            f"Walking, by the Fourier state: the mean magnitude of the signed means is {totals.mean_magnitude_of_means:.3f} "
            f"deg (published {found.published.gait.mean_magnitude_deg:.3f}), the RMS {totals.rmse:.3f} deg."
        )
    return tuple(sentences)
