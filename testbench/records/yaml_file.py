"""Read a YAML file strictly and say where every fault of it stands.

YAML 1.2 numbers (1e-3 is a number, yes is a word), no duplicate keys, no tags or aliases that could run or explode, and a map
from the path of each value to its line and column, so that a validation error can name the place.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from testbench.exceptions import FileProblems, InputError, Problem

LARGEST_FILE = 1_000_000
DEEPEST_NESTING = 40

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


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))  # decimal, as YAML 1.2 wants: 010 is ten


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)


@dataclass
class YamlDocument(Generic[Record]):
    """A validated YAML file that still knows where each value was written.

    Attributes:
        value: The record. text: The file, verbatim. file: Its path. places: (line, column) of each path, from 1.
    """

    value: Record
    text: str
    file: Path
    places: dict[Location, tuple[int, int]]

    def problem(self, message: str, *path: Any) -> FileProblems:
        """The error that says `message` of the value at `path`."""
        return FileProblems(self.file, [locate(self.places, path, message)])


def load_yaml(file: str | Path, record: type[Record]) -> YamlDocument[Record]:
    """Read and validate one YAML file.

    Raises:
        FileProblems: The file is missing, too large, not YAML, or does not fit the record; every problem at once.
    """
    file = Path(file)
    text = read_text(file)
    data, places = parse_yaml(text, file)
    if not isinstance(data, dict):
        what = "is empty" if data is None else f"holds a {_kind(data)}"
        raise FileProblems(file, [Problem(f"the file {what}; it must hold a mapping with keys such as "
                                          f"{', '.join(list(record.model_fields)[:4])}", line=1)])  # fmt: skip
    try:
        value = record.model_validate(data)
    except ValidationError as error:
        raise FileProblems(file, _problems(error, places)) from None
    return YamlDocument(value, text, file, places)


def read_text(file: Path) -> str:
    """The text of a UTF-8 file of sane size.

    Raises:
        FileProblems: The file is missing, a folder, larger than a megabyte, or not text.
    """
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise FileProblems(file, [Problem(f"the file is larger than {LARGEST_FILE} bytes; this is no such file")])
        raw = file.read_bytes()
    except OSError as error:
        raise FileProblems(file, [Problem(f"cannot be read: {error.strerror}")]) from None
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise FileProblems(file, [Problem("the file is not UTF-8 text", line=line)]) from None
    return text


def parse_yaml(text: str, file: Path) -> tuple[Any, dict[Location, tuple[int, int]]]:
    """Parse YAML text into plain values and the place of each.

    Raises:
        FileProblems: The text is not YAML, repeats a key, uses an alias or a tag, or nests too deeply.
    """
    loader = None
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        message = getattr(error, "problem", None) or getattr(error, "reason", None) or "nested too deeply"
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, None)
        raise FileProblems(file, [Problem(f"not valid YAML: {message}", "", line, column)]) from None
    if node is None:
        return None, {}
    places: dict[Location, tuple[int, int]] = {}
    problems: list[Problem] = []
    value = _construct(loader, node, (), places, problems, set())
    if problems:
        raise FileProblems(file, problems)
    return value, places


def _construct(loader, node, path: Location, places, problems: list[Problem], seen: set[int]) -> Any:
    place = (node.start_mark.line + 1, node.start_mark.column + 1)
    places.setdefault(path, place)

    def refuse(message: str) -> None:
        problems.append(Problem(message, _dotted(path), *place))

    if len(path) > DEEPEST_NESTING:
        return refuse(f"nested deeper than {DEEPEST_NESTING} levels")
    if not isinstance(node, yaml.ScalarNode):
        if id(node) in seen:
            return refuse("aliases (*name) are not allowed; write the value again")
        seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        return [_construct(loader, child, (*path, i), places, problems, seen) for i, child in enumerate(node.value)]
    if isinstance(node, yaml.MappingNode):
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key_place = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            if not isinstance(key_node, yaml.ScalarNode):
                problems.append(Problem("keys must be plain words", _dotted(path), *key_place))
                continue
            key = key_node.value
            if key in mapping:
                first = places[(*path, key)]
                problems.append(Problem(f"the key '{key}' stands twice (first in line {first[0]})", _dotted(path), *key_place))
                continue
            places[(*path, key)] = key_place
            mapping[key] = _construct(loader, value_node, (*path, key), places, problems, seen)
        return mapping
    if not node.tag.startswith("tag:yaml.org,2002:") or node.tag.rsplit(":", 1)[1] not in {
        "str",
        "int",
        "float",
        "bool",
        "null",
    }:
        return refuse(f"the tag {node.tag} is not allowed")
    try:
        return loader.construct_object(node)
    except (yaml.YAMLError, ValueError) as error:
        return refuse(f"cannot be read: {error}")


def _problems(error: ValidationError, places: dict[Location, tuple[int, int]]) -> list[Problem]:
    problems, seen = [], set()
    for fault in error.errors(include_url=False, include_context=True):
        found = locate(places, fault["loc"], _message(fault))
        if (found.message, found.line, found.path) not in seen:
            seen.add((found.message, found.line, found.path))
            problems.append(found)
    return sorted(problems, key=lambda problem: (problem.line or 0, problem.column or 0))


def locate(places: dict[Location, tuple[int, int]], path: Location, message: str) -> Problem:
    """The problem at `path`, or at the nearest part of it that stands in the file (a union adds names of its own)."""
    known: Location = ()
    for part in path:
        if (*known, part) in places:
            known = (*known, part)
    line, column = places.get(known, (1, None))
    return Problem(message, _dotted(known), line, column)


def _message(fault: Any) -> str:
    kind, message, given = fault["type"], fault["msg"], fault.get("input")
    last = fault["loc"][-1] if fault["loc"] else ""
    if kind == "extra_forbidden":
        return f"unknown key '{last}'"
    if kind == "missing":
        return f"the key '{last}' is missing"
    if kind == "value_error":
        return str(fault["ctx"]["error"])
    message = message[0].lower() + message[1:]
    message = message.replace("input should be", "must be").replace("a valid dictionary", "a mapping")
    message = message.replace("or instance of", "or").replace("a valid ", "a ")
    if isinstance(given, str | int | float | bool) or given is None:
        message += f", not {given!r}" if given is not None else ", not empty"
    return message


def _dotted(path: Location) -> str:
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else (f".{part}" if text else str(part))
    return text


def _kind(data: Any) -> str:
    return {list: "list", str: "text", int: "number", float: "number", bool: "truth value"}.get(type(data), "value")


def check_size(count: int, limit: int, what: str) -> None:
    """Refuse `count` of `what` above `limit`.

    Raises:
        InputError: The count is too large.
    """
    if count > limit:
        raise InputError(f"{count} {what} are more than the {limit} allowed")
