"""Foreign files: each importer turns a recording into a session like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.exceptions import FileProblems, NotFoundError, Problem

if TYPE_CHECKING:
    from testbench.clock import Clock
    from testbench.formats.options import Options
    from testbench.formats.recording import Recording
    from testbench.formats.truth.attach import TruthOptions
    from testbench.records.session.session import Session
    from testbench.records.specs.protocol import Body


@dataclass(frozen=True)
class Format:
    """A file format: where its importer lives, and a line for people.

    Attributes:
        module: Of the importer.
        description: For people.
        tried: On which files that none of our code wrote; "" where none could be had.
        with_options: Whether the importer takes options.
    """

    module: str
    description: str
    tried: str = ""
    with_options: bool = field(default=True)

    @property
    def line(self) -> str:
        """The description, and what the importer was tried on."""
        return f"{self.description}; {f'tried on {self.tried}' if self.tried else UNTRIED}"

    def read(self, files: list[Path], options: Options) -> Recording:
        """Read files with the importer's own function `read`."""
        function: Callable[..., Recording] = import_module(self.module).read
        return function(files, options) if self.with_options else function(files)


UNTRIED = "never tried on a real file"
FORMATS = {
    "broad": Format(
        "testbench.formats.vendors.broad",
        "a BROAD trial (.mat or .hdf5): IMU and optical orientation at 285.7 Hz",
        "trials of the dataset",
        with_options=False,
    ),
    "xsens_dot": Format(
        "testbench.formats.vendors.xsens_dot",
        "Xsens DOT, CSV of the vendor's app in any payload mode, one file a sensor",
        "files of the vendor's app in one of the modes",
    ),
    "matrix": Format(
        "testbench.formats.vendors.matrix",
        "MATRIX, CSV with dateTime, acc_x..z [g], gyr_x..z [deg/s], one file a sensor",
    ),
    "imu_tk": Format(
        "testbench.formats.vendors.imu_tk",
        "a pair of text files (accelerometer, gyroscope) of time, x, y, z, raw counts or SI",
        "the pair of its example",
    ),
    "technaid": Format(
        "testbench.formats.vendors.technaid", "Technaid Tech-IMU, CSV with one or more sensors"
    ),
    "shimmer": Format(
        "testbench.formats.vendors.shimmer",
        "Shimmer, CSV or TSV exported by Consensys (calibrated columns)",
        "the first rows of published files",
    ),
    "ngimu": Format(
        "testbench.formats.vendors.ngimu",
        "x-io NGIMU, sensors.csv and quaternion.csv of one or more devices",
        "rows of the maker's example",
    ),
    "ximu3": Format(
        "testbench.formats.vendors.ximu3",
        "x-io x-IMU3, Inertial.csv, Magnetometer.csv, Quaternion.csv and others, or their folders",
        "rows of the maker's examples",
    ),
    "apdm": Format(
        "testbench.formats.vendors.apdm",
        "APDM Opal, HDF5 of Mobility Lab or Motion Studio, one or more sensors",
    ),
    "mtw": Format(
        "testbench.formats.vendors.mtw",
        "Xsens MTw or MTi, text exported by MT Manager, one file a sensor",
        "the first rows of published files",
    ),
    "mti_mat": Format(
        "testbench.formats.vendors.mti_mat",
        "MATLAB file with arrays acc, gyr, mag (Xsens MTi and others)",
    ),
    "rosbag": Format(
        "testbench.formats.vendors.rosbag",
        "ROS 1 bag, ROS 2 bag or MCAP with sensor_msgs/Imu, a sensor a topic",
        "bags of the writers of rosbags and mcap",
    ),
    "opensim_sto": Format(
        "testbench.formats.vendors.opensim_sto",
        "OpenSim .sto, a table of orientations, a sensor a column",
        "files of OpenSim's own writer",
    ),
    "generic": Format(
        "testbench.formats.vendors.generic",
        "any CSV, TSV or Parquet, by a mapping in YAML (--mapping)",
        "the session of imucal",
    ),
}

