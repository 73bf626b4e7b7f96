"""Where the protocols and robots that ship with the product lie, in a source tree and in an
installed package alike.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent.parent


def shipped_folder(name: str) -> Path:
    """The folder `name` ("protocols" or "robots") of the source tree, or its copy inside the
    installed package.
    """
    source = _PACKAGE.parent / name
    return source if (_PACKAGE.parent / "pyproject.toml").is_file() else _PACKAGE / "shipped" / name
