"""Devices that write a file a message: the files of one folder are one device."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.tables.text_table import TextTable


def by_folder(
    tables: Iterable[TextTable],
    kind_of: Callable[[TextTable], str],
    called: Mapping[str, str],
) -> dict[Path, dict[str, TextTable]]:
    """The tables of each device, by what they are.

    Args:
        tables: Of all devices.
        kind_of: What a table is; no device has two of one kind.
        called: File of each kind, as the maker calls it.

    Raises:
        InputError: Two of a kind stand in one folder.
    """
    devices: dict[Path, dict[str, TextTable]] = {}
    for table in tables:
        kind = kind_of(table)
        own = devices.setdefault(table.file.resolve().parent, {})
        if kind in own:
            raise InputError(
                f"{table.file} and {own[kind].file} are both the {called[kind]} of one device; "
                "put each device in its own folder"
            )
        own[kind] = table
    return devices
