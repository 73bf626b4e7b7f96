"""Units of foreign files and their factors to those of a session (m/s^2, rad/s, uT, s)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from testbench.exceptions import NotFoundError
from testbench.frames import STANDARD_GRAVITY

QUANTITIES = ("acc", "gyr", "mag")
AccUnit = Literal["m/s^2", "g", "mg"]
GyrUnit = Literal["rad/s", "deg/s", "mdeg/s"]
MagUnit = Literal["uT", "nT", "mT", "G", "mG", "au"]
StampUnit = Literal["s", "ms", "us", "ns", "min", "h", "day"]
TimeUnit = Literal["s", "ms", "us", "ns", "min", "h", "day", "clock"]

ARBITRARY_UNIT_UT = 40.0
"""Magnetic field of one arbitrary unit of Xsens sensors [uT]: about that of the maker's laboratory,
to which they are normalised (Xsens DOT user manual XD0502P, section 4.2.2).
"""


@dataclass(frozen=True)
class Unit:
    """A unit: its name here, and how many units of a session one of it is."""

    name: str
    factor: float


SECONDS: dict[str, float] = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    "day": 86_400.0,
    "clock": 1.0,
}
"""Seconds of one unit of time; "clock" is a time of day hh:mm:ss, with or without a date."""
_FACTORS: dict[str, dict[str, float]] = {
    "acc": {"m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": STANDARD_GRAVITY / 1000},
    "gyr": {"rad/s": 1.0, "deg/s": np.pi / 180, "mdeg/s": np.pi / 180_000},
    "mag": {"uT": 1.0, "nT": 1e-3, "mT": 1000.0, "G": 100.0, "mG": 0.1, "au": ARBITRARY_UNIT_UT},
    "time": {unit: SECONDS[unit] for unit in get_args(StampUnit)},
}
_SPELLINGS = {
    "m/(s^2)": "m/s^2",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "m/s/s": "m/s^2",
    "mps2": "m/s^2",
    "m.s-2": "m/s^2",
    "ms-2": "m/s^2",
    "gs": "g",
    "dps": "deg/s",
    "°/s": "deg/s",
    "degrees/s": "deg/s",
    "deg/sec": "deg/s",
    "degree/s": "deg/s",
    "rps": "rad/s",
    "rad/sec": "rad/s",
    "mdps": "mdeg/s",
    "µt": "uT",
    "μt": "uT",
    "gauss": "G",
    "mgauss": "mG",
    "a.u.": "au",
    "local_flux": "au",
    "sec": "s",
    "secs": "s",
    "seconds": "s",
    "msec": "ms",
    "msecs": "ms",
    "µs": "us",
    "usec": "us",
    "nsec": "ns",
    "minutes": "min",
    "hours": "h",
    "days": "day",
}


def find_unit(quantity: str, name: str) -> Unit:
    """A unit by the name or a usual spelling of it.

    Raises:
        NotFoundError: No such unit of this quantity; lists those that exist.
    """
    unit = known_unit(quantity, name)
    if unit is None:
        raise NotFoundError(f"unit of {quantity}", name, list(_FACTORS[quantity]))
    return unit


def known_unit(quantity: str, name: str) -> Unit | None:
    """A unit by the name or a usual spelling of it, or None.

    G (gauss) and g (gravity) differ by the quantity.
    """
    factors, plain = _FACTORS[quantity], name.strip()
    if plain in factors:
        return Unit(plain, factors[plain])
    lower = plain.lower()
    spelt = _SPELLINGS.get(lower, lower)
    return next(
        (
            Unit(key, factor)
            for key, factor in factors.items()
            if key == spelt or key.lower() == spelt
        ),
        None,
    )


def unit_names(quantity: str) -> list[str]:
    """Names of the units of a quantity."""
    return list(_FACTORS[quantity])
