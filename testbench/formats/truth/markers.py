"""Truth of sensors from a motion capture export: a cluster of markers or a rigid body each."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.recording import Recording
from testbench.formats.tables.text_table import head_of
from testbench.formats.truth.c3d import read_c3d
from testbench.formats.truth.clusters import LEAST_MARKERS, ClusterFit, fit_cluster
from testbench.formats.truth.motive import is_motive, read_motive
from testbench.formats.truth.qualisys import is_qualisys, read_qualisys
from testbench.formats.truth.reference import reference_truth
from testbench.formats.truth.sto_truth import is_sto, read_sto
from testbench.formats.truth.tracked import Tracked
from testbench.formats.truth.trc import is_trc, read_trc
from testbench.formats.truth.vicon import is_vicon, read_vicon
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Pose
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.specs.strict import Placement

LISTED = 40
"""So many names are listed in a message."""
TEXTS = (
    (is_trc, read_trc),
    (is_motive, read_motive),
    (is_vicon, read_vicon),
    (is_qualisys, read_qualisys),
    (is_sto, read_sto),
)


def read_tracked(file: Path, rate: float | None) -> Tracked | None:
    """The export in a file, None if it is none that is known.

    Args:
        file: Any.
        rate: In place of its own [Hz], or None.

    Raises:
        FileProblems: It is an export, but damaged.
    """
    if file.suffix.lower() == ".c3d":
        return read_c3d(file)
    lines = head_of(file)
    return next((read(file, rate) for known, read in TEXTS if known(lines)), None)


def is_tracked(file: Path) -> bool:
    """Whether a file of text is such an export."""
    lines = head_of(file)
    return any(known(lines) for known, _ in TEXTS)


def give_truth(
    recording: Recording,
    tracked: Tracked,
    clusters: Mapping[str, list[str]],
    mountings: Mapping[str, Placement],
    shift_ns: int,
) -> None:
    """Give sensors the orientation of their clusters or bodies as truth.

    Args:
        recording: Whose sensors; is changed.
        tracked: The export.
        clusters: Markers of each sensor, or the one body that carries it.
        mountings: Sensor in the body ("" for all).
        shift_ns: Added to the export's times [ns].

    Raises:
        InputError: A sensor or its markers are not named, or are no cluster.
        NotFoundError: No such marker or body.
    """
    sensors = recording.sensors
    chosen = dict(clusters) or _by_name(list(sensors), tracked)
    if not chosen:
        raise InputError(
            "which markers carry the sensors? Answer with --truth-cluster SENSOR=M1,M2,M3 (three "
            f"or more), or SENSOR=BODY; the file has {_listing(tracked)}"
        )
    recording.findings.append(
        finding(
            "truth.tracked",
            system=tracked.system,
            frames=len(tracked.time_ns),
            first_s=shift_ns / NANOSECONDS,
        )
    )
    recording.findings += tracked.findings
    for name, marks in chosen.items():
        sensor = sensors[name]
        if len(marks) == 1:
            q = _body(tracked, marks[0])
            sensor.details |= {"truth": f"{tracked.system}, rigid body {marks[0]}"}
        else:
            fit = _cluster(tracked, name, marks)
            q, residual_mm = fit.q_world_from_cluster, round(1000 * fit.residual_rms_m, 4)
            recording.findings += _findings(fit, name, marks, residual_mm)
            sensor.details |= {
                "truth": f"{tracked.system}, cluster {', '.join(marks)}",
                "truth_residual_mm": residual_mm,
            }
            if np.isfinite(fit.sd_rad):
                sensor.details |= {
                    "truth_sd_deg": float(np.degrees(fit.sd_rad)),
                    "truth_sd_from": f"markers that scatter by {1000 * fit.noise_m:.2g} mm about "
                    "their shape, and how far they are apart",
                }
        mounting = mountings.get(name, mountings.get("", Placement()))
        set_truth(recording, name, tracked.time_ns + shift_ns, q, mounting)


def set_truth(
    recording: Recording,
    name: str,
    time_ns: np.ndarray,
    q_world_from_body: np.ndarray,
    mounting: Placement,
) -> None:
    """Give one sensor the orientation of a body as truth.

    Args:
        recording: Whose sensor; is changed.
        name: Of the sensor.
        time_ns: Host time, shape (n,), int64.
        q_world_from_body: Shape (n, 4), NaN where lost.
        mounting: Sensor in the body.
    """
    q_body_from_sensor = Pose.from_placement(mounting).quaternion
    recording.sensors[name].truth = reference_truth(
        name, time_ns, q_world_from_body, q_body_from_sensor, None, recording.findings
    )


def _by_name(sensors: list[str], tracked: Tracked) -> dict[str, list[str]]:
    """Bodies that are called like sensors, or the only one of a single sensor."""
    found = {
        sensor: [body]
        for sensor in sensors
        for body in tracked.bodies
        if body.rpartition(":")[2].strip().lower() in {sensor.lower(), f"{sensor.lower()}_imu"}
    }
    if not found and len(sensors) == len(tracked.bodies) == 1:
        return {sensors[0]: list(tracked.bodies)}
    return found


def _listing(tracked: Tracked) -> str:
    parts = []
    for word, names in (("bodies", tracked.bodies), ("markers", tracked.markers)):
        if names:
            more = ", ..." if len(names) > LISTED else ""
            parts.append(f"the {word} {', '.join(list(names)[:LISTED])}{more}")
    parts += [f"{name}, but {why}" for name, why in list(tracked.left_out.items())[:3]]
    return "; ".join(parts) or "none"


def _body(tracked: Tracked, name: str) -> np.ndarray:
    ends = [b for b in tracked.bodies if name in {b, b.rpartition(":")[2].strip()}]
    if name in tracked.bodies:
        return tracked.bodies[name]
    if len(ends) == 1:
        return tracked.bodies[ends[0]]
    if name in tracked.left_out:
        raise InputError(f"the body '{name}' cannot be the truth: {tracked.left_out[name]}")
    raise InputError(
        f"there is no rigid body '{name}', and a cluster needs {LEAST_MARKERS} markers or more; "
        f"the file has {_listing(tracked)}"
    )


def _cluster(tracked: Tracked, sensor: str, marks: list[str]) -> ClusterFit:
    """The orientations of a cluster."""
    listing = ", ".join(marks)
    if len(set(marks)) < max(len(marks), LEAST_MARKERS):
        raise InputError(
            f"--truth-cluster {sensor}={','.join(marks)}: an orientation needs {LEAST_MARKERS} "
            "different markers or more"
        )
    fit = fit_cluster(np.stack([tracked.marker(mark) for mark in marks], axis=1))
    if fit is None:
        raise InputError(
            f"--truth-cluster {sensor}: in no frame are three of the markers {listing} seen that "
            "are not on one line"
        )
    if not fit.rigid:
        median = 1000 * float(np.nanmedian(fit.residual_m))
        raise InputError(
            f"--truth-cluster {sensor}: the markers {listing} are no rigid cluster: they move by "
            f"{median:.1f} mm against one another, and are {1000 * fit.size_m:.0f} mm apart from "
            "their middle; name markers of one body"
        )
    return fit


def _findings(fit: ClusterFit, sensor: str, marks: list[str], residual_mm: float) -> list[Finding]:
    """How well the markers keep together, and which frames they lost."""
    found = [finding("tracking.cluster", sensor, markers=marks, residual_mm=residual_mm)]
    lost = fit.few + fit.in_line + fit.deformed
    if lost:
        found.append(
            finding(
                "tracking.lost",
                sensor,
                lost=lost,
                frames=len(fit.residual_m),
                markers=marks,
                few=fit.few,
                in_line=fit.in_line,
                deformed=fit.deformed,
            )
        )
    return found
