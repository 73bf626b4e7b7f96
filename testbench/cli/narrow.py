"""Tables on a terminal narrower than they are: numbers stay whole, words wrap."""

from __future__ import annotations

from dataclasses import dataclass

GAP, EDGES, TIGHT_GAP = 3, 2, 2
"""Between columns and at both ends of a table, and between columns where room is short."""
SHORTEST_FOLD = 8
"""A column of words is never folded to less."""
NOTHING = "-"


@dataclass
class Layout:
    """How a table is shown.

    Attributes:
        kept: Columns, by their place.
        widths: Theirs; None where every column is as wide as it likes.
        same: Names and values of the columns left out because every row has the same in them.
        width: Of the whole table.
    """

    kept: list[int]
    widths: list[int] | None
    same: list[tuple[str, str]]
    width: int


def fit(columns: list[str], rows: list[list[str]], numeric: list[bool], room: int) -> Layout:
    """How to show a table in so many characters.

    Titles and words go over several lines, numbers never do; what every row has alike leaves the
    table, as far as it must, and is said once. Where all that does not suffice the table stays
    wider than there is room.

    Args:
        columns: Titles.
        rows: Cells as they are shown, one for each column.
        numeric: Of each column.
        room: Characters.
    """
    every = list(range(len(columns)))
    natural = [max([len(columns[i]), *(len(row[i]) for row in rows)]) for i in every]
    whole = sum(natural) + GAP * (len(columns) - 1) + EDGES
    if whole <= room:
        return Layout(every, None, [], whole)
    least = [
        max(_longest_word([columns[i]]), *map(len, (row[i] for row in rows)))
        if numeric[i]
        else _longest_word([columns[i], *(row[i] for row in rows)])
        for i in every
    ]
    kept, same = every, []
    alike = [
        i
        for i in every
        if len(rows) > 1 and len({row[i] for row in rows}) == 1 and rows[0][i] not in ("", NOTHING)
    ]
    for i in alike[: len(columns) - 2]:
        if _total(least, kept) <= room:
            break
        kept = [other for other in kept if other != i]
        same.append((columns[i], rows[0][i]))
    widths = [least[i] if numeric[i] else natural[i] for i in every]
    shortest = [least[i] if numeric[i] else min(least[i], SHORTEST_FOLD) for i in every]
    for limit in (least, shortest):
        while _total(widths, kept) > room:
            wide = [i for i in kept if widths[i] > limit[i]]
            if not wide:
                break
            widths[max(wide, key=lambda i: widths[i])] -= 1
    return Layout(kept, [widths[i] for i in kept], same, _total(widths, kept))


def _total(widths: list[int], kept: list[int]) -> int:
    return sum(widths[i] for i in kept) + TIGHT_GAP * (len(kept) - 1)


def _longest_word(texts: list[str]) -> int:
    return max((len(word) for text in texts for word in text.split()), default=1)
