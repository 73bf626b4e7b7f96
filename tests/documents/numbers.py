"""Compute the tables of the documents anew: `make docs-numbers`.

Above each table of numbers a comment says what made it: `<!-- numbers: NAME -->` is a function of
this module, which writes the table; `<!-- numbers of: COMMAND -->` a campaign that prints them, by
the hour; `<!-- numbers stated in: FILE -->` constants of the program or of a source.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import yaml
from scipy.ndimage import uniform_filter1d

from testbench.estimation.calibration.attitude_aided import attitude_aided
from testbench.estimation.calibration.methods import METHODS
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.validation import validate
from testbench.model.misalignment import misalignment_errors
from testbench.model.statistics.polynomial import fit_quadratic
from testbench.pipeline.analyse import Result
from testbench.pipeline.bring_in import bring_in
from testbench.pipeline.request import (
    AnalysisRequest,
    ImportRequest,
    Request,
    RunRequest,
    TuneRequest,
)
from testbench.pipeline.run import run
from testbench.pipeline.tune import tune
from testbench.records.results.evaluation import Evaluation
from testbench.records.specs.shipped import shipped_folder
from tests.documents.blocks import documents
from tests.estimation.calibration.covering import NOISE
from tests.estimation.calibration.simulated import UP, part, poses_of, rng, turned
from tests.estimation.calibration.test_on_the_bench import HELD_OUT, poses_of_session

MARK = re.compile(r"<!-- numbers: (\w+) -->")
Rows = list[list[str]]


def table_of(rows: Rows) -> str:
    """Markdown of a table; the first row is its header."""
    lines = ["|" + "".join(f" {cell} |" if cell else " |" for cell in row) for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]]) + "\n"


def misalignment_fits(folder: Path) -> Rows:
    """Parabolas over the misalignment (docs/methods.md)."""
    rows = [["f [deg]", "a [1/deg]", "95 %", "c [deg]", "R²", "adjusted", "RMSE [deg]"]]
    misaligned = np.arange(-20.0, 21.0, 2.0)
    for flexion, digits in ((70.0, (5, 4, 4, 4, 2)), (60.0, (5, 5, 4, 4, 5))):
        errors = misalignment_errors("ZYX", "X", np.radians([flexion]), np.radians(misaligned))
        fit = fit_quadratic(misaligned, np.degrees(np.abs(errors[0, :, 1])))
        low, high = fit.interval("a")
        values = (fit.value("a"), fit.value("c"), fit.r_squared, fit.adjusted_r_squared, fit.rmse)
        a, *others = (f"{value:.{n}f}" for value, n in zip(values, digits, strict=True))
        rows.append([f"{flexion:g}", a, f"{low:.5f} to {high:.5f}", *others])
    return rows


TRIALS = {
    "02": "slow rotation",
    "05": "slow rotation with breaks",
    "14": "slow translation with breaks",
    "16": "fast translation",
    "30": "magnet beside it",
}


def tuning_on_broad(folder: Path) -> Rows:
    """Madgwick's beta on five trials of BROAD (docs/tuning.md)."""
    data = Path(os.environ["TESTBENCH_DATA"]) / "broad"
    sessions = []
    for trial in TRIALS:
        (file,) = data.glob(f"{trial}_*.mat")
        asked = ImportRequest(format="broad", files=(str(file),), out=str(folder / trial))
        sessions.append(str(bring_in(asked).path))
    found = tune(
        TuneRequest(
            sessions=tuple(sessions),
            filter="madgwick_marg",
            tuned=("beta",),
            leave_one_out=True,
            out=str(folder / "beta.json"),
        )
    )
    columns = []
    for one in found.sessions:
        assert one.own_parameters is not None
        own_beta = one.own_parameters["beta"]
        columns.append((one.default_value, one.value, one.own_value, own_beta, one.left_out_value))
    values = np.array(columns, float)
    rows = [
        [
            "trial",
            "default, 0.041",
            f"one set for all, {found.parameters['beta']:.3f}",
            "own optimum",
            "own beta [rad/s]",
            "by the set of the other four",
        ]
    ]
    for (trial, what), own in zip(TRIALS.items(), values, strict=True):
        numbers = [f"{own[i]:.3f}" if i == 3 else f"{own[i]:.2f}" for i in range(5)]
        rows.append([f"{trial}, {what}", *numbers])
    mean = values.mean(axis=0)
    return [*rows, ["mean", *("" if i == 3 else f"{mean[i]:.2f}" for i in range(5))]]


