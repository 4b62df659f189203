"""JSON models of jobs, and notification of clients that follow a job."""

from __future__ import annotations

import asyncio
import contextlib
from collections import defaultdict
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field

from planish.types.verdict import Word
from planish.web.scheduler import Scheduler
from planish.web.store import Row, State

MEDIA_TYPES = {
    ".tif": "image/tiff",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".pdf": "application/pdf",
    ".obj": "model/obj",
    ".json": "application/json",
    ".html": "text/html; charset=utf-8",
}


class File(BaseModel):
    """One result file."""

    name: str
    bytes: int
    href: str


class Figure(BaseModel):
    """One line of the report summary."""

    what: str
    how_much: str
    usual: str = Field(default="", description="What is usual of it")


class JobState(BaseModel):
    """State of a job."""

    id: str
    title: str = Field(description="File name of the scan")
    state: State
    ahead: int = Field(description="Number of jobs queued before this one")
    preparing: bool = Field(description="Queued while the service compiles: a minute or two after its first start")
    stage: str = Field(
        description="photos, read, clean, flatten, turn, render, unshade, sharpen, binarize, measure, write, look"
    )
    share: float = Field(description="Fraction of the stage that is done, 0 to 1")
    sentence: str = Field(description="Reason of the failure")
    created: datetime
    finished: datetime | None
    expires: datetime | None = Field(description="When the results are deleted")
    settled: bool | None = Field(description="Whether the solver came to rest; see verdict")
    outcome: str
    verdict: Word | None = Field(description="How good the page is")
    reasons: list[str] = Field(description="Of a verdict other than good, the worst first")
    warnings: list[str] = Field(description="What else was noticed")
    figures: list[Figure]
    files: list[File]
    all_files: str | None = Field(description="Link to all files as one zip")


class Health(BaseModel):
    """State and limits of the service."""

    status: Literal["ok", "stopping"]
    version: str
    warm: bool = Field(description="Whether compiled kernels are loaded, so that jobs start at once")
    jobs: dict[State, int]
    limits: dict[str, int | float]


def describe_job(row: Row, scheduler: Scheduler) -> JobState:
    """Convert a job's row to its JSON model."""
    stage, share = scheduler.progress(row.id) if row.state == "running" else ("", 0.0)
    keep = scheduler.limits.keep_hours * 3600
    url, folder = f"/api/jobs/{row.id}", scheduler.results(row)
    files = [
        File(name=name, bytes=_file_size(folder / name), href=f"{url}/files/{name}")
        for name in row.result.get("files", [])
    ]
    return JobState(
        id=row.id,
        title=row.title,
        state=row.state,
        ahead=scheduler.store.queued_before(row) if row.state == "queued" else 0,
        preparing=row.state == "queued" and not scheduler.ready,
        stage=stage,
        share=share,
        sentence=row.sentence,
        created=datetime.fromtimestamp(row.created, UTC),
        finished=None if row.finished is None else datetime.fromtimestamp(row.finished, UTC),
        expires=None if row.finished is None else datetime.fromtimestamp(row.finished + keep, UTC),
        settled=row.result.get("settled"),
        outcome=row.result.get("outcome", ""),
        warnings=row.result.get("warnings", []),
        verdict=row.result.get("verdict"),
        reasons=row.result.get("reasons", []),
        figures=[
            Figure(**dict(zip(Figure.model_fields, figure, strict=False))) for figure in row.result.get("figures", [])
        ],
        files=files,
        all_files=f"{url}/all.zip" if files else None,
    )


def _file_size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:  # deleted concurrently
        return 0


class JobSubscribers:
    """Clients that follow a job; notifications may come from any thread."""

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop | None = None
        self._subscriptions: dict[str, set[asyncio.Event]] = defaultdict(set)

    def notify(self, id: str) -> None:
        """Notify the subscribers of one job."""
        if self.loop is not None:
            with contextlib.suppress(RuntimeError):  # the event loop is closed
                self.loop.call_soon_threadsafe(self._set_events, id)

    def notify_all(self) -> None:
        """Notify the subscribers of all jobs."""
        for id in list(self._subscriptions):
            self.notify(id)

    @contextlib.contextmanager
    def subscribe(self, id: str) -> Iterator[asyncio.Event]:
        """Event that is set whenever the job changes."""
        event = asyncio.Event()
        self._subscriptions[id].add(event)
        try:
            yield event
        finally:
            self._subscriptions[id].discard(event)
            if not self._subscriptions[id]:
                del self._subscriptions[id]

    def _set_events(self, id: str) -> None:
        for event in self._subscriptions.get(id, ()):
            event.set()
