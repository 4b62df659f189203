"""Error responses: problem details as JSON (RFC 9457)."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from pydantic import BaseModel
from starlette.responses import JSONResponse

Responses = dict[int | str, dict[str, Any]]

MEDIA_TYPE = "application/problem+json"


class Problem(BaseModel):
    """Problem details of an error response."""

    title: str
    status: int
    detail: str


class HTTPProblem(Exception):
    """An error response, as exception.

    Attributes
    ----------
    status : int
        HTTP status code.
    detail : str
        One sentence for the user.
    headers : dict
    """

    def __init__(self, status: int, detail: str, headers: dict[str, str] | None = None):
        super().__init__(detail)
        self.status, self.detail, self.headers = status, detail, headers or {}


def problem_response(status: int, detail: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """Response with problem details."""
    problem = Problem(title=HTTPStatus(status).phrase, status=status, detail=detail)
    return JSONResponse(problem.model_dump(), status, headers, MEDIA_TYPE)


def problem_responses(*statuses: int) -> Responses:
    """OpenAPI description of error responses."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def media_response(media_type: str, description: str) -> Responses:
    """OpenAPI description of a response that is a file or a stream."""
    return {200: {"description": description, "content": {media_type: {}}}}
