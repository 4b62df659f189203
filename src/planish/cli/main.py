"""The `planish` command: its subcommands, and what errors become."""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import NoReturn

from cyclopts import App, CycloptsError
from rich.console import Console

from planish import __version__
from planish.cli import acquire, calibrate
from planish.errors import PlanishError, UsageError

DID_NOT_SETTLE = 5
INTERRUPTED = 130

app = App(
    name="planish",
    help="Flatten 3D-scanned warped documents: the page comes out flat, at its true size in millimetres.",
    version=__version__,
    version_flags=["--version"],
    help_epilogue=(
        "Exit codes: 0 done; 2 bad command line; 3 input cannot be used; 4 output cannot be written; 5 the sheet did "
        "not settle (the result is still written); 6 an optional part is not installed; 130 interrupted."
    ),
)
app.command("planish.cli.demo:demo")
app.command("planish.cli.restore:restore")
app.command("planish.cli.flatten:flatten")
app.command("planish.cli.photo:photo")
app.command(acquire.app)
app.command(calibrate.app)


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code.

    The work is done by a second thread, so that Ctrl-C is heard at once, also in the middle of a long kernel, and never
    raises an exception inside compiled code, which may not survive it.
    """
    with ThreadPoolExecutor(1) as worker:
        try:
            sys.exit(worker.submit(run, arguments).result())
        except KeyboardInterrupt:
            _leave()


def _leave() -> NoReturn:
    """End the process as it is, without waiting for the work, but with the disk and the terminal tidy."""
    from planish.io.files import drop_unfinished

    drop_unfinished()
    Console(stderr=True).show_cursor()
    os._exit(_fail(INTERRUPTED, "interrupted; nothing was half-written"))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; every failure is one line on stderr and an exit code."""
    try:
        settled = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return DID_NOT_SETTLE if settled is False else 0
    except CycloptsError as problem:
        return _fail(UsageError.exit_code, str(problem))
    except PlanishError as problem:
        return _fail(problem.exit_code, str(problem))
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted; nothing was half-written")
    except BrokenPipeError:  # the reader of our output has gone, as `planish ... | head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError:
        return _fail(3, "there is not enough memory for this scan; give --points, or a smaller photo")


def _fail(code: int, sentence: str) -> int:
    line = " ".join(sentence.split())
    Console(stderr=True, highlight=False, soft_wrap=True, markup=False).print(f"planish: {line}")
    return code
