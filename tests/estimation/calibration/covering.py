"""How often the 95 % intervals that calibrations state hold the truth: one trial after the other,
each by its number, so that tests ask for some and the benchmark `intervals` for thousands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from testbench.estimation.calibration.gyroscope import IN_RUN
from testbench.estimation.calibration.methods import METHODS, get_method, methods_of
from testbench.estimation.calibration.poses import StaticPoses
from testbench.records.results.fit import Fit
from tests.estimation.calibration.gyroscopes import Gyroscope, Motion, chain, record
from tests.estimation.calibration.simulated import (
    FIELD,
    GRAVITY,
    LEVEL,
    SIX,
    UP,
    all_of,
    part,
    poses_of,
    rng,
    truth_of,
    turned,
)

PLANE = GRAVITY * np.array([[np.cos(a), 0, np.sin(a)] for a in np.linspace(0, 5, 8)])
NOISE = 2e-3
"""Of a mean [m/s^2]: 120 ug/sqrt(Hz) at 60 Hz over two seconds is 0.6 mm/s^2."""
DRIFT = np.array([0.004, -0.002, 0.001])
"""Change of an accelerometer's bias with temperature [m/s^2/K]."""
FIELD_NOISE = 0.1
TILT = np.radians(0.1)
"""Of the vertical by the accelerometer."""
DIP = float(np.arcsin(40.0 / np.linalg.norm(FIELD)))
WORLD = Rotation.random(24, rng=rng(11)).inv()
GYROSCOPE_NOISE = np.radians(0.05)

Trial = Callable[[int], np.ndarray]
"""From the number of a trial to which parameters' intervals held the truth, shape (p,), bool."""


def held(trial: Trial, numbers: Iterable[int]) -> np.ndarray:
    """In how many trials each parameter's interval held the truth, shape (p,)."""
    return np.sum([trial(number) for number in numbers], axis=0)


def chance(trials: int) -> tuple[int, int]:
    """The fewest and the most of so many 95 % intervals that hold the truth, but by a chance of one
    in ten thousand on either side.
    """
    fewest, most = binom.ppf([1e-4, 1 - 1e-4], trials, LEVEL)
    return int(fewest), int(most)


def as_often_as_stated(inside: np.ndarray, trials: int) -> bool:
    """Whether intervals held the truth as often as 95 % ones do."""
    fewest, most = chance(trials)
    return bool(((inside >= fewest) & (inside <= most)).all())


def _drawn(number: int) -> np.random.Generator:
    return np.random.default_rng([2024, number])


def _inside(fits: tuple[Fit, ...], truth: np.ndarray) -> np.ndarray:
    values, _, half = all_of(fits)
    return np.abs(values - truth) <= half


