"""Strict YAML: what the words of a file mean, where its faults stand, and what is refused before it
is read.
"""

import math
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbench.exceptions import FileProblems
from testbench.records.disk.yaml_file import (
    LARGEST_FILE,
    MOST_PROBLEMS,
    load_yaml,
    parse_yaml,
    read_text,
)
from testbench.records.specs.strict import StrictModel


class Inner(StrictModel):
    size: float
    words: list[str] = []


class Outer(StrictModel):
    name: str
    inner: Inner
    flag: bool = False
    count: int = 0


def values(text, tmp_path):
    return parse_yaml(text, tmp_path / "file.yaml")[0]


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("1e-3", 0.001),
        ("1E3", 1000.0),
        ("-.5", -0.5),
        ("+3", 3),
        ("010", 10),
        ("1.", 1.0),
        (".inf", math.inf),
        ("yes", "yes"),
        ("no", "no"),
        ("on", "on"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("null", None),
        ("12:30:45", "12:30:45"),
        ("2024-01-01", "2024-01-01"),
        ("1_000", "1_000"),
        ("0x1F", "0x1F"),
        ("'1e-3'", "1e-3"),
        ("!!str 5", "5"),
        ("<<", "<<"),
    ],
)
def test_words_mean_what_yaml_1_2_says(tmp_path, word, value):
    found = values(f"key: {word}", tmp_path)["key"]
    assert found == value
    assert type(found) is type(value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_python_writes_is_read_as_that_number(number):
    assert parse_yaml(f"a: {number!r}", "file.yaml")[0] == {"a": number}


@given(st.integers(-(10**18), 10**18))
def test_every_whole_number_is_read_exactly(number):
    assert parse_yaml(f"a: {number}", "file.yaml")[0] == {"a": number}


def test_the_place_of_every_value_is_known(tmp_path):
    text = "name: a\ninner:\n  size: 1\n  words: [x,\n    y]\n"
    _, places = parse_yaml(text, tmp_path / "file.yaml")
    assert places[("name",)] == (1, 1)
    assert places[("inner", "size")] == (3, 3)
    assert places[("inner", "words", 0)] == (4, 11)
    assert places[("inner", "words", 1)] == (5, 5)


def test_a_file_is_read_with_its_text_and_can_name_the_place_of_a_later_fault(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text("name: a\ninner: {size: 2}\n")
    document = load_yaml(file, Outer)
    assert document.value == Outer(name="a", inner=Inner(size=2))
    assert document.text == file.read_text()
    assert (
        str(document.problem("too large", "inner", "size")) == f"{file}:2:9: inner.size: too large"
    )
    assert str(document.problem("missing", "inner", "words", 3)) == f"{file}:2:1: inner: missing"


def test_a_byte_order_mark_and_dos_line_ends_are_taken_as_they_come(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_bytes("\ufeffname: a\r\ninner: {size: 2}\r\n".encode())
    assert load_yaml(file, Outer).value.name == "a"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name: a\ninner: {size: x}\n", "2:9: inner.size: must be a number, not 'x'"),
        ("name: a\ninner: {size: true}\n", "2:9: inner.size: must be a number, not true"),
        ("name: a\ninner: {size: [1]}\n", "2:9: inner.size: must be a number, not [1]"),
        ("name: a\ninner: {size: .nan}\n", "2:9: inner.size: must be a finite number, not nan"),
        ("name: a\ninner: 3\n", "2:1: inner: must be a mapping (key: value), not 3"),
        ("name: a\ninner:\n", "2:1: inner: must be a mapping (key: value), not empty"),
        ("name: 1\ninner: {size: 2}\n", "1:1: name: must be text, not 1"),
        ("name: a\ninner: {size: 2, words: x}\n", "2:18: inner.words: must be a list, not 'x'"),
        (
            "name: a\ninner: {size: 2, words: {a: 1}}\n",
            "2:18: inner.words: must be a list, not a mapping with a",
        ),
        ("name: a\ninner: {size: 2}\nflag: yes\n", "3:1: flag: must be true or false, not 'yes'"),
        ("name: a\ninner: {size: 2}\ncount: 1.5\n", "3:1: count: must be a whole number, not 1.5"),
        ("name: a\ninner: {}\n", "2:1: inner: the key 'size' is missing"),
        ("name: a\ninner: {size: 2, sise: 3}\n", "2:18: inner.sise: unknown key 'sise'"),
        (
            "name: a\nname: b\ninner: {size: 2}\n",
            "2:1: the key 'name' stands twice (first in line 1)",
        ),
        (
            "name: a\ninner: {size: 2, words: [" + "x" * 100 + ", 5]}\n",
            "inner.words[1]: must be text, not 5",
        ),
        (
            "name: 7" + "0" * 15 + "\ninner: {size: '" + "x" * 100 + "'}\n",
            "not '" + "x" * 59 + "...",
        ),
        ('name: "\\ud800"\ninner: {size: 2}\n', "1:7: name: holds half of a surrogate pair"),
        ('name: a\n"\\ud800": 1\ninner: {size: 2}\n', "2:1: keys must be plain words"),
    ],
)
def test_a_fault_gives_one_sentence_with_its_place(tmp_path, text, message):
    file = tmp_path / "file.yaml"
    file.write_text(text)
    with pytest.raises(FileProblems) as caught:
        load_yaml(file, Outer)
    assert message in str(caught.value)
    assert len({problem.path for problem in caught.value.problems}) == len(caught.value.problems)


def test_every_problem_of_a_file_is_found_at_once_and_in_order(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text("extra: 1\nname: 2\ninner: {words: [3, a, 4]}\n")
    with pytest.raises(FileProblems) as caught:
        load_yaml(file, Outer)
    assert [(p.line, p.path) for p in caught.value.problems] == [
        (1, "extra"),
        (2, "name"),
        (3, "inner"),
        (3, "inner.words[0]"),
        (3, "inner.words[2]"),
    ]


def test_a_flood_of_problems_is_cut_short(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text("name: a\ninner: {size: 1}\n" + "".join(f"extra_{i}: 1\n" for i in range(200)))
    with pytest.raises(FileProblems) as caught:
        load_yaml(file, Outer)
    assert len(caught.value.problems) == MOST_PROBLEMS + 1
    assert caught.value.problems[-1].message == f"and {200 - MOST_PROBLEMS} more problems"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: *b", "aliases (*name) are not allowed"),
        ("a: &b [1]\nc: *b", "aliases (*name) are not allowed"),
        ("a: &b [*b]", "aliases (*name) are not allowed"),
        (
            "a: !!python/object/apply:os.system ['true']",
            "the tag !!python/object/apply:os.system is not allowed",
        ),
        ("a: !!python/object/new:dict {b: 1}", "the tag !!python/object/new:dict is not allowed"),
        ("a: !!set {b, c}", "the tag !!set is not allowed"),
        ("a: !!binary aGk=", "the tag !!binary is not allowed"),
        ("!!python/name:os.system : 1\na: !mine 3", "the tag !mine is not allowed"),
        ("a: !!bool perhaps", "'perhaps' is not of the type that its tag says"),
        ("a: !!float ''", "'' is not of the type that its tag says"),
        ("a: !!int 1.5", "'1.5' is not of the type that its tag says"),
        ("? {b: 1}\n: 2", "keys must be plain words"),
        ("a: 1\n\tb: 2", "a tab cannot indent; use spaces"),
        ("a: 1\n---\nb: 2", "more than one document"),
        ("a: [1", "not valid YAML: expected ',' or ']'"),
        ("a: 'b", "not valid YAML: found unexpected end of stream while scanning a quoted scalar"),
        ("a: b: c", "not valid YAML: mapping values are not allowed here"),
        ("a: \x01", "the character U+0001 is not allowed"),
        ("%YAML 3.0\n---\na: 1", "not valid YAML: found incompatible YAML document"),
    ],
)
def test_what_is_no_plain_yaml_is_refused(tmp_path, text, message):
    with pytest.raises(FileProblems) as caught:
        values(text, tmp_path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.problems[0].line is not None


def test_tags_never_run_anything(tmp_path):
    target = tmp_path / "made"
    with pytest.raises(FileProblems):
        values(
            "a: !!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path "
            f"['{target}']]",
            tmp_path,
        )
    assert not target.exists()


@pytest.mark.parametrize(
    "text",
    [
        "[" * 50_000,
        "{a: " * 50_000,
        "- " * 50_000,
        "a: " + "[" * 41 + "]" * 41,
        "[" * 500 + "]" * 500,
    ],
)
def test_deep_nesting_is_refused_quickly(tmp_path, text):
    start = time.process_time()
    with pytest.raises(FileProblems, match="nested"):
        values(text, tmp_path)
    assert time.process_time() - start < 10


def test_an_alias_bomb_is_refused_quickly(tmp_path):
    bomb = "a0: &a0 [x, x]\n" + "".join(
        f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 500)
    )
    start = time.process_time()
    with pytest.raises(FileProblems, match="aliases"):
        values(bomb, tmp_path)
    assert time.process_time() - start < 10


def test_a_file_that_is_too_large_is_not_read_to_its_end(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text("x" * LARGEST_FILE)
    assert len(read_text(file)) == LARGEST_FILE
    file.write_text("x" * (LARGEST_FILE + 1))
    with pytest.raises(FileProblems, match="larger than the 250 kB allowed"):
        read_text(file)


def test_a_device_without_end_is_refused():
    with pytest.raises(FileProblems, match="larger than"):
        load_yaml("/dev/zero", Outer)


def test_a_file_that_is_missing_or_a_folder_is_refused(tmp_path):
    with pytest.raises(
        FileProblems, match=r"none\.yaml: cannot be read: No such file or directory"
    ):
        load_yaml(tmp_path / "none.yaml", Outer)
    with pytest.raises(FileProblems, match="cannot be read: Is a directory"):
        load_yaml(tmp_path, Outer)


def test_the_line_of_a_byte_that_is_no_text_is_named(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_bytes(b"name: a\ninner:\n  size: \xff\n")
    with pytest.raises(FileProblems) as caught:
        load_yaml(file, Outer)
    assert str(caught.value) == f"{file}:3: the file is not UTF-8 text"


def test_control_characters_of_a_file_never_reach_the_terminal(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text('name: a\ninner: {size: "\\e[31mred\\n"}\n"\\e]0;title\\a\\nerror: fake": 1\n')
    with pytest.raises(FileProblems) as caught:
        load_yaml(file, Outer)
    assert all(line.isprintable() for line in str(caught.value).splitlines())
    assert len(str(caught.value).splitlines()) == 2


@settings(deadline=None, max_examples=300)
@given(
    st.text(
        alphabet=st.sampled_from(list("ab:-[]{}#&*!|>%@`'\"\\ \n\t,?~<0.e\x00\x1f\u00e9\ud800")),
        max_size=60,
    )
)
def test_any_text_is_read_or_refused(text):
    try:
        parse_yaml(text, "file.yaml")
    except FileProblems as error:
        assert str(error)  # noqa: PT017 - whether it is refused depends on the text


def test_a_text_that_is_read_again_says_what_it_says_whatever_was_done_with_it_before(tmp_path):
    text = "words: [a, b]\ninner: {size: 1.5, flag: true}\n"
    first, places = parse_yaml(text, "first.yaml")
    first["words"].append("c")
    first["inner"]["size"] = 2
    places.clear()
    again, places = parse_yaml(text, "second.yaml")
    assert again == {"words": ["a", "b"], "inner": {"size": 1.5, "flag": True}}
    assert places["inner", "size"] == (2, 9)
    for name in ("first.yaml", "second.yaml"):  # nor is a fault forgotten, or told of another file
        with pytest.raises(FileProblems, match=f"{name}:2:.*stands twice"):
            parse_yaml("a: 1\na: 2\n", name)
        with pytest.raises(FileProblems, match=f"{name}:1:"):
            parse_yaml("a: [", name)
