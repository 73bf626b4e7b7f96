"""Sentences of certificates, in one place; named values stand in braces."""

from __future__ import annotations

SIMULATED = (
    "Simulated: the samples come from {parts}. This document rehearses a certificate and is none: "
    "it says nothing of any sensor that exists, and must not be used as if it did."
)
NOTHING_MEASURED = "None: nothing was measured."
NOT_TRACEABLE = "Metrological traceability is not claimed: no certificate of a reference is stated."
NO_REFERENCE = (
    "Metrological traceability is not claimed: the results were held against no reference."
)
UNKNOWN_TRUTH = (
    "Metrological traceability is not claimed: of no result it is known how far its reference may "
    "be off."
)
LABORATORY_STATES = "The laboratory states: {text}"
ARM_REFERENCE = (
    "Reference: the joints of the arm {arm} through its kinematics. What its file says of how far "
    "they may be off: {why}"
)
ONLY_ITEMS = (
    "The results relate only to the items identified here, as they were mounted, switched on and "
    "configured in this session. A new power-up, mounting, firmware or temperature is not in them."
)
NO_INTERVAL = "No interval until the next calibration is recommended; its user decides on that."
IN_FULL = "This document may be reproduced in full only, unless the laboratory agrees in writing."
NO_ACCREDITATION = "It is not issued under any accreditation."
ACCREDITATION = "Accreditation, as the laboratory states it: {text}."

NOISE_TITLE = "Certificate of noise at rest"
REST_TAKEN = (
    "The longest rest of the recording without a gap was taken: {count} samples over {span:.0f} s. "
    "The orientation of the part at rest was not prescribed."
)
ALLAN = (
    "Overlapping Allan deviation over averaging times of that rest, and a fit of white noise, bias "
    "instability and random walk of the rate to it, weighted by its effective degrees of freedom; "
    "white noise that went through a low pass is fitted with it (IEEE Std 952-1997, annex C)."
)
NOISE_UNCERTAINTY = (
    "U is the expanded uncertainty, k = 1.96 times the standard uncertainty of the fit, for 95 %. "
    "It holds how far chance may have moved the result over this one rest. It does not hold the "
    "scale of the part, nor what another power-up, temperature, orientation or specimen would "
    "change."
)
OWN_UNITS = (
    "The part reads in its own units; its scale was held against no reference. Averaging times are "
    "by the time stamps of the recording, which were held against no standard."
)
WHITE_NOISE = (
    "{triad} of {sensor}: white noise of at most {shown} {unit} (axis {axis}), over {span:.0f} s "
    "at rest."
)
NO_WHITE_NOISE = "No white noise of {sensor} stood out over {span:.0f} s at rest."
TRIAD_NOT_OBSERVED = (
    "{triad}: nothing was observed; the recording holds none, or its reading never changed."
)
NO_REST_SHOWS = (
    "Bias, scale, axes, nonlinearity and response to temperature: a rest shows none of them."
)
TOO_SLOW = "Changes over more than about {half:.0f} s: the rest is too short for them."

CALIBRATION_TITLE = "Calibration certificate"
CALIBRATED = "Calibrated of {sensor}: {methods}."
PARAMETERS = (
    "Parameters are those of the method that is named (docs/calibration.md); whatever the method, "
    "corrected = matrix · (raw − bias − drift · (T − reference) − g_matrix · force), which the "
    "calibration file holds."
)
CALIBRATED_ANEW = (
    "The sensor was calibrated anew from the raw files by the best methods that they allow, as "
    "“testbench calibrate” does where no method is named."
)
CALIBRATION_KEPT = (
    "The parameters are those of the calibration file {file} (SHA-256 {digest}), which was made "
    "from this session."
)
CALIBRATION_UNCERTAINTY = (
    "U is the expanded uncertainty for 95 %: k times the standard uncertainty of the fit, k by "
    "Student's t for its degrees of freedom. It holds the noise, the arm's errors where the method "
    "asks the arm, and what the model was found to lack. It does not hold how the part changes "
    "with time, at another power-up, or beyond the temperatures of this session."
)
GRAVITY = (
    "Reference of the accelerometer: gravity, taken as {gravity:.5f} m/s² unless the robot file "
    "says otherwise."
)
NOT_CALIBRATED = "Noise and bandwidth were not calibrated."

PERFORMANCE_TITLE = "Test certificate"
PERFORMANCE_UNCERTAINTY = (
    "U is the expanded uncertainty for 95 % of what the truth may be off by, from a budget after "
    "JCGM 100:2008 (docs/uncertainty.md); of delays and settling times it is 1.96 times their own "
    "standard uncertainty. It does not hold the scatter of this session: the 95 % interval does, "
    "for the same part mounted and switched on as it is. What another part, mounting or power-up "
    "would change is in neither."
)
MOVED = "The arm moved the sensors through the protocol {protocol}: {steps} steps were finished."
CAME_WITH_TRUTH = "A recording was evaluated against the truth that came with it."
BY_FILTERS = "Orientations by {filters}; sources in docs/methods.md."
CORRECTED_FIRST = (
    "Raw samples of {sensor} were corrected first by the calibration of session {session}."
)
TUNED = "Parameters of {filters} were tuned on other sessions."
OWN_QUANTITIES = (
    "The sensors' own quantities (rates, forces, fields) were not held against a reference: bias, "
    "scale and noise are not stated here."
)
OTHER_MOTIONS = (
    "Nothing is stated of other motions, nor of filters, joints and sensors without a row in the "
    "tables."
)
NO_LIMITS = "No limits were stated."
DECISION_RULE = (
    "Outcome: {outcome}. Decision rule: guard bands of U on both sides of a limit "
    "(ILAC-G8:09/2019, 4.2; JCGM 106:2012, 8.3): pass keeps it even if the truth is off by U, fail "
    "breaks it even then, marginal lies between, or keeps it while U cannot be stated. At the edge "
    "of a pass the truth is beyond the limit with a probability of 2.5 % at most."
)
EQUAL_SESSIONS = "Where equal sessions were named, their scatter is in the guard band as well."
"""Of the decision rule."""
OTHERWISE = (
    "{metric} by {filter}: the guard band holds the scatter of {sessions} equal sessions; a "
    "further one would come out otherwise in {percent:.0f} %."
)
NO_U = "No U by {filters}: {why}."
NO_INTERVAL_KNOWN = (
    "A dash for an interval: it is not known from this session; evaluation.json says why."
)
ERROR_MODEL = (
    "The orientation by “device” is an error model here, and no device computed it: its rows test "
    "the bench alone."
)
