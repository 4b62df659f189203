"""The ASGI application: the browser page, and the public HTTP API that it uses."""

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
from planish.web.card import card_pdf
from planish.web.host_check import VIEW_HEADERS, HostCheckMiddleware
from planish.web.jobs import MEDIA_TYPES, Health, JobState
from planish.web.openapi import describe_api, request_body
from planish.web.problems import HTTPProblem, media_response, problem_response, problem_responses
from planish.web.service import Service
from planish.web.zip_stream import ZipResponse

STATIC = Path(__file__).parent / "static"
_INLINE_SUFFIXES = (".jpg", ".html")
_STATUS_DETAILS = {404: "there is no such address", 405: "this address does not allow that method"}
_EVENT_STREAM = media_response("text/event-stream", "The job, whenever it changes")
_FILE_RESPONSE = media_response("*/*", "The file")
_PDF_RESPONSE = media_response("application/pdf", "The card")
_ZIP_RESPONSE = media_response("application/zip", "All files")

router = APIRouter(prefix="/api")


def application(service: Service, hosts: frozenset[str] = frozenset()) -> ASGIApp:
    """Create the application.

    Parameters
    ----------
    service : Service
        Started and stopped with the application.
    hosts : frozenset of str
        Host names to accept besides localhost and IP addresses.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        service.start()
        yield
        service.stop()

    app = FastAPI(
        title="planish", version=__version__, openapi_url=None, docs_url=None, redoc_url=None, lifespan=lifespan
    )
    app.state.service = service
    app.include_router(router)
    app.mount("/static", StaticFiles(directory=STATIC))
    app.add_api_route("/", _index_page, include_in_schema=False)
    app.add_api_route("/api/openapi.json", _openapi_document, include_in_schema=False)
    app.add_exception_handler(HTTPProblem, _handle_problem)
    app.add_exception_handler(HTTPException, _handle_problem)
    app.add_exception_handler(Exception, _handle_internal_error)
    return HostCheckMiddleware(app, hosts)


def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


ServiceDep = Annotated[Service, Depends(_service)]


@router.get("/health")
def health(service: ServiceDep) -> Health:
    """Return the state of the service and its limits."""
    return Health(
        status="stopping" if service.stopping else "ok",
        version=__version__,
        warm=service.scheduler.ready,
        jobs=service.store.counts(),
        limits=vars(service.limits),
    )


@router.post(
    "/jobs",
    status_code=201,
    responses=problem_responses(400, 403, 408, 413, 415, 422, 429, 503),
    openapi_extra={"requestBody": request_body()},
)
async def create_job(request: Request, response: Response, service: ServiceDep) -> JobState:
    """Upload a scan and queue it as a job."""
    job_state = await service.submit(request)
    response.headers["location"] = f"/api/jobs/{job_state.id}"
    return job_state


@router.get("/jobs/{id}", responses=problem_responses(404))
def get_job(id: str, service: ServiceDep) -> JobState:
    """Return the state of a job and links to its results."""
    return service.job_state(id)


@router.delete("/jobs/{id}", status_code=204, response_model=None, responses=problem_responses(403, 404))
def delete_job(id: str, service: ServiceDep) -> None:
    """Cancel a job if it runs, and delete all of its files."""
    service.get_row(id)
    service.scheduler.remove(id)


@router.get("/jobs/{id}/events", response_class=StreamingResponse, responses=_EVENT_STREAM | problem_responses(404))
def job_events(id: str, service: ServiceDep) -> StreamingResponse:
    """Stream a job until it ends, as server-sent events: the job's JSON whenever it changes."""
    service.get_row(id)
    return StreamingResponse(service.events(id), media_type="text/event-stream", headers={"x-accel-buffering": "no"})


@router.get(
    "/jobs/{id}/files/{name}",
    response_class=FileResponse,
    responses=_FILE_RESPONSE | problem_responses(404, 409, 410),
)
def job_file(id: str, name: str, service: ServiceDep) -> FileResponse:
    """Download one result file."""
    folder, names = service.results(id)
    if name not in names:
        raise HTTPProblem(404, f"this job has no such file; it has {', '.join(names)}")
    if not (folder / name).is_file():
        raise _gone(id, name)
    suffix = Path(name).suffix
    return FileResponse(
        folder / name,
        media_type=MEDIA_TYPES[suffix],
        filename=f"{service.download_name(id)}-{name}",
        content_disposition_type="inline" if suffix in _INLINE_SUFFIXES else "attachment",
        headers=VIEW_HEADERS if suffix == ".html" else None,
    )


@router.get(
    "/jobs/{id}/all.zip",
    response_class=StreamingResponse,
    responses=_ZIP_RESPONSE | problem_responses(404, 409, 410),
)
def job_archive(id: str, service: ServiceDep) -> StreamingResponse:
    """Download all result files as one zip."""
    folder, names = service.results(id)
    try:
        return ZipResponse([folder / name for name in names], f"{service.download_name(id)}.zip")
    except FileNotFoundError as problem:
        raise _gone(id, Path(problem.filename).name) from None


def _gone(id: str, name: str) -> HTTPProblem:
    logging.getLogger("planish.web").error("%s of job %s is no longer on the disk", name, id)
    return HTTPProblem(410, f"{name} is no longer on the server's disk; send the scan again")


@router.get("/card-{paper}.pdf", response_class=Response, responses=_PDF_RESPONSE | problem_responses(404))
def card(paper: str) -> Response:
    """Cards with markers of 40 mm to print at 100 %, on a4 or letter; beside a sheet they tell its size in photos."""
    return Response(card_pdf(paper), media_type="application/pdf")


def _openapi_document(request: Request) -> JSONResponse:
    return JSONResponse(describe_api(request.app))


def _index_page() -> FileResponse:
    return FileResponse(STATIC / "index.html", media_type="text/html; charset=utf-8")


async def _handle_problem(request: Request, problem: Exception) -> Response:
    if isinstance(problem, HTTPProblem):
        return problem_response(problem.status, problem.detail, problem.headers)
    assert isinstance(problem, HTTPException)
    sentence = _STATUS_DETAILS.get(problem.status_code, str(problem.detail))
    headers = {name.lower(): value for name, value in (problem.headers or {}).items()}
    methods = {method for route in router.routes if isinstance(route, Route) for method in _methods(route, request)}
    if problem.status_code == 405 and methods:
        headers["allow"] = ", ".join(sorted(methods))  # Starlette lists the methods of the first matching route only
    return problem_response(problem.status_code, sentence, headers)


def _methods(route: Route, request: Request) -> set[str]:
    return set(route.methods or ()) if route.matches(request.scope)[0] != Match.NONE else set()


async def _handle_internal_error(request: Request, problem: Exception) -> Response:
    logging.getLogger("planish.web").error("%s %s failed", request.method, request.url.path, exc_info=problem)
    return problem_response(500, "internal error; the operator of the service finds the reason in its log")
