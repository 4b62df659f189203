"""Job scheduler: one thread per worker process, and one that deletes expired results."""

from __future__ import annotations

import contextlib
import logging
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from time import time

from planish.errors import PlanishError
from planish.job.worker import InternalError, Limits, StoppedError, WorkerDiedError, preload_workers, run_in_subprocess
from planish.settings import ServeSettings
from planish.system import usable_cores
from planish.web.fields import read_fields
from planish.web.outline import read_cut, read_outline
from planish.web.restore_upload import restore_upload
from planish.web.store import MAX_TRIES, Row, Store
from planish.web.upload_request import UploadRequest
from planish.web.wording import in_browser

_log = logging.getLogger("planish.web")

_CLEANUP_INTERVAL = 30.0
_RETRY_DELAY = 1.0
"""Seconds to wait after an error of the service itself."""
_SHUTDOWN_TIMEOUT = 15.0
"""Seconds to wait for killed processes at shutdown."""
OF_ONE_PHOTO = {"shading": "background", "sharpen": "1"}
"""Fields whose default is another one for a single photo, as it is for `planish photo`."""
_SERVER_ENDED = "the server ended repeatedly while processing this scan; try a smaller scan"


class Scheduler:
    """Runs queued jobs in worker processes and records their results.

    Parameters
    ----------
    store : Store
    folder : Path
        Parent folder of the job folders, which are named by job id.
    limits : ServeSettings
    notify : callable
        Called with the id of a job whenever it changes, from any thread.

    Attributes
    ----------
    ready : bool
        Whether compiled kernels are loaded, so that jobs start at once.
    """

    def __init__(self, store: Store, folder: Path, limits: ServeSettings, notify: Callable[[str], None]):
        self.store, self.folder, self.limits, self._notify_subscribers = store, folder, limits, notify
        self.ready = False
        self._progress: dict[str, tuple[str, float]] = {}
        self._stops: dict[str, threading.Event] = {}
        self._condition = threading.Condition()
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Recover the jobs of an earlier server, and start the threads."""
        self.store.recover(_SERVER_ENDED)
        self.clean_up()
        workers = [threading.Thread(target=self._work_loop, daemon=True) for _ in range(self.limits.jobs)]
        self._threads = [*workers, threading.Thread(target=self._clean_up_periodically, daemon=True)]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Kill running jobs; they are restarted by the next server."""
        self._stopping.set()
        with self._condition:
            for stop in self._stops.values():
                stop.set()
            self._condition.notify_all()
        for thread in self._threads:
            thread.join(_SHUTDOWN_TIMEOUT if self.ready else 0.5)

    def job_folder(self, id: str) -> Path:
        """Folder of a job."""
        return self.folder / id

    def results(self, row: Row) -> Path:
        """Folder of a job's results, one per try, so that tries do not mix."""
        return self.job_folder(row.id) / f"out-{row.tries}"

    def notify(self) -> None:
        """Wake a worker thread for a new job."""
        with self._condition:
            self._condition.notify()

    def remove(self, id: str) -> bool:
        """Cancel and delete a job in any state; False if there is no such job."""
        with self._condition:
            existed = self.store.remove(id)
            stop = self._stops.get(id)
            if stop is not None:
                stop.set()  # its thread deletes the folder when the process has ended
        if existed and stop is None:
            self._remove_folder(id)
        self._notify_subscribers(id)
        return existed

    def progress(self, id: str) -> tuple[str, float]:
        """Stage of a running job, and the fraction of the stage that is done."""
        return self._progress.get(id, ("", 0.0))

    def clean_up(self) -> None:
        """Delete expired results, and folders that belong to no job."""
        for id in self.store.finished_before(time() - self.limits.keep_hours * 3600):
            self.remove(id)
        oldest = time() - self.limits.upload_seconds - 60  # newer ones may be uploads in progress
        known_ids = self.store.all_ids()
        for path in self.folder.iterdir():
            if path.name not in known_ids and path.name not in self._stops and path.stat().st_mtime < oldest:
                self._remove_folder(path.name)

    def _work_loop(self) -> None:
        with contextlib.suppress(Exception):  # jobs will report the error
            preload_workers()
        self.ready = True
        while not self._stopping.is_set():
            try:
                self._run_next()
            except Exception:  # for example a disk error, which may be temporary
                _log.exception("a job could not be started, or its result not be recorded")
                self._stopping.wait(_RETRY_DELAY)

    def _run_next(self) -> None:
        """Wait for a job and run it."""
        with self._condition:
            row = self.store.take()
            if row is None:
                self._condition.wait()
                return
            stop = self._stops[row.id] = threading.Event()
        self._notify_subscribers(row.id)
        finished = True
        try:
            finished = self._run_job(row, stop)
        finally:
            self._progress.pop(row.id, None)
            with self._condition:
                del self._stops[row.id]
                if not finished:  # last, because another thread may take it at once
                    self.store.requeue(row.id, counted=not self._stopping.is_set())
                removed = self.store.get(row.id) is None
            if removed:
                self._remove_folder(row.id)
            self._notify_subscribers(row.id)

    def _run_job(self, row: Row, stop: threading.Event) -> bool:
        """Run a job and record its result; False if it must be requeued."""

        def progress(stage: str, share: float) -> None:
            self._progress[row.id] = (stage, share)
            self._notify_subscribers(row.id)

        limits = Limits(
            seconds=self.limits.seconds,
            memory_mb=self.limits.memory_mb,
            threads=max(1, usable_cores() // self.limits.jobs),
        )
        job_folder = self.job_folder(row.id)
        for leftover in job_folder.glob("out-*"):
            shutil.rmtree(leftover)
        try:
            result = run_in_subprocess(
                restore_upload,
                job_folder / "in",
                self.results(row),
                _upload_request(row),
                limits=limits,
                progress=progress,
                stop=stop,
            )
            self.store.finish(row.id, result)
        except StoppedError:
            return False
        except WorkerDiedError as error:
            if row.tries < MAX_TRIES:
                return False
            self.store.fail(row.id, str(error))
        except Exception as error:
            self.store.fail(row.id, in_browser(error) if isinstance(error, PlanishError) else str(error))
            if isinstance(error, InternalError):
                _log.error("%s\n%s", error, error.trace)
        shutil.rmtree(job_folder / "in", ignore_errors=True)  # uploads are not kept
        return True

    def _clean_up_periodically(self) -> None:
        while not self._stopping.wait(_CLEANUP_INTERVAL):
            try:
                self.clean_up()
            except Exception:  # for example a disk error, which may be temporary
                _log.exception("expired results could not be deleted")

    def _remove_folder(self, id: str) -> None:
        shutil.rmtree(self.job_folder(id), ignore_errors=True)


def _upload_request(row: Row) -> UploadRequest:
    data = row.request
    one_photo = not data["scan"] and len(data["photo"]) == 1
    form = read_fields({**(OF_ONE_PHOTO if one_photo else {}), **data["fields"]})
    return UploadRequest(
        scan=data["scan"],
        photo=tuple(data["photo"]),
        camera=tuple(data["camera"]),
        size=form.size,
        settings=form.settings,
        units=form.units,
        view=form.view,
        formats=form.formats,
        outline=read_outline(form.outline),
        cut=read_cut(form.cut),
        points_only=form.points_only,
    )
