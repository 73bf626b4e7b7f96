"""The physical hazards that a person looks at, once a session, before a real arm moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from testbench.exceptions import ArmRefused

HAZARDS = {
    "area": "Nobody is within reach of the arm, and nobody can come near it unseen.",
    "emergency_stop": "The emergency stop is within my reach, and it was tried today.",
    "mounting": "The arm, the sensors and their holder are fixed; nothing can come loose at the "
    "planned speeds.",
    "cables": "Cables and straps have slack for every planned turn and cannot catch.",
    "surroundings": "Everything the arm could touch, which the plan does not know of, is out of "
    "its way.",
    "payload": "Mass and centre of mass of the tool are set as they are.",
    "limits": "Speed and force limits of the robot's safety configuration suit this bench.",
}
"""By a word for the manifest."""


def confirm_hazards(ask: Callable[[str], bool]) -> dict[str, Any]:
    """Ask for every hazard.

    Args:
        ask: Shows a sentence and says whether a person confirmed it.

    Returns:
        What the manifest keeps: the sentences, all confirmed.

    Raises:
        ArmRefused: One was not confirmed.
    """
    for word, sentence in HAZARDS.items():
        if not ask(sentence):
            raise ArmRefused(f"nothing moves: the hazard '{word}' was not confirmed")
    return {"confirmed": list(HAZARDS), "sentences": list(HAZARDS.values())}
