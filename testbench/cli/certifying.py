"""The commands `certificate`: what a laboratory states of a session, after ISO/IEC 17025."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.options import (
    CalibrationOption,
    FiltersOption,
    JsonOption,
    RepeatsOption,
    SensorOption,
    SessionArgument,
    SetOption,
    TunedOption,
    analysis_request,
    beside,
    optional,
)
from testbench.cli.output import say, say_findings, say_json

if TYPE_CHECKING:
    from testbench.pipeline.certificate import Issued
    from testbench.pipeline.request import CertificateRequest
    from testbench.records.specs.laboratory import Laboratory, Statement

certificate = typer.Typer(
    help="Issue certificates after ISO/IEC 17025, 7.8: PDF and JSON.", no_args_is_help=True
)


@certificate.callback()
def _certificate() -> None:
    """Issue certificates after ISO/IEC 17025, 7.8: PDF and JSON."""


PdfOption = Annotated[
    bool, typer.Option("--pdf", help="Set its pages as well; else the JSON file alone is written.")
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE.pdf",
        help="PDF file; its JSON lies beside it. Default: in the session's folder certificates.",
    ),
]
LaboratoryOption = Annotated[
    Path | None,
    typer.Option(
        "--laboratory",
        metavar="FILE",
        help="Laboratory data (.yaml) in place of the user's own.",
    ),
]
CustomerOption = Annotated[
    str | None, typer.Option("--customer", help="Whom it is issued to, with the address.")
]
OperatorOption = Annotated[
    str | None, typer.Option("--operator", help="Who measured; else as the laboratory has it.")
]
AmbientOption = Annotated[
    str | None,
    typer.Option(
        "--ambient",
        help="Conditions of the measurement, such as '(23.1 ± 0.5) °C, 45 % RH'; else as the "
        "laboratory has it.",
    ),
]
SerialOption = Annotated[
    list[str] | None,
    typer.Option(
        "--serial-number",
        metavar="[SENSOR=]NUMBER",
        help="Of a sensor whose session does not state it; may be repeated.",
    ),
]
FirmwareOption = Annotated[
    list[str] | None,
    typer.Option(
        "--firmware",
        metavar="[SENSOR=]VERSION",
        help="Of a sensor whose session does not state it; may be repeated.",
    ),
]


@certificate.command()
def noise(
    session: SessionArgument,
    sensor: SensorOption = None,
    pdf: PdfOption = False,
    out: OutOption = None,
    laboratory: LaboratoryOption = None,
    customer: CustomerOption = None,
    operator: OperatorOption = None,
    ambient: AmbientOption = None,
    serial_number: SerialOption = None,
    firmware: FirmwareOption = None,
    json: JsonOption = False,
) -> None:
    """Noise at rest by axis, as a data sheet has it, with the Allan deviation."""
    from testbench.pipeline.request import CertificateRequest

    stated = _stated(customer, operator, ambient, serial_number, firmware)
    asked = CertificateRequest(kind="noise", sensor=sensor, stated=stated)
    _issue(session, _placed(asked, pdf, out, laboratory), json)


@certificate.command()
def calibration(
    session: SessionArgument,
    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration",
            help="Calibration file that was made from this session, or a folder with it. Default: "
            "calibrated anew, by the best methods that the recording allows.",
        ),
    ] = None,
    sensor: SensorOption = None,
    pdf: PdfOption = False,
    out: OutOption = None,
    laboratory: LaboratoryOption = None,
    customer: CustomerOption = None,
    operator: OperatorOption = None,
    ambient: AmbientOption = None,
    serial_number: SerialOption = None,
    firmware: FirmwareOption = None,
    json: JsonOption = False,
) -> None:
    """Parameters of a sensor's calibration, with U and k."""
    from testbench.pipeline.request import CertificateRequest

    stated = _stated(customer, operator, ambient, serial_number, firmware)
    asked = CertificateRequest(
        kind="calibration", sensor=sensor, calibration=optional(calibration), stated=stated
    )
    _issue(session, _placed(asked, pdf, out, laboratory), json)


