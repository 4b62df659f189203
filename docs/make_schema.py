"""Write docs/report.schema.json, the JSON schema of the report, from its dataclasses: python docs/make_schema.py."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from docstring_parser import parse
from pydantic import TypeAdapter

from planish import settings, types
from planish.types.verdict import Word

DRAFT = "https://json-schema.org/draft/2020-12/schema"
PLACE = "https://planish.readthedocs.io/report.schema.json"


def texts() -> dict[str, str]:
    """The schema as it should be, by file name."""
    made = TypeAdapter(types.Report).json_schema(mode="serialization")
    definitions = made.pop("$defs")
    del definitions["Diagnostic"]  # `Report.to_dict` writes sentences and codes
    made["properties"]["verdict"] = {"enum": list(get_args(Word))}
    for name in ("reasons", "reason_codes", "warnings", "warning_codes"):
        made["properties"][name] = {"type": "array", "items": {"type": "string"}}
    for name, definition in [("Report", made), *definitions.items()]:
        definition["required"] = list(definition["properties"])  # a written report has every key
        _describe(definition, getattr(types, name, None) or getattr(settings, name))
    for part in _parts([made, definitions]):
        for noise in ("title", "default"):
            if not isinstance(part.get(noise), dict):
                part.pop(noise, None)
        if part.get("type") == "number":  # a number that is not finite is written as null
            part["type"] = ["number", "null"]
        match part:
            case {"anyOf": [{"type": kind, **rest}, {"type": "null"}]} if not rest:
                del part["anyOf"]
                part["type"] = [kind, "null"]
    schema = {"$schema": DRAFT, "$id": PLACE, **made, "title": "The report of planish", "$defs": definitions}
    return {"report.schema.json": json.dumps(schema, indent=2, ensure_ascii=False) + "\n"}


def _describe(definition: dict[str, Any], value: type) -> None:
    """Take the sentences of a class's docstring over into its definition."""
    said = parse(value.__doc__ or "")
    definition["description"] = said.short_description
    for attribute in said.params:
        for name in attribute.arg_name.split(", "):
            if attribute.description:
                definition["properties"][name]["description"] = attribute.description


def _parts(value: Any) -> Iterator[dict[str, Any]]:
    """Every object in a schema."""
    if isinstance(value, dict):
        yield value
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from _parts(item)


if __name__ == "__main__":
    for name, text in texts().items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
