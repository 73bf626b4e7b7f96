"""What a person must have allowed before a real arm moves."""

from __future__ import annotations

from typing import Any

from testbench.exceptions import ArmRefused
from testbench.execution.checklist import confirm_hazards
from testbench.pipeline.arm import look_at_arm
from testbench.pipeline.prepared import Prepared
from testbench.pipeline.request import RunRequest
from testbench.pipeline.watcher import Watcher


def approve(prepared: Prepared, asked: RunRequest, watcher: Watcher) -> dict[str, Any]:
    """Show the whole motion, and ask for the hazards where somebody wants the arm to move.

    A person is asked last, when arm and options are such that the run will not be refused
    afterwards.

    Args:
        prepared: What the arm would do.
        asked: Arm and sensors.
        watcher: Who is shown the motion, and what was allowed.

    Returns:
        What was confirmed, and how, for the manifest.

    Raises:
        ArmRefused: The motion or a hazard was not confirmed.
        InputError: There are no sensors, or others than those that began, or the arm must not be
            driven.
        DriverError: A live sensor delivers nothing, or there is no controller that answers.
    """
    watcher.motion(prepared)
    consent = watcher.consent
    if not consent.motion:
        raise ArmRefused("nothing moved: this was a dry run; add --confirm-motion to move the arm")
    if consent.hazards_checked:
        return confirm_hazards(lambda sentence: True) | {"by": "--hazards-checked"}
    if consent.ask is None:
        raise ArmRefused(
            "nothing moves: the hazards must be confirmed on a terminal, or with --hazards-checked"
        )
    look_at_arm(prepared, asked, watcher.clock)
    return confirm_hazards(consent.ask) | {"by": consent.asked}
