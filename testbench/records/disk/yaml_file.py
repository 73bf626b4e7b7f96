"""Read a YAML file strictly and say where every fault of it stands.

YAML 1.2 numbers (1e-3 is a number, yes is a word), no duplicate keys, no tags or aliases that could
run or explode, and a map from the path of each value to its line and column, so that a validation
error can name the place.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError

from testbench.exceptions import FileProblems, Problem, one_line

LARGEST_FILE = 250_000
"""Bytes; the longest protocol that a person writes is a tenth of it."""
DEEPEST_NESTING = 40
MOST_PROBLEMS = 30
LONGEST_QUOTE = 60
LONGEST_REMEMBERED = 20_000
"""Characters of a file whose nodes are kept: robots and presets are read again for every session,
and parsing takes longest.
"""

Record = TypeVar("Record", bound=BaseModel)
Location = tuple[Any, ...]


class _Loader(yaml.SafeLoader):
    """SafeLoader with the YAML 1.2 core schema instead of YAML 1.1's surprises."""


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("bool", r"^(?:true|True|TRUE|false|False|FALSE)$", "tTfF"),
    ("null", r"^(?:~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    ("int", r"^[-+]?[0-9]+$", "-+0123456789"),
    ("float", r"^[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?$", "-+0123456789."),
    ("float", r"^(?:[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$", "-+."),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(_pattern), list(_first))


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | float:
    digits = loader.construct_scalar(node)
    return (
        int(digits) if len(digits) < 20 else float(digits)
    )  # decimal, as YAML 1.2 wants: 010 is ten


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)

_TAGS: dict[type[yaml.Node], set[str]] = {
    yaml.ScalarNode: {
        f"tag:yaml.org,2002:{name}" for name in ("str", "int", "float", "bool", "null")
    },
    yaml.SequenceNode: {"tag:yaml.org,2002:seq"},
    yaml.MappingNode: {"tag:yaml.org,2002:map"},
}


@dataclass
class YamlDocument(Generic[Record]):
    """A validated YAML file that still knows where each value was written.

    Attributes:
        value: The record.
        text: The file, verbatim.
        file: Its path.
        places: (line, column) of each path, from 1.
    """

    value: Record
    text: str
    file: Path
    places: dict[Location, tuple[int, int]]

    def problem(self, message: str, *path: Any) -> FileProblems:
        """The error that says `message` of the value at `path`."""
        return FileProblems(self.file, [locate(self.places, path, message)])


def load_yaml(
    file: str | Path,
    record: type[Record],
    another_kind: Callable[[dict[str, Any]], str | None] | None = None,
) -> YamlDocument[Record]:
    """Read and validate one YAML file.

    Args:
        file: Its path.
        record: What it shall be.
        another_kind: Of the content of a file that does not fit, the sentence that takes the place
            of all its faults where it is something else, or None.

    Raises:
        FileProblems: The file is missing, too large, not YAML, or does not fit the record; every
            problem at once.
    """
    file = Path(file)
    text = read_text(file)
    data, places = parse_yaml(text, file)
    if not isinstance(data, dict):
        what = "is empty" if data is None else f"holds {_kind(data)}"
        keys = ", ".join(list(record.model_fields)[:4])
        raise FileProblems(
            file,
            [Problem(f"the file {what}; it must hold a mapping with keys such as {keys}", line=1)],
        )
    try:
        value = record.model_validate(data)
    except ValidationError as error:
        told = another_kind(data) if another_kind is not None else None
        problems = (
            few(validation_problems(error, places, record=record))
            if told is None
            else [locate({}, (), told)]
        )
        raise FileProblems(file, problems) from None
    return YamlDocument(value, text, file, places)


def read_text(file: Path) -> str:
    """The text of a UTF-8 file of sane size.

    Raises:
        FileProblems: The file is missing, a folder, too large, or not text.
    """
    try:
        with file.open("rb") as stream:
            raw = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise FileProblems(file, [Problem(f"cannot be read: {error.strerror}")]) from None
    if len(raw) > LARGEST_FILE:
        raise FileProblems(
            file, [Problem(f"the file is larger than the {LARGEST_FILE // 1000} kB allowed")]
        )
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise FileProblems(file, [Problem("the file is not UTF-8 text", line=line)]) from None


