"""Tables and figures of the walks of the study `reference-4`, beside the published ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from testbench.estimation.gait.known_distance import fit_lengths
from testbench.estimation.gait.parameters import PUBLISHED
from testbench.exceptions import InputError
from testbench.records.results.study import (
    StudyCurve,
    StudyCurves,
    StudyReason,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.specs.published import PublishedRow, PublishedTable
from testbench.studies.pedestrian.walks import (
    CORRECTED,
    DEVICE,
    DEVICES,
    FILTERS,
    LISTING,
    OURS,
    PARAMETERS,
    PRINTS,
    PROPERTIES,
    SIMPLE,
    TEXT,
    VARIANTS,
    Reckoned,
    Walks,
)

SLOPE = PUBLISHED["universal"].slope_m_deg
"""a_H of E. Muñoz 2016, which the source keeps [m/deg]."""
OTHER_WALKER = "another walker, whose lengths and turns differ"
REPETITIONS = "standard deviation over the repetitions"
OVER_PARTS = "standard deviation over parts and runs"
VARIANTS_KEY = "variants"


def _mean_sd(values: Sequence[float]) -> tuple[float | None, float | None]:
    if not len(values):
        return None, None
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return float(np.mean(values)), sd


def _intercept(walks: Sequence[Reckoned]) -> float:
    """b_H that gives the known distance of all walks together; 0 where none has a cycle [m]."""
    known = [one for one in walks if len(one.swings)]
    if not known:
        return 0.0
    return fit_lengths([one.swings for one in known], [one.distance for one in known], SLOPE)[1]


def _row(
    label: str,
    cells: Sequence[tuple[float | None, float | None]],
    filter_name: str,
    published: tuple[tuple[Value, ...], tuple[Value, ...]] = ((), ()),
) -> StudyRow:
    """One row by one filter: ours, or the source's by its print."""
    values, spread = zip(*cells, strict=True)
    beside, sd = published
    return StudyRow(
        label,
        values,
        beside,
        spread=spread,
        published_spread=sd,
        settings="ours" if filter_name in (CORRECTED, OURS) else "published",
        printed=PRINTS.get(filter_name, ""),
        other=OTHER_WALKER if beside else "",
    )


def corridor_table(walks: Walks, published: PublishedTable) -> StudyTable:
    """Table 10: the straight corridor, b_H tuned on the same walks.

    Args:
        walks: All.
        published: As printed.
    """
    theirs = {row.label: row for row in published.rows}
    rows = []
    for label, device in DEVICES.items():
        printed = theirs[label]
        by = DEVICE if device == "bno055" else LISTING
        for name in (by, OURS):
            own = walks.of("corridor", "shank", device, name)
            b = _intercept(own)
            cells = [
                _mean_sd([one.cycle_error for one in own]),
                _mean_sd([one.distance_error(SLOPE, b) for one in own]),
                _mean_sd([one.position_error(SLOPE, b) for one in own]),
            ]
            v = printed.values
            beside = ((v[0], v[2], v[3]), (v[4], v[5], v[6])) if name == by else ((), ())
            how = {DEVICE: "device's angles", OURS: OURS}.get(name, "own filter")
            rows.append(_row(f"{label}, {how}", cells, name, beside))
    count = len(walks.of("corridor", "shank", "ngimu", LISTING))
    return StudyTable(
        "table_10",
        f"Straight corridor, 14 gait cycles: mean magnitude of the errors, {count} repetitions",
        ("error in cycles", "error in distance [m]", "error in position [m]"),
        tuple(rows),
        "How to read: on the shank, in a level frame. b_H is tuned on the same walks, as in the "
        "source, with a_H as published; so the distance says only how much walks differ.",
        "",
        "10",
        (2, 3, 2),
        short="Table 10",
        spread=REPETITIONS,
        published_spread=REPETITIONS,
        reasons=(
            StudyReason(
                "What varies from stride to stride, the noise of a device and the drift of its "
                "heading are in ours; heel strike, skin and a strap's slip are not.",
                "candidate",
                "table_10",
            ),
            StudyReason("Speed, length of stride and path of the source's walks.", "open", ""),
        ),
    )


