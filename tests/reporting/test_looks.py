"""How a report looks in a window, on a phone, in the dark and on paper."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.reporting.report import report
from tests.reporting.browsing import needs_browser
from tests.reporting.conftest import Judged
from tests.reporting.looking import DARK, axe_source, is_blank, look, picture, printed_pages

pytestmark = [pytest.mark.browser, pytest.mark.slow, needs_browser]
FIRST_FIGURE = 900
MOST_SHEETS = 6


@pytest.fixture(scope="module")
def page(quick: Judged) -> Path:
    return report(quick.session, quick.estimate, quick.evaluation)


@pytest.mark.parametrize(("width", "flags"), [(1300, ()), (420, ()), (1300, (DARK,))])
def test_nothing_of_a_report_overlaps_or_sticks_out(
    page: Path, tmp_path: Path, width: int, flags: tuple[str, ...]
) -> None:
    looked = look(page, tmp_path, width, *flags, axe=axe_source() if width > 500 else None)
    assert not looked.faults, looked.faults
    assert looked.dark == bool(flags)
    if width > 500:
        assert looked.serious is not None
        assert looked.first_figure is not None and looked.first_figure < FIRST_FIGURE
    if width > 500 and not flags:  # one drawing will do: test_report has the dark one
        pixels = picture(page, tmp_path / "page.png", tmp_path, (width, 1400), *flags)
        assert not is_blank(pixels)


def test_quick_takes_few_sheets_of_paper(page: Path, tmp_path: Path) -> None:
    assert 1 < printed_pages(page, tmp_path / "page.pdf", tmp_path) <= MOST_SHEETS