def parse_yaml(text: str, file: Path) -> tuple[Any, dict[Location, tuple[int, int]]]:
    """Parse YAML text into plain values and the place of each.

    Raises:
        FileProblems: The text is not YAML, repeats a key, uses an alias or a tag, or nests too
            deeply.
    """
    try:
        node = _remembered(text) if len(text) <= LONGEST_REMEMBERED else _composed(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise FileProblems(file, [_syntax_problem(error, text)]) from None
    if node is None:
        return None, {}
    places: dict[Location, tuple[int, int]] = {}
    problems: list[Problem] = []
    value = _construct(_Loader(""), node, (), places, problems, set())
    if problems:
        raise FileProblems(file, few(problems))
    return value, places


def _composed(text: str) -> yaml.Node | None:
    """The nodes of a text; nobody changes them."""
    return _Loader(text).get_single_node()


_remembered = lru_cache(maxsize=32)(_composed)


def _syntax_problem(error: Exception, text: str) -> Problem:
    if isinstance(error, RecursionError):
        return Problem("not valid YAML: nested too deeply", line=1)
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        return Problem(
            f"not valid YAML: the character U+{error.character:04X} is not allowed", line=line
        )
    mark, said = getattr(error, "problem_mark", None), getattr(error, "problem", None) or str(error)
    context = getattr(error, "context", None) or ""
    if "'\\t'" in said:
        said = "a tab cannot indent; use spaces"
    elif "found undefined alias" in said:
        said = "aliases (*name) are not allowed; write the value out"
    elif context.startswith("expected a single document"):
        said = "the file holds more than one document (a line of ---)"
    elif context:
        said = f"{said} {context}"
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, None)
    return Problem(f"not valid YAML: {one_line(said)}", "", line, column)


# One recursion over the kinds of nodes, each of which refuses what it does not take.
def _construct(
    loader: _Loader,
    node: yaml.Node,
    path: Location,
    places: dict[Location, tuple[int, int]],
    problems: list[Problem],
    seen: set[int],
) -> Any:
    place = (node.start_mark.line + 1, node.start_mark.column + 1)
    places.setdefault(path, place)

    def refuse(message: str) -> None:
        problems.append(Problem(one_line(message), dotted(path), *place))

    if len(path) > DEEPEST_NESTING:
        return refuse(f"nested deeper than {DEEPEST_NESTING} levels")
    if isinstance(node.value, str) and not _is_unicode(node.value):
        return refuse("holds half of a surrogate pair, which is no character")
    if node.tag not in _TAGS[type(node)]:
        return refuse(f"the tag {node.tag.replace('tag:yaml.org,2002:', '!!')} is not allowed")
    if not isinstance(node, yaml.ScalarNode):
        if id(node) in seen:
            return refuse("aliases (*name) are not allowed; write the value out")
        seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        return [
            _construct(loader, child, (*path, i), places, problems, seen)
            for i, child in enumerate(node.value)
        ]
    if isinstance(node, yaml.MappingNode):
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key_place = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            if not isinstance(key_node, yaml.ScalarNode):
                problems.append(Problem("keys must be plain words", dotted(path), *key_place))
                continue
            key = key_node.value
            if not _is_unicode(key):
                problems.append(Problem("keys must be plain words", dotted(path), *key_place))
                continue
            if key in mapping:
                first = places[(*path, key)]
                message = one_line(f"the key '{key}' stands twice (first in line {first[0]})")
                problems.append(Problem(message, dotted(path), *key_place))
                continue
            places[(*path, key)] = key_place
            mapping[key] = _construct(loader, value_node, (*path, key), places, problems, seen)
        return mapping
    try:
        return loader.construct_object(node)
    except (yaml.YAMLError, ArithmeticError, LookupError, ValueError):
        return refuse(f"'{node.value}' is not of the type that its tag says")


def _is_unicode(text: str) -> bool:
    return text.isascii() or not any("\ud800" <= c <= "\udfff" for c in text)


def few(problems: list[Problem]) -> list[Problem]:
    """The first problems, and how many more there are: a wrong file shall not fill the terminal."""
    more = len(problems) - MOST_PROBLEMS
    return (
        problems if more <= 0 else [*problems[:MOST_PROBLEMS], Problem(f"and {more} more problems")]
    )


