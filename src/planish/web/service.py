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
from planish.web.intake import take_in
from planish.web.jobs import JobState, Watchers, describe
from planish.web.problems import Refusal
from planish.web.scheduler import Foreman
from planish.web.store import Row, Store, new_id

_SHORTEST_WAIT, _LONGEST_WAIT = 0.1, 5.0
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
        self.limits, self.homes = limits, folder / "jobs"
        self.homes.mkdir(parents=True, exist_ok=True)
        self.store, self.watchers = Store(folder / "jobs.sqlite"), Watchers()
        self.foreman = Foreman(self.store, self.homes, limits, self.watchers.changed)
        self.stopping = False
        self._uploads = 0

    def start(self) -> None:
        """Begin to work; called inside the event loop."""
        self.watchers.loop = asyncio.get_running_loop()
        self.foreman.start()

    def say_stop(self) -> None:
        """Take nothing more, and let those who watch go; may be called from a signal's handler."""
        self.stopping = True
        self.watchers.wake_all()

    def stop(self) -> None:
        """End all work."""
        self.say_stop()
        self.foreman.stop()
        self.store.close()

    def find(self, id: str) -> Row:
        """The job of that name.

        Raises
        ------
        Refusal
            404.
        """
        row = self.store.get(id)
        if row is None:
            raise Refusal(404, "there is no such job; its results are removed after a while, or it never was")
        return row

    def results(self, id: str) -> tuple[Path, list[str]]:
        """The folder of a job's results, and their names.

        Raises
        ------
        Refusal
            404, or 409 while there are none.
        """
        row = self.find(id)
        if row.state == "failed":
            raise Refusal(409, f"this job has no results, as it failed: {row.sentence}")
        if row.state != "done":
            raise Refusal(409, f"this job is {row.state}; its results come when it is done")
        return self.foreman.results(row), row.result["files"]

    def told(self, id: str) -> JobState:
        """A job as it is told of."""
        return describe(self.find(id), self.foreman)

    async def take(self, request: Request) -> JobState:
        """Take a new job in.

        Raises
        ------
        Refusal
        """
        self._check_room()
        self._uploads += 1
        id = new_id()
        try:
            title, wanted = await take_in(request, self.homes / id, self.limits)
            row = await run_in_threadpool(self.store.add, id, title, wanted)
        except sqlite3.Error as problem:
            await run_in_threadpool(shutil.rmtree, self.homes / id, ignore_errors=True)
            raise Refusal(503, "the job cannot be kept: the server's disk is full or out of order") from problem
        finally:
            self._uploads -= 1
        self.foreman.wake()
        return await run_in_threadpool(describe, row, self.foreman)

    async def events(self, id: str) -> AsyncIterator[str]:
        """A job, anew whenever there is news of it, as server-sent events; ends with the job."""
        with self.watchers.watching(id) as event:
            said = ""
            while True:
                event.clear()
                row = await run_in_threadpool(self.store.get, id)
                if row is None:
                    yield "event: removed\ndata: {}\n\n"
                    return
                text = (await run_in_threadpool(describe, row, self.foreman)).model_dump_json()
                yield f"data: {text}\n\n" if text != said else ": still there\n\n"
                said = text
                if row.state in ("done", "failed") or self.stopping:
                    return
                await asyncio.sleep(_SHORTEST_WAIT)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(event.wait(), _LONGEST_WAIT)

    def _check_room(self) -> None:
        if self.stopping:
            raise Refusal(503, "the service is being stopped; come again later", {"retry-after": "60"})
        if self.store.counts()["queued"] + self._uploads >= self.limits.queue:
            raise Refusal(429, f"{self.limits.queue} scans wait already; come again later", {"retry-after": "30"})
        most_mb = self.limits.upload_mb + self.limits.unpacked_mb
        if shutil.disk_usage(self.homes).free < most_mb * 1e6:
            raise Refusal(503, f"the server's disk has less than {most_mb:g} MB left, which a scan may take")
