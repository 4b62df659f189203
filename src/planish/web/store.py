"""What is known of all jobs, in one SQLite file: it outlives the server, however that ends."""

from __future__ import annotations

import json
import secrets
import sqlite3
import threading
from dataclasses import dataclass, field
from pathlib import Path
from time import time
from typing import Any, Literal, get_args

State = Literal["queued", "running", "done", "failed"]

MAX_TRIES = 3
"""How often a job is begun whose process, or whose server, is ended from outside."""

_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed')),
    tries INTEGER NOT NULL DEFAULT 0,
    created REAL NOT NULL,
    finished REAL,
    title TEXT NOT NULL,
    wanted TEXT NOT NULL,
    result TEXT NOT NULL DEFAULT '{}',
    sentence TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX IF NOT EXISTS by_state ON jobs (state, number);
"""


@dataclass(frozen=True)
class Row:
    """One job.

    Attributes
    ----------
    number : int
        In the order of coming.
    id : str
        Cannot be guessed: who knows it may see the job.
    state : {"queued", "running", "done", "failed"}
    tries : int
        How often it was begun.
    created, finished : float
        Seconds since 1970.
    title : str
    request : dict
        The upload and the form's fields.
    result : dict
        What `planish.web.restore_upload` returned.
    sentence : str
        Why it failed.
    """

    number: int
    id: str
    state: State
    tries: int
    created: float
    finished: float | None
    title: str
    request: dict[str, Any] = field(default_factory=dict)
    result: dict[str, Any] = field(default_factory=dict)
    sentence: str = ""


class Store:
    """The table of jobs; each change is whole, and on the disk before anybody is told.

    Parameters
    ----------
    path : Path
        Of the file, made if there is none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = Store(Path(folder) / "jobs.sqlite")
    ...     added = store.add(new_id(), "scan.obj", {})
    ...     taken = store.take()
    ...     store.take(), store.finish(taken.id, {"settled": True}), store.get(taken.id).state
    (None, True, 'done')
    """

    def __init__(self, path: Path):
        self._lock = threading.Lock()
        self._connection = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = FULL")
        self._connection.executescript(_SCHEMA)

    def close(self) -> None:
        """Write all that waits, and let go of the file."""
        with self._lock:
            self._connection.close()

    def add(self, id: str, title: str, request: dict[str, Any]) -> Row:
        """Put a job at the end of the queue."""
        statement = "INSERT INTO jobs (id, state, created, title, wanted) VALUES (?, 'queued', ?, ?, ?)"
        self._execute(statement, id, time(), title, json.dumps(request))
        row = self.get(id)
        assert row is not None
        return row

    def get(self, id: str) -> Row | None:
        """The job of that name, if there is one."""
        return self._fetch_one("SELECT * FROM jobs WHERE id = ?", id)

    def take(self) -> Row | None:
        """Begin the job that has waited longest, if one waits."""
        return self._fetch_one(
            "UPDATE jobs SET state = 'running', tries = tries + 1 WHERE number = "
            "(SELECT number FROM jobs WHERE state = 'queued' ORDER BY number LIMIT 1) RETURNING *"
        )

    def finish(self, id: str, result: dict[str, Any]) -> bool:
        """A running job is done; False where it was removed meanwhile."""
        return self._finish(id, "done", json.dumps(result), "")

    def fail(self, id: str, sentence: str) -> bool:
        """A running job cannot be done; False where it was removed meanwhile."""
        return self._finish(id, "failed", "{}", sentence)

    def requeue(self, id: str, *, counted: bool) -> None:
        """A running job shall be begun anew; `counted`: that it was begun shall count as a try."""
        statement = "UPDATE jobs SET state = 'queued', tries = tries - ? WHERE id = ? AND state = 'running'"
        self._execute(statement, 0 if counted else 1, id)

    def remove(self, id: str) -> bool:
        """Forget a job; False where there is none of that name."""
        return self._execute("DELETE FROM jobs WHERE id = ?", id) > 0

    def recover(self, sentence: str) -> None:
        """After a start: jobs that ran when the server ended are begun anew, or have failed with this sentence."""
        failed = "UPDATE jobs SET state = 'failed', finished = ?, sentence = ? WHERE state = 'running' AND tries >= ?"
        self._execute(failed, time(), sentence, MAX_TRIES)
        self._execute("UPDATE jobs SET state = 'queued' WHERE state = 'running'")

    def finished_before(self, moment: float) -> list[str]:
        """Names of the jobs that ended before a moment."""
        with self._lock:
            return [row[0] for row in self._connection.execute("SELECT id FROM jobs WHERE finished < ?", (moment,))]

    def all_ids(self) -> set[str]:
        """Names of all jobs."""
        with self._lock:
            return {row[0] for row in self._connection.execute("SELECT id FROM jobs")}

    def counts(self) -> dict[State, int]:
        """How many jobs are in each state."""
        with self._lock:
            rows = dict(self._connection.execute("SELECT state, COUNT(*) FROM jobs GROUP BY state").fetchall())
        return {state: rows.get(state, 0) for state in get_args(State)}

    def queued_before(self, row: Row) -> int:
        """How many jobs wait that came before."""
        with self._lock:
            (count,) = self._connection.execute(
                "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND number < ?", (row.number,)
            ).fetchone()
        return int(count)

    def _finish(self, id: str, state: State, result: str, sentence: str) -> bool:
        ended = "UPDATE jobs SET state = ?, finished = ?, result = ?, sentence = ? WHERE id = ? AND state = 'running'"
        return self._execute(ended, state, time(), result, sentence, id) > 0

    def _execute(self, statement: str, *values: Any) -> int:
        """Carry out one statement, as a transaction of its own; how many rows it changed."""
        with self._lock:
            return self._connection.execute(statement, values).rowcount

    def _fetch_one(self, statement: str, *values: Any) -> Row | None:
        with self._lock:
            rows = self._connection.execute(statement, values).fetchall()
        if not rows:
            return None
        number, name, state, tries, created, finished, title, request, result, sentence = rows[0]
        return Row(
            number, name, state, tries, created, finished, title, json.loads(request), json.loads(result), sentence
        )


def new_id() -> str:
    """A name that cannot be guessed."""
    return secrets.token_urlsafe(16)
