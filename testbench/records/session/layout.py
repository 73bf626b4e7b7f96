"""What the files of a session are called; docs/session_format.md says what is in them."""

from __future__ import annotations

MANIFEST, EVENTS = "manifest.json", "events.jsonl"
PROTOCOL, INCLUDED, ROBOT, URDF = "protocol.yaml", "included_", "robot.yaml", "robot.urdf"
"""Verbatim copies; each file that the protocol includes is called `INCLUDED` and its own name."""
CHAIN_ROBOT, CHAIN_URDF = "chain_robot.yaml", "chain_robot.urdf"
"""The model that an import was recorded of, where it does not ship with the bench."""
PLAN = "plan.parquet"
ARM = "arm"
"""The stream of the arm's samples."""
JOURNALS = "*.arrows"
"""Streams that were not turned into tables yet."""

ESTIMATE, ESTIMATE_SUMMARY = "estimate", "estimate.json"
"""A folder of tables, with the summary in it."""
EVALUATION, EVALUATION_SUMMARY = "evaluation", "evaluation.json"
"""A folder of tables, with the summary beside it."""
GAIT, GAIT_SUMMARY = "gait", "gait.json"
"""A folder of tables, with the summary in it; it follows from the samples alone."""
REPORT, PRINTED, RECORDING, EXPORT = "report.html", "report.pdf", "session.rrd", "export"
OF_AN_ESTIMATE = (EVALUATION_SUMMARY, PRINTED, REPORT, EVALUATION)
"""What follows from an estimate, in the order in which it is removed: nothing reads the folder
without its summary.
"""
DERIVED = (ESTIMATE, GAIT, *OF_AN_ESTIMATE)
"""What may be deleted and made again."""
CERTIFICATES = "certificates"
"""A folder of what was certified of the session, which is kept, not made again."""
SEAL = "manifest.json.sig"
"""A signature of the manifest."""
CYCLES = "cycles"
"""The table of the average cycles, in the folder of the evaluation."""
FOUND_CYCLES = "found_cycles"
"""The table of the average cycles that were found without a plan."""

_IMU, _TRUTH = "imu_", "truth_"
CHAIN = "chain_"
"""Tables of the chain filter begin so, and in exports what stands for it in place of a filter."""


def imu_stream(sensor: str) -> str:
    """The stream of a sensor's raw samples."""
    return f"{_IMU}{sensor}"


def sensor_of(stream: str) -> str | None:
    """The sensor whose raw samples a stream is; None for any other stream."""
    return stream.removeprefix(_IMU) if stream.startswith(_IMU) else None


def truth_stream(sensor: str) -> str:
    """The table of what a sensor went through."""
    return f"{_TRUTH}{sensor}"


def angles_stream(joint: str) -> str:
    """The table of a joint's angles according to another system."""
    return f"angles_{joint}"


def orientation_table(sensor: str) -> str:
    """The table of a sensor's orientations, or of their errors."""
    return f"orientation_{sensor}"


def joint_table(joint: str) -> str:
    """The table of a joint's angles, or of their errors."""
    return f"joint_{joint}"


def chain_table(section: str, state: str) -> str:
    """The table of the arm's joints by a chain filter, or of their errors."""
    return f"{CHAIN}{section}_{state}"


def magnetic_table(sensor: str) -> str:
    """The table of how far the field at a sensor was disturbed."""
    return f"magnetic_{sensor}"


def allan_table(sensor: str) -> str:
    """The table of a sensor's Allan deviations at rest."""
    return f"allan_{sensor}"


def difference_table(sensor: str) -> str:
    """The table of how far a sensor's orientations lie apart."""
    return f"difference_{sensor}"


def euler_table(sensor: str) -> str:
    """The table of a sensor's Euler angles."""
    return f"euler_{sensor}"


def motion_table(joint: str) -> str:
    """The table of a joint's angles that nobody judges."""
    return f"motion_{joint}"


def walk_table(sensor: str) -> str:
    """The table of where a sensor went."""
    return f"walk_{sensor}"


def table_file(name: str) -> str:
    """The file of a table, or of a stream that was closed."""
    return f"{name}.parquet"


def is_raw(name: str) -> bool:
    """Whether a file of a session's folder is a part of the recording, whose hash is stated."""
    others = {MANIFEST, SEAL, RECORDING, EXPORT, CERTIFICATES, *DERIVED}
    return not name.startswith(".") and name not in others


def is_read_raw(name: str) -> bool:
    """Whether a file is read as a part of the recording if it stands in a session's folder."""
    fixed = {EVENTS, PROTOCOL, ROBOT, URDF, CHAIN_ROBOT, CHAIN_URDF, PLAN, table_file(ARM)}
    streams = (imu_stream(""), truth_stream(""), angles_stream(""))
    return name in fixed or (name.endswith(table_file("")) and name.startswith(streams))


def journal_file(stream: str) -> str:
    """The file of a stream that is being written."""
    return f"{stream}.arrows"
