"""The source keeps what `tests.house` looks at, and `tests.house` finds what breaks it."""

from __future__ import annotations

import ast
import io
import tokenize

import pytest

from tests import house

PRODUCT = house.ROOT / "testbench"
FILE = PRODUCT / "room" / "module.py"


def test_no_room_breaks_a_rule() -> None:
    found = house.findings()
    assert not found, "\n".join(map(str, found))


def test_the_script_prints_what_it_measured_whether_anything_is_broken_or_not(
    monkeypatch, capsys
) -> None:
    broken = house.Finding("columns", FILE, 3, "101 columns")
    monkeypatch.setattr(house, "measured", lambda: {"columns": "7 lines", "shapes": "2 arrays"})
    monkeypatch.setattr(house, "findings", list)
    assert house.main([])
    assert capsys.readouterr().out == "columns: 7 lines: 0 broken\nshapes: 2 arrays: 0 broken\n"
    monkeypatch.setattr(house, "findings", lambda: [broken])
    assert not house.main([])
    assert "columns: 7 lines: 1 broken {'room': 1}" in capsys.readouterr().out
    assert house.main(["another room"])


def texts(found) -> list[str]:
    return [finding.text for finding in found]


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        ("a, b, c, d, e, f, g", 0),
        ("a, b, c, d, e, f, g, h", 1),
        ("self, a, b, c, d, e, f, g", 0),
        ("a, /, b, c, d, e, f, *args, g", 1),
        ("a, b, c, d, e, f, **others", 0),
        ("a, b, c, d, e, f, *, g, h", 1),
    ],
)
def test_arguments_are_counted(arguments, found) -> None:
    tree = ast.parse(f"class A:\n    async def f({arguments}): ...\n")
    assert len(list(house.many_arguments(FILE, tree))) == found
    assert not list(house.many_arguments(house.ROOT / "testbench" / "cli" / "run.py", tree))


def test_a_circle_of_imports_is_found_however_it_is_closed() -> None:
    sources = {
        "a": "from testbench import b",
        "b": "def f():\n    import testbench.c",
        "c": "if TYPE_CHECKING:\n    from testbench.a import Name",
        "d": "from testbench.a import Name",
        "e": "from testbench.e import itself",
    }
    package = {
        house.ROOT / "testbench" / f"{name}.py": ast.parse(source)
        for name, source in sources.items()
    }
    (circle,) = house.circles(package)
    assert circle.text == "import one another: testbench.a, testbench.b, testbench.c"
    assert circle.room == "a"


def test_a_circle_of_folders_is_found_where_no_modules_import_one_another() -> None:
    sources = {
        "units": "from testbench import exceptions",
        "tables/__init__": "from testbench.room.door import all_of_it",
        "tables/read": "from testbench.room.units import metre",
        "table": "from testbench.room.tables.read import lines",
        "door": "from testbench.room.doors.inner import x",
        "doors/__init__": "from testbench.room.door import outer",
        "doors/inner": "import numpy",
    }
    room = house.ROOT / "testbench" / "room"
    package = {room / f"{name}.py": ast.parse(source) for name, source in sources.items()}
    package[house.ROOT / "testbench" / "exceptions.py"] = ast.parse("")
    (circle,) = house.circles(package)
    assert circle.text == ("folders that import one another: testbench/room, testbench/room/tables")
    assert circle.room == "room"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("def f(q: np.ndarray): ...", ["f: q has no shape"]),
        ("def f(q: 'np.ndarray | None' = None): ...", ["f: q has no shape"]),
        ("def f(q: dict[str, Sequence[NDArray]]): ...", ["f: q has no shape"]),
        ("def f(q: float, call: Callable[[np.ndarray], float]): ...", []),
        ("def _f(q: np.ndarray): ...", []),
        ("def f(q: np.ndarray):\n    '''Shape (n,).'''", ["f: q has no shape"]),
        ("def f(q: np.ndarray):\n    '''Do.\n\n    Args:\n        q: Shape (n,).\n    '''", []),
        (
            (
                "def f(q: np.ndarray):\n    '''Do.\n\n    Args:\n        q: Long,\n"
                "            shape (n,).\n\n    Returns:\n        More.\n    '''"
            ),
            [],
        ),
        ("class A:\n    def __init__(self, q: np.ndarray): ...", ["A.__init__: q has no shape"]),
        (
            (
                "class A:\n    '''A.\n\n    Args:\n        q: Shape (n,).\n    '''\n\n"
                "    def __init__(self, q: np.ndarray): ..."
            ),
            [],
        ),
        (
            (
                "class A:\n    def f(self, q: np.ndarray):\n        '''Do.\n\n        Args:\n"
                "            q: Shape (n,).\n        '''\n\n"
                "class B(A):\n    def f(self, q: np.ndarray): ...\n"
                "    def g(self, q: np.ndarray): ..."
            ),
            ["B.g: q has no shape"],
        ),
    ],
)
def test_an_array_without_a_shape_is_found(source, found) -> None:
    tree = ast.parse(source)
    assert texts(house.shapeless(FILE, tree, house.classes([tree]))) == found


