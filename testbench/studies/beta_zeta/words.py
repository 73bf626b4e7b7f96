"""What the study `beta_zeta` says of its tables; every figure in braces is computed."""

from __future__ import annotations

QUESTION = (
    "Madgwick's filter has two gains. A thesis tuned both on a leg, by noise at rest and by "
    "sweeps against the filter on board of the sensor. What does its zeta do, how good are its "
    "gains on a leg that walks, stands and sits down, and what would the bias state of Madgwick's "
    "own report gain?"
)
OVER_PARTS = "standard deviation over the parts"

IDENTITY_HOW = (
    "How to read: the largest difference in any element of the quaternion between the two forms "
    "of the filter after one step, from every state that the first take leads the one with zeta "
    "to. Together is the beta that stands for both gains; in the text's form it changes with the "
    "size of the gradient, whose mean is taken here."
)
IDENTITY = (
    "Eqs 32 to 35 of the source take 2 T zeta q* s off the angular rate w of the same sample and "
    "then form q (w) / 2 − beta s/|s|. But q (2 T zeta q* s) / 2 is T zeta s: what is left is w "
    "and beta + T zeta |s|, if s is the gradient, as eq. 33 prints it; the program that the "
    "thesis used has the unit gradient there, and beta + T zeta. Nothing is kept from sample to "
    "sample, so no drift is learnt and none removed. In the report of 2010 (eqs 47 to 49) the "
    "same term is summed up over the samples; that sum is the bias."
)

DIFFERENCE_HOW = (
    "How to read: mean length of the difference of two unit quaternions of equal sign, mean over "
    "the parts; as an angle, 4 asin(d/2). Best are the gains of a sweep that come nearest to the "
    "device; the last column is the most that zeta changes it at any one beta."
)
DIFFERENCE = (
    "The source does not say how its difference was taken, nor of which sensor and take it is. If "
    "it is the length of the difference, 0.1154 is an angle of {angle:.1f} deg between two "
    "filters of the same sensor. A small difference to another filter is not a small error: the "
    "simulated device is an error model that stays within a degree or two of the truth, so that "
    "this is nearly the filter's error."
)
NO_DEVICE = (
    "The sensors of this recording report no orientation: there is no device to compare with."
)

ERRORS_HOW = (
    "How to read: RMS error against the truth [deg], total with a magnetometer, inclination "
    "without, mean over the parts. Each take begins anew. The force column is the RMS of how far "
    "the size of the specific force is from gravity's, of the sensor itself."
)
ERRORS = "Beta 0.35 and zeta 0.07 are the gains that the source found by noise."
GAINS_HOW = (
    "How to read: gains by a grid and Nelder-Mead over all takes, and the mean error by them; "
    "then each motion by the gains that the other motions choose. All in degrees, mean over the "
    "parts."
)
GAINS = (
    "Held out is what a user gets who tunes on other motions than those that come. The form of "
    "the upstream code cannot beat beta alone: it is beta alone. Where it differs, the search "
    "ended elsewhere on the same flat ridge."
)
CHANGES_HOW = (
    "How to read: geometric mean of the ratio of both errors, held out, as a change, with its "
    "interval of 95 % by Student's t, once over the parts and once over motions and sensors. Less "
    "or more is shown only where both intervals leave zero out."
)
CHANGES = "The same parts and motions stand on both sides."

BIAS_HOW = (
    "How to read: mean of the gyroscope in the rest at the beginning, and the bias that each form "
    "ends the walk with, of the first part; beside noise they differ by the part's response to "
    "gravity, which changes with the pose."
)
BIAS = "Zero: the source's form has no bias state."

NOISE_HOW = (
    "How to read: standard deviation at rest, mean of the axes; zeta from the means of the two "
    "halves of the rest; mean over the parts."
)
NOISE = (
    "The source's eq. 46 is beta = sqrt(3/4 sigma); Madgwick's report has sqrt(3/4) sigma, and "
    "for zeta likewise. A beta of 0.35 means a sigma of {printed:.3f} by the first and "
    "{right:.3f} rad/s, or {right_deg:.0f} deg/s, by the second: no gyroscope at rest is that "
    "noisy."
)
DEGREES = "deg/s taken for rad/s, and the root over the noise, put beta at tenths"

TIME_HOW = (
    "How to read: time of one sample on one core of the machine that ran this, the median of "
    "{times} runs over the first walk; compiled code of this bench, but for fusion and vqf, whose "
    "own libraries run."
)
TIME = (
    "The source claims the efficiency of Madgwick's filter and measures no time; its closed "
    "filter cannot be timed."
)

BOXES = "Total error of the first part by take"
BOXES_HOW = "How to read: quartiles, whiskers to 1.5 interquartile ranges, against the truth."
CURVES_HOW = (
    "How to read: first part, the source's gains (0.35, 0.07) by the upstream code, and the "
    "device of the simulation, an error model."
)
OWN_CURVES_HOW = (
    "How to read: beta 0.35 and zeta 0.07 by the upstream code, and the device's own orientation "
    "where it reports one."
)
QW_HOW = "How to read: first take, zeta 0.07; the source's figures 30 and 31 have such gains."
JUMPS_HOW = (
    "How to read: yaw as the conversion gives it, within half a turn, and without its jumps of a "
    "whole turn."
)

IDENTICAL = (
    "The zeta of the thesis is an addition to beta: {first:g} and {second:g} are a beta of "
    "{text:.5f} by its text and {together:.5f} by the program that it used. One step of both "
    "forms differs by at most {most:.0e} in any element of the quaternion, from any state that a "
    "take leads to."
)
DISTANCE = (
    "With the thesis's gains Madgwick's filter is {spread} from the device in mean length of the "
    "quaternion difference, by sensor and motion; published is {theirs:.4f} at best, of an "
    "unnamed one."
)
OWN_DISTANCE = "With beta 0.35 and zeta 0.07 the filter is {spread} from the device in mean length."
