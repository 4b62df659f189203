"""The application: the page in the browser, and the HTTP API that it uses as anybody may."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, FastAPI, Request, Response
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, JSONResponse, StreamingResponse
from starlette.routing import Match, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from planish.version import __version__
from planish.web.archive import zipped
from planish.web.guard import VIEW_HEADERS, Guard
from planish.web.jobs import MEDIA_TYPES, Health, JobState
from planish.web.openapi import describe_api, request_body
from planish.web.problems import Refusal, answer, gives, responses
from planish.web.service import Service

STATIC = Path(__file__).parent / "static"
_INLINE = (".jpg", ".html")
_SENTENCES = {404: "there is nothing at this address", 405: "this address is not for that method"}
_STREAM = gives("text/event-stream", "The job, whenever there is news of it")
_FILE = gives("*/*", "The file")
_ARCHIVE = gives("application/zip", "All files")

api = APIRouter(prefix="/api")


def application(service: Service, hosts: frozenset[str] = frozenset()) -> ASGIApp:
    """The whole application.

    Parameters
    ----------
    service : Service
        Begins to work with the application's life, and ends with it.
    hosts : frozenset of str
        Names under which it may be asked for, beside localhost and plain addresses.
    """

    @asynccontextmanager
    async def life(app: FastAPI) -> AsyncIterator[None]:
        service.start()
        yield
        service.stop()

    app = FastAPI(title="planish", version=__version__, openapi_url=None, docs_url=None, redoc_url=None, lifespan=life)
    app.state.service = service
    app.include_router(api)
    app.mount("/static", StaticFiles(directory=STATIC))
    app.add_api_route("/", _page, include_in_schema=False)
    app.add_api_route("/api/openapi.json", _description, include_in_schema=False)
    app.add_exception_handler(Refusal, _refuse)
    app.add_exception_handler(HTTPException, _refuse)
    app.add_exception_handler(Exception, _fault)
    return Guard(app, hosts)


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


Behind = Annotated[Service, Depends(_service)]


@api.get("/health")
def health(service: Behind) -> Health:
    """Tell how the service does, and what it takes."""
    return Health(
        status="stopping" if service.stopping else "ok",
        version=__version__,
        warm=service.foreman.warm,
        jobs=service.store.counts(),
        limits=vars(service.limits),
    )


@api.post(
    "/jobs",
    status_code=201,
    responses=responses(400, 403, 408, 413, 415, 422, 429, 503),
    openapi_extra={"requestBody": request_body()},
)
async def create(request: Request, response: Response, service: Behind) -> JobState:
    """Take a scan, and put it in the queue."""
    told = await service.take(request)
    response.headers["location"] = f"/api/jobs/{told.id}"
    return told


@api.get("/jobs/{id}", responses=responses(404))
def show(id: str, service: Behind) -> JobState:
    """Tell how far a job is, and where its results are."""
    return service.told(id)


@api.delete("/jobs/{id}", status_code=204, responses=responses(403, 404))
def remove(id: str, service: Behind) -> None:
    """End a job if it runs, and remove all of it."""
    service.find(id)
    service.foreman.remove(id)


@api.get("/jobs/{id}/events", response_class=StreamingResponse, responses=_STREAM | responses(404))
def events(id: str, service: Behind) -> StreamingResponse:
    """Tell of a job as long as it goes on, as server-sent events: the job's JSON whenever there is news of it."""
    service.find(id)
    return StreamingResponse(service.events(id), media_type="text/event-stream", headers={"x-accel-buffering": "no"})


@api.get("/jobs/{id}/files/{name}", response_class=FileResponse, responses=_FILE | responses(404, 409))
def file(id: str, name: str, service: Behind) -> FileResponse:
    """Give one result."""
    folder, names = service.results(id)
    if name not in names:
        raise Refusal(404, f"this job has no such file; it has {', '.join(names)}")
    suffix = Path(name).suffix
    return FileResponse(
        folder / name,
        media_type=MEDIA_TYPES[suffix],
        filename=name,
        content_disposition_type="inline" if suffix in _INLINE else "attachment",
        headers=VIEW_HEADERS if suffix == ".html" else None,
    )


@api.get("/jobs/{id}/all.zip", response_class=StreamingResponse, responses=_ARCHIVE | responses(404, 409))
def everything(id: str, service: Behind) -> StreamingResponse:
    """Give all results in one zip."""
    folder, names = service.results(id)
    headers = {"content-disposition": 'attachment; filename="planish.zip"'}
    return StreamingResponse(zipped([folder / name for name in names]), media_type="application/zip", headers=headers)


def _description(request: Request) -> JSONResponse:
    return JSONResponse(describe_api(request.app))


def _page() -> FileResponse:
    return FileResponse(STATIC / "index.html", media_type="text/html; charset=utf-8")


async def _refuse(request: Request, problem: Exception) -> Response:
    if isinstance(problem, Refusal):
        return answer(problem.status, problem.detail, problem.headers)
    assert isinstance(problem, HTTPException)
    sentence = _SENTENCES.get(problem.status_code, str(problem.detail))
    headers = {name.lower(): value for name, value in (problem.headers or {}).items()}
    methods = {method for route in api.routes if isinstance(route, Route) for method in _methods(route, request)}
    if problem.status_code == 405 and methods:
        headers["allow"] = ", ".join(sorted(methods))  # by itself, only the first route's are told
    return answer(problem.status_code, sentence, headers)


def _methods(route: Route, request: Request) -> set[str]:
    return set(route.methods or ()) if route.matches(request.scope)[0] != Match.NONE else set()


async def _fault(request: Request, problem: Exception) -> Response:
    logging.getLogger("planish.web").error("%s %s failed", request.method, request.url.path, exc_info=problem)
    return answer(500, "the service failed; whoever runs it finds the reason in its log")
