"""Packages that only some commands need, and how to install them from where a person stands."""

from __future__ import annotations

import re
import shlex
import sys
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path

PROJECT = "imu-testbench"


def is_missing(extra: str) -> bool:
    """Whether a package of an extra is not installed; nothing is loaded.

    Run from its source without an installation, the bench does not know what an extra brings, and
    a package that is missing is told where it is loaded.
    """
    return any(not _is_installed(name) for name in _packages(extra))


def missing_extra(what: str, extra: str) -> str:
    """A sentence on an extra that is not installed, with the command that installs it.

    Args:
        what: What needs it, and "needs" or "need": "serial devices need".
        extra: Which.
    """
    sentence = f"{what} the extra '{extra}', which is not installed: {install_command(extra)}"
    only = [where for where in _packages(extra).values() if where]
    return f"{sentence} (it is for {only[0]} only)" if only else sentence


def install_command(extra: str) -> str:
    """What a person types to install an extra beside this very program."""
    python = shlex.quote(sys.executable)
    pip = f"{python} -m pip install" if find_spec("pip") else f"uv pip install --python {python}"
    what = PROJECT if _is_installed(PROJECT) else str(Path(__file__).resolve().parents[1])
    return f"{pip} {shlex.quote(f'{what}[{extra}]')}"


def _packages(extra: str) -> dict[str, str]:
    """Packages of an extra, and for which machines and versions of Python each is; "" for all."""
    stated = (requires(PROJECT) or []) if _is_installed(PROJECT) else []
    found = {}
    for requirement in stated:
        name, _, marker = requirement.partition(";")
        parts = [part.strip(" ()") for part in marker.split(" and ")]
        own = [part for part in parts if re.fullmatch(rf"extra == ['\"]{extra}['\"]", part)]
        if own:
            package = re.match(r"[\w.-]+", name.strip())
            assert package is not None
            found[package[0]] = " and ".join(part for part in parts if part not in own)
    return found


def _is_installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True
