"""Calibrations of simulated sensors whose errors the models of calibrations have not, and what is
said of them: one part after the other, each by its number.

The errors that a part was drawn with are rebuilt here from the seed; nothing of them is in the
session.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from testbench import execute, plan
from testbench.estimation.calibration.session_calibration import calibrate
from testbench.execution import RunOptions
from testbench.model.imu import TriadModel
from testbench.records.findings.finding import Severity
from testbench.records.results.calibration import TriadCalibration
from testbench.records.session.plan import Plan
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.robot import load_robot
from testbench.records.specs.shipped import shipped_folder

SENSOR = "forearm"
WARMING_MG_K, WARMING_S = 0.5, 60.0
RANGE_G = 2.0


@dataclass(frozen=True)
class Lack:
    """Something that a model has not.

    Attributes:
        kind: What.
        unit: Of its sizes.
        sizes: From small to the one that must be named.
        code: Of the finding that names it.
        triad: That the finding is about.
    """

    kind: str
    unit: str
    sizes: tuple[float, ...]
    code: str
    triad: str


LACKS = (
    Lack(
        "warming by 0.5 mg/K within 60 s, no thermometer",
        "K",
        (0.5, 1.0, 2.0, 5.0, 10.0),
        "calibration.trend",
        "accelerometer",
    ),
    Lack(
        "nonlinearity at a range of 2 g",
        "% of full scale",
        (0.02, 0.05, 0.1, 0.2, 0.5),
        "calibration.nonlinear",
        "accelerometer",
    ),
    Lack(
        "field of the arm and the bench",
        "times the shipped",
        (0.003, 0.01, 0.03, 0.1, 1.0),
        "calibration.field",
        "magnetometer",
    ),
    *(
        Lack(
            f"clipped {triad}",
            "% of the samples",
            (0.1, 0.2, 0.5, 1.0, 2.0),
            "calibration.clipped",
            triad,
        )
        for triad in ("accelerometer", "gyroscope", "magnetometer")
    ),
)
QUANTITIES = {"accelerometer": "acc", "gyroscope": "gyr", "magnetometer": "mag"}


def clean(seed: int) -> dict[str, Any]:
    """A part with nothing but what the models have, on an arm with wrong links: codes of the
    warnings, and chi-square over the number of parameters, by triad.
    """
    with session("clean", 0.0, seed) as recorded:
        found = calibrate(recorded, SENSOR).calibration
        squares = {
            triad: chi_square(found.triads[triad], recorded, seed, triad)
            for triad in ("accelerometer", "gyroscope")
            if triad in found.triads
        }
    codes = [own.code for own in found.findings if own.severity == Severity.WARNING]
    return {"codes": codes, "chi_square": squares}


def named(lack: Lack, size: float, seed: int) -> tuple[bool, list[str]]:
    """Whether a lack of some size is named, and the codes of other warnings.

    Args:
        lack: What the model has not.
        size: In its unit.
        seed: Of the part and the session.
    """
    with session(lack.kind, size, seed) as recorded:
        if lack.kind.startswith("clipped"):
            clipped(recorded, lack.triad, size / 100)
        found = calibrate(recorded, SENSOR).calibration
    warnings = [own for own in found.findings if own.severity == Severity.WARNING]
    own = [
        warning
        for warning in warnings
        if warning.code.startswith(lack.code)
        and lack.triad in (warning.where, warning.values.get("triad"))
    ]
    return bool(own), [warning.code for warning in warnings if warning not in own]


@contextmanager
def session(kind: str, size: float, seed: int) -> Iterator[Session]:
    """A recorded session of `calibration_optimal`, gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        made = plan_of(kind, 0.0 if kind.startswith("clipped") else size)
        yield execute(made, folder, seed, RunOptions(session_name=f"seed_{seed}"))


@cache
def plan_of(kind: str, size: float) -> Plan:
    """The plan of a part with a lack of some size, the arm's own magnetism left out."""
    shipped = shipped_folder("protocols") / "calibration_optimal.yaml"
    content = yaml.safe_load(shipped.read_text(encoding="utf-8"))
    environment: dict[str, Any] = {
        "joint_errors": True,
        "link_errors": True,
        "arm_magnetism": False,
    }
    accelerometer: dict[str, Any] = {}
    if kind.startswith("warming"):
        environment |= {"warm_up_deg_c": size, "warm_up_time_s": WARMING_S}
        accelerometer = {"bias_drift_sd_mg_k": WARMING_MG_K}
    elif kind.startswith("nonlinearity"):
        accelerometer = {
            "range_g": RANGE_G,
            "counts_per_g": 2**15 / RANGE_G,
            "nonlinearity_percent_fs": size,
        }
    elif kind.startswith("field"):
        environment["dipoles"] = [
            dipole.model_dump()
            | {
                "moment_A_m2": [size * moment for moment in dipole.moment_A_m2],
                "iron_radius_mm": size ** (1 / 3) * dipole.iron_radius_mm,  # its moment is cubic
            }
            for dipole in load_robot("ur3e").spec.magnetism.dipoles
        ]
    content["environment"] = environment
    content["sensors"][SENSOR]["parameters"] = {"accelerometer": accelerometer}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "protocol.yaml"
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
        return plan(file)


def clipped(recorded: Session, triad: str, share: float) -> None:
    """Let a session read a triad that is cut off, on a count, in a share of its samples."""
    key, samples = QUANTITIES[triad], recorded.imu(SENSOR)
    readings = getattr(samples, key)
    values = np.unique(readings)
    count = float(np.diff(values).min())
    limit = float(np.quantile(np.abs(readings).max(axis=1), 1 - share))
    limit = round(limit / count) * count
    less: ImuSamples = replace(samples, **{key: np.clip(readings, -limit, limit)})
    recorded.imu = lambda *_, **__: less  # type: ignore[method-assign]


def chi_square(found: TriadCalibration, recorded: Session, seed: int, triad: str) -> float:
    """Of all parameters of a triad together by their covariance, over their number."""
    parameters = recorded.analysis.sensors[SENSOR].imu()
    sheet = getattr(parameters, triad).triad()
    real = TriadModel(sheet, parameters.rate_hz, seed, SENSOR, triad).errors
    if triad == "accelerometer":
        truth = np.concatenate([real.matrix.reshape(-1), real.bias])
    else:
        inverse = np.linalg.inv(real.matrix)  # T K of Tedaldi, T with a diagonal of ones
        scale = np.diag(inverse)
        T = inverse / scale
        turns = [-T[0, 1], T[0, 2], T[1, 0], -T[1, 2], -T[2, 0], T[2, 1]]
        truth = np.concatenate([scale, turns, real.bias, real.g_matrix.reshape(-1)])
    fit = found.fits[0]
    off = fit.values - truth
    return float(off @ np.linalg.solve(fit.covariance, off)) / len(off)
