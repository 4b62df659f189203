"""State behind the HTTP application: job table, scheduler and event subscribers."""

from __future__ import annotations

import asyncio
import contextlib
import re
import shutil
import sqlite3
from collections.abc import AsyncIterator
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from planish.settings import ServeSettings
from planish.web.jobs import JobState, JobSubscribers, describe_job
from planish.web.problems import HTTPProblem
from planish.web.scheduler import Scheduler
from planish.web.store import Row, Store, new_id
from planish.web.upload import receive_upload

_MIN_INTERVAL, _MAX_INTERVAL = 0.1, 5.0
"""Minimum and maximum seconds between two events of a job: while it changes, and while it does not."""


class Service:
    """Accepts jobs and reports on them.

    Parameters
    ----------
    folder : Path
        Folder of the job table and of job files; created if it does not exist.
    limits : ServeSettings
    """

    def __init__(self, folder: Path, limits: ServeSettings):
        self.limits, self.jobs_folder = limits, folder / "jobs"
        self.jobs_folder.mkdir(parents=True, exist_ok=True)
        self.store, self.subscribers = Store(folder / "jobs.sqlite"), JobSubscribers()
        self.scheduler = Scheduler(self.store, self.jobs_folder, limits, self.subscribers.notify)
        self.stopping = False
        self._uploads = 0

    def start(self) -> None:
        """Start the scheduler; called inside the event loop."""
        self.subscribers.loop = asyncio.get_running_loop()
        self.scheduler.start()

    def begin_shutdown(self) -> None:
        """Refuse new jobs and end event streams; may be called from a signal handler."""
        self.stopping = True
        self.subscribers.notify_all()

    def stop(self) -> None:
        """Stop the scheduler and close the job table."""
        self.begin_shutdown()
        self.scheduler.stop()
        self.store.close()

    def get_row(self, id: str) -> Row:
        """Row of a job.

        Raises
        ------
        HTTPProblem
            404.
        """
        row = self.store.get(id)
        if row is None:
            raise HTTPProblem(404, "there is no such job; finished jobs are deleted after a while")
        return row

    def results(self, id: str) -> tuple[Path, list[str]]:
        """Folder and names of the results of a job.

        Raises
        ------
        HTTPProblem
            404, or 409 if there are no results.
        """
        row = self.get_row(id)
        if row.state == "failed":
            raise HTTPProblem(409, f"this job has no results because it failed: {row.sentence}")
        if row.state != "done":
            raise HTTPProblem(409, f"this job is {row.state}; its results are available when it is done")
        return self.scheduler.results(row), row.result["files"]

    def download_name(self, id: str) -> str:
        """How the files of a job are called when they are saved: after the scan, without suffix and blanks."""
        return re.sub(r"\s+", "-", Path(self.get_row(id).title).stem) or "planish"

    def job_state(self, id: str) -> JobState:
        """JSON model of a job."""
        return describe_job(self.get_row(id), self.scheduler)

    async def submit(self, request: Request) -> JobState:
        """Receive an upload and queue it as a job.

        Raises
        ------
        HTTPProblem
        """
        self._check_capacity()
        self._uploads += 1
        id = new_id()
        try:
            title, request_data = await receive_upload(request, self.jobs_folder / id, self.limits)
            row = await run_in_threadpool(self.store.add, id, title, request_data)
        except sqlite3.Error as problem:
            await run_in_threadpool(shutil.rmtree, self.jobs_folder / id, ignore_errors=True)
            raise HTTPProblem(503, "the job cannot be stored: the server's disk is full or failing") from problem
        finally:
            self._uploads -= 1
        self.scheduler.notify()
        return await run_in_threadpool(describe_job, row, self.scheduler)

    async def events(self, id: str) -> AsyncIterator[str]:
        """Server-sent events of a job, one per change; the stream ends with the job."""
        with self.subscribers.subscribe(id) as event:
            last_sent = ""
            while True:
                event.clear()
                row = await run_in_threadpool(self.store.get, id)
                if row is None:
                    yield "event: removed\ndata: {}\n\n"
                    return
                text = (await run_in_threadpool(describe_job, row, self.scheduler)).model_dump_json()
                yield f"data: {text}\n\n" if text != last_sent else ": keep-alive\n\n"
                last_sent = text
                if row.state in ("done", "failed") or self.stopping:
                    return
                await asyncio.sleep(_MIN_INTERVAL)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(event.wait(), _MAX_INTERVAL)

    def _check_capacity(self) -> None:
        if self.stopping:
            raise HTTPProblem(503, "the service is shutting down; try again later", {"retry-after": "60"})
        if self.store.counts()["queued"] + self._uploads >= self.limits.queue:
            raise HTTPProblem(
                429, f"the queue is full ({self.limits.queue} scans); try again later", {"retry-after": "30"}
            )
        required_mb = self.limits.upload_mb + self.limits.unpacked_mb
        if shutil.disk_usage(self.jobs_folder).free < required_mb * 1e6:
            raise HTTPProblem(503, f"the server's disk has less than the {required_mb:g} MB left that a scan may need")
