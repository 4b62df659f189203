"""The description of the HTTP API, from the routes and settings themselves."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from planish.web.fields import known_fields, schema_of
from planish.web.form import FILE_FIELDS
from planish.web.problems import Problem

_DESCRIPTION = (
    "Scans of warped documents go in, flat pages come out. Send a scan to /api/jobs, follow its events or ask for it "
    "now and then, and fetch its files. Problems are told in one sentence each (RFC 9457)."
)
_FILES = {
    "scan": "The scan's files: OBJ with MTL and image, PLY, GLB or glTF with its buffers, the files of a tifxyz folder,"
    " or one zip of them",
    "photo": "Photos, where the scan's files do not name them",
    "camera": "The cameras of those photos (JSON)",
}


def describe_api(app: FastAPI) -> dict[str, Any]:
    """What /api/openapi.json says."""
    description = get_openapi(title=app.title, version=app.version, description=_DESCRIPTION, routes=app.routes)
    schemas = description["components"]["schemas"]
    for name in ("HTTPValidationError", "ValidationError"):  # names of jobs are any text, so that these never come
        schemas.pop(name, None)
    schemas["Problem"] = Problem.model_json_schema()
    for methods in description["paths"].values():
        for operation in methods.values():
            content = operation["responses"].get("422", {}).get("content", {})
            if "application/json" in content:
                del operation["responses"]["422"]
    return description


def request_body() -> dict[str, Any]:
    """The form of a new job."""
    files: dict[str, dict[str, Any]] = {
        name: {"type": "array", "items": {"type": "string", "format": "binary"}, "description": _FILES[name]}
        for name in FILE_FIELDS
    }
    files["scan"]["minItems"] = 1
    settings = {field.name: schema_of(field) for field in known_fields().values()}
    schema = {
        "type": "object",
        "required": ["scan"],
        "properties": {**files, **settings},
        "additionalProperties": False,
    }
    return {"required": True, "content": {"multipart/form-data": {"schema": schema}}}
