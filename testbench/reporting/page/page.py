"""What a page is made of: sections of tables, figures and sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from testbench.reporting.page.figures import Figure
from testbench.reporting.page.scene import Scene
from testbench.reporting.page.tables import Table

ERRORS = (
    "Errors are estimated minus true; e is an error, |e| its magnitude. Angles in degrees, times "
    "in seconds since the start of the session."
)


@dataclass(frozen=True)
class Figures:
    """One figure, or several small ones side by side.

    Attributes:
        caption: What they show.
        figures: By the words a screen reader says.
        how: How to read them, one line.
        small: Several to a row.
        folded: Shown, and drawn, only when asked for.
    """

    caption: str
    figures: dict[str, Figure]
    how: str
    small: bool = False
    folded: bool = False


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    title: str


@dataclass(frozen=True)
class Sentence:
    """A plain sentence, such as why there is no figure here.

    Attributes:
        text: Of it.
        weight: "note" or "warning" of what must not be overlooked, the outcome of a limit; empty
            of the others.
    """

    text: str
    weight: str = ""


@dataclass(frozen=True)
class Folded:
    """Blocks of one kind that are too many to stand one below the other: shown only when asked
    for.
    """

    caption: str
    blocks: list[Table]


Block = Table | Figures | Heading | Sentence | Folded


@dataclass
class Section:
    """A part of the page that the contents list; `key` is its anchor."""

    key: str
    title: str
    blocks: list[Block] = field(default_factory=list)


def figures_first(section: Section) -> Section:
    """The section with its tables behind its figures, and folded, under each of its headings.

    One without a figure to be seen stays as it is.
    """
    if not any(isinstance(block, Figures) and not block.folded for block in section.blocks):
        return section
    groups: list[list[Block]] = [[]]
    for block in section.blocks:
        if isinstance(block, Heading):
            groups.append([])
        groups[-1].append(block)
    ordered: list[Block] = []
    for group in groups:
        tables = [block for block in group if isinstance(block, Table | Folded)]
        ordered += [block for block in group if not isinstance(block, Table | Folded)]
        ordered += [replace(t, folded=True) if isinstance(t, Table) else t for t in tables]
    return Section(section.key, section.title, ordered)


@dataclass(frozen=True)
class Tile:
    """A number worth seeing first."""

    value: str
    unit: str
    title: str
    detail: str = ""


@dataclass(frozen=True)
class Page:
    """All that a page shows, from top to bottom.

    Attributes:
        title: The headline, and the first part of the window's title.
        purpose: The sentence below the headline; empty for none.
        facts: Names and values below the answer.
        tiles: Numbers worth seeing first.
        sections: The body.
        answer: What was found, in sentences and figures: the first screen.
        scene: What stood on the bench, drawn beside the first sentences; None for nothing.
        outcome: Colour of the badge beside the title, None for no badge.
        verdict: Words on the badge.
        simulated: From what the samples come, where that is not real.
        modelled_filter: The filter that is a model as well.
        partial: What lies in another session, where a run was gone on with.
        kind: What the page is, for the window's title.
        footer: The last line.
    """

    title: str
    purpose: str
    facts: Sequence[tuple[str, str]]
    tiles: Sequence[Tile]
    sections: Sequence[Section]
    answer: Sequence[Block] = ()
    scene: Scene | None = None
    outcome: str | None = None
    verdict: str = ""
    simulated: str = ""
    modelled_filter: str = ""
    partial: str = ""
    kind: str = "report"
    footer: str = ERRORS
