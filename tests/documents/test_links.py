"""Links between documents lead to files that exist and headings that stand there, by the anchors
that a forge makes of headings.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from tests.documents.blocks import FENCE, ROOT, documents

LINK = re.compile(r"\]\(([^()\s]*(?:\([^()\s]*\)[^()\s]*)*)\)")
PAGES = [*documents(), ROOT / "CHANGELOG.md"]


def prose(document: Path) -> str:
    """A document without its fenced blocks."""
    return FENCE.sub("", document.read_text(encoding="utf-8"))


@cache
def anchors(document: Path) -> set[str]:
    """What can stand behind # of a link to a document: lower case, without punctuation."""
    found: set[str] = set()
    for heading in re.findall(r"^#{1,6} (.+?) *$", prose(document), re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)|[`*]", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        number = 0
        while (own := f"{slug}-{number}" if number else slug) in found:
            number += 1
        found.add(own)
    return found


@pytest.mark.parametrize("document", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings(document: Path) -> None:
    broken = []
    for target in LINK.findall(prose(document)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (document.parent / name).resolve() if name else document
        lost = anchor and file.suffix == ".md" and anchor not in anchors(file)
        if not file.exists() or lost:
            broken.append(target)
    assert broken == []


def test_a_heading_that_is_not_there_is_noticed() -> None:
    assert "from-two-dots-to-a-knee-curve" in anchors(ROOT / "docs" / "joint_angles.md")
    assert "truth_sensorparquet" in anchors(ROOT / "docs" / "session_format.md")
    assert "no-such-heading" not in anchors(ROOT / "README.md")
