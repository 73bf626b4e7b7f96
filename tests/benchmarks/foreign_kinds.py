"""Whole files of every format that is imported, and of every kind of truth, in short."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from tests.formats import mocap
from tests.formats.bags import Ros, write_bag
from tests.formats.conftest import G, Motion, split_axes, table_in, turned
from tests.formats.foreign_arrays import mat73_with_objects, mat_with_objects
from tests.formats.mapped.mappings import PHONE
from tests.formats.test_broad import made_up
from tests.formats.test_truth_files import JOINTS, LINK
from tests.formats.test_vendor_files import (
    NEW,
    matrix_columns,
    mtw,
    ngimu,
    shimmer,
    technaid_pair,
)
from tests.formats.test_vendor_files import pair as imu_tk_pair
from tests.formats.test_xsens_dot import ABOVE, ticks

RATE = 50.0
MOTION = turned(300, RATE)
MARKERS = "foot=" + ",".join(mocap.NAMES)


@dataclass(frozen=True)
class Kind:
    """Whole files of one kind, and the words that import them.

    Attributes:
        format: Of the recording; "--guess" for one that is guessed at.
        words: After the format, to import them, beside files in the same folder.
        mutated: The files, or others of the folder, that are changed.
    """

    format: str
    words: tuple[str, ...]
    mutated: tuple[str, ...]


Maker = Callable[[Path], Kind]


def _plain(format_name: str, *names: str) -> Kind:
    """A kind whose files are all that its words name, and may all be changed."""
    return Kind(format_name, names, names)


def _inside(folder: Path, paths: list[Path]) -> list[str]:
    return [str(path.relative_to(folder)) for path in paths]


def _broad(suffix: str) -> Maker:
    def make(folder: Path) -> Kind:
        m, trial = MOTION, made_up(len(MOTION.t))
        trial |= {"imu_gyr": m.gyr, "imu_acc": m.acc, "imu_mag": m.mag, "opt_quat": m.q}
        trial["sampling_rate"] = RATE
        name = f"trial{suffix}"
        if suffix == ".mat":
            savemat(folder / name, trial)
        else:
            with h5py.File(folder / name, "w") as file:
                file.attrs["sampling_rate"] = trial.pop("sampling_rate")
                for key, value in trial.items():
                    file[key] = value
        return _plain("broad", name)

    return make


def _dot(groups: dict[str, np.ndarray]) -> Maker:
    """Two sensors of the vendor's app that are synchronised."""

    def make(folder: Path) -> Kind:
        n = len(MOTION.t)
        columns: dict[str, Any] = {"PacketCounter": np.arange(1, n + 1)}
        columns["SampleTimeFine"] = ticks(n, RATE)
        for pattern, array in groups.items():
            columns |= split_axes(pattern, array, "WXYZ"[4 - array.shape[1] :])
        columns["Status"] = np.zeros(n, dtype=int)
        names = [f"{side}_20260101_101010_123.csv" for side in ("left", "right")]
        for name in names:
            above = ABOVE.format(sync="Synced", rate=50)
            table_in(folder)(name, columns, above, form="%.9g")
        return _plain("xsens_dot", *names)

    return make


def _matrix(folder: Path) -> Kind:
    m = turned(400, 100.0)
    table_in(folder)("a.csv", matrix_columns(m, split_axes))
    return _plain("matrix", "a.csv")


def _imu_tk(counts: bool) -> Maker:
    def make(folder: Path) -> Kind:
        m = MOTION
        if counts:  # as the pair of its example
            acc, gyr = (np.round(32768 + k * v) for k, v in ((413, m.acc), (4800, m.gyr)))
            m = Motion(m.t, m.q, gyr, acc, m.mag)
        return _plain("imu_tk", *_inside(folder, imu_tk_pair(folder, m)))

    return make


def _technaid(folder: Path) -> Kind:
    files = technaid_pair(table_in(folder), split_axes, MOTION)
    return _plain("technaid", *_inside(folder, files))


def _shimmer(folder: Path) -> Kind:
    shimmer(table_in(folder), split_axes, MOTION)
    return _plain("shimmer", "shimmer.csv")


def _ngimu(folder: Path) -> Kind:
    files = ngimu(table_in(folder), split_axes, MOTION, "NGIMU", 2)
    return _plain("ngimu", *_inside(folder, files))


def _ximu3(folder: Path) -> Kind:
    m, write = MOTION, table_in(folder)
    stamp = {"Timestamp (us)": np.round(1e6 * m.t)}
    inertial = split_axes("Gyroscope {} (deg/s)", np.degrees(m.gyr))
    inertial |= split_axes("Accelerometer {} (g)", m.acc / G)
    write("Inertial.csv", stamp | inertial)
    write("Magnetometer.csv", stamp | split_axes("{} (a.u.)", m.mag / 40))
    write("Quaternion.csv", stamp | split_axes("{}", m.q, "WXYZ"))
    return _plain("ximu3", "Inertial.csv", "Magnetometer.csv", "Quaternion.csv")


