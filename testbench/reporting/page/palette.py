"""One colour for each filter, the same in the report and in the viewer, legible on white and on
near-black.
"""

from __future__ import annotations

COLOURS = (
    "#2f7ed8",
    "#dd7a1f",
    "#1f9e77",
    "#a866d6",
    "#d64f5c",
    "#9a8712",
    "#1a9bb0",
    "#cc5c9e",
    "#6d8f2c",
    "#8a7461",
    "#7276e6",
    "#b5533c",
)
"""Contrast of at least 3 to 1 against #ffffff and #14171c each; neighbours differ in hue and
lightness.
"""

ORDERED = ("#3276d8", "#8564d0", "#b358a9", "#cc5771", "#cc6632", "#b1820d", "#86992a", "#3ca36b")
"""Steps of one quantity: hue by hue from blue over red to green, with the contrast of `COLOURS`."""

USUAL = ("device", "vqf_6d", "vqf_9d", "fusion", "madgwick_imu", "vqf_offline")
"""Filters whose colour is the same in every report."""

REFERENCE = "#868e99"
"""Truth and published results."""

AXES_COLOURS = {"x": COLOURS[4], "y": COLOURS[2], "z": COLOURS[0]}
"""Axes of a sensor: red, green and blue, as viewers draw them."""


def filter_colours(filters: list[str]) -> dict[str, str]:
    """Colour of each filter: those of `USUAL` always have their own, others take what is left.

    Beyond twelve they repeat.
    """
    names = list(dict.fromkeys(filters))
    taken = {name: COLOURS[i] for i, name in enumerate(USUAL) if name in names}
    free = [colour for colour in COLOURS if colour not in taken.values()] or list(COLOURS)
    others = [name for name in names if name not in taken]
    colours = taken | {name: free[i % len(free)] for i, name in enumerate(others)}
    return {name: colours[name] for name in names}


def ordered_colours(count: int) -> list[str]:
    """Colours for the values of one quantity in their order, as far apart as so many can be.

    Beyond eight they repeat.
    """
    if count > len(ORDERED):
        return [ORDERED[i % len(ORDERED)] for i in range(count)]
    last = len(ORDERED) - 1
    return [ORDERED[round(i * last / max(count - 1, 1))] for i in range(count)]


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of `#rrggbb`, 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def translucent(colour: str, opacity: float) -> str:
    """The colour as CSS rgba()."""
    return f"rgba({', '.join(str(part) for part in rgb(colour))}, {opacity:g})"
