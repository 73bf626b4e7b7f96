"""What a page does by itself: figures are unpacked, tables sort and are saved, terms explained."""

from __future__ import annotations

import base64
import gzip
import json
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from testbench.reporting.page.figures import packed_plotly
from testbench.reporting.page.glossary import terms
from testbench.reporting.page.page import Figures, Page, Section
from testbench.reporting.page.render import render_page
from testbench.reporting.page.tables import Cell, Row, Table, label, number
from tests.reporting.browsing import browse, needs_browser

ROWS = [
    Row([Cell("one", head=True, span=2)], "group"),
    Row([label("a"), Cell("2.10 ± 0.1", kind="number")]),
    Row([label("Table 5"), Cell("9", kind="number")], "published"),
    Row([label('b, "B"'), Cell("−3.0", kind="number")]),
    Row([label("c"), number(None)]),
    Row([label("d"), Cell("1.5·10⁻³", kind="number")]),
    Row([Cell("two", head=True, span=2)], "group"),
    Row([label("f"), Cell("5", kind="number")]),
    Row([label("e"), Cell("4", kind="number")]),
]
TABLE = Table("t", [Cell("name"), Cell("heading [deg]", kind="number")], ROWS, "How to read: U.")
FIGURE = {
    "data": [{"type": "scatter", "x": [1, 2], "y": [1, 2]}],
    "layout": {"height": 300, "xaxis": {}, "yaxis": {}},
}


WAIT = """
const wait = setInterval(() => {
  if (document.documentElement.dataset.drawn !== "all") return;
  clearInterval(wait);
  const place = document.createElement("pre");
  place.id = "told";
  place.textContent = JSON.stringify(told());
  document.body.replaceChildren(place);
  document.head.replaceChildren();
}, 20);
"""
CATCH = (
    "window.Blob = function (parts) { saved += parts.join(''); }; URL.createObjectURL = () => '#';"
)


def ran(tmp_path: Path, script: str) -> Any:
    """What a script says of a page with a table and a figure, once that is drawn."""
    figures = Figures("f", {"f": FIGURE}, "")
    page = render_page(
        Page("t", "", [], [], [Section("a", "A", [figures]), Section("b", "B", [TABLE])])
    )
    added = f"<script>let saved = ''; const told = () => {{ {script} }}; {WAIT}</script>"
    file = tmp_path / "page.html"
    file.write_text(page.replace("</body>", f"{added}</body>"), encoding="utf-8")
    found = re.search(
        r'<pre id="told">(.*?)</pre>', browse(file, tmp_path / "profile", "--dump-dom")
    )
    assert found is not None
    return json.loads(unescape(found[1]))


def test_plotly_is_packed_whole() -> None:
    from plotly.offline import get_plotlyjs

    packed = packed_plotly()
    assert gzip.decompress(base64.b64decode(packed)).decode() == get_plotlyjs()
    assert len(packed) < 2_200_000


@pytest.mark.browser
@needs_browser
def test_a_figure_is_drawn_by_what_was_unpacked(tmp_path: Path) -> None:
    told = ran(
        tmp_path, "return [document.querySelectorAll('.figure .trace').length, Plotly.version]"
    )
    assert told[0] == 1 and told[1]


ORDER = (
    "Array.from(document.querySelectorAll('tbody tr'), (row) => row.cells[0].textContent.trim())"
)


@pytest.mark.browser
@needs_browser
def test_a_table_sorts_within_its_groups_and_what_belongs_together_stays(tmp_path: Path) -> None:
    told = ran(
        tmp_path,
        "const button = document.querySelectorAll('th button')[1]; const found = [];"
        f"for (let i = 0; i < 3; i++) {{ button.click(); found.push({ORDER}); }} return found;",
    )
    up, down, before = told
    b = 'b, "B"'
    assert up == ["one", b, "d", "a", "Table 5", "c", "two", "e", "f"]
    assert down == ["one", "a", "Table 5", "d", b, "c", "two", "f", "e"]
    assert before == ["one", "a", "Table 5", b, "c", "d", "two", "f", "e"]


@pytest.mark.browser
@needs_browser
def test_a_table_is_saved_as_csv(tmp_path: Path) -> None:
    told = ran(
        tmp_path,
        f"{CATCH} document.querySelectorAll('.tools button')[1].click(); return saved;",
    )
    lines = told.removeprefix("\ufeff").splitlines()
    assert lines[0] == "name,heading [deg]" and lines[1] == "one,"
    assert '"b, ""B""",-3.0' in lines and "a,2.10 ± 0.1" in lines


def test_terms_are_those_of_the_documentation() -> None:
    known = {name: term.text for term in terms() for name in term.names}
    assert known["U"] == known["Expanded uncertainty"] and "95 %" in known["U"]
    assert known["Proximal"] == known["distal"]
    assert "the robot" in known["Arm"] and "upper arm" in known["Arm"]  # both entries of the word
    assert "Plan." not in known and not any("**" in text for text in known.values())


@pytest.mark.browser
@needs_browser
def test_a_term_in_a_title_explains_itself(tmp_path: Path) -> None:
    told = ran(
        tmp_path,
        "const found = document.querySelectorAll('main abbr');"
        "return Array.from(found, (term) => [term.textContent, term.title]);",
    )
    known = {name.lower(): term.text for term in terms() for name in term.names}
    assert ["heading", known["heading"]] in told
    assert ["U", known["u"]] in told
