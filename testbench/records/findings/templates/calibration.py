"""Findings of `calibrate`: what a calibration's model lacks, what it rests on, what is refused."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "calibration.trend": Template(
        WARNING,
        "its readings at rest drift through the recording by {change} {unit}, {how}",
        "the bias is that of the middle of the poses, the drift was taken out before the fit, and "
        "the stated uncertainty of the bias holds it, for a later session may find the part "
        "colder or warmer",
        "let the sensor warm up before the first pose, or record its temperature",
    ),
    "calibration.temperature": Template(
        WARNING,
        "its readings at rest go with its temperature otherwise than the model has it",
        "the stated uncertainties were widened by what that does to the parameters",
        "more poses at each temperature, or a part that has warmed up",
    ),
    "calibration.nonlinear": Template(
        WARNING,
        "its response is no straight line: terms of the {order} power add {size} {unit} at 1 g",
        "scale and cross-axis hold at 1 g and in these directions alone; the stated uncertainties "
        "were widened by what the terms do to them",
        "a range that is wide against 1 g, or a part that is more linear",
    ),
    "calibration.residuals": Template(
        WARNING,
        "its model leaves residuals {ratio:.1f} times what their noise explains ({dof} degrees of "
        "freedom)",
        "something is not in the model; the stated uncertainties were widened by that factor "
        "(Birge's ratio), which is right if it is drawn anew in each pose and too little if not",
        "look at the table of poses for one that stands out",
    ),
    "calibration.field": Template(
        WARNING,
        "its residuals are {ratio:.1f} times what their noise explains",
        "the field is not the same in all poses: the arm, its motors or the bench disturb it; hard "
        "and soft iron hold part of that. The stated uncertainties were widened to what errors as "
        "large as all residuals together can do",
        "turn the sensor by hand in one place far from the arm, or name `known_field` where "
        "the field of every pose is known",
    ),
    "calibration.field_refused": Template(
        WARNING,
        "it is not calibrated: the residuals of {method} are {ratio:.1f} times what their noise "
        "explains",
        "the field is not the same in all poses: the arm, its motors or the bench disturb it, and "
        "hard iron by these poses would be that of the bench",
        "turn the sensor by hand in one place far from the arm; --method {method} calibrates it "
        "all the same",
    ),
    "calibration.clipped": Template(
        WARNING,
        "the {triad} is clipped ({limits})",
        "readings at the end of a range are no measurements, and a calibration by them has wrong "
        "scales; it is not calibrated",
        "record again with a wider range, or move more slowly",
    ),
    "calibration.clipped_moving": Template(
        WARNING,
        "the {triad} is clipped between the rests ({limits})",
        "rests within its range calibrate it all the same; what needs its readings in motion, such "
        "as a gyroscope's response to force or an orientation, is wrong there",
        "record again with a wider range, or move more slowly",
    ),
    "calibration.missed": Template(
        WARNING,
        "by {method} the turns that are held out miss the direction of gravity by a median of "
        "{missed_deg:.3g} deg, where a good calibration leaves below 1",
        "it is not for use: its rates are clipped or of another time than the accelerometer's, its "
        "axes are not the accelerometer's, or the sensor was moved otherwise between the rests",
        "look into the recording first; a calibration without --method leaves this triad as it is",
    ),
    "calibration.missed_refused": Template(
        WARNING,
        "it is not calibrated by {method}: the turns that are held out miss the direction of "
        "gravity by a median of {missed_deg:.3g} deg, where a good calibration leaves below 1",
        "its rates are clipped or of another time than the accelerometer's, its axes are not the "
        "accelerometer's, or the sensor was moved otherwise between the rests",
        "record it again; --method {method} calibrates it all the same",
    ),
    "calibration.at_one_g": Template(
        NOTE,
        "scale, cross-axis and bias are those at 1 g, the force that every pose feels",
        "what the part's nonlinearity changes at other forces is not seen here",
    ),
    "calibration.sheet": Template(
        NOTE,
        "scale, cross-axis and bias are those at 1 g, the force that every pose feels",
        "the stated uncertainties hold what the data sheet's nonlinearity lets them differ from "
        "those of small forces: {percent:.2g} % of scale",
    ),
    "calibration.gravity": Template(
        NOTE,
        "gravity is taken to be {gravity_m_s2:.5f} m/s^2, known to {sd_mm_s2:.2g} mm/s^2 (standard "
        "uncertainty)",
        "a wrong gravity cannot be told from a scale that all axes share; the stated uncertainties "
        "of the scales hold it: {percent:.2g} %",
        "state gravity_m_s2 of the place in the robot file",
    ),
    "calibration.gravity_simulated": Template(
        NOTE,
        "gravity is the {gravity_m_s2:.5f} m/s^2 that the sensor was simulated with",
        "of a real one a wrong gravity could not be told from a scale that all axes share",
    ),
    "calibration.gyroscope_trend": Template(
        WARNING,
        "its bias drifts through the rests by {change} deg/s, {how}",
        "it was taken out before the fit; the bias is that of the middle of the rests, and its "
        "stated uncertainty holds the drift",
        "let the sensor warm up before the first pose, or record its temperature",
    ),
    "calibration.gyroscope": Template(
        WARNING,
        "its model leaves residuals {ratio:.1f} times what their noise explains ({dof} degrees of "
        "freedom)",
        "something is not in the model; the stated uncertainties were widened by that factor "
        "(Birge's ratio)",
        "look whether its rates are of another time than the truth's, or cut off at the end of "
        "their range",
    ),
}
