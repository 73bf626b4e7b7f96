"""What the source promises and no linter looks at: `python -m tests.house [room]` prints what it
measured and what is broken, rule by rule, and how often in each room; it fails where something is.
"""

from __future__ import annotations

import ast
import gc
import inspect
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("testbench", "tests", "examples")
COLUMNS = 100
MOST_ARGUMENTS = 7
MOST_LINES = 50
MOST_COMPLEX = 10
SECTIONS = ("Args", "Attributes", "Raises")
HEADINGS = (*SECTIONS, "Returns", "Yields", "Note", "Notes", "Example", "Examples", "References")
WORDS = ROOT / "testbench" / "records" / "findings"
ARRAYS = {"ndarray", "NDArray", "ArrayLike", "Array", "Columns"}

Function = ast.FunctionDef | ast.AsyncFunctionDef
Bases = dict[str, ast.ClassDef]


@dataclass(frozen=True)
class Finding:
    """One place where a rule is broken."""

    rule: str
    file: Path
    line: int
    text: str

    @property
    def room(self) -> str:
        """The part of the package that the file belongs to, or the folder beside the package."""
        parts = self.file.relative_to(ROOT).with_suffix("").parts
        return parts[0] if parts[0] != "testbench" else parts[1] if len(parts) > 1 else "testbench"

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line}: {self.text}"


@dataclass(frozen=True)
class Entry:
    """One entry of a section of a docstring, such as `rate: Samples a second [Hz].`"""

    section: str
    name: str
    text: str


def files(*folders: str) -> list[Path]:
    """All Python files in some folders of the repository."""
    return sorted(file for folder in folders for file in (ROOT / folder).rglob("*.py"))


def parsed(modules: Iterable[Path]) -> dict[Path, ast.Module]:
    """The trees of some modules; the collector of garbage, which would look through all of them
    over and over while they grow, has to wait.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        return {file: ast.parse(file.read_text(encoding="utf-8")) for file in modules}
    finally:
        if was_on:
            gc.enable()


@cache
def nodes(tree: ast.AST) -> list[ast.AST]:
    """What `ast.walk` gives but for contexts and operators, which hold nothing, in a third of the
    time and once for a tree; `nodes.cache_clear` lets go of the trees.
    """
    found = [tree]
    for node in found:
        for value in vars(node).values():
            if isinstance(value, list):
                found += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST) and value._fields:
                found.append(value)
    return found


QUOTED_OR_COMMENT = re.compile(
    r'''"""(?:\\.|[^\\])*?"""|\'{3}(?:\\.|[^\\])*?\'{3}'''
    r"""|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|(?P<comment>\#[^\n]*)""",
    re.DOTALL,
)


def comments(source: str) -> Iterator[tuple[int, int, str]]:
    """Line, column and text of each comment, in a tenth of the time of `tokenize`."""
    row, seen = 1, 0
    for match in QUOTED_OR_COMMENT.finditer(source):
        if match["comment"]:
            row, seen = row + source.count("\n", seen, match.start()), match.start()
            yield row, seen - source.rfind("\n", 0, seen) - 1, match["comment"]


def findings() -> list[Finding]:
    """Everything that is broken, rule by rule."""
    try:
        return _findings()
    finally:
        nodes.cache_clear()


def _findings() -> list[Finding]:
    found = [finding for file in files(*FOLDERS) for finding in long_lines(file)]
    package = parsed(files("testbench"))
    found += circles(package)
    bases = classes(package.values())
    complex_ones = complex_functions(ROOT / "testbench")
    for file, tree in package.items():
        found += many_arguments(file, tree)
        found += long_functions(file, tree, complex_ones)
        found += shapeless(file, tree, bases)
        found += run_on_entries(file, tree)
        found += bare_kernels(file, tree)
        found += free_sentences(file, tree)
    return found


def classes(trees: Iterable[ast.AST]) -> Bases:
    """All classes by name."""
    every = (node for tree in trees for node in nodes(tree))
    return {node.name: node for node in every if isinstance(node, ast.ClassDef)}


def long_lines(file: Path) -> Iterator[Finding]:
    """Lines that do not fit on the page."""
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        if len(line) > COLUMNS:
            yield Finding("columns", file, number, f"{len(line)} columns")


def many_arguments(file: Path, tree: ast.AST) -> Iterator[Finding]:
    """Functions outside of the command line with more than seven arguments."""
    if file.is_relative_to(ROOT / "testbench" / "cli"):
        return
    for node in nodes(tree):
        if isinstance(node, Function) and len(arguments(node)) > MOST_ARGUMENTS:
            text = f"{node.name} takes {len(arguments(node))} arguments"
            yield Finding("arguments", file, node.lineno, text)