LOOP_FIGURES: dict[str, tuple[str, Callable[[Reckoned, float], float]]] = {
    "error in cycles [%]": ("cycles", lambda one, b: 100 * one.cycle_error / one.cycles),
    "error in distance [%]": (
        "distance",
        lambda one, b: 100 * one.distance_error(SLOPE, b) / one.distance,
    ),
    "error in position [m]": ("position", lambda one, b: one.position_error(SLOPE, b)),
}


def loop_table(walks: Walks, tables: dict[str, PublishedTable]) -> StudyTable:
    """Tables 12 to 14: the loop by parameters that one run of each part chose.

    Args:
        walks: All.
        tables: As printed.
    """
    rows = []
    for device, device_label in (("ngimu", "NGIMU"), ("bno080", "BNO080")):
        for place, position in PARAMETERS.items():
            theirs = _published_runs(tables, f"{device_label}, {position}")
            for title, (key, rule) in LOOP_FIGURES.items():
                for name in (LISTING, OURS):
                    ours = _verified(walks, place, device, name, rule)
                    beside, note = theirs[key] if name == LISTING else ([], "")
                    label = f"{device_label}, {place}: {title}"
                    rows.append(_loop_row(label, ours, name, beside, note))
    return StudyTable(
        "table_13",
        "Loop of 109 gait cycles and 151.7 m with turns, parameters frozen after one run",
        ("mean", "lowest", "highest", "published within"),
        tuple(rows),
        "How to read: magnitudes; thresholds of table 11, b_H tuned on one run of each part, then "
        "three runs judged. Published is the mean of three runs, its lowest and highest; within "
        "says whether that mean lies between our lowest and highest. A misprint is put right "
        "and told beneath.",
        "",
        "12, 13, 14",
        (2, 2, 2, 0),
        short="Tables 12 to 14",
        spread=OVER_PARTS,
        reasons=(
            StudyReason(
                "A chest swings twice a gait cycle, by 3 deg in all in our walker. Below the "
                "threshold of table 11 (6 and 8 deg) no cycle is found, somewhat above it both "
                "swings are counted, and only about it about as many as there are.",
                "shown",
                "properties",
            ),
            StudyReason(
                "How far the arm swings, and hands in pockets, decide whether a cycle of the wrist "
                "is found; the table of properties moves each.",
                "candidate",
                "properties",
            ),
            StudyReason(
                "How the source's walker moved: neither swings nor speeds are stated.", "open", ""
            ),
        ),
    )


def _published_runs(
    tables: dict[str, PublishedTable], begin: str
) -> dict[str, tuple[list[float], str]]:
    """Figures of the three verification runs of one device and place, and what is to be known of
    them; a misprint is put right.
    """
    relative = [row for row in tables["13"].rows if row.label.startswith(f"{begin}, ")]
    absolute = [row for row in tables["12"].rows if row.label.startswith(f"{begin}, ")]
    return {
        "cycles": _put_right(relative, 0),
        "distance": _put_right(relative, 1),
        "position": _put_right(absolute, 3),
    }


def _put_right(rows: Sequence[PublishedRow], column: int) -> tuple[list[float], str]:
    """One column of published runs with its misprints put right, and a sentence on these."""
    found, notes = [], []
    for row in rows:
        value = row.values[column]
        right = row.corrected[column] if row.corrected else None
        if right is not None:
            notes.append(f"run {row.label[-1]} is printed as {value:g}: {row.remark}")
            value = right
        if value is not None:
            found.append(value)
    return found, "; ".join(notes)


def _verified(
    walks: Walks, place: str, device: str, name: str, rule: Callable[[Reckoned, float], float]
) -> list[float]:
    """A figure of every verification run, by the b_H that the part's tuning run chose."""
    found = []
    for tuning in walks.of("tuning", place, device, name):
        b = _intercept([tuning])
        found += [
            rule(one, b) for one in walks.of("loop", place, device, name) if one.part == tuning.part
        ]
    return found


