"""State of an emulated controller: modes, safety, program, registers, and RTDE variables.

Numbers of modes and bits: Universal Robots, Real-Time Data Exchange (RTDE) guide, tables of output
fields.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

REGISTERS = 48
"""Integer and double registers of each direction (PolyScope 5.3 and later)."""


class RobotMode(IntEnum):
    """RTDE `robot_mode`."""

    DISCONNECTED = 0
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    RUNNING = 7


class SafetyMode(IntEnum):
    """RTDE `safety_mode`."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9


class RuntimeState(IntEnum):
    """RTDE `runtime_state`."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


SAFETY_BITS = {
    SafetyMode.NORMAL: 1 << 0,
    SafetyMode.REDUCED: 1 << 1,
    SafetyMode.PROTECTIVE_STOP: 1 << 2 | 1 << 10,
    SafetyMode.RECOVERY: 1 << 3,
    SafetyMode.SAFEGUARD_STOP: 1 << 4 | 1 << 10,
    SafetyMode.SYSTEM_EMERGENCY_STOP: 1 << 5 | 1 << 7 | 1 << 10,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10,
    SafetyMode.VIOLATION: 1 << 8 | 1 << 10,
    SafetyMode.FAULT: 1 << 9 | 1 << 10,
}
"""RTDE `safety_status_bits` of each mode."""

VECTOR6 = [
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_pose",
    "target_TCP_speed",
    "joint_temperatures",
    "actual_joint_voltage",
    "payload_inertia",
    "ft_raw_wrench",
]
DOUBLES = [
    "timestamp",
    "actual_execution_time",
    "speed_scaling",
    "target_speed_fraction",
    "actual_momentum",
    "actual_main_voltage",
    "actual_robot_voltage",
    "actual_robot_current",
    "standard_analog_input0",
    "standard_analog_input1",
    "standard_analog_output0",
    "standard_analog_output1",
    "payload",
]

OUTPUT_TYPES: dict[str, str] = (
    dict.fromkeys(VECTOR6, "VECTOR6D")
    | dict.fromkeys(DOUBLES, "DOUBLE")
    | {
        "joint_mode": "VECTOR6INT32",
        "robot_mode": "INT32",
        "safety_mode": "INT32",
        "safety_status": "INT32",
        "actual_tool_accelerometer": "VECTOR3D",
        "payload_cog": "VECTOR3D",
        "actual_digital_input_bits": "UINT64",
        "actual_digital_output_bits": "UINT64",
        "runtime_state": "UINT32",
        "robot_status_bits": "UINT32",
        "safety_status_bits": "UINT32",
    }
    | {f"output_int_register_{i}": "INT32" for i in range(REGISTERS)}
    | {f"output_double_register_{i}": "DOUBLE" for i in range(REGISTERS)}
    | {f"input_int_register_{i}": "INT32" for i in range(REGISTERS)}
    | {f"input_double_register_{i}": "DOUBLE" for i in range(REGISTERS)}
)
INPUT_TYPES: dict[str, str] = (
    {f"input_int_register_{i}": "INT32" for i in range(REGISTERS)}
    | {f"input_double_register_{i}": "DOUBLE" for i in range(REGISTERS)}
    | {
        "speed_slider_mask": "UINT32",
        "speed_slider_fraction": "DOUBLE",
        "external_force_torque": "VECTOR6D",
        "standard_digital_output_mask": "UINT8",
        "configurable_digital_output_mask": "UINT8",
        "tool_digital_output_mask": "UINT8",
        "standard_digital_output": "UINT8",
        "configurable_digital_output": "UINT8",
        "tool_digital_output": "UINT8",
        "standard_analog_output_mask": "UINT8",
        "standard_analog_output_type": "UINT8",
        "standard_analog_output_0": "DOUBLE",
        "standard_analog_output_1": "DOUBLE",
    }
)


class Registers:
    """General-purpose registers of both directions."""

    def __init__(self) -> None:
        self.input_int = [0] * REGISTERS
        self.input_double = [0.0] * REGISTERS
        self.output_int = [0] * REGISTERS
        self.output_double = [0.0] * REGISTERS

    def doubles(self, first: int, count: int) -> np.ndarray:
        """Input double registers from `first` on, shape (count,)."""
        return np.array(self.input_double[first : first + count])
