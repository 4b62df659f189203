"""Who sees to it that jobs are done: one thread for each process at work, and one that clears away."""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from time import time

from planish.job.worker import DiedError, FaultError, Limits, StoppedError, apart, warm_up
from planish.settings import ServeSettings
from planish.web.fields import read_fields
from planish.web.store import TRIES, Row, Store
from planish.web.work import Order, restore_upload

_log = logging.getLogger("planish.web")

_SWEEP_SECONDS = 30.0
_PAUSE = 1.0
"""Seconds after a failure of the service itself."""
_PATIENCE = 15.0
"""Seconds for killed processes to end when the server stops."""
_SERVER_ENDED = "the server was ended in the middle of this scan, again and again; try a smaller scan"


class Foreman:
    """Takes jobs from the queue, has them done, and writes down how they ended.

    Parameters
    ----------
    store : Store
    folder : Path
        Each job has a folder in it, of its own name.
    limits : ServeSettings
    changed : callable
        Told the name of a job whenever there is news of it; called from other threads.

    Attributes
    ----------
    warm : bool
        Whether jobs begin at once; before, kernels are being loaded.
    """

    def __init__(self, store: Store, folder: Path, limits: ServeSettings, changed: Callable[[str], None]):
        self.store, self.folder, self.limits, self._changed = store, folder, limits, changed
        self.warm = False
        self._progress: dict[str, tuple[str, float]] = {}
        self._stops: dict[str, threading.Event] = {}
        self._news = threading.Condition()
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Begin the work, with what a former server left."""
        self.store.recover(_SERVER_ENDED)
        self.sweep()
        hands = [threading.Thread(target=self._work, daemon=True) for _ in range(self.limits.jobs)]
        self._threads = [*hands, threading.Thread(target=self._clear_away, daemon=True)]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Kill what runs; it is begun anew after the next start."""
        self._stopping.set()
        with self._news:
            for stop in self._stops.values():
                stop.set()
            self._news.notify_all()
        for thread in self._threads:
            thread.join(_PATIENCE if self.warm else 0.5)

    def home(self, id: str) -> Path:
        """The folder of a job."""
        return self.folder / id

    def results(self, row: Row) -> Path:
        """The folder of a job's results: one for each try, so that none meets what another left."""
        return self.home(row.id) / f"out-{row.tries}"

    def wake(self) -> None:
        """Say that there is a new job."""
        with self._news:
            self._news.notify()

    def remove(self, id: str) -> bool:
        """End a job, whatever its state, and remove all of it; False where there is none of that name."""
        with self._news:
            found = self.store.remove(id)
            stop = self._stops.get(id)
            if stop is not None:
                stop.set()  # its thread removes the folder when the process is dead
        if found and stop is None:
            self._remove_folder(id)
        self._changed(id)
        return found

    def progress(self, id: str) -> tuple[str, float]:
        """The stage of a running job, and the share of it that is done."""
        return self._progress.get(id, ("", 0.0))

    def sweep(self) -> None:
        """Remove results whose time is over, and folders that belong to no job."""
        for id in self.store.ended_before(time() - self.limits.keep_hours * 3600):
            self.remove(id)
        oldest = time() - self.limits.upload_seconds - 60  # younger ones may be uploads on their way
        known = self.store.ids()
        for path in self.folder.iterdir():
            if path.name not in known and path.name not in self._stops and path.stat().st_mtime < oldest:
                self._remove_folder(path.name)

    def _work(self) -> None:
        with contextlib.suppress(Exception):  # if it cannot be, the jobs will tell
            warm_up()
        self.warm = True
        while not self._stopping.is_set():
            try:
                self._take_one()
            except Exception:  # a disk out of order, say, that may come back
                _log.exception("a job could not be begun, or its end not be written down")
                self._stopping.wait(_PAUSE)

    def _take_one(self) -> None:
        """Wait for a job, and see it through."""
        with self._news:
            row = self.store.take()
            if row is None:
                self._news.wait()
                return
            stop = self._stops[row.id] = threading.Event()
        self._changed(row.id)
        ended = True
        try:
            ended = self._do(row, stop)
        finally:
            self._progress.pop(row.id, None)
            with self._news:
                del self._stops[row.id]
                if not ended:  # last, as another thread may begin it at once
                    self.store.put_back(row.id, counted=not self._stopping.is_set())
                gone = self.store.get(row.id) is None
            if gone:
                self._remove_folder(row.id)
            self._changed(row.id)

    def _do(self, row: Row, stop: threading.Event) -> bool:
        """Have a job done, and write down how it ended; False where it shall be begun anew."""

        def tell(stage: str, share: float) -> None:
            self._progress[row.id] = (stage, share)
            self._changed(row.id)

        most = Limits(
            seconds=self.limits.seconds,
            memory_mb=self.limits.memory_mb,
            threads=max(1, (os.cpu_count() or 1) // self.limits.jobs),
        )
        home = self.home(row.id)
        for left in home.glob("out-*"):
            shutil.rmtree(left)
        try:
            result = apart(
                restore_upload, home / "in", self.results(row), _order(row), limits=most, progress=tell, stop=stop
            )
            self.store.finish(row.id, result)
        except StoppedError:
            return False
        except DiedError as problem:
            if row.tries < TRIES:
                return False
            self.store.fail(row.id, str(problem))
        except Exception as problem:
            self.store.fail(row.id, str(problem))
            if isinstance(problem, FaultError):
                _log.error("%s\n%s", problem, problem.trace)
        shutil.rmtree(home / "in", ignore_errors=True)  # the scan itself is not kept
        return True

    def _clear_away(self) -> None:
        while not self._stopping.wait(_SWEEP_SECONDS):
            try:
                self.sweep()
            except Exception:  # a disk out of order, say, that may come back
                _log.exception("old results could not be removed")

    def _remove_folder(self, id: str) -> None:
        shutil.rmtree(self.home(id), ignore_errors=True)


def _order(row: Row) -> Order:
    told = row.wanted
    asked = read_fields(told["fields"])
    return Order(
        scan=told["scan"],
        photo=tuple(told["photo"]),
        camera=tuple(told["camera"]),
        settings=asked.settings,
        units=asked.units,
        view=asked.view,
        formats=asked.formats,
    )
