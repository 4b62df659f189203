"""The server: one process that listens, until it is told to stop."""

from __future__ import annotations

import errno
import fcntl
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
from planish.web.app import application
from planish.web.service import Service

_SHUTDOWN_TIMEOUT = 5
"""Seconds for answers on their way, once the server is told to stop."""


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
        For jobs and their files; only one server may use it.
    limits : ServeSettings
    host : str
        The address to listen at.
    port : int
        0: one that is free.
    hosts : frozenset of str
        Names under which the service may be asked for, beside localhost and plain addresses.
    ready : callable
        Told the address for browsers when it listens.

    Raises
    ------
    OutputError
        If the port is in use or may not be used, or another server uses the folder.
    KeyboardInterrupt
        After a stop by Ctrl-C.
    """
    _make_private_folder(folder)
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
    """Whether only this machine can reach an address."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class _Server(uvicorn.Server):
    """Ends those who watch a job when it is told to stop, as they would hold it up."""

    def __init__(self, config: uvicorn.Config, service: Service):
        super().__init__(config)
        self.service, self.interrupted = service, False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self.interrupted = sig == signal.SIGINT
        self.force_exit = self.should_exit
        self.should_exit = True
        self.service.begin_shutdown()


def _make_private_folder(folder: Path) -> None:
    """Make the folder, for nobody else to read: scans may be of anything."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "writing there is not permitted")
    except OSError as problem:
        raise OutputError(
            f"{folder} cannot be used for jobs and results: {problem.strerror}; give another folder with --data"
        ) from None


@contextmanager
def _exclusive_lock(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the system lets go of it however this process ends."""
    descriptor = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(f"{folder} is used by another server; give another folder with --data") from None
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _listen(host: str, port: int) -> Iterator[socket.socket]:
    try:
        listener = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as problem:
        reasons = {
            errno.EADDRINUSE: f"port {port} is in use; give another with --port",
            errno.EACCES: f"port {port} may not be used by you; give one from 1024 up with --port",
            errno.EADDRNOTAVAIL: "this machine has no such address; give one that it has with --host",
        }
        reason = reasons.get(problem.errno or 0, problem.strerror or str(problem))
        raise OutputError(f"{host} cannot be listened at: {reason}") from None
    with listener:
        yield listener