TRUTHS = {
    "C3D": "markers, and angles of joints (.c3d); tried on files of ezc3d's writer",
    "TRC": "markers (.trc); tried on files of OpenSim's writer",
    "Motive": f"markers and rigid bodies of OptiTrack, CSV; {UNTRIED}",
    "Vicon": f"markers and rigid bodies of Nexus or Tracker, CSV; {UNTRIED}",
    "Qualisys": f"markers or rigid bodies, TSV; {UNTRIED}",
    "OpenSim": "orientations of bodies (.sto), angles of joints (.mot, .sto); tried on files of "
    "OpenSim's writer",
    "ROS": "joint states, transforms, poses in a bag; tried on bags of the writer of rosbags",
    "table": "orientations (time_s, q_w, q_x, q_y, q_z), joint angles of a robot (--robot) or of a "
    "body (--truth-angle)",
}
"""What --truth reads, for people."""


def _with_body(recording: Recording, given: Body | None) -> None:
    """Give a recording the joints that a person names, and say what contradicts them all."""
    if given is None and recording.analysis.body is None:
        return
    from testbench.formats.body import attach_body, name_findings, refuse_contradictions

    if given is not None:
        attach_body(recording, given)
    if recording.analysis.body is not None:
        refuse_contradictions(recording.analysis.body)
        recording.findings += name_findings(recording.analysis.body)


def import_recording(
    name: str,
    files: list[Path],
    out: Path,
    clock: Clock,
    options: Options | None = None,
    truth: TruthOptions | None = None,
    body: Body | None = None,
) -> Session:
    """Turn foreign files into a session.

    Args:
        name: Of the format.
        files: To read.
        out: Folder of the session, to be made.
        clock: For the date.
        options: Answers to what the files leave open.
        truth: Where the truth is, if not in the files.
        body: Joints between the sensors, beside those of a mapping.

    Raises:
        NotFoundError: No such format; lists those that exist.
        InputError: Something is open or contradicts itself; says how to settle it. Nothing is
            written then.
        FileProblems: A file is not of this format; nothing is written then.
    """
    from testbench.formats.axes import find_axes
    from testbench.formats.dates import earliest, recorded_in_name, stated_date
    from testbench.formats.given_twice import copies, refuse_twice
    from testbench.formats.options import Options
    from testbench.formats.recording import write_recording
    from testbench.formats.remap import remap_axes
    from testbench.formats.signatures import with_other_format
    from testbench.records.findings.catalogue import finding

    if name not in FORMATS:
        raise NotFoundError("format", name, list(FORMATS))
    _check_out(out)
    refuse_twice(files)
    options = options if options is not None else Options()
    stated = None if options.recorded_at is None else stated_date(options.recorded_at)
    try:
        recording = FORMATS[name].read(files, options)
    except FileProblems as error:
        raise with_other_format(error, name) from None
    options.check_all_used(name)
    recording.recorded = (
        stated or recording.recorded or earliest(recorded_in_name(file) for file in files)
    )
    recording.findings += copies(files)
    if recording.recorded is None:
        recording.findings.append(finding("date.unknown"))
    for key, sensor in recording.sensors.items():
        head = sensor.head()
        if head is None or not len(head):
            raise FileProblems(files[0], [Problem(f"sensor '{key}' has no samples")])
    _say_so(recording, options)
    if options.axes is not None:
        remap_axes(recording, find_axes(options.axes), options.axes)
    _with_body(recording, body)
    if truth is not None:  # its angles are those of joints
        from testbench.formats.truth.attach import attach_truth

        attach_truth(recording, truth)
    return write_recording(recording, files, name, out, clock)


def _say_so(recording: Recording, options: Options) -> None:
    """What a person says of the samples goes with them."""
    recording.answered = frozenset(options.units)
    recording.simulated |= options.simulated
    if options.hemisphere is not None:
        for sensor in recording.sensors.values():
            sensor.details["hemisphere"] = options.hemisphere


def _check_out(out: Path) -> None:
    """Refuse at once what would fail after a long read."""
    from testbench.exceptions import SessionError

    if out.exists():
        raise SessionError(f"the session folder {out} cannot be made: it exists already")
