"""Whether the stated uncertainty of the joint angles of a person covers the true ones."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from testbench import estimate
from testbench.clock import SystemClock
from testbench.formats import import_recording
from testbench.formats.exporters.source import ExportSource
from testbench.formats.options import Options
from testbench.model import rotation
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.system import walking_limb

COUNT = 100
FILTERS = ("vqf_6d", "vqf_9d")
WAYS = ("standing", "functional", "stated")
JOINTS = {"hip": ("pelvis", "thigh"), "knee": ("thigh", "shank"), "ankle": ("shank", "foot")}
EACH = 10
"""One of so many instants counts: errors last."""
COVERED = 1.96


def bench_joints(count: int = COUNT) -> bool:
    """Simulate persons with seeds from 0, and print how often a true angle lies within 1.96
    standard uncertainties of the estimated one; whether that is 90 to 98 % of each joint each way.
    """
    found = resumed("joints_of_people", count, _persons)
    rows: list[list[str | Text]] = []
    sound = True
    for way in WAYS:
        for joint in JOINTS:
            for key in FILTERS:
                own = [person[f"{way} {joint} {key}"] for person in found]
                known = [entry for entry in own if entry is not None]
                if not known:
                    rows.append([Text(way), Text(joint), Text(key), "0", *["-"] * 6])
                    continue
                within = 100 * np.mean([entry["within"] for entry in known], axis=0)
                rms = np.sqrt(np.mean([entry["square"] for entry in known], axis=0))
                whole = float(np.mean(within))
                sound &= 90 <= whole <= 98
                rows.append(
                    [
                        Text(way),
                        Text(joint),
                        Text(key),
                        f"{len(known)}",
                        f"{whole:.1f}",
                        *(f"{value:.0f}" for value in within),
                        " ".join(f"{value:.1f}" for value in rms),
                        f"{np.mean([entry['sd'] for entry in known]):.1f}",
                    ]
                )
    show(
        f"Joint angles of {count} persons who stand and walk",
        [
            "placed by",
            "joint",
            "filter",
            "computed",
            "within [%]",
            "first [%]",
            "second [%]",
            "third [%]",
            "RMS errors [deg]",
            "mean sd [deg]",
        ],
        rows,
        "target: 90 to 98 % within 1.96 standard uncertainties",
    )
    return sound


def _persons(seeds: range) -> Iterator[dict[str, Any]]:
    for seed in seeds:
        yield person(seed)


def mapping_text() -> str:
    """Joints by every way, as a mapping has them."""
    lines = [
        f"  {joint}_{way}_r: {{proximal: {ends[0]}, distal: {ends[1]}, "
        f"definition: {joint}, alignment: {way}}}\n"
        for way in WAYS
        for joint, ends in JOINTS.items()
    ]
    filters = ", ".join(FILTERS)
    return (
        "joints:\n" + "".join(lines) + f"alignment: {{axes_sd_deg: {walking_limb.POSTURE_DEG}, "
        f"stated_sd_deg: {walking_limb.SKIN_DEG}}}\n"
        f"estimate: {{filters: [{filters}], align: none, calibrate: none, align_clock: false}}\n"
    )


def person(seed: int) -> dict[str, Any]:
    """Squares of the errors [deg^2] and how many are covered, by way, joint and filter."""
    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        scene = walking_limb.walk(seed)
        mapping, files = walking_limb.export(scene, Path(folder) / "files", mapping_text())
        session = import_recording(
            "generic", files, Path(folder) / "session", SystemClock(), Options(str(mapping))
        )
        estimated = estimate(session)
        source = ExportSource(session, estimated)
        for way in WAYS:
            for joint in JOINTS:
                name = f"{joint}_{way}_r"
                own = estimated.joints[name]
                (true,) = source.true_angles(name, own.host_time_ns).values()
                for key in FILTERS:
                    result[f"{way} {joint} {key}"] = _judged(own, (key, f"isb_{joint}"), true)
    return result


def _judged(own: Any, key: tuple[str, str], true: np.ndarray) -> dict[str, Any] | None:
    if key not in own.angles:
        return None
    error = rotation.wrap(own.angles[key] - true)[::EACH]
    sd = own.sd[key][::EACH]
    known = np.isfinite(error).all(axis=1)
    error, sd = error[known], sd[known]
    return {
        "within": np.mean(np.abs(error) <= COVERED * sd, axis=0).tolist(),
        "square": (np.degrees(1) ** 2 * np.mean(error**2, axis=0)).tolist(),
        "sd": float(np.degrees(np.mean(sd))),
    }


if __name__ == "__main__":
    sys.exit(not bench_joints(count_of(COUNT, __doc__)))