def _apdm(folder: Path) -> Kind:
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("Sensors/1262")
        group["Accelerometer"], group["Gyroscope"] = MOTION.acc, MOTION.gyr
        group["Magnetometer"] = MOTION.mag
        group["Time"] = (1_600_000_000_000_000 + np.round(1e6 * MOTION.t)).astype("u8")
        group.create_group("Configuration").attrs["Label 0"] = np.bytes_(b"Foot\0\0")
        file["Processed/1262/Orientation"] = MOTION.q
    return _plain("apdm", "a.h5")


def _older_apdm(folder: Path) -> Kind:
    with h5py.File(folder / "b.h5", "w") as file:
        file.attrs["CaseIdList"] = np.array([b"SI-000133"])
        file.attrs["MonitorLabelList"] = np.array([b"Trunk\0\0"])
        group = file.create_group("SI-000133")
        group["Calibrated/Accelerometers"], group["Calibrated/Gyroscopes"] = MOTION.acc, MOTION.gyr
        group["Time"] = np.round(1e6 * MOTION.t).astype("u8")
    return _plain("apdm", "b.h5")


def _mtw(folder: Path) -> Kind:
    m = MOTION
    groups = {"Acc_{}": (m.acc, "XYZ"), "Gyr_{}": (m.gyr, "XYZ"), "Mag_{}": (m.mag / 40, "XYZ")}
    first = {"SampleTimeFine": (2**32 - 5000 + 200 * np.arange(len(m.t))) % 2**32}
    groups["Quat_q{}"] = (m.q, "0123")
    above = NEW.format(earth="ENU")
    return _plain("mtw", mtw(table_in(folder), split_axes, m, above, groups, first=first).name)


def _mti_mat(new: bool) -> Maker:
    def make(folder: Path) -> Kind:
        content = {"acc": MOTION.acc, "gyr": MOTION.gyr, "mag": MOTION.mag, "quat": MOTION.q}
        write = mat73_with_objects if new else mat_with_objects
        write(folder / "m.mat", content | {"t": MOTION.t[:, None]})
        return _plain("mti_mat", "m.mat")

    return make


def _sto_file(path: Path) -> None:
    head = "DataRate=50\nDataType=Quaternion\nversion=3\nendheader\ntime\tfoot_imu\n"
    rows = zip(MOTION.t, MOTION.q, strict=True)
    lines = (f"{t:.4f}\t" + ",".join(f"{x:.9f}" for x in row) for t, row in rows)
    path.write_text(head + "\n".join(lines) + "\n")


def _sto(folder: Path) -> Kind:
    _sto_file(folder / "a.sto")
    return _plain("opensim_sto", "a.sto")


def _bag(name: str) -> Maker:
    def make(folder: Path) -> Kind:
        ros = Ros.of(name.endswith(".bag"))
        messages = ros.imus(MOTION, "/foot/imu") + ros.fields(MOTION, "/foot/mag")
        messages += ros.transforms(MOTION.t, "map", "shank", MOTION.q)
        path = write_bag(folder / name, ros, messages)
        inside = [path] if path.is_file() else [p for p in path.iterdir() if p.is_file()]
        own = str(path.relative_to(folder))
        words = (own, "--truth", own, "--truth-cluster", "foot=shank")
        return Kind("rosbag", words, tuple(_inside(folder, inside)))

    return make


# --- the generic format

COLUMNS = {"t": MOTION.t} | split_axes("a{}", MOTION.acc, "xyz")
COLUMNS |= split_axes("w{}", MOTION.gyr, "xyz") | split_axes("m{}", MOTION.mag, "xyz")
COLUMNS |= split_axes("q{}", MOTION.q, "wxyz") | {"n": np.arange(len(MOTION.t), dtype=float)}
MAPPING = """\
description: a small recording
time: {column: t, unit: s}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2, full_scale: 16 g}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
    mag: {columns: [mx, my, mz], unit: uT}
    quaternion: {columns: [qw, qx, qy, qz], order: wxyz}
    counter: n
segments: {imu: forearm}
exclude: [{from_s: 0.5, to_s: 0.7, reason: touched}]
"""
IN_ROWS = """\
    truth: {columns: [pw, px, py, pz], order: wxyz, judged: n}
"""
IN_A_FILE = """\
    truth:
      file: optical.csv
      columns: [qx, qy, qz, qw]
      order: xyzw
      time: {column: ms, unit: ms}
      world: unknown
"""


