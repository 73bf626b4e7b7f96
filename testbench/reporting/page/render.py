"""HTML from sections: the one place that knows the template."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from testbench.reporting.page.figure_parts import Figure
from testbench.reporting.page.figures import packed_plotly
from testbench.reporting.page.glossary import terms
from testbench.reporting.page.page import (
    Figures,
    Folded,
    Heading,
    Page,
    Sentence,
    figures_first,
)
from testbench.reporting.page.scene import drawing, turnable
from testbench.reporting.page.tables import Table, counted, powers_of_ten

TEMPLATES = Path(__file__).resolve().parent / "templates"
HOW = "How to read: "
"""What the lines below tables and figures begin with; the page shows them behind these words."""


def render_page(page: Page) -> str:
    """A page that works offline."""
    sections = [figures_first(section) for section in page.sections]
    blocks = [*page.answer, *(block for section in sections for block in section.blocks)]
    return _template().render(
        vars(page) | {"sections": sections},
        has_figures=page.scene is not None or any(isinstance(block, Figures) for block in blocks),
    )


@cache
def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.tests["table"] = lambda block: isinstance(block, Table)
    environment.tests["figures"] = lambda block: isinstance(block, Figures)
    environment.tests["fold"] = lambda block: isinstance(block, Folded)
    environment.tests["heading"] = lambda block: isinstance(block, Heading)
    environment.tests["sentence"] = lambda block: isinstance(block, Sentence)
    environment.globals["packed_plotly"] = lambda: Markup(packed_plotly())
    environment.filters["drawing"] = lambda scene: Markup(drawing(scene))
    environment.filters["turnable"] = turnable
    environment.filters["lean"] = _lean
    environment.filters["breakable"] = _breakable
    environment.filters["code"] = _code
    environment.filters["plain_how"] = lambda how: how.removeprefix(HOW)
    environment.globals["counted"] = counted
    environment.globals["terms"] = terms
    environment.globals["verbatim"] = _verbatim
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("report.html.j2")


def _lean(figure: Figure) -> Figure:
    """The figure whose curves have no abscissae where they are those of the first: half its size.

    The page's script puts them back.
    """
    first, *others = figure["data"]
    shared = first.get("x")
    lean = [own | {"x": None} if own.get("x") is shared is not None else own for own in others]
    return figure | {"data": [first, *lean]}


def _breakable(text: str) -> Any:
    """A name that may go on in another line after an underscore or a point inside it."""
    return Markup(re.sub(r"(?<=[^\s_.])([_.])(?=[A-Za-z])", r"\1<wbr>", str(escape(text))))


def _code(text: str) -> Any:
    """A sentence whose parts in backticks are shown as code, and whose powers of ten as such."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(powers_of_ten(text)))))


def _verbatim(name: str) -> Any:
    """A style sheet or script of ours, unescaped."""
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))
