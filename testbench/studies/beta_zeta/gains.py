"""Gains of each form of the filter, tuned on takes, judged on motions that chose none of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.estimation.filters import OrientationFilter, get_filter
from testbench.pipeline.parameter_space import Effort, Space, find_optimum
from testbench.studies.beta_zeta.takes import Take

TEXT, UPSTREAM = "madgwick_zeta_as_printed", "madgwick_zeta_upstream"
MARG, IMU, ADAPTIVE = "madgwick_marg", "madgwick_imu", "madgwick_adaptive"
EFFORT = Effort(values=6, points=100)


@dataclass(frozen=True)
class Form:
    """One form of Madgwick's filter.

    Attributes:
        label: For tables.
        filter: Its name.
        tuned: Parameters that are looked for.
    """

    label: str
    filter: str
    tuned: tuple[str, ...]


ALONE = Form("beta alone", MARG, ("beta",))
STATE = Form("with a bias state", MARG, ("beta", "zeta"))
IMU_ALONE = Form("beta alone, no magnetometer", IMU, ("beta",))
IMU_STATE = Form("with a bias state, no magnetometer", IMU, ("beta", "zeta"))
FORMS = (
    Form("zeta of the text", TEXT, ("beta", "zeta")),
    Form("zeta of the upstream code", UPSTREAM, ("beta", "zeta")),
    ALONE,
    STATE,
    Form("adaptive beta", ADAPTIVE, ("beta",)),
    IMU_ALONE,
    IMU_STATE,
)


@dataclass(frozen=True)
class Tuned:
    """What a form came to.

    Attributes:
        form: Which.
        gains: Beta and zeta by all takes; zeta is None where it is not tuned.
        own: Error of each take by them [deg], in the order of the takes.
        held_out: Error of each take by the gains of all other motions [deg]; empty where there is
            one motion only.
    """

    form: Form
    gains: tuple[float, float | None]
    own: np.ndarray
    held_out: np.ndarray

    @property
    def judged(self) -> np.ndarray:
        """Held out where it can be, shape (takes,) [deg]."""
        return self.held_out if len(self.held_out) else self.own


def tuned(form: Form, takes: Sequence[Take]) -> Tuned:
    """Look for the gains of a form.

    Args:
        form: Which.
        takes: All; each counts alike.
    """
    kind = get_filter(form.filter)
    space = Space.of(kind.PARAMETERS, form.tuned)
    start = tuple(kind.parameters[name] for name in space.names)
    seen: dict[tuple[int, tuple[float, ...]], float] = {}

    def error(i: int, point: tuple[float, ...]) -> float:
        if (i, point) not in seen:
            seen[i, point] = takes[i].error(with_gains(kind, space.names, point))
        return seen[i, point]

    def found(rows: Sequence[int]) -> tuple[float, ...]:
        def cost(point: tuple[float, ...]) -> float:
            return float(np.mean([error(i, point) for i in rows]))

        return find_optimum(space, start, cost, EFFORT).point

    every = range(len(takes))
    best = found(every)
    held_out = np.full(len(takes), np.nan)
    motions = list(dict.fromkeys(take.motion for take in takes))
    for motion in motions if len(motions) > 1 else []:
        others = found([i for i in every if takes[i].motion != motion])
        for i in every:
            if takes[i].motion == motion:
                held_out[i] = error(i, others)
    zeta = best[1] if len(best) > 1 else None
    own = np.array([error(i, best) for i in every])
    return Tuned(form, (best[0], zeta), own, held_out if len(motions) > 1 else np.zeros(0))


def with_gains(
    kind: OrientationFilter, names: Sequence[str], point: Sequence[float]
) -> OrientationFilter:
    """The same filter with other gains.

    Args:
        kind: The filter.
        names: Of the gains.
        point: Their values.
    """
    return get_filter(kind.name, {**kind.parameters, **dict(zip(names, point, strict=True))})
