"""The JSON schema of protocol files, which gives editors completion and hints."""

from __future__ import annotations

import json
from typing import Any

from testbench.records.specs.protocol import ProtocolSpec
from testbench.records.specs.sensor import ImuParameters, list_presets

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def protocol_schema() -> dict[str, Any]:
    """The schema of a protocol file (JSON Schema, draft 2020-12)."""
    schema = ProtocolSpec.model_json_schema()
    parts = schema.pop("$defs")
    parts |= _optional_parameters()
    sensor = parts["Sensor"]["properties"]
    sensor["parameters"] |= {"$ref": "#/$defs/ImuParameters"}
    for key in ("additionalProperties", "type"):
        sensor["parameters"].pop(key, None)
    sensor["preset"] |= {"examples": list_presets()}
    schema.pop("title")
    for part in (schema, *parts.values()):
        _tidy(part)
    return {
        "$schema": DIALECT,
        "title": "testbench protocol",
        **schema,
        "$defs": dict(sorted(parts.items())),
    }


def schema_text() -> str:
    """The schema as the text of protocols/schema.json."""
    return json.dumps(protocol_schema(), indent=2, ensure_ascii=False) + "\n"


def _tidy(part: dict[str, Any]) -> None:
    """Drop what serves no editor, and refuse names that fit no pattern, as the bench does.

    That are titles which only repeat a key, and the places where docstrings wrap.
    """
    if "description" in part:
        paragraphs = part["description"].split("\n\n")
        part["description"] = "\n\n".join(" ".join(text.split()) for text in paragraphs)
    for entry in part.get("properties", {}).values():
        entry.pop("title", None)
        if "patternProperties" in entry:
            entry["additionalProperties"] = False


def _optional_parameters() -> dict[str, Any]:
    """The sensor's parameters with nothing required.

    Those given beside a preset need not be complete.
    """
    whole = ImuParameters.model_json_schema()
    parts = whole.pop("$defs") | {"ImuParameters": whole}
    for part in parts.values():
        part.pop("required", None)
    return parts