def worth_of_the_arm(folder: Path) -> Rows:
    """What the arm's orientation adds to the norm of gravity (docs/calibration.md)."""
    rows = [
        [
            "",
            "predicted by the covariances",
            "measured",
            "direction on held-out poses, norm only",
            "arm",
        ]
    ]
    for count, sd in ((12, ARM_SD), (24, ARM_SD), (48, ARM_SD), (24, 0.0)):
        title = f"{count} poses{'' if sd else ', arm without error'}"
        rows.append([title, *_worth(count, sd)])
    return rows


ARM_SD = float(np.radians(0.03))
CALIBRATIONS = 300


def _worth(count: int, direction_sd: float) -> list[str]:
    """Ratios of the bias' variance by the norm to that by the arm, and directions of both."""
    forces, (response, bias) = turned(UP, count), part()
    others = turned(UP, 24, seed=8)
    draw = rng(3)
    stated, off, turns = [], [], []
    for _ in range(CALIBRATIONS):
        poses = poses_of(forces, response, bias, NOISE, draw, direction_sd)
        by_norm, by_arm = norm_only(poses), attitude_aided(poses)
        stated.append([by_norm.fits[0].sd[6:], by_arm.fits[0].sd[9:]])
        off.append([by_norm.bias - bias, by_arm.bias - bias])
        corrected = [own.apply(others @ response.T + bias) for own in (by_norm, by_arm)]
        turns.append([_apart_deg(own, others) for own in corrected])
    variances = [np.mean(np.square(values), axis=(0, 2)) for values in (stated, off)]
    ratios = [f"{own[0] / own[1]:.2g}" for own in variances]
    by_norm_deg, by_arm_deg = np.sqrt(np.mean(np.square(turns), axis=0))
    return [*ratios, f"{by_norm_deg:.2f} deg", f"{by_arm_deg:.3f} deg"]


def _apart_deg(a: np.ndarray, b: np.ndarray) -> float:
    """RMS angle between vectors, shape (n, 3) each [deg]."""
    across = np.linalg.norm(np.cross(a, b), axis=1)
    angle = np.arctan2(across, np.sum(a * b, axis=1))
    return float(np.degrees(np.sqrt(np.mean(angle**2))))


OF_FIELD = {
    "elbow_flexion": "static",
    "elbow_dynamic": "dynamic",
    "magnetic_passage": "dynamic",
    "magnetic_passage, stay": "static",
}
FIELD_FILTERS = ["ecompass", "madgwick_marg", "fusion_9d", "mahony_marg", "ekf", "mekf", "vqf_9d"]


