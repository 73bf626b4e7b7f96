"""Every command and snippet of README and docs is classified, exists, and does what it says; what
takes long or needs an arm is run by `tests.benchmarks.documents`.
"""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
import typer.main

from testbench.cli.app import app
from tests.documents.asked import Asked, asked_of, kind_of, run_document
from tests.documents.blocks import HOW_TO, ROOT, blocks, commands, documents, is_shell
from tests.documents.kinds import OTHER_LANGUAGES, PAGES

REFERENCE = [page for page in documents() if not page.is_relative_to(HOW_TO)]
ALL = [asked for page in REFERENCE for asked in asked_of(page)]


def test_what_becomes_of_every_command_and_snippet_is_said() -> None:
    assert [asked.place for asked in ALL if kind_of(asked) is None] == []
    assert len(ALL) > 80
    for asked in ALL:
        kind = kind_of(asked)
        assert kind is not None
        assert bool(kind.why) == (kind.how == "elsewhere"), asked.place
        assert not (asked.python and kind.how == "serves"), asked.place


def test_nothing_is_said_of_commands_that_no_document_has() -> None:
    named = {(asked.block.document, asked.text) for asked in ALL}
    idle = [
        f"{document}: {key}"
        for document, page in PAGES.items()
        for key in page.kinds
        if not any(own == document and text.startswith(key) for own, text in named)
    ]
    assert idle == []


def test_no_command_hides_in_an_indented_block() -> None:
    hidden = [
        f"{page.relative_to(ROOT)}: {line}"
        for page in documents()
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("    testbench ")
    ]
    assert hidden == []


def test_blocks_of_other_languages_are_known() -> None:
    others = {
        own.language
        for page in documents()
        for own in blocks(page)
        if not is_shell(own) and own.language != "python"
    }
    assert others == set(OTHER_LANGUAGES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [n for n in PAGES if any(kind.how == "quick" for kind in PAGES[n].kinds.values())],
)
def test_quick_commands_end_as_they_should(name: str, tmp_path) -> None:
    for ended in run_document(name, {"quick"}, tmp_path):
        assert ended.code == ended.wanted, f"{ended.place}\n{ended.said}"
        assert "Traceback" not in ended.said, ended.place


COMMANDS: Any = typer.main.get_command(app)
INLINE = re.compile(r"`(testbench [^`]+)`")


def mentioned() -> list[tuple[str, str]]:
    """Every `testbench ...` of the documents, in blocks and in sentences, with where it stands."""
    found = []
    for page in documents():
        name = page.relative_to(ROOT).as_posix()
        if name.startswith("docs/decisions/"):
            continue  # of their day
        prose = page.read_text(encoding="utf-8")
        for block in blocks(page):
            if is_shell(block):
                found += [(name, text) for text in commands(block) if "testbench " in text]
        found += [(name, text) for text in INLINE.findall(" ".join(prose.split()))]
    return found


def unknown(text: str) -> list[str]:
    """What of a command does not exist: the command, one below it, or options."""
    words = [word for word in _words(text) if word != "..."]
    command, wrong = COMMANDS, []
    for word in words[1:]:
        below = getattr(command, "commands", {})
        if word in below:
            command = below[word]
        elif below and re.fullmatch(r"[a-z-]+", word) and not word.startswith("-"):
            return [word]
    options = {name for own in command.params for name in (*own.opts, *own.secondary_opts)}
    for word in words[1:]:
        name = word.partition("=")[0]
        if re.fullmatch(r"--[a-z0-9-]+", name) and name not in options | {"--help", "--version"}:
            wrong.append(word)
    return wrong


def _words(text: str) -> list[str]:
    """From `testbench` on, to the end of that command."""
    begun = text[text.index("testbench ") :]
    try:
        words = shlex.split(begun)
    except ValueError:  # a quotation that the sentence ends
        words = begun.split()
    ends = [i for i, word in enumerate(words) if word in ("||", "&&", "|", "&") or ";" in word]
    return [word.rstrip(";,.") for word in words[: ends[0] + 1 if ends else None]]


def test_every_command_and_option_that_is_mentioned_exists() -> None:
    found = mentioned()
    assert len(found) > 150
    assert [f"{name}: {text}: {what}" for name, text in found if (what := unknown(text))] == []


def test_what_does_not_exist_is_noticed() -> None:
    assert unknown("testbench mispell quick") == ["mispell"]
    assert unknown("testbench run quick --sed 3; done") == ["--sed"]
    assert unknown("testbench emulate ur --model ur3e &") == []


def test_comments_are_no_part_of_a_command() -> None:
    (block,) = (own for own in blocks(ROOT / "docs" / "real_arm.md") if "--dot arm" in own.text)
    assert Asked(block, commands(block)[2]).text.endswith("--dot forearm=D4:22:CD:00:11:23")
