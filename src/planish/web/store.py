"""Persistent job table in one SQLite file, which survives crashes of the server."""

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
"""Maximum number of starts of a job whose worker or server is killed."""

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
        Position in the order of submission.
    id : str
        Unguessable: it is the only credential for the job.
    state : {"queued", "running", "done", "failed"}
    tries : int
        Number of starts.
    created, finished : float
        Unix time in seconds.
    title : str
    request : dict
        The upload and the form fields.
    result : dict
        Result of `planish.web.restore_upload.restore_upload`.
    sentence : str
        Reason of the failure.
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
    """Table of jobs; each change is one transaction, on disk when the method returns.

    Parameters
    ----------
    path : Path
        SQLite file, created if it does not exist.

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
        """Close the file."""
        with self._lock:
            self._connection.close()

    def add(self, id: str, title: str, request: dict[str, Any]) -> Row:
        """Append a job to the queue."""
        statement = "INSERT INTO jobs (id, state, created, title, wanted) VALUES (?, 'queued', ?, ?, ?)"
        self._execute(statement, id, time(), title, json.dumps(request))
        row = self.get(id)
        assert row is not None
        return row

    def get(self, id: str) -> Row | None:
        """Row of a job, if it exists."""
        return self._fetch_one("SELECT * FROM jobs WHERE id = ?", id)

    def take(self) -> Row | None:
        """Take the first queued job, if any, and mark it as running."""
        return self._fetch_one(
            "UPDATE jobs SET state = 'running', tries = tries + 1 WHERE number = "
            "(SELECT number FROM jobs WHERE state = 'queued' ORDER BY number LIMIT 1) RETURNING *"
        )

    def finish(self, id: str, result: dict[str, Any]) -> bool:
        """Mark a running job as done; False if it was deleted meanwhile."""
        return self._finish(id, "done", json.dumps(result), "")

    def fail(self, id: str, sentence: str) -> bool:
        """Mark a running job as failed; False if it was deleted meanwhile."""
        return self._finish(id, "failed", "{}", sentence)

    def requeue(self, id: str, *, counted: bool) -> None:
        """Put a running job back into the queue; `counted`: whether its start counts as a try."""
        statement = "UPDATE jobs SET state = 'queued', tries = tries - ? WHERE id = ? AND state = 'running'"
        self._execute(statement, 0 if counted else 1, id)

    def remove(self, id: str) -> bool:
        """Delete a job; False if it does not exist."""
        return self._execute("DELETE FROM jobs WHERE id = ?", id) > 0

    def recover(self, sentence: str) -> None:
        """Requeue jobs that ran when an earlier server ended; those at the limit of tries fail with this sentence."""
        failed = "UPDATE jobs SET state = 'failed', finished = ?, sentence = ? WHERE state = 'running' AND tries >= ?"
        self._execute(failed, time(), sentence, MAX_TRIES)
        self._execute("UPDATE jobs SET state = 'queued' WHERE state = 'running'")

    def finished_before(self, moment: float) -> list[str]:
        """Ids of the jobs that ended before a time."""
        with self._lock:
            return [row[0] for row in self._connection.execute("SELECT id FROM jobs WHERE finished < ?", (moment,))]

    def all_ids(self) -> set[str]:
        """Ids of all jobs."""
        with self._lock:
            return {row[0] for row in self._connection.execute("SELECT id FROM jobs")}

    def counts(self) -> dict[State, int]:
        """Number of jobs in each state."""
        with self._lock:
            rows = dict(self._connection.execute("SELECT state, COUNT(*) FROM jobs GROUP BY state").fetchall())
        return {state: rows.get(state, 0) for state in get_args(State)}

    def queued_before(self, row: Row) -> int:
        """Number of queued jobs submitted before this one."""
        with self._lock:
            (count,) = self._connection.execute(
                "SELECT COUNT(*) FROM jobs WHERE state = 'queued' AND number < ?", (row.number,)
            ).fetchone()
        return int(count)

    def _finish(self, id: str, state: State, result: str, sentence: str) -> bool:
        ended = "UPDATE jobs SET state = ?, finished = ?, result = ?, sentence = ? WHERE id = ? AND state = 'running'"
        return self._execute(ended, state, time(), result, sentence, id) > 0

    def _execute(self, statement: str, *values: Any) -> int:
        """Execute one statement as a transaction; number of changed rows."""
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
    """Unguessable job id."""
    return secrets.token_urlsafe(16)