def disturbed_field(folder: Path) -> Rows:
    """Heading errors of filters in a disturbed field (docs/filters.md)."""
    found = {
        protocol: _evaluated(protocol, folder)
        for protocol in dict.fromkeys(name.partition(",")[0] for name in OF_FIELD)
    }
    unrejected = _evaluated(
        "magnetic_passage", folder, "vqf_9d", parameters={"vqf_9d": {"mag_rejection": 0.0}}
    )
    rows = [
        [
            "",
            "`elbow_flexion` (poses)",
            "`elbow_dynamic` (sweeps)",
            "`magnetic_passage`, passes",
            "`magnetic_passage`, stay",
        ]
    ]
    places = [(found[name.partition(",")[0]], motion) for name, motion in OF_FIELD.items()]
    rows.append(["heading of the field", *(_of_field(*place) for place in places)])
    for name in FIELD_FILTERS:
        title = "`ecompass`, `triad`" if name == "ecompass" else f"`{name}`"
        rows.append([title, *(_headings(*place, name) for place in places)])
    again = [_headings(unrejected, motion, "vqf_9d") for motion in ("dynamic", "static")]
    rows.append(["`vqf_9d`, `mag_rejection` 0", "", "", *again])
    sections = (None, None, "passes", "stay")
    totals = [
        ", ".join(_joint_total(result, section, name) for name in ("ecompass", "vqf_9d"))
        for (result, _), section in zip(places, sections, strict=True)
    ]
    return [*rows, ["total error of the joint: `ecompass`, `vqf_9d`", *totals]]


def _evaluated(
    protocol: str,
    folder: Path,
    *filters: str,
    parameters: dict[str, dict[str, float]] | None = None,
    seed: int = 0,
) -> Result:
    """A run of a protocol."""
    asked = Request(
        run=RunRequest(protocol=protocol, logs=str(folder), seed=seed),
        analysis=AnalysisRequest(
            filters=filters or None, parameters=parameters or {}, report=False
        ),
    )
    return run(asked)


def _of_field(result: Result, motion: str) -> str:
    return _pair(
        [row.field_heading_rms_deg for row in _moved(result.evaluation.magnetic_field, motion)]
    )


def _headings(result: Result, motion: str, name: str) -> str:
    """RMS heading errors of the sensors by a filter; empty where it was not run."""
    return _pair(_heading_errors(result.evaluation, motion, name))


def _heading_errors(evaluation: Evaluation, motion: str, name: str) -> list[float]:
    own = [
        row for row in evaluation.orientation_summary if (row.filter, row.part) == (name, "heading")
    ]
    return [row.errors.rmse_deg for row in _moved(own, motion)]


def _moved(rows: Sequence[Any], motion: str) -> list[Any]:
    """A row of each sensor: of the wanted motion, or of all where it had only one."""
    by_sensor: dict[str, dict[str, Any]] = {}
    for row in rows:
        by_sensor.setdefault(row.sensor, {})[row.motion] = row
    return [own.get(motion, own["all"]) for own in by_sensor.values()]


def _joint_total(result: Result, section: str | None, name: str) -> str:
    """RMS error of the joint's rotation, in a section or in all that is judged [deg]."""
    (series,) = (s for key, s in result.evaluation.series.items() if key.startswith("joint_"))
    judged = series["judged"].astype(bool)
    if section is not None:
        steps = [step for step in result.session.steps if step.section == section]
        time_ns = series["host_time_ns"]
        judged &= (time_ns >= steps[0].start_ns) & (time_ns <= steps[-1].end_ns)
    error = series[f"{name}_total_error_rad"][judged]
    return f"{np.degrees(np.sqrt(np.nanmean(error**2))):.2f}"


def _pair(values: Sequence[float]) -> str:
    digits = 2 if values and max(values) < 1.5 else 1
    return ", ".join(f"{value:.{digits}f}" for value in values)


COST_FILTERS = ["ecompass", "madgwick_marg", "mahony_marg", "vqf_9d", "vqf_6d"]
ELBOWS = {"elbow_flexion": "static", "elbow_dynamic": "dynamic"}


def cost_of_the_field(folder: Path) -> Rows:
    """What the arm's field costs in the elbow protocols (docs/filters.md)."""
    titles = [""]
    for protocol in ELBOWS:
        titles += [f"`{protocol}`: joint, total", "arm, heading", "forearm, heading"]
    rows = [titles]
    costs = {protocol: _costs(protocol, motion, folder) for protocol, motion in ELBOWS.items()}
    for name in COST_FILTERS:
        title = "`ecompass`, `triad`" if name == "ecompass" else f"`{name}`"
        both = [costs[protocol][name] for protocol in ELBOWS]
        cells = [f"{a:.2f} → {b:.2f}" for own in both for a, b in zip(*own, strict=True)]
        rows.append([title, *cells])
    return rows


