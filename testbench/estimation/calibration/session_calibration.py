"""Calibration of one sensor from a session, with figures on poses and turns held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from testbench.estimation.calibration.arm_errors import shifted_truths
from testbench.estimation.calibration.arm_uncertainty import with_arm_uncertainty
from testbench.estimation.calibration.axis_model import orthogonality
from testbench.estimation.calibration.examined import (
    examined_accelerometer,
    examined_gyroscope,
    examined_magnetometer,
    gyroscope_cubic,
    with_rate_nonlinearity,
)
from testbench.estimation.calibration.force_scale import (
    gravity_sd,
    sheet_nonlinearity,
    sheet_settling,
)
from testbench.estimation.calibration.gyroscope import IN_RUN, static_bias, validated
from testbench.estimation.calibration.gyroscope_trend import bias_trend, widened_by_trend
from testbench.estimation.calibration.methods import (
    METHODS,
    Calibrated,
    Known,
    Method,
    get_method,
    methods_to_try,
)
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.prepared import (
    AS_THE_METHOD,
    Prepared,
    Segmentation,
    prepare,
)
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.session_mounting import find_mounting
from testbench.estimation.calibration.shared_frame import take_mounting_out
from testbench.estimation.calibration.temperature import Function, with_drift
from testbench.estimation.calibration.turns import TurnSettings
from testbench.estimation.calibration.validation import cross_validate, validate
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.calibration_result import CalibrationResult
from testbench.records.results.fit import Fit
from testbench.records.session.session import Session

MISSED_DEG = 5.0
"""Median error of held-out turns that is remarked [deg]: a gyroscope of 3 % is off by 2.7 deg after
a quarter turn without any calibration."""
SCALE_WITHIN = 1.5
"""Largest factor that a calibration may find between a gyroscope and the rate: data sheets of
consumer parts state 3 %, and a wrong range setting is a factor of 2.
"""


@dataclass(frozen=True)
class Told:
    """What is said of a calibration while it is made.

    Attributes:
        remarks: What was left out, and why.
        findings: What its user must know.
    """

    remarks: list[str]
    findings: list[Finding]

    def clipped(self, prepared: Prepared, key: str, named: Method | None) -> bool:
        """Whether a triad is clipped, which is said.

        Args:
            prepared: The recording.
            key: "acc", "gyr" or "mag".
            named: The method that was asked for, if one was.

        Raises:
            InputError: It is, and a method for it was asked for.
        """
        found = prepared.clipped.get(key)
        if found is None:
            return False
        if named is not None:
            raise InputError(str(found))
        self.findings.append(found)
        return True


def calibrate(
    session: Session,
    sensor: str,
    methods: Sequence[str] = (),
    segmentation: Segmentation | None = None,
    held_out: Sequence[Session] = (),
    field: np.ndarray | None = None,
    turns: TurnSettings = AS_THE_METHOD,
) -> CalibrationResult:
    """Calibrate a sensor.

    Args:
        session: The recording.
        sensor: Its name.
        methods: At most one for each triad; the best that the recording allows if none is named.
        segmentation: Which witness says where the rests are; the arm if it was there.
        held_out: Sessions of the same sensor, in the same mounting, whose poses validate;
            cross-validation without any.
        field: Of the earth in the world, shape (3,) [uT]; None where nobody states it.
        turns: How the turns of the gyroscope are integrated, where somebody says so.

    Raises:
        NotFoundError: No such sensor or method.
        InputError: Two methods for one triad, or nothing to calibrate from.
        PoorExcitation: The recording does not determine a parameter of a method that was asked for.
    """
    # Longer than a screen: triad after triad, each with what the ones before it gave.
    chosen = _by_triad(methods, field, turns)
    opened = CalibrationRecording.of(session, sensor)
    prepared = prepare(opened, segmentation)
    if prepared.truth is not None:
        placed = session.analysis.sensors.get(sensor)
        shifted = shifted_truths(session.arm(), session.robot, placed, prepared.truth)
        prepared = replace(prepared, stated=prepared.truth, shifted=shifted)
    sheet = None if opened.sheet is None else opened.sheet.accelerometer.triad()
    prepared = replace(
        prepared,
        gravity_sd=gravity_sd(opened.gravity, bool(session.simulated)),
        nonlinearity=sheet_nonlinearity(sheet),
        settling=sheet_settling(sheet),
    )
    others = [prepare(CalibrationRecording.of(other, sensor), None) for other in held_out]
    told = Told(list(prepared.remarks), list(prepared.clipped_moving))
    remarks = told.remarks
    triads: dict[str, TriadCalibration] = {}
    accelerometer, prepared = _accelerometer(
        prepared, others, chosen.get("accelerometer"), not methods, told
    )
    if accelerometer is not None:
        triads["accelerometer"] = accelerometer
    remarks += _orthogonality(prepared.poses)
    gyroscope: TriadCalibration | None = None
    bare: Fit | None = None
    left: list[np.ndarray] = []
    if prepared.has_gyroscope:
        trend = bias_trend(prepared.gyroscope_recording(accelerometer))
        if trend is not None:
            prepared = prepared.without_trend("gyr", trend.at(prepared.time_ns / NANOSECONDS))
        gyroscope, function = _gyroscope(
            prepared, others, accelerometer, chosen.get("gyroscope"), not methods, told, turns
        )
        if gyroscope is not None:
            bare = gyroscope.fits[0]
            recording = prepared.gyroscope_recording(accelerometer).every(turns.every)
            gyroscope, left = with_rate_nonlinearity(
                gyroscope, recording, gyroscope_cubic(opened.sheet), function
            )
            if trend is not None:
                gyroscope = widened_by_trend(gyroscope, recording, trend, function)
                told.findings.append(trend.told())
            triads["gyroscope"] = gyroscope
    magnetometer = _magnetometer(
        prepared, others, accelerometer, chosen.get("magnetometer"), not methods, told, field
    )
    if magnetometer is not None:
        triads["magnetometer"] = magnetometer
    if not triads and "mounting" not in chosen:
        raise InputError(
            f"{session.path}: nothing could be calibrated: "
            f"{'; '.join([*remarks, *map(str, told.findings)]) or 'no method fits the recording'}"
        )
    triads = {name: _with_in_run(name, found, prepared.settling) for name, found in triads.items()}
    if prepared.truth is not None:
        triads, added, by_zeros = with_arm_uncertainty(prepared, triads, field)
        remarks += added
        left += by_zeros
    if bare is not None:
        triads["gyroscope"], said = examined_gyroscope(triads["gyroscope"], bare, left)
        told.findings.extend(said)
    triads, mounting, odd = take_mounting_out(triads, keep_small="mounting" not in chosen)
    remarks += odd
    if "mounting" in chosen and mounting is not None:
        remarks.append(
            f"the mounting by {chosen['mounting'].name} takes the place of the one "
            f"{mounting.method}"
        )
        mounting = None
    if session.recorded_at is None:
        remarks.append(
            "the date of the recording is unknown: the calibration bears the date of its import"
        )
    device = session.manifest.sensors[sensor].device_tag
    calibration = SensorCalibration(
        sensor,
        str(device) if device else None,
        session.recorded_at or session.started,
        session.name,
        session.fingerprint,
        "",  # who keeps it says by which version it was made
        prepared.temperature,
        triads,
        mounting=mounting,
        findings=tuple(told.findings),
        simulated=session.manifest.sensors[sensor].simulated,
    )
    if "mounting" in chosen:  # of the sensor's own axes, whole, whatever the triads contained of it
        sweeps = [step for step in session.steps if step.kind == "sweep"]
        by = chosen["mounting"]
        found = find_mounting(by.name, by.function, prepared, calibration, sweeps)
        calibration = replace(calibration, mounting=found)
    where = (
        "cross-validation"
        if not others
        else "poses and turns of " + ", ".join(other.name for other in held_out)
    )
    poses = prepared.calibration_poses(accelerometer)
    return CalibrationResult(
        calibration, poses, prepared.segmentation, prepared.agreements, where, remarks
    )


def _by_triad(
    names: Sequence[str], field: np.ndarray | None, turns: TurnSettings
) -> dict[Calibrated, Method]:
    """The methods that were named, each with what it must be told."""
    chosen: dict[Calibrated, Method] = {}
    for name in names:
        method = get_method(name)
        if "field" in method.asks and field is None:
            raise InputError(
                f"the method {name} needs the earth's field in the world; state it with "
                "--field-ut X Y Z"
            )
        triad = method.calibrates
        if triad in chosen:
            raise InputError(
                f"{chosen[triad].name} and {name} both calibrate the {triad}; name one"
            )
        chosen[triad] = method
    if turns.angle is not None and not any("turn_angle" in m.asks for m in chosen.values()):
        fitting = [m.name for m in METHODS.values() if "turn_angle" in m.asks]
        raise InputError(
            f"--turn-deg is for the method {' or '.join(fitting)}; name it with --method, or leave "
            "the angle out"
        )
    if (turns.of_integration or turns.every > 1) and not any(
        method.integrates for method in chosen.values()
    ):
        fitting = [m.name for m in METHODS.values() if m.integrates]
        raise InputError(
            "--integrator, --stages, --g-sensitivity and --every are for the methods "
            f"{' and '.join(fitting)}; name one with --method, or leave them out"
        )
    return chosen


def _accelerometer(
    prepared: Prepared,
    others: list[Prepared],
    named: Method | None,
    free: bool,
    told: Told,
) -> tuple[TriadCalibration | None, Prepared]:
    """The accelerometer, and the recording without the trend that it was found to have."""
    if (named is None and not free) or told.clipped(prepared, "acc", named):
        return None, prepared
    known: set[Known] = {"arm"} if prepared.poses.expected is not None else set()
    for method in [named] if named else methods_to_try("accelerometer", known):
        try:
            found, at_rest = examined_accelerometer(method.function, prepared)
        except (PoorExcitation, InputError) as error:
            if named:
                raise
            told.remarks.append(f"accelerometer by {method.name}: {error}")
            continue
        told.findings.extend(at_rest.findings)
        prepared = at_rest.prepared
        figures = _held_out_poses(found, others)
        figures = figures or cross_validate(method.function, prepared.poses)
        return replace(found, validation=figures), prepared
    return None, prepared


def _with_in_run(triad: str, found: TriadCalibration, settling: float) -> TriadCalibration:
    """The triad with the in-run bias that its rests share in the covariance of its bias.

    The methods take it to be drawn anew for each rest; it wanders slowly, and a whole session may
    lie to one side of the turn-on bias.
    """
    sd = {"accelerometer": settling, "gyroscope": IN_RUN}.get(triad, 0.0)
    if not sd or METHODS[found.method].counts_in_run:
        return found
    fits = []
    for fit in found.fits:
        bias = [name.removeprefix("gyr_").startswith(("bias_", "offset_")) for name in fit.names]
        fits.append(
            replace(fit, covariance=fit.covariance + sd**2 * np.diag(np.array(bias, float)))
        )
    return replace(found, fits=tuple(fits))


def _orthogonality(poses: StaticPoses) -> list[str]:
    """The angle between two axes, by poses that turn both through the vertical; else nothing."""
    try:
        found = orthogonality(poses)
    except InputError:
        return []
    first, second = found.axes
    theta = ", ".join(f"{value:.5f}" for value in found.theta)
    angle = f"{np.degrees(found.angle):.3f} ± {np.degrees(found.angle_sd):.3f} deg"
    scales = f"{found.scale[0]:.5f} and {found.scale[1]:.5f}"
    return [
        (
            f"the accelerometer's axes {first} and {second} are {angle} apart, their scales "
            f"{scales}; "
            f"theta = [{theta}]"
        )
    ]


def _held_out_poses(found: TriadCalibration, others: list[Prepared]) -> dict[str, float]:
    if not others:
        return {}
    return validate(found, joined([other.poses for other in others]))


def joined(several: list[StaticPoses]) -> StaticPoses:
    """Poses of several recordings of one sensor; what not all of them know is left out."""

    def all_of(name: str) -> np.ndarray | None:
        arrays = [getattr(poses, name) for poses in several]
        return None if any(array is None for array in arrays) else np.concatenate(arrays)

    first = several[0]
    together = {
        name: all_of(name)
        for name in ("expected", "vertical", "temperature", "start", "end", "count")
    }
    mean, variance = (
        np.concatenate([getattr(poses, name) for poses in several]) for name in ("mean", "variance")
    )
    return StaticPoses(
        mean,
        variance,
        first.magnitude,
        direction_sd=first.direction_sd,
        vertical_sd=first.vertical_sd,
        **together,
    )


def _gyroscope(
    prepared: Prepared,
    others: list[Prepared],
    accelerometer: TriadCalibration | None,
    named: Method | None,
    free: bool,
    told: Told,
    turns: TurnSettings,
) -> tuple[TriadCalibration | None, Function]:
    """The gyroscope, and the method that found it."""
    if (named is None and not free) or told.clipped(prepared, "gyr", named):
        return None, static_bias
    recording = prepared.gyroscope_recording(accelerometer).every(turns.every)
    held_out = [
        other.gyroscope_recording(accelerometer).every(turns.every)
        for other in others
        if other.has_gyroscope
    ]
    known: set[Known] = {"arm"} if prepared.has_truth else set()
    for method in [named] if named else methods_to_try("gyroscope", known):
        asked: dict[str, object] = {}
        if "turn_angle" in method.asks:
            asked["angle"] = turns.angle
        asked |= turns.of_integration if method.integrates else {}
        function = with_drift(partial(method.function, **asked))
        try:
            if method.spares is None:
                found = prepared.with_held_out_turns(function, recording, held_out, turns)
            else:
                found = function(recording)
                spared = [turn for other in held_out for turn in other.turns]
                spared = spared if held_out else method.spares(recording)
                found = validated(found, spared) if spared else found
        except (PoorExcitation, InputError) as error:
            if named:
                raise
            told.remarks.append(f"gyroscope by {method.name}: {error}")
        else:
            refuse_implausible_scale(found)
            missed = missed_gravity(found, refused=named is None)
            told.findings.extend(missed)
            if missed and named is None:
                continue
            return found, function
    return None, static_bias


def missed_gravity(found: TriadCalibration, refused: bool) -> list[Finding]:
    """A finding where the turns do not arrive where gravity says, when they are held out.

    Args:
        found: Of a gyroscope.
        refused: Whether it is not kept then.
    """
    missed = found.validation.get("gravity_direction_median_deg", 0.0)
    if missed <= MISSED_DEG:
        return []
    code = "calibration.missed_refused" if refused else "calibration.missed"
    return [finding(code, "gyroscope", method=found.method, missed_deg=missed)]


def refuse_implausible_scale(found: TriadCalibration) -> None:
    """Refuse a gyroscope whose scale no part has: the range setting, the unit or a stated angle is
    wrong.

    Raises:
        InputError: Says by how much.
    """
    scale = np.linalg.norm(np.linalg.inv(found.matrix), axis=0)
    if np.all((scale > 1 / SCALE_WITHIN) & (scale < SCALE_WITHIN)):
        return
    told = ", ".join(f"{axis} {value:.4g}" for axis, value in zip("xyz", scale, strict=True))
    turns = (
        "; or the turns were not of the angle that --turn-deg states"
        if "turn_angle" in METHODS[found.method].asks
        else ""
    )
    raise InputError(
        f"the gyroscope reads so many times the rate of its turns, by {found.method}: {told}. "
        "Parts are within a few percent "
        "of 1: it was read at the wrong range setting or in the wrong unit, and a calibration "
        f"would hide it{turns}. Correct "
        "the scale where the file is read (testbench import --unit, or scale in a mapping) and "
        "calibrate again"
    )


def _magnetometer(
    prepared: Prepared,
    others: list[Prepared],
    accelerometer: TriadCalibration | None,
    named: Method | None,
    free: bool,
    told: Told,
    field: np.ndarray | None,
) -> TriadCalibration | None:
    if (named is None and not free) or not prepared.has_magnetometer:
        if named is not None:
            raise InputError(f"the method {named.name} needs a magnetometer; this sensor has none")
        return None
    if told.clipped(prepared, "mag", named):
        return None
    poses = prepared.magnetometer_poses(accelerometer, field)
    known: set[Known] = {"vertical"} if accelerometer else set()
    for method in [named] if named else methods_to_try("magnetometer", known):
        try:
            found, said = examined_magnetometer(method, poses, named is not None)
            told.findings.extend(said)
            if found is None:
                return None
            figures = cross_validate(method.function, poses, magnetometer=True)
            if others:
                figures = validate(
                    found,
                    joined([other.magnetometer_poses(accelerometer, field) for other in others]),
                    magnetometer=True,
                )
        except (PoorExcitation, InputError) as error:
            if named:
                raise
            told.remarks.append(f"magnetometer by {method.name}: {error}")
            continue
        return replace(found, validation=figures)
    return None
