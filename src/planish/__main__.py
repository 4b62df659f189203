"""`planish`, and `python -m planish`: signals are heard before anything that takes time is imported."""

import os
import signal
import sys
from types import FrameType
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line."""
    _open_closed_streams()
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    from planish.cli.main import main as run

    run()


def _open_closed_streams() -> None:
    """Let closed standard streams lead nowhere, before another file gets their number (as after `>&-`)."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free, this one
            setattr(sys, name, os.fdopen(number, mode))


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    os.write(2, b"planish: interrupted before anything was done\n")
    os._exit(128 + number)


if __name__ == "__main__":
    main()
