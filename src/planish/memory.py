"""Free memory, and a refusal of work that needs more.

A process that allocates more than there is does not fail: the machine starts to swap, or the process is killed
without a message.
"""

from __future__ import annotations

import errno
import mmap
import sys
from pathlib import Path

from planish.errors import InputError
from planish.system import free_memory, own_memory_limits

_ADDRESSES = 500e6
"""Bytes of addresses that are taken without being used: threads' stacks and heaps, buffers of libraries. Where a limit
leaves fewer, OpenBLAS waits for ever for a buffer that it cannot have."""
SCARCE = 300e6
"""Bytes; with fewer, libraries cannot be loaded and threads not be started."""
_LEAST = 400e6
"""Bytes for a small page with compiled kernels; measured with `ulimit -d`."""
_REFUSED = (
    "can't start new thread",
    "Could not find/load shared object",
    "failed to map segment",
    "cannot allocate memory",
    "Cannot allocate memory",
)
_VERSION_2 = ("memory.max", "memory.current", "inactive_file")
_VERSION_1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")


def check_memory(need: float, what: str, hint: str) -> None:
    """Refuse work that needs more memory than is free.

    Parameters
    ----------
    need : float
        Bytes, beside what the process has already.
    what : str
        The work, as the subject of a sentence.
    hint : str
        What the user can do, with settings in braces.

    Raises
    ------
    InputError

    Examples
    --------
    >>> check_memory(1e15, "a page of 1 x 1 km", "lower {dpi}")
    Traceback (most recent call last):
        ...
    planish.errors.InputError: a page of 1 x 1 km needs about 1000000.0 GB of memory, and ... are free; lower dpi
    """
    free = free_bytes()
    if need > free:
        raise InputError(f"{what} needs about {_readable(need)} of memory, and {_readable(free)} are free", hint)


def check_limits() -> None:
    """Refuse to begin under a limit that leaves no room even for the libraries, which would hang or crash.

    Raises
    ------
    InputError
    """
    free = min(of_control_groups(), _of_own_limits())
    if free < SCARCE:
        raise InputError(
            f"planish needs {_readable(_LEAST)} of memory or more, and a limit (ulimit, container) leaves it "
            f"{_readable(max(0.0, free))}; raise the limit"
        )


def is_out_of_memory(problem: BaseException) -> bool:
    """Whether an exception says that memory was asked for and not given.

    By Python, numpy, the system or OpenCV; or, while little memory is free, by the loader of shared libraries or the
    start of a thread, which have no class of their own for it.
    """
    if isinstance(problem, MemoryError) or (isinstance(problem, OSError) and problem.errno == errno.ENOMEM):
        return True
    cv2 = sys.modules.get("cv2")
    if cv2 is not None and isinstance(problem, cv2.error):
        return bool(problem.code == cv2.Error.StsNoMem)
    refused = isinstance(problem, ImportError | RuntimeError | OSError) and any(
        words in str(problem) for words in _REFUSED
    )
    return refused and free_bytes() < SCARCE


def _readable(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"


def free_bytes() -> float:
    """Memory that this process may still take: of the machine, of its control groups, of its own limits."""
    return max(0.0, min(free_memory(), of_control_groups(), _of_own_limits()))


def of_control_groups(process: Path = Path("/proc/self"), mount: Path = Path("/sys/fs/cgroup")) -> float:
    """What the control groups leave that containers and schedulers put a process into, and those above them.

    Files that were read and lie in memory count as free: they are dropped when there is need.
    """
    free = float("inf")
    for line in _lines(process / "cgroup"):
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        root, names = (mount / "memory", _VERSION_1) if controllers else (mount, _VERSION_2)
        levels = Path(path.lstrip("/")).parts
        for depth in range(len(levels) + 1):
            free = min(free, _of_group(root.joinpath(*levels[:depth]), *names))
    return free


def _of_group(group: Path, limit: str, used: str, droppable: str) -> float:
    most, taken = (_lines(group / name) for name in (limit, used))
    if not most or not taken or most[0] == "max":
        return float("inf")
    files = [float(line.split()[1]) for line in _lines(group / "memory.stat") if line.startswith(f"{droppable} ")]
    return float(most[0]) - float(taken[0]) + sum(files)


def _of_own_limits() -> float:
    """What `ulimit -v` and `ulimit -d` leave."""
    statm = [float(pages) * mmap.PAGESIZE for line in _lines(Path("/proc/self/statm")) for pages in line.split()]
    if not statm:
        return float("inf")
    addresses, data = own_memory_limits()
    return min(addresses - statm[0] - _ADDRESSES, data - statm[5])


def _lines(file: Path) -> list[str]:
    """Of a file of the system; none where there is no such file."""
    try:
        return file.read_text().splitlines()
    except OSError:
        return []