def _loop_row(label: str, ours: list[float], name: str, theirs: list[float], note: str) -> StudyRow:
    mean, sd = _mean_sd(ours)
    low, high = min(ours), max(ours)
    beside: tuple[Value, ...] = ()
    within: Value = None
    if theirs:
        middle = round(float(np.mean(theirs)), 3)
        beside = (middle, min(theirs), max(theirs), None)
        within = "yes" if low <= middle <= high else "no"
    return StudyRow(
        label,
        (mean, low, high, within),
        beside,
        note,
        spread=(sd, None, None, None),
        settings="ours" if name == OURS else "published",
        printed=PRINTS.get(name, ""),
        other=OTHER_WALKER if theirs else "",
    )


def property_table(walks: Walks) -> StudyTable:
    """How the figures of the loop move with each property of the walker."""
    kinds = [("as it is", "loop")]
    for name, levels in PROPERTIES.items():
        kinds += [(f"{name}: {level}", f"{name}: {level}") for level, _ in levels]
    rows = []
    for label, kind in kinds:
        for place in PARAMETERS:
            cells = []
            for title in LOOP_FIGURES:
                rule, values = LOOP_FIGURES[title][1], []
                for tuning in walks.of("tuning", place, "ngimu", LISTING):
                    b = _intercept([tuning])
                    own = walks.of(kind, place, "ngimu", LISTING)
                    values += [rule(one, b) for one in own if one.part == tuning.part][:1]
                cells.append(_mean_sd(values))
            rows.append(_row(f"{label}, {place}", cells, LISTING))
    return StudyTable(
        "properties",
        "The loop by one property of the walker after the other",
        tuple(LOOP_FIGURES),
        tuple(rows),
        "How to read: NGIMU, b_H tuned on the walker as it is, then one walk with the property "
        "changed, mean magnitude over the parts. The walker's properties are from the sources that "
        "docs/studies.md names; these are the values beside them.",
        decimals=(2, 2, 2),
        short="Properties",
        spread=OVER_PARTS,
    )


def drift_of_walks(walks: Walks, published: PublishedTable) -> StudyTable:
    """Yaw drift in the corridor by mounting and by every print of the filter.

    Args:
        walks: All.
        published: As printed, in words.
    """
    front, _, thigh = published.rows
    beside: dict[tuple[str, str], Value] = {
        ("shank", SIMPLE): front.values[0],
        ("shank", LISTING): front.values[1],
        ("thigh", SIMPLE): thigh.values[0],
    }
    rows = []
    for place in ("shank", "thigh"):
        for name in FILTERS:
            own = walks.of("corridor", place, "ngimu", name)
            cell = _mean_sd([abs(one.drift_deg) for one in own])
            theirs = beside.get((place, name))
            told: tuple[tuple[Value, ...], tuple[Value, ...]] = ((), ())
            if theirs is not None:
                told = ((theirs, None), ())
            rate = _mean_sd([abs(one.drift_deg) / one.cycles for one in own])
            named = {SIMPLE: "simple prediction", CORRECTED: "corrected", OURS: OURS}
            what = named.get(name, "improved prediction")
            rows.append(_row(f"{place}, {what}", [cell, rate], name, told))
    return StudyTable(
        "drift_by_place",
        "Magnitude of the yaw drift over 14 gait cycles in a straight corridor, NGIMU",
        ("drift [deg]", "drift a cycle [deg]"),
        tuple(rows),
        "How to read: heading in the rest after the walk less that before it. The filters of the "
        "source have no bias state; the corrected one and vqf_6d had the gyroscope's zero taken "
        "from the rest before the walk. Why the corrected one drifts more on the shank: see the "
        "table of the filter with one thing changed.",
        "Published in words: about 50 (front of the ankle) and below 50 deg (front of the thigh) "
        "by the simple, below 10 by the improved prediction, of walks whose length is not stated.",
        decimals=(1, 2),
        short="Drift by mounting",
        spread=REPETITIONS,
    )


