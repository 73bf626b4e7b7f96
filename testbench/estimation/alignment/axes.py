"""Axis identification: which axis of the recording is each axis of the sensor as mounted.

The readings are regressed on what the arm says the sensor felt; the signed permutation nearest to
the 3 x 3 map names the axes, its determinant the handedness, its size the unit, and what is left
the crookedness of the mounting. A swapped axis, a wrong sign and a wrong unit thus show in every
recording that moves enough, not only in the protocol made for it.

A magnetometer is the exception: the field in the world is not known, so that a map and the same
with all signs reversed fit alike, one of them mirroring the sensor. Only a map that is neither
straight nor wholly reversed can be remarked upon, as two readings; which of them holds is known to
whoever knows whether the field points down there or up.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from testbench.consistency.angular_rate import MAPS, names_of
from testbench.consistency.gain import GAIN_WITHIN as GYR_GAIN_WITHIN
from testbench.consistency.refused import WORDS
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import AxisFinding
from testbench.records.session.samples import AXES, ImuSamples, Truth

MOST_SAMPLES = 20_000
LEAST_RATE, LEAST_FORCE = np.radians(3.0), 1.0
"""RMS that an axis must see beyond what the others see, to be told from them [rad/s], [m/s^2]."""
MOST_OFFSET = 0.1
"""Part of what an accelerometer reads at rest that its offset may be."""
LEAST_FIELD_MARGIN = 3.0
"""A map of the magnetometer must explain this many times more of the field's variance than the next
best.
"""
LEAST_TILT = 0.3
"""RMS change of the vertical in the sensor that tells the conventions of a quaternion apart [1]."""


def identify_axes(
    samples: ImuSamples, time_ns: np.ndarray, static: np.ndarray, truth: Truth, gravity: np.ndarray
) -> dict[str, AxisFinding]:
    """The axes of each triad of a sensor, and the convention of its quaternion.

    Args:
        samples: As recorded.
        time_ns: Their instants on the host's clock, shape (n,) [ns].
        static: Whether each is at rest and sound, shape (n,), bool.
        truth: Of the sensor, in the axes it is believed to have.
        gravity: In the world, shape (3,) [m/s^2].

    Returns:
        By "gyr", "acc", "mag" and "device_q", those that were recorded.
    """
    pick = np.unique(
        np.linspace(0, len(time_ns) - 1, min(len(time_ns), MOST_SAMPLES)).round().astype(int)
    )
    q = truth_at(truth, time_ns[pick])
    known = np.isfinite(q[:, 0])
    found: dict[str, AxisFinding] = {}
    rate, sound = true_rates(truth, time_ns[pick])
    moving = sound & np.isfinite(samples.gyr[pick]).all(axis=1)
    if moving.sum() >= 20:
        found["gyr"] = _triad(samples.gyr[pick][moving], rate[moving], LEAST_RATE)
    rest = known & static[pick] & np.isfinite(samples.acc[pick]).all(axis=1)
    if rest.sum() >= 20:
        force = rotation.rotate(rotation.conjugate(q[rest]), -gravity)
        found["acc"] = _by_gravity(samples.acc[pick][rest], force)
    if samples.mag is not None:
        felt = known & np.isfinite(samples.mag[pick]).all(axis=1)
        if felt.sum() >= 20:
            found["mag"] = _magnetometer(samples.mag[pick][felt], q[felt], gravity)
    if samples.device_q is not None:
        given = known & np.isfinite(samples.device_q[pick]).all(axis=1)
        if given.sum() >= 20:
            found["device_q"] = _quaternion(samples.device_q[pick][given], q[given])
    return found


def findings_on(axes: dict[str, AxisFinding]) -> list[Finding]:
    """What is wrong with a sensor's axes; none where nothing is."""
    looked = [_odd(triad, own) for triad, own in axes.items()]
    return [found for found in looked if found is not None]


MOST_CROOKED_DEG = 30.0
GAINS = {
    "gyr": (180 / np.pi, "deg/s were taken for rad/s"),
    "acc": (1 / STANDARD_GRAVITY, "g were taken for m/s^2"),
}
GAIN_WITHIN = 0.25
"""A triad may read by so much more or less than it felt; a gyroscope whose motion is understood by
`GYR_GAIN_WITHIN`, as against gravity.
"""
SURE = 0.95
"""Part of the readings' variance that is explained where their size is believed [1]."""


def _is_sure(own: AxisFinding) -> bool:
    return own.axes == STRAIGHT and own.agreement is not None and own.agreement > SURE


