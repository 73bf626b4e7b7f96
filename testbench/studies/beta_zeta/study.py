"""The study `beta_zeta`: the two gains of Madgwick's filter as de Miguel Pueyo 2024 has them, and
with a true bias state, on a leg that walks, stands and sits down.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from testbench.estimation.filters import FILTERS, RecursiveFilter, get_filter
from testbench.model import rotation
from testbench.model.statistics.spread import Change, in_percent
from testbench.records.results.study import (
    Print,
    StudyReason,
    StudyRecord,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.session.session import Session
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published import PublishedTable, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.beta_zeta import words
from testbench.studies.beta_zeta.figures import boxes, figures
from testbench.studies.beta_zeta.gains import (
    ADAPTIVE,
    ALONE,
    FORMS,
    IMU,
    IMU_ALONE,
    IMU_STATE,
    MARG,
    STATE,
    TEXT,
    UPSTREAM,
    Form,
    Tuned,
    tuned,
)
from testbench.studies.beta_zeta.takes import Take, rest_of, takes_of

PROTOCOL = "beta_zeta"
THESIS_GAINS = {"beta": 0.35, "zeta": 0.07}
SWEEPS = {
    "sweep 1": (np.linspace(0.1, 1.0, 10), np.linspace(0.1, 1.0, 10)),
    "sweep 2": (np.linspace(0.3, 0.4, 11), np.linspace(0.01, 0.1, 10)),
}
"""The grids of the source, beta and zeta; it does not give their steps."""
JUDGED = {
    "beta 0.35 and zeta 0.07, upstream code": (UPSTREAM, THESIS_GAINS),
    "beta 0.35 and zeta 0.07, text": (TEXT, THESIS_GAINS),
    "Madgwick's default, beta 0.041": (MARG, {}),
    "beta 0.1": (MARG, {"beta": 0.1}),
    "adaptive beta, 0.1": (ADAPTIVE, {"beta": 0.1}),
    "no magnetometer, beta 0.033": (IMU, {}),
    "no magnetometer, beta 0.35": (IMU, {"beta": 0.35}),
}
TIMES = 9
"""A run over a take is timed so often; the median counts."""
RANDOM_STEPS, MOST_STATES = 10_000, 2000
"""Random states, and those of a take, from which one step is made."""
MADE_FOR_HOURS = ("vqf_offline",)
"""Filters that are not timed a sample at a time."""


def run(bench: StudyBench) -> StudyRecord:
    """Run the protocol for every part, or take the user's recording, and compute the tables.

    Raises:
        InputError: The user's recording has no rates and forces, or neither a truth nor a device's
            orientation.
    """
    started = bench.now()
    results = bench.results(PROTOCOL)
    sessions = [result.session for result in results]
    takes = takes_of(sessions)
    judged = [take for take in takes if take.q_true is not None]
    with_mag = [take for take in takes if take.samples.has("mag")]
    with_device = [take for take in with_mag if take.samples.has("device_q")]
    missing = []
    if not takes:
        missing.append("a sensor with angular rates and specific forces")
    elif not judged and not with_device:
        missing.append("a truth, or an orientation of the device's own and a magnetometer")
    bench.refuse_without("Madgwick's filter", missing)
    bench.say("gains and tables")
    found = [tuned(form, own) for form in FORMS for own in [_fit(form, judged)] if own]
    published = load_published_tables("reference_2")
    tables = _tables(bench, takes, judged, with_device, found, sessions, published.tables["gains"])
    return StudyRecord(
        "beta_zeta",
        "The two gains of Madgwick's filter",
        words.QUESTION,
        published.source,
        started,
        bench.settings(PROTOCOL),
        tuple(str(session.path) for session in sessions),
        _findings(bench, tables, found, judged),
        tuple(tables.values()),
        tuple(boxes(judged)),
        software_versions(),
        figures(
            [take for take in takes if take.part == 0],
            words.CURVES_HOW if bench.session is None else words.OWN_CURVES_HOW,
        ),
    )


def _fit(form: Form, takes: Sequence[Take]) -> list[Take]:
    """Takes whose sensors have what a form needs."""
    needs = FILTERS[form.filter].needs
    return [take for take in takes if all(take.samples.has(quantity) for quantity in needs)]


def _tables(
    bench: StudyBench,
    takes: list[Take],
    judged: list[Take],
    with_device: list[Take],
    found: list[Tuned],
    sessions: list[Session],
    published: PublishedTable,
) -> dict[str, StudyTable]:
    tables = []
    if any(take.samples.has("mag") for take in takes):
        tables.append(identity_table(next(take for take in takes if take.samples.has("mag"))))
    if with_device:
        tables.append(difference_table(with_device, published))
    if judged:
        tables += [errors_table(judged), gain_table(found, judged)]
        if len({take.part for take in judged}) > 1:
            tables.append(change_table(found, judged))
        tables.append(bias_table(judged, found, sessions))
    tables += [noise_table(sessions, takes[0].sensor), time_table(takes[0])]
    return {table.key: table for table in tables}


def step_difference(count: int, interval: float, seed: int = 0) -> float:
    """Largest difference, over random states, of the rate of change of q with a zeta that
    corrects the rate of the same sample and with beta + interval * zeta [1/s].

    By quaternion products alone: q' = q (w - 2 T zeta q* s) / 2 - beta s with the unit gradient s.

    Args:
        count: How many states.
        interval: T [s].
        seed: Of the states.
    """
    rng = np.random.default_rng(seed)
    q, s = (rotation.normalise(rng.standard_normal((count, 4))) for _ in range(2))
    rate = np.column_stack([np.zeros(count), rng.uniform(-10, 10, (count, 3))])
    beta, zeta = rng.uniform(0, 1, (2, count, 1))
    drift = 2 * interval * zeta * rotation.multiply(rotation.conjugate(q), s)
    printed = 0.5 * rotation.multiply(q, rate - drift) - beta * s
    alone = 0.5 * rotation.multiply(q, rate) - (beta + interval * zeta) * s
    return float(np.abs(printed - alone).max())


def identity_table(take: Take) -> StudyTable:
    """That the source's zeta is an addition to beta, by number.

    Args:
        take: Whose states are gone through.
    """
    interval = take.samples.interval
    rows = [
        StudyRow(
            f"rate of change of q [1/s], {RANDOM_STEPS} random states, unit gradient",
            (None, None, None, step_difference(RANDOM_STEPS, interval)),
        )
    ]
    prints: tuple[tuple[str, Print], ...] = ((TEXT, "text"), (UPSTREAM, "upstream code"))
    for beta, zeta in ((0.35, 0.07), (0.33, 0.05), (0.1, 1.0)):
        for name, label in prints:
            together, largest = _stepwise(take, name, beta, zeta)
            rows.append(
                StudyRow(
                    "one step from every state of a take",
                    (beta, zeta, together, largest),
                    settings="published",
                    printed=label,
                )
            )
    rows = [_numbered(row, i) for i, row in enumerate(rows)]
    return StudyTable(
        "identity",
        "The source's zeta against a larger beta alone",
        ("beta [rad/s]", "zeta [rad/s²]", "together [rad/s]", "largest difference"),
        tuple(rows),
        words.IDENTITY_HOW,
        words.IDENTITY,
        decimals=(3, 3, 5, 6),
        short="Identity",
    )


def _numbered(row: StudyRow, i: int) -> StudyRow:
    """Rows of equal words told apart by their gains."""
    if i == 0:
        return row
    return replace(row, label=f"{row.label}, {row.values[0]:g} and {row.values[1]:g}")


def _stepwise(take: Take, name: str, beta: float, zeta: float) -> tuple[float, float]:
    """Mean beta that stands for both gains, and the largest difference after one step with the
    beta that stands for them in that step.
    """
    kind = get_filter(name, {"beta": beta, "zeta": zeta})
    assert isinstance(kind, RecursiveFilter)
    samples = take.samples.piece(slice(0, MOST_STATES))
    _, state = kind.advance(samples.piece(slice(0, 1)))
    largest, together = 0.0, []
    for i in range(1, len(samples)):
        now = samples.piece(slice(i, i + 1))
        size = _gradient_size(take, i, state["q"]) if name == TEXT else 1.0
        sum_of_both = beta + samples.interval * zeta * size
        other = get_filter(MARG, {"beta": sum_of_both})
        q_other, _ = other.advance(now, {**state, "filter": MARG})
        q, state = kind.advance(now, state)
        largest = max(largest, float(np.abs(q - q_other).max()))
        together.append(sum_of_both)
    return float(np.mean(together)), largest


def _gradient_size(take: Take, i: int, state_q: Sequence[float]) -> float:
    """Length of the gradient J' f of a sample (eqs 28 to 30), by quaternions alone.

    The misfit f of the up direction u and of the field is that of directions turned into the
    sensor; on the unit sphere its gradient by q is a sum of 2 J' f, taken here by differences.
    """
    acc = take.samples.acc[i] / np.linalg.norm(take.samples.acc[i])
    mag_all = take.samples.mag
    assert mag_all is not None
    mag = mag_all[i] / np.linalg.norm(mag_all[i])
    # the frame of the report: north along x
    turn = rotation.from_heading(-np.pi / 2)
    q = rotation.multiply(turn[None], np.array(state_q)[None])[0]
    h = rotation.rotate(q[None], mag[None])[0]
    b, bz = float(np.hypot(h[0], h[1])), float(h[2])

    def cost(p: np.ndarray) -> float:
        w, x, y, z = p
        f = np.array(
            [
                2 * (x * z - w * y) - acc[0],
                2 * (w * x + y * z) - acc[1],
                1 - 2 * (x * x + y * y) - acc[2],
                b * (1 - 2 * (y * y + z * z)) + 2 * bz * (x * z - w * y) - mag[0],
                2 * b * (x * y - w * z) + 2 * bz * (w * x + y * z) - mag[1],
                2 * b * (w * y + x * z) + bz * (1 - 2 * (x * x + y * y)) - mag[2],
            ]
        )
        return 0.5 * float(f @ f)

    step = 1e-6
    slopes = [(cost(q + step * own) - cost(q - step * own)) / (2 * step) for own in np.eye(4)]
    return float(np.linalg.norm(slopes))


def angle_of(difference: float) -> float:
    """Angle between two orientations whose unit quaternions lie so far apart [deg]: |q - p| = 2
    sin(angle / 4).
    """
    return float(np.degrees(4 * np.arcsin(difference / 2)))


def _groups(takes: Sequence[Take]) -> dict[str, list[Take]]:
    """Takes by sensor and motion."""
    found: dict[str, list[Take]] = {}
    for take in takes:
        found.setdefault(f"{take.sensor}, {take.motion}", []).append(take)
    return found


def _mean_sd(values: Sequence[float]) -> tuple[float, float | None]:
    sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return float(np.mean(values)), sd


def difference_table(takes: Sequence[Take], published: PublishedTable) -> StudyTable:
    """The source's own figure: how far Madgwick's filter is from the device's.

    Args:
        takes: Of sensors that report an orientation.
        published: What was printed.
    """
    rows = []
    for label, own in _groups(takes).items():
        kind = get_filter(UPSTREAM, THESIS_GAINS)
        mean, sd = _mean_sd([take.difference(kind) for take in own])
        rows.append(
            StudyRow(
                f"{label}, gains by noise",
                (0.35, 0.07, mean, angle_of(mean), None),
                spread=(None, None, sd, None, None),
                settings="published",
                printed="upstream code",
            )
        )
        for name, grid in SWEEPS.items():
            rows.append(_sweep(f"{label}, {name}, best", own, grid))
    none = (None,) * 5
    for row in published.rows:
        beta, zeta, distance = row.values
        angle = None if distance is None else round(angle_of(float(distance)), 1)
        rows.append(StudyRow(row.label, none, (beta, zeta, distance, angle, None), row.remark))
    columns = ("beta", "zeta", "mean difference", "as an angle [deg]", "most that zeta changes it")
    angle = angle_of(0.11535)
    return StudyTable(
        "difference",
        "Mean difference between Madgwick's filter by the source's gains and the device",
        columns,
        tuple(rows),
        words.DIFFERENCE_HOW,
        words.DIFFERENCE.format(angle=angle),
        decimals=(2, 2, 4, 1, 5),
        short="Difference to the device",
        spread=words.OVER_PARTS,
        reasons=(
            StudyReason(
                "A leg that walks accelerates its sensors by metres a second squared, which is "
                "what beta trades against the gyroscope: figures of this size need no fault.",
                "candidate",
                "difference",
            ),
            StudyReason("How the difference was taken, and of what, is not stated.", "open", ""),
        ),
    )


def _sweep(label: str, takes: list[Take], grid: tuple[np.ndarray, np.ndarray]) -> StudyRow:
    """The gains of a sweep that come nearest to the device, of all parts together."""
    betas, zetas = grid
    values = np.array(
        [
            [
                [take.difference(get_filter(UPSTREAM, {"beta": b, "zeta": z})) for take in takes]
                for z in zetas
            ]
            for b in betas
        ]
    )
    means = values.mean(axis=2)
    i, j = np.unravel_index(int(np.argmin(means)), means.shape)
    mean, sd = _mean_sd(values[i, j].tolist())
    at_edge = i in (0, len(betas) - 1) or j in (0, len(zetas) - 1)
    return StudyRow(
        label,
        (float(betas[i]), float(zetas[j]), mean, angle_of(mean), float(np.ptp(means, 1).max())),
        note="at an end of the sweep" if at_edge else "",
        spread=(None, None, sd, None, None),
        settings="published",
        printed="upstream code",
    )


def errors_table(takes: Sequence[Take]) -> StudyTable:
    """Errors against the truth by some gains, take by take.

    Args:
        takes: With a truth.
    """
    rows = []
    chosen = {
        label: get_filter(name, gains)
        for label, (name, gains) in JUDGED.items()
        if all(take.samples.has(q) for take in takes for q in FILTERS[name].needs)
    }
    for group, own in _groups(takes).items():
        cells = [_mean_sd([take.error(kind) for take in own]) for kind in chosen.values()]
        force = _mean_sd([take.linear_acceleration for take in own])
        values, spread = zip(force, *cells, strict=True)
        rows.append(StudyRow(group, tuple(values), spread=tuple(spread)))
    return StudyTable(
        "errors",
        "RMS error against the truth, by sensor, motion and gains",
        ("force [m/s²]", *(f"{label} [deg]" for label in chosen)),
        tuple(rows),
        words.ERRORS_HOW,
        words.ERRORS,
        decimals=(2, *(2,) * len(chosen)),
        short="Errors",
        spread=words.OVER_PARTS,
    )


def _by_part(takes: Sequence[Take], values: np.ndarray) -> list[float]:
    """Mean over the takes of each part."""
    parts = np.array([take.part for take in takes])
    return [float(values[parts == part].mean()) for part in dict.fromkeys(parts.tolist())]


def gain_table(found: Sequence[Tuned], takes: Sequence[Take]) -> StudyTable:
    """What each form of the filter comes to.

    Args:
        found: Each form.
        takes: That they were tuned on.
    """
    motions = list(dict.fromkeys(take.motion for take in takes))
    held = len(motions) > 1
    rows = []
    for own in found:
        fit = _fit(own.form, takes)
        cells = [_mean_sd(_by_part(fit, own.own))]
        if held:
            cells.append(_mean_sd(_by_part(fit, own.held_out)))
            for motion in motions:
                of = np.array([take.motion == motion for take in fit])
                rest = [take for take, yes in zip(fit, of, strict=True) if yes]
                cells.append(_mean_sd(_by_part(rest, own.held_out[of])))
        values, spread = zip(*cells, strict=True)
        error = "inclination" if own.form.filter == IMU else "total"
        rows.append(
            StudyRow(
                own.form.label,
                (error, *own.gains, *values),
                spread=(None, None, None, *spread),
            )
        )
    columns = ["error", "beta [rad/s]", "zeta [rad/s²]", "tuned on all [deg]"]
    if held:
        columns += ["by the other motions' gains [deg]", *(f"{motion} [deg]" for motion in motions)]
    return StudyTable(
        "gains",
        "RMS error with tuned gains, held out over motions",
        tuple(columns),
        tuple(rows),
        words.GAINS_HOW,
        words.GAINS,
        decimals=(0, 4, 5, *(2,) * (len(columns) - 3)),
        short="What a bias state gains",
        spread=words.OVER_PARTS,
    )


PAIRS = {
    "bias state against beta alone": (STATE, ALONE),
    "the same without magnetometer": (IMU_STATE, IMU_ALONE),
    "adaptive beta against beta alone": (FORMS[4], ALONE),
}


def changes(found: Sequence[Tuned], takes: Sequence[Take]) -> dict[str, tuple[Change, Change]]:
    """Of pairs of forms, over the parts and over motions and sensors.

    Args:
        found: Each form.
        takes: That they were tuned on.
    """
    by = {own.form: own for own in found}
    result = {}
    for name, (first, second) in PAIRS.items():
        if first not in by or second not in by:
            continue
        fit = _fit(first, takes)
        over_parts = Change.of(*(_by_part(fit, by[form].judged) for form in (first, second)))
        keys = np.array([f"{take.sensor}, {take.motion}" for take in fit])
        groups = list(dict.fromkeys(keys.tolist()))
        over_motions = Change.of(
            *(
                [float(by[form].judged[keys == key].mean()) for key in groups]
                for form in (first, second)
            )
        )
        result[name] = (over_parts, over_motions)
    return result


def verdict(pair: tuple[Change, Change]) -> str:
    """What both intervals show: less, more, or not shown."""
    first, second = pair
    return first.verdict if first.verdict == second.verdict else "not shown"


def change_table(found: Sequence[Tuned], takes: Sequence[Take]) -> StudyTable:
    """Whether a form is better than another, over parts and over motions.

    Args:
        found: Each form.
        takes: That they were tuned on.
    """
    rows = []
    for name, pair in changes(found, takes).items():
        cells: list[Value] = []
        for change in pair:
            cells += [change.percent, *(change.interval or (None, None))]
        rows.append(StudyRow(name, (*cells, verdict(pair))))
    return StudyTable(
        "changes",
        "Error of one form against another, gains held out over motions",
        (
            "over parts [%]",
            "from [%]",
            "to [%]",
            "over motions [%]",
            "from [%] ",
            "to [%] ",
            "shown",
        ),
        tuple(rows),
        words.CHANGES_HOW,
        words.CHANGES,
        decimals=(0,) * 7,
        short="Which form errs less",
        spread="intervals in columns of their own",
    )


def bias_table(
    takes: Sequence[Take], found: Sequence[Tuned], sessions: Sequence[Session]
) -> StudyTable:
    """The bias that the filter ends with, beside what the gyroscope read at rest before.

    Args:
        takes: With a truth.
        found: Each form.
        sessions: One a part.
    """
    take = takes[0]
    at_rest = np.degrees(rest_of(sessions[0], take.sensor)[0].mean(axis=0))
    columns, values = ["at rest before [deg/s]"], [at_rest]
    for own in found:
        if len(own.form.tuned) < 2:
            continue
        zeta = own.gains[1]
        assert zeta is not None
        kind = get_filter(own.form.filter, {"beta": own.gains[0], "zeta": zeta})
        assert isinstance(kind, RecursiveFilter)
        _, state = kind.advance(take.samples)
        columns.append(f"{own.form.label} [deg/s]")
        values.append(np.degrees(state["gyr_bias_rad_s"]))
    rows = [
        StudyRow(axis, tuple(float(column[i]) for column in values)) for i, axis in enumerate("xyz")
    ]
    return StudyTable(
        "bias",
        f"Bias of the gyroscope at the end of a take, {take.sensor}, {take.motion}",
        tuple(columns),
        tuple(rows),
        words.BIAS_HOW,
        words.BIAS,
        decimals=(3,) * len(columns),
        short="Bias",
    )


# Longer than a screen: three rules and what is said of them.
def noise_table(sessions: Sequence[Session], sensor: str) -> StudyTable:
    """Gains from the noise at rest: by the source's formulas, in both units, and by Madgwick's.

    Args:
        sessions: One a part.
        sensor: Of which.
    """
    found = []
    for session in sessions:
        rate, interval = rest_of(session, sensor)
        middle = len(rate) // 2
        sigma = float(rate.std(axis=0, ddof=1).mean())
        drift = np.abs(rate[middle:].mean(axis=0) - rate[:middle].mean(axis=0)).mean()
        found.append((sigma, float(drift) / (middle * interval)))
    degree, factor = float(np.degrees(1.0)), float(np.sqrt(0.75))
    published = (None, 0.35, 0.07)

    def row(
        label: str, unit: float, rule: Callable[[float], float], beside: tuple[Value, ...] = ()
    ) -> StudyRow:
        cells = [(s * unit, rule(s * unit), rule(d * unit)) for s, d in found]
        means, sds = zip(*(_mean_sd(column) for column in zip(*cells, strict=True)), strict=True)
        other = "of another sensor, whose noise is not stated" if beside else ""
        print_of: Print = "text" if beside or "text" in label else ""
        name = label.replace(" of the text", "")
        return StudyRow(name, means, beside, spread=sds, printed=print_of, other=other)

    rows = (
        row("sqrt(3/4 sigma) of the text, rad/s", 1.0, lambda x: float(np.sqrt(0.75 * x))),
        row(
            "sqrt(3/4 sigma) of the text, deg/s taken for rad/s",
            degree,
            lambda x: float(np.sqrt(0.75 * x)),
            published,
        ),
        row("Madgwick 2010, sqrt(3/4) sigma, rad/s", 1.0, lambda x: factor * x),
    )
    why = words.NOISE.format(
        printed=0.35**2 / 0.75, right=0.35 / factor, right_deg=float(np.degrees(0.35 / factor))
    )
    return StudyTable(
        "noise",
        "Gains from the noise at rest",
        ("sigma", "beta", "zeta"),
        rows,
        words.NOISE_HOW,
        why,
        decimals=(6, 5, 6),
        short="Gains by noise",
        spread=words.OVER_PARTS,
        reasons=(
            StudyReason(words.DEGREES, "candidate", "noise"),
            StudyReason("Where the source's zeta of 0.07 came from.", "open", ""),
        ),
    )


def time_table(take: Take) -> StudyTable:
    """How long each filter takes for a sample.

    Args:
        take: That they run over.
    """
    rows = []
    for name, kind in FILTERS.items():
        if name in MADE_FOR_HOURS or not all(take.samples.has(q) for q in kind.needs):
            continue
        made = kind()
        made.run(take.samples)  # compiled now
        seconds = []
        for _ in range(TIMES):
            begin = perf_counter()
            made.run(take.samples)
            seconds.append(perf_counter() - begin)
        each = 1e6 * np.array(seconds) / len(take.samples)
        rows.append(StudyRow(name, (float(np.median(each)), float(each.min()), float(each.max()))))
    return StudyTable(
        "time",
        "Time of one sample",
        ("median [µs]", "least [µs]", "most [µs]"),
        tuple(rows),
        words.TIME_HOW.format(times=TIMES),
        words.TIME,
        decimals=(2, 2, 2),
        short="Run time",
    )


def _findings(
    bench: StudyBench, tables: dict[str, StudyTable], found: list[Tuned], takes: list[Take]
) -> tuple[str, ...]:
    said = []
    if "identity" in tables and not bench.own:
        text, upstream = tables["identity"].rows[1:3]
        said.append(
            words.IDENTICAL.format(
                first=text.values[0],
                second=text.values[1],
                text=text.values[2],
                together=upstream.values[2],
                most=max(_number(row.values[3]) for row in tables["identity"].rows[1:]),
            )
        )
    if "difference" in tables:
        own = [
            _number(row.values[2])
            for row in tables["difference"].rows
            if row.label.endswith("gains by noise")
        ]
        spread = f"{min(own):.3f} to {max(own):.3f}"
        said.append(
            words.OWN_DISTANCE.format(spread=spread)
            if bench.own
            else words.DISTANCE.format(spread=spread, theirs=0.11535)
        )
    elif bench.own:
        said.append(words.NO_DEVICE)
    if "errors" in tables:
        table, told = tables["errors"], []
        for i, label in enumerate(table.columns[1:], start=1):
            values = [_number(row.values[i]) for row in table.rows]
            told.append(f"{label.removesuffix(' [deg]')}: {min(values):.1f} to {max(values):.1f}")
        said.append(f"RMS error over sensors and motions [deg]. {'; '.join(told)}.")
    if "changes" in tables:
        for name, pair in changes(found, takes).items():
            said.append(f"{name[0].upper()}{name[1:]}, gains of the other motions: {_told(pair)}.")
    return tuple(said)


def _told(pair: tuple[Change, Change]) -> str:
    shown = verdict(pair)
    spans = [
        f"{in_percent(change.interval[0])} to {in_percent(change.interval[1])} over {where}"
        for change, where in zip(pair, ("parts", "motions and sensors"), strict=True)
        if change.interval is not None
    ]
    what = f"{shown} error" if shown != "not shown" else "neither less nor more is shown"
    return f"{what} ({'; '.join(spans)}, 95 % intervals)"


def _number(value: Value) -> float:
    assert isinstance(value, int | float)
    return float(value)