def tuned_table(walks: Walks, published: PublishedTable) -> StudyTable:
    """b_H by a known distance, beside table 11; a_H too, by walks of two speeds.

    Args:
        walks: All.
        published: As printed.
    """
    theirs = {row.label: row.values for row in published.rows}
    rows = []
    for device in ("ngimu", "bno080"):
        for place, position in PARAMETERS.items():
            own = walks.of("tuning", place, device, LISTING)
            counted = [one for one in own if 2 * len(one.swings) > one.cycles]
            swing = _mean_sd([float(one.swings.mean()) for one in counted])
            b = _mean_sd([_intercept([one]) for one in counted])
            printed = theirs[f"{device}_{position}"][2]
            rows.append(
                _row(
                    f"{place}, {device}",
                    [swing, (SLOPE, None), b],
                    LISTING,
                    ((None, None, printed), ()),
                )
            )
    rows.append(_both_tuned(walks))
    return StudyTable(
        "table_11",
        "Step length tuned to a known distance",
        ("mean swing [deg]", "a_H [m/deg]", "b_H [m]"),
        tuple(rows),
        "How to read: of the tuning run of each part, 151.7 m over 109 cycles; a dash where fewer "
        "than half of the cycles are found. The last row fits both by two walks, 15 % slower and "
        "faster.",
        "A published b_H tells the swing of the source's walker: with a cycle of 1.392 m it is "
        "(1.392 − b_H) / a_H, some 35 to 41 deg on the shin and 15 to 17 deg on the wrist.",
        "11",
        (1, 4, 3),
        spread=OVER_PARTS,
        reasons=(
            StudyReason(
                "The curves of the literature swing the shank by half as much again as the "
                "source's b_H tells of its walker, so that ours comes out negative.",
                "shown",
                "table_11",
            ),
            StudyReason("Why the source's shin swings by so little.", "open", ""),
        ),
    )


def _both_tuned(walks: Walks) -> StudyRow:
    slopes, intercepts = [], []
    every = walks.of("speeds", "shank", "ngimu", LISTING)
    for part in dict.fromkeys(one.part for one in every):
        own = [one for one in every if one.part == part]
        try:
            a, b = fit_lengths([one.swings for one in own], [one.distance for one in own])
        except InputError:
            continue
        slopes.append(a)
        intercepts.append(b)
    swing = _mean_sd([float(one.swings.mean()) for one in every if len(one.swings)])
    cells = [swing, _mean_sd(slopes), _mean_sd(intercepts)]
    return _row("shank, ngimu, both by two speeds", cells, LISTING)


def published_alone(key: str, published: PublishedTable, titles: tuple[str, ...]) -> StudyTable:
    """A table of the source that has nothing of ours beside it.

    Args:
        key: Its number.
        published: As printed.
        titles: Of the columns.
    """
    none = (None,) * len(titles)
    return StudyTable(
        f"table_{key}",
        published.caption,
        titles,
        tuple(StudyRow(row.label, none, tuple(row.values), row.remark) for row in published.rows),
        "How to read: published values alone. The step counter is a program on board of the "
        "device, which no model of it stands for.",
        table=key,
    )


def loop_curves(walks: Walks) -> StudyCurves:
    """The loop from above by each place, first part."""
    curves = [StudyCurve("walked", walks.loop[::20, 0], walks.loop[::20, 1], "truth")]
    for place in PARAMETERS:
        tuning = walks.of("tuning", place, "ngimu", LISTING)[:1]
        own = walks.of("loop", place, "ngimu", LISTING)[:1]
        for one in own:
            path = one.path(SLOPE, _intercept(tuning))
            if len(path) > 1:
                curves.append(StudyCurve(place, path[:, 0], path[:, 1], "measurement"))
    return StudyCurves(
        "Path of the loop by place, NGIMU, the source's program",
        "x [m]",
        "y [m]",
        tuple(curves),
        "How to read: from above, a point after each gait cycle, axes to one scale; first part.",
        plane=True,
    )