def _allowed_keys(record: type[BaseModel], path: Location) -> str:
    """What may stand where an unknown key does, the likeliest first."""
    models = [record]
    for part in path[:-1]:
        annotations = [
            model.model_fields[part].annotation for model in models if part in model.model_fields
        ]
        if annotations:
            models = [found for annotation in annotations for found in _models_in(annotation)]
    keys = sorted({key for model in models for key in model.model_fields})
    near = get_close_matches(str(path[-1]), keys, 1)
    return (f"; did you mean '{near[0]}'?" if near else "") + (
        f"; allowed: {', '.join(keys)}" if keys else ""
    )


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """The models that a type mentions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for argument in get_args(annotation) for found in _models_in(argument)]


def validation_problems(
    error: ValidationError,
    places: dict[Location, tuple[int, int]],
    *prefix: Any,
    record: type[BaseModel] | None = None,
) -> list[Problem]:
    """Each fault of a record once, in the order of the file.

    Args:
        error: What pydantic found.
        places: Of the file.
        prefix: Path of the record in the file.
        record: The model, so that an unknown key can be answered with those it has.
    """
    problems, seen = [], set()
    for fault in error.errors(include_url=False, include_context=True):
        message = fault_sentence(fault)
        if fault["type"] == "extra_forbidden" and record is not None:
            message += _allowed_keys(record, fault["loc"])
        found = locate(places, (*prefix, *fault["loc"]), message)
        if (found.message, found.line, found.path) not in seen:
            seen.add((found.message, found.line, found.path))
            problems.append(found)
    return sorted(problems, key=lambda problem: (problem.line or 0, problem.column or 0))


def locate(places: dict[Location, tuple[int, int]], path: Location, message: str) -> Problem:
    """The problem at `path`, or at the nearest part of it that stands in the file.

    A union adds names of its own.
    """
    known: Location = ()
    for part in path:
        if (*known, part) in places:
            known = (*known, part)
    line, column = places.get(known, (1, None))
    return Problem(one_line(message), dotted(known), line, column)


def fault_sentence(fault: Any) -> str:
    """One sentence for one fault that pydantic found, in the words of a person who writes YAML."""
    kind, message, given, context = (
        fault["type"],
        fault["msg"],
        fault.get("input"),
        fault.get("ctx", {}),
    )
    last = fault["loc"][-1] if fault["loc"] else ""
    if kind in {"extra_forbidden", "unexpected_keyword_argument"}:
        return f"unknown key '{last}'"
    if kind in {"missing", "missing_argument", "missing_keyword_only_argument"}:
        return f"the key '{last}' is missing"
    if kind == "value_error":
        return str(context["error"])
    if kind == "string_pattern_mismatch":
        return (
            f"must be a name (a letter, then up to 63 letters, digits and _), not {_quoted(given)}"
        )
    if kind in {"too_short", "too_long"}:
        bound, word = (
            (context["min_length"], "at least")
            if kind == "too_short"
            else (context["max_length"], "at most")
        )
        return (
            f"must have {word} {bound} {'entry' if bound == 1 else 'entries'}, not "
            f"{context['actual_length']}"
        )
    if kind in {"string_too_short", "string_too_long"}:
        bound, word = (
            (context["min_length"], "at least")
            if kind == "string_too_short"
            else (context["max_length"], "at most")
        )
        return f"must have {word} {bound} character{'s' if bound > 1 else ''}, not {len(given)}"
    if kind in {"model_type", "dict_type", "model_attributes_type", "dataclass_type"}:
        message = "must be a mapping (key: value)"
    elif kind == "float_type":
        message = "must be a number"
    elif kind == "string_type":
        message = "must be text"
    message = message[0].lower() + message[1:]
    message = (
        message.replace("input should be", "must be")
        .replace("a valid ", "a ")
        .replace("a integer", "a whole number")
        .replace("a boolean", "true or false")
    )
    return f"{message}, not {_quoted(given)}"


def _quoted(given: Any) -> str:
    """A value as its writer would know it, not too long."""
    if isinstance(given, bool) or given is None:
        return {True: "true", False: "false", None: "empty"}[given]
    if isinstance(given, dict):
        return f"a mapping with {', '.join(list(given)[:3])}" if given else "an empty mapping"
    text = repr(given)
    return text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."


def dotted(path: Location) -> str:
    """A place in a file, such as `sensors.arm.axes[2]`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else (f".{part}" if text else str(part))
    return one_line(text)


def _kind(data: Any) -> str:
    kinds = {list: "a list", str: "text", int: "a number", float: "a number", bool: "a truth value"}
    return kinds.get(type(data), "something else")
