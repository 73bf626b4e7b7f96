"""A body with markers on it, as motion capture systems write it down."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

SHAPE = np.array([[0.0, 0.0, 0.0], [0.09, 0.0, 0.01], [0.02, 0.07, 0.0], [0.05, 0.04, 0.05]])
"""Markers in the body [m]."""
NAMES = ["S1", "S2", "S3", "S4"]


def placed(q: np.ndarray, noise_m: float = 0.0, seed: int = 3) -> np.ndarray:
    """The markers of a body that is turned and moved, shape (n, 4, 3) [m]."""
    t = np.arange(len(q))[:, None]
    path = np.hstack([0.3 * np.sin(t / 70), 0.2 * np.cos(t / 90), 1.0 + 0.1 * np.sin(t / 50)])
    turned = np.einsum("nij,kj->nki", Rotation.from_quat(q, scalar_first=True).as_matrix(), SHAPE)
    noise = noise_m * np.random.default_rng(seed).standard_normal(turned.shape)
    return turned + path[:, None] + noise


def off_deg(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angles by which orientations differ but for one constant turn of the body, shape (n,)."""
    known = np.isfinite(found).all(axis=1)
    turns = Rotation.from_quat(true[known], scalar_first=True).inv() * Rotation.from_quat(
        found[known], scalar_first=True
    )
    result = np.full(len(found), np.nan)
    result[known] = np.degrees((turns * turns.mean().inv()).magnitude())
    return result


def text(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6f}"


def write_motive(path: Path, rate: float, markers: np.ndarray, q: np.ndarray, form: str) -> Path:
    """One rigid body of quaternions (or Euler angles) and its labelled markers."""
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(
        ["Format Version", "1.23", "Take Name", "walk, one", "Export Frame Rate", f"{rate:.6f}"]
        + [
            "Total Exported Frames",
            str(len(markers)),
            "Rotation Type",
            form,
            "Length Units",
            "Meters",
            "Coordinate Space",
            "Global",
        ]
    )
    rows.writerow([])
    axes = ["X", "Y", "Z", "W"] if form == "Quaternion" else ["X", "Y", "Z"]
    body, many = len(axes) + 4, markers.shape[1]
    rows.writerow(["", "Type", *["Rigid Body"] * body, *["Marker"] * (3 * many)])
    labels = [name for name in NAMES for _ in range(3)]
    rows.writerow(["", "Name", *["Shank"] * body, *labels])
    rows.writerow(["", "ID", *["1"] * body, *[str(i) for i in range(3 * many)]])
    what = ["Rotation"] * len(axes) + ["Position"] * 3 + ["Mean Marker Error"]
    rows.writerow(["", "", *what, *["Position"] * (3 * many)])
    rows.writerow(["Frame", "Time (Seconds)", *axes, "X", "Y", "Z", "", *["X", "Y", "Z"] * many])
    for i, (row, turn) in enumerate(zip(markers, q, strict=True)):
        values = list(np.roll(turn, -1)) if form == "Quaternion" else [1.0, 2.0, 3.0]
        cells = [*values, 0.0, 0.0, 0.0, 0.0001, *row.ravel()]
        rows.writerow([i, f"{i / rate:.6f}", *map(text, cells)])
    path.write_text(out.getvalue())
    return path


def write_vicon(path: Path, rate: float, markers: np.ndarray, q: np.ndarray) -> Path:
    """A section of objects with quaternions, and one of trajectories."""
    lines = ["Objects", f"{rate:g}", ",,global:Shank,,,,,,"]
    lines += ["Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ", ",,,,,,mm,mm,mm"]
    lines += [
        f"{i + 1},0,{','.join(map(text, np.roll(turn, -1)))},0,0,0" for i, turn in enumerate(q)
    ]
    lines += ["", "Trajectories", f"{rate:g}", ",," + ",,,".join(f"Anna:{n}" for n in NAMES) + ",,"]
    lines += ["Frame,Sub Frame" + ",X,Y,Z" * len(NAMES), "," + ",mm" * (3 * len(NAMES))]
    lines += [
        f"{i + 1},0,{','.join(map(text, 1000 * row.ravel()))}" for i, row in enumerate(markers)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_qualisys(path: Path, rate: float, markers: np.ndarray, titles: bool) -> Path:
    lines = [f"NO_OF_FRAMES\t{len(markers)}", "NO_OF_CAMERAS\t8", f"NO_OF_MARKERS\t{len(NAMES)}"]
    lines += [f"FREQUENCY\t{rate:g}", "NO_OF_ANALOG\t0", "DESCRIPTION\t--"]
    lines += ["TIME_STAMP\t2023-03-01, 10:00:00\t1.5", "DATA_INCLUDED\t3D"]
    lines += ["MARKER_NAMES\t" + "\t".join(NAMES)]
    if titles:
        axes = "\t".join(f"{name} {axis}" for name in NAMES for axis in "XYZ")
        lines += [f"Frame\tTime\t{axes}"]
    for i, row in enumerate(markers):
        lead = f"{i + 1}\t{i / rate:.5f}\t" if titles else ""
        lines.append(lead + "\t".join(map(text, np.nan_to_num(1000 * row.ravel()))))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_trc(path: Path, rate: float, markers: np.ndarray) -> Path:
    count = f"{rate:g}\t{rate:g}\t{len(markers)}\t{len(NAMES)}\tmm"
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}"]
    lines += ["DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits", count]
    lines += ["Frame#\tTime\t" + "\t\t\t".join(NAMES)]
    lines += ["\t\t" + "\t".join(f"{c}{i}" for i in range(1, 5) for c in "XYZ"), ""]
    for i, row in enumerate(markers):
        cells = "\t".join(map(text, 1000 * row.ravel()))
        lines.append(f"{i + 1}\t{i / rate:.5f}\t{cells}")
    path.write_text("\n".join(lines) + "\n")
    return path


def write_bodies(path: Path, rate: float, q: np.ndarray, by_rows: bool) -> Path:
    """Rigid bodies of Qualisys; matrices column by column, or by rows as no one should."""
    titles = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *[f"Rot[{i}]" for i in range(9)]]
    lines = [f"NO_OF_FRAMES\t{len(q)}", "NO_OF_BODIES\t1", f"FREQUENCY\t{rate:g}"]
    lines += ["DATA_INCLUDED\t6D", "BODY_NAMES\tShank", "\t".join(titles)]
    turns = Rotation.from_quat(q, scalar_first=True)
    matrices = turns.as_matrix() if by_rows else turns.as_matrix().transpose(0, 2, 1)
    angles = turns.as_euler("XYZ", degrees=True)
    for angle, matrix in zip(angles, matrices.reshape(-1, 9), strict=True):
        lines.append("\t".join(map(text, [0.0, 0.0, 0.0, *angle, 0.1, *matrix])))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(path: Path, rate: float, markers: np.ndarray, unit: str = "mm") -> Path:
    """By ezc3d's own writer."""
    import ezc3d

    content = ezc3d.c3d()
    values = np.ones((4, markers.shape[1], len(markers)))
    values[:3] = (1000.0 if unit == "mm" else 1.0) * markers.transpose(2, 1, 0)
    content["parameters"]["POINT"]["RATE"]["value"] = [rate]
    content["parameters"]["POINT"]["LABELS"]["value"] = [f"Anna:{name}" for name in NAMES]
    content["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    content["data"]["points"] = values
    content.write(str(path))
    return path
