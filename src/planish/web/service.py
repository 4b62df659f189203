"""What stands behind the application: the table of jobs, those who do them, and those who watch."""

from __future__ import annotations

import asyncio
import contextlib
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
"""Seconds between two words on a job: while there is news, and while there is none."""


class Service:
    """Takes jobs in and tells of them.

    Parameters
    ----------
    folder : Path
        For the table of jobs and their files; made if there is none.
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
        """Begin to work; called inside the event loop."""
        self.subscribers.loop = asyncio.get_running_loop()
        self.scheduler.start()

    def begin_shutdown(self) -> None:
        """Take nothing more, and let those who watch go; may be called from a signal's handler."""
        self.stopping = True
        self.subscribers.notify_all()

    def stop(self) -> None:
        """End all work."""
        self.begin_shutdown()
        self.scheduler.stop()
        self.store.close()

    def get_row(self, id: str) -> Row:
        """The job of that name.

        Raises
        ------
        HTTPProblem
            404.
        """
        row = self.store.get(id)
        if row is None:
            raise HTTPProblem(404, "there is no such job; its results are removed after a while, or it never was")
        return row

    def results(self, id: str) -> tuple[Path, list[str]]:
        """The folder of a job's results, and their names.

        Raises
        ------
        HTTPProblem
            404, or 409 while there are none.
        """
        row = self.get_row(id)
        if row.state == "failed":
            raise HTTPProblem(409, f"this job has no results, as it failed: {row.sentence}")
        if row.state != "done":
            raise HTTPProblem(409, f"this job is {row.state}; its results come when it is done")
        return self.scheduler.results(row), row.result["files"]

    def job_state(self, id: str) -> JobState:
        """A job as it is told of."""
        return describe_job(self.get_row(id), self.scheduler)

    async def submit(self, request: Request) -> JobState:
        """Take a new job in.

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
            raise HTTPProblem(503, "the job cannot be kept: the server's disk is full or out of order") from problem
        finally:
            self._uploads -= 1
        self.scheduler.notify()
        return await run_in_threadpool(describe_job, row, self.scheduler)

    async def events(self, id: str) -> AsyncIterator[str]:
        """A job, anew whenever there is news of it, as server-sent events; ends with the job."""
        with self.subscribers.subscribe(id) as event:
            last_sent = ""
            while True:
                event.clear()
                row = await run_in_threadpool(self.store.get, id)
                if row is None:
                    yield "event: removed\ndata: {}\n\n"
                    return
                text = (await run_in_threadpool(describe_job, row, self.scheduler)).model_dump_json()
                yield f"data: {text}\n\n" if text != last_sent else ": still there\n\n"
                last_sent = text
                if row.state in ("done", "failed") or self.stopping:
                    return
                await asyncio.sleep(_MIN_INTERVAL)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(event.wait(), _MAX_INTERVAL)

    def _check_capacity(self) -> None:
        if self.stopping:
            raise HTTPProblem(503, "the service is being stopped; come again later", {"retry-after": "60"})
        if self.store.counts()["queued"] + self._uploads >= self.limits.queue:
            raise HTTPProblem(429, f"{self.limits.queue} scans wait already; come again later", {"retry-after": "30"})
        required_mb = self.limits.upload_mb + self.limits.unpacked_mb
        if shutil.disk_usage(self.jobs_folder).free < required_mb * 1e6:
            raise HTTPProblem(503, f"the server's disk has less than {required_mb:g} MB left, which a scan may take")
