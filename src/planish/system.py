"""What differs between Linux, macOS and Windows: locks, limits, processes, signals. Nothing else asks for the system.

Every function has a second way for systems without POSIX. The tests take fcntl, resource, fork and the signals of POSIX
away and run the program with that way on Linux; on Windows itself it has not been run.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]
try:
    import resource
except ImportError:
    resource = None  # type: ignore[assignment]

OPEN_FILES_CAN_BE_LOCKED = fcntl is not None
"""Whether a file or folder that is open can be locked, renamed and removed."""

MEMORY_CAN_BE_LIMITED = resource is not None
"""Whether the system itself refuses a process more memory than its limit."""

LAST_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that end a command."""

_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)  # on Windows SIGTERM ends a process at once


_DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in "123456789¹²³")}


def is_device_name(name: str) -> bool:
    """Whether Windows takes a file of this name, in any folder and with any suffix, for a device.

    Examples
    --------
    >>> is_device_name("nul.obj"), is_device_name("COM1"), is_device_name("console.obj")
    (True, True, False)
    """
    return name.partition(".")[0].rstrip().upper() in _DEVICES


def lock_open_file(descriptor: int, *, wait: bool) -> bool:
    """Lock an open file or folder until it is closed, which the system does however the process ends.

    Returns
    -------
    bool
        False where another process holds the lock, or where there are none (some network drives).
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


@contextlib.contextmanager
def exclusive_lock(path: Path) -> Iterator[bool]:
    """Hold a lock on a file of its own, which the system releases however the process ends.

    Yields
    ------
    bool
        False where another process holds it.

    Raises
    ------
    OSError
        If the file cannot be made.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path, mode=0o600, thread_local=False)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        yield False
        return
    try:
        yield True
    finally:
        lock.release()


def others_may_enter(folder: Path) -> bool:
    """Whether the permissions of a folder let other users into it. Windows keeps those elsewhere: False."""
    return os.name == "posix" and bool(folder.stat().st_mode & 0o077)


def flush_to_disk(path: Path) -> None:
    """Bring a file that this process wrote, or the names in a folder, to the disk."""
    folder = path.is_dir()
    if folder and not OPEN_FILES_CAN_BE_LOCKED:  # Windows opens no folders, and flushes only what it may write
        return
    descriptor = os.open(path, os.O_RDONLY if OPEN_FILES_CAN_BE_LOCKED else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def is_running(pid: int) -> bool:
    """Whether there is a process of this number."""
    import psutil

    return psutil.pid_exists(pid)


def free_memory() -> float:
    """Bytes that the machine can give without swapping."""
    import psutil

    return float(psutil.virtual_memory().available)


def memory_of(pid: int) -> float:
    """Resident bytes of a process and its children; 0 when it has ended."""
    import psutil

    with contextlib.suppress(psutil.Error):
        process = psutil.Process(pid)
        return float(sum(each.memory_info().rss for each in (process, *process.children(recursive=True))))
    return 0.0


def peak_memory() -> float:
    """The most resident bytes that this process has had."""
    import psutil

    info = psutil.Process().memory_info()
    if resource is None:
        return float(getattr(info, "peak_wset", info.rss))
    unit = 1 if psutil.MACOS else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


def own_memory_limits() -> tuple[float, float]:
    """Limits of this process in bytes: of addresses (`ulimit -v`) and of data (`ulimit -d`)."""
    if resource is None:
        return float("inf"), float("inf")
    limits = (resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA))
    addresses, data = (float("inf") if limit == resource.RLIM_INFINITY else float(limit) for limit in limits)
    return addresses, data


def limit_own_memory(size: float) -> None:
    """Have the system refuse this process more than so many bytes of data, where it can (`MEMORY_CAN_BE_LIMITED`)."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (int(size), int(size)))


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def worker_context(preload: list[str]) -> ForkServerContext | SpawnContext:
    """How worker processes are started: forked from a server that has imported modules, or each anew."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(preload)
    return context


def lead_own_group() -> None:
    """Let this process not be reached by the terminal's Ctrl-C, and be killed along with its children."""
    if hasattr(os, "setpgrp"):
        os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def kill_group(pid: int) -> None:
    """Kill a process that leads its own group, and its children."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(pid, _KILL)
    else:
        import psutil

        with contextlib.suppress(psutil.Error):
            for child in psutil.Process(pid).children(recursive=True):
                with contextlib.suppress(psutil.Error):
                    child.kill()
    with contextlib.suppress(OSError):
        os.kill(pid, _KILL)
