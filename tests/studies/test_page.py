"""Numbers of ours in docs/studies.md are those of studies that were run."""

from __future__ import annotations

import re
from itertools import chain

import pytest
import yaml

from testbench.records.results.study import StudyReason, StudyRecord, StudyRow, StudyTable
from testbench.records.specs.published import PUBLISHED
from tests.studies import page

NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?")
GIVEN = {
    "8.9e-7": "table 4.1 of Botina & Vergara, rounded",
    "2116 7106": "means of table 4.7 of Botina & Vergara",
    "1000": "R of Quijano & Valencia's text",
    "0.498": "mean magnitude of table 4.3 of Quijano & Valencia",
    "24": "poses of gimvebo_gyro",
    "38": "rests of imu_tk",
    "0.001 0.17": "range of the rows 10 sigma",
    "1.5": "Hz, in elbow_rates",
    "26 27": "figures of de Miguel",
    "2.7": "% of variability, Walker",
    "3.2 3.4 4.19 4.29 4.35 4.37": "figures of Quijano & Valencia",
}
"""Numbers of the page that are neither ours nor in a published file."""


def test_the_page_is_made_of_the_values_that_are_kept():
    """After a change of studies.md.j2 or of a study: python -m tests.studies.page logs."""
    used: set[str] = set()
    kept = page.kept()

    def look(address: str) -> list:
        used.add(address)
        return kept[address]

    assert page.rendered(look) == page.PAGE.read_text(encoding="utf-8")
    assert used == set(kept)


def test_no_number_of_ours_is_typed():
    text = page.TEMPLATE.read_text(encoding="utf-8")
    text = re.sub(r"\{#.*?#\}|\{\{.*?\}\}|```.*?```", "", text, flags=re.DOTALL)
    text = re.sub(r"\]\([^)]*\)|`[^`]*`", "", text)
    assert "±" not in text.replace("mean ± standard deviation", "").replace("ours ± is", "")
    printed = set(chain.from_iterable(map(_numbers, PUBLISHED.glob("*.yaml"))))
    given = {number for several in GIVEN for number in several.split()}
    for match in NUMBER.finditer(text):
        told = match[0]
        decimals = len(told.partition(".")[2])
        rounded = "e" not in told and any(round(n, decimals) == float(told) for n in printed)
        around = text[max(match.start() - 40, 0) : match.end() + 20]
        assert rounded or told in given or float(told) in printed, around


def _numbers(file) -> list[float]:
    """All of a published file, and the means of its rows and columns."""
    found = []

    def walk(content) -> None:
        if isinstance(content, dict):
            content = list(content.values())
        if isinstance(content, list):
            several = [n for n in content if isinstance(n, int | float)]
            if several:
                found.append(sum(several) / len(several))
            for each in content:
                walk(each)
        elif isinstance(content, int | float):
            found.append(float(content))
        elif isinstance(content, str):
            found.extend(float(number) for number in NUMBER.findall(content))

    walk(yaml.safe_load(file.read_text(encoding="utf-8")))
    return found


def test_an_address_finds_its_number_and_another_run_another():
    def record(value: float) -> StudyRecord:
        rows = (
            StudyRow("first", ("yes", value), spread=(None, 0.02), settings="ours"),
            StudyRow("second", ("no", 7.0)),
        )
        reasons = (StudyReason("Because.", "shown", "t"),)
        table = StudyTable("t", "T", ("said", "angle [deg]"), rows, "How.", reasons=reasons)
        return StudyRecord("reference-1", "", "", "", "", {}, (), ("Found.",), (table,))

    def look(address: str, value: float = 0.25) -> list:
        return page.looked_up({"reference-1": record(value)}, f"reference-1|{address}")

    assert look("t|first|angle") == [0.25, 0.02] and look("t|first|angle", 0.5) == [0.5, 0.02]
    assert look("t|first, our settings|said") == ["yes", None]
    assert look("t|*|angle") == [0.25, 7.0] and look("t|sec|") == ["second"]
    assert look("t|reasons|") == [["shown", "Because."]] and look("findings||") == ["Found."]
    with pytest.raises(SystemExit, match="0 of these begin so: first, our settings; second"):
        look("t|third|angle")