@certificate.command("test")
def performance(
    session: SessionArgument,
    filters: FiltersOption = None,
    parameters: SetOption = None,
    calibration: CalibrationOption = None,
    tuned: TunedOption = None,
    repeats: RepeatsOption = None,
    pdf: PdfOption = False,
    out: OutOption = None,
    laboratory: LaboratoryOption = None,
    customer: CustomerOption = None,
    operator: OperatorOption = None,
    ambient: AmbientOption = None,
    serial_number: SerialOption = None,
    firmware: FirmwareOption = None,
    json: JsonOption = False,
) -> None:
    """Errors of joint angles and orientations, and the limits that they keep."""
    from testbench.pipeline.request import CertificateRequest

    stated = _stated(customer, operator, ambient, serial_number, firmware)
    analysed = beside(analysis_request(filters, parameters, calibration, tuned), repeats)
    asked = CertificateRequest(kind="test", analysis=analysed, stated=stated)
    _issue(session, _placed(asked, pdf, out, laboratory), json)


def _stated(
    customer: str | None,
    operator: str | None,
    ambient: str | None,
    serial: list[str] | None,
    firmware: list[str] | None,
) -> Statement:
    """What is stated beside the session."""
    from testbench.records.specs.laboratory import Statement

    return Statement(
        customer=customer,
        operator=operator,
        ambient=ambient,
        serial_numbers=tuple(serial or ()),
        firmwares=tuple(firmware or ()),
    )


def _placed(
    asked: CertificateRequest, pdf: bool, out: Path | None, laboratory: Path | None
) -> CertificateRequest:
    """A request with where it is kept, and by whom it is issued."""
    update = {"pdf": pdf, "out": optional(out), "laboratory": optional(laboratory)}
    return asked.model_copy(update=update)


def _issue(path: Path, asked: CertificateRequest, json: bool) -> None:
    """Issue a certificate, asking for the laboratory first where it is not known yet."""
    from testbench.pipeline.certificate import certify
    from testbench.records.session.session import Session
    from testbench.records.specs.laboratory import laboratory_file

    session = Session(path)
    own = laboratory_file()
    unknown = asked.laboratory is None and (own is None or not own.is_file())
    if unknown and not json and sys.stdin.isatty():
        say("No laboratory has been stated yet; this is asked once.")
        _ask_and_keep(None)
    issued = certify(session, asked)
    if json:
        say_json(_told(session.path, issued))
    else:
        _say(issued)


def _told(session: Path, issued: Issued) -> dict[str, object]:
    made = issued.certificate
    return {
        "session": str(session),
        "number": made.number,
        "json": str(issued.json),
        "pdf": str(issued.pdf) if issued.pdf else None,
        "simulated": made.simulated,
        "summary": made.summary,
        "findings": [own.model_dump(mode="json") for own in made.findings],
        "blank": made.blank,
    }


def _say(issued: Issued) -> None:
    """What was found, what weighs, what is blank, and the files."""
    from testbench.records.findings.earlier import read_again

    made = issued.certificate
    for sentence in made.summary:
        say(sentence)
    say_findings(read_again(own.model_dump()) for own in made.findings)
    if made.blank:
        say(f"left blank: {'; '.join(made.blank)}")
    if made.simulated:
        say("simulated: every page says so")
    say(f"certificate: {made.number}")
    say(f"json: {issued.json}")
    if issued.pdf:
        say(f"pdf:  {issued.pdf}")


@certificate.command()
def laboratory(
    laboratory: LaboratoryOption = None,
) -> None:
    """State the laboratory that certificates are issued by, once; an empty line keeps what stands
    in brackets.
    """
    _ask_and_keep(laboratory)


@certificate.command()
def schema() -> None:
    """Print the JSON schema of certificates."""
    from testbench.records.results.certificate import schema_text

    say(schema_text().rstrip())


def _ask_and_keep(file: Path | None) -> None:
    from testbench.records.specs.laboratory import save_laboratory

    say(f"laboratory: {save_laboratory(_asked(_known(file)), file)}")


def _known(file: Path | None) -> Laboratory | None:
    """What was stated before."""
    from testbench.records.specs.laboratory import laboratory_file, load_laboratory

    own = file or laboratory_file()
    return load_laboratory(own) if own is not None and own.is_file() else None


def _asked(known: Laboratory | None) -> Laboratory:
    """Ask for each thing that is stated of a laboratory."""
    from testbench.records.specs.laboratory import Laboratory

    found: dict[str, str | None] = {}
    for name, field in Laboratory.model_fields.items():
        before = None if known is None else getattr(known, name)
        words = f"{name.replace('_', ' ').capitalize()} ({(field.description or '').rstrip('.')})"
        needed = field.is_required() and before is None
        answer = typer.prompt(words, default=None if needed else before or "", type=str)
        found[name] = str(answer).strip() or before
    return Laboratory.model_validate(found)
