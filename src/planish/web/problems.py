"""What the service answers when it refuses: one sentence, as JSON (RFC 9457), with the right status."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from pydantic import BaseModel
from starlette.responses import JSONResponse

Responses = dict[int | str, dict[str, Any]]

MEDIA_TYPE = "application/problem+json"


class Problem(BaseModel):
    """What went wrong."""

    title: str
    status: int
    detail: str


class HTTPProblem(Exception):
    """A request that is not carried out.

    Attributes
    ----------
    status : int
        Of HTTP.
    detail : str
        One sentence for the user.
    headers : dict
    """

    def __init__(self, status: int, detail: str, headers: dict[str, str] | None = None):
        super().__init__(detail)
        self.status, self.detail, self.headers = status, detail, headers or {}


def problem_response(status: int, detail: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """The response that tells of a problem."""
    problem = Problem(title=HTTPStatus(status).phrase, status=status, detail=detail)
    return JSONResponse(problem.model_dump(), status, headers, MEDIA_TYPE)


def problem_responses(*statuses: int) -> Responses:
    """What OpenAPI is told about them."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def media_response(media_type: str, description: str) -> Responses:
    """The same of an answer that is a file or a stream."""
    return {200: {"description": description, "content": {media_type: {}}}}
