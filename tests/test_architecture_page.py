"""docs/architecture.md names every room of the program and what each of them imports."""

from __future__ import annotations

import re

import grimp

from tests.house import ROOT

PAGE = ROOT / "docs" / "architecture.md"
ROOM = re.compile(r"^\| `(\w+)` \| (.+) \| (.*) \|$", re.M)
BELOW = {"exceptions", "extras", "frames", "clock"}
"""Modules that every room may use; the page says so once."""


def arrows() -> dict[str, set[str]]:
    """Rooms, and the rooms that each imports."""
    graph = grimp.build_graph("testbench", cache_dir=None)
    rooms = {name.split(".")[1] for name in graph.find_children("testbench")}
    found: dict[str, set[str]] = {room: set() for room in rooms - BELOW - {"__main__"}}
    for room, others in found.items():
        for module in {f"testbench.{room}", *graph.find_descendants(f"testbench.{room}")}:
            imported = graph.find_modules_directly_imported_by(module)
            others |= {name.split(".")[1] for name in imported if name.count(".")} - BELOW - {room}
    return found


def test_the_page_shows_every_room_and_every_arrow() -> None:
    text = PAGE.read_text(encoding="utf-8")
    rooms = text[text.index("## Rooms") : text.index("## Inside the rooms")]
    shown = {room: set(re.findall(r"`(\w+)`", imports)) for room, _, imports in ROOM.findall(rooms)}
    assert shown == arrows()


def test_the_page_names_only_folders_and_files_that_exist() -> None:
    text = PAGE.read_text(encoding="utf-8")
    named = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text)
    assert named
    assert [
        path
        for path in named
        if not (ROOT / path).exists() and not (ROOT / "testbench" / path).exists()
    ] == []
