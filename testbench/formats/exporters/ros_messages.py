"""The ROS 2 messages that exports hold: their definitions, and the layout of their bytes."""

from __future__ import annotations

from testbench.formats.exporters.cdr import CdrLayout

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
TRANSFORM = "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
STAMPED = "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"


def _schema(text: str, **parts: str) -> str:
    """A definition with those it needs, as rosbag2 concatenates them."""
    sections = [
        f"{'=' * 80}\nMSG: {name.replace('__', '/')}\n{part}" for name, part in parts.items()
    ]
    return "".join([text, *sections])


IMU = "sensor_msgs/msg/Imu"
MAGNETIC_FIELD = "sensor_msgs/msg/MagneticField"
JOINT_STATE = "sensor_msgs/msg/JointState"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"

SCHEMAS = {
    IMU: _schema(
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
        std_msgs__Header=HEADER,
        builtin_interfaces__Time=TIME,
        geometry_msgs__Quaternion=QUATERNION,
        geometry_msgs__Vector3=VECTOR,
    ),
    MAGNETIC_FIELD: _schema(
        "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] "
        "magnetic_field_covariance\n",
        std_msgs__Header=HEADER,
        builtin_interfaces__Time=TIME,
        geometry_msgs__Vector3=VECTOR,
    ),
    JOINT_STATE: _schema(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] "
        "effort\n",
        std_msgs__Header=HEADER,
        builtin_interfaces__Time=TIME,
    ),
    TF_MESSAGE: _schema(
        "geometry_msgs/TransformStamped[] transforms\n",
        geometry_msgs__TransformStamped=STAMPED,
        std_msgs__Header=HEADER,
        builtin_interfaces__Time=TIME,
        geometry_msgs__Transform=TRANSFORM,
        geometry_msgs__Vector3=VECTOR,
        geometry_msgs__Quaternion=QUATERNION,
    ),
}
"""Text of each definition, by type."""


def imu_layout(frame: str) -> CdrLayout:
    """sensor_msgs/msg/Imu: slots q_xyzw, q_covariance (9), rate, force.

    Covariances of zeros are unknown, by its definition.
    """
    layout = _header(CdrLayout(), frame).slot("q_xyzw", "<f8", 4).slot("q_covariance", "<f8", 9)
    layout.slot("rate", "<f8", 3).constant("<f8", [0.0] * 9)
    return layout.slot("force", "<f8", 3).constant("<f8", [0.0] * 9)


def magnetic_field_layout(frame: str) -> CdrLayout:
    """sensor_msgs/msg/MagneticField: slot field [T].

    A covariance of zeros is unknown, by its definition.
    """
    return _header(CdrLayout(), frame).slot("field", "<f8", 3).constant("<f8", [0.0] * 9)


def joint_state_layout(frame: str, joints: list[str]) -> CdrLayout:
    """sensor_msgs/msg/JointState without efforts: slots position, velocity."""
    layout = _header(CdrLayout(), frame).constant("<u4", [len(joints)])
    for joint in joints:
        layout.string(joint)
    for slot in ("position", "velocity"):
        layout.constant("<u4", [len(joints)]).slot(slot, "<f8", len(joints))
    return layout.constant("<u4", [0])


def transforms_layout(frames: list[tuple[str, str]]) -> CdrLayout:
    """tf2_msgs/msg/TFMessage of these (parent, child) frames.

    Slots are sec_i, nanosec_i, translation_i and q_xyzw_i.
    """
    layout = CdrLayout().constant("<u4", [len(frames)])
    for i, (parent, child) in enumerate(frames):
        _header(layout, parent, f"_{i}").string(child).slot(f"translation_{i}", "<f8", 3).slot(
            f"q_xyzw_{i}", "<f8", 4
        )
    return layout


def _header(layout: CdrLayout, frame: str, mark: str = "") -> CdrLayout:
    """std_msgs/msg/Header: slots sec, nanosec."""
    return layout.slot(f"sec{mark}", "<i4").slot(f"nanosec{mark}", "<u4").string(frame)
