"""What the study `gimvebo` says of its tables; every figure in braces is computed."""

from __future__ import annotations

QUESTION = (
    "A gyroscope is calibrated by turning it from rest to rest and asking that its integrated "
    "rates lead from gravity before to gravity after. How much does the integrator matter, how "
    "long does it take, and how good does the sensor become?"
)

BOX_HOW = (
    "How to read: quartiles and whiskers of a box plot (to 1.5 interquartile ranges), outliers one "
    "by one where they are few; rows in italics are the published ones."
)

MAGNITUDE = (
    "Single samples of our part scatter by {noise:.1f} mm/s² about each axis, the data sheet's 400 "
    "µg/√Hz at 50 Hz, and no calibration takes that away. The published calibrated samples have an "
    "interquartile range of 1.3 mm/s², less than this noise allows: they must be averages, or "
    "low-passed far below 50 Hz. Their fair neighbour is our row of means, which is held out; the "
    "published values are those that the calibration was fitted to. The raw ones fit a tolerance "
    "of 3 % in scale and of 50 to 80 mg in zero."
)

NORM = (
    "Over a whole turn a correct RK4 keeps the norm within {rk4:.1e} and a correct trapezoid "
    "within {trapezoid:.1e}: at a steady rate a step changes it by 1 − z⁶/144 and 1 + z⁴/8, with z "
    "= |ω|h/2. Norms from 0.05 to 1.33 need z of about one, which at steps of 20 or 40 ms means "
    "thousands of degrees a second, while the sensor ends at 250: the published values of RK4 and "
    "Tustin look like an implementation error, and the table of faults shows which. For "
    "Crouch-Grossman both are 1, as they must be."
)

ANGLES = {
    "rk4": (
        "Ours are turns that the calibration has not seen; the published ones are those it was "
        "fitted to, which flatters them. An uncalibrated gyroscope of this kind has a zero rate of "
        "up to 20 deg/s, 80 deg over 4 s; angles about 90 deg are those of directions that have "
        "nothing to do with one another. Tens of degrees that remain after a calibration are not "
        "the sensor's: its noise makes a hundredth of a degree in 4 s. They look like an "
        "implementation error: rates in deg/s integrated as rad/s leave angles of this kind (table "
        "of faults)."
    ),
    "cg4": (
        "As beside table 4.3: the published median looks like one of rates in deg/s, not of the "
        "integrator. Ours can hardly tell Crouch-Grossman from RK4: its rates between the samples "
        "are interpolated, which holds it to order 2."
    ),
    "trapezoid": (
        "As beside table 4.3. The published trapezoid is worse than the others by a factor of two; "
        "ours stands in the table. The misplaced 1/2 with which its eq. 2.36 is printed does not "
        "tell why: eq. 2.38, of RK4, has it as well, and see the table of faults for what it does "
        "to the angle."
    ),
}

STAGES = (
    "From rest to rest the errors of a rate that is held over each step cancel between speeding up "
    "and slowing down, but for the turning of the axes meanwhile; at 20 ms and these speeds little "
    "is left. The published difference of 13 deg needs steps in which the sensor turns by about a "
    "radian, so it too looks like rates in deg/s. That speeds need not be held constant was "
    "concluded from it; how much it takes in ours, the rows say."
)

TIME_HOW = (
    "How to read: ten turns of 200 samples, from raw readings to parameters with covariance, on "
    "the machine that ran this study and with the code already compiled. The published means are "
    "computed here from the published runs."
)

TIME = (
    "The published times are those of interpreted loops over every sample in every evaluation "
    "(MATLAB, 1.70 GHz), with derivatives by differences. Ours is one compiled loop that gives the "
    "derivatives along the way. The source prints 35.37 min as the mean of Crouch-Grossman; its "
    "runs give 35.27 min."
)

