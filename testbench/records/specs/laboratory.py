"""The laboratory that certificates are issued by, as a person states it once."""

from __future__ import annotations

from pathlib import Path

import yaml
from pydantic import Field

from testbench.exceptions import InputError
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.disk.user_folders import user_folder
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.asked import Asked
from testbench.records.specs.strict import StrictModel

FILE = "laboratory.yaml"


class Laboratory(StrictModel):
    """Who issues a certificate; what is null stays blank on it."""

    name: str = Field(min_length=1, max_length=200, description="Of the laboratory.")
    address: str = Field(
        min_length=1, max_length=400, description="Where the measurements are made."
    )
    contact: str | None = Field(
        default=None, max_length=200, description="By which it is reached, such as an e-mail."
    )
    operator: str | None = Field(
        default=None, max_length=200, description="Who measures, where nobody else is named."
    )
    authorised_by: str | None = Field(
        default=None, max_length=200, description="Who authorises certificates."
    )
    accreditation: str | None = Field(
        default=None,
        max_length=400,
        description="Its accreditation and number; null: none is claimed.",
    )
    ambient: str | None = Field(
        default=None,
        max_length=200,
        description="Conditions that it keeps, such as (23 ± 2) °C, (45 ± 15) % RH.",
    )
    traceability: str | None = Field(
        default=None,
        max_length=1000,
        description="What its references are traceable to, with their certificates.",
    )


class Statement(Asked):
    """What is stated of one certificate, beside its session; what is null stays blank, or is as
    the laboratory has it.
    """

    customer: str | None = Field(default=None, description="Whom it is issued to.")
    operator: str | None = Field(default=None, description="Who measured.")
    ambient: str | None = Field(default=None, description="Conditions of the measurement.")
    serial_numbers: tuple[str, ...] = Field(
        default=(), description="Of sensors that do not state theirs, each `[SENSOR=]NUMBER`."
    )
    firmwares: tuple[str, ...] = Field(
        default=(), description="Of sensors that do not state theirs, each `[SENSOR=]VERSION`."
    )


def laboratory_file() -> Path | None:
    """Where the user's own laboratory is kept; None where the user has no folder."""
    folder = user_folder("XDG_CONFIG_HOME", ".config")
    return None if folder is None else folder / FILE


def load_laboratory(file: Path | None) -> Laboratory:
    """The laboratory of a file, or the user's own.

    Args:
        file: That is named; the user's own if None.

    Raises:
        InputError: None is named, and the user has stated none.
        FileProblems: The file is missing or malformed; every problem at once.
    """
    own = laboratory_file()
    if file is None and (own is None or not own.is_file()):
        raise InputError(
            "no laboratory has been stated: run `testbench certificate laboratory` once, or name "
            "a file with --laboratory (docs/certificates.md)"
        )
    return load_yaml(file or own or Path(FILE), Laboratory).value


def save_laboratory(laboratory: Laboratory, file: Path | None = None) -> Path:
    """Keep a laboratory, in place of an earlier one.

    Args:
        laboratory: As stated.
        file: To write; the user's own if None.

    Raises:
        InputError: The user has no folder to keep it in, or the file cannot be written.
        StorageError: The disk does not take it.
    """
    target = file or laboratory_file()
    if target is None:
        raise InputError("there is no home folder to keep it in; name a file with --laboratory")
    text = yaml.safe_dump(laboratory.model_dump(), sort_keys=False, allow_unicode=True, width=100)
    with stored_where_asked(target):
        if file is None:
            target.parent.mkdir(parents=True, exist_ok=True)
        write_text(target, text)
    return target
