"""Where files that ship with the product lie, in a source tree and an installed package alike."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2]
"""The folder of the package itself."""


def shipped_folder(name: str) -> Path:
    """The folder `name` ("protocols", "robots", "docs") of the source tree or the installed
    package, which has of the last only what a report explains.
    """
    source = PACKAGE.parent / name
    return source if (PACKAGE.parent / "pyproject.toml").is_file() else PACKAGE / "shipped" / name


def shipped_names(folder: Path) -> list[str]:
    """Names of the YAML files that ship in a folder."""
    return sorted(file.stem for file in folder.glob("*.yaml"))


def shipped_data(room: str, kind: str) -> Path:
    """The folder of the files that ship inside a room of the package.

    Args:
        room: Of the package, such as "model".
        kind: Folder in it, such as "presets".
    """
    return PACKAGE / room / kind
