"""No two product modules share a run of equal lines, and `tests.repeats` finds those that do."""

from __future__ import annotations

import pytest

from tests.repeats import LONGEST, code_lines, product, repeats

BODY = "".join(f"value_{i} = work({i})\n" for i in range(LONGEST))


def two(tmp_path, one: str, other: str):
    files = [tmp_path / "one.py", tmp_path / "other.py"]
    for file, text in zip(files, (one, other), strict=True):
        file.write_text(text, encoding="utf-8")
    return repeats(files)


def test_no_two_modules_repeat_one_another() -> None:
    found = repeats(product())
    assert not found, "\n".join(str(repeat) for repeat in found)


def test_a_run_of_equal_lines_is_found_with_its_places(tmp_path) -> None:
    (found,) = two(tmp_path, "a = 1\n" + BODY, BODY + "b = 2\n")
    assert found.lines == LONGEST
    assert (found.one.first, found.one.last) == (2, LONGEST + 1)
    assert (found.other.first, found.other.last) == (1, LONGEST)


def test_a_longer_run_is_told_once(tmp_path) -> None:
    (found,) = two(tmp_path, BODY + "c = 3\nd = 4\n", BODY + "c = 3\nd = 5\n")
    assert found.lines == LONGEST + 1


def test_a_shorter_run_passes(tmp_path) -> None:
    assert not two(tmp_path, BODY, BODY.replace("work(3)", "other(3)"))


@pytest.mark.parametrize(
    "between",
    ["\n", "# why\n", "import os\n", "from os import (\n    path,\n)\n", '"""What it is."""\n'],
)
def test_what_is_between_the_lines_does_not_hide_a_run(between, tmp_path) -> None:
    first, rest = BODY.split("\n", 1)
    (found,) = two(tmp_path, BODY, f"{first}\n{between}{rest}")
    assert found.lines == LONGEST


def test_white_space_and_comments_at_the_end_do_not_hide_a_run(tmp_path) -> None:
    indented = "if True:\n" + "".join(f"    {line}  # so\n" for line in BODY.splitlines())
    assert len(two(tmp_path, BODY, indented)) == 1


def test_only_code_counts() -> None:
    text = (
        '"""Module."""\n\nimport os\n\ndef f():\n    """What.\n\n    More.\n    """\n    return 1\n'
    )
    assert [line for _, line in code_lines(text)] == ["deff():", "return1"]