def _odd(triad: str, own: AxisFinding) -> Finding | None:
    name = WORDS[triad]
    if own.axes is None:
        return None
    if triad == "device_q":
        usual = own.axes == AS_DOCUMENTED
        return None if usual else finding("axes.quaternion", reading=own.axes)
    if triad == "mag":
        return None if own.axes == STRAIGHT else _two_readings(own.axes, own.field_dip_deg)
    within = 1 + (GYR_GAIN_WITHIN if triad == "gyr" and _is_sure(own) else GAIN_WITHIN)
    if own.gain is not None and not 1 / within < own.gain < within:
        factor, why = GAINS.get(triad, (0.0, ""))
        if factor and 0.8 < own.gain / factor < 1.25:
            return finding("axes.gain_of_unit", triad=name, gain=own.gain, cause=why)
        return finding("axes.gain", triad=name, gain=own.gain)
    if own.axes != STRAIGHT and own.crooked_deg is not None and own.crooked_deg < MOST_CROOKED_DEG:
        code = "axes.other" if own.right_handed else "axes.mirrored"
        return finding(code, triad=name, axes=own.axes)
    return None


STRAIGHT = "x: +x, y: +y, z: +z"
BRIEF_NS = NANOSECONDS // 10
"""Between orientations that lie closer a rate is mostly their noise [ns]."""
LEVEL_DEG = 5.0
"""A field that dips by less does not tell which way is up [deg]."""


def _two_readings(axes: str, dip_deg: float | None) -> Finding:
    reversed_axes = axes.translate(str.maketrans("+-", "-+"))
    if dip_deg is None or abs(dip_deg) < LEVEL_DEG:
        return finding("axes.field_level", axes=axes, reversed=reversed_axes)
    down, up = (axes, reversed_axes) if dip_deg > 0 else (reversed_axes, axes)
    return finding("axes.field", axes=axes, reversed=reversed_axes, down=down, up=up)


