"""Run the HTTP server until it is told to stop."""

from __future__ import annotations

import errno
import ipaddress
import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import uvicorn

from planish.errors import OutputError
from planish.settings import ServeSettings
from planish.system import exclusive_lock, others_may_enter
from planish.web.app import application
from planish.web.service import Service

_SHUTDOWN_TIMEOUT = 5
"""Seconds to finish responses at shutdown."""
_OWN_NAMES = {"jobs", "jobs.sqlite", "jobs.sqlite-wal", "jobs.sqlite-shm", "lock"}
"""What a folder of jobs and results holds."""


def run_server(
    folder: Path,
    limits: ServeSettings,
    *,
    host: str,
    port: int,
    hosts: frozenset[str] = frozenset(),
    ready: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve until SIGTERM or Ctrl-C.

    Parameters
    ----------
    folder : Path
        Folder for jobs and their files; only one server may use it.
    limits : ServeSettings
    host : str
        Address to listen on.
    port : int
        0: any free port.
    hosts : frozenset of str
        Host names to accept besides localhost and IP addresses.
    ready : callable
        Called with the URL once the server listens.

    Raises
    ------
    OutputError
        If the port is in use or not permitted, or another server uses the folder.
    KeyboardInterrupt
        After Ctrl-C.
    """
    make_private_folder(folder)
    with _exclusive_lock(folder), _listen(host, port) as listener:
        service = Service(folder, limits)
        config = uvicorn.Config(
            application(service, hosts),
            access_log=False,
            log_level="warning",
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=_SHUTDOWN_TIMEOUT,
        )
        server = _Server(config, service)
        name = f"[{host}]" if ":" in host else host
        ready(f"http://{name}:{listener.getsockname()[1]}/")
        server.run(sockets=[listener])
    if server.interrupted:
        raise KeyboardInterrupt


def is_loopback(host: str) -> bool:
    """Whether an address is reachable from this machine only."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class _Server(uvicorn.Server):
    """Ends event streams at shutdown, which would otherwise delay it."""

    def __init__(self, config: uvicorn.Config, service: Service):
        super().__init__(config)
        self.service, self.interrupted = service, False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self.interrupted = sig == signal.SIGINT
        self.force_exit = self.should_exit
        self.should_exit = True
        self.service.begin_shutdown()


def make_private_folder(folder: Path) -> None:
    """Create the folder, or make it readable by this user only: scans may be confidential, and job ids are credentials.

    A folder in place that holds other things stays as it is.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "no write permission")
        others = sorted({path.name for path in folder.iterdir()} - _OWN_NAMES)
        if others_may_enter(folder) and not others:
            folder.chmod(0o700)
    except OSError as problem:
        raise OutputError(
            f"{folder} cannot be used for jobs and results: {problem.strerror}; give another folder with --data"
        ) from None
    if others_may_enter(folder):
        why = f"it holds other files ({others[0]})" if others else "its permissions cannot be changed"
        raise OutputError(
            f"{folder} cannot be used for jobs and results: other users may enter it, and {why}",
            "give a folder of its own with --data, or close this one with chmod 700",
        )


@contextmanager
def _exclusive_lock(folder: Path) -> Iterator[None]:
    """Lock the folder; the system releases the lock however this process ends."""
    with exclusive_lock(folder / "lock") as held:
        if not held:
            raise OutputError(f"{folder} is used by another server; give another folder with --data")
        yield


@contextmanager
def _listen(host: str, port: int) -> Iterator[socket.socket]:
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as problem:
        reasons = {
            errno.EADDRINUSE: f"port {port} is in use; give another with --port",
            errno.EACCES: f"no permission to use port {port}; give one from 1024 up with --port",
            errno.EADDRNOTAVAIL: "this machine has no such address; give another with --host",
        }
        reason = reasons.get(problem.errno or 0, problem.strerror or str(problem))
        raise OutputError(f"cannot listen on {host}: {reason}") from None
    with listener:
        yield listener