def sentences(walks: Walks) -> tuple[str, ...]:
    """What the walks answer."""
    by = {}
    for place in PARAMETERS:
        errors = _verified(walks, place, "ngimu", LISTING, LOOP_FIGURES["error in cycles [%]"][1])
        far = _verified(walks, place, "ngimu", LISTING, LOOP_FIGURES["error in distance [%]"][1])
        by[place] = (
            f"{place} {min(errors):.0f} to {max(errors):.0f} % of the cycles and {min(far):.0f} to "
            f"{max(far):.0f} % of the distance"
        )
    drift = {
        name: [abs(one.drift_deg) for one in walks.of("corridor", "shank", "ngimu", name)]
        for name in (SIMPLE, TEXT, LISTING, CORRECTED, OURS)
    }
    told = ", ".join(
        f"{what} {min(drift[name]):.0f} to {max(drift[name]):.0f}"
        for name, what in (
            (SIMPLE, "simple (text)"),
            (TEXT, "improved (text)"),
            (LISTING, "improved (listing)"),
            (CORRECTED, "corrected"),
            (OURS, OURS),
        )
    )
    places = "; ".join(by.values())
    return (
        f"Walking a loop with turns, by run, NGIMU and the source's program: {places}.",
        f"Yaw drift of the shank over 14 cycles of walking [deg]: {told}.",
    )


def variants_table(walks: Walks) -> StudyTable:
    """The filter on a shank with one thing changed at a time.

    Args:
        walks: All.
    """
    rows = []
    for label, (name, _, _) in VARIANTS.items():
        own = walks.of("variants", "shank", "ngimu", label)
        cells = [
            _mean_sd([abs(one.drift_deg) for one in own]),
            _mean_sd([one.tilt_deg for one in own if one.tilt_deg is not None]),
        ]
        values, spread = zip(*cells, strict=True)
        rows.append(StudyRow(label, values, spread=spread, printed=PRINTS.get(name, "")))
    found = {row.label: [float(value or 0.0) for value in row.values] for row in rows}
    return StudyTable(
        VARIANTS_KEY,
        "The filter with one thing changed, shank, 14 gait cycles in a straight corridor, NGIMU",
        ("drift [deg]", "inclination while walking, RMS error [deg]"),
        tuple(rows),
        "How to read: magnitude of the drift as above; the inclination is judged by the walker's "
        "true one, which the source did not know.",
        decimals=(1, 1),
        short="One thing changed",
        spread=REPETITIONS,
        reasons=_variant_reasons(found),
    )


def _variant_reasons(by: dict[str, list[float]]) -> tuple[StudyReason, ...]:
    """Why the corrected filter drifts more, by drift and inclination of each variant [deg]."""
    whole, told, still = (
        by[label]
        for label in (
            "corrected",
            "corrected, forces exact to 0.05 rad",
            "corrected, a hundredth of the process noise",
        )
    )
    program = by["program"]
    less = max(told[0], still[0]) < 0.5 * whole[0] and max(told[1], still[1]) < 0.5 * whole[1]
    return (
        StudyReason(
            "While a leg swings, a force that is of gravity's size by chance is taken to show "
            "roll and pitch within 0.0014 rad, as at rest, and the corrected filter, whose "
            "uncertainty has grown since the last one, follows it whole: its inclination is "
            f"off by {whole[1]:.0f} deg RMS and its yaw drifts by {whole[0]:.0f} deg. With "
            f"forces exact to 0.05 rad it is {told[1]:.1f} and {told[0]:.1f} deg, with a "
            f"hundredth of the process noise {still[1]:.1f} and {still[0]:.1f} deg.",
            "shown" if less else "refuted",
            VARIANTS_KEY,
        ),
        StudyReason(
            "The program follows such a force by a tenth, for its uncertainty stands still while "
            f"its gate is closed: its yaw drifts by {program[0]:.1f} deg, and its inclination is "
            f"off by {program[1]:.0f} deg RMS all the same.",
            "candidate",
            VARIANTS_KEY,
        ),
    )
