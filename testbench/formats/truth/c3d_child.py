"""Run as a program: the markers of a C3D file, as arrays on standard output.

The package that reads C3D is compiled; a damaged file can end its process or keep it busy for ever.
So it reads in a process of its own (see `c3d.py`), which needs nothing of this bench.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

MOST_BYTES = 8 << 30


def main(path: str) -> None:
    """Read a file; what is wrong with it goes to standard error, with exit code 2."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    except (ImportError, OSError, ValueError):
        pass  # not on this system
    try:
        import ezc3d

        content = ezc3d.c3d(path)
        parameters = content["parameters"]["POINT"]
        points = np.asarray(content["data"]["points"], dtype=float)
        labels, angles = (_all_texts(parameters, name) for name in ("LABELS", "ANGLES"))
        arrays = {
            "points": np.moveaxis(points[:3], 2, 0).transpose(0, 2, 1),
            "labels": np.array(labels, dtype=str),
            "angles": np.array(angles, dtype=str),
            "angle_unit": np.array((_angle_units(parameters) or [""])[0]),
            "unit": np.array((_texts(parameters, "UNITS") or ["mm"])[0]),
            "rate": np.array(float(np.ravel(parameters["RATE"]["value"])[0])),
        }
    except BaseException as error:
        sys.stderr.write(" ".join(str(error).split())[:200] or type(error).__name__)
        sys.exit(2)
    np.savez(sys.stdout.buffer, **arrays)  # type: ignore[arg-type]


def _all_texts(parameters: Any, name: str) -> list[str]:
    """Of a parameter, and of those that go on with it: LABELS, LABELS2, ..."""
    names = [name, *(f"{name}{further}" for further in range(2, 10))]
    return [text for own in names for text in _texts(parameters, own)]


def _angle_units(parameters: Any) -> list[str]:
    """Units of angles, in the parameter that TYPE_GROUPS pairs with ANGLES, else ANGLE_UNITS."""
    groups = _texts(parameters, "TYPE_GROUPS")
    named = dict(zip(groups[::2], groups[1::2], strict=False))
    return _texts(parameters, named.get("ANGLES", "ANGLE_UNITS"))


def _texts(parameters: Any, name: str) -> list[str]:
    return [str(text).strip() for text in parameters[name]["value"]] if name in parameters else []


if __name__ == "__main__":
    main(sys.argv[1])
