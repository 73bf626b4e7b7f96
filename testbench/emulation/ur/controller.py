"""The emulated controller: safety system, program and joints, one control period at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from testbench.emulation.controller import EmulatedController
from testbench.emulation.faults import Faults
from testbench.emulation.ur.script import ControlScript, is_control_script
from testbench.emulation.ur.state import SAFETY_BITS, Registers, RobotMode, RuntimeState, SafetyMode

AMPERE_NOISE = 0.02
"""Noise of measured currents: a stand-in."""
ZERO6 = [0.0] * 6


@dataclass(frozen=True)
class Identity:
    """What a controller says of itself: model as the dashboard names it, serial number, PolyScope
    version.
    """

    model: str
    serial: str = "20265000001"
    polyscope: str = "5.17.0.128818"

    @property
    def version(self) -> tuple[int, int, int, int]:
        """Major, minor, bugfix, build."""
        numbers = [int(part) for part in self.polyscope.split(".")]
        return (
            (numbers + [0] * 4)[0],
            (numbers + [0] * 4)[1],
            (numbers + [0] * 4)[2],
            (numbers + [0] * 4)[3],
        )


class Controller(EmulatedController):
    """State of the controller."""

    identity: Identity

    def _switch_on(self) -> None:
        self.registers = Registers()
        self.mode, self.safety, self.runtime = (
            RobotMode.RUNNING,
            SafetyMode.NORMAL,
            RuntimeState.STOPPED,
        )
        self.script: ControlScript | None = None
        self.slider, self.remote_control = 1.0, True
        self.payload, self.payload_cog = 0.0, [0.0, 0.0, 0.0]
        self._unlock_at = math.inf

    @property
    def playing(self) -> bool:
        return self.runtime is RuntimeState.PLAYING

    @property
    def state(self) -> str:
        return f"{self.mode.name} {self.safety.name} {self.runtime.name}"

    def _advance(self) -> None:
        if self.script is not None and self.playing:
            ended = self.script.tick(self)
            if ended is not None:
                self.stop_program(ended)
        trip = self.joints.step(self.slider)
        if trip is not None and self.safety is SafetyMode.NORMAL:
            self.protective_stop(trip)

    def upload(self, program: str) -> None:
        """Run a program that came in at a script port; it replaces the one that runs."""
        if not self.remote_control:
            self.messages.append("a program was refused: the robot is not in remote control")
            return
        if self.mode is not RobotMode.RUNNING or self.safety is not SafetyMode.NORMAL:
            self.messages.append("a program was refused: the arm is not running")
            return
        if is_control_script(program):
            self.stop_program("replaced by another program")
            self.script, self.runtime = ControlScript(program), RuntimeState.PLAYING
            self.script.begin(self)
        elif program.strip().startswith(("stopj", "def stop", "sec ")) or "stopj" in program:
            self.stop_program("replaced by another program")
        else:
            self.messages.append(
                "a program was refused: only ur_rtde's control script and stopj are emulated"
            )

    def stop_program(self, why: str) -> None:
        """End the program; the joints come to rest."""
        if self.script is not None:
            self.messages.append(f"program ended: {why}")
        self.script, self.runtime = None, RuntimeState.STOPPED
        self.joints.stop_hard()

    def pause(self) -> None:
        """Pause the program."""
        if self.playing:
            self.runtime = RuntimeState.PAUSED
            self.joints.stop_hard()

    def play(self) -> bool:
        """Go on with a paused program."""
        ready = (
            self.mode is RobotMode.RUNNING
            and self.safety is SafetyMode.NORMAL
            and self.remote_control
        )
        if self.script is None or self.runtime is not RuntimeState.PAUSED or not ready:
            return False
        self.runtime = RuntimeState.PLAYING
        return True

    def protective_stop(self, why: str) -> None:
        """Stop hard; it can be unlocked five seconds later, as on the real controller."""
        self.messages.append(f"protective stop: {why}")
        self.safety = SafetyMode.PROTECTIVE_STOP
        self._unlock_at = self.time + 5.0
        self.pause()

    def unlock_protective_stop(self) -> str:
        """Answer of the dashboard."""
        if self.safety is SafetyMode.PROTECTIVE_STOP and self.time < self._unlock_at:
            return "Cannot unlock protective stop until 5s after occurrence"
        if self.safety is SafetyMode.PROTECTIVE_STOP:
            self.safety = SafetyMode.NORMAL
        return "Protective stop releasing"

    def fault(self, name: str, value: float | None = None) -> None:
        """Let a fault happen; see `faults.FAULTS`."""
        if name == "protective_stop":
            self.protective_stop("asked for")
        elif name == "emergency_stop":
            self.safety = SafetyMode.ROBOT_EMERGENCY_STOP
            self.stop_program("emergency stop")
            self.mode = RobotMode.POWER_OFF
        elif name == "power_off":
            self.stop_program("power off")
            self.mode = RobotMode.POWER_OFF
        elif name == "slider":
            self.slider = 0.5 if value is None else value
        elif name == "local_control":
            self.remote_control = False
        elif name == "clock_step":
            self.step_clock(value)
        elif name == "program_stop":
            self.stop_program("asked for")
        else:
            self.faults.strike(name.removeprefix("rtde_"), value, self.time)
        self.messages.append(f"fault {name}" + ("" if value is None else f" {value:g}"))

    def clear(self) -> None:
        """End every fault, unlock the safety system and power the arm up again."""
        self.faults = Faults()
        self.slider, self.remote_control = 1.0, True
        self.safety, self.mode = SafetyMode.NORMAL, RobotMode.RUNNING
        if self.runtime is RuntimeState.PAUSED:
            self.stop_program("cleared")
        self.messages.append("cleared")

    def outputs(self) -> dict[str, Any]:
        """Every RTDE output variable but the registers."""
        joints, current, told = self.joints, self.currents, self.faults.payload_kg
        powered = self.mode >= RobotMode.POWER_ON
        noise = AMPERE_NOISE * self._rng.standard_normal(len(current))
        return {
            "timestamp": self.stamp,
            "target_q": joints.q_reference,
            "target_qd": joints.v_reference,
            "target_qdd": joints.a_reference,
            "target_current": current,
            "target_moment": current,
            "actual_q": joints.q_measured,
            "actual_qd": joints.v_measured,
            "actual_current": current + noise if powered else ZERO6,
            "joint_temperatures": [30.0] * 6,
            "joint_mode": [253 if powered else 239] * 6,
            "robot_mode": int(self.mode),
            "safety_mode": int(self.safety),
            "safety_status": int(self.safety),
            "runtime_state": int(self.runtime),
            "robot_status_bits": int(powered) | int(self.script is not None) << 1,
            "safety_status_bits": SAFETY_BITS[self.safety],
            "speed_scaling": self.slider if self.playing else 0.0,
            "target_speed_fraction": self.slider,
            "payload": self.payload if told is None else told,
            "payload_cog": self.payload_cog,
            "actual_main_voltage": 48.0,
            "actual_robot_voltage": 48.0 if powered else 0.0,
        }
