"""The commands of docs/how_to run as they stand there, and print what the page shows; those that
take longer, or an arm, are run by `tests.benchmarks.documents`.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.documents.blocks import HOW_TO, ROOT
from tests.documents.how_to import faults_of
from tests.documents.kinds import LONG_PAGES, WITH_AN_ARM

PAGES = sorted(page for page in HOW_TO.glob("*.md") if page.name != "README.md")
LONGEST_PAGE = 62
"""Lines of the longest page: what a screen or two hold, with its file of YAML."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if page.stem not in (*LONG_PAGES, *WITH_AN_ARM)],
    ids=lambda page: page.stem,
)
def test_a_page_runs_as_written(page: Path, tmp_path: Path) -> None:
    assert faults_of(page, tmp_path) == []


def test_pages_that_only_make_long_runs_are_pages() -> None:
    assert {*LONG_PAGES, *WITH_AN_ARM} < {page.stem for page in PAGES}


def test_every_task_has_a_picture_a_screen_and_a_place_in_the_list() -> None:
    listed = re.findall(r"\]\((\w+\.md)\)", (HOW_TO / "README.md").read_text(encoding="utf-8"))
    assert sorted(listed) == [page.name for page in PAGES]
    assert len(PAGES) >= 10
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        (picture,) = re.findall(r"!\[[^\]]+\]\(\.\./images/(\w+\.png)\)", text)
        assert (ROOT / "docs" / "images" / picture).is_file()
        assert len(text.splitlines()) <= LONGEST_PAGE
