"""Issue a certificate of a session: computed from its raw files, which are compared with their
hashes first, and never from what was derived of them earlier.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from testbench.clock import Clock, SystemClock, utc_name
from testbench.estimation.calibration.session_calibration import calibrate
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, NotFoundError, SessionError, StorageError
from testbench.pipeline.calibrate import only_sensor
from testbench.pipeline.loaded_analysis import LoadedAnalysis, load_analysis
from testbench.pipeline.repeats import judged_with_repeats
from testbench.pipeline.request import CertificateRequest
from testbench.pipeline.summaries import refuse_no_folder
from testbench.records.disk.replacing import replaced_file, stored_where_asked, write_text
from testbench.records.results.calibration_file import SensorCalibration, load_calibrations
from testbench.records.results.certificate import Certificate
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import CERTIFICATES, EVALUATION_SUMMARY
from testbench.records.session.manifest import RunStatus
from testbench.records.session.raw_files import check_raw_files, refuse_changed
from testbench.records.session.seal import is_sealed, refuse_unstated
from testbench.records.session.session import Session
from testbench.records.specs.laboratory import load_laboratory
from testbench.reporting.certificate import words
from testbench.reporting.certificate.calibration import calibration_parts
from testbench.reporting.certificate.certificate import Issue, Recorded, certificate_of
from testbench.reporting.certificate.noise import noise_parts
from testbench.reporting.certificate.parts import Parts
from testbench.reporting.certificate.performance import performance_parts
from testbench.reporting.certificate.typesetting import pdf_of, refuse_missing


@dataclass(frozen=True)
class Issued:
    """A certificate and its files; the PDF is None where none was asked for."""

    certificate: Certificate
    json: Path
    pdf: Path | None


def certify(session: Session, asked: CertificateRequest, clock: Clock | None = None) -> Issued:
    """Issue a certificate.

    Args:
        session: The recording.
        asked: Of what, by whom, and where it is kept.
        clock: Tells the date of issue; that of this machine if None.

    Raises:
        NotFoundError: No such sensor or filter.
        InputError: There is no laboratory, nothing to certify, or a file of that name; or what
            sets a PDF is not installed.
        SessionError: The session is not what was recorded, or not closed, or the evaluation that
            it keeps says otherwise.
        StorageError: The disk does not take it; nothing is left then.
    """
    if asked.pdf:
        refuse_missing()
    laboratory = load_laboratory(None if asked.laboratory is None else Path(asked.laboratory))
    refuse_no_folder(asked.out)
    sensors = _sensors(session, asked)
    recorded = _recorded(session, sensors)
    moment = (clock or SystemClock()).utc()
    target = _target(session, asked, sensors, utc_name(moment))
    software = f"testbench {version('imu-testbench')}"
    issue = Issue(laboratory, asked.stated, moment, software)
    parts = _parts(session, sensors[0], asked)
    certificate = certificate_of(asked.kind, parts, recorded, issue)
    return _write(certificate, target, asked.pdf)


def _sensors(session: Session, asked: CertificateRequest) -> list[str]:
    """Of which sensors the results are: of a test all of them."""
    if asked.kind == "test":
        return session.sensor_names
    name = only_sensor(session, asked.sensor)
    if name not in session.sensor_names:
        raise NotFoundError("sensor", name, session.sensor_names)
    return [name]


def _recorded(session: Session, sensors: list[str]) -> Recorded:
    """The session, whose raw files are all read anew.

    Raises:
        SessionError: It is not what was recorded, or not closed.
    """
    if session.is_being_recorded:
        raise SessionError(f"{session.path} is still being recorded")
    if session.status is RunStatus.RUNNING:
        raise SessionError(session.what_to_do_cut_off)
    refuse_unstated(session)
    checked = check_raw_files(session)
    refuse_changed(session, checked, remedy="; nothing is certified of it")
    return Recorded(session, sensors, len(checked.names), is_sealed(session))


def _target(session: Session, asked: CertificateRequest, sensors: list[str], day: str) -> Path:
    """The PDF that is asked for, or one in the session's folder; its JSON lies beside it.

    Raises:
        InputError: It is no PDF, one of the files is there, or the folder leads elsewhere.
    """
    of = "" if asked.kind == "test" else f"_{sensors[0]}"
    out = session.path / CERTIFICATES / f"{asked.kind}{of}_{day}.pdf"
    if asked.out is None and out.parent.is_symlink():  # a session may come from anybody
        raise InputError(
            f"{out.parent} is a symbolic link, which may lead anywhere; name a file with --out"
        )
    out = out if asked.out is None else Path(asked.out)
    if out.suffix != ".pdf":
        raise InputError(f"--out {out}: name a .pdf file; its JSON file is put beside it")
    for file in (out, out.with_suffix(".json")):
        if file.exists():
            raise InputError(f"{file} exists already; certificates are kept, not replaced")
    return out


def _parts(session: Session, sensor: str, asked: CertificateRequest) -> Parts:
    """What the kind of certificate that is asked for says of the session."""
    if asked.kind == "calibration":
        return _calibration(session, sensor, asked.calibration)
    loaded = load_analysis(asked.analysis)
    estimated = loaded.estimate(session, whatever=asked.kind == "noise")
    evaluated = _evaluated(session, estimated, loaded)
    if asked.kind == "noise":
        parts = noise_parts(session, sensor, evaluated)
    else:
        parts = performance_parts(session, estimated, evaluated)
    _refuse_otherwise(session, parts, sensor, asked, (estimated, evaluated))
    return parts


def _evaluated(session: Session, estimated: Estimate, loaded: LoadedAnalysis) -> Evaluation:
    evaluated = evaluate(session, estimated, loaded.settings(session))
    return judged_with_repeats(session, estimated, evaluated, loaded)


def _refuse_otherwise(
    session: Session,
    parts: Parts,
    sensor: str,
    asked: CertificateRequest,
    own: tuple[Estimate, Evaluation],
) -> None:
    """Refuse to certify numbers beside an evaluation of the session that has others.

    Raises:
        SessionError: evaluation.json would state other results than the certificate.
    """
    if not (session.path / EVALUATION_SUMMARY).is_file():
        return
    kept = Evaluation.load(session.path)
    try:
        if asked.kind == "noise":
            same = noise_parts(session, sensor, kept).results == parts.results
        else:
            same = performance_parts(session, own[0], kept).results == parts.results
    except InputError:  # nothing to certify in what is kept
        same = False
    if not same:
        raise SessionError(
            f"{session.path / EVALUATION_SUMMARY} has other results than the raw files give: name "
            "the options that it was made with (--filters, --set, --calibration, --tuned, "
            "--repeats), or make it anew first with `testbench report`"
        )


def _calibration(session: Session, sensor: str, kept: str | None) -> Parts:
    """Of a calibration that is kept, or of one that is made anew as `calibrate` does by itself."""
    if kept is None:
        result = calibrate(session, sensor)
        return calibration_parts(
            session, result.calibration, result.poses, words.CALIBRATED_ANEW, result.remarks
        )
    found = _kept_calibration(session, sensor, Path(kept))
    file = found.file or Path(kept)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    source = words.CALIBRATION_KEPT.format(file=file.name, digest=digest)
    return calibration_parts(session, found, None, source, [])


def _kept_calibration(session: Session, sensor: str, path: Path) -> SensorCalibration:
    """The calibration of a sensor that was made from this very session.

    Raises:
        InputError: There is none, or more than one.
    """
    known = load_calibrations(path)
    found = [c for c in known if c.sensor == sensor and c.fingerprint == session.fingerprint]
    if len(found) != 1:
        count = "none" if not found else f"{len(found)} calibrations"
        raise InputError(
            f"{path} holds {count} of sensor {sensor} made from session {session.name} as it is"
            + ("; name one file" if found else "")
        )
    return found[0]


def _write(certificate: Certificate, pdf: Path, wanted: bool) -> Issued:
    """Both files, or none of them."""
    json = pdf.with_suffix(".json")
    page = pdf_of(certificate, json.name) if wanted else None
    if pdf.parent.name == CERTIFICATES:
        with stored_where_asked(pdf.parent):
            pdf.parent.mkdir(exist_ok=True)
    with stored_where_asked(json):
        write_text(json, certificate.text(), anew=True)
    if page is None:
        return Issued(certificate, json, None)
    try:
        with stored_where_asked(pdf), replaced_file(pdf, anew=True) as partial:
            partial.write_bytes(page)
    except (InputError, StorageError):
        json.unlink(missing_ok=True)
        raise
    return Issued(certificate, json, pdf)