@pytest.mark.parametrize(
    ("entries", "found"),
    [
        (["lower: Lower end.", "upper: Upper end."], []),
        (["lower, upper: The ends."], ["no entry of one name: 'lower, upper'"]),
        (["Both ends."], ["no entry of one name: 'Both ends.'"]),
        (["lower: The ends. upper: Too."], ["the entry of lower goes on with upper"]),
        (["lower: The ends. upper,", "    other_*: Too."], ["goes on with upper, other_*"]),
        (["lower: An end.", "upper: An end."], ["says the same of lower and upper"]),
        (["lower: As in ISO: an end.", "upper: Of (a): the other."], []),
    ],
)
def test_an_entry_that_is_not_one_is_found(entries, found) -> None:
    lines = "".join(f"        {line}\n" for line in entries)
    source = f"class A:\n    '''A.\n\n    Attributes:\n{lines}    '''\n"
    source += "    lower: float\n    upper: float"
    told = texts(house.run_on_entries(FILE, ast.parse(source)))
    assert len(told) == len(found)
    assert all(part in text for part, text in zip(found, told, strict=True))


def test_a_long_line_is_found(tmp_path) -> None:
    file = tmp_path / "module.py"
    file.write_text("x" * 100 + "\n" + "x" * 101 + "\n")
    (finding,) = house.long_lines(file)
    assert (finding.line, finding.text) == (2, "101 columns")


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("@njit(cache=True)\ndef f(x):\n    return x\n", ["f has no comment"]),
        ("@njit\ndef f(x):\n    # eq. 1\n    return x\n", []),
        ("@numba.njit\ndef f(x):\n    return x  # eq. 1\n", []),
        ("# not inside\n@njit\ndef f(x):\n    return x\n\n\n# nor here\n", ["f has no comment"]),
        ("@njit\ndef f(x):\n    return '# in a text'\n", ["f has no comment"]),
        ("def f(x):\n    return x\n", []),
    ],
)
def test_a_kernel_without_a_comment_is_found(source, found, tmp_path) -> None:
    file = tmp_path / "module.py"
    file.write_text(source)
    assert texts(house.bare_kernels(file, ast.parse(source))) == found


LONG = "def f(x):\n" + "    x += 1\n" * 50
COMPLEX = "def f(x):\n    return x\n"


@pytest.mark.parametrize(
    ("source", "complex_at", "found"),
    [
        (LONG, 0, ["f has 51 lines and no comment why"]),
        (LONG.replace("    x += 1\n", "", 1), 0, []),
        (LONG.replace("    x += 1\n", "    '''A.\n\n    B.\n    '''\n", 1), 0, []),
        (f"# One piece.\n{LONG}", 0, []),
        (f"# One piece.\n\n{LONG}", 0, ["f has 51 lines and no comment why"]),
        (f"# One piece.\n@cache\n{LONG}", 0, []),
        (LONG.replace(":\n", ":\n    # One piece.\n", 1), 0, []),
        (LONG.replace(":\n", ":\n    '''A.'''\n    # One piece.\n", 1), 0, []),
        (COMPLEX, 0, []),
        (COMPLEX, 1, ["f is complex and no comment why"]),
        (f"# One piece.\n{COMPLEX}", 2, []),
    ],
)
def test_a_long_or_complex_function_without_a_reason_is_found(
    tmp_path, source, complex_at, found
) -> None:
    file = tmp_path / "module.py"
    file.write_text(f"\n{source}")
    tree = ast.parse(file.read_text())
    assert texts(house.long_functions(file, tree, {(file, complex_at + 1)})) == found


def test_comments_are_those_of_the_tokenizer() -> None:
    source = (
        'a = "# no"  # one\n\n"""it\'s # no\n"""  # two\nb = r\'\\\'#no\'#three "\n'
        'c = "\\\\"  # \'four\n'
    )
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    expected = [(*each.start, each.string) for each in tokens if each.type == tokenize.COMMENT]
    assert list(house.comments(source)) == expected and len(expected) == 4


def test_ruff_tells_complex_functions(tmp_path) -> None:
    file = tmp_path / "module.py"
    file.write_text("x = 1\n\n\ndef f(x):\n" + "    if x:\n        x += 1\n" * 10)
    assert house.complex_functions(tmp_path) == {(file, 4)}
    file.write_text("def f(x):\n" + "    if x:\n        x += 1\n" * 9)
    assert house.complex_functions(tmp_path) == set()


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("finding('clock.unfitted', 'hand')", []),
        ("noted('it is odd')", ["a finding without a template"]),
        ("catalogue.noted('it is odd')", ["a finding without a template"]),
        ("Finding('a.b', NOTE, '', 'it is odd')", ["a finding without a template"]),
        ("finding(NOTED, text='it is odd')", ["a sentence without a code"]),
        ("finding('general.noted', text='it is odd')", ["a sentence without a code"]),
    ],
)
def test_a_finding_in_words_of_its_own_is_found(source, found) -> None:
    tree = ast.parse(source)
    assert texts(house.free_sentences(FILE, tree)) == found
    assert not list(house.free_sentences(house.WORDS / "earlier.py", tree))