def _costs(protocol: str, motion: str, folder: Path) -> dict[str, list[np.ndarray]]:
    """RMS errors without and with the arm's field, mean of the seeds: joint, arm, forearm."""
    pairs = _with_and_without(protocol)
    return {
        name: [
            np.mean([_errors(pair[i], motion, name) for pair in pairs], axis=0) for i in range(2)
        ]
        for name in COST_FILTERS
    }


@cache
def _with_and_without(protocol: str) -> list[tuple[Evaluation, Evaluation]]:
    """Runs without the arm's field and with it, seeds 0 to 2: the noise of both is the same."""
    found = []
    with tempfile.TemporaryDirectory() as made:
        for field in ("false", "true"):
            file = Path(made) / field / f"{protocol}.yaml"
            copytree(shipped_folder("protocols"), file.parent)
            text = file.read_text(encoding="utf-8")
            assert "\nenvironment" not in text
            field_text = f"\nenvironment: {{arm_magnetism: {field}}}\n"
            file.write_text(text + field_text, encoding="utf-8")
            logs = Path(made) / "logs"
            found.append(
                [
                    _evaluated(str(file), logs, *COST_FILTERS, seed=seed).evaluation
                    for seed in range(3)
                ]
            )
    return list(zip(*found, strict=True))


def _errors(evaluation: Evaluation, motion: str, name: str) -> list[float]:
    """RMS error of the joint's rotation, and of both headings [deg]."""
    series = evaluation.series["joint_elbow"]
    total = series[f"{name}_total_error_rad"][series["judged"].astype(bool)]
    whole = float(np.degrees(np.sqrt(np.nanmean(total**2))))
    return [whole, *_heading_errors(evaluation, motion, name)]


HALF_S, MINUTE = 0.5, 120
"""Samples are means of half seconds [s]; a minute has so many of them."""


def followed_by_filters(folder: Path) -> Rows:
    """What part of the field's disturbance the filters follow (docs/filters.md)."""
    rows = [
        [
            "",
            "`elbow_flexion`: against the minute around",
            "of the whole",
            "`elbow_dynamic`: against the minute around",
        ]
    ]
    for name in COST_FILTERS:
        title = "`ecompass`, `triad`" if name == "ecompass" else f"`{name}`"
        shares = [
            np.mean(
                [_followed(*pair, name, MINUTE) for pair in _with_and_without("elbow_flexion")]
            ),
            np.mean([_followed(*pair, name, None) for pair in _with_and_without("elbow_flexion")]),
            np.mean(
                [_followed(*pair, name, MINUTE) for pair in _with_and_without("elbow_dynamic")]
            ),
        ]
        rows.append([title, *(f"{share:.2f}" if share else "0" for share in shares)])
    return rows


def _followed(without: Evaluation, given: Evaluation, name: str, around: int | None) -> float:
    """Slope of what the field did to the forearm's heading by a filter on what it did to itself."""
    field, own = (
        _halves(given, key, column) - _halves(without, key, column)
        for key, column in (
            ("magnetic_forearm", "heading_rad"),
            ("orientation_forearm", f"{name}_heading_rad"),
        )
    )
    if around is not None:
        field, own = (x - uniform_filter1d(x, around, mode="nearest") for x in (field, own))
    # a field that deviates to one side turns the heading that follows it to the other
    return -float(np.sum(field * own) / np.sum(field**2))


