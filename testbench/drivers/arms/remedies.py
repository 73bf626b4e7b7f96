"""What a person does after an arm has stopped, by the driver's word for the cause.

Sentences without a full stop.
"""

from __future__ import annotations


def _common(where: str) -> dict[str, str]:
    """What is the same on all arms, but for the place in which their maker has the settings."""
    network = (
        "see that the arm stands still, and that controller and network are in order: "
        "nobody knew where it was"
    )
    return {
        "disconnect": "see that the arm stands still, and that controller and network cable are as "
        "they were",
        "silence": "see that the controller has booted, and that no firewall holds its data back; "
        "then try again",
        "report_silence": network,
        "slow_response": "see what keeps controller, network or this machine busy, and try again",
        "host_silence": "see what keeps this machine busy (its disk, its memory), and try again",
        "driver": "see that the arm stands still, and what keeps controller, network or this "
        "machine busy, then try again",
        "tracking_error": f"did the arm touch something, is the load set {where} the one it "
        "carries, is the motion too fast?",
        "not_reached": f"did the arm touch something, is the load set {where} the one it carries?",
        "refused": f"see {where} what the controller says",
    }


PENDANT = "on the teach pendant"
UR_REMEDIES = _common(PENDANT) | {
    "protective_stop": "look for what stopped it (a collision, a cable, the load), free the arm, "
    f"unlock it {PENDANT}, and "
    "stop the program that is paused there",
    "emergency_stop": "free the arm, release the emergency stop, then power it on and release its "
    f"brakes {PENDANT}",
    "safety_stop": f"see {PENDANT} which safety function stopped the arm, and remove its cause",
    "power_off": f"power the arm on and release its brakes {PENDANT}",
    "silence": "see that the controller has booted, that its RTDE interface is enabled (safety "
    "settings, network services), "
    "and that no firewall or other client holds its data back; then try again",
    "speed_slider": f"put the speed slider back {PENDANT}",
    "program_stopped": f"find out who stopped or replaced the program: somebody {PENDANT}, or "
    "another bench",
    "payload": f"see {PENDANT} which payload is set, and by whom",
}
"""Of Universal Robots arms."""

STUDIO = "in UFACTORY Studio"
XARM_REMEDIES = _common(STUDIO) | {
    "protective_stop": "look for what stopped it (a collision, a cable, the load, how the arm is "
    "mounted), free the arm, then "
    f"clear the error and enable the robot {STUDIO}",
    "emergency_stop": "free the arm, release the emergency stop button, then enable the robot "
    f"{STUDIO}",
    "servo_error": "switch the control box off and on again; when the error comes back, ask the "
    "maker",
    "controller_error": "look the error's number up in the maker's user manual, remove its cause, "
    f"then clear it {STUDIO}",
    "power_off": f"find out who switched the motors off, then enable the robot {STUDIO}",
    "program_stopped": f"find out who stopped or paused the arm: somebody {STUDIO}, or another "
    "program",
    "mode_changed": f"find out who changed the mode: somebody {STUDIO}, or another program",
    "not_ready": f"see {STUDIO} what the controller says",
    "payload": f"see {STUDIO} which load is set, and what the controller says",
}
"""Of UFACTORY xArms, by the user manual's chapter on error handling."""