def complex_functions(folder: Path) -> set[tuple[Path, int]]:
    """File and line of each function that ruff finds too complex."""
    limit = f"lint.mccabe.max-complexity={MOST_COMPLEX}"
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901"]
    command += ["--config", limit, "--output-format", "json", "--exit-zero", str(folder)]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    return {(Path(each["filename"]), each["location"]["row"]) for each in json.loads(told)}


def long_functions(
    file: Path, tree: ast.Module, complex_ones: set[tuple[Path, int]]
) -> Iterator[Finding]:
    """Long or complex functions of which no comment says why they are one piece.

    The comment stands directly above the function or its decorators, or begins its body.

    Args:
        file: The module.
        tree: The same, parsed.
        complex_ones: As `complex_functions` gives them.
    """
    lines: list[str] = []
    for node in nodes(tree):
        if not isinstance(node, Function):
            continue
        docstring = node.body[0] if ast.get_docstring(node, clean=False) is not None else None
        length = node.end_lineno - node.lineno + 1
        if docstring is not None:
            length -= docstring.end_lineno - docstring.lineno + 1
        if length > MOST_LINES:
            text = f"{node.name} has {length} lines"
        elif (file, node.lineno) in complex_ones:
            text = f"{node.name} is complex"
        else:
            continue
        lines = lines or file.read_text(encoding="utf-8").splitlines()
        above = min(each.lineno for each in [node, *node.decorator_list]) - 2
        begins = node.body[0].lineno - 2 if docstring is None else docstring.end_lineno
        if not any(lines[i].lstrip().startswith("#") for i in (above, begins)):
            yield Finding("long", file, node.lineno, f"{text} and no comment why")


def kernels(tree: ast.AST) -> Iterator[Function]:
    """Functions that numba compiles."""
    for node in nodes(tree):
        if isinstance(node, Function):
            decorators = [d.func if isinstance(d, ast.Call) else d for d in node.decorator_list]
            if any(last_name(decorator) == "njit" for decorator in decorators):
                yield node


def bare_kernels(file: Path, tree: ast.Module) -> Iterator[Finding]:
    """Compiled functions of which no line says by a comment what it computes."""
    rows: list[int] = []
    for node in kernels(tree):
        rows = rows or [0, *(row for row, _, _ in comments(file.read_text(encoding="utf-8")))]
        if not any(node.lineno < row <= node.end_lineno for row in rows):
            yield Finding("kernels", file, node.lineno, f"{node.name} has no comment")


def arguments(function: Function) -> list[ast.arg]:
    """What a caller gives: `self` and `cls` are left out, `*args` is one argument."""
    given = function.args
    own = [*given.posonlyargs, *given.args]
    if own and own[0].arg in {"self", "cls"}:
        own = own[1:]
    return [*own, *given.kwonlyargs, *(arg for arg in (given.vararg, given.kwarg) if arg)]


def circles(package: dict[Path, ast.Module]) -> Iterator[Finding]:
    """Modules, and folders, that import one another, be it by way of others, for types only or in a
    function.
    """
    modules = {module_name(file): file for file in package}
    imports = {
        name: sorted(imported(package[file], modules.keys()) - {name})
        for name, file in modules.items()
    }
    for circle in connected(imports):
        text = "import one another: " + ", ".join(circle)
        yield Finding("circles", modules[circle[0]], 1, text)
    for circle in connected(folder_imports(imports, modules)):
        text = "folders that import one another: " + ", ".join(circle)
        yield Finding("circles", ROOT / circle[0] / "__init__.py", 1, text)


def folder_imports(imports: dict[str, list[str]], modules: dict[str, Path]) -> dict[str, list[str]]:
    """From each folder to those whose modules are imported by the ones that lie in it.

    What a folder opens its door to (`__init__.py`) is no arrow of its own: doors name what is
    inside. The modules beside the rooms are what every room stands on, and no folder.

    Args:
        imports: From each module to those that it imports.
        modules: Where each lies.
    """
    found: dict[str, set[str]] = {}
    for name, others in imports.items():
        if modules[name].name == "__init__.py":
            continue
        own, top = modules[name].parent, ROOT / "testbench"
        for folder in {own, *(modules[other].parent for other in others)} - {top}:
            arrows = found.setdefault(str(folder.relative_to(ROOT)), set())
            if folder == own:
                reached = {modules[other].parent for other in others} - {own, top}
                arrows |= {str(each.relative_to(ROOT)) for each in reached}
    return {folder: sorted(arrows) for folder, arrows in found.items()}


