"""Findings on what the quantities of a sensor say of one another."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "consistency.time_unit": Template(
        WARNING,
        "its stamps give {rate_hz:.3g} Hz, and gravity turns as fast as its gyroscope says at "
        "{true_rate_hz:.4g} Hz",
        "the unit of time is wrong: true times are {factor:g} of what they were taken for",
        "state it by the key time.unit of the mapping or --unit time={unit} (s, ms, us, ns), or "
        "the rate by --rate",
    ),
    "consistency.rate": Template(
        WARNING,
        "its stamps give {rate_hz:.3g} Hz, a rate that no such sensor has",
        "the unit of time, or the rate that is stated, is wrong",
        "state it by the key time.unit of the mapping or --unit time=UNIT (s, ms, us, ns), or the "
        "rate by --rate",
    ),
    "consistency.acc_unit": Template(
        WARNING,
        "|acc| {when} is {norm_m_s2:.4g} m/s^2, where gravity is 9.81",
        "it looks like {unit} taken for m/s^2",
        "in which unit is it? Answer with --unit acc=UNIT (m/s^2, g, mg), or the key acc.unit of "
        "the mapping; the unit it was read in confirms it as it is",
    ),
    "consistency.acc_norm": Template(
        WARNING,
        "|acc| {when} is {norm_m_s2:.4g} m/s^2, where gravity is 9.81",
        "its unit or scale is wrong",
        "in which unit is it? Answer with --unit acc=UNIT (m/s^2, g, mg), or the keys acc.unit "
        "and acc.scale of the mapping; the unit it was read in confirms it as it is",
    ),
    "consistency.no_gravity": Template(
        WARNING,
        "|acc| {when} is {norm_m_s2:.4g} m/s^2, where gravity is 9.81",
        "Gravity seems to have been removed; the bench needs the specific force, with gravity",
        "take the columns with gravity; --unit acc=UNIT (m/s^2, g, mg) in the unit it was read in "
        "confirms it as it is",
    ),
    "consistency.gyr_unit": Template(
        WARNING,
        "its gyroscope turns {times:.3g} times {how} for gravity",
        "it looks like {unit} taken for {read}",
        "in which unit is it? Answer with --unit gyr=UNIT (rad/s, deg/s, mdeg/s), or the key "
        "gyr.unit of the mapping; the unit it was read in confirms it as it is",
    ),
    "consistency.gyr_or_time_unit": Template(
        WARNING,
        "gravity turns {factor:g} times as far as its gyroscope says at {rate_hz:.4g} Hz",
        "the unit of time is wrong and the rate is {other_rate_hz:.4g} Hz, or the unit of the "
        "gyroscope is",
        "state the unit of time by the key time.unit of the mapping or --unit time=UNIT (s, ms, "
        "us, ns), or of counts of another length the rate by --rate, or the gyroscope's unit by "
        "gyr.unit or --unit gyr=UNIT (rad/s, deg/s, mdeg/s)",
    ),
    "consistency.gyr_factor": Template(
        WARNING,
        "gravity turns {factor:.3g} times as far as its gyroscope says",
        "{means}",
        "{mends}; --unit gyr=UNIT in the unit it was read in confirms it as it is",
    ),
    "consistency.scale_or_rate": Template(
        WARNING,
        "gravity turns {scale:.3g} times as far as its gyroscope says at {rate_hz:.4g} Hz",
        "its scale is that of another range setting, or the samples came at {other_rate_hz:.4g} "
        "Hz; gravity alone cannot tell which",
        "if the rate is right, the key gyr.scale: {scale:.3g} of the mapping mends it; if it is "
        "not, --rate {other_rate_hz:.4g} or the key rate_hz; --unit gyr=UNIT in the unit it was "
        "read in confirms it as it is",
    ),
    "consistency.gain_or_rate": Template(
        WARNING,
        "gravity turns {gain:.3g} times as far as its gyroscope says at {rate_hz:.4g} Hz",
        "its scale is wrong by that, or the samples came at {other_rate_hz:.4g} Hz; gravity alone "
        "cannot tell which",
        "if the rate is right, the key gyr.scale: {gain:.3g} of the mapping mends it; if it is "
        "not, --rate {other_rate_hz:.4g} or the key rate_hz",
    ),
    "consistency.gyr_mirrored": Template(
        WARNING,
        "gyroscope and accelerometer contradict each other: gravity turns as the gyroscope says "
        "only if its axes are {axes}",
        "one sign or two axes of the gyroscope are wrong, so that it is mirrored",
        "the key gyr.axes of the mapping states them: {axes}",
    ),
    "consistency.gyr_negated": Template(
        WARNING,
        "gyroscope and accelerometer contradict each other: gravity turns the other way about",
        "all three signs of the gyroscope are wrong, or it says how the world turns",
        "the key gyr.scale: -1 of the mapping mends it",
    ),
    "consistency.gyr_or_acc_axes": Template(
        WARNING,
        "gyroscope and accelerometer contradict each other: gravity turns as the gyroscope says "
        "only if its axes are {axes}",
        "the axes of one of the two are other ones than were taken",
        "the key gyr.axes of the mapping states them, {axes}, or acc.axes does if it is the "
        "accelerometer's that are wrong: one of {acc_axes}",
    ),
    "consistency.gyr_axes_unclear": Template(
        WARNING,
        "gyroscope and accelerometer contradict each other: gravity does not turn as the "
        "gyroscope says",
        "axes or signs of one of the two are wrong; the motion does not tell which, {axes} fit "
        "among others",
        "the keys gyr.axes and acc.axes of the mapping state them",
    ),
    "consistency.mag_unit": Template(
        WARNING,
        "the magnetic field is usually {norm_ut:.3g} uT, where the earth has 22 to 67",
        "it looks like {unit} taken for uT",
        "--unit mag={unit}, or the key mag.unit of the mapping, states it",
    ),
    "consistency.mag_norm": Template(
        WARNING,
        "the magnetic field is usually {norm_ut:.3g} uT, where the earth has 22 to 67",
        "its unit is wrong, or a magnet is near",
        "--unit mag=UNIT (uT, nT, mT, G, mG, au), or the key mag.unit of the mapping, states it",
    ),
    "consistency.mag_axes": Template(
        WARNING,
        "magnetometer and gyroscope contradict each other: the field turns as the gyroscope says "
        "only if its axes are one of {axes}",
        "the axes of the magnetometer are other ones than were taken",
        "the key mag.axes of the mapping states them; which of the two it is, the dip of the "
        "field tells: down in the north, up in the south",
    ),
    "consistency.orientation_reading": Template(
        WARNING,
        "turned by its orientation the specific force does not point up, but does if read with "
        "{keys}",
        "order or direction of the quaternion are other ones than were taken",
        "the keys quaternion.{keys} of the mapping say so",
    ),
    "consistency.orientation_ned": Template(
        WARNING,
        "turned by its orientation the specific force points down, and the field along x",
        "the earth of the quaternion is NED, where ENU was taken; or, of an iPhone, whose x points "
        "north and z up, the accelerometer has the opposite sign",
        "the key quaternion.earth: NED of the mapping mends the one, acc.scale: -1 the other "
        "{keys}",
    ),
    "consistency.acc_negated": Template(
        WARNING,
        "turned by its orientation the specific force points down, and the field north",
        "the accelerometer has the opposite sign, as that of phones",
        "the key acc.scale: -1 of the mapping mends it {keys}",
    ),
    "consistency.acc_or_mag_negated": Template(
        WARNING,
        "by its accelerometer the field points {dip_deg:.0f} deg {points}, where in the "
        "{hemisphere} it points {expected}",
        "the accelerometer has the opposite sign, as that of phones, or the magnetometer has",
        "the key acc.scale: -1 of the mapping mends the one, mag.scale: -1 the other",
    ),
    "consistency.orientation_down": Template(
        WARNING,
        "turned by its orientation the specific force points down",
        "the accelerometer has the opposite sign, as that of phones, or the earth of the "
        "quaternion has z down (NED)",
        "the key acc.scale: -1 of the mapping mends the one, quaternion.earth: NED the other "
        "{keys}",
    ),
    "consistency.orientation_earth": Template(
        WARNING,
        "turned by its orientation the specific force points along {up}",
        "the earth of the quaternion has {up} up, where z was taken",
        "turn it before the import; the filter device is of no use as it is {keys}",
    ),
    "consistency.orientation_unlike": Template(
        WARNING,
        "its orientation does not turn with its gyroscope and accelerometer, in whatever order "
        "and direction it is read",
        "it is of another sensor, of another time, or wrong",
        "leave it out of the mapping",
    ),
    "consistency.unchecked": Template(
        NOTE,
        "its motion does not show whether these are right: {in_short}",
        "",
        "turn it about two axes, and tilt it, with rests between; the sign of the accelerometer is "
        "told by an orientation of the device, or by a magnetometer and --hemisphere north or "
        "south",
    ),
}