def set_up(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poses, response and bias that a method for accelerometers is made for."""
    response, bias = part()
    if name == "six_position":
        return SIX, np.diag(np.diag(response)), bias
    if name == "ferraris":
        return SIX, response, bias
    if name == "rotational_3d":
        return turned(UP, 20), response, np.zeros(3)
    if name.startswith("rotational_2d"):
        response = np.array([[1.01, 0, 0.02], [0, 1, 0], [-0.03, 0, 0.98]])
        return PLANE, response, np.array([0.1, 0, -0.05]) * name.endswith("bias")
    if name.startswith("rotational_nearest"):
        return (
            turned(UP, 20),
            Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix(),
            bias * name.endswith("bias"),
        )
    return turned(UP, 20), response, bias


def truth_for(name: str, response: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """What such a method's parameters are."""
    if name.startswith("rotational_2d"):
        A = np.linalg.inv(response[np.ix_([0, 2], [0, 2])])
        return (
            np.column_stack([A, -A @ bias[[0, 2]]]).reshape(-1)
            if name.endswith("bias")
            else A.reshape(-1)
        )
    if name.startswith("rotational_nearest"):
        vector = Rotation.from_matrix(response).as_rotvec()
        return np.concatenate([vector, bias]) if name.endswith("bias") else vector
    return truth_of(name, response, bias)


def accelerometer(name: str, number: int) -> np.ndarray:
    """A calibration of an accelerometer by poses that suit the method."""
    forces, response, bias = set_up(name)
    crooked = 5e-4 if name in ("attitude_aided", "ferraris") else 0.0
    poses = poses_of(forces, response, bias, NOISE, _drawn(number), crooked)
    return _inside(METHODS[name].function(poses).fits, truth_for(name, response, bias))


def rotation(name: str, number: int) -> np.ndarray:
    """A calibration that is a rotation: its error is a small one about the sensor's axes, not a
    difference of vectors.
    """
    forces, response, bias = set_up(name)
    poses = poses_of(forces, response, bias, NOISE, _drawn(number))
    (fit,) = METHODS[name].function(poses).fits
    left = Rotation.from_matrix(response) * Rotation.from_rotvec(fit.values[:3]).inv()
    errors = np.concatenate([left.as_rotvec(), fit.values[3:] - bias[: len(fit.values) - 3]])
    return np.abs(errors) <= fit.half_width()


def fewest_poses(name: str, count: int, number: int) -> np.ndarray:
    """A calibration by so few poses that no residual is left, and the known noise is believed."""
    _, response, bias = set_up(name)
    forces = turned(UP, 20)[[0, 5, 9, 13]][:count]
    poses = poses_of(forces, response, bias, NOISE, _drawn(number))
    return _inside(METHODS[name].function(poses).fits, truth_for(name, response, bias))


def heated(draw: np.random.Generator | None = None) -> StaticPoses:
    """Poses of an accelerometer whose bias follows its temperature; without noise if not drawn."""
    temperature = np.linspace(18.0, 34.0, 24) + rng(1).normal(size=24)
    noise = 0.0 if draw is None else NOISE
    cold = poses_of(turned(UP, 24), *part(), noise, draw, temperature=temperature)
    warm = temperature - temperature.mean()
    return replace(cold, mean=cold.mean + warm[:, None] * DRIFT)


def drift(name: str, number: int) -> np.ndarray:
    """A calibration with the drift of the bias among its parameters."""
    fits = METHODS[name].function(heated(_drawn(number))).fits
    return _inside(fits, np.concatenate([truth_of(name, *part()), DRIFT]))


def iron() -> tuple[np.ndarray, np.ndarray]:
    """Soft iron with a magnetometer that sits crookedly by 4 deg, and hard iron."""
    soft = np.array([[1.05, 0.03, -0.02], [0.01, 0.96, 0.04], [0.02, -0.03, 1.02]])
    crooked = Rotation.from_rotvec([0.05, -0.04, 0.03]).as_matrix()
    return soft @ crooked, np.array([30.0, -12.0, 8.0])


def field_poses(draw: np.random.Generator | None = None, tilt: float = 0.0) -> StaticPoses:
    """Readings of the earth's field near iron in 24 poses, and the vertical of each."""
    noise = 0.0 if draw is None else FIELD_NOISE
    poses = poses_of(WORLD.apply(FIELD), *iron(), noise, draw)
    vertical = WORLD.apply([0.0, 0.0, 1.0])
    if draw is not None and tilt:
        vertical = Rotation.from_rotvec(tilt * draw.standard_normal((24, 3))).apply(vertical)
    return replace(poses, vertical=vertical, vertical_sd=tilt)


def iron_truth(name: str) -> np.ndarray:
    """What the parameters of a method for magnetometers are."""
    truth = truth_of(name, *iron())
    return np.append(truth, DIP) if name == "ellipsoid_dip" else truth


def magnetometer(name: str, number: int) -> np.ndarray:
    """A calibration of a magnetometer."""
    tilt = TILT if name == "ellipsoid_dip" else 0.0
    poses = field_poses(_drawn(number), tilt)
    return _inside(METHODS[name].function(poses).fits, iron_truth(name))


@cache
def wandering() -> list[Motion]:
    """Turns about all axes at once."""
    return chain("wandering", 12, np.random.default_rng(5), interval=0.02, duration=3.0)


def gyroscope_truth(gyroscope: Gyroscope) -> dict[str, float]:
    """What the parameters of the methods for gyroscopes are, by name."""
    response = {
        f"gyr_response_{a}{b}": gyroscope.response[i, j]
        for i, a in enumerate("xyz")
        for j, b in enumerate("xyz")
    }
    return gyroscope.tedaldi() | response


def gyroscope(method: str, number: int) -> np.ndarray:
    """A calibration with its own part, noise, errors of the directions and drift of the bias
    between rests and turns.
    """
    draw = _drawn(number)
    own = Gyroscope.draw(draw, GYROSCOPE_NOISE, g=0.0 if method == "gravity_turns" else 0.1)
    in_run = 0.0 if method == "rate_table" else IN_RUN
    recording = record(own, wandering(), draw, rest_s=1.0, up_sd=2e-4, in_run=in_run)
    (fit,) = get_method(method).function(recording).fits
    truth = gyroscope_truth(own)
    return _inside((fit,), np.array([truth[name] for name in fit.names]))


NEAREST = ("rotational_nearest", "rotational_nearest_bias")
TRIALS: dict[str, Trial] = {
    **{
        f"accelerometer {name}": partial(rotation if name in NEAREST else accelerometer, name)
        for name in methods_of("accelerometer")
    },
    **{f"drift {name}": partial(drift, name) for name in ("attitude_aided", "norm_only")},
    **{
        f"no residual {name}": partial(fewest_poses, name, count)
        for name, count in (
            ("rotational_3d", 3),
            ("axis_model", 4),
            ("rotational_3d_bias", 4),
            ("attitude_aided", 4),
        )
    },
    **{f"magnetometer {name}": partial(magnetometer, name) for name in methods_of("magnetometer")},
    **{
        f"gyroscope {name}": partial(gyroscope, name)
        for name in ("gravity_turns", "attitude", "rate_table")
    },
}
"""Every kind of calibration of which it is asked, by what a person calls it."""