def true_rates(
    truth: Truth, time_ns: np.ndarray, over_s: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """True angular rate in the sensor at times.

    Args:
        truth: Of the sensor.
        time_ns: The times, shape (n,) [ns].
        over_s: Length of the interval about each time that the rate is the mean of [s], as of a
            sensor that integrates; if 0 the truth's own rate at the instant, and of a truth
            without rates the mean over `BRIEF_NS`.

    Returns:
        The rate, shape (n, 3) [rad/s], and where it is known, shape (n,), bool.
    """
    if truth.rate is not None and over_s <= 0:
        rate = np.column_stack(
            [np.interp(time_ns, truth.host_time_ns, column) for column in truth.rate.T]
        )
        return rate, np.isfinite(rate).all(axis=1) & np.isfinite(truth_at(truth, time_ns)[:, 0])
    half = round(over_s / 2 * NANOSECONDS) or BRIEF_NS // 2
    before, after = truth_at(truth, time_ns - half), truth_at(truth, time_ns + half)
    sound = np.isfinite(before[:, 0]) & np.isfinite(after[:, 0])
    rate = np.zeros((len(time_ns), 3))
    turned = rotation.multiply(rotation.conjugate(before[sound]), after[sound])
    rate[sound] = rotation.to_rotation_vector(turned) * NANOSECONDS / (2 * half)
    return rate, sound


def _by_gravity(read: np.ndarray, felt: np.ndarray) -> AxisFinding:
    """The accelerometer's axes from rests, shapes (n, 3) [m/s^2].

    A few rests fit any three columns and an offset. An offset that no part has says that gravity is
    not where the world of the truth has it.
    """
    own = _triad(read, felt, LEAST_FORCE)
    if own.axes is None:
        return own
    # readings = response @ felt, through the origin, by the axes that were seen
    response = np.linalg.lstsq(felt, read, rcond=None)[0].T
    left = read - felt @ response.T
    off = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    if off > MOST_OFFSET * float(np.mean(np.linalg.norm(read, axis=1))):
        return AxisFinding(unseen=list(AXES))
    return own


def _triad(read: np.ndarray, felt: np.ndarray, least: float) -> AxisFinding:
    """From readings and what was felt at the same instants, each of shape (n, 3)."""
    x, y = read - read.mean(axis=0), felt - felt.mean(axis=0)
    spread = y.T @ y / len(y)
    # what each axis sees beyond the others: the residual variance when it is regressed on them
    alone = np.array([_alone(spread, j) for j in range(3)])
    seen = alone >= least
    unseen = [axis for axis, shown in zip(AXES, seen, strict=True) if not shown]
    if seen.sum() < 2:
        return AxisFinding(unseen=unseen)
    columns = np.flatnonzero(seen)
    # readings = response @ felt, shape (3, k)
    response = np.linalg.lstsq(y[:, columns], x, rcond=None)[0].T
    gain = float(np.sqrt(np.mean(np.sum(response**2, axis=0))))
    left = x - y[:, columns] @ response.T
    agreement = float(1 - np.sum(left**2) / np.sum(x**2)) if np.any(x) else float("nan")
    full = np.zeros((3, 3))
    full[:, columns] = response / gain
    if len(columns) == 2:  # the third by the right-hand rule
        third = ({0, 1, 2} - set(columns.tolist())).pop()
        full[:, third] = np.cross(full[:, (third + 1) % 3], full[:, (third + 2) % 3])
    rows = np.arange(3)
    places = max(permutations(range(3)), key=lambda order: np.abs(full[rows, order]).sum())
    nearest = np.zeros((3, 3))
    nearest[rows, places] = np.sign(full[rows, places])
    crooked = rotation.angle(rotation.from_matrix(rotation.nearest_rotation(full @ nearest.T)))
    right = bool(np.linalg.det(nearest) > 0) if len(columns) == 3 else None
    # readings = nearest @ felt
    return AxisFinding(
        names_of(nearest.T), right, gain, float(np.degrees(crooked)), agreement, unseen
    )


def _alone(spread: np.ndarray, j: int) -> float:
    others = [i for i in range(3) if i != j]
    explained = (
        spread[j, others] @ np.linalg.pinv(spread[np.ix_(others, others)]) @ spread[others, j]
    )
    return float(np.sqrt(max(spread[j, j] - explained, 0.0)))


def _magnetometer(
    read: np.ndarray, q_world_from_sensor: np.ndarray, gravity: np.ndarray
) -> AxisFinding:
    """The map that makes the field in the world most constant, whatever its direction there.

    A map with all signs reversed does as well, with the field reversed; the one that keeps the
    right hand is taken, and the dip that goes with it.
    """
    R = rotation.to_matrix(q_world_from_sensor)
    power = float(np.mean(np.sum(read**2, axis=1)))
    # world field of axis i of the readings as axis j of the sensor: R[:, :, j] read[:, i]; its mean
    # is linear in the map
    mean = np.einsum("nkj,ni->kji", R, read) / len(read)
    maps = [nearest for nearest in MAPS if np.linalg.det(nearest) > 0]
    strength = (
        np.array([np.sum(np.einsum("kji,ij->k", mean, nearest) ** 2) for nearest in maps]) / power
    )
    order = np.argsort(strength)[::-1]
    best, next_best = (1 - strength[order[k]] for k in (0, 1))
    if next_best < LEAST_FIELD_MARGIN * max(best, 1e-3):
        return AxisFinding(agreement=float(1 - best), unseen=list(AXES))
    nearest = maps[order[0]]
    field = np.einsum("kji,ij->k", mean, nearest)
    down = float(field @ gravity / np.linalg.norm(field) / np.linalg.norm(gravity))
    dip = float(np.degrees(np.arcsin(np.clip(down, -1.0, 1.0))))
    return AxisFinding(names_of(nearest.T), None, None, None, float(1 - best), [], dip)


AS_DOCUMENTED = "w x y z, earth from sensor, z up"


def _quaternion(q_given: np.ndarray, q_true: np.ndarray) -> AxisFinding:
    """Which reading of a quaternion turns the vertical as the arm did."""
    up = np.array([0.0, 0.0, 1.0])
    true = rotation.rotate(rotation.conjugate(q_true), up)
    if float(np.sqrt(np.mean(np.sum((true - true.mean(axis=0)) ** 2, axis=1)))) < LEAST_TILT:
        return AxisFinding(unseen=["tilt"])
    readings = {}
    for order, columns in (("w x y z", [0, 1, 2, 3]), ("x y z w", [3, 0, 1, 2])):
        q = rotation.normalise(q_given[:, columns])
        for way, earth_from_sensor in (
            ("earth from sensor", q),
            ("sensor from earth", rotation.conjugate(q)),
        ):
            vertical = rotation.rotate(rotation.conjugate(earth_from_sensor), up)
            for sense, sign in (("z up", 1.0), ("z down", -1.0)):
                readings[f"{order}, {way}, {sense}"] = float(
                    np.mean(np.sum(sign * vertical * true, axis=1))
                )
    best = max(readings, key=readings.__getitem__)
    rivals = [value for name, value in readings.items() if name != best]
    if readings[best] < 0.9 or readings[best] - max(rivals) < 0.05:
        return AxisFinding(agreement=readings[best])
    return AxisFinding(best, None, None, None, readings[best], [])
