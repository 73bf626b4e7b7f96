"""A sensor as measured at rest, in the words of a data sheet: a preset to simulate it by."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.noise import UNITS
from testbench.exceptions import InputError
from testbench.records.results.evaluation import NoiseRow
from testbench.records.specs.sensor import Accelerometer, Gyroscope, ImuParameters, Magnetometer

Sheet = Accelerometer | Gyroscope | Magnetometer

WHITE = {
    "acc": "noise_density_ug_sqrthz",
    "gyr": "noise_density_deg_s_sqrthz",
    "mag": "noise_density_uT_sqrthz",
}
SLOW = {
    "acc": ("in_run_bias_mg", "bias_random_walk_mg_sqrts"),
    "gyr": ("in_run_bias_deg_h", "bias_random_walk_deg_h_sqrts"),
}
KINDS = ("bias_instability", "rate_random_walk")
TRIADS = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
LEAST_COUNTS = 0.4
"""Standard deviation of the noise, in counts, from which rounding adds a twelfth of a count squared
to its variance.

What this leaves out is, for normal noise of standard deviation s, within (4 s^2 + 1/pi^2) exp(-2
pi^2 s^2) counts squared (Widrow & Kollár, Quantization Noise, 2008, on the moments of quantised
signals): a tenth of s at 0.4, below 2 % from 0.5 on.
"""


def measured_sensor(
    rows: list[NoiseRow],
    base: ImuParameters,
    origin: str,
    rate: float | None = None,
    base_name: str = "a data sheet",
) -> tuple[ImuParameters, list[str]]:
    """The data sheet with the noise that was measured.

    White noise is taken by axis, less that of rounding to the counts of `base`, which the simulated
    sensor adds again; slow changes of the bias as the RMS over the axes that show them. A rest that
    shows a random walk and no bias instability has its slow changes in the walk, and no instability
    stands beside it. What else the rest was too short to show, and all that a rest cannot show
    (ranges, bandwidths, scale and turn-on bias over parts, clock), stays as in `base`. The
    description and the source of the new sensor say which is which.

    Args:
        rows: One sensor's noise at rest.
        base: The data sheet to start from.
        origin: Where the numbers come from, a phrase.
        rate: Output rate [Hz]; that of `base` if None.
        base_name: What `base` is, a phrase.

    Returns:
        The sensor, and sentences on what was not measured.

    Raises:
        InputError: Nothing was measured.
    """
    if not rows:
        raise InputError("the recording holds no rest of 10 s or more, so no noise was measured")
    changes: dict[str, dict[str, object]] = {}
    kept: list[str] = []
    measured: list[str] = [] if rate is None else ["the output rate"]
    for quantity, triad in TRIADS.items():
        own = {row.axis: row for row in rows if row.quantity == quantity}
        sheet = getattr(base, triad)
        if sheet is None and own:
            kept.append(
                f"{triad}: its noise was measured and is not in the file, because {base_name} has "
                f"no {triad}"
            )
        if sheet is not None and not own:
            kept.append(
                f"{triad}: nothing was measured, the recording holds none; all of it copied from "
                f"{base_name}"
            )
        if not own or sheet is None:
            continue
        density, shown = _white_noise(own, sheet, quantity, triad, kept)
        measured += [f"white noise of the {triad} ({', '.join(shown)})"] if shown else []
        changes[triad] = {WHITE[quantity]: density}
        if quantity in SLOW:
            slow, words = _slow_noise(own, sheet, quantity, triad, kept)
            changes[triad] |= slow
            measured += [f"{word} of the {triad}" for word in words]
    update: dict[str, object] = {
        triad: getattr(base, triad).model_copy(update=values) for triad, values in changes.items()
    }
    update["description"] = f"Noise as measured ({origin}); all else copied from {base_name}"
    update["source"] = (
        f"Measured ({origin}): {', '.join(measured) or 'nothing'}. Copied from {base_name}: "
        "everything else"
        + (f"; in particular {'; '.join(kept)}" if kept else "")
        + f". What {base_name} rests on: {base.source or 'not stated'}"
    )
    if rate is not None:
        update["rate_hz"] = float(f"{rate:.6g}")
    return ImuParameters.model_validate(base.model_copy(update=update).model_dump()), kept


def _white_noise(
    own: dict[str, NoiseRow], sheet: Sheet, quantity: str, triad: str, kept: list[str]
) -> tuple[list[float], str]:
    """Density of a triad's white noise by axis, and the axes of which it was measured.

    Args:
        own: What was measured, by axis.
        sheet: The triad's data sheet.
        quantity: What the triad measures.
        triad: Its name.
        kept: Gets a sentence on each axis of which nothing was measured.
    """
    density = list(getattr(sheet, WHITE[quantity]))
    shown = ""
    for i, axis in enumerate("xyz"):
        white = own[axis].noise_density if axis in own else None
        if white is None:
            kept.append(f"{triad} {axis}: white noise lost among the others; {density[i]:g} kept")
            continue
        unrounded = _without_rounding(own[axis], white, sheet.triad().resolution)
        if unrounded is None:
            kept.append(
                f"{triad} {axis}: white noise hidden by the counts of the sensor; "
                f"{density[i]:g} kept"
            )
        else:
            density[i] = float(f"{unrounded:.4g}")
            shown += axis
    return density, shown


def _slow_noise(
    own: dict[str, NoiseRow], sheet: Sheet, quantity: str, triad: str, kept: list[str]
) -> tuple[dict[str, object], list[str]]:
    """Slow changes of a triad's bias for the file, and the names of those that were measured.

    Args:
        own: What was measured, by axis.
        sheet: The triad's data sheet.
        quantity: What the triad measures.
        triad: Its name.
        kept: Gets a sentence on each kind of change that was not measured.
    """
    values: dict[str, object] = {}
    measured: list[str] = []
    found = {
        kind: [value for row in own.values() if (value := getattr(row, kind)) is not None]
        for kind in KINDS
    }
    for key, kind in zip(SLOW[quantity], KINDS, strict=True):
        words = kind.replace("_", " ")
        if found[kind]:
            values[key] = float(f"{np.sqrt(np.mean(np.square(found[kind]))):.4g}")
            measured.append(words)
        elif kind == "bias_instability" and found["rate_random_walk"]:
            values[key] = 0.0
            kept.append(
                f"{triad}: {words} not shown by this rest; 0 written, because the random "
                "walk holds the slow noise"
            )
        else:
            kept.append(f"{triad}: {words} not shown by this rest; {getattr(sheet, key):g} kept")
    return values, measured


def _without_rounding(row: NoiseRow, density: float, resolution: float) -> float | None:
    """One-sided density less that of rounding, q^2/12 spread over half the rate; None where too
    little is left to be told.
    """
    half_rate = (row.samples - 1) / row.span_s / 2
    count = resolution / UNITS[row.quantity][3]
    left = density**2 * half_rate - count**2 / 12
    if left < (LEAST_COUNTS * count) ** 2:
        return None
    return float(np.sqrt(left / half_rate))
