"""Folders of the user's own: XDG Base Directory Specification 0.8."""

from __future__ import annotations

import os
from pathlib import Path

OWN = "testbench"
"""What the bench's folder is called in each of them."""


def user_folder(variable: str, usual: str) -> Path | None:
    """The bench's folder in one of the user's, None where the user has none.

    Args:
        variable: Of the environment, which states the folder if it is an absolute path, such as
            XDG_CACHE_HOME.
        usual: Its name in the home folder else, such as .cache.
    """
    stated = Path(os.environ.get(variable, ""))
    if stated.is_absolute():
        return stated / OWN
    try:
        return Path.home() / usual / OWN
    except RuntimeError:
        return None
