"""What the study `beta_zeta` says of its tables; every figure in braces is computed."""

from __future__ import annotations

QUESTION = (
    "Madgwick's filter has two gains. A thesis tuned both, by noise at rest and by sweeps against "
    "the filter on board of the sensor. What does its zeta do, how good are its gains against an "
    "arm that knows the truth, and what would the bias state of Madgwick's own report gain?"
)

IDENTITY_HOW = (
    "How to read: the largest difference in any element of the quaternion between the two forms of "
    "the filter."
)
IDENTITY = (
    "Eqs 32 to 35 of the source take 2 T zeta q* s off the angular rate w of the same sample and "
    "then form q (w) / 2 − beta s, with the unit gradient s and the interval T. But q (2 T zeta q* "
    "s) / 2 is T zeta s: what is left is w and beta + T zeta. Nothing is kept from sample to "
    "sample, so no drift is learnt and none removed. In the report of 2010 (eqs 47 to 49) the same "
    "term is summed up over the samples; that sum is the bias. Left to themselves for a whole "
    "session the two forms may still come apart, by no more than the filter trembles: its "
    "correction has a fixed size, and near the solution rounding decides its direction. The "
    "control shows the same for one filter whose beta differs in the last digit."
)

DIFFERENCE_HOW = (
    "How to read: mean length of the difference of two unit quaternions of equal sign, after the "
    "first rest; as an angle, 4 asin(d/2). The last column is the most that zeta changes it at any "
    "one beta. Ratio: of the mean differences."
)
DIFFERENCE = (
    "The source does not say how its difference was taken. If it is the length of the difference, "
    "0.1154 is an angle of {angle:.1f} deg between two filters of the same sensor. The simulated "
    "device is an error model of the orientation that stays within a degree of the truth, and the "
    "arm is no leg: ours shows the kind of figure and how little zeta matters in it, not what the "
    "thesis's sensor would have shown. A small difference to another filter is not a small error: "
    "the maps below are against the arm."
)

MAP_HOW = (
    "How to read: RMS error [deg] over what is evaluated of the first part, beta in rad/s, zeta in "
    "rad/s²."
)
STATE = (
    "Without a bias state (zeta 0) a bias turns the estimate away, and a small beta may be too "
    "slow to correct it. Too large a zeta lets the bias follow the motion."
)
MAPS = {
    "printed": (
        "Total error against the arm over both gains, zeta as printed",
        "Map, zeta as printed",
        (
            "A row changes as far as a sixtieth of zeta changes beta: zeta 1 at beta 0.01 is a "
            "beta of 0.027."
        ),
    ),
    "state": (
        "Total error against the arm over both gains, with a true bias state",
        "Map, bias state",
        STATE,
    ),
    "state_imu": (
        (
            "Inclination error against the arm over both gains, without magnetometer, with a true "
            "bias state"
        ),
        "Map, bias state, no magnetometer",
        (
            "The heading is left out: without a magnetometer it is not observed, and neither is "
            "the bias about the vertical."
        ),
    ),
}

GAINS_HOW = (
    "How to read: every form was tuned in the same way, by a grid and Nelder-Mead. The last column "
    "is the one to compare: each part is evaluated by the gains that all others chose."
)
GAINS = (
    "The form as printed cannot beat beta alone: it is beta alone. Where it differs, the search "
    "ended elsewhere on the same flat ridge."
)

BIAS_HOW = (
    "How to read: mean of the gyroscope in the rest at the beginning, and the bias that each form "
    "of the filter ends with; beside noise they differ by the part's response to gravity, which "
    "changes with the pose."
)
BIAS = "Zero: the form as printed has no bias state."

NOISE_HOW = (
    "How to read: standard deviation at rest, mean of the axes; zeta from the means of the two "
    "halves of the rest."
)
NOISE = (
    "The source prints beta = sqrt(3/4 sigma); Madgwick's report has sqrt(3/4) sigma (its eq. 49 "
    "for zeta likewise). A beta of 0.35 means a sigma of {printed:.3f} by the printed formula and "
    "{right:.3f} rad/s, or {right_deg:.0f} deg/s, by the right one: no gyroscope at rest is that "
    "noisy. Degrees taken for radians and the misplaced root give a beta of that order; where its "
    "zeta came from cannot be told."
)

BOXES = "Total error of the first part"
BOXES_HOW = "How to read: quartiles, whiskers to 1.5 interquartile ranges, against the arm."

IDENTICAL = (
    "The zeta of the thesis is an addition to beta: {first:g} and {second:g} are a beta of "
    "{together:.5f} alone. From any state that a session leads to, one step of both differs by at "
    "most {most:.0e} in any element of the quaternion."
)
DISTANCE = (
    "Its best mean difference to the device, {theirs:.4f}, is an angle of {their_angle:.1f} deg; "
    "ours, with a simulated device, is {ours:.4f}, {angle:.1f} deg."
)
GAINED = (
    "With gains tuned in the same way, {where}, the total error is {printed:.2f} deg as printed, "
    "{alone:.2f} deg with beta alone, and {state:.2f} deg with a true bias state; without "
    "magnetometer the inclination error is {imu_alone:.2f} deg with beta alone and {imu_state:.2f} "
    "deg with a bias state. The bias state against beta alone, total: {gained}; inclination: "
    "{imu_gained}."
)
