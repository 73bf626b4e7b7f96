"""A mapping as YAML that a person goes on with."""

from __future__ import annotations

import re
from typing import Any

import yaml

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_/^]*")
_OTHER_WORDS = {"true", "false", "null", "yes", "no", "on", "off"}


class _Writer(yaml.SafeDumper):
    """Quotes whatever could be read as something else than text, and folds nothing."""


def _quoted(writer: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    plain = _PLAIN.fullmatch(text) and text.lower() not in _OTHER_WORDS
    return writer.represent_scalar("tag:yaml.org,2002:str", text, style=None if plain else '"')


_Writer.add_representer(str, _quoted)


def mapping_yaml(mapping: dict[str, Any], seen: list[str]) -> str:
    """The text of a mapping.

    Args:
        mapping: As it is read.
        seen: What it rests on; stands above it as comments.
    """
    lines = ["# A mapping to begin with; look whether it is right. It rests on this:"]
    lines += [f"# - {' '.join(sentence.split())}" for sentence in seen]
    body = yaml.dump(
        mapping,
        Dumper=_Writer,
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=None,
        width=1_000_000,
    )
    return "\n".join(lines) + "\n" + body
