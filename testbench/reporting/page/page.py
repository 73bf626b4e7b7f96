"""What a page is made of: sections of tables, figures and sentences."""

from __future__ import annotations

from dataclasses import dataclass, field

from testbench.reporting.page.figures import Figure
from testbench.reporting.page.tables import Table


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
    """A plain sentence, such as why there is no figure here."""

    text: str


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


@dataclass(frozen=True)
class Tile:
    """A number worth seeing first."""

    value: str
    unit: str
    title: str
    detail: str = ""
