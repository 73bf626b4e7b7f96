"""Tables of numbers in the documents say what made them; the quick ones are as it makes them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.documents.blocks import ROOT, documents
from tests.documents.numbers import GENERATORS, MARK, misalignment_fits, renewed, table_of

NOTE = re.compile(r"<!-- numbers(?:| of| stated in): .+ -->")
TABLE = re.compile(r"^\|.*\n\|[-:| ]+\|\n(?:\|.*\n)+", re.MULTILINE)
NUMBER = re.compile(r"[-+±<>~≤*]*\d")
SHARE = 0.34
"""A table with more cells that begin with a number than this is one of numbers."""
EXEMPT = {
    "docs/protocol_reference.md": "defaults, which tests/records hold to the program",
    "docs/studies.md": "made from studies, which tests/studies/test_page.py holds it to",
}


def is_of_numbers(table: str) -> bool:
    """Whether a table of Markdown shows numbers; its first column names rows."""
    rows = [line.strip("| ").split("|")[1:] for line in table.splitlines()[2:]]
    cells = [cell.strip() for row in rows for cell in row]
    return sum(bool(NUMBER.match(cell)) for cell in cells) > SHARE * len(cells)


@pytest.mark.parametrize("page", documents(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_tables_of_numbers_say_what_made_them(page: Path) -> None:
    if page.relative_to(ROOT).as_posix() in EXEMPT or "decisions" in page.parts:
        return
    text = page.read_text(encoding="utf-8")
    silent = [
        found[0].splitlines()[0]
        for found in TABLE.finditer(text)
        if is_of_numbers(found[0])
        and not NOTE.fullmatch(text[: found.start()].rstrip().rpartition("\n")[2])
    ]
    assert silent == []


def test_what_made_them_exists() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in documents())
    assert sorted(MARK.findall(text)) == sorted(GENERATORS)
    for module in re.findall(r"<!-- numbers of: python -m (tests[\w.]+) -->", text):
        assert (ROOT / f"{module.replace('.', '/')}.py").is_file()
    for path in re.findall(r"<!-- numbers stated in: (\S+) -->", text):
        assert (ROOT / path).exists()


def test_quick_tables_are_as_they_are_made(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "methods.md").read_text(encoding="utf-8")
    assert renewed(page, "misalignment_fits", misalignment_fits(tmp_path)) == page


def test_sentences_below_the_tuning_table_have_its_means() -> None:
    page = (ROOT / "docs" / "tuning.md").read_text(encoding="utf-8")
    _, _, after = page.partition("<!-- numbers: tuning_on_broad -->")
    (means,) = re.findall(r"^\| mean \|(.*)\|$", after, re.MULTILINE)
    begin, _, own, _, others = (cell.strip() for cell in means.split("|"))
    for mean in (begin, own, others):
        assert f"{mean} deg" in after


def test_a_table_is_replaced_and_nothing_beside_it() -> None:
    before = "a\n\n<!-- numbers: one -->\n\n| x |\n|---|\n| 1 |\n\nb\n"
    after = renewed(before, "one", [["x", "y"], ["2", "3"]])
    assert after == before.replace("| x |\n|---|\n| 1 |\n", table_of([["x", "y"], ["2", "3"]]))
    assert renewed(before, "two", [["x"]]) == before
