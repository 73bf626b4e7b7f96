"""What a person does after an arm has stopped, by the word that its driver has for the cause."""

from __future__ import annotations

PENDANT = "on the teach pendant"
REMEDIES = {
    "protective_stop": f"look for what stopped it (a collision, a cable, the load), free the arm, unlock it {PENDANT}, and "
    "stop the program that is paused there",
    "emergency_stop": f"free the arm, release the emergency stop, then power it on and release its brakes {PENDANT}",
    "safety_stop": f"see {PENDANT} which safety function stopped the arm, and remove its cause",
    "power_off": f"power the arm on and release its brakes {PENDANT}",
    "disconnect": "see that the arm stands still, and that controller and network cable are as they were",
    "silence": "see that the controller has booted, that its RTDE interface is enabled (safety settings, network services), "
    "and that no firewall or client holds its data back; then try again",
    "rtde_silence": "see that the arm stands still, and that controller and network are in order: nobody knew where it was",
    "speed_slider": f"put the speed slider back {PENDANT}",
    "program_stopped": f"find out who stopped or replaced the program: somebody {PENDANT}, or another bench",
    "slow_response": "see what keeps controller, network or this machine busy, and try again",
    "host_silence": "see what keeps this machine busy (its disk, its memory), and try again",
    "driver": "see that the arm stands still, and what keeps controller, network or this machine busy, then try again",
    "tracking_error": f"did the arm touch something, is the load set {PENDANT} the one it carries, is the motion too fast?",
    "not_reached": f"did the arm touch something, is the load set {PENDANT} the one it carries?",
    "refused": f"see {PENDANT} what the controller says",
}
"""Sentences without a full stop."""
