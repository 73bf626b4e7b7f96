"""What a person says of a walk beside its samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from testbench.estimation.filters import choose_filters
from testbench.estimation.gait.parameters import MOUNTINGS, PUBLISHED
from testbench.estimation.gait.wearing import FOUND
from testbench.exceptions import InputError, NotFoundError
from testbench.records.results.gait import PLACES

DEFAULT_PARAMETERS = {
    "foot": "universal",
    "shank": "universal",
    "wrist": "ngimu_wrist",
    "chest": "ngimu_chest",
}
"""Of the regression, by place: b_H of E. Muñoz 2016, else those of Cabezuelo's table 11."""
DEFAULT_FILTER = "euler_ekf"
"""Whose orientation the regression takes: the corrected filter of the source."""


@dataclass(frozen=True)
class GaitSettings:
    """How a walk is reckoned.

    Attributes:
        on: Where sensors sit, by name; those that are missing are found.
        mounting: How sensors of the regression are worn, by name; those that are missing are found.
        parameters: Of the regression, a name of `PUBLISHED`; given, a sensor on the foot goes by
            the regression, too. By place if "".
        filter: Of the regression.
        floor: "level": all stands of a foot are equally high; "any"; "found" by their rise.
    """

    on: Mapping[str, str] = field(default_factory=dict)
    mounting: Mapping[str, str] = field(default_factory=dict)
    parameters: str = ""
    filter: str = DEFAULT_FILTER
    floor: Literal["found", "level", "any"] = "found"

    @property
    def level(self) -> bool | None:
        """Whether the floor is level; None where that is to be found."""
        return None if self.floor == "found" else self.floor == "level"

    def check(self, sensors: Sequence[str]) -> None:
        """Refuse what does not exist.

        Args:
            sensors: Of the session.

        Raises:
            NotFoundError: No such sensor, place, mounting, parameters or filter.
        """
        choose_filters([self.filter])
        for what, given, allowed in (
            ("place", self.on, PLACES),
            ("mounting", self.mounting, (FOUND, *MOUNTINGS)),
        ):
            for sensor, value in given.items():
                if sensor not in sensors:
                    raise NotFoundError("sensor", sensor, list(sensors))
                if value not in allowed:
                    raise NotFoundError(what, value, list(allowed))
        if self.parameters and self.parameters not in PUBLISHED:
            raise NotFoundError("parameters", self.parameters, list(PUBLISHED))


def by_sensor(option: str, given: Iterable[str], sensors: Sequence[str]) -> dict[str, str]:
    """What is said of each sensor, by entries `SENSOR=VALUE`, or `VALUE` of all of them.

    Args:
        option: How the entries are given, for messages.
        given: The entries.
        sensors: Of the session.

    Raises:
        InputError: A sensor is named twice, or two things are said of all.
    """
    given, found = list(given), dict[str, str]()
    bare = [text.strip() for text in given if "=" not in text]
    if len(bare) > 1:
        raise InputError(f"{option} says {' and '.join(bare)} of all sensors; say which holds")
    for text in given:
        sensor, equals, value = text.rpartition("=")
        for name in [sensor.strip()] if equals else sensors:
            if name in found and equals:
                raise InputError(f"{option} says twice what '{name}' is: {found[name]} and {value}")
            found[name] = value.strip()
    return found
