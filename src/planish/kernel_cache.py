"""Where compiled kernels are kept if neither the package nor the home folder can be written.

Numba keeps them beside the package or in the home folder, and fails where it can write to neither: on read-only disks
of clusters, and for users without a home. It reads its variable when it is imported, before any kernel is defined.
"""

from __future__ import annotations

import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"

made: Path | None = None
"""The temporary folder, if this process has made it."""


def use_writable_kernel_cache(package: Path = Path(__file__).parent) -> Path | None:
    """Have numba keep kernels in a private temporary folder if it can keep them nowhere else.

    The folder is the same for all processes of a user, so that kernels are compiled once.

    Parameters
    ----------
    package : Path
        Folder of the package.

    Returns
    -------
    Path or None
        The temporary folder; None where none is needed, or where the system has none.
    """
    global made
    if os.environ.get(VARIABLE) or os.name != "posix" or _numbas_own(package) is not None:
        return None
    try:
        name = f"planish-kernels-{os.getuid()}"
        folder = Path(tempfile.gettempdir()) / name
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
            made = folder
        if not _is_private(folder):  # of somebody else: what lies there would be run
            made = folder = Path(tempfile.mkdtemp(prefix=f"{name}-"))
    except OSError:
        return None
    os.environ[VARIABLE] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    return folder


def kernel_folder(package: Path) -> Path:
    """The folder in or below which numba keeps the kernels."""
    return Path(os.environ.get(VARIABLE) or _numbas_own(package) or package)


def _numbas_own(package: Path) -> Path | None:
    """The first of the folders that numba tries by itself which can be written to."""
    if _is_writable(package / "__pycache__"):
        return package
    return cache if _is_writable(cache := _user_cache()) else None


def _user_cache() -> Path:
    """The folder of numba's own cache in the home folder."""
    home = Path("~").expanduser()
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "numba"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "numba"


def _is_writable(folder: Path) -> bool:
    """Whether there is such a folder to write to, or it can be made."""
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    return existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)


def _is_private(folder: Path) -> bool:
    """Whether this is a folder, no link to one, of this user, that nobody else may enter."""
    status = folder.lstat()
    return folder.is_dir() and not folder.is_symlink() and status.st_uid == os.getuid() and not status.st_mode & 0o077