def module_name(file: Path) -> str:
    """The dotted name of a module or, for an `__init__.py`, of its package."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(tree: ast.AST, modules: set[str]) -> set[str]:
    """The modules that any import statement of a module names."""
    found = set()
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inner if inner <= modules else inner | {node.module}
    return found & modules


def connected(arrows: dict[str, list[str]]) -> list[list[str]]:
    """Groups of more than one node in which each can be reached from each, in order of name.

    Args:
        arrows: From each node to those that it points to.
    """

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        todo = list(arrows[start])
        while todo:
            node = todo.pop()
            if node not in found:
                found.add(node)
                todo += arrows[node]
        return found

    reach = {node: reached(node) for node in arrows}
    groups = {
        tuple(sorted(other for other in reach[node] if node in reach[other]))
        for node in arrows
        if node in reach[node]
    }
    return [list(group) for group in sorted(groups)]


def shapeless(file: Path, tree: ast.Module, bases: Bases) -> Iterator[Finding]:
    """Array arguments of public functions whose entry in the docstring states no shape."""
    for name, arg, entry in array_arguments(tree, bases):
        if "shape" not in entry.lower():
            yield Finding("shapes", file, arg.lineno, f"{name}: {arg.arg} has no shape")


def array_arguments(tree: ast.Module, bases: Bases) -> Iterator[tuple[str, ast.arg, str]]:
    """Each array that a public function takes: name of the function, argument, and its entry in the
    docstring.
    """
    for owner, function in public_functions(tree.body):
        own = described(owner, function, bases)
        entries = {e.name.lstrip("*"): e.text for e in own if e.section == "Args"}
        for arg in arguments(function):
            if is_array(arg.annotation):
                name = f"{owner.name}.{function.name}" if owner else function.name
                yield name, arg, entries.get(arg.arg, "")


def public_functions(body: list[ast.stmt]) -> Iterator[tuple[ast.ClassDef | None, Function]]:
    """Functions, and methods with their classes, whose names do not begin with an underscore; the
    constructor of a public class is one of them.
    """
    for node in body:
        if isinstance(node, Function) and not node.name.startswith("_"):
            yield None, node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, Function) and (
                    inner.name == "__init__" or not inner.name.startswith("_")
                ):
                    yield node, inner


def described(owner: ast.ClassDef | None, function: Function, bases: Bases) -> list[Entry]:
    """The entries that describe a function: its own, for a constructor also those of its class,
    for a method without any those of the method that it stands in for.
    """
    entries = list(docstring_entries(function))
    if owner is None:
        return entries
    if function.name == "__init__":
        return [*entries, *docstring_entries(owner)]
    todo = [owner]
    while not entries and todo:
        above = [
            bases[name] for node in todo for name in map(last_name, node.bases) if name in bases
        ]
        methods = [m for node in above for m in node.body if isinstance(m, Function)]
        entries = [e for m in methods if m.name == function.name for e in docstring_entries(m)]
        todo = above
    return entries


def last_name(node: ast.expr) -> str:
    """`Filter` of `Filter`, `base.Filter` and `Filter[State]`."""
    match node:
        case ast.Name(name) | ast.Attribute(attr=name):
            return name
        case ast.Subscript(inner):
            return last_name(inner)
    return ""


def is_array(annotation: ast.AST | None) -> bool:
    """Whether an annotation names an array, or a collection of arrays; a callable is none."""
    match annotation:
        case None | ast.Subscript(ast.Name("Callable" | "Literal")):
            return False
        case ast.Subscript(ast.Name("Annotated"), ast.Tuple([inner, *_])):
            return is_array(inner)
        case ast.Constant(str(text)):
            return is_array(ast.parse(text, mode="eval").body)
        case ast.Name(name) | ast.Attribute(attr=name):
            return name in ARRAYS
    return any(is_array(node) for node in ast.iter_child_nodes(annotation))


def run_on_entries(file: Path, tree: ast.Module) -> Iterator[Finding]:
    """Entries of docstrings that speak of several names, hold further entries, or say the same as
    the one before.
    """
    for node in nodes(tree):
        if isinstance(node, Function | ast.ClassDef):
            names, before = own_names(node), Entry("", "", "")
            for entry in docstring_entries(node):
                text = run_on(entry, names)
                if (entry.section, entry.text) == (before.section, before.text):
                    text = f"says the same of {before.name} and {entry.name}"
                if text:
                    yield Finding("entries", file, node.lineno, f"{node.name}: {text}")
                before = entry


def run_on(entry: Entry, names: set[str]) -> str:
    """What is wrong with an entry; empty if nothing is.

    Args:
        entry: As it stands in the docstring.
        names: Arguments or attributes that have entries of their own.
    """
    if not re.fullmatch(r"\*{0,2}[\w.]+( \([^)]*\))?", entry.name):
        return f"no entry of one name: '{entry.name or entry.text[:40]}'"
    for inside in re.findall(r"[.;,] ((?:[\w*]+, )*[\w*]+): ", entry.text):
        if any(name in names or re.search(r"[_*]", name) for name in inside.split(", ")):
            return f"the entry of {entry.name} goes on with {inside}"
    return ""


def own_names(node: Function | ast.ClassDef) -> set[str]:
    """The arguments of a function, or what is assigned to in a class."""
    if isinstance(node, Function):
        return {arg.arg for arg in arguments(node)}
    return {
        child.target.id
        for child in node.body
        if isinstance(child, ast.AnnAssign) and isinstance(child.target, ast.Name)
    }


def docstring_entries(node: Function | ast.ClassDef) -> Iterator[Entry]:
    """The entries of a docstring in the style of Google; a line that begins none where one should
    is an entry without a name.
    """
    lines = inspect.cleandoc(ast.get_docstring(node, clean=False) or "").splitlines()
    section, found = "", []
    for line in [*lines, "Note:"]:
        if line.rstrip(":") in HEADINGS and line.endswith(":"):
            yield from found
            section, found = line.rstrip(":"), []
        elif section in SECTIONS and line.strip():
            if len(line) - len(line.lstrip()) <= 4:
                name, colon, text = line.strip().partition(":")
                found.append(Entry(section, *((name, text) if colon else ("", name))))
            else:
                last = found.pop() if found else Entry(section, "", "")
                found.append(Entry(section, last.name, f"{last.text} {line.strip()}"))


def free_sentences(file: Path, tree: ast.Module) -> Iterator[Finding]:
    """Findings in words of their own, where every one has the words of its code."""
    if WORDS in file.parents:
        return
    for node in nodes(tree):
        if isinstance(node, ast.Call) and last_name(node.func) in {"Finding", "noted"}:
            yield Finding("findings", file, node.lineno, "a finding without a template")
        named = isinstance(node, ast.Name) and node.id == "NOTED"
        if named or (isinstance(node, ast.Constant) and node.value == "general.noted"):
            yield Finding("findings", file, node.lineno, "a sentence without a code")


def counts(found: list[Finding]) -> dict[str, Counter[str]]:
    """How often each rule is broken in each room."""
    rules: dict[str, Counter[str]] = {}
    for finding in found:
        rules.setdefault(finding.rule, Counter())[finding.room] += 1
    return rules


def measured() -> dict[str, str]:
    """What each rule looks at, and how near the worst of it comes to its limit."""
    lines = [
        len(line)
        for file in files(*FOLDERS)
        for line in file.read_text(encoding="utf-8").splitlines()
    ]
    package = parsed(files("testbench"))
    every = {file: nodes(tree) for file, tree in package.items()}
    functions = {
        file: [node for node in some if isinstance(node, Function)] for file, some in every.items()
    }
    cli = ROOT / "testbench" / "cli"
    taken = [
        len(arguments(node))
        for file, some in functions.items()
        if not file.is_relative_to(cli)
        for node in some
    ]
    bases = classes(package.values())
    arrays = sum(1 for tree in package.values() for _ in array_arguments(tree, bases))
    documented = [
        node
        for some in every.values()
        for node in some
        if isinstance(node, Function | ast.ClassDef)
    ]
    entries = sum(1 for node in documented for _ in docstring_entries(node))
    compiled = sum(1 for tree in package.values() for _ in kernels(tree))
    nodes.cache_clear()
    words = [file for file in package if file.parent == WORDS / "templates"]
    return {
        "columns": f"{len(lines)} lines, the longest of {max(lines)} columns of {COLUMNS}",
        "arguments": f"{len(taken)} functions outside cli/, the most of {max(taken)} arguments of "
        f"{MOST_ARGUMENTS}",
        "circles": f"{len(package)} modules in {len({file.parent for file in package})} folders",
        "shapes": f"{arrays} arrays that public functions take",
        "entries": f"{entries} entries of docstrings",
        "long": f"{sum(map(len, functions.values()))} functions, of {MOST_LINES} lines and "
        f"complexity {MOST_COMPLEX} at most where no comment says why",
        "kernels": f"{compiled} compiled functions",
        "findings": f"{len(package) - len(words)} modules that have no words of their own",
    }


def main(rooms: list[str]) -> bool:
    """Print what was measured, and what is broken in some rooms or everywhere; whether nothing
    is.
    """
    found = [finding for finding in findings() if not rooms or finding.room in rooms]
    for finding in found:
        print(f"{finding.rule:9s} {finding}")
    broken = counts(found)
    for rule, text in measured().items():
        of_room = broken.get(rule, Counter())
        where = f" {dict(sorted(of_room.items()))}" if of_room else ""
        print(f"{rule}: {text}: {of_room.total()} broken{where}")
    assert set(broken) <= set(measured()), "a rule of which nobody says what it looks at"
    return not found


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))
