"""OpenAPI description of the HTTP API, generated from routes and settings."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from planish.web.fields import known_fields, schema_of
from planish.web.form import FILE_FIELDS
from planish.web.problems import Problem

_DESCRIPTION = (
    "Restores flat pages from 3D scans of warped documents. Post a scan to /api/jobs, follow its events or poll the "
    "job, and download its files. Errors are problem details with one sentence (RFC 9457)."
)
_FILES = {
    "scan": "The scan's files: OBJ with MTL and image, PLY, GLB or glTF with its buffers, the files of a tifxyz folder,"
    " or one zip of them",
    "photo": "Photos, if the scan's files do not reference them",
    "camera": "The cameras of those photos (JSON)",
}


def describe_api(app: FastAPI) -> dict[str, Any]:
    """Content of /api/openapi.json."""
    document = get_openapi(title=app.title, version=app.version, description=_DESCRIPTION, routes=app.routes)
    schemas = document["components"]["schemas"]
    # Unused: FastAPI validates nothing but job ids, which are any text.
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    schemas["Problem"] = Problem.model_json_schema()
    for methods in document["paths"].values():
        for operation in methods.values():
            content = operation["responses"].get("422", {}).get("content", {})
            if "application/json" in content:
                del operation["responses"]["422"]
    return document


def request_body() -> dict[str, Any]:
    """Request body of a new job."""
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
