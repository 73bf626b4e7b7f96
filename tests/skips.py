"""Which tests may skip in `.ci/run`: those whose need no installation of it can meet. Elsewhere a
test may skip for want of anything.
"""

from __future__ import annotations

import os
import platform
import re
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Excuse:
    """Something that may be missing.

    Attributes:
        reason: Pattern of the reasons that tests give for it.
        holds: Whether it may be missing here.
        why: What an installation cannot do about it.
    """

    reason: str
    holds: bool
    why: str


def excuses() -> list[Excuse]:
    """What may be missing on this machine."""
    version, linux_pc = sys.version_info, sys.platform == "linux" and platform.machine() == "x86_64"
    without = os.environ.get("CI_WITHOUT", "").split()
    return [
        Excuse(
            "ur_rtde|rtde_control",
            version >= (3, 13) or not linux_pc,
            "ur_rtde has wheels for Python before 3.13 on x86-64 alone",
        ),
        Excuse(
            "opensim",
            version >= (3, 14) or not linux_pc,
            "opensim has wheels for Python before 3.14 on Linux x86-64 alone",
        ),
        Excuse("let tests mount a file system", True, "a container may forbid it even to root"),
        Excuse(
            "TESTBENCH_DATA is not set",
            not (Path(__file__).resolve().parents[2] / "shared" / "data").is_dir(),
            "the recordings do not lie beside the repository",
        ),
        Excuse(
            "TESTBENCH_CASES is not set",
            not (Path(__file__).resolve().parents[2] / "shared" / "cases").is_dir(),
            "the situations do not lie beside the repository",
        ),
        Excuse("Chromium", "chromium" in without, "apt-get could not install it"),
        Excuse("Vulkan", "libvulkan1" in without, "apt-get could not install it"),
    ]


def complaint(reason: str) -> str | None:
    """What is said of a test that skips for a reason, in CI; None where it may."""
    if not os.environ.get("CI"):
        return None
    if any(excuse.holds and re.search(excuse.reason, reason) for excuse in excuses()):
        return None
    return f"nothing must skip in CI that its installation could avoid, but this did: {reason}"