def _generic(write: Callable[[Path], Any], name: str, mapped: bool = False) -> Maker:
    """By a mapping; where `mapped`, that is what is changed."""

    def make(folder: Path) -> Kind:
        write(folder / name)
        (folder / "map.yaml").write_text(MAPPING)
        changed = "map.yaml" if mapped else name
        return Kind("generic", (name, "--mapping", "map.yaml"), (changed,))

    return make


def _csv(path: Path) -> None:
    table_in(path.parent)(path.name, COLUMNS, form="%.7g")


def _european(path: Path) -> None:
    table_in(path.parent)(path.name, COLUMNS, separator=";", decimal=",", form="%.7g")
    path.write_bytes(path.read_text().encode("utf-16-le"))


def _hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for title, column in COLUMNS.items():
            file.create_dataset(title, data=column, chunks=True, compression="gzip")


def _truth_in_rows(folder: Path) -> Kind:
    truth = split_axes("p{}", MOTION.q, "wxyz")
    table_in(folder)("d.csv", COLUMNS | truth, form="%.7g")
    (folder / "map.yaml").write_text(MAPPING.replace("segments", IN_ROWS + "segments"))
    return Kind("generic", ("d.csv", "--mapping", "map.yaml"), ("d.csv",))


def _truth_in_a_file(folder: Path) -> Kind:
    _csv(folder / "d.csv")
    columns = {"ms": 1000 * MOTION.t[::2]} | split_axes("q{}", MOTION.q[::2], "wxyz")
    table_in(folder)("optical.csv", columns)
    (folder / "map.yaml").write_text(MAPPING.replace("segments", IN_A_FILE + "segments"))
    words = ("d.csv", "--mapping", "map.yaml")
    return Kind("generic", words, ("d.csv", "optical.csv"))


def _phone(folder: Path) -> Kind:
    m, write = MOTION, table_in(folder)
    write("Acc.csv", {"t": m.t} | split_axes("{}", m.acc, "xyz"))
    write("Gyro.csv", {"t": m.t + 0.004} | split_axes("{}", m.gyr, "xyz"))
    write("Mag.csv", {"t": m.t[::5]} | split_axes("{}", m.mag[::5], "xyz"))
    (folder / "map.yaml").write_text(PHONE)
    files = ("Acc.csv", "Gyro.csv", "Mag.csv")
    return Kind("generic", (*files, "--mapping", "map.yaml"), files)


def _guessed(write: Callable[[Path], Any], name: str) -> Maker:
    def make(folder: Path) -> Kind:
        write(folder / name)
        return _plain("--guess", name)

    return make


# --- truth in a file of its own


def _foot(folder: Path) -> None:
    """The sensor that a truth is of."""
    columns = {"Time (s)": MOTION.t} | split_axes("Acc{} (m/s^2)", MOTION.acc)
    table_in(folder)("foot.csv", columns | split_axes("Gyr{} (rad/s)", MOTION.gyr))


def _truth(name: str, write: Callable[[Path], Any], *words: str) -> Maker:
    def make(folder: Path) -> Kind:
        write(folder / name)
        _foot(folder)
        return Kind("technaid", ("foot.csv", "--truth", name, *words), (name,))

    return make


PLACED = mocap.placed(MOTION.q, 0.1e-3)


def _trc_file(path: Path) -> None:
    names = "\t\t\t".join(mocap.NAMES)
    head = "PathFileType\t4\t(X/Y/Z)\tw.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    head += f"50\t50\t{len(PLACED)}\t4\tmm\nFrame#\tTime\t{names}\t\t\n"
    head += "\t\t" + "\t".join(f"{a}{i}" for i in range(1, 5) for a in "XYZ") + "\n\n"
    rows = enumerate(1000 * PLACED.reshape(len(PLACED), -1))
    lines = (f"{i + 1}\t{i / RATE:.3f}\t" + "\t".join(f"{x:.4f}" for x in r) for i, r in rows)
    path.write_text(head + "\n".join(lines) + "\n")


def _orientations(path: Path) -> None:
    table_in(path.parent)(path.name, {"time_s": MOTION.t} | split_axes("q_{}", MOTION.q, "wxyz"))


def _joint_log(path: Path) -> None:
    angles = np.tile([0.0, -90, -90, -90, 90, 180], (len(MOTION.t), 1))
    angles[:, 3:] += np.degrees(np.cumsum(MOTION.gyr, axis=0)) / RATE
    columns = {"time_s": MOTION.t} | split_axes("J{}", angles, "123456")
    table_in(path.parent)(path.name, columns)


