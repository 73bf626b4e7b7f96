"""Certificates say what the session's results say, to the digits that their uncertainty allows."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from dataclasses import replace
from errno import ENOSPC
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from pypdf import PdfReader

from testbench.exceptions import InputError, NotFoundError, SessionError, StorageError
from testbench.pipeline import certificate as pipeline
from testbench.pipeline.analyse import Result
from testbench.pipeline.calibrate import calibrate
from testbench.pipeline.certificate import Issued, certify
from testbench.pipeline.request import CalibrationRequest, CertificateRequest
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.results.calibration_file import load_calibration
from testbench.records.results.certificate import SCHEMA_FILE, certificate_schema, schema_text
from testbench.records.results.quantity import Quantity
from testbench.records.session.session import Session
from testbench.records.specs.laboratory import Laboratory, Statement
from testbench.reporting.certificate import typesetting
from testbench.reporting.certificate.noise import noise_parts
from testbench.reporting.certificate.performance import factor_of
from testbench.reporting.certificate.statements import traceability_of
from tests.asking import recorded
from tests.command_line import command

TRIADS = {"acc": "Accelerometer", "gyr": "Gyroscope", "mag": "Magnetometer"}
LINES = {
    "White noise, one-sided density": ("noise_density", "noise_density_sd"),
    "Bias instability": ("bias_instability", "bias_instability_sd"),
    "Rate random walk": ("rate_random_walk", "rate_random_walk_sd"),
}


def issue(session: Session, folder: Path, laboratory: Path, kind: str, **other) -> Issued:
    asked = CertificateRequest(
        kind=kind, pdf=True, out=folder / f"{kind}.pdf", laboratory=laboratory, **other
    )
    return certify(session, asked)


def pages(file: Path) -> list[str]:
    """The text of each page, its white space made one."""
    return [" ".join(page.extract_text().split()) for page in PdfReader(file).pages]


def squeezed(text: str) -> str:
    return re.sub(r"\s", "", text)


def is_of(quantity: Quantity, value: float, expanded: float | None) -> bool:
    """Whether a quantity is a value, rounded by the second digit of its uncertainty."""
    known = value if expanded is None else expanded
    unit = 10.0 ** (int(f"{known:.1e}".partition("e")[2]) - 1)
    near = quantity.value is not None and abs(quantity.value - value) <= 0.5001 * unit
    if expanded is None:
        return near and quantity.expanded_uncertainty is None
    rounded = pytest.approx(float(f"{expanded:.1e}"), rel=1e-9)
    return near and quantity.expanded_uncertainty == rounded


def shown_on_the_page(issued: Issued) -> None:
    """Every result stands on the page, and no other number stands among the results."""
    assert issued.pdf is not None
    text = " ".join(pages(issued.pdf))
    spaced = text[text.index("4 Results") : text.index("5 What may change a conclusion")]
    body = squeezed(spaced)
    made, allowed = issued.certificate, []
    for table in made.results:
        for row in table.rows:
            for quantity in row.quantities:
                assert squeezed(quantity.shown) in body
            words = [*row.of, *row.more, *(own.shown for own in row.quantities)]
            assert all(squeezed(word) in body for word in row.more)
            allowed += re.findall(r"\d+\.\d+", " ".join(words))
        allowed += re.findall(r"\d+\.\d+", " ".join([table.title, *table.columns, *table.notes]))
    said = [*made.conformity, *(figure.title for figure in made.figures), made.number]
    allowed += re.findall(r"\d+\.\d+", " ".join(said))
    assert set(re.findall(r"(?<![\w.])\d+\.\d+(?![\w.])", spaced)) <= {*allowed}


@pytest.fixture(scope="module")
def noise(resting: Result, laboratory: Path, tmp_path_factory) -> Issued:
    folder = tmp_path_factory.mktemp("noise")
    return issue(resting.session, folder, laboratory, "noise", sensor="dot")


@pytest.fixture(scope="module")
def tested(quick: Result, laboratory: Path, tmp_path_factory) -> Issued:
    return issue(quick.session, tmp_path_factory.mktemp("tested"), laboratory, "test")


@pytest.fixture(scope="module")
def poses(tmp_path_factory) -> Session:
    return recorded("calibration_3d", 3, tmp_path_factory.mktemp("poses"))


@pytest.fixture(scope="module")
def calibrated(poses: Session, laboratory: Path, tmp_path_factory) -> Issued:
    return issue(poses, tmp_path_factory.mktemp("calibrated"), laboratory, "calibration")


@pytest.fixture(scope="module")
def own(device: Session, laboratory: Path, tmp_path_factory) -> Issued:
    stated = Statement(customer="A. Client", operator="B. Operator")
    folder = tmp_path_factory.mktemp("own")
    return issue(device, folder, laboratory, "noise", stated=stated)


def test_the_noise_is_that_of_the_evaluation(noise: Issued, resting: Result) -> None:
    rows = {(r.quantity, r.axis): r for r in resting.evaluation.noise if r.sensor == "dot"}
    kept = read_json(resting.session.path / "evaluation.json")["noise"]
    seen = 0
    for quantity, triad in TRIADS.items():
        table = next(t for t in noise.certificate.results if t.title.startswith(triad))
        for line in table.rows:
            for axis, found in zip("xyz", line.quantities, strict=True):
                row = rows[quantity, axis]
                if line.of[0] not in LINES:
                    continue
                value, sd = (getattr(row, key) for key in LINES[line.of[0]])
                if value is None:
                    assert (found.shown, found.value) == ("–", None)
                    assert found.lacking
                    continue
                assert is_of(found, value, 1.96 * sd)
                assert value in [own[LINES[line.of[0]][0]] for own in kept]
                seen += 1
    assert seen >= 9
    shown_on_the_page(noise)


def test_a_random_walk_is_the_white_noise_in_another_unit(noise: Issued, resting: Result) -> None:
    table = next(t for t in noise.certificate.results if t.title.startswith("Gyroscope"))
    (line,) = [row for row in table.rows if row.of == ["Angle random walk"]]
    for axis, found in zip("xyz", line.quantities, strict=True):
        (row,) = [
            r
            for r in resting.evaluation.noise
            if (r.sensor, r.quantity, r.axis) == ("dot", "gyr", axis)
        ]
        assert row.random_walk and row.noise_density and row.noise_density_sd
        part = row.noise_density_sd / row.noise_density
        assert is_of(found, row.random_walk, 1.96 * part * row.random_walk)
    assert line.unit == "deg/√h"


def test_the_metrics_are_those_of_the_evaluation(tested: Issued, quick: Result) -> None:
    kept = {
        (m["name"], m["filter"], m["section"], m["sequence"]): m
        for m in read_json(quick.session.path / "evaluation.json")["metrics"]
    }
    rows = [row for table in tested.certificate.results for row in table.rows]
    assert rows
    for row in rows:
        _, _, by, where = row.of
        places = [
            key
            for key in kept
            if key[:2] == (row.key, by) and all((part or "") in where for part in key[2:])
        ]
        (metric,) = [
            kept[key]
            for key in places
            if is_of(row.quantities[0], kept[key]["value"], kept[key]["expanded_uncertainty"])
        ]
        assert row.outcome == (metric["outcome"] or "")
        factors = {
            round(k, 2)
            for budget in quick.evaluation.uncertainty
            for k in (budget.coverage_factor, budget.coverage_factor_magnitude)
            if k is not None
        }
        assert row.quantities[0].coverage_factor in factors | {1.96}
        assert row.more[0] == f"{row.quantities[0].coverage_factor:.2f}"
    shown_on_the_page(tested)


def test_k_is_that_of_the_budget_behind_the_uncertainty(quick: Result) -> None:
    budget = next(b for b in quick.evaluation.uncertainty if b.complete)
    own = [m for m in quick.evaluation.metrics if m.name.partition(".")[0] == budget.owner]
    one = replace(own[0], expanded_uncertainty=budget.expanded_magnitude_deg)
    assert factor_of(quick.evaluation, one) == budget.coverage_factor_magnitude
    assert factor_of(quick.evaluation, replace(one, expanded_uncertainty=None)) is None


def test_the_parameters_are_those_of_the_calibration(
    calibrated: Issued, poses: Session, tmp_path: Path
) -> None:
    made = calibrate(poses, CalibrationRequest(out=tmp_path / "own.yaml", report=False))
    kept = load_calibration(made.file)
    fits = [fit for found in kept.triads.values() for fit in found.fits]
    tables = [t for t in calibrated.certificate.results if t.of == ["parameter"]]
    assert len(tables) == len(fits) >= 2
    for table, fit in zip(tables, fits, strict=True):
        for row, name, value, half, sd in zip(
            table.rows, fit.names, fit.values, fit.half_width(), fit.sd, strict=True
        ):
            (found,) = row.quantities
            assert row.of == [name]
            assert is_of(found, value, half)
            assert found.coverage_factor == pytest.approx(half / sd, abs=0.006)
    shown_on_the_page(calibrated)


def test_a_kept_calibration_is_certified_as_it_is(
    calibrated: Issued, poses: Session, laboratory: Path, tmp_path: Path
) -> None:
    made = calibrate(poses, CalibrationRequest(out=tmp_path / "kept", report=False))
    again = issue(poses, tmp_path, laboratory, "calibration", calibration=tmp_path / "kept")
    assert again.certificate.results == calibrated.certificate.results
    digest = hashlib.sha256(made.file.read_bytes()).hexdigest()
    assert digest in again.certificate.procedure[0]
    text = made.file.read_text(encoding="utf-8")
    made.file.write_text(text.replace(poses.fingerprint, "ab" * 32), encoding="utf-8")
    with pytest.raises(InputError, match="holds none of sensor"):
        issue(poses, tmp_path / "kept", laboratory, "calibration", calibration=made.file)


@pytest.mark.parametrize("name", ["noise", "tested", "calibrated", "own"])
def test_it_has_two_to_four_numbered_pages_with_the_hash_of_its_json(name, request) -> None:
    issued: Issued = request.getfixturevalue(name)
    assert issued.pdf is not None
    found = pages(issued.pdf)
    assert 2 <= len(found) <= 4
    digest = hashlib.sha256(issued.json.read_bytes()).hexdigest()
    for i, text in enumerate(found, 1):
        assert f"Page {i} of {len(found)}" in text
        assert digest in squeezed(text)
        assert issued.certificate.number in text
    assert f"End of certificate {issued.certificate.number}" in found[-1]


@pytest.mark.parametrize("name", ["noise", "tested", "calibrated"])
def test_what_is_simulated_says_so_across_every_page(name, request) -> None:
    issued: Issued = request.getfixturevalue(name)
    assert issued.pdf is not None
    for page in PdfReader(issued.pdf).pages:
        across: list[str] = []

        def note(text, placed, _own, _font, size, found=across) -> None:
            if abs(placed[1]) > 0.1 and size > 50 and text.strip():
                found.append(text.strip())

        page.extract_text(visitor_text=note)
        assert across == ["SIMULATED"]
    made = issued.certificate
    assert "none" in made.simulated and made.traceability[0] == "None: nothing was measured."
    words = made.text()
    assert "gravity by certificate 17" not in " ".join(made.traceability)
    assert "It is not issued under any accreditation." in made.validity
    assert "SIMULATED" not in words  # only the page says it in large type


def test_what_is_real_does_not(own: Issued) -> None:
    assert own.pdf is not None
    assert "simulated" not in " ".join(pages(own.pdf)).lower()
    made = own.certificate
    assert made.traceability[0].endswith("the results were held against no reference.")
    assert "gravity by certificate 17" not in " ".join(made.traceability)
    assert made.validity[-1].endswith("D-K-00000.")


def test_a_laboratory_states_what_its_references_are_traceable_to(
    own: Issued, device: Session, resting: Result
) -> None:
    stated = own.certificate.laboratory
    none = Laboratory(name="A", address="B")
    parts = replace(noise_parts(resting.session, "dot", resting.evaluation), untraceable="")
    told = traceability_of(device, stated, parts)
    assert told[-1] == "The laboratory states: gravity by certificate 17"
    assert traceability_of(device, none, parts)[0].startswith("Metrological traceability is not")
    assert traceability_of(resting.session, stated, parts)[0] == "None: nothing was measured."
    of_nothing = replace(parts, untraceable="No.")
    assert traceability_of(device, stated, of_nothing) == ["No.", *parts.references]


def test_the_device_is_identified_by_what_it_states(own: Issued, device: Session) -> None:
    entries = {entry.name: entry for entry in own.certificate.items[0].entries}
    assert (entries["Serial number"].value, entries["Firmware"].value) == ("4711", "2.1.0")
    assert entries["Device tag"].value == "D4-22"
    assert own.pdf is not None
    text = " ".join(pages(own.pdf))
    for word in ("4711", "2.1.0", "A. Client", "B. Operator", "Laboratory of Motion"):
        assert word in text
    assert device.fingerprint in squeezed(text)
    assert "Magnetometer: nothing was observed" in text


def test_what_nobody_states_is_blank_with_a_reason(noise: Issued) -> None:
    blank = " ".join(noise.certificate.blank)
    for what in ("customer (", "operator (", "serial number of dot (", "firmware of dot ("):
        assert what in blank
    assert noise.pdf is not None
    text = " ".join(pages(noise.pdf))
    assert "blank: a model has none: simulated, part 1" in text
    assert "blank: neither the session nor the laboratory states it" in text


def test_what_is_stated_is_marked_and_may_not_contradict_the_device(
    device: Session, resting: Result, laboratory: Path, tmp_path: Path
) -> None:
    def refused(session: Session, **stated) -> str:
        with pytest.raises(InputError) as caught:
            issue(session, tmp_path, laboratory, "noise", stated=Statement(**stated), **dot)
        return str(caught.value)

    dot: dict[str, str] = {}
    assert "states the serial number 4711" in refused(device, serial_numbers=("4712",))
    assert "unknown sensor" in refused(device, firmwares=("hand=2",))
    dot = {"sensor": "dot"}
    assert "is simulated" in refused(resting.session, serial_numbers=("4712",))
    assert "--ambient" in refused(resting.session, ambient="20 °C")
    assert list(tmp_path.iterdir()) == []


def test_the_json_keeps_to_the_schema_that_ships(noise, tested, calibrated, own) -> None:
    assert SCHEMA_FILE.read_text(encoding="utf-8") == schema_text()
    for issued in (noise, tested, calibrated, own):
        jsonschema.validate(json.loads(issued.json.read_text("utf-8")), certificate_schema())


def test_no_number_of_the_json_is_finer_than_the_page(tested, noise, calibrated) -> None:
    for issued in (tested, noise, calibrated):
        for table in issued.certificate.results:
            for quantity in [q for row in table.rows for q in row.quantities]:
                if quantity.expanded_uncertainty:
                    unit = 10.0 ** (int(f"{quantity.expanded_uncertainty:.1e}"[-3:]) - 1)
                    assert quantity.value is not None
                    assert np.isclose(quantity.value / unit, round(quantity.value / unit))


def copied(session: Session, folder: Path) -> Session:
    shutil.copytree(session.path, folder / session.name)
    return Session(folder / session.name)


def test_a_session_that_was_changed_is_refused(
    device: Session, laboratory: Path, tmp_path: Path
) -> None:
    changed = copied(device, tmp_path)
    file = changed.path / "imu_foot.parquet"
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    with pytest.raises(SessionError, match=r"imu_foot\.parquet was changed"):
        certify(changed, CertificateRequest(kind="noise", pdf=True, laboratory=laboratory))
    assert not (changed.path / "certificates").exists()


def test_nothing_is_written_through_a_link_of_a_session(
    device: Session, laboratory: Path, tmp_path: Path
) -> None:
    linked = copied(device, tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (linked.path / "certificates").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="is a symbolic link"):
        certify(linked, CertificateRequest(kind="noise", laboratory=laboratory))
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_findings_that_change_a_conclusion_are_carried(
    device: Session, laboratory: Path, tmp_path: Path
) -> None:
    told = copied(device, tmp_path)
    found = {"code": "time.gaps", "severity": "warning", "where": "", "sentence": "it had gaps"}
    ended = {"status": "interrupted", "message": "stopped by hand", "findings": [found]}
    write_json(told.path / "manifest.json", read_json(told.path / "manifest.json") | ended)
    issued = issue(Session(told.path), tmp_path, laboratory, "noise")
    assert issued.pdf is not None
    text = " ".join(pages(issued.pdf))
    assert "it had gaps" in text
    assert "interrupted: stopped by hand" in text


def test_an_evaluation_that_says_otherwise_is_refused(
    quick: Result, laboratory: Path, tmp_path: Path
) -> None:
    other = copied(quick.session, tmp_path)
    data = read_json(other.path / "evaluation.json")
    for metric in data["metrics"]:
        metric["value"] = 1.5 * (metric["value"] or 1)
    write_json(other.path / "evaluation.json", data)
    with pytest.raises(SessionError, match="has other results than the raw files give"):
        issue(other, tmp_path, laboratory, "test")


def test_nothing_is_certified_of_nothing(
    device: Session, poses: Session, resting: Result, laboratory: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="nothing was held against a truth"):
        issue(device, tmp_path, laboratory, "test")
    with pytest.raises(InputError, match="say which with --sensor"):
        issue(resting.session, tmp_path, laboratory, "noise")
    with pytest.raises(NotFoundError, match="known: dot, matrix"):
        issue(resting.session, tmp_path, laboratory, "noise", sensor="hand")
    assert list(tmp_path.iterdir()) == []


def test_what_exists_is_kept_and_what_fails_leaves_nothing(
    device: Session, laboratory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = issue(device, tmp_path, laboratory, "noise")
    before = first.json.read_bytes()
    with pytest.raises(InputError, match="certificates are kept, not replaced"):
        issue(device, tmp_path, laboratory, "noise")
    assert first.json.read_bytes() == before

    def full(*_, **__):
        raise OSError(ENOSPC, "full")

    monkeypatch.setattr(pipeline, "replaced_file", full)
    (tmp_path / "other").mkdir()
    with pytest.raises(StorageError, match="no room left"):
        issue(device, tmp_path / "other", laboratory, "noise")
    assert list((tmp_path / "other").iterdir()) == []


def test_what_is_missing_is_named_before_anything_else(
    device: Session, laboratory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(typesetting.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"extra 'certificate', which is .* install .*\[certificate\]"
    ):
        issue(device, tmp_path, tmp_path / "no_laboratory.yaml", "noise")
    out = tmp_path / "noise.pdf"
    issued = certify(device, CertificateRequest(kind="noise", laboratory=laboratory, out=out))
    assert (issued.pdf, issued.json) == (None, tmp_path / "noise.json")


def test_the_command_says_what_is_blank_and_where_the_files_are(
    device: Session, laboratory: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = copied(device, tmp_path)
    asked = ("certificate", "noise", session.path, "--laboratory", laboratory, "--pdf")
    assert command(*asked) == 0
    said = capsys.readouterr().out
    (blank,) = [line for line in said.splitlines() if line.startswith("left blank: ")]
    assert "operator (neither" in blank and "customer (" in blank
    (pdf,) = (session.path / "certificates").glob("noise_foot_*.pdf")
    assert f"pdf:  {pdf}" in said and pdf.with_suffix(".json").is_file()
    assert command("verify", session.path) == 0
    assert command("certificate", "schema") == 0
    assert '"testbench certificate"' in capsys.readouterr().out


def test_no_laboratory_is_one_message(
    device: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert command("certificate", "noise", device.path, "--json") == 2
    told = json.loads(capsys.readouterr().err)["error"]
    assert "testbench certificate laboratory" in told["message"]
