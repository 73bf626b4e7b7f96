"""HTML from sections: the one place that knows the template."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from testbench.reporting.figures import plotly_script
from testbench.reporting.page import Figures, Folded, Heading, Section, Tile
from testbench.reporting.tables import Table, counted, powers_of_ten

ERRORS = (
    "Errors are estimated minus true; e is an error, |e| its magnitude. Angles in degrees, times "
    "in seconds since the start of the session."
)
TEMPLATES = Path(__file__).resolve().parent / "templates"


def render_page(
    *,
    title: str,
    purpose: str,
    facts: Sequence[tuple[str, str]],
    tiles: Sequence[Tile],
    sections: Sequence[Section],
    outcome: str | None = None,
    verdict: str = "",
    simulated: str = "",
    modelled_filter: str = "",
    partial: str = "",
    kind: str = "report",
    footer: str = ERRORS,
) -> str:
    """A page that works offline.

    Args:
        title: Its head.
        purpose: Its head.
        facts: Names and values below it.
        tiles: Numbers worth seeing first.
        sections: The body.
        outcome: Colour of the badge beside the title, None for no badge.
        verdict: Its words.
        simulated: From what the samples come, where that is not real.
        modelled_filter: The filter that is a model as well.
        partial: What lies in another session, where a run was gone on with.
        kind: What the page is, for the window's title.
        footer: Its last line.
    """
    return _template().render(
        title=title,
        purpose=purpose,
        outcome=outcome,
        verdict=verdict,
        simulated=simulated,
        modelled_filter=modelled_filter,
        partial=partial,
        kind=kind,
        footer=footer,
        facts=facts,
        tiles=tiles,
        sections=sections,
        has_figures=any(
            isinstance(block, Figures) for section in sections for block in section.blocks
        ),
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
    environment.globals["plotly_script"] = lambda: Markup(plotly_script())
    environment.filters["breakable"] = _breakable
    environment.filters["code"] = _code
    environment.globals["counted"] = counted
    environment.globals["verbatim"] = _verbatim
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment.get_template("report.html.j2")


def _breakable(text: str) -> Any:
    """A name that may go on in another line after an underscore or a point inside it."""
    return Markup(re.sub(r"(?<=[^\s_.])([_.])(?=[A-Za-z])", r"\1<wbr>", str(escape(text))))


def _code(text: str) -> Any:
    """A sentence whose parts in backticks are shown as code, and whose powers of ten as such."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(powers_of_ten(text)))))


def _verbatim(name: str) -> Any:
    """A style sheet or script of ours, unescaped."""
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))
