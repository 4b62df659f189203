"""Takes away what Windows has not; Python imports this at its start where this folder is on its path."""

import contextlib
import multiprocessing.context
import os
import shutil
import signal
import sys
import warnings
from pathlib import Path

import psutil  # has its own way on every system

assert psutil.LINUX
warnings.filterwarnings("ignore", message="only soft file lock is available")  # Windows has locks of its own

read_only = set()


def open_no_folder(path, flags, *more, opened=os.open, **how):
    if Path(path).is_dir():
        raise PermissionError(13, "Permission denied", os.fspath(path))
    descriptor = opened(path, flags, *more, **how)
    (read_only.discard if flags & (os.O_RDWR | os.O_WRONLY) else read_only.add)(descriptor)
    return descriptor


def flush_what_may_be_written(descriptor, flushed=os.fsync):
    if descriptor in read_only:
        raise OSError(9, "Bad file descriptor")
    flushed(descriptor)


shutil._use_fd_functions = False
os.open, os.fsync = open_no_folder, flush_what_may_be_written
for name in ("fcntl", "resource"):
    sys.modules[name] = None
for name in ("fork", "forkpty", "killpg", "setpgrp", "sched_getaffinity", "sysconf", "register_at_fork"):
    with contextlib.suppress(AttributeError):
        delattr(os, name)
for name in ("SIGHUP", "SIGKILL"):
    delattr(signal, name)
for start in ("fork", "forkserver"):
    del multiprocessing.context._concrete_contexts[start]
multiprocessing.context.DefaultContext.get_all_start_methods = lambda self: ["spawn"]
multiprocessing.get_all_start_methods = lambda: ["spawn"]
multiprocessing.context._default_context._default_context = multiprocessing.context._concrete_contexts["spawn"]
