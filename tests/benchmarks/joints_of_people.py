"""Whether the stated uncertainty of the joint angles of a person covers the true ones."""

from __future__ import annotations

import itertools
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
from testbench.records.results.estimate import Estimate
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.system import walking_limb

COUNT = 100
FILTERS = ("vqf_6d", "vqf_9d")
WAYS = ("standing", "functional", "stated")
JOINTS = {"hip": ("pelvis", "thigh"), "knee": ("thigh", "shank"), "ankle": ("shank", "foot")}
CHAIN, STATE = "chain", "chain_motion_kinematic"
"""The fourth way, by the state that a mapping gets which names none."""
COORDINATES = {
    "hip": ["hip_r_flexion", "hip_r_adduction", "hip_r_rotation"],
    "knee": ["knee_r_flexion"],
    "ankle": ["ankle_r_flexion", "ankle_r_inversion", "ankle_r_rotation"],
}
"""The chain's joints of each. It turns about x and y before z (model: forwards, up, to the right),
so that its truth is of that sequence; its knee is a hinge.
"""
SEQUENCE, ORDER = "XYZ", [2, 0, 1]
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
    for way, key in [*itertools.product(WAYS, FILTERS), (CHAIN, STATE)]:
        for joint in JOINTS:
            row, covered = _row(way, joint, key, [own[f"{way} {joint} {key}"] for own in found])
            rows.append(row)
            sound &= covered
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


def _row(
    way: str, joint: str, key: str, found: list[dict[str, Any] | None]
) -> tuple[list[str | Text], bool]:
    """A row of the table, and whether it meets the target, which one of nothing does."""
    known = [entry for entry in found if entry is not None]
    row: list[str | Text] = [Text(way), Text(joint), Text(key), str(len(known))]
    if not known:
        return [*row, *["-"] * 6], True
    within = 100 * np.mean([entry["within"] for entry in known], axis=0)
    rms = np.sqrt(np.mean([entry["square"] for entry in known], axis=0))
    whole = float(np.mean(within))
    parts = [f"{value:.0f}" for value in within] + ["-"] * (3 - len(within))
    errors = " ".join(f"{value:.1f}" for value in rms)
    sd = f"{np.mean([entry['sd'] for entry in known]):.1f}"
    return [*row, f"{whole:.1f}", *parts, errors, sd], 90 <= whole <= 98


def _persons(seeds: range) -> Iterator[dict[str, Any]]:
    for seed in seeds:
        yield person(seed)


def mapping_text(scene: walking_limb.Walk) -> str:
    """Joints by every way, as a mapping has them."""
    lines = [
        f"  {joint}_{way}_r: {{proximal: {ends[0]}, distal: {ends[1]}, "
        f"definition: {joint}, alignment: {way}, compare: [{{sequence: {SEQUENCE}}}]}}\n"
        for way in WAYS
        for joint, ends in JOINTS.items()
    ]
    filters = ", ".join(FILTERS)
    return (
        "joints:\n" + "".join(lines) + f"alignment: {{axes_sd_deg: {walking_limb.POSTURE_DEG}, "
        f"stated_sd_deg: {walking_limb.SKIN_DEG}}}\n"
        f"estimate:\n  filters: [{filters}]\n  align: none\n  calibrate: none\n"
        "  align_clock: false\n" + walking_limb.chain_text(scene)
    )


def person(seed: int) -> dict[str, Any]:
    """Squares of the errors [deg^2] and how many are covered, by way, joint and filter.

    They walk on a treadmill, for the chain's base does not travel.
    """
    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        scene = walking_limb.walk(seed, speed=0.0)
        mapping, files = walking_limb.export(scene, Path(folder) / "files", mapping_text(scene))
        session = import_recording(
            "generic", files, Path(folder) / "session", SystemClock(), Options(str(mapping))
        )
        estimated = estimate(session)
        source = ExportSource(session, estimated)
        for way, joint in itertools.product(WAYS, JOINTS):
            name, label = f"{joint}_{way}_r", f"isb_{joint}"
            own = estimated.joints[name]
            true = source.true_angles(name, own.host_time_ns)[label]
            for key in FILTERS:
                found = None
                if (key, label) in own.angles:
                    found = _judged(own.angles[key, label], own.sd[key, label], true)
                result[f"{way} {joint} {key}"] = found
        for joint in JOINTS:
            result[f"{CHAIN} {joint} {STATE}"] = _of_chain(joint, estimated, source)
    return result


def _of_chain(joint: str, estimated: Estimate, source: ExportSource) -> dict[str, Any] | None:
    """The same by the chain filter; None where it says that it is lost."""
    (chain,) = estimated.chain
    if chain.facts["lost"]:
        return None
    true = source.true_angles(f"{joint}_{WAYS[0]}_r", chain.host_time_ns)
    of_knee = joint == "knee"
    wanted = true[f"isb_{joint}"][:, :1] if of_knee else true[SEQUENCE][:, ORDER]
    columns = [chain.joints.index(name) for name in COORDINATES[joint]]
    return _judged(chain.mean[:, 0, columns], chain.sd[:, 0, columns], wanted)


def _judged(angles: np.ndarray, sd: np.ndarray, true: np.ndarray) -> dict[str, Any]:
    error = rotation.wrap(angles - true)[::EACH]
    sd = sd[::EACH]
    known = np.isfinite(error).all(axis=1)
    error, sd = error[known], sd[known]
    return {
        "within": np.mean(np.abs(error) <= COVERED * sd, axis=0).tolist(),
        "square": (np.degrees(1) ** 2 * np.mean(error**2, axis=0)).tolist(),
        "sd": float(np.degrees(np.mean(sd))),
    }


if __name__ == "__main__":
    sys.exit(not bench_joints(count_of(COUNT, __doc__)))
