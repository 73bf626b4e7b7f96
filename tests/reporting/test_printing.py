"""A report on paper: by a browser where there is one, else that is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.records.session.layout import PRINTED
from testbench.reporting.page import printing
from testbench.reporting.page.printing import PrintingError, browser, print_page
from testbench.reporting.report import report
from tests.reporting.browsing import needs_browser
from tests.reporting.conftest import Judged


def test_without_a_browser_it_is_said_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(printing, "INSTALLED", ())
    monkeypatch.setenv("PATH", str(tmp_path))
    assert browser() is None
    with pytest.raises(PrintingError, match="install Chromium, Chrome or Edge"):
        print_page(tmp_path / "report.html", tmp_path / "report.pdf")
    assert list(tmp_path.iterdir()) == []


def test_a_browser_that_prints_nothing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "chromium"
    program.write_text("#!/bin/sh\nexit 7\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PrintingError, match="ended with code 7"):
        print_page(tmp_path / "report.html", tmp_path / "report.pdf")
    assert not (tmp_path / "report.pdf").exists()


def test_what_was_printed_of_an_earlier_report_goes(quick: Judged) -> None:
    printed = quick.session.path / PRINTED
    printed.write_bytes(b"%PDF-")
    report(quick.session, quick.estimate, quick.evaluation)
    assert not printed.exists()


@pytest.mark.browser
@needs_browser
def test_a_page_is_printed(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("<p>words</p>")
    assert print_page(page, tmp_path / "page.pdf").read_bytes().startswith(b"%PDF-")
