"""Parameters of step detection and step length, with those of Cabezuelo 2019, table 11."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

MOUNTINGS: dict[str, list[list[float]]] = {
    "level": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "frontal": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "lateral": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
}
"""Axes of a level frame (x along roll, y along pitch, z up), one a row, in the sensor's: worn level
(ENU), in front, at side.

The source's maps of a sensor on the left leg, with its frame's z turned upwards.
"""


@dataclass(frozen=True)
class PedestrianParameters:
    """What counts as a gait cycle, and how long it is.

    Attributes:
        amplitude_deg: Swing from peak to peak that a cycle must exceed.
        false_zero_deg: Excursion that a half swing must exceed on either side of zero.
        offset_window_s: Length of the mean that is taken off: 100 samples at the source's 100 Hz.
        slope_m_deg: Step length by the swing, a_H of E. Muñoz 2016.
        intercept_m: Step length without any swing, b_H of E. Muñoz 2016.
        form: "line", a_H swing + b_H, or "product", a_H swing b_H as eq. 2.28 is printed.
        mounting: How the sensor is worn, a key of `MOUNTINGS`.
    """

    amplitude_deg: float = 25.0
    false_zero_deg: float = 5.0
    offset_window_s: float = 1.0
    slope_m_deg: float = 0.0294
    intercept_m: float = 0.232
    form: Literal["line", "product"] = "line"
    mounting: Literal["level", "frontal", "lateral"] = "level"

    def length(self, swing_deg: float) -> float:
        """Length of a gait cycle [m] by the swing of the leg [deg] (eq. 2.28).

        The source calls it a regression line and prints a product. Its own parameters decide for
        the line: on the chest, where a swing is 6 to 10 deg, b_H is 1.2 for cycles of 1.39 m; the
        product would be 0.3 m.
        """
        if self.form == "product":
            return self.slope_m_deg * swing_deg * self.intercept_m  # eq. 2.28 as printed
        return self.slope_m_deg * swing_deg + self.intercept_m


# Table 11: tuned on one run of 109 cycles and 151.72 m for each position and device.
PUBLISHED: dict[str, PedestrianParameters] = {
    "universal": PedestrianParameters(),
    "ngimu_shin": PedestrianParameters(25, 5, intercept_m=0.35, mounting="frontal"),
    "ngimu_instep": PedestrianParameters(25, 5, intercept_m=0.065),
    "ngimu_wrist": PedestrianParameters(10, 5, intercept_m=0.95),
    "ngimu_chest": PedestrianParameters(6, 2, intercept_m=1.2),
    "bno080_shin": PedestrianParameters(25, 5, intercept_m=0.2, mounting="frontal"),
    "bno080_instep": PedestrianParameters(25, 5, intercept_m=0.2),
    "bno080_wrist": PedestrianParameters(10, 2, intercept_m=0.9),
    "bno080_chest": PedestrianParameters(8, 2, intercept_m=1.2),
}
