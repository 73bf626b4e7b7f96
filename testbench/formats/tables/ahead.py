"""Work that threads do while what came before it is looked at."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 2
"""Pieces that are worked on meanwhile, each by a thread of its own."""
AT_ONCE = 3
"""So many pieces are worked on by the caller first: those that tell what a recording is."""


def worked_ahead(
    work: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[tuple[Item, Callable[[], Result]]]:
    """Each item with what gives the result of work on it, or raises what that raised.

    The first `AT_ONCE` are worked on by the caller's thread, so that who wants no more pays for no
    more. The items are taken in the caller's thread, too; where that fails, it fails after those
    before it were given.

    Args:
        work: In other threads, where it must let go of the interpreter to gain anything.
        items: To work on.
    """
    rest = iter(items)
    for first in islice(rest, AT_ONCE):
        yield first, partial(work, first)
    waiting: deque[tuple[Item, Future[Result]]] = deque()
    with ThreadPoolExecutor(AHEAD) as threads:
        try:
            for item in rest:
                waiting.append((item, threads.submit(work, item)))
                if len(waiting) > AHEAD:
                    done, future = waiting.popleft()
                    yield done, future.result
        except Exception:
            yield from ((done, future.result) for done, future in waiting)
            raise
        yield from ((done, future.result) for done, future in waiting)
