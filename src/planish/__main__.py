"""`planish`, and `python -m planish`: signals are heard before anything that takes time is imported."""

import os
import signal
from types import FrameType
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    from planish.cli.main import main as run

    run()


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    os.write(2, b"planish: interrupted before anything was done\n")
    os._exit(128 + number)


if __name__ == "__main__":
    main()