FAULTS_HOW = (
    "The speeds of the published motions are not known: the norms are shown at ours (median "
    "{speed:.0f} deg/s), and at the speed at which the median agrees. The angles are those of the "
    "turns that were fitted, as published."
)

FAULTS = (
    "Rates in deg/s taken for rad/s give RK4 norms that are 1 while nothing moves and fall to "
    "hundredths while it does. They also leave the search for scales, which starts at 1 where "
    "π/180 would be right, in a minimum near its start: angles of about 90 deg before, tens of "
    "degrees after, as published. The factor 1/2 before the bracket, as eq. 2.36 is printed, "
    "together with it puts the norm of a Tustin step at 0.5 and above.{agree} Eq. 2.38 prints the "
    "same 1/2 for RK4, but there the published third quartile of 1 excludes it: a step at rest "
    "would have the norm 0.5. So it is a misprint at least once, and may be one both times. "
    "{angle} Not everything is explained: Tustin norms below 0.5 cannot come about in this way, "
    "the quartiles hang on how the published motions divide into rest and turning, and how the "
    "norms were taken is not said. The text alone does not decide."
)

AGREE = (
    " The two faults were matched to the two published medians one by one, and ask for {speeds} of "
    "the motors: {0:.2f} and {1:.2f} times ours."
)

SPEEDS = {1.05: "nearly the same speed", 1.2: "similar speeds", float("inf"): "different speeds"}
"""By the largest ratio of two speeds that may be called so."""

TUSTIN_ANGLE = (
    "{which} the factor of two in the angle of Tustin: with rates in deg/s {plain:.1f} deg are "
    "left after the fit, and {printed:.1f} deg with the 1/2, which doubles the turn of a step, as "
    "well; published are {published:.1f} deg."
)

EXPLAINED = {True: "The two together may explain", False: "The two together do not explain"}
"""Whether what they leave comes to nine tenths of what was published."""


def agreement(first: float, second: float) -> str:
    """The sentence on two factors of the speed, with the word that their ratio allows."""
    ratio = max(first, second) / min(first, second)
    return AGREE.format(
        first, second, speeds=next(words for most, words in SPEEDS.items() if ratio <= most)
    )


def tustin_angle(plain: float, printed: float, published: float) -> str:
    """The sentence on what the two faults leave of the angle, medians in deg, and whether that
    explains the published one.
    """
    explained = EXPLAINED[max(plain, printed) >= 0.9 * published]
    return TUSTIN_ANGLE.format(which=explained, plain=plain, printed=printed, published=published)


PARAMETERS_HOW = (
    "How to read: the source prints no parameters. Estimators never see the true values; they are "
    "rebuilt here from the seed. The condition number of the fit is {condition:.1f}."
)

FOUND_ANGLE = (
    "After calibration gravity is found again within {rk4:.2f} deg (RK4) and {cg4:.2f} deg (CG4), "
    "the median of ten held-out turns; published are 23.72 and 22.67 deg, on turns that were "
    "fitted."
)

FOUND_G = (
    "With the gyroscope's response to gravity fitted as well, the median is {with_g:.3f} deg "
    "(RK4); against without: {shown}."
)

FOUND_INTEGRATOR = (
    "From Euler to CG4 the medians of the integrators lie within {spread:.3f} deg of one another "
    "at 20 ms, or {percent:.1f} % of their mean."
)

FOUND_TIME = (
    "A whole calibration takes {0:.3f} s (RK4), {1:.3f} s (CG4) and {2:.3f} s (Tustin) on this "
    "machine; published are 106, 2116 and 7106 s."
)

FOUND_MAGNITUDE = (
    "The mean squared error of the accelerometer's magnitude is {raw:.2g} (m/s²)² before "
    "calibration and {calibrated:.1g} after, held-out means; published: 0.0667 to 8.9e-7, on data "
    "that were fitted."
)

FOUND_FAULT = (
    "The published norms, and the tens of degrees after calibration, are of the kind that rates in "
    "deg/s taken for rad/s give."
)
