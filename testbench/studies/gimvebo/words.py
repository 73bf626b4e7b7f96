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
    "The published calibrated samples have an interquartile range of 1.3 mm/s². Whether they are "
    "single samples is not said; if they were, they would have less noise than the sensor's data "
    "sheet states (400 µg/√Hz, at 50 Hz some 20 mm/s² about each axis), which no calibration takes "
    "away. They were fitted; ours are held out."
)

MAGNITUDE_SHOWN = (
    "The published calibrated samples are no single samples of such a sensor: ours, calibrated, "
    "have an interquartile range of {single:.1f} mm/s² one by one and {means:.1f} mm/s² as means "
    "of the rests, theirs 1.3 mm/s²."
)

NORM = (
    "In rad/s the norms stay at 1 by every integrator of the publication: at a steady rate a step "
    "changes them by 1 − z⁶/144 (RK4) and 1 + z⁴/8 (Heun), with z = |ω|h/2. The implicit rule of "
    "Tustin keeps |q|² (1 + z²/4): below 1 while the sensor turns, and 1 again at rest. Published "
    "norms from 0.05 to 1.33 need z of about one, which at steps of 20 or 40 ms means thousands of "
    "degrees a second, while the sensor ends at 250 about each axis. What could have made them is "
    "tried in the table of norms by hypothesis."
)

ANGLES = (
    "Ours are turns that the calibration has not seen; by which theirs were judged is not said, "
    "and there are none but those it was fitted to, which flatters. What rates in deg/s would "
    "leave stands in the table of angles in degrees."
)

HEADING = (
    "The publication judges gravity's direction alone, to which a turn about the vertical is "
    "nothing; the gimbal's angles know it."
)

INTERVALS = (
    "The publication recommends a shorter interval than its 20 ms. From rest to rest the errors of "
    "a coarse step cancel in part; what is left, the rows say. A protocol of one's own may have "
    "another rate."
)

STAGES = (
    "From rest to rest the errors of a rate that is held over each step cancel between speeding up "
    "and slowing down, but for the turning of the axes meanwhile. That speeds need not be held "
    "constant was concluded from the published difference of 13 deg; how much it takes in ours, "
    "the rows say."
)

TIME_HOW = (
    "How to read: ten turns of 200 samples, from raw readings to parameters with covariance, on "
    "the machine that ran this study and with the code already compiled; of one part. The "
    "published means are computed here from the published runs."
)

TIME = (
    "The published times are those of interpreted loops over every sample in every evaluation "
    "(MATLAB), with derivatives by differences. Ours is one compiled loop that gives the "
    "derivatives along the way. The source prints 35.37 min as the mean of Crouch-Grossman; its "
    "runs give 35.27 min."
)

NORMS_HOW = (
    "How to read: each row feeds all turns of the first part to a step of an integrator that takes "
    "deg/s for rad/s and does what the row says, each turn at the factor of our speed at which the "
    "median of its norms is the published one; ranges are from the least to the largest turn. A "
    "hypothesis in which a published figure lies outside of all turns does not make it by motions "
    "like ours; one in which all lie inside could be it. The speeds of the published motions are "
    "not known."
)

NORM_CLAIM = (
    "The norms of {published} are those of {method} with deg/s taken for rad/s, {hypothesis}: "
    "{inside} of {all} published figures lie within the range of our turns."
)

NORM_OPEN = (
    "No hypothesis of the table gives all published figures of the norms of {published}; what made "
    "them is open{above}."
)

ABOVE_ONE = ", and so is what made norms above 1"

ANGLES_HOW = (
    "Rates in deg/s are taken for rad/s, without bias; the fit of nine parameters begins at scales "
    "of one, where π/180 would be right. By the turns that were fitted."
)

ANGLE_CLAIM = (
    "{row}: deg/s taken for rad/s leave {median:.0f} deg (quartiles {q1:.0f} to {q3:.0f}), "
    "published is a median of {published:g} deg."
)

ANGLE_OPEN = (
    "Why the medians that lie outside of our quartiles do so is open: the published motions, the "
    "start of the fit and where it ended are not known."
)

PARAMETERS_HOW = (
    "How to read: of the first part; the source prints no parameters. Estimators never see the "
    "true values; they are rebuilt here from the seed. The condition number of the fit is "
    "{condition:.1f}."
)

FOUND_ANGLE = (
    "After calibration gravity is found again within {rk4} deg (RK4), {cg4} deg (CG4) and "
    "{tustin} deg (Tustin), the median of {turns}{parts}."
)

PUBLISHED_ANGLE = "The published angles are 23.72, 22.67 and 55.77 deg, of turns that were fitted."

FOUND_G = (
    "With the gyroscope's response to gravity fitted as well, the median is {with_g} deg (RK4); "
    "against without: {shown}."
)

FOUND_INTEGRATOR = (
    "From Euler to CG4 the medians of the integrators lie within {spread:.3f} deg of one another "
    "at {interval:.0f} ms, or {percent:.1f} % of their mean. CG4 against RK4: {shown}."
)

FOUND_HEADING = (
    "The heading, which gravity cannot judge, is off by {nine} deg after the turn (RK4, median), "
    "and by {with_g} deg with g-sensitivity."
)

FOUND_TIME = (
    "A whole calibration takes {0:.3f} s (RK4), {1:.3f} s (CG4) and {2:.3f} s (Tustin) on this "
    "machine."
)

PUBLISHED_TIME = "The published times are 106, 2116 and 7106 s, in MATLAB on a machine of 1.70 GHz."

FOUND_MAGNITUDE = (
    "The mean squared error of the accelerometer's magnitude is {raw:.2g} (m/s²)² before "
    "calibration and {calibrated:.1g} after, means of held-out rests."
)

PUBLISHED_MAGNITUDE = (
    "The published mean squared errors are 0.0667 and 8.9e-7, on data that were fitted."
)

FOUND_PARAMETERS = (
    "Of {count} parameters of {parts} parts {inside} lie within 1.96 standard uncertainties of the "
    "errors that the parts were drawn with."
)

FOUND_FITTING = (
    "{published}: of {tried} hypotheses with deg/s taken for rad/s, {fitting} every published "
    "figure of the norms within the range of our turns{which}."
)
