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
    samples: ImuSamples,
    time_ns: np.ndarray,
    static: np.ndarray,
    truth: Truth,
    gravity: np.ndarray,
    mounting_known: bool = True,
) -> dict[str, AxisFinding]:
    """The axes of each triad of a sensor, and the convention of its quaternion.

    Args:
        samples: As recorded.
        time_ns: Their instants on the host's clock, shape (n,) [ns].
        static: Whether each is at rest and sound, shape (n,), bool.
        truth: Of the sensor, in the axes it is believed to have.
        gravity: In the world, shape (3,) [m/s^2].
        mounting_known: Whether the sensor sits as it is believed to; see `findings_on`.

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
            found["device_q"] = _quaternion(samples.device_q[pick][given], q[given], mounting_known)
    return found


def findings_on(axes: dict[str, AxisFinding], mounting_known: bool = True) -> list[Finding]:
    """What is wrong with a sensor's axes; none where nothing is.

    Args:
        axes: As `identify_axes` found them.
        mounting_known: Whether the sensor was put where it is believed to be, as in an arm's
            protocol; else it may be turned in its body by any rotation.
    """
    most = MOST_CROOKED_DEG if mounting_known else MOST_CROOKED_UNKNOWN_DEG
    looked = [_odd(triad, own, most) for triad, own in axes.items()]
    return [found for found in looked if found is not None]


MOST_CROOKED_DEG = 30.0
"""What is further from a map of axes is no exchange of them, where the mounting is known [deg]."""
MOST_CROOKED_UNKNOWN_DEG = 10.0
"""Likewise where it is not. Of mountings that may be any rotation, 0.65 % lie so near to one of the
23 maps, (23 / pi) (a - sin a) for an angle a; of exchanged axes on a sensor that sits straight
to 3 deg about each axis, 99 % do (chi-square of three).
"""
LEAST_RESPONSE = 0.4
"""Least singular value of a response of size 1 whose hand is believed [1]."""
FIELD_ROUNDS = 20
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


def _odd(triad: str, own: AxisFinding, most_crooked_deg: float) -> Finding | None:
    name = WORDS[triad]
    if own.axes is None:
        return None
    if triad == "device_q":
        usual = own.axes == AS_DOCUMENTED
        return None if usual else finding("axes.quaternion", reading=own.axes)
    straight = own.axes == STRAIGHT
    near = own.crooked_deg is not None and own.crooked_deg < most_crooked_deg
    if triad == "mag":
        return None if straight or not near else _two_readings(own.axes, own.field_dip_deg)
    within = 1 + (GYR_GAIN_WITHIN if triad == "gyr" and _is_sure(own) else GAIN_WITHIN)
    if own.gain is not None and not 1 / within < _gain_without_noise(own, within) < within:
        factor, why = GAINS.get(triad, (0.0, ""))
        if factor and 0.8 < own.gain / factor < 1.25:
            return finding("axes.gain_of_unit", triad=name, gain=own.gain, cause=why)
        return finding("axes.gain", triad=name, gain=own.gain)
    if own.right_handed is False:  # no mounting does that
        return finding("axes.mirrored", triad=name, axes=own.axes)
    return finding("axes.other", triad=name, axes=own.axes) if near and not straight else None


def _gain_without_noise(own: AxisFinding, within: float) -> float:
    """The gain nearest to 1 that noise of the truth leaves possible [1].

    Noise in what a regression goes by makes its slope smaller, by no more than the part of the
    variance that is explained (Fuller, Measurement error models, 1987, section 1.1).

    Args:
        own: The triad.
        within: Gains by which a part may be off.
    """
    gain = own.gain or 0.0
    if gain >= 1 / within or own.agreement is None or not own.agreement > 0:
        return gain
    return min(gain / own.agreement, 1.0)


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
    full[:, columns] = response / max(gain, 1e-30)
    if len(columns) == 2:  # the third by the right-hand rule
        third = ({0, 1, 2} - set(columns.tolist())).pop()
        full[:, third] = np.cross(full[:, (third + 1) % 3], full[:, (third + 2) % 3])
    elif np.linalg.svd(full, compute_uv=False)[-1] < LEAST_RESPONSE:  # flat: no hand
        return AxisFinding(agreement=agreement, unseen=unseen)
    nearest, crooked = _nearest_map(full)
    right = bool(np.linalg.det(nearest) > 0) if len(columns) == 3 else None
    # readings = nearest @ felt
    return AxisFinding(names_of(nearest.T), right, gain, crooked, agreement, unseen)


def _nearest_map(response: np.ndarray) -> tuple[np.ndarray, float]:
    """The signed permutation of the same hand that is nearest to a response, and how far [deg].

    A mounting turns, and mirrors nothing: of the other hand, one that is nearer entry by entry is
    none.

    Args:
        response: Shape (3, 3).
    """
    hand = np.sign(np.linalg.det(response))
    maps = [own for own in MAPS if np.linalg.det(own) * hand > 0]
    nearest = max(maps, key=lambda own: float(np.sum(own * response)))
    turned = rotation.nearest_rotation(response @ nearest.T)
    return nearest, float(np.degrees(rotation.angle(rotation.from_matrix(turned))))


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
    field, crooked = _field_of_a_rotation(mean, nearest)
    down = float(field @ gravity / np.linalg.norm(field) / np.linalg.norm(gravity))
    dip = float(np.degrees(np.arcsin(np.clip(down, -1.0, 1.0))))
    return AxisFinding(names_of(nearest.T), None, None, crooked, float(1 - best), [], dip)


def _field_of_a_rotation(mean: np.ndarray, nearest: np.ndarray) -> tuple[np.ndarray, float]:
    """The field in the world by the rotation that makes it strongest, shape (3,), and how far that
    is from a map [deg].

    The strength of the mean is sum over k of (mean_kji P_ij)^2; the field for a rotation and the
    rotation for a field (Kabsch 1976) are found by turns.

    Args:
        mean: World field of axis i of the readings as axis j of the sensor, shape (3, 3, 3).
        nearest: Where to begin, shape (3, 3).
    """
    turned = nearest
    for _ in range(FIELD_ROUNDS):
        field = np.einsum("kji,ij->k", mean, turned)
        turned = rotation.nearest_rotation(np.einsum("kji,k->ij", mean, field))
    own = rotation.from_matrix(turned @ nearest.T)
    return np.einsum("kji,ij->k", mean, turned), float(np.degrees(rotation.angle(own)))


AS_DOCUMENTED = "w x y z, earth from sensor, z up"


def _quaternion(q_given: np.ndarray, q_true: np.ndarray, mounting_known: bool) -> AxisFinding:
    """Which reading of a quaternion turns the vertical as the arm did.

    In an unknown mounting both verticals are compared in the best rotation (Kabsch 1976), and
    another reading is named only where it fits and the usual one does not.

    Args:
        q_given: By the device, as read, shape (n, 4).
        q_true: The truth, shape (n, 4).
        mounting_known: Whether the sensor sits as it is believed to.
    """
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
                profile = sign * true.T @ vertical / len(true)
                turned = np.eye(3) if mounting_known else rotation.nearest_rotation(profile)
                readings[f"{order}, {way}, {sense}"] = float(np.sum(turned * profile))
    best = max(readings, key=readings.__getitem__)
    if not mounting_known and readings[AS_DOCUMENTED] > readings[best] - 0.05:
        best = AS_DOCUMENTED
    rivals = [value for name, value in readings.items() if name != best]
    unsure = readings[best] - max(rivals) < 0.05 and (mounting_known or best != AS_DOCUMENTED)
    if readings[best] < 0.9 or unsure:
        return AxisFinding(agreement=readings[best])
    return AxisFinding(best, None, None, None, readings[best], [])
