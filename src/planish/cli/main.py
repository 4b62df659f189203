"""The `planish` command: subcommands, signals, and exit codes of errors."""

from __future__ import annotations

import errno
import io
import os
import shutil
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import NoReturn, TextIO

from cyclopts import CycloptsError
from rich.console import Console

from planish.cli import acquire, calibrate
from planish.cli.app import app
from planish.cli.batch import batch
from planish.cli.completion import install_completion
from planish.cli.demo import demo
from planish.cli.doctor import doctor
from planish.cli.flatten import flatten
from planish.cli.photo import photo
from planish.cli.restore import restore
from planish.cli.serve import serve
from planish.cli.view import view
from planish.cli.warm_up import warm_up
from planish.errors import OutputError, PlanishError, UsageError
from planish.hints import as_flag
from planish.memory import check_limits, is_out_of_memory
from planish.system import LAST_SIGNALS

NOT_GOOD = 5
"""The page was written, but its verdict is "not good"."""
NARROWEST = 40
"""Columns that help needs at least."""
INTERRUPTED, TERMINATED = 130, 143
"""128 plus the signal number, as in shells."""

app.command(install_completion)
app.command(demo)
app.command(restore)
app.command(batch)
app.command(flatten)
app.command(photo)
app.command(view)
app.command(serve)
app.command(warm_up)
app.command(doctor)
app.command(acquire.app)
app.command(calibrate.app)


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit with its exit code.

    The command runs in a second thread, so that signals (Ctrl-C, SIGTERM) are handled at once, even during a long
    kernel, and never raise an exception inside compiled code.
    """
    for number in LAST_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # ignored in background jobs and under nohup
            signal.signal(number, _leave)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may hold what a terminal cannot show
    _keep_lines_readable()
    os.environ["PLANISH_OWN_PROCESS"] = "1"  # see planish.io.suppress_stderr, which is not imported yet
    if (sys.argv[1:] if arguments is None else arguments)[:1] == ["serve"]:  # the server handles signals itself
        sys.exit(run(arguments))
    with ThreadPoolExecutor(1) as worker:
        sys.exit(worker.submit(run, arguments).result())


def _keep_lines_readable() -> None:
    """Keep help and tables from being laid out for no columns, as COLUMNS=0 asks, which never ends."""
    columns = shutil.get_terminal_size().columns
    if "COLUMNS" in os.environ or columns < NARROWEST:
        os.environ["COLUMNS"] = str(max(columns, NARROWEST))


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    """Exit without waiting for the worker thread, after removing unfinished files and restoring the terminal."""
    from planish.io.files import drop_unfinished

    drop_unfinished()
    Console(stderr=True).show_cursor()
    how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
    os._exit(_fail(128 + number, f"{how}; no incomplete files were left"))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; every error is one line on stderr and an exit code."""
    try:
        if not {"--help", "-h", "--version"} & set(sys.argv[1:] if arguments is None else arguments):
            check_limits()
        usable = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return NOT_GOOD if usable is False else 0
    except CycloptsError as problem:
        return _fail(UsageError.exit_code, str(problem))
    except PlanishError as problem:
        return _fail(problem.exit_code, problem.message(as_flag))
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted; no incomplete files were left")
    except BrokenPipeError:  # the reader closed the pipe, as in `planish ... | head`
        _print_no_more(sys.stdout)
        return 0
    except OSError as problem:  # of the standard output: errors of files have come as OutputError
        if problem.errno not in (errno.ENOSPC, errno.EIO, errno.EFBIG):
            raise
        _print_no_more(sys.stdout)
        return _fail(OutputError.exit_code, f"standard output cannot be written: {problem.strerror}")
    except Exception as problem:
        if not is_out_of_memory(problem):
            raise
        return _fail(3, "not enough memory; give a smaller mesh or photo, or close other programs")


def _print_no_more(stream: TextIO) -> None:
    """Let the rest of a standard stream lead nowhere: Python writes what it has kept when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _fail(code: int, sentence: str) -> int:
    line = " ".join(sentence.split())
    try:
        Console(stderr=True, highlight=False, soft_wrap=True, markup=False).print(f"planish: {line}")
    except OSError:  # full, or its reader has gone
        _print_no_more(sys.stderr)
    return code