def _poses(folder: Path) -> Kind:
    """Two commanded poses, before the turns and after them."""
    angles = np.array([[0.0, -90, -90, -90, 90, 180], [20.0, -70, -90, -60, 90, 180]])
    np.savetxt(folder / "poses.txt", angles, fmt="%g", delimiter=", ")
    _foot(folder)
    robot = ("--robot", "ur3e", "--link", LINK, "--dwell", "1")
    return Kind("technaid", ("foot.csv", "--truth", "poses.txt", *robot), ("poses.txt",))


def _joint_states(path: Path) -> None:
    angles = np.tile(np.radians([0.0, -90, -90, -90, 90, 180]), (len(MOTION.t), 1))
    angles[:, 3:] += np.cumsum(MOTION.gyr, axis=0) / RATE
    ros = Ros.of(True)
    write_bag(path, ros, ros.joints(MOTION.t, JOINTS, angles))


CLUSTER = ("--truth-cluster", MARKERS)
ROBOT = ("--robot", "ur3e", "--link", LINK)
FREE = Rotation.from_quat(MOTION.q, scalar_first=True).apply(MOTION.acc.copy()) - [0, 0, G]
KINDS: dict[str, Maker] = {
    "broad, .mat": _broad(".mat"),
    "broad, .hdf5": _broad(".hdf5"),
    "xsens_dot, rates": _dot({"Acc_{}": MOTION.acc, "Gyr_{}": np.degrees(MOTION.gyr)}),
    "xsens_dot, quaternion": _dot({"Quat_{}": MOTION.q, "FreeAcc_{}": FREE}),
    "matrix": _matrix,
    "imu_tk, SI": _imu_tk(False),
    "imu_tk, counts": _imu_tk(True),
    "technaid": _technaid,
    "shimmer": _shimmer,
    "ngimu": _ngimu,
    "ximu3": _ximu3,
    "apdm": _apdm,
    "apdm, older": _older_apdm,
    "mtw": _mtw,
    "mti_mat, 5": _mti_mat(False),
    "mti_mat, 7.3": _mti_mat(True),
    "rosbag, .bag": _bag("a.bag"),
    "rosbag, .db3": _bag("folder"),
    "rosbag, .mcap": _bag("a.mcap"),
    "opensim_sto": _sto,
    "generic, CSV": _generic(_csv, "d.csv"),
    "generic, UTF-16 ;": _generic(_european, "d.csv"),
    "generic, Parquet": _generic(lambda p: pq.write_table(pa.table(COLUMNS), p), "d.parquet"),
    "generic, .mat 5": _generic(lambda p: mat_with_objects(p, COLUMNS), "d.mat"),
    "generic, .mat packed": _generic(lambda p: mat_with_objects(p, COLUMNS, True), "d.mat"),
    "generic, .mat 7.3": _generic(lambda p: mat73_with_objects(p, COLUMNS), "d.mat"),
    "generic, HDF5": _generic(_hdf5, "d.h5"),
    "generic, mapping": _generic(_csv, "d.csv", mapped=True),
    "generic, phone": _phone,
    "--guess, CSV": _guessed(_csv, "d.csv"),
    "--guess, HDF5": _guessed(_hdf5, "d.h5"),
    "--guess, .mat": _guessed(lambda p: mat_with_objects(p, COLUMNS), "d.mat"),
    "truth, table, same rows": _truth_in_rows,
    "truth, table of a mapping": _truth_in_a_file,
    "truth, OpenSim": _truth("t.sto", _sto_file, "--truth-cluster", "foot=foot_imu"),
    "truth, C3D": _truth("t.c3d", lambda p: mocap.write_c3d(p, RATE, PLACED), *CLUSTER),
    "truth, TRC": _truth("t.trc", _trc_file, *CLUSTER),
    "truth, Motive": _truth(
        "t.csv",
        lambda p: mocap.write_motive(p, RATE, PLACED, MOTION.q, "Quaternion"),
        *CLUSTER,
    ),
    "truth, Vicon": _truth(
        "t.csv", lambda p: mocap.write_vicon(p, RATE, PLACED, MOTION.q), *CLUSTER
    ),
    "truth, Qualisys 3D": _truth(
        "t.tsv", lambda p: mocap.write_qualisys(p, RATE, PLACED, True), *CLUSTER
    ),
    "truth, Qualisys 6D": _truth(
        "t.tsv",
        lambda p: mocap.write_bodies(p, RATE, MOTION.q, False),
        "--truth-cluster",
        "foot=Shank",
    ),
    "truth, table of orientations": _truth("t.csv", _orientations),
    "truth, table of joint angles": _truth("t.csv", _joint_log, *ROBOT, "--joint-unit", "deg"),
    "truth, ROS": _truth("t.bag", _joint_states, *ROBOT),
    "truth, table of poses": _poses,
}
