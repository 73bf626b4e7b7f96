"""When a recording was made, by what its files say.

That is a header, a stamp, or the name that a vendor's software gave.

A date that could be read in two ways (3/4/2023) is not read at all.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

from testbench.exceptions import InputError

EARLIEST = 1990
"""A year before it, such as the 1970 of a clock that was never set, is no date of a recording."""
NO_ZONE = "its time zone is not stated: UTC is assumed, it may be off by 14 h"
_YEAR_FIRST = re.compile(
    r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
    r"(?:[T _]+(?P<H>\d{1,2})[:.-](?P<M>\d{2})(?:[:.-](?P<S>\d{2})(?:[._,]\d+)?)?)?"
)
_YEAR_LAST = re.compile(
    r"(?P<a>\d{1,2})[-/.](?P<b>\d{1,2})[-/.](?P<y>\d{4})"
    r"(?:[T _,]+(?P<H>\d{1,2}):(?P<M>\d{2})(?::(?P<S>\d{2})(?:[.,]\d+)?)?"
    r"(?:\s*(?P<p>[AaPp])\.?[Mm]\.?)?)?"
)
_IN_NAME = re.compile(
    r"(?<!\d)(?P<y>\d{4})-?(?P<m>\d{2})-?(?P<d>\d{2})"
    r"[T _-](?P<H>\d{2})[-.h]?(?P<M>\d{2})[-.m]?(?P<S>\d{2})(?!\d)"
)
_ZONE = re.compile(
    r"(?:(?:GMT|UTC)\s*(?P<g>[+-])(?P<gh>\d{1,2})(?::?(?P<gm>\d{2}))?|(?P<z>Z|GMT|UTC)"
    r"|(?P<o>[+-])(?P<oh>\d{2}):?(?P<om>\d{2}))\s*$"
)
ENGLISH = ("%a %b %d %H:%M:%S %Y", "%d %b %Y %H:%M:%S", "%b %d %Y %H:%M:%S")


@dataclass(frozen=True)
class Recorded:
    """When a recording was made.

    Attributes:
        at: With its zone.
        source: Who says so, a phrase.
    """

    at: datetime
    source: str


def read_date(text: str) -> tuple[datetime, bool] | None:
    """A date as a file states it, and whether it states its time zone (else UTC).

    None where it is none, or ambiguous.
    """
    text = text.strip().strip('"')
    found = _YEAR_FIRST.match(text) or _YEAR_LAST.match(text)
    if found is None:
        for form in ENGLISH:
            try:
                return datetime.strptime(text, form).replace(tzinfo=UTC), False
            except ValueError:
                continue
        return None
    parts = found.groupdict()
    month, day = parts.get("m"), parts.get("d")
    if month is None:
        first, second = int(parts["a"]), int(parts["b"])
        if parts.get("p") or second > 12:  # am and pm are written where the month comes first
            month, day = first, second
        elif first > 12 or first == second:
            month, day = second, first
        else:
            return None
    hour = int(parts["H"] or 0)
    if parts.get("p"):
        hour = hour % 12 + (12 if parts["p"] in "Pp" else 0)
    zone = _ZONE.search(text[found.end() :])
    try:
        at = datetime(
            int(parts["y"]),
            int(month),
            int(day or 0),
            hour,
            int(parts["M"] or 0),
            int(parts["S"] or 0),
            tzinfo=UTC,
        )
        at -= _offset(zone) if zone else timedelta(0)
    except (ValueError, OverflowError):
        return None
    return (at, zone is not None) if at.year >= EARLIEST else None


def _offset(zone: re.Match[str]) -> timedelta:
    if zone["z"]:
        return timedelta(0)
    sign, hours, minutes = (
        (zone["g"], zone["gh"], zone["gm"]) if zone["g"] else (zone["o"], zone["oh"], zone["om"])
    )
    ahead = timedelta(hours=int(hours), minutes=int(minutes or 0)) * (1 if sign == "+" else -1)
    return timezone(ahead).utcoffset(None)


def recorded(text: str | None, source: str) -> Recorded | None:
    """The date that a text states, None where it states none; `source` says where it stands."""
    found = read_date(text) if text else None
    if found is None:
        return None
    at, zoned = found
    return Recorded(at, source if zoned else f"{source}; {NO_ZONE}")


def recorded_in_name(file: Path) -> Recorded | None:
    """The date and time in the name of a file, or of the two folders around it."""
    file = file.absolute()
    for name, what in (
        (file.stem, "the file's name"),
        (file.parent.name, "the folder's name"),
        (file.parent.parent.name, "the folder's name"),
    ):
        found = _IN_NAME.search(name)
        if found is not None:
            y, m, d, H, M, S = found.group("y", "m", "d", "H", "M", "S")
            result = recorded(f"{y}-{m}-{d} {H}:{M}:{S}", f"{what}, {name}")
            if result is not None:
                return result
    return None


def earliest(dates: Iterable[Recorded | None]) -> Recorded | None:
    """The first of several, None where there is none."""
    return min((date for date in dates if date is not None), key=lambda date: date.at, default=None)


def stated_date(text: str) -> Recorded:
    """What a person states with --recorded-at.

    Raises:
        InputError: It is no ISO date.
    """
    found = read_date(text) if re.match(r"\d{4}-", text.strip()) else None
    if found is None:
        raise InputError(
            f"--recorded-at {text}: write the date as 2021-08-20, or with a time as "
            "2021-08-20T20:21:13+08:00"
        )
    at, zoned = found
    return Recorded(at, "stated with --recorded-at" + ("" if zoned else ", in UTC"))
