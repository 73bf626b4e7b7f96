"""The dashboard server's answers (Universal Robots, Dashboard Server e-Series)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbench.emulation.ur.state import RobotMode, RuntimeState, SafetyMode

if TYPE_CHECKING:
    from testbench.emulation.ur.controller import Controller

GREETING = "Connected: Universal Robots Dashboard Server"
REMOTE_ONLY = {
    "play",
    "stop",
    "pause",
    "power on",
    "power off",
    "brake release",
    "unlock protective stop",
    "restart safety",
}
REFUSED = "Command is not allowed due to safety reasons"


# One branch a command, in the order of the dashboard's manual.
def answer(controller: Controller, command: str) -> str:  # noqa: C901 - one branch a command
    """What the dashboard says to a command."""
    if command in REMOTE_ONLY and not controller.remote_control:
        return REFUSED
    if command == "PolyscopeVersion":
        version, _, build = controller.identity.polyscope.rpartition(".")
        return f"URSoftware {version}.{build} (Jan 01 2024)"
    if command == "is in remote control":
        return str(controller.remote_control).lower()
    if command == "get robot model":
        return controller.identity.model
    if command == "get serial number":
        return controller.identity.serial
    if command == "robotmode":
        return f"Robotmode: {controller.mode.name}"
    if command in {"safetystatus", "safetymode"}:
        return f"{command.capitalize()}: {controller.safety.name}"
    if command == "running":
        return f"Program running: {str(controller.playing).lower()}"
    if command == "programState":
        state = controller.runtime.name
        return (
            f"{state} rtde_control"
            if controller.script is not None
            else f"{RuntimeState.STOPPED.name} null"
        )
    if command == "get loaded program":
        return "No program loaded"
    if command == "play":
        return "Starting program" if controller.play() else "Failed to execute: play"
    if command == "stop":
        controller.stop_program("stopped on the dashboard")
        return "Stopped"
    if command == "pause":
        controller.pause()
        return "Pausing program"
    if command == "power on":
        if controller.mode is RobotMode.POWER_OFF and controller.safety is SafetyMode.NORMAL:
            controller.mode = RobotMode.IDLE
        return "Powering on"
    if command == "brake release":
        if controller.safety is SafetyMode.NORMAL:
            controller.mode = RobotMode.RUNNING
        return "Brake releasing"
    if command == "power off":
        controller.fault("power_off")
        return "Powering off"
    if command == "unlock protective stop":
        return controller.unlock_protective_stop()
    if command in {"close popup", "close safety popup", "restart safety"}:
        return {"close popup": "closing popup", "close safety popup": "closing safety popup"}.get(
            command, "Restarting safety"
        )
    if command.startswith(("popup ", "addToLog ", "setUserRole ")):
        return "showing popup" if command.startswith("popup") else "Added log message"
    if command == "isProgramSaved":
        return "true null"
    return f'could not understand: "{command[:80]}"'