def _halves(evaluation: Evaluation, key: str, column: str) -> np.ndarray:
    """Means of half seconds of a judged angle [rad]."""
    series = evaluation.series[key]
    judged = series["judged"].astype(bool) & np.isfinite(series[column])
    half = (series["host_time_ns"][judged] / (HALF_S * 1e9)).astype(int)
    number, row = np.unique(half, return_inverse=True)
    sums = np.bincount(row, np.unwrap(series[column][judged]))
    return np.asarray(sums / np.bincount(row))[: len(number)]


BENCH_METHODS = {
    "attitude_aided": "",
    "ferraris": "",
    "six_position": "",
    "rotational_nearest_bias": "",
    "rotational_3d": ", as published",
}


def calibrated_on_the_bench(folder: Path) -> Rows:
    """Methods on six poses, judged in others of another session (docs/calibration.md)."""
    columns = [_on_the_bench(preset, folder) for preset in ("xsens_dot", "matrix")]
    rows = [["", "Xsens DOT", "MATRIX"]]
    for name, how in BENCH_METHODS.items():
        rows.append([f"`{name}`{how}", *(column[name] for column in columns)])
    return [*rows, ["published, real sensors (table 5.4)", "21.2 mg", "26.2 mg"]]


def _on_the_bench(preset: str, folder: Path) -> dict[str, str]:
    found = []
    for poses in (None, HELD_OUT):
        file = folder / f"{preset}_{poses is None}" / "calibration_3d.yaml"
        copytree(shipped_folder("protocols"), file.parent)
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
        content["sensors"]["forearm"]["preset"] = preset
        content["estimate"]["filters"] = ["vqf_6d"]
        if poses is not None:
            steps = [{"move_to_deg": pose, "dwell_s": 5} for pose in poses]
            content["sections"][0]["steps"] = steps
        file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        asked = Request(
            run=RunRequest(protocol=str(file), logs=str(folder / "logs"), seed=4),
            analysis=AnalysisRequest(report=False),
        )
        found.append(poses_of_session(run(asked)))
    six, others = found
    told = {}
    for name in BENCH_METHODS:
        figures = validate(METHODS[name].function(six), others)
        worst = max(abs(figures[f"bias_{axis}_mg"]) for axis in "xyz")
        direction = figures["direction_rms_deg"]
        digits = (2, 3) if worst < 1 else (1, 2)
        told[name] = f"{worst:.{digits[0]}f} mg, {direction:.{digits[1]}f} deg"
    return told


GENERATORS: dict[str, Callable[[Path], Rows]] = {
    "misalignment_fits": misalignment_fits,
    "tuning_on_broad": tuning_on_broad,
    "worth_of_the_arm": worth_of_the_arm,
    "disturbed_field": disturbed_field,
    "cost_of_the_field": cost_of_the_field,
    "followed_by_filters": followed_by_filters,
    "calibrated_on_the_bench": calibrated_on_the_bench,
}
"""By the names in the comments."""
OF_DATA = {"tuning_on_broad"}
"""Those that need the public recordings."""


def renewed(text: str, name: str, rows: Rows) -> str:
    """A document with the table below a comment in place of the one that stood there."""
    pattern = rf"(<!-- numbers: {name} -->\n\n)(?:\|.*\n)+"
    return re.sub(pattern, lambda found: found[1] + table_of(rows), text)


def renew(names: Sequence[str]) -> list[Path]:
    """Compute tables anew; the documents that changed."""
    changed = []
    for page in documents():
        text = own = page.read_text(encoding="utf-8")
        for name in MARK.findall(text):
            if name in names:
                with tempfile.TemporaryDirectory() as folder:
                    own = renewed(own, name, GENERATORS[name](Path(folder)))
                print(f"{page.name}: {name}", flush=True)
        if own != text:
            page.write_text(own, encoding="utf-8")
            changed.append(page)
    return changed


if __name__ == "__main__":
    there = [n for n in GENERATORS if n not in OF_DATA or os.environ.get("TESTBENCH_DATA")]
    for file in renew(sys.argv[1:] or there):
        print(f"changed: {file}")
