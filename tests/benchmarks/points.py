"""What campaigns that try something at each of many points share: how the points are walked, and
how what failed is told.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

MOST_TOLD = 40
"""Failures that are printed, the first ones."""
Found = dict[str, Any]
"""What a trial came to; `failure` says what was wrong, "" where nothing was."""


class Tried(Protocol):
    """What is tried, in a folder of its own.

    Attributes:
        points: At which, in an order by chance that is the same every time.
    """

    points: list[tuple[Any, ...]]

    def trial(self, *point: Any, **named: Any) -> Found:
        """What one of the points came to."""
        ...


def walk(make: Callable[[Path], Tried]) -> Callable[[range], Iterator[Found]]:
    """Trials for `resumed`, by the numbers of their points, as far as there are any.

    Args:
        make: What is tried, in a folder that is removed afterwards.
    """

    def trials(numbers: range) -> Iterator[Found]:
        with tempfile.TemporaryDirectory() as name:
            tried = make(Path(name))
            for number in numbers:
                if number >= len(tried.points):
                    return
                yield tried.trial(*tried.points[number])

    return trials


def by(found: Sequence[Found], key: str) -> dict[str, list[Found]]:
    """Trials by one of their values, in the order in which these came first."""
    result: dict[str, list[Found]] = {}
    for one in found:
        result.setdefault(one[key], []).append(one)
    return result


def failed(found: Sequence[Found]) -> int:
    """How many trials failed."""
    return sum(one["failure"] != "" for one in found)


def tell_failures(found: Sequence[Found], where: str, what: str = "points tried") -> bool:
    """Print how many trials failed, and how; whether none did.

    Args:
        found: What they came to.
        where: Says which trial it was; its values stand for the names in braces.
        what: Trials are, in the plural.
    """
    print(f"{len(found)} {what}, {failed(found)} failed")
    for one in [one for one in found if one["failure"]][:MOST_TOLD]:
        print(f"  {where.format_map(one)}: {one['failure']}")
    return not failed(found)
